use super::*;
use crate::scene::Aabb;
use crate::shadow::casters::can_block;
use glam::{Vec3, Vec4};

fn light(shape: LightShape) -> AreaLight {
    AreaLight::new(shape, Vec3::new(1.0, 10.0, 2.0), Vec3::NEG_Y, Vec3::X)
}

fn cube(center: Vec3, half: f32) -> Aabb {
    Aabb {
        min: center - Vec3::splat(half),
        max: center + Vec3::splat(half),
    }
}

fn corners(boxes: &[Aabb]) -> Vec<[Vec3; 8]> {
    boxes.iter().map(Aabb::corners).collect()
}

fn views_of(shape: LightShape, boxes: &[Aabb], options: &OcclusionOptions) -> Vec<SlicedView> {
    let hulls: Vec<Vec<DVec3>> = boxes
        .iter()
        .map(|b| b.corners().map(|c| c.as_dvec3()).to_vec())
        .collect();
    let boxes = corners(boxes);
    let blocks = can_block(&light(shape), &hulls, &boxes);
    let casters = Casters {
        boxes: &boxes,
        blocks: &blocks,
    };
    sliced_views(&light(shape), &hulls, &casters, options)
}

const RECT: LightShape = LightShape::Rect {
    width: 2.0,
    height: 1.0,
};

#[test]
fn planes_invert_the_place_of_a_depth() {
    for by_inverse in [0.0, 0.5, 1.0] {
        let (near, far) = (0.7, 31.0);
        for i in 0..=20 {
            let place = f64::from(i) / 20.0;
            let z = plane_depth(near, far, by_inverse, place);
            let linear = (z - near) / (far - near);
            let back = (1.0 - by_inverse) * linear + by_inverse * linear * far / z;
            assert!((back - place).abs() < 1.0e-9, "{by_inverse} {place}: {z}");
        }
    }
}

#[test]
fn the_offset_is_the_least_that_the_lights_border_allows() {
    // z / (|x| / half - 1): 6 / (3 / 1 - 1) and 8 / (2 / 0.5 - 1).
    let points = [[3.0, 0.2, 6.0], [0.5, 2.0, 8.0], [0.9, 0.4, 1.0]];
    let d = offset_of(points.into_iter(), 1.0, 0.5, 10.0);
    assert_eq!(d, Some(8.0 / 3.0));
    // No point beside the light.
    let inside = [[0.9, 0.4, 1.0]];
    assert_eq!(offset_of(inside.into_iter(), 1.0, 0.5, 10.0), None);
}

#[test]
fn matrices_draw_where_shaders_look() {
    let boxes = [cube(Vec3::ZERO, 1.0), cube(Vec3::new(3.0, 2.0, 1.0), 0.5)];
    for projection in [
        Projection::Centered,
        Projection::Offset,
        Projection::Orthographic,
    ] {
        let options = OcclusionOptions {
            projection,
            ..OcclusionOptions::DEFAULT
        };
        let sun = LightShape::Sun {
            angular_diameter: 0.02,
        };
        for shape in [RECT, LightShape::Disk { radius: 0.3 }, sun] {
            let views = views_of(shape, &boxes, &options);
            assert_eq!(views.len(), 1, "{shape:?}");
            let view = &views[0];
            let origin = if shape.is_sun() {
                Vec3::ZERO
            } else {
                light(shape).center
            };
            for corner in boxes.iter().flat_map(|b| b.corners()) {
                let q = corner - origin;
                let dot = |row: [f32; 4]| Vec3::new(row[0], row[1], row[2]).dot(q);
                let p = &view.params;
                let z = dot(p.forward);
                let over = if p.scale[2] > 0.0 {
                    z + p.forward[3]
                } else {
                    1.0
                };
                let x = (dot(p.right) / over - p.right[3]) * p.scale[0];
                let y = (dot(p.up) / over - p.up[3]) * p.scale[1];
                let clip = view.clip_from_scene * Vec4::from((corner, 1.0));
                let ndc = clip.truncate() / clip.w;
                assert!(
                    (0.5 * ndc.x + 0.5 - x).abs() < 1.0e-5,
                    "{shape:?} {projection:?}"
                );
                assert!(
                    (0.5 * ndc.y + 0.5 - y).abs() < 1.0e-5,
                    "{shape:?} {projection:?}"
                );
                assert!(
                    ndc.z > 0.0 && ndc.z < 1.0,
                    "{shape:?} {projection:?}: {ndc}"
                );
                let depth = Vec4::from(view.depth).dot(Vec4::from((corner, 1.0)));
                assert!((depth - z).abs() < 1.0e-4);
                assert!(depth <= view.planes[view.planes.len() - 1]);
            }
        }
    }
}

#[test]
fn a_lamp_in_a_room_looks_through_the_faces_of_a_cube() {
    let room = [cube(Vec3::new(1.0, 10.0, 2.0), 3.0)];
    let sphere = LightShape::Sphere { radius: 0.1 };
    assert_eq!(views_of(sphere, &room, &OcclusionOptions::DEFAULT).len(), 6);
    // A rectangle sends nothing backwards; from behind, one view sees all that it lights.
    assert_eq!(views_of(RECT, &room, &OcclusionOptions::DEFAULT).len(), 5);
    let offset = OcclusionOptions {
        projection: Projection::Offset,
        ..OcclusionOptions::DEFAULT
    };
    assert_eq!(views_of(RECT, &room, &offset).len(), 1);
    assert!(views_of(RECT, &[], &offset).is_empty());
}
