//! Every pixel's error against its bound, on all scenes.

use super::{SIZE, bounded, load, render};
use antumbra::reference::{Reference, Sampling, Settings};

const SCENES: [&str; 13] = [
    "blockers.gltf",
    "comb.gltf",
    "far_away.gltf",
    "fences.gltf",
    "figure.glb",
    "foliage.glb",
    "lights.gltf",
    "mirrored.gltf",
    "poles.gltf",
    "room.glb",
    "sphere_over_plane.gltf",
    "sun_court.glb",
    "tube.gltf",
];

/// No pixel is off by more than its bound and four standard errors of a truth of 4096 samples. Those are
/// spread more evenly than at random, so that their error is below the one taken here.
fn check(name: &str, samples: u32, technique: &str) {
    let scene = load(name);
    let camera = scene.select_camera(None).unwrap();
    let reference = Reference::new(&scene).unwrap();
    let (_, surfaces) = &render(&scene, &camera, &["hard"])[0];
    for (at, light) in scene.lights.iter().enumerate() {
        let (seen, bound) = bounded(&scene, &camera, at, technique);
        let settings = Settings {
            camera: &camera,
            size: SIZE,
            light: &light.light,
            sampling: &Sampling::samples(samples),
        };
        let truth = reference.render(&settings, &|_| {}).unwrap();
        let (mut pixels, mut worst, mut wide) = (0, f32::MIN, 0.0f32);
        for i in (0..seen.len()).filter(|i| truth.valid[*i]) {
            let pixel = glam::UVec2::new(i as u32 % SIZE[0], i as u32 / SIZE[0]);
            let met = reference.surface(&camera, SIZE, pixel).unwrap();
            if surfaces.is_other(i, &met) {
                continue;
            }
            let v = truth.visibility[i];
            let standard_error = (v * (1.0 - v) / samples as f32).sqrt();
            let over = (seen[i] - v).abs() - bound[i] - 4.0 * standard_error;
            pixels += 1;
            worst = worst.max(over);
            wide = wide.max(bound[i]);
            assert!(
                over <= 1.0 / samples as f32,
                "{name}, `{}`, {technique}, pixel {i}: {} instead of {v}, bound {}",
                light.name,
                seen[i],
                bound[i]
            );
        }
        println!(
            "{name}, `{}`, {technique}: {pixels} pixels, at most {worst:.4} over, largest bound {wide:.3}",
            light.name
        );
        assert!(pixels > 1000, "{name}: there is something to measure");
    }
}

/// Takes minutes.
#[test]
#[ignore = "billions of rays: cargo test --release --test capture_shaft -- --ignored"]
fn no_bound_is_exceeded_on_any_scene() {
    let _one = super::support::serial();
    for name in SCENES {
        check(name, 4096, "shaft-masks");
        check(name, 4096, "shaft-masks:target-error=none");
    }
}

#[test]
fn no_bound_is_exceeded_on_two_scenes() {
    let _one = super::support::serial();
    check("comb.gltf", 1024, "shaft-masks");
    check("mirrored.gltf", 1024, "shaft-masks:target-error=none");
}
