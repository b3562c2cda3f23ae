//! Lights that nothing in view gets any light from.

use crate::light::AreaLight;
use crate::shadow::is_before;
use glam::DVec3;

/// Room for rounding in the distance at which a light's range ends, as a part of it.
const SLACK: f64 = 1.0e-4;

/// Why nothing within `receivers` (convex hulls, [`visible_hulls`](super::visible_hulls); scene space,
/// metres) gets any light from a light, blocked or not: shading need not look at it. `None` if something
/// may. What a light's cone leaves is not looked at.
pub fn unlit(light: &AreaLight, receivers: &[Vec<DVec3>]) -> Option<&'static str> {
    let color = light.color * light.candela();
    let before = |hull: &Vec<DVec3>| is_before(light, hull);
    let range = light.range.filter(|_| !light.shape.is_sun());
    let in_range = |hull: &Vec<DVec3>| {
        range.is_none_or(|range| distance(light, hull) <= f64::from(range) * (1.0 + SLACK))
    };
    if color.max_element() <= 0.0 {
        Some("its intensity is 0")
    } else if receivers.is_empty() {
        Some("no surface is in view")
    } else if !receivers.iter().any(before) {
        Some("all that is in view is behind it")
    } else if !receivers.iter().any(in_range) {
        Some("all that is in view is beyond its range")
    } else {
        None
    }
}

/// Metres from a light's centre to the box around some points, which is no more than to their hull.
fn distance(light: &AreaLight, points: &[DVec3]) -> f64 {
    let low = points.iter().copied().reduce(DVec3::min);
    let high = points.iter().copied().reduce(DVec3::max);
    let center = light.center.as_dvec3();
    match (low, high) {
        (Some(low), Some(high)) => center.clamp(low, high).distance(center),
        _ => f64::INFINITY,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::light::LightShape;
    use glam::Vec3;

    #[test]
    fn each_reason() {
        let disk = LightShape::Disk { radius: 0.5 };
        let light = AreaLight::new(disk, Vec3::Y * 4.0, Vec3::NEG_Y, Vec3::X);
        let floor: Vec<DVec3> = [[-1.0, -1.0], [-1.0, 1.0], [1.0, 1.0], [1.0, -1.0]]
            .map(|[x, z]| DVec3::new(x, 0.0, z))
            .to_vec();
        let receivers = [floor];
        let of = |light: AreaLight| unlit(&light, &receivers).unwrap_or("lit");
        assert_eq!(of(light), "lit");
        let (range, intensity) = (Some(3.9), 0.0);
        assert!(of(AreaLight { range, ..light }).contains("range"));
        let range = Some(4.1);
        assert_eq!(of(AreaLight { range, ..light }), "lit");
        assert!(of(AreaLight { intensity, ..light }).contains("intensity"));
        let direction = Vec3::Y;
        assert!(of(AreaLight { direction, ..light }).contains("behind"));
        assert!(unlit(&light, &[]).is_some_and(|reason| reason.contains("view")));
    }
}
