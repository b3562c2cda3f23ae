//! Frames look as they looked when somebody last looked at them: against the pictures of `tests/golden/`.
//!
//! They say how frames look, not how they should: that is what the ray-traced truth is for. Where a change is meant,
//! `ANTUMBRA_BLESS=1 cargo test --test golden` writes them anew, to be looked at and committed (see CONTRIBUTING.md).
#![cfg(feature = "cli")]

mod support;

use std::path::{Path, PathBuf};

use antumbra::ash::vk;
use antumbra::capture::{CapturedFrame, FrameRequest, exposure, png};
use antumbra::scene::{LoadOptions, Scene};
use image::GrayImage;
use support::rig::with_renderer;

const SIZE: u32 = 96;

/// A pixel is off if it differs by more than this, of 255.
const MOST: u8 = 6;

/// Pixels that may be off, of all. The pictures are Mesa's; other drivers put the corners of triangles elsewhere within
/// a texel, which moves the outlines of maps.
fn most_off(driver: vk::DriverId) -> f64 {
    if driver == vk::DriverId::MESA_LLVMPIPE {
        0.001
    } else {
        0.01
    }
}

/// What is drawn: a scene of `assets/`, the name of its light, a technique.
const VISIBILITY: [(&str, &str, &str); 10] = [
    ("lights.gltf", "disk", "hard"),
    ("lights.gltf", "disk", "pcf"),
    ("lights.gltf", "disk", "pcss"),
    ("lights.gltf", "disk", "ssoc"),
    ("lights.gltf", "rect", "occlusion-textures"),
    ("lights.gltf", "rect", "mdi"),
    ("lights.gltf", "sphere", "dbuffer"),
    ("lights.gltf", "line", "oess"),
    ("lights.gltf", "sun", "shaft-masks"),
    ("foliage.glb", "lamp", "dbuffer"),
];

fn load(name: &str) -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("assets")
        .join(name);
    Scene::load(&path, &LoadOptions::default()).unwrap()
}

fn request(scene: &Scene, lights: Vec<usize>, technique: &str) -> FrameRequest {
    FrameRequest {
        camera: scene.cameras[0].clone(),
        size: [SIZE; 2],
        lights,
        technique: technique.parse().unwrap(),
    }
}

fn draw(scene: &Scene, request: &FrameRequest) -> (CapturedFrame, vk::DriverId) {
    with_renderer(scene, |renderer| {
        let frame = renderer.render(request).unwrap();
        (frame, renderer.gpu().info().driver_id)
    })
}

fn reference_of(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden");
    folder.join(format!("{name}.png"))
}

/// What is wrong with a picture, and where to look.
fn check(name: &str, driver: vk::DriverId, picture: &GrayImage) -> Result<(), String> {
    let path = reference_of(name);
    if std::env::var_os("ANTUMBRA_BLESS").is_some() {
        if std::env::var_os("CI").is_some() {
            return Err("references are never written where CI is set".into());
        }
        return picture.save(&path).map_err(|error| error.to_string());
    }
    let reference = image::open(&path)
        .map_err(|error| format!("{}: {error}; ANTUMBRA_BLESS=1 writes it", path.display()))?
        .into_luma8();
    if reference.dimensions() != picture.dimensions() {
        return Err(format!("{} pixels, not {:?}", name, reference.dimensions()));
    }
    let differences = reference.pixels().zip(picture.pixels());
    let differences: Vec<u8> = differences.map(|(a, b)| a.0[0].abs_diff(b.0[0])).collect();
    let off = differences.iter().filter(|d| **d > MOST).count();
    let part = off as f64 / differences.len() as f64;
    println!(
        "{name}: {off} pixels off, by up to {}",
        differences.iter().max().unwrap_or(&0)
    );
    // Beside each other: as it was, where it differs, as it is.
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("golden");
    let shown = folder.join(format!("{name}.png"));
    if part <= most_off(driver) {
        let _ = std::fs::remove_file(shown);
        return Ok(());
    }
    let [width, height] = [picture.width(), picture.height()];
    let sheet = GrayImage::from_fn(3 * width, height, |x, y| match x / width {
        0 => *reference.get_pixel(x, y),
        1 => image::Luma([differences[(y * width + x - width) as usize].saturating_mul(4)]),
        _ => *picture.get_pixel(x - 2 * width, y),
    });
    std::fs::create_dir_all(&folder).map_err(|error| error.to_string())?;
    sheet.save(&shown).map_err(|error| error.to_string())?;
    Err(format!(
        "{name}: {off} pixels ({:.2} %) differ by more than {MOST} of 255; see {}; if that is meant: \
         ANTUMBRA_BLESS=1 cargo test --test golden",
        100.0 * part,
        shown.display()
    ))
}

fn report(problems: Vec<String>) {
    assert!(problems.is_empty(), "\n{}", problems.join("\n"));
}

#[test]
fn visibility_is_as_it_was() {
    let _one = support::serial();
    let mut problems = Vec::new();
    for (file, light, technique) in VISIBILITY {
        let scene = load(file);
        let at = scene.lights.iter().position(|l| l.name == light);
        let at = at.unwrap_or_else(|| panic!("{file} has no light `{light}`"));
        let request = request(&scene, vec![at], technique);
        let (mut frame, driver) = draw(&scene, &request);
        let visibility = frame.lights.remove(0).visibility;
        let grey = visibility.iter().map(|v| (255.0 * v + 0.5) as u8).collect();
        let picture = GrayImage::from_raw(SIZE, SIZE, grey).unwrap();
        let stem = file.split('.').next().unwrap_or(file);
        problems.extend(check(&format!("{stem}-{light}-{technique}"), driver, &picture).err());
    }
    report(problems);
}

/// All lights of a scene in one picture, exposed and in sRGB as `capture -o` writes it; its brightness is compared.
#[test]
fn a_picture_is_as_it_was() {
    let _one = support::serial();
    let scene = load("lights.gltf");
    let lights = (0..scene.lights.len()).collect();
    let request = request(&scene, lights, "hard");
    let (frame, driver) = draw(&scene, &request);
    let color = frame.color;
    let scale = exposure(&color);
    let rgb: Vec<[f32; 3]> = (color.iter())
        .map(|c| [c[0] * scale, c[1] * scale, c[2] * scale])
        .collect();
    let bytes = png::encode_linear_rgb(SIZE, SIZE, &rgb).unwrap();
    let picture = image::load_from_memory(&bytes).unwrap().into_luma8();
    report(
        check("lights-picture", driver, &picture)
            .err()
            .into_iter()
            .collect(),
    );
}

#[test]
fn references_are_small_and_none_is_left_over() {
    let folder = reference_of("x");
    let mut names: Vec<String> = VISIBILITY
        .iter()
        .map(|(file, light, technique)| {
            let stem = file.split('.').next().unwrap_or(file);
            format!("{stem}-{light}-{technique}.png")
        })
        .collect();
    names.push("lights-picture.png".into());
    names.sort();
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder.parent().unwrap()).unwrap() {
        let entry = entry.unwrap();
        assert!(
            entry.metadata().unwrap().len() <= 16 * 1024,
            "{:?}",
            entry.path()
        );
        found.push(entry.file_name().into_string().unwrap());
    }
    found.sort();
    assert_eq!(found, names);
}
