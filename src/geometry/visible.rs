//! What part of a scene a camera can see, as convex hulls.

use super::convex::{HalfSpace, box_faces, clip};
use super::cover::Cover;
use crate::scene::SceneCamera;
use glam::{DVec3, Vec3};

/// The parts of boxes, given by their corners (x changing fastest, then y), that lie in a camera's
/// frustum (without far plane), as points whose convex hull holds them; none for a box out of view.
/// What lies behind one of `covers` and is hidden by it is left out: roots below ground, a body's
/// parts that stand in a wall. Scene space, metres.
pub fn visible_hulls(
    camera: &SceneCamera,
    size: [u32; 2],
    boxes: impl IntoIterator<Item = [Vec3; 8]>,
    covers: &[Cover],
) -> Vec<Vec<DVec3>> {
    let planes = frustum(camera, size);
    let eye = camera.position.as_dvec3();
    let covers: Vec<(&Cover, HalfSpace)> = covers
        .iter()
        .filter_map(|cover| {
            let (normal, offset) = cover.behind(eye)?;
            Some((cover, HalfSpace { normal, offset }))
        })
        .collect();
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
            let in_front = |(_, plane): &(&Cover, HalfSpace)| within(plane);
            if planes.iter().all(within) && covers.iter().all(in_front) {
                return corners.to_vec();
            }
            let mut faces = box_faces(&corners);
            for plane in &planes {
                clip(&mut faces, plane);
            }
            for (cover, plane) in &covers {
                leave_out_hidden(&mut faces, cover, plane, camera);
            }
            faces.into_iter().flatten().collect::<Vec<_>>()
        })
        .filter(|points: &Vec<_>| !points.is_empty())
        .collect()
}

/// Cuts off what lies behind a cover, if all of it is hidden.
fn leave_out_hidden(
    faces: &mut Vec<Vec<DVec3>>,
    cover: &Cover,
    behind: &HalfSpace,
    camera: &SceneCamera,
) {
    let mut points = faces.iter().flatten();
    if points.all(|p| behind.distance(*p) <= 0.0) {
        return;
    }
    let mut hidden = faces.clone();
    let other_side = HalfSpace {
        normal: -behind.normal,
        offset: -behind.offset,
    };
    clip(&mut hidden, &other_side);
    let eye = camera.position.as_dvec3();
    let forward = camera.forward.as_dvec3();
    let near = f64::from(camera.znear);
    // Points at the plane itself are as far behind it as rounding allows.
    let mut points = hidden.iter().flatten();
    if points.all(|p| cover.hides(*p, eye, forward, near)) {
        clip(faces, behind);
    }
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
        let hulls = visible_hulls(
            &camera(),
            [64, 64],
            [inside, behind].map(|b| b.corners()),
            &[],
        );
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
        let hulls = visible_hulls(&camera(), [64, 64], [floor.corners()], &[]);
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

    #[test]
    fn what_a_floor_hides_is_left_out() {
        let floor = [[-3.0, -3.0], [3.0, -3.0], [3.0, 3.0], [-3.0, 3.0]].map(|[x, z]| {
            // Seen from above and in front.
            Vec3::new(x, -1.0, z)
        });
        let cover = Cover::of(&[
            [floor[0], floor[1], floor[2]],
            [floor[0], floor[2], floor[3]],
        ]);
        let post = |x: f32| {
            let (min, max) = (Vec3::new(x, -1.5, -0.1), Vec3::new(x + 0.2, 0.5, 0.1));
            Aabb { min, max }.corners()
        };
        let hulls = visible_hulls(
            &camera(),
            [64, 64],
            [post(0.0), post(3.5)],
            cover.as_slice(),
        );
        let lowest = |points: &Vec<DVec3>| points.iter().map(|p| p.y).fold(f64::INFINITY, f64::min);
        assert!(
            (lowest(&hulls[0]) + 1.0).abs() < 1.0e-4,
            "{}",
            lowest(&hulls[0])
        );
        // One beside the floor shows all of itself.
        assert!((lowest(&hulls[1]) + 1.5).abs() < 1.0e-6);
    }
}
