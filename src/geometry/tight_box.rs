//! Boxes around triangles that turn with them.

use crate::scene::Aabb;
use glam::{DVec3, Vec3};

/// The eight corners of a box around triangles, x changing fastest, then y: along the axes or along
/// the largest triangle and its longest edge, whichever has the smaller surface. The latter turns
/// with the triangles, so that what is fitted to a floor, a wall or a board is the same however the
/// scene lies; boxes along the axes grow around what is turned.
///
/// Scene space, metres; widened by rounding, so that no corner of a triangle is outside.
pub fn tight_box(triangles: &[[Vec3; 3]]) -> [Vec3; 8] {
    let mut bounds = Aabb::EMPTY;
    triangles.iter().flatten().for_each(|p| bounds.insert(*p));
    let upright = bounds.corners();
    let Some([x, y, z]) = axes_of_largest(triangles) else {
        return upright;
    };
    // Offsets from the middle keep their digits far from the origin.
    let middle = bounds.center().as_dvec3();
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for point in triangles.iter().flatten() {
        let q = point.as_dvec3() - middle;
        let at = DVec3::new(q.dot(x), q.dot(y), q.dot(z));
        (low, high) = (low.min(at), high.max(at));
    }
    let surface = |size: DVec3| size.x * size.y + size.y * size.z + size.z * size.x;
    // Rounding must not choose between boxes that are as good as each other.
    if surface(high - low) >= 0.999 * surface(bounds.size().as_dvec3()) {
        return upright;
    }
    let rounding =
        f64::from(f32::EPSILON) * (bounds.min.abs().max(bounds.max.abs())).as_dvec3().length();
    let (low, high) = (low - rounding, high + rounding);
    [0, 1, 2, 3, 4, 5, 6, 7].map(|i| {
        let pick = |axis: usize| {
            if i >> axis & 1 == 0 {
                low[axis]
            } else {
                high[axis]
            }
        };
        (middle + x * pick(0) + y * pick(1) + z * pick(2)).as_vec3()
    })
}

/// Unit vectors along the longest edge of the largest triangle, across it, and along its normal.
fn axes_of_largest(triangles: &[[Vec3; 3]]) -> Option<[DVec3; 3]> {
    let cross = |corners: &[Vec3; 3]| {
        let [a, b, c] = corners.map(|corner| corner.as_dvec3());
        (b - a).cross(c - a)
    };
    let larger = |a: &&[Vec3; 3], b: &&[Vec3; 3]| {
        cross(a)
            .length_squared()
            .total_cmp(&cross(b).length_squared())
    };
    let largest = triangles.iter().max_by(larger)?;
    let normal = cross(largest).try_normalize()?;
    let [a, b, c] = largest.map(|corner| corner.as_dvec3());
    let edges = [b - a, c - b, a - c];
    let longer = |a: &DVec3, b: &DVec3| a.length_squared().total_cmp(&b.length_squared());
    // A diagonal of a rectangle is no side of it: of two sides at a right angle either will do.
    let right_angle = |i: usize| {
        edges[i]
            .normalize()
            .dot(edges[(i + 2) % 3].normalize())
            .abs()
    };
    let corner = (0..3).min_by(|a, b| right_angle(*a).total_cmp(&right_angle(*b)))?;
    let along = if right_angle(corner) < 1.0e-3 {
        edges[corner]
    } else {
        edges.into_iter().max_by(longer)?
    };
    let x = along.try_normalize()?;
    let x = (x - normal * x.dot(normal)).try_normalize()?;
    Some([x, normal.cross(x), normal])
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Quat;

    fn slab() -> Vec<[Vec3; 3]> {
        let corners = Aabb {
            min: Vec3::new(-3.0, 0.0, -1.0),
            max: Vec3::new(3.0, 0.2, 1.0),
        }
        .corners();
        let quads = [
            [0, 1, 3, 2],
            [4, 5, 7, 6],
            [0, 1, 5, 4],
            [2, 3, 7, 6],
            [0, 2, 6, 4],
            [1, 3, 7, 5],
        ];
        let halves = quads
            .iter()
            .flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]);
        halves.map(|half| half.map(|i| corners[i])).collect()
    }

    fn sizes(corners: [Vec3; 8]) -> [f32; 3] {
        let mut sizes = [1, 2, 4].map(|i| (corners[i] - corners[0]).length());
        sizes.sort_by(f32::total_cmp);
        sizes
    }

    #[test]
    fn a_turned_slab_keeps_its_size() {
        let turn = Quat::from_euler(glam::EulerRot::XYZ, 0.4, 1.1, -0.7);
        let turned: Vec<_> = (slab().iter())
            .map(|t| t.map(|p| turn * p + Vec3::new(5.0, 9.0, -4.0)))
            .collect();
        for triangles in [slab(), turned] {
            let found = sizes(tight_box(&triangles));
            for (size, expected) in found.into_iter().zip([0.2, 2.0, 6.0]) {
                assert!((size - expected).abs() < 1.0e-4, "{found:?}");
            }
        }
    }

    #[test]
    fn nothing_is_outside() {
        let mut state = 7_u32;
        let mut random = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / (1 << 23) as f32 - 1.0
        };
        for _ in 0..200 {
            let far = Vec3::new(random(), random(), random());
            let point = |random: &mut dyn FnMut() -> f32| {
                far + Vec3::new(random(), 0.01 * random(), 3.0 * random())
            };
            let triangles: Vec<[Vec3; 3]> =
                (0..5).map(|_| [0; 3].map(|_| point(&mut random))).collect();
            let corners = tight_box(&triangles).map(|c| c.as_dvec3());
            for p in triangles.iter().flatten() {
                for i in [1, 2, 4] {
                    let edge = corners[i] - corners[0];
                    let at = (p.as_dvec3() - corners[0]).dot(edge) / edge.length();
                    let slack = 1.0e-3;
                    assert!(at > -slack && at < edge.length() + slack);
                }
            }
        }
        // A point and a line have no axes of their own.
        let point = [[Vec3::ONE; 3]];
        assert_eq!(tight_box(&point), [Vec3::ONE; 8]);
    }
}
