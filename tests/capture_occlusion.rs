//! `occlusion-textures` against closed forms and brute force: filters, combinations, slices and what
//! they are allowed to be wrong by.
#![cfg(feature = "cli")]

mod support;

use antumbra::capture::{CapturedFrame, FrameRequest, Samples};
use antumbra::light::LightShape;
use antumbra::reference::{Reference, Sampling, Settings};
use antumbra::scene::{Aabb, Scene, SceneCamera};
use glam::Vec3;
use support::plates::{HEIGHT, SIZE, camera, floor, floor_x, plate, quad, scene};
use support::rig::with_renderer;

fn square(half: f32) -> LightShape {
    LightShape::Rect {
        width: 2.0 * half,
        height: 2.0 * half,
    }
}

fn request(camera: &SceneCamera, size: [u32; 2], options: &str) -> FrameRequest {
    FrameRequest {
        camera: camera.clone(),
        size,
        lights: vec![0],
        // Coarser than the default, which takes SwiftShader seconds; a later option wins.
        technique: format!("occlusion-textures:resolution=512,detail=2,slices=16,{options}")
            .parse()
            .unwrap(),
    }
}

fn render(scene: &Scene, options: &[&str]) -> Vec<Vec<f32>> {
    with_renderer(scene, |renderer| {
        let images = options.iter().map(|options| {
            let frame = renderer.render(&request(&camera(), [SIZE; 2], options));
            frame.unwrap().lights.remove(0).visibility
        });
        images.collect()
    })
}

/// Largest error against the half-plane x <= 0 at a depth: linear across the light of half width 1.
fn half_plane_error(image: &[f32], depth: f32) -> f32 {
    let half_width = (HEIGHT - depth) / depth;
    let errors = image.iter().enumerate().map(|(i, v)| {
        let x = floor_x(i as u32 % SIZE);
        let truth = (0.5 + 0.5 * x / half_width).clamp(0.0, 1.0);
        (v - truth).abs()
    });
    errors.fold(0.0, f32::max)
}

/// Slices with planes at 3.34, 5, 6.66, .. metres: two plates, where the half-plane hides them from
/// all that they could darken, say where the first begins and the last ends.
fn half_plane_in_slices(depth: f32) -> Scene {
    let far = 9.99;
    let near = (4.0 * 5.0 - far) / 3.0;
    scene(
        vec![
            floor(),
            plate("blocker", [-30.0, 0.0], [-30.0, 30.0], depth),
            plate("nearest", [-1.19, -1.1], [0.0, 0.05], near),
            plate("farthest", [-1.5, -1.4], [0.0, 0.05], far),
        ],
        square(1.0),
    )
}

const IN_SLICES: &str = "slices=4,fit=range,planes=uniform,depth=lower,contact=0";

#[test]
fn a_half_plane_on_a_slice_plane_is_exact_to_a_texel() {
    let _one = support::serial();
    let scene = half_plane_in_slices(4.9995);
    let sat = format!("{IN_SLICES},filter=sat");
    let linear = format!("{IN_SLICES},filter=nbuffers");
    let log = format!("{IN_SLICES},filter=nbuffers-log");
    let images = render(&scene, &[&sat, &linear, &log]);
    let errors: Vec<f32> = images.iter().map(|i| half_plane_error(i, 5.0)).collect();
    println!("sat, N-buffers linear, log: {errors:?}");
    // Kernels are 0.2 wide in an image at most 1 wide, of 256 texels.
    let half_texel = 0.5 / (0.2 * 256.0);
    assert!(errors[0] <= 0.003 + half_texel, "tables: {}", errors[0]);
    assert!(errors[1] <= 0.07 + half_texel, "N-buffers: {}", errors[1]);
    assert!(
        errors[2] <= 0.08 + half_texel,
        "N-buffers, log: {}",
        errors[2]
    );
}

#[test]
fn a_half_plane_inside_a_slice_is_as_wrong_as_its_rounding() {
    let _one = support::serial();
    let scene = half_plane_in_slices(4.0);
    let image = &render(&scene, &[IN_SLICES])[0];
    let error = half_plane_error(image, 4.0);
    // Penumbrae of the lower plane instead of the edge's own: half of 1 - w(b) / w(h).
    let width = |z: f32| 1.0 / z - 1.0 / HEIGHT;
    let rounding = 0.5 * (1.0 - width(5.0) / width(4.0));
    println!("{error} of {rounding}");
    assert!(error <= rounding + 0.01, "{error} > {rounding}");
    assert!(
        error >= rounding - 0.03,
        "{error}: the slices are not where they should be"
    );
    // Slices spent where something is come much closer.
    let fitted = half_plane_error(&render(&scene, &[""])[0], 4.0);
    println!("fitted to what is there: {fitted}");
    assert!(fitted <= 0.25 * rounding, "{fitted}");
}

fn plane(frame: &CapturedFrame, name: &str, component: usize) -> Vec<u32> {
    let image = frame
        .images
        .iter()
        .find(|image| image.name == name)
        .unwrap();
    match &image.planes[component] {
        Samples::Uint(words) => words.clone(),
        other => panic!("{name}: {other:?}"),
    }
}

#[test]
fn tables_are_the_sums_of_their_texels() {
    let _one = support::serial();
    let tilted = [
        Vec3::new(-0.7, 3.0, -0.5),
        Vec3::new(-0.3, 5.0, 0.6),
        Vec3::new(0.5, 6.5, 0.7),
        Vec3::new(0.4, 4.0, -0.6),
    ];
    let mut primitives = vec![floor(), quad("tilted", tilted)];
    for i in 0..20 {
        let x = -1.0 + 0.1 * i as f32;
        primitives.push(plate(
            "bar",
            [x, x + 0.03],
            [-1.0, 1.0],
            3.0 + 0.2 * i as f32,
        ));
    }
    let scene = scene(primitives, square(1.0));
    // With few fine slices the groups are the slices, in order.
    let request = request(
        &camera(),
        [SIZE; 2],
        "slices=8,fit=range,resolution=128,detail=2",
    );
    let names = [
        "occlusion-textures.bits 0:lamp.0[0]",
        "occlusion-textures.tables 0:lamp.0[0]",
    ];
    let frame = with_renderer(&scene, |renderer| {
        renderer.render_with_images(&request, &names).unwrap()
    });
    let bits = plane(&frame, names[0], 0);
    let occupied: Vec<u32> = (0..8)
        .filter(|slice| bits.iter().any(|b| b >> slice & 1 == 1))
        .collect();
    assert!(occupied.len() >= 4, "{occupied:?}");
    let side = 64;
    // Two groups share a component; each counts what it and all nearer ones block.
    let pairs = [[0, 2], [1, 3], [4, 6], [5, 7]];
    let up_to = |group: usize| {
        let nearer = occupied.get(..=group).unwrap_or_default();
        nearer.iter().fold(0, |mask, slice| mask | 1_u32 << slice)
    };
    for (component, pair) in pairs.into_iter().enumerate() {
        let table = plane(&frame, names[1], component);
        let mut marked = 0;
        for y in 0..=side {
            for x in 0..=side {
                let count = |mask: u32| {
                    let row = |v: usize| &bits[128 * v..128 * v + 2 * x];
                    let hits = (0..2 * y).flat_map(row).filter(|b| *b & mask != 0);
                    hits.count() as u32
                };
                // All rows of the table would take long; every seventh and the borders do.
                if y % 7 != 1 && y != side && y != 0 {
                    continue;
                }
                let [low, high] = pair.map(|group| count(up_to(group)));
                let expected = low.wrapping_add(high << 16);
                assert_eq!(
                    table[y * (side + 1) + x],
                    expected,
                    "groups {pair:?} at {x}, {y}"
                );
                marked = marked.max(low);
            }
        }
        assert!(
            marked > 0 || pair[0] >= occupied.len(),
            "groups {pair:?} hold nothing"
        );
    }
}

#[test]
fn nothing_is_full_light_and_a_cover_is_none() {
    let _one = support::serial();
    let options = [
        "",
        "filter=nbuffers",
        "filter=mipmaps",
        "projection=offset",
        "fit=range",
    ];
    for image in render(&scene(vec![floor()], square(1.0)), &options) {
        assert!(image.iter().all(|v| *v == 1.0));
    }
    let cover = plate("cover", [-20.0, 20.0], [-20.0, 20.0], 5.0);
    let covered = scene(vec![floor(), cover], square(1.0));
    for combine in ["cumulative", "product", "sum", "maximum", "thin"] {
        // Tables only: N-buffers know no border and let light in around the image's.
        let image = &render(&covered, &[&format!("combine={combine}")])[0];
        let most = image.iter().copied().fold(0.0, f32::max);
        assert!(most == 0.0, "{combine}: {most}");
    }
}

/// Ground and a sheet that stands on it: neither has anything between itself and the light, which
/// shines past the upright sheet's plane in part.
#[test]
fn without_casters_there_are_no_slices() {
    let _one = support::serial();
    let sheet = [
        Vec3::new(-0.2, 0.0, -0.5),
        Vec3::new(-0.2, 0.0, 0.5),
        Vec3::new(0.2, 0.4, 0.5),
        Vec3::new(0.2, 0.4, -0.5),
    ];
    let ground = scene(vec![floor()], square(1.0));
    let with_sheet = scene(vec![floor(), quad("sheet", sheet)], square(1.0));
    for (scene, slices) in [(&ground, false), (&with_sheet, true)] {
        let mut request = request(&camera(), [SIZE; 2], "");
        let draw = |request: &FrameRequest| {
            with_renderer(scene, |renderer| renderer.render(request).unwrap())
        };
        let frame = draw(&request);
        let passes = frame.passes.iter().map(|(name, _)| name.as_str());
        let sliced = passes.filter(|name| name.contains("slices")).count();
        assert_eq!(sliced > 0, slices);
        request.technique = "shaft-masks".parse().unwrap();
        let exact = draw(&request);
        let pairs = frame.lights[0]
            .visibility
            .iter()
            .zip(&exact.lights[0].visibility);
        let most = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(slices || most == 0.0, "{most}");
    }
}

/// Textures, and sums over them, are made of the slices that hold something and of no others.
#[test]
fn empty_slices_are_left_out() {
    let _one = support::serial();
    let bar = |depth: f32| plate("bar", [-0.3, 0.3], [-1.0, 1.0], depth);
    let rows = |depths: &[f32]| {
        let bars = depths.iter().map(|depth| bar(*depth));
        scene(bars.chain([floor()]).collect(), square(1.0))
    };
    let all: Vec<f32> = (0..24).map(|i| 3.0 + 0.2 * i as f32).collect();
    // Slices reach from the first bar to the last in both.
    for (depths, few) in [(&[all[0], all[23]][..], true), (&all, false)] {
        // Groups of tables by 8, and by 4.
        for (options, most) in [("slices=32", 32), ("slices=16,combine=bounded", 16)] {
            let request = request(&camera(), [SIZE; 2], options);
            let light = with_renderer(&rows(depths), |renderer| {
                renderer.render_counted(&request).unwrap().lights.remove(0)
            });
            let count = |name: &str| light.counters[name];
            let (filled, textures) = (count("slices_filled"), count("textures"));
            if few {
                // A bar may touch the plane between two slices.
                assert!((2..=4).contains(&filled), "{:?}", light.counters);
                assert_eq!(textures, filled);
            } else {
                assert!(filled > 16 && textures <= most, "{:?}", light.counters);
            }
            assert!(count("slices_empty") >= if few { 24 } else { 1 });
            let sets = if options.contains("bounded") { 2 } else { 1 };
            let layers = [4, 8].map(|groups| sets * textures.div_ceil(groups));
            assert!(
                layers.contains(&count("tables_summed")),
                "{:?}",
                light.counters
            );
        }
    }
}

/// Kernels that reached out of the image would let light in around a cover that ends where the
/// image does.
#[test]
fn kernels_stay_within_the_image() {
    let _one = support::serial();
    // As wide as what the floor in view can see of the light at that depth, and a texel more.
    let half = 0.5 * (1.6 + 1.0) * 1.02;
    let cover = plate("cover", [-half, half], [-half, half], 5.0);
    let scene = scene(vec![floor(), cover], square(1.0));
    let options = ["", "projection=offset", "projection=orthographic"];
    for (image, options) in render(&scene, &options).iter().zip(options) {
        let most = image.iter().copied().fold(0.0, f32::max);
        assert!(most <= 0.01, "{options}: {most}");
    }
}

#[test]
fn a_receiver_that_passes_slice_planes_sees_no_step() {
    let _one = support::serial();
    // A ramp that falls by 3 m along the picture, below an edge that runs along it.
    let ramp = [
        Vec3::new(-30.0, 3.0, -1.5),
        Vec3::new(-30.0, 0.0, 1.5),
        Vec3::new(30.0, 0.0, 1.5),
        Vec3::new(30.0, 3.0, -1.5),
    ];
    let blocker = plate("blocker", [-30.0, 0.0], [-30.0, 30.0], 4.0);
    let scene = scene(vec![quad("ramp", ramp), blocker], square(1.0));
    let above = SceneCamera {
        position: Vec3::new(0.25, 5.5, 0.0),
        forward: Vec3::NEG_Y,
        right: Vec3::Z,
        up: Vec3::X,
        yfov: 1.0e-3,
        znear: 0.01,
        ..SceneCamera::framing(&Aabb::EMPTY)
    };
    // One row of 1000 pixels, less than 3 mm apart.
    let request = request(&above, [1000, 2], "resolution=1024");
    let frame = with_renderer(&scene, |renderer| renderer.render(&request).unwrap());
    let row = &frame.lights[0].visibility[..1000];
    let step = row
        .windows(2)
        .map(|w| (w[0] - w[1]).abs())
        .fold(0.0, f32::max);
    let range = row
        .iter()
        .fold((1.0_f32, 0.0_f32), |(a, b), v| (a.min(*v), b.max(*v)));
    println!("largest step {step}, values {range:?}");
    assert!(
        range.0 > 0.3 && range.1 < 0.95,
        "{range:?}: the row lies in the penumbra"
    );
    assert!(step <= 0.005, "{step}");
}

#[test]
fn a_tilted_sheet_does_not_leak() {
    let _one = support::serial();
    let sheet = [
        Vec3::new(-20.0, 3.0, -4.0),
        Vec3::new(20.0, 3.0, -4.0),
        Vec3::new(20.0, 7.5, 4.0),
        Vec3::new(-20.0, 7.5, 4.0),
    ];
    let scene = scene(vec![floor(), quad("sheet", sheet)], square(1.0));
    let images = render(
        &scene,
        &[
            "",
            "combine=product",
            "fit=range,depth=lower",
            "fit=range,depth=lower,combine=product",
        ],
    );
    let most = |image: &Vec<f32>| image.iter().copied().fold(0.0, f32::max);
    println!("{:?}", images.iter().map(most).collect::<Vec<_>>());
    assert!(most(&images[0]) <= 0.05, "{}", most(&images[0]));
    // Slices over the whole range are coarser and leak more, but less than by the product.
    assert!(most(&images[2]) < most(&images[3]));
    assert!(
        most(&images[1]) > 0.1,
        "the published product leaks: {}",
        most(&images[1])
    );
}

/// Wings that lean across the slices, and feelers a few texels wide (the paper's figure 6): what they
/// hide is neither let through nor counted twice.
#[test]
fn a_butterfly_neither_leaks_nor_grows_fat() {
    let _one = support::serial();
    let p = Vec3::new;
    let wing = |side: f32| {
        let tip = |x: f32, z: f32| p(side * x, 5.0 + 0.8 * x, z);
        [
            tip(0.02, -0.45),
            tip(0.9, -0.6),
            tip(0.8, 0.5),
            tip(0.02, 0.35),
        ]
    };
    let feeler = |side: f32| {
        let at = |t: f32, w: f32| p(side * (0.05 + 0.3 * t) + w, 5.0 + 0.6 * t, -0.45 - 0.35 * t);
        [at(0.0, 0.0), at(1.0, 0.0), at(1.0, 0.015), at(0.0, 0.015)]
    };
    let quads = [wing(-1.0), wing(1.0), feeler(-1.0), feeler(1.0)];
    let mut primitives = vec![floor()];
    primitives.extend(quads.map(|corners| quad("part", corners)));
    let scene = scene(primitives, square(0.25));
    let truth = Reference::new(&scene).unwrap();
    let settings = Settings {
        camera: &camera(),
        size: [SIZE; 2],
        light: &scene.lights[0].light,
        sampling: &Sampling::Plain { samples: 256 },
    };
    let truth = truth.render(&settings, &|_| ()).unwrap().visibility;
    let options = ["resolution=1024", "resolution=1024,combine=product"];
    let images = render(&scene, &options);
    let hidden = |image: &[f32]| image.iter().map(|v| f64::from(1.0 - v)).sum::<f64>();
    let leak = |image: &[f32]| {
        let dark = image.iter().zip(&truth).filter(|(_, t)| **t == 0.0);
        dark.map(|(v, _)| *v).fold(0.0, f32::max)
    };
    let fat = |image: &[f32]| hidden(image) / hidden(&truth) - 1.0;
    let found: Vec<_> = images.iter().map(|i| (leak(i), fat(i))).collect();
    println!("leak and growth: {found:?}");
    assert!(truth.iter().filter(|t| **t == 0.0).count() > 100);
    assert!(found[0].0 <= 0.05, "lets through {}", found[0].0);
    // A texel is 3 mm there; the outlines are 7.6 m long and hold 1.5 square metres.
    assert!(found[0].1.abs() <= 0.015, "grows by {}", found[0].1);
    assert!(found[1].0 > found[0].0, "the published product leaks more");
}

#[test]
fn a_larger_light_costs_no_more() {
    let _one = support::serial();
    // Blockers everywhere, so that every kernel has something in it.
    let mut primitives = vec![floor()];
    for (row, depth) in [3.0_f32, 5.0, 7.0].into_iter().enumerate() {
        for i in -120..120 {
            let x = 0.25 * i as f32 + 0.1 * row as f32;
            primitives.push(plate("bar", [x, x + 0.05], [-20.0, 20.0], depth));
        }
    }
    let images = |half: f32| {
        let scene = scene(primitives.clone(), square(half));
        let shown = ["show=fetches", "show=fetches,early=off", "", "early=off"];
        render(&scene, &shown)
    };
    let once = images(1.0);
    assert!(once[0].iter().all(|v| *v > 0.0));
    for half in [2.0, 4.0] {
        let more = images(half);
        assert!(once[0] == more[0], "half width {half}");
        assert!(once[1] == more[1], "half width {half}, nothing left out");
        // What is left out would add nothing.
        let pairs = more[2].iter().zip(&more[3]);
        let most = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(most < 2.0e-6, "{most}");
    }
}

#[test]
fn every_option_renders_the_same_twice_without_a_message() {
    let _one = support::serial();
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/foliage.glb");
    let scene = Scene::load(&path, &Default::default()).unwrap();
    let camera = scene.select_camera(None).unwrap();
    for options in [
        "",
        "slices=4,planes=uniform,fit=range",
        "slices=128,planes=reciprocal,contact=0",
        "combine=thin,filter=nbuffers-log,resolution=256",
        "filter=mipmaps,detail=1,resolution=128",
    ] {
        let request = request(&camera, [96, 96], options);
        let [first, second] = with_renderer(&scene, |renderer| {
            [(); 2].map(|()| renderer.render(&request).unwrap())
        });
        let values = &first.lights[0].visibility;
        assert!(*values == second.lights[0].visibility, "{options}");
        assert!(values.iter().all(|v| (0.0..=1.0).contains(v)), "{options}");
        assert!(
            values.iter().any(|v| *v < 0.3) && values.iter().any(|v| *v > 0.7),
            "{options}"
        );
    }
}
