//! `shaft-masks` against rays to the same samples of the light, and against itself with little room.
#![cfg(feature = "cli")]

mod support;

#[path = "capture_shaft/bounds.rs"]
mod bounds;
#[path = "capture_shaft/refine.rs"]
mod refine;
#[path = "capture_shaft/stress.rs"]
mod stress;

use antumbra::capture::{CapturedImage, FrameRequest, Samples};
use antumbra::light::{AreaLight, LightShape};
use antumbra::reference::{Pattern, Reference, Sampling, Settings, Surface};
use antumbra::scene::{LoadOptions, Scene, SceneCamera};
use antumbra::shadow::shaft_masks::light_samples;
use glam::{DVec3, UVec2, Vec3};
use std::path::Path;
use support::plates::{self, HEIGHT, floor, floor_x, plate};
use support::rig::with_renderer;

const SIZE: [u32; 2] = [64; 2];

fn load(name: &str) -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("assets")
        .join(name);
    Scene::load(&path, &LoadOptions::default()).unwrap()
}

/// Visibility of every light, and the surfaces, for each technique.
fn render(
    scene: &Scene,
    camera: &SceneCamera,
    techniques: &[&str],
) -> Vec<(Vec<Vec<f32>>, Surfaces)> {
    with_renderer(scene, |renderer| {
        let images = techniques.iter().map(|technique| {
            let request = FrameRequest {
                camera: camera.clone(),
                size: SIZE,
                lights: (0..scene.lights.len()).collect(),
                technique: technique.parse().unwrap(),
            };
            let frame = renderer
                .render_with_images(&request, &["normal", "depth"])
                .unwrap();
            let lights = frame.lights.into_iter().map(|light| light.visibility);
            (lights.collect(), Surfaces::of(&frame.images))
        });
        images.collect()
    })
}

/// What was drawn at each pixel.
struct Surfaces {
    normals: Vec<DVec3>,
    /// Metres along the view.
    depths: Vec<f64>,
}

impl Surfaces {
    fn of(images: &[CapturedImage]) -> Self {
        let plane = |image: usize, i: usize| match &images[image].planes[i] {
            Samples::Float(values) => values.iter().map(|v| f64::from(*v)),
            other => panic!("{other:?}"),
        };
        let xyz = plane(0, 0).zip(plane(0, 1)).zip(plane(0, 2));
        Self {
            normals: xyz.map(|((x, y), z)| DVec3::new(x, y, z)).collect(),
            depths: plane(1, 0).collect(),
        }
    }

    /// Whether a pixel shows another triangle than the ray through its centre meets. Stored normals
    /// are off by less than 7e-5; those of a smooth mesh's neighbours differ by little more.
    fn is_other(&self, pixel: usize, met: &Surface) -> bool {
        met.normal.distance(self.normals[pixel]) > 1.0e-4
            || (self.depths[pixel] - met.depth).abs() > 1.0e-3 * met.depth
    }
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

/// What rays say of a picture.
struct Compared {
    pixels: usize,
    /// Pixels that see a part of the light.
    partly: usize,
    /// Pixels of the same surface that differ.
    off: Vec<UVec2>,
    /// Samples by which they do.
    bits: f64,
    /// Pixels that show another surface than the ray through their centre meets.
    others: usize,
    /// Pixels that differ in whose own plane all of the light lies, as far as single precision can tell.
    level: usize,
    /// Part of the partly lit pixels' samples that differ.
    part: f64,
}

/// Whether the light's centre is in a surface's own plane but for the rounding of positions in single precision.
/// For a flat light that is level with the surface rounding says whether it is all above the plane or all below.
fn is_level(surface: &Surface, light: &AreaLight) -> bool {
    let center = light.center.as_dvec3();
    let extent = surface.position.abs().max(center.abs()).max_element();
    surface.normal.dot(center - surface.position).abs() <= extent * 2.0_f64.powi(-20)
}

/// Compares with rays. Rasterisation may find another triangle than the ray through a pixel's centre
/// where that passes within a sub-texel step of an edge, and then the nearest point of that triangle is
/// shaded: such pixels are told by their normals and depths, and are few.
fn compare(
    reference: &Reference<'_>,
    camera: &SceneCamera,
    light: &AreaLight,
    side: u32,
    (image, surfaces): (&[f32], &Surfaces),
) -> Compared {
    let (truth, valid) = cast(reference, camera, light, side);
    let mut found = Compared {
        pixels: 0,
        partly: 0,
        off: Vec::new(),
        bits: 0.0,
        others: 0,
        level: 0,
        part: 0.0,
    };
    let samples = f64::from(side * side);
    for (index, (v, truth)) in image.iter().zip(&truth).enumerate() {
        if !valid[index] {
            continue;
        }
        found.pixels += 1;
        found.partly += usize::from((0.005..0.995).contains(truth));
        if v == truth {
            continue;
        }
        let pixel = UVec2::new(index as u32 % SIZE[0], index as u32 / SIZE[0]);
        let surface = reference.surface(camera, SIZE, pixel).unwrap();
        if surfaces.is_other(index, &surface) {
            found.others += 1;
            continue;
        }
        if is_level(&surface, light) {
            found.level += 1;
            continue;
        }
        found.bits += f64::from((v - truth).abs()) * samples;
        found.off.push(pixel);
    }
    found.part = found.bits / (samples * found.partly.max(1) as f64);
    found
}

fn technique(side: u32) -> String {
    format!("shaft-masks:samples={},target-error=none", side * side)
}

/// Compares all lights of a scene with rays.
fn check(name: &str, side: u32) {
    let scene = load(name);
    let camera = scene.select_camera(None).unwrap();
    let images = render(&scene, &camera, &[&technique(side)]);
    let reference = Reference::new(&scene).unwrap();
    let (images, surfaces) = &images[0];
    for (image, light) in images.iter().zip(&scene.lights) {
        let found = compare(&reference, &camera, &light.light, side, (image, surfaces));
        println!(
            "{name}, `{}` ({}), {} samples: {} of {} pixels differ, {} in penumbrae; {:.2e} of their \
             bits; {} pixels of another surface",
            light.name,
            light.light.shape.kind(),
            side * side,
            found.off.len(),
            found.pixels,
            found.partly,
            found.part,
            found.others
        );
        assert_eq!(found.level, 0, "{name}: no light is level with a surface");
        assert!(found.pixels > 1000, "{name}: there is something to measure");
        assert!(
            found.part <= MOST,
            "{name}, `{}`: {}",
            light.name,
            found.part
        );
        // The fewer sub-texel steps, the more centres lie within one of an edge: 0.1 % of pixels at
        // 256 steps, 0.4 % at SwiftShader's 16, among them all wires of the fences.
        let bits = with_renderer(&scene, |renderer| {
            renderer.gpu().info().limits.sub_pixel_precision_bits
        });
        let most = found.pixels as f64 * (8.0e-4 + 0.0512 / f64::from(1_u32 << bits.min(16)));
        assert!(
            found.others as f64 <= most.max(2.0),
            "{name}: {}",
            found.others
        );
    }
}

/// Most bits that may differ: samples within rounding of an edge.
const MOST: f64 = 1.0e-4;

/// All shapes of lights; meshes that are closed, open, mirrored, fine, far away or have holes.
const SCENES: [&str; 6] = [
    "far_away.gltf",
    "fences.gltf",
    "figure.glb",
    "foliage.glb",
    "lights.gltf",
    "room.glb",
];

#[test]
fn masks_are_those_of_rays() {
    let _one = support::serial();
    for name in SCENES {
        check(name, 8);
    }
    check("mirrored.gltf", 16);
    check("sphere_over_plane.gltf", 32);
}

/// The other scenes.
#[test]
#[ignore = "takes minutes: cargo test --release --test capture_shaft -- --ignored"]
fn masks_are_those_of_rays_on_all_scenes() {
    let _one = support::serial();
    for name in [
        "blockers.gltf",
        "comb.gltf",
        "poles.gltf",
        "sun_court.glb",
        "tube.gltf",
    ] {
        check(name, 8);
        check(name, 16);
    }
}

/// Rows of a sphere's samples lie along its first axis, or the second where that is along the line of sight: the border
/// between the two runs through the picture, and with it through tiles.
#[test]
fn rows_of_a_sphere_may_turn_within_a_tile() {
    let _one = support::serial();
    let mut partly = 0;
    for step in -4..=4 {
        let turn = 0.9_f32.acos() + 0.02 * step as f32;
        let axis = Vec3::new(turn.sin(), -turn.cos(), 0.0);
        let near = |i: i32| 0.7 * i as f32 + 0.05 * step as f32;
        let places = (-3..=3).flat_map(|i| (-3..=3).map(move |j| [near(i), near(j)]));
        let plates = places.map(|[x, z]| plate("plate", [x, x + 0.4], [z, z + 0.5], 9.0));
        let primitives = plates.chain([floor()]).collect();
        let mut scene = plates::scene(primitives, LightShape::Sphere { radius: 1.0 });
        let light = &mut scene.lights[0].light;
        *light = AreaLight::new(light.shape, light.center, Vec3::Z, axis);
        let light = *light;
        let camera = plates::camera();
        let images = render(&scene, &camera, &[&technique(8)]);
        let reference = Reference::new(&scene).unwrap();
        let (images, surfaces) = &images[0];
        let found = compare(&reference, &camera, &light, 8, (&images[0], surfaces));
        println!("{step}: {} in {:?}", found.part, found.off);
        partly += found.partly;
        assert!(found.part <= MOST, "{} in {:?}", found.part, found.off);
    }
    assert!(partly > 10_000, "{partly}");
}

#[test]
fn lists_without_room_change_nothing() {
    let _one = support::serial();
    let same = |name: &str, techniques: &[&str]| {
        let scene = load(name);
        let camera = scene.select_camera(None).unwrap();
        let images = render(&scene, &camera, techniques);
        for (image, technique) in images.iter().zip(techniques) {
            let off = image.0.iter().flatten().zip(images[0].0.iter().flatten());
            let off = off.filter(|(v, wanted)| v != wanted).count();
            assert_eq!(off, 0, "{name}, {technique}");
        }
    };
    let techniques = [
        "shaft-masks:samples=64,target-error=none",
        "shaft-masks:samples=64,target-error=none,room=0",
        // Room for some lists, and for the beginnings of others: which ones may differ from run to run.
        "shaft-masks:samples=64,target-error=none,room=4",
        "shaft-masks:samples=64,target-error=none,room=12",
    ];
    same("figure.glb", &techniques);
    // Tiles with more triangles than there is room for, but fewer than a task has.
    let room = "shaft-masks:samples=64,target-error=none,room=16";
    same("fences.gltf", &[techniques[0], room, techniques[2]]);
    // Tens of thousands of triangles in a shaft, cut out by their texture.
    same("foliage.glb", &techniques[..2]);
}

/// Where part of the light is below a tile's surfaces, a segment to its middle may be, too: that some triangle is in the way
/// of that one does not make the tile dark.
#[test]
fn tiles_below_the_middle_of_a_light_are_not_dark() {
    let _one = support::serial();
    let scene = load("lights.gltf");
    let light = scene
        .lights
        .iter()
        .position(|light| light.name == "area rect");
    let seen = |technique: &str| {
        let request = FrameRequest {
            camera: scene.select_camera(None).unwrap(),
            size: [256; 2],
            lights: vec![light.unwrap()],
            technique: technique.parse().unwrap(),
        };
        let frame = with_renderer(&scene, |renderer| renderer.render(&request).unwrap());
        frame.lights[0].visibility.clone()
    };
    let [lists, walks] = ["", ",room=0"]
        .map(|room| seen(&format!("shaft-masks:samples=64,target-error=none{room}")));
    // Rounding at a surface's own plane may hide a sample from one and not from the other.
    let off = lists.iter().zip(&walks);
    let off = off.filter(|(a, b)| (*a - *b).abs() > 1.5 / 64.0).count();
    assert_eq!(off, 0);
}

/// Visibility of one light and the bound on its error.
fn bounded(
    scene: &Scene,
    camera: &SceneCamera,
    light: usize,
    technique: &str,
) -> (Vec<f32>, Vec<f32>) {
    let request = FrameRequest {
        camera: camera.clone(),
        size: SIZE,
        lights: vec![light],
        technique: technique.parse().unwrap(),
    };
    let frame = with_renderer(scene, |renderer| {
        let images = ["visibility_bound"];
        renderer.render_with_images(&request, &images).unwrap()
    });
    let Samples::Float(bound) = &frame.images[0].planes[0] else {
        panic!("{:?}", frame.images[0].planes);
    };
    (frame.lights[0].visibility.clone(), bound.clone())
}

/// 64 samples are off by what they say at most, told by 256, which are rays' and off by two hundredths;
/// and where nothing is undecided they are not off at all.
#[test]
fn errors_are_within_their_bounds() {
    let _one = support::serial();
    let scene = load("lights.gltf");
    let camera = scene.select_camera(None).unwrap();
    // A disk, a line and a sun: a rectangle's cells are simpler, and a sphere's those of a disk.
    for light in [0, 3, 4] {
        let name = &scene.lights[light].name;
        let (few, bound) = bounded(
            &scene,
            &camera,
            light,
            "shaft-masks:samples=64,target-error=none",
        );
        let (many, finer) = bounded(
            &scene,
            &camera,
            light,
            "shaft-masks:samples=256,target-error=none",
        );
        let (mut penumbra, mut sums, mut worst) = (0, [0.0; 2], 0.0f32);
        for i in 0..few.len() {
            let off = (few[i] - many[i]).abs();
            worst = worst.max(off);
            if bound[i] == 0.0 {
                assert_eq!(few[i], many[i], "{name}, pixel {i}: all is decided");
                assert!(few[i] == 0.0 || few[i] == 1.0, "{name}, pixel {i}");
            }
            assert!(
                off <= bound[i] + 0.02,
                "{name}, pixel {i}: {off}, {}",
                bound[i]
            );
            if (0.005..0.995).contains(&many[i]) {
                penumbra += 1;
                sums[0] += bound[i];
                sums[1] += finer[i];
            }
        }
        let [coarse, fine] = sums.map(|sum| sum / penumbra as f32);
        println!("{name}: bounds {coarse:.3} and {fine:.3} over {penumbra} pixels, off {worst:.3}");
        assert!(
            penumbra > 20 && worst > 0.0,
            "{name}: there is something to measure"
        );
        // Cells that a straight edge crosses are 8 to 15 of 64, and 16 to 31 of 256.
        assert!(
            coarse < 0.5 && fine < 0.8 * coarse,
            "{name}: {coarse}, {fine}"
        );
    }
}

/// The part of a unit disk left of x.
fn disk_left_of(x: f64) -> f64 {
    let x = x.clamp(-1.0, 1.0);
    0.5 + (x * (1.0 - x * x).sqrt() + x.asin()) / std::f64::consts::PI
}

/// Half-planes, a slot between two and both with a plate before them, under a square and a disk: the
/// part of the light that is seen is known, and no pixel is farther from it than its bound.
#[test]
fn no_bound_is_exceeded_on_closed_forms() {
    let _one = support::serial();
    let wide = [-30.0, 30.0];
    let half_plane = vec![floor(), plate("half-plane", [-30.0, 0.0], wide, 5.0)];
    let mut slot = half_plane.clone();
    slot.push(plate("other", [0.3, 30.0], wide, 5.0));
    let mut overlapping = half_plane.clone();
    overlapping.push(plate("nearer", [-30.0, -0.1], wide, 3.0));
    let square = LightShape::Rect {
        width: 2.0,
        height: 2.0,
    };
    let disk = LightShape::Disk { radius: 1.0 };
    // What each plate leaves of the light, as the range of its places -1 to 1 seen from x on the floor.
    let place = |edge: f64, depth: f64, x: f64| {
        let height = f64::from(HEIGHT);
        (edge * height - x * depth) / (height - depth)
    };
    let beyond = |x: f64| [place(0.0, 5.0, x), 1.0];
    let between = |x: f64| [place(0.0, 5.0, x), place(f64::from(0.3f32), 5.0, x)];
    let both = |x: f64| {
        [
            place(0.0, 5.0, x).max(place(f64::from(-0.1f32), 3.0, x)),
            1.0,
        ]
    };
    type Free<'a> = &'a dyn Fn(f64) -> [f64; 2];
    let cases: [(&str, Vec<_>, Free); 3] = [
        ("half-plane", half_plane, &beyond),
        ("slot", slot, &between),
        ("overlap", overlapping, &both),
    ];
    for (name, primitives, free) in cases {
        for shape in [square, disk] {
            let scene = plates::scene(primitives.clone(), shape);
            let (seen, bound) = bounded(&scene, &plates::camera(), 0, "shaft-masks");
            let (mut worst, mut partly) = (0.0f64, 0);
            for (i, (seen, bound)) in seen.iter().zip(&bound).enumerate() {
                let [from, to] = free(f64::from(floor_x(i as u32 % SIZE[0])));
                let part = |x: f64| match shape {
                    LightShape::Disk { .. } => disk_left_of(x),
                    _ => 0.5 + 0.5 * x.clamp(-1.0, 1.0),
                };
                let truth = (part(to) - part(from)).max(0.0);
                let off = (f64::from(*seen) - truth).abs();
                worst = worst.max(off);
                partly += usize::from(truth > 0.01 && truth < 0.99);
                assert!(
                    off <= f64::from(*bound) + 1.0e-5,
                    "{name}, {shape:?}, pixel {i}: {off} off, bound {bound}"
                );
            }
            println!("{name}, {shape:?}: {worst:.4} off at most, {partly} pixels");
            assert!(partly > 500);
        }
    }
}

/// Another technique's picture with tiles settled: rays are right about most of these already, and
/// where the pictures differ the settled one is right.
#[test]
fn settled_tiles_serve_other_techniques() {
    let _one = support::serial();
    let scene = load("figure.glb");
    let camera = scene.select_camera(None).unwrap();
    let masks = render(&scene, &camera, &["shaft-masks:target-error=none"]);
    let others = ["mdi", "occlusion-textures", "ssoc"];
    for technique in others {
        let with = format!("{technique}:classes=on");
        let images = render(&scene, &camera, &[technique, &with]);
        let [without, with] = [0, 1].map(|at| &images[at].0[0]);
        let mut settled = 0;
        for (i, (v, before)) in with.iter().zip(without).enumerate() {
            if v != before {
                settled += 1;
                assert_eq!(*v, masks[0].0[0][i], "{technique}, pixel {i}");
                assert!(*v == 0.0 || *v == 1.0, "{technique}, pixel {i}");
            }
        }
        println!("{technique}: {settled} pixels differ");
    }
    let counters = |technique: &str| {
        let request = FrameRequest {
            camera: camera.clone(),
            size: SIZE,
            lights: vec![0],
            technique: technique.parse().unwrap(),
        };
        let frame = with_renderer(&scene, |renderer| {
            renderer.render_counted(&request).unwrap()
        });
        frame.lights[0].counters.clone()
    };
    for technique in others {
        assert!(!counters(technique).contains_key("tiles_lit"));
        let counters = counters(&format!("{technique}:classes=on"));
        for kind in ["tiles_lit", "tiles_penumbra"] {
            assert!(counters[kind] > 0, "{technique}, {kind}");
        }
    }
    let traced = |technique: &str| counters(technique)["pixels_traced"];
    let [all, few] = [traced("mdi"), traced("mdi:classes=on")];
    // Most of the lit ones need no ray anyway.
    assert!(few > 0 && few < all, "{few} of {all}");
}
