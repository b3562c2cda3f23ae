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
            let image = &render(&scene, &[&format!("mdi:buckets={buckets},resolution=256")])[0];
            let least = image.iter().copied().fold(1.0, f32::min);
            assert_eq!(least, 1.0, "slope {slope}, {buckets} buckets");
        }
    }
}

/// Near the origin of scene space depths and places are small, but not what a view far wider than
/// the picture rounds them by: lit ground must not shadow itself.
#[cfg(feature = "cli")]
#[test]
fn ground_near_the_origin_is_lit_by_a_sun() {
    use antumbra::scene::LoadOptions;
    let _one = support::serial();
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/lights.gltf");
    let scene = Scene::load(&path, &LoadOptions::default()).unwrap();
    let light = scene.lights.iter().position(|light| light.name == "sun");
    let request = |technique: &str| FrameRequest {
        camera: scene.cameras[0].clone(),
        size: [128; 2],
        lights: vec![light.unwrap()],
        technique: technique.parse().unwrap(),
    };
    let mut renderer = FrameRenderer::new(support::gpu(), &scene).unwrap();
    let [hard, soft] = ["hard", "mdi:rays=16"].map(|technique| {
        let frame = renderer.render(&request(technique)).unwrap();
        frame.lights[0].visibility.clone()
    });
    // No umbra of a sun reaches beyond the shadow of its centre, but by a texel at edges.
    let dark = |(v, w): &(&f32, &f32)| **v == 1.0 && **w == 0.0;
    let wrong = hard.iter().zip(&soft).filter(dark).count();
    println!("{wrong} of {} pixels", hard.len());
    assert!(wrong * 500 < hard.len(), "{wrong} pixels");
    support::assert_no_messages(&renderer.destroy().unwrap());
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
    let images = render(&scene, &["mdi:resolution=512"; 3]);
    assert!(images[0] == images[1] && images[0] == images[2]);
    assert!(images[0].iter().any(|v| *v > 0.0 && *v < 1.0));
}

/// A dispatch's time counts in its own scope: the device's times make up most of a frame whose work
/// is nearly all in dispatches.
#[test]
fn times_of_passes_account_for_the_frame() {
    let _one = support::serial();
    let bar = plate("bar", [-0.5, 0.5], [-1.0, 1.0], 5.0);
    let scene = scene(vec![floor(), bar], square(1.0));
    let mut renderer = FrameRenderer::new(support::gpu(), &scene).unwrap();
    let request = FrameRequest {
        camera: camera(),
        size: [4 * SIZE; 2],
        lights: vec![0],
        technique: "mdi:resolution=512".parse().unwrap(),
    };
    let frames: Vec<_> = (0..3).map(|_| renderer.render(&request).unwrap()).collect();
    let sum = |passes: &[(String, f64)]| passes.iter().map(|(_, ms)| ms).sum::<f64>();
    for frame in &frames {
        println!(
            "{:.1} of {:.1} ms: {:?}",
            sum(&frame.passes),
            frame.frame_ms,
            frame.passes
        );
    }
    // Of the first frame shaders are compiled; times are of the frame before on some devices.
    let parts = frames[1..]
        .iter()
        .map(|frame| sum(&frame.passes) / frame.frame_ms);
    let part = parts.fold(f64::INFINITY, f64::min);
    println!("passes are {part:.3} of the frame");
    assert!(part > 0.5 && part < 1.05, "{part}");
    support::assert_no_messages(&renderer.destroy().unwrap());
}
