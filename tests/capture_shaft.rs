//! `shaft-masks` against rays to the same samples of the light, and against itself with little room.

mod support;

use antumbra::capture::{CapturedImage, FrameRenderer, FrameRequest, Samples};
use antumbra::light::AreaLight;
use antumbra::reference::{Pattern, Reference, Sampling, Settings};
use antumbra::scene::{LoadOptions, Scene, SceneCamera};
use antumbra::shadow::shaft_masks::light_samples;
use glam::{DVec3, UVec2};
use std::path::Path;

const SIZE: [u32; 2] = [96; 2];

fn load(name: &str) -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("assets")
        .join(name);
    Scene::load(&path, &LoadOptions::default()).unwrap()
}

/// Visibility of every light, and the normals, for each technique.
fn render(
    scene: &Scene,
    camera: &SceneCamera,
    techniques: &[&str],
) -> Vec<(Vec<Vec<f32>>, Vec<DVec3>)> {
    let mut renderer = FrameRenderer::new(support::gpu(), scene).unwrap();
    let images = techniques.iter().map(|technique| {
        let request = FrameRequest {
            camera: camera.clone(),
            size: SIZE,
            lights: (0..scene.lights.len()).collect(),
            technique: technique.parse().unwrap(),
        };
        let frame = renderer.render_with_images(&request, &["normal"]).unwrap();
        let lights = frame.lights.into_iter().map(|light| light.visibility);
        (lights.collect(), normals(&frame.images[0]))
    });
    let images = images.collect();
    support::assert_no_messages(&renderer.destroy().unwrap());
    images
}

fn normals(image: &CapturedImage) -> Vec<DVec3> {
    let plane = |i: usize| match &image.planes[i] {
        Samples::Float(values) => values.iter().map(|v| f64::from(*v)),
        other => panic!("{other:?}"),
    };
    let xy = plane(0).zip(plane(1));
    xy.zip(plane(2))
        .map(|((x, y), z)| DVec3::new(x, y, z))
        .collect()
}

/// Rays to the samples that the technique takes: visibility, and where it can be compared.
fn cast(
    reference: &Reference<'_>,
    camera: &SceneCamera,
    light: &AreaLight,
    side: u32,
) -> (Vec<f32>, Vec<bool>) {
    let samples = light_samples(&light.shape, side);
    let lines = samples.iter().map(|p| format!("{} {}\n", p.x, p.y));
    let text: String = lines.collect();
    let sampling = Sampling::Pattern(Pattern::parse(&text, "light_samples").unwrap());
    let settings = Settings {
        camera,
        size: SIZE,
        light,
        sampling: &sampling,
    };
    let truth = reference.render(&settings, &|_| {}).unwrap();
    (truth.visibility, truth.valid)
}

/// Compares with rays. Rasterisation may find another triangle than the ray through a pixel's centre
/// where that passes within a sub-texel step of an edge, and then shades a point beyond that
/// triangle: such pixels are told by their normals, and are few.
fn check(name: &str, side: u32, most: f64) {
    let scene = load(name);
    let camera = scene.select_camera(None).unwrap();
    let samples = side * side;
    let technique = format!("shaft-masks:samples={samples}");
    let images = render(&scene, &camera, &[&technique]);
    let reference = Reference::new(&scene).unwrap();
    let (images, normals) = &images[0];
    for (image, light) in images.iter().zip(&scene.lights) {
        let (truth, valid) = cast(&reference, &camera, &light.light, side);
        let (mut pixels, mut partly, mut bits, mut off, mut others) = (0, 0, 0.0, 0, 0);
        for (index, (v, truth)) in image.iter().zip(&truth).enumerate() {
            if !valid[index] {
                continue;
            }
            pixels += 1;
            partly += u32::from((0.005..0.995).contains(truth));
            if v == truth {
                continue;
            }
            let pixel = UVec2::new(index as u32 % SIZE[0], index as u32 / SIZE[0]);
            let surface = reference.surface(&camera, SIZE, pixel).unwrap();
            // Stored normals are rounded by 4e-5.
            if surface.normal.distance(normals[index]) > 1.0e-3 {
                others += 1;
                continue;
            }
            bits += f64::from((v - truth).abs()) * f64::from(samples);
            off += 1;
        }
        let part = bits / (f64::from(samples) * f64::from(partly.max(1)));
        println!(
            "{name}, `{}` ({}), {samples} samples: {off} of {pixels} pixels differ, {partly} in \
             penumbrae; {part:.2e} of their bits; {others} pixels of another surface",
            light.name,
            light.light.shape.kind(),
        );
        assert!(pixels > 1000, "{name}: there is something to measure");
        assert!(part <= most, "{name}, `{}`: {part}", light.name);
        assert!(
            f64::from(others) <= 1.0e-3 * f64::from(pixels),
            "{name}: {others}"
        );
    }
}

/// Most bits that may differ: samples within rounding of an edge. Leaves have edges within a texel too,
/// where the reference's alpha is that of double precision.
fn most(name: &str) -> f64 {
    match name {
        "foliage.glb" => 1.0e-3,
        _ => 1.0e-4,
    }
}

macro_rules! scenes {
    ($($test:ident: $file:literal,)*) => {
        $(#[test]
        fn $test() {
            let _one = support::serial();
            check($file, 8, most($file));
        })*
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

#[test]
fn more_samples() {
    let _one = support::serial();
    check("sphere_over_plane.gltf", 16, 1.0e-4);
    check("sphere_over_plane.gltf", 32, 1.0e-4);
}

#[test]
fn lists_without_room_change_nothing() {
    let _one = support::serial();
    for name in ["figure.glb", "lights.gltf"] {
        let scene = load(name);
        let camera = scene.select_camera(None).unwrap();
        let techniques = [
            "shaft-masks",
            "shaft-masks:room=0",
            "shaft-masks:room=4",
            "shaft-masks",
        ];
        let images = render(&scene, &camera, &techniques);
        for image in &images[1..] {
            assert!(image.0 == images[0].0, "{name}");
        }
    }
}
