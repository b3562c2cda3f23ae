//! `hard` against the exact shadow of the light's centre, cast ray by ray on the CPU, on every scene
//! of `assets/`.
#![cfg(feature = "cli")]

mod support;

use antumbra::capture::{FrameRenderer, FrameRequest};
use antumbra::reference::{Reference, Sampling, Settings};
use antumbra::scene::{LoadOptions, Scene, SceneCamera};
use antumbra::shadow::Technique;
use std::path::{Path, PathBuf};

const SIZE: [u32; 2] = [512; 2];

/// Least part of the valid pixels that must be right: where a texel's width of edge is a large share
/// of the picture, it is less.
fn least_right(name: &str) -> f64 {
    match name {
        "fences.gltf" | "foliage.glb" => 0.98,
        _ => 0.995,
    }
}

/// Whether the truth changes within `reach` pixels of one.
fn near_an_edge(truth: &[f32], pixel: usize, reach: i64) -> bool {
    let [width, height] = SIZE.map(i64::from);
    let (x, y) = (pixel as i64 % width, pixel as i64 / width);
    let around = (-reach..=reach).flat_map(|dy| (-reach..=reach).map(move |dx| (x + dx, y + dy)));
    around
        .filter(|(x, y)| (0..width).contains(x) && (0..height).contains(y))
        .any(|(x, y)| truth[(y * width + x) as usize] != truth[pixel])
}

/// Of each pixel, whether it can be compared and whether it sees the light's centre: 2 and 1 added up.
///
/// The same for every driver: where `ANTUMBRA_TEST_TRUTH` names a folder, it is kept there. Whoever sets
/// that begins with an empty folder, or a fault of the reference would go unseen.
fn truth(scene: &Scene, camera: &SceneCamera, light: usize, name: &str) -> Vec<u8> {
    let folder = std::env::var_os("ANTUMBRA_TEST_TRUTH").map(PathBuf::from);
    let file = folder.map(|folder| folder.join(format!("{name}.{light}")));
    let pixels = (SIZE[0] * SIZE[1]) as usize;
    if let Some(kept) = file.as_ref().and_then(|file| std::fs::read(file).ok()) {
        assert_eq!(kept.len(), pixels, "{file:?}");
        return kept;
    }
    let reference = Reference::new(scene).unwrap();
    let light = &scene.lights[light].light;
    let settings = Settings {
        camera,
        size: SIZE,
        light,
        sampling: &Sampling::Plain { samples: 1 },
    };
    let valid = reference.render(&settings, &|_| {}).unwrap().valid;
    let center = reference.center_visibility(camera, SIZE, light).unwrap();
    let pairs = valid.iter().zip(center);
    let cast = pairs.map(|(valid, v)| 2 * u8::from(*valid) + u8::from(v == 1.0));
    let cast: Vec<u8> = cast.collect();
    if let Some(file) = file {
        let aside = file.with_extension(std::process::id().to_string());
        std::fs::write(&aside, &cast).unwrap();
        std::fs::rename(aside, file).unwrap();
    }
    cast
}

fn check(name: &str) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("assets")
        .join(name);
    let scene = Scene::load(&path, &LoadOptions::default()).unwrap();
    let camera = scene.select_camera(None).unwrap();
    let request = FrameRequest {
        camera: camera.clone(),
        size: SIZE,
        lights: (0..scene.lights.len()).collect(),
        technique: Technique::Hard,
    };
    let mut renderer = FrameRenderer::new(support::gpu(), &scene).unwrap();
    let frame = renderer.render(&request).unwrap();
    support::assert_no_messages(&renderer.destroy().unwrap());
    for (index, (captured, scene_light)) in frame.lights.iter().zip(&scene.lights).enumerate() {
        let cast = truth(&scene, &camera, index, name);
        let truth: Vec<f32> = cast.iter().map(|pixel| f32::from(pixel & 1)).collect();
        let pixels = (0..truth.len()).filter(|pixel| cast[*pixel] & 2 != 0);
        let (mut count, mut dark, mut wrong) = (0, 0, Vec::new());
        for pixel in pixels {
            count += 1;
            dark += usize::from(truth[pixel] == 0.0);
            if truth[pixel] != captured.visibility[pixel] {
                wrong.push(pixel);
            }
        }
        let stray = wrong
            .iter()
            .filter(|p| !near_an_edge(&truth, **p, 2))
            .count();
        let right = 1.0 - wrong.len() as f64 / f64::from(count.max(1));
        let title = format!("{name}, light `{}`", scene_light.name);
        println!(
            "{title}: {:.3} % of {count} valid pixels right, {dark} in shadow, {} wrong, {stray} of \
             them more than 2 pixels from a shadow's edge",
            100.0 * right,
            wrong.len()
        );
        assert!(count > 20_000, "{title}: there is something to measure");
        assert!(right >= least_right(name), "{title}: {right}");
        // A pixel at the rim of a cut-out may show another surface than the ray through its centre
        // meets, and have that one's shadow.
        let few = 0.05 * wrong.len() as f64 + 1.0e-4 * f64::from(count);
        assert!(
            stray as f64 <= few,
            "{title}: {stray} of {} wrong pixels",
            wrong.len()
        );
    }
}

macro_rules! scenes {
    ($($test:ident: $file:literal,)*) => {
        $(#[test]
        fn $test() {
            let _one = support::serial();
            check($file);
        })*

        #[test]
        fn every_scene_is_here() {
            let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets");
            for entry in std::fs::read_dir(folder).unwrap() {
                let name = entry.unwrap().file_name().into_string().unwrap();
                if name.ends_with(".gltf") || name.ends_with(".glb") {
                    assert!([$($file),*].contains(&name.as_str()), "{name}");
                }
            }
        }
    };
}

scenes! {
    blockers: "blockers.gltf",
    comb: "comb.gltf",
    far_away: "far_away.gltf",
    fences: "fences.gltf",
    figure: "figure.glb",
    foliage: "foliage.glb",
    lights: "lights.gltf",
    mirrored: "mirrored.gltf",
    poles: "poles.gltf",
    room: "room.glb",
    sphere_over_plane: "sphere_over_plane.gltf",
    sun_court: "sun_court.glb",
    tube: "tube.gltf",
}
