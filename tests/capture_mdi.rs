//! `mdi` against closed forms: C1 to C6 of its acceptance, one scene for each.

mod support;

use antumbra::capture::{FrameRenderer, FrameRequest};
use antumbra::light::LightShape;
use antumbra::scene::{Primitive, Scene};
use glam::Vec3;
use support::plates::{HEIGHT, SIZE, camera, floor, floor_x, plate, quad, scene};

fn square(half: f32) -> LightShape {
    LightShape::Rect {
        width: 2.0 * half,
        height: 2.0 * half,
    }
}

fn render(scene: &Scene, techniques: &[&str]) -> Vec<Vec<f32>> {
    let mut renderer = FrameRenderer::new(support::gpu(), scene).unwrap();
    let images = techniques.iter().map(|technique| {
        let request = FrameRequest {
            camera: camera(),
            size: [SIZE; 2],
            lights: vec![0],
            technique: technique.parse().unwrap(),
        };
        let frame = renderer.render(&request);
        frame.unwrap().lights.remove(0).visibility
    });
    let images = images.collect();
    support::assert_no_messages(&renderer.destroy().unwrap());
    images
}

/// A half-plane `x <= edge` (or `z <= edge`) at a depth: the part of the square of half width 1 that
/// it leaves free of a point `at` metres along that axis.
fn free(at: f32, edge: f32, depth: f32) -> f32 {
    // From the light's place s the line to `at` passes the depth at s + (at - s) depth / HEIGHT.
    let first = (edge - at * depth / HEIGHT) / (1.0 - depth / HEIGHT);
    (0.5 - 0.5 * first).clamp(0.0, 1.0)
}

/// Least and greatest of image minus truth.
fn errors(image: &[f32], truth: impl Fn(f32, f32) -> f32) -> [f32; 2] {
    let errors = image.iter().enumerate().map(|(i, v)| {
        let [x, z] = [i as u32 % SIZE, i as u32 / SIZE].map(floor_x);
        v - truth(x, z)
    });
    errors.fold([0.0, 0.0], |[a, b], e| [a.min(e), b.max(e)])
}

#[test]
fn c1_a_half_plane_is_as_wrong_as_its_bucket() {
    let _one = support::serial();
    let scene = scene(
        vec![floor(), plate("blocker", [-30.0, 0.0], [-30.0, 30.0], 5.0)],
        square(1.0),
    );
    let images = render(&scene, &["mdi:rays=36", "mdi:rays=64,buckets=128"]);
    for (image, per_side) in images.iter().zip([6.0, 8.0]) {
        let [darker, lighter] = errors(image, |x, _| free(x, 0.0, 5.0));
        println!("{darker} {lighter}");
        assert!(-darker <= 0.045 + 1.0 / per_side, "{darker}");
        assert!(lighter <= 0.01 + 1.0 / per_side, "{lighter}");
    }
}

#[test]
fn c3_level_and_slanted_receivers_are_fully_lit() {
    let _one = support::serial();
    for slope in [0.0, 0.3, 1.0, 3.0] {
        let corner = |x: f32, z: f32| Vec3::new(x, x * slope, z);
        let corners = [
            corner(-2.0, -30.0),
            corner(-2.0, 30.0),
            corner(2.0, 30.0),
            corner(2.0, -30.0),
        ];
        for buckets in [32, 64, 128] {
            let scene = scene(vec![quad("slanted", corners)], square(1.0));
            let image = &render(&scene, &[&format!("mdi:buckets={buckets}")])[0];
            let least = image.iter().copied().fold(1.0, f32::min);
            assert_eq!(least, 1.0, "slope {slope}, {buckets} buckets");
        }
    }
}

#[test]
fn c4_rays_combine_blockers() {
    let _one = support::serial();
    let wide = [-30.0, 30.0];
    let crossed = vec![
        floor(),
        plate("near", [-30.0, 0.0], wide, 3.0),
        plate("far", wide, [-30.0, 0.0], 6.0),
    ];
    let image = &render(&scene(crossed, square(1.0)), &["mdi"])[0];
    let [darker, lighter] = errors(image, |x, z| free(x, 0.0, 3.0) * free(z, 0.0, 6.0));
    println!("crossed: {darker} {lighter}");
    assert!(-darker <= 0.08 && lighter <= 0.08, "{darker} {lighter}");
    let parallel: Vec<Primitive> = vec![
        floor(),
        plate("near", [-30.0, 0.0], wide, 3.0),
        plate("far", [-30.0, 0.0], wide, 6.0),
    ];
    let image = &render(&scene(parallel, square(1.0)), &["mdi"])[0];
    let [darker, lighter] = errors(image, |x, _| free(x, 0.0, 3.0).min(free(x, 0.0, 6.0)));
    println!("parallel: {darker} {lighter}");
    assert!(-darker <= 0.08 && lighter <= 0.08, "{darker} {lighter}");
}

#[test]
fn c6_frames_repeat_to_the_bit() {
    let _one = support::serial();
    let blockers = (0..20).map(|i| {
        let x = -1.0 + 0.1 * i as f32;
        plate("bar", [x, x + 0.05], [-1.0, 1.0], 3.0 + 0.2 * i as f32)
    });
    let scene = scene(
        std::iter::once(floor()).chain(blockers).collect(),
        square(1.0),
    );
    let images = render(&scene, &["mdi", "mdi", "mdi"]);
    assert!(images[0] == images[1] && images[0] == images[2]);
    assert!(images[0].iter().any(|v| *v > 0.0 && *v < 1.0));
}
