//! `oess` on meshes that are no closed, orderly surfaces, against rays.

mod support;

use antumbra::capture::FrameRequest;
use antumbra::light::LightShape;
use antumbra::reference::{Reference, Sampling, Settings};
use antumbra::scene::{Primitive, Scene, SceneCamera};
use antumbra::stress::{Case, SCALES, Similarity, cases};
use glam::{DQuat, DVec3, EulerRot, Vec3};
use support::plates::{camera, floor, quad, scene};
use support::rig::with_renderer;

const SIDE: u32 = 64;

/// Errors of a picture of a scene's first light.
#[derive(Debug)]
struct Errors {
    /// Valid pixels.
    pixels: usize,
    worst: f32,
}

fn errors(scene: &Scene, camera: &SceneCamera, technique: &str) -> Errors {
    let request = FrameRequest {
        camera: camera.clone(),
        size: [SIDE; 2],
        lights: vec![0],
        technique: technique.parse().unwrap(),
    };
    let frame = with_renderer(scene, |renderer| renderer.render(&request).unwrap());
    let settings = Settings {
        camera,
        size: [SIDE; 2],
        light: &scene.lights[0].light,
        sampling: &Sampling::samples(1024),
    };
    let truth = Reference::new(scene).unwrap();
    let truth = truth.render(&settings, &|_| ()).unwrap();
    let found = &frame.lights[0].visibility;
    let valid = (0..found.len()).filter(|i| truth.valid[*i]);
    let errors = valid.map(|i| (found[i] - truth.visibility[i]).abs());
    let errors: Vec<f32> = errors.collect();
    Errors {
        pixels: errors.len(),
        worst: errors.iter().copied().fold(0.0, f32::max),
    }
}

/// A scene in other sizes, turned, moved and mirrored.
fn guises(case: &Case) -> Vec<Case> {
    let turned = Similarity {
        turn: DQuat::from_euler(EulerRot::YXZ, 0.7, 1.9, -0.4),
        shift: DVec3::new(9.0, -4.0, 7.0),
        ..Similarity::IDENTITY
    };
    let scaled = SCALES.map(|scale| case.seen_as(&Similarity::scaled(scale)));
    let others = [case.clone(), case.seen_as(&turned), case.mirrored()];
    others.into_iter().chain(scaled).collect()
}

/// Vertices within edges, a cage of hundreds of holes, and triangles without area, whose edges lie on each other
/// but for rounding.
#[test]
fn meshes_of_all_sorts() {
    let _one = support::serial();
    let is_line = |case: &Case| matches!(case.area_light().shape, LightShape::Line { .. });
    let cases: Vec<Case> = cases().into_iter().filter(is_line).collect();
    assert!(cases.iter().any(|case| case.name == "no-area"));
    for case in cases {
        for guise in guises(&case) {
            assert_eq!(guise.light, 0);
            let found = errors(&guise.scene, &guise.camera, "oess");
            println!("{}: {found:?}", guise.name);
            assert!(found.pixels > 2000, "{}: {found:?}", guise.name);
            assert!(found.worst <= 0.006, "{}: {found:?}", guise.name);
        }
    }
}

/// Three leaves to one side of an edge and one to the other: no outline, but two surfaces more are before the
/// light on one side of it.
#[test]
fn an_edge_of_four_faces() {
    let _one = support::serial();
    let leaf = |x: f32, y: f32| {
        let corners = [[0.0, 5.0, -2.0], [0.0, 5.0, 2.0], [x, y, 2.0], [x, y, -2.0]];
        quad("leaf", corners.map(Vec3::from))
    };
    let leaves = [(-0.3, 5.0), (0.5, 5.2), (0.35, 5.0), (0.4, 4.8)];
    let leaves = leaves.map(|(x, y)| leaf(x, y));
    let all: Vec<Primitive> = std::iter::once(floor()).chain(leaves).collect();
    let line = LightShape::Line { length: 2.0 };
    let found = errors(&scene(all, line), &camera(), "oess");
    println!("{found:?}");
    assert!(found.worst <= 0.005, "{found:?}");
}
