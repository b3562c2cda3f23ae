//! Which parts of the scene can stand between a light and what the picture shows.

use crate::geometry::SceneBuffers;
use crate::light::{AreaLight, LightShape};
use glam::{DVec3, Vec3};
use std::rc::Rc;

/// Rounding of coordinates that are held in 32 bits, as a part of them, with what boxes around
/// triangles add to it.
const ROUNDING: f64 = 4.0e-6;

/// [`can_block`] for each of a scene's draws.
pub fn casters(light: &AreaLight, receivers: &[Vec<DVec3>], scene: &SceneBuffers) -> Rc<[bool]> {
    let boxes: Vec<_> = scene.draws().iter().map(|draw| draw.corners).collect();
    can_block(light, receivers, &boxes).into()
}

/// For each box (eight corners in scene space, metres, x changing fastest, then y) whether what is in
/// it can block any part of the light from any point of the receivers' convex hulls. It cannot where
/// the light and all receivers lie on the outer side of a face of the box: neither does flat ground
/// shadow itself or what stands on it, nor a wall the room that it closes. And nothing can where there
/// are no receivers, or all are behind the light.
///
/// Never wrong about what it rules out; what it leaves may still block nothing.
pub(super) fn can_block(
    light: &AreaLight,
    receivers: &[Vec<DVec3>],
    boxes: &[[Vec3; 8]],
) -> Vec<bool> {
    if !receivers.iter().any(|hull| is_before(light, hull)) {
        return vec![false; boxes.len()];
    }
    let largest = |corners: &[Vec3; 8]| {
        corners
            .iter()
            .map(|c| c.abs().max_element())
            .fold(0.0, f32::max)
    };
    let finite = boxes.iter().map(largest).filter(|size| size.is_finite());
    let slack = ROUNDING * f64::from(finite.fold(0.0, f32::max));
    boxes
        .iter()
        .map(|corners| {
            let corners = corners.map(|corner| corner.as_dvec3());
            !outer_faces(&corners).into_iter().any(|(normal, offset)| {
                light_is_beyond(light, normal, offset - slack)
                    && receivers
                        .iter()
                        .flatten()
                        .all(|p| normal.dot(*p) >= offset - slack)
            })
        })
        .collect()
}

/// Whether any point of a hull is where the light shines: a disk or rectangle gives none behind its plane.
pub(crate) fn is_before(light: &AreaLight, hull: &[DVec3]) -> bool {
    let front = |p: &DVec3| (*p - light.center.as_dvec3()).dot(light.direction.as_dvec3()) > 0.0;
    !light.shape.is_one_sided() || hull.iter().any(front)
}

/// Outward normals of a box's faces, and the offsets of their planes; of a flat box, both sides, and planes at
/// right angles through its rim.
fn outer_faces(corners: &[DVec3; 8]) -> Vec<(DVec3, f64)> {
    let edges = [1, 2, 4].map(|i| corners[i] - corners[0]);
    let mut faces = Vec::with_capacity(6);
    for axis in 0..3 {
        let others = [edges[(axis + 1) % 3], edges[(axis + 2) % 3]];
        let across = others[0].cross(others[1]).try_normalize();
        let Some(normal) = across.or_else(|| aside(edges[axis], others)) else {
            continue;
        };
        for normal in [normal, -normal] {
            let offset = corners
                .iter()
                .map(|c| normal.dot(*c))
                .fold(f64::NEG_INFINITY, f64::max);
            faces.push((normal, offset));
        }
    }
    faces
}

/// The direction of an edge that is at right angles to two others, of which one at least has no length.
fn aside(edge: DVec3, others: [DVec3; 2]) -> Option<DVec3> {
    let along = others.into_iter().find_map(DVec3::try_normalize);
    let rest = along.map_or(edge, |along| edge - edge.dot(along) * along);
    rest.try_normalize()
}

/// Whether all of a light is above every surface in view, so that none hides any of it from itself: where all
/// receivers' hulls are flat and have light and eye on one side. False where that is not certain.
pub(crate) fn is_above_all(light: &AreaLight, receivers: &[Vec<DVec3>], eye: DVec3) -> bool {
    receivers.iter().all(|hull| {
        let Some((normal, offset)) = plane_of(hull) else {
            return false;
        };
        let side = (normal.dot(eye) - offset).signum();
        let clearance = light_clearance(light, side * normal, side * offset);
        let scale = match light.shape {
            LightShape::Sun { .. } => 1.0,
            _ => (hull.iter())
                .map(|p| p.distance(light.center.as_dvec3()))
                .fold(0.0, f64::max),
        };
        clearance > CLEARANCE * scale
    })
}

/// Least clearance of a light above a plane, as a part of the distance: shaders find all of it above then.
const CLEARANCE: f64 = 1.0e-3;

/// The plane that a hull lies in: its unit normal and offset. `None` for one that is not flat, or is but a line.
fn plane_of(hull: &[DVec3]) -> Option<(DVec3, f64)> {
    let first = *hull.first()?;
    let largest = |from: &dyn Fn(DVec3) -> DVec3| {
        let all = hull.iter().map(|p| from(*p - first));
        all.max_by(|a, b| a.length_squared().total_cmp(&b.length_squared()))
    };
    let along = largest(&|p| p)?;
    let across = largest(&|p| along.cross(p))?;
    if across.length() <= FLAT * along.length_squared() {
        return None;
    }
    let normal = across.try_normalize()?;
    let height = |p: &DVec3| normal.dot(*p - first).abs();
    let size = hull
        .iter()
        .map(|p| p.abs().max_element())
        .fold(0.0, f64::max);
    let flat = hull.iter().all(|p| height(p) <= ROUNDING * size);
    flat.then(|| (normal, normal.dot(first)))
}

/// Least width of a hull that has a plane, as a part of its length.
const FLAT: f64 = 1.0e-3;

/// Whether all of a light lies where `normal` . p >= `offset`; of a sun, whether its directions do
/// not lead back from there.
fn light_is_beyond(light: &AreaLight, normal: DVec3, offset: f64) -> bool {
    light_clearance(light, normal, offset) >= 0.0
}

/// How far all of a light lies beyond where `normal` . p = `offset`, metres; of a sun, by how much the sine of the
/// angle between its directions and the plane is above 0.
fn light_clearance(light: &AreaLight, normal: DVec3, offset: f64) -> f64 {
    let [x, y] = [light.axis_x, light.axis_y].map(|axis| normal.dot(axis.as_dvec3()));
    let reach = match light.shape {
        LightShape::Sun { angular_diameter } => {
            let towards = -light.direction.as_dvec3();
            return normal.dot(towards) - (0.5 * f64::from(angular_diameter)).sin();
        }
        LightShape::Rect { width, height } => {
            0.5 * (f64::from(width) * x.abs() + f64::from(height) * y.abs())
        }
        LightShape::Disk { radius } => f64::from(radius) * x.hypot(y),
        _ => f64::from(light.shape.bounding_radius()),
    };
    normal.dot(light.center.as_dvec3()) - reach - offset
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Aabb;

    fn boxed(low: [f32; 3], high: [f32; 3]) -> [Vec3; 8] {
        let (min, max) = (low.into(), high.into());
        Aabb { min, max }.corners()
    }

    fn hull(corners: &[Vec3; 8]) -> Vec<DVec3> {
        corners.iter().map(|c| c.as_dvec3()).collect()
    }

    fn light(shape: LightShape, center: [f32; 3]) -> AreaLight {
        AreaLight::new(shape, center.into(), Vec3::NEG_Y, Vec3::X)
    }

    #[test]
    fn lights_are_above_flat_ground_alone() {
        let disk = LightShape::Disk { radius: 0.5 };
        let ground = hull(&boxed([-10.0, 1.0, -10.0], [10.0, 1.0, 10.0]));
        let body = hull(&boxed([-1.0, 1.0, -1.0], [1.0, 2.0, 1.0]));
        let above = |center, receivers: &[Vec<DVec3>], eye: [f64; 3]| {
            is_above_all(&light(disk, center), receivers, eye.into())
        };
        let eye = [3.0, 5.0, 0.0];
        assert!(above([0.0, 4.0, 0.0], std::slice::from_ref(&ground), eye));
        assert!(!above([0.0, 1.0, 0.0], std::slice::from_ref(&ground), eye));
        assert!(!above([0.0, -4.0, 0.0], std::slice::from_ref(&ground), eye));
        // Seen from below.
        assert!(!above(
            [0.0, 4.0, 0.0],
            std::slice::from_ref(&ground),
            [0.0; 3]
        ));
        assert!(above(
            [0.0, -4.0, 0.0],
            std::slice::from_ref(&ground),
            [0.0; 3]
        ));
        assert!(!above([0.0, 4.0, 0.0], &[ground.clone(), body], eye));
        // A wall that the light is level with.
        let wall = hull(&boxed([0.0, 1.0, -10.0], [0.0, 9.0, 10.0]));
        assert!(!above([0.0, 4.0, 0.0], &[ground, wall], eye));
        let sun = |degrees: f32| {
            let angular_diameter = degrees.to_radians();
            let wall = [hull(&boxed([0.0, 1.0, -10.0], [0.0, 9.0, 10.0]))];
            let mut light = light(LightShape::Sun { angular_diameter }, [0.0; 3]);
            light.direction = Vec3::new(-0.1, -1.0, 0.0).normalize();
            is_above_all(&light, &wall, DVec3::X)
        };
        assert!(sun(2.0) && !sun(12.0));
    }

    #[test]
    fn flat_ground_blocks_nothing_above_it() {
        let ground = boxed([-10.0, 1.0, -10.0], [10.0, 1.0, 10.0]);
        let body = boxed([-1.0, 1.0, -1.0], [1.0, 2.0, 1.0]);
        let receivers = [hull(&ground), hull(&body)];
        let sun = LightShape::Sun {
            angular_diameter: 0.5,
        };
        for shape in [
            LightShape::Disk { radius: 2.0 },
            LightShape::Sphere { radius: 2.0 },
            sun,
        ] {
            let light = light(shape, [0.0, 4.0, 0.0]);
            assert_eq!(
                can_block(&light, &receivers, &[ground, body]),
                [false, true]
            );
        }
        // A light that reaches below it, and something below it, are both reasons.
        let low = light(LightShape::Sphere { radius: 4.0 }, [0.0, 4.0, 0.0]);
        assert_eq!(can_block(&low, &receivers, &[ground]), [true]);
        let cellar = boxed([0.0, 0.0, 0.0], [0.1, 0.5, 0.1]);
        let disk = light(LightShape::Disk { radius: 2.0 }, [0.0, 4.0, 0.0]);
        let with_cellar = [hull(&ground), hull(&cellar)];
        assert_eq!(can_block(&disk, &with_cellar, &[ground]), [true]);
    }

    #[test]
    fn nothing_blocks_for_nobody() {
        let body = boxed([-1.0, 1.0, -1.0], [1.0, 2.0, 1.0]);
        let disk = light(LightShape::Disk { radius: 2.0 }, [0.0, 4.0, 0.0]);
        let block =
            |light: &AreaLight, receivers: &[Vec<DVec3>]| can_block(light, receivers, &[body]);
        assert_eq!(block(&disk, &[hull(&body)]), [true]);
        assert_eq!(block(&disk, &[]), [false]);
        let above = hull(&boxed([-1.0, 5.0, -1.0], [1.0, 6.0, 1.0]));
        assert_eq!(block(&disk, std::slice::from_ref(&above)), [false]);
        // A sphere shines there too.
        let sphere = light(LightShape::Sphere { radius: 2.5 }, [0.0, 4.0, 0.0]);
        assert_eq!(block(&sphere, &[above]), [true]);
    }

    #[test]
    fn what_stands_aside_shadows_nothing_however_flat() {
        let ground = boxed([-1.0, 0.0, -1.0], [1.0, 0.0, 1.0]);
        let sheets = [
            boxed([5.0, 2.0, -1.0], [6.0, 2.0, 1.0]),
            boxed([5.0, 0.0, -1.0], [5.0, 2.0, 1.0]),
            boxed([-1.0, 2.0, 5.0], [1.0, 2.0, 6.0]),
            boxed([-1.0, 2.0, 5.0], [1.0, 2.0, 5.0]),
            boxed([0.5, 2.0, -1.0], [6.0, 2.0, 1.0]),
        ];
        let disk = light(LightShape::Disk { radius: 0.5 }, [0.0, 4.0, 0.0]);
        // A line has no sides that could tell where it is.
        assert_eq!(
            can_block(&disk, &[hull(&ground)], &sheets),
            [false, false, false, true, true]
        );
        // Sheets that are turned are no exception.
        let turn = glam::Quat::from_rotation_y(0.4) * glam::Quat::from_rotation_x(0.3);
        let turned = sheets.map(|corners| corners.map(|corner| turn * corner));
        let center = turn * disk.center;
        let turned_light = AreaLight::new(disk.shape, center, turn * Vec3::NEG_Y, turn * Vec3::X);
        let ground = ground.map(|corner| turn * corner);
        assert_eq!(
            can_block(&turned_light, &[hull(&ground)], &turned),
            [false, false, false, true, true]
        );
    }

    #[test]
    fn walls_do_not_shadow_their_room() {
        let wall = boxed([5.0, 0.0, -5.0], [5.0, 3.0, 5.0]);
        let screen = boxed([2.0, 0.0, -1.0], [2.0, 2.0, 1.0]);
        let thick = boxed([5.0, 0.0, -5.0], [5.5, 3.0, 5.0]);
        let receivers = [hull(&wall), hull(&screen)];
        let lamp = light(LightShape::Sphere { radius: 0.5 }, [0.0, 2.0, 0.0]);
        let boxes = [wall, screen, thick];
        assert_eq!(can_block(&lamp, &receivers, &boxes), [false, true, false]);
    }
}
