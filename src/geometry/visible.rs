//! What part of a scene a camera can see, as convex hulls.

use crate::scene::SceneCamera;
use glam::{DVec3, Vec3};

/// A half-space: points with `dot(normal, p) <= offset`.
#[derive(Clone, Copy, Debug)]
struct HalfSpace {
    normal: DVec3,
    offset: f64,
}

impl HalfSpace {
    fn distance(&self, point: DVec3) -> f64 {
        self.normal.dot(point) - self.offset
    }
}

/// The parts of boxes, given by their corners (x changing fastest, then y), that lie in a camera's
/// frustum (without far plane), as points whose convex hull holds them; none for a box out of view.
/// Scene space, metres.
pub fn visible_hulls(
    camera: &SceneCamera,
    size: [u32; 2],
    boxes: impl IntoIterator<Item = [Vec3; 8]>,
) -> Vec<Vec<DVec3>> {
    let planes = frustum(camera, size);
    boxes
        .into_iter()
        .filter(|corners| corners.iter().all(|corner| corner.is_finite()))
        .map(|corners| {
            // Most boxes of a scene are wholly in view or wholly out of it.
            let corners = corners.map(|corner| corner.as_dvec3());
            let beyond = |plane: &HalfSpace| corners.iter().all(|c| plane.distance(*c) > 0.0);
            let within = |plane: &HalfSpace| corners.iter().all(|c| plane.distance(*c) <= 0.0);
            if planes.iter().any(beyond) {
                return Vec::new();
            }
            if planes.iter().all(within) {
                return corners.to_vec();
            }
            let mut faces = box_faces(&corners);
            for plane in &planes {
                clip(&mut faces, plane);
            }
            faces.into_iter().flatten().collect::<Vec<_>>()
        })
        .filter(|points: &Vec<_>| !points.is_empty())
        .collect()
}

/// The four sides and the near plane, a pixel wider than the picture on each side.
fn frustum(camera: &SceneCamera, size: [u32; 2]) -> [HalfSpace; 5] {
    let [width, height] = size.map(f64::from);
    let pixel = 2.0 * camera.tan_half_fov() / height;
    let (x, y) = (pixel * (0.5 * width + 1.0), pixel * (0.5 * height + 1.0));
    let [right, up, forward] = [camera.right, camera.up, camera.forward].map(|v| v.as_dvec3());
    let eye = camera.position.as_dvec3();
    let side = |normal: DVec3| HalfSpace {
        normal,
        offset: normal.dot(eye),
    };
    [
        side(right - forward * x),
        side(-right - forward * x),
        side(up - forward * y),
        side(-up - forward * y),
        HalfSpace {
            normal: -forward,
            offset: -forward.dot(eye) - f64::from(camera.znear),
        },
    ]
}

/// The six faces of a box as polygons.
fn box_faces(corners: &[DVec3; 8]) -> Vec<Vec<DVec3>> {
    let faces = [
        [0, 1, 3, 2],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 3, 7, 6],
        [0, 2, 6, 4],
        [1, 3, 7, 5],
    ];
    faces.map(|face| face.map(|i| corners[i]).to_vec()).to_vec()
}

/// Cuts a convex polyhedron, given by its faces, by a half-space, and closes the cut. Only the hull
/// of the result counts, so the points of the cut need no order.
fn clip(faces: &mut Vec<Vec<DVec3>>, plane: &HalfSpace) {
    let mut cut = Vec::new();
    for face in faces.iter_mut() {
        let mut kept = Vec::with_capacity(face.len() + 1);
        for (i, &from) in face.iter().enumerate() {
            let to = face[(i + 1) % face.len()];
            let (a, b) = (plane.distance(from), plane.distance(to));
            if a <= 0.0 {
                kept.push(from);
            }
            if (a < 0.0 && b > 0.0) || (a > 0.0 && b < 0.0) {
                let point = from + (to - from) * (a / (a - b));
                kept.push(point);
                cut.push(point);
            }
        }
        *face = kept;
    }
    faces.retain(|face| !face.is_empty());
    if let Some(closing) = in_order(cut, plane.normal) {
        faces.push(closing);
    }
}

/// Points of a convex polygon across `normal`, sorted around their middle.
fn in_order(mut points: Vec<DVec3>, normal: DVec3) -> Option<Vec<DVec3>> {
    if points.len() < 3 {
        return None;
    }
    let middle = points.iter().sum::<DVec3>() / points.len() as f64;
    let x = normal.normalize_or(DVec3::Z).any_orthonormal_vector();
    let y = normal.normalize_or(DVec3::Z).cross(x);
    let angle = |p: &DVec3| (*p - middle).dot(y).atan2((*p - middle).dot(x));
    points.sort_by(|a, b| angle(a).total_cmp(&angle(b)));
    Some(points)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Aabb;

    fn camera() -> SceneCamera {
        SceneCamera {
            position: Vec3::new(0.0, 0.0, 5.0),
            right: Vec3::X,
            up: Vec3::Y,
            forward: Vec3::NEG_Z,
            yfov: std::f32::consts::FRAC_PI_2,
            znear: 0.1,
            ..SceneCamera::framing(&Aabb::EMPTY)
        }
    }

    #[test]
    fn a_box_in_view_stays_and_one_out_of_view_goes() {
        let inside = Aabb {
            min: Vec3::splat(-0.5),
            max: Vec3::splat(0.5),
        };
        let behind = Aabb {
            min: Vec3::new(-1.0, -1.0, 6.0),
            max: Vec3::new(1.0, 1.0, 8.0),
        };
        let hulls = visible_hulls(&camera(), [64, 64], [inside, behind].map(|b| b.corners()));
        assert_eq!(hulls.len(), 1);
        for corner in inside.corners() {
            assert!(hulls[0].contains(&corner.as_dvec3()));
        }
    }

    /// Points of the clipped hull lie in box and frustum, and reach every extreme that sampled
    /// points of both reach.
    #[test]
    fn a_wide_floor_is_cut_to_what_is_seen() {
        let floor = Aabb {
            min: Vec3::new(-100.0, -1.2, -100.0),
            max: Vec3::new(100.0, -1.0, 100.0),
        };
        let hulls = visible_hulls(&camera(), [64, 64], [floor.corners()]);
        let points = &hulls[0];
        let planes = frustum(&camera(), [64, 64]);
        for point in points {
            assert!(planes.iter().all(|plane| plane.distance(*point) < 1.0e-9));
            assert!(point.y > -1.2001 && point.y < -0.9999);
        }
        let sample = (0..100_000).map(|i| {
            let (i, j, k) = (i % 100, i / 100 % 100, i / 10_000);
            let x = -100.0 + 2.0 * f64::from(i);
            let z = -100.0 + 2.0 * f64::from(j);
            DVec3::new(x, -1.2 + 0.2 * f64::from(k) / 9.0, z)
        });
        let seen = sample.filter(|p| planes.iter().all(|plane| plane.distance(*p) <= 0.0));
        let seen: Vec<DVec3> = seen.collect();
        assert!(seen.len() > 100);
        for direction in [DVec3::X, DVec3::NEG_X, DVec3::Z, DVec3::NEG_Z, DVec3::ONE] {
            let reach = |points: &[DVec3]| {
                let along = points.iter().map(|p| p.dot(direction));
                along.fold(f64::NEG_INFINITY, f64::max)
            };
            assert!(reach(points) >= reach(&seen) - 1.0e-9);
        }
    }
}
