//! Lights get the views they need: none where nothing is seen, one where that suffices, several for a
//! lamp in a room; and the shadow is right across the seams between views.
#![cfg(feature = "cli")]

mod support;

use antumbra::capture::{CapturedFrame, FrameRenderer, FrameRequest};
use antumbra::light::{AreaLight, LightShape};
use antumbra::scene::{Aabb, LoadOptions, Material, Primitive, Scene, SceneCamera, SceneLight};
use antumbra::shadow::Technique;
use glam::{UVec2, Vec3};
use std::path::Path;

const SIZE: u32 = 96;

/// A box as twelve triangles, facing outwards.
fn cuboid(name: &str, min: Vec3, max: Vec3) -> Primitive {
    let positions = Aabb { min, max }.corners().to_vec();
    let quads = [
        [0, 2, 3, 1],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 4, 6, 2],
        [1, 3, 7, 5],
    ];
    let split = |[a, b, c, d]: [u32; 4]| [a, b, c, a, c, d];
    Primitive {
        name: name.to_string(),
        normals: vec![Vec3::Y; positions.len()],
        positions,
        indices: quads.into_iter().flat_map(split).collect(),
        ..Primitive::default()
    }
}

/// A room of 4 m with walls of 10 cm, a lamp in its middle and a beam beside the lamp.
fn room() -> Scene {
    let walls = [Vec3::X, Vec3::Y, Vec3::Z].into_iter().flat_map(|axis| {
        let inner = Vec3::splat(2.0);
        [axis, -axis].map(|side| {
            let (a, b) = (inner * side, inner * side + 0.1 * side);
            let across = (Vec3::ONE - axis) * 2.1;
            cuboid("wall", a.min(b) - across, a.max(b) + across)
        })
    });
    let lamp = AreaLight::new(LightShape::Point, Vec3::ZERO, Vec3::NEG_Y, Vec3::X);
    let mut scene = Scene {
        name: "room".to_string(),
        primitives: walls
            .chain([cuboid(
                "beam",
                Vec3::new(0.5, -0.3, -0.2),
                Vec3::new(0.6, 0.3, 0.25),
            )])
            .collect(),
        materials: vec![Material::default()],
        lights: vec![SceneLight {
            name: "lamp".to_string(),
            node: None,
            light: lamp,
        }],
        ..Scene::default()
    };
    scene.finish().unwrap();
    scene
}

/// A camera at `position` that looks along -X, +X or another unit vector across +Y.
fn camera(position: Vec3, forward: Vec3) -> SceneCamera {
    SceneCamera {
        position,
        forward,
        right: forward.cross(Vec3::Y),
        up: Vec3::Y,
        yfov: 2.0,
        znear: 0.01,
        ..SceneCamera::framing(&Aabb::EMPTY)
    }
}

fn render(scene: &Scene, camera: &SceneCamera) -> CapturedFrame {
    let _one = support::serial();
    let mut renderer = FrameRenderer::new(support::gpu(), scene).unwrap();
    let request = FrameRequest {
        camera: camera.clone(),
        size: [SIZE; 2],
        lights: vec![0],
        technique: Technique::Hard,
    };
    let frame = renderer.render(&request).unwrap();
    support::assert_no_messages(&renderer.destroy().unwrap());
    frame
}

fn map_passes(frame: &CapturedFrame) -> usize {
    let passes = frame.lights[0].passes.iter();
    passes.filter(|name| name.starts_with("hard.map")).count()
}

#[test]
fn a_lamp_in_a_room_shadows_the_wall_behind_the_beam() {
    let scene = room();
    // Wide enough to see walls in several directions from the lamp.
    let camera = camera(Vec3::new(-1.9, 0.0, 0.0), Vec3::X);
    let frame = render(&scene, &camera);
    assert!(map_passes(&frame) > 1, "{:?}", frame.lights[0].passes);
    let mut shadowed = 0;
    for (i, visibility) in frame.lights[0].visibility.iter().enumerate() {
        let pixel = UVec2::new(i as u32 % SIZE, i as u32 / SIZE);
        let ray = camera.ray(pixel, UVec2::splat(SIZE));
        // The far wall, where the ray does not meet the beam before it.
        let t = (2.0 - ray.origin.x) / ray.direction.x;
        let p = ray.origin + t * ray.direction;
        if ray.direction.x <= 0.0 || p.y.abs() > 1.99 || p.z.abs() > 1.99 {
            continue;
        }
        let at =
            |x: f32, from: Vec3, to: Vec3| from + (to - from) * ((x - from.x) / (to.x - from.x));
        let crosses = |from: Vec3, margin: f32| {
            [0.5, 0.6].iter().any(|x| {
                let q = at(*x, from, p);
                q.y.abs() < 0.3 + margin && q.z > -0.2 - margin && q.z < 0.25 + margin
            })
        };
        if crosses(ray.origin, 0.02) {
            continue;
        }
        if crosses(Vec3::ZERO, -0.005) {
            shadowed += 1;
            assert_eq!(*visibility, 0.0, "{p} is behind the beam");
        } else if !crosses(Vec3::ZERO, 0.02) {
            assert_eq!(*visibility, 1.0, "{p} sees the lamp");
        }
    }
    assert!(shadowed > 50, "{shadowed}");
}

/// The far wall and the beam are seen, nothing beside or behind the lamp.
#[test]
fn a_narrow_picture_needs_one_view() {
    let narrow = SceneCamera {
        yfov: 0.4,
        ..camera(Vec3::new(-1.9, 0.0, 0.0), Vec3::X)
    };
    assert_eq!(map_passes(&render(&room(), &narrow)), 1);
}

#[test]
fn a_picture_of_nothing_draws_no_map() {
    let frame = render(&room(), &camera(Vec3::new(5.0, 0.0, 0.0), Vec3::X));
    assert!(frame.lights[0].visibility.iter().all(|v| *v == 1.0));
    assert!(frame.color.iter().all(|texel| texel[3] == 0.0));
    assert_eq!(map_passes(&frame), 0);
    let maps = (frame.plan.resources.iter()).filter(|r| r.name.contains("map"));
    assert_eq!(maps.count(), 0);
}

#[test]
fn a_scene_without_triangles_is_all_lit() {
    let mut scene = room();
    scene.primitives.clear();
    let frame = render(&scene, &camera(Vec3::new(-1.9, 0.0, 0.0), Vec3::X));
    assert!(frame.lights[0].visibility.iter().all(|v| *v == 1.0));
}

/// The same scene 100 km from the origin and at it: equal but for where rounding moves an edge.
#[test]
fn a_scene_far_away_looks_as_it_does_at_home() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/far_away.gltf");
    let text = std::fs::read_to_string(&path).unwrap();
    let home = text.replace("[60000.0, 0.0, -80000.0]", "[0.0, 0.0, 0.0]");
    assert_ne!(text, home, "the scene stands far away");
    let options = LoadOptions::default();
    let scenes =
        [text, home].map(|text| Scene::load_slice(&path, text.as_bytes(), &options).unwrap());
    assert!(scenes[0].rebase_origin.length() > 90_000.0);
    assert!(scenes[1].rebase_origin.length() < 100.0);
    let [far, near] = scenes.each_ref().map(|scene| {
        let camera = scene.select_camera(None).unwrap();
        render(scene, &camera).lights[0].visibility.clone()
    });
    let differ = far.iter().zip(&near).filter(|(a, b)| a != b).count();
    let dark = near.iter().filter(|v| **v == 0.0).count();
    assert!(dark > 200, "{dark}");
    assert!(
        differ * 1000 <= near.len() * 2,
        "{differ} of {} pixels",
        near.len()
    );
}
