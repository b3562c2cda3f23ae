//! The steps of `oess` as published and as they are: edges, their outreach, merging, and lights that are
//! not even.

mod support;

use antumbra::capture::{FrameRequest, Samples};
use antumbra::light::{LightProfile, LightShape};
use antumbra::scene::{Scene, SceneCamera};
use support::plates::{HEIGHT, SIZE, camera, floor, floor_x, plate, scene};

const LENGTH: f32 = 2.0;

fn line(length: f32) -> LightShape {
    LightShape::Line { length }
}

struct Frame {
    visibility: Vec<f32>,
    images: Vec<Vec<u32>>,
}

fn frame(scene: &Scene, camera: &SceneCamera, technique: &str, names: &[&str]) -> Frame {
    let request = FrameRequest {
        camera: camera.clone(),
        size: [SIZE; 2],
        lights: vec![0],
        technique: technique.parse().unwrap(),
    };
    let mut frame = support::rig::with_renderer(scene, |renderer| {
        renderer.render_with_images(&request, names).unwrap()
    });
    let images = frame.images.into_iter().map(|image| {
        let Some(Samples::Uint(values)) = image.planes.into_iter().next() else {
            panic!("{} holds no numbers", image.name);
        };
        values
    });
    Frame {
        visibility: frame.lights.remove(0).visibility,
        images: images.collect(),
    }
}

/// Plates of several depths, turned so that their edges slant across rows.
fn slanted(length: f32) -> Scene {
    let mut primitives = vec![floor()];
    for (i, (x, depth)) in [(-0.9, 5.0), (-0.2, 3.5), (0.25, 6.0), (0.7, 7.5)]
        .into_iter()
        .enumerate()
    {
        let mut blocker = plate("blocker", [x, x + 0.35], [-1.5, 1.5], depth);
        for p in &mut blocker.positions {
            p.x += p.z * (0.13 + 0.1 * i as f32);
            p.y += p.z * 0.11;
        }
        primitives.push(blocker);
    }
    scene(primitives, line(length))
}

#[test]
fn the_scan_finds_what_a_search_of_whole_rows_finds() {
    let _one = support::serial();
    let names = ["oess.forward 0:lamp", "oess.backward 0:lamp"];
    for find in ["fold", "location", "tilt", "both"] {
        let of = |outreach: &str| {
            let technique = format!("oess:resolution=128,outreach={outreach},find={find}");
            frame(&slanted(LENGTH), &camera(), &technique, &names).images
        };
        let (scan, search) = (of("scan"), of("search"));
        assert!(scan == search, "{find}");
        let found = scan.iter().flatten().filter(|texel| **texel != 0).count();
        println!("{find}: {found} texels have an edge");
        // Level plates face both ends: tilt alone finds nothing there.
        assert_eq!(found > 500, find != "tilt", "{find}: {found}");
        // What the published step writes is one of the scan's two.
        let scatter = of("scatter");
        let pairs = scatter.iter().flatten().zip(scan.iter().flatten());
        let strange = pairs.filter(|(one, two)| **one != 0 && **two & 0xffff == 0);
        assert_eq!(strange.count(), 0, "{find}");
    }
}

#[test]
fn steps_of_the_outreach_do_not_grow_with_penumbrae() {
    let _one = support::serial();
    let names = ["oess.forward_steps 0:lamp", "oess.backward_steps 0:lamp"];
    let blocker = plate("blocker", [-30.0, 0.0], [-30.0, 30.0], 5.0);
    let steps = |outreach: &str, length: f32| {
        let technique = format!("oess:resolution=512,outreach={outreach},find=fold");
        let scene = scene(vec![floor(), blocker.clone()], line(length));
        let images = frame(&scene, &camera(), &technique, &names).images;
        images.iter().flatten().map(|n| f64::from(*n)).sum::<f64>()
    };
    for (outreach, least, most) in [
        ("hull", 0.8, 1.2),
        ("scan", 0.8, 1.2),
        ("scatter", 1.5, 9.0),
    ] {
        let (narrow, wide) = (steps(outreach, 0.5), steps(outreach, 1.0));
        println!("{outreach}: {narrow}, then {wide}");
        assert!(narrow > 0.0);
        let ratio = wide / narrow;
        assert!((least..most).contains(&ratio), "{outreach}: {ratio}");
        if outreach == "hull" {
            // Each texel is entered once and left once.
            assert!(wide <= 3.0 * 2.0 * 512.0 * 512.0);
        }
    }
}

/// The light that half-planes and strips, given by depth and x range, leave free of a point of the floor.
fn truth(x: f32, at: f32, blockers: &[(f32, [f32; 2])], bright: impl Fn(f32) -> f32) -> f32 {
    const STEPS: u32 = 2000;
    let (mut sum, mut free) = (0.0, 0.0);
    for step in 0..STEPS {
        let place = (step as f32 + 0.5) / STEPS as f32;
        let from = LENGTH * (place - 0.5);
        let hidden = blockers.iter().any(|(depth, range)| {
            let crossing = from + (x - from) * depth / at;
            *depth < at && crossing > range[0] && crossing < range[1]
        });
        sum += bright(place);
        free += if hidden { 0.0 } else { bright(place) };
    }
    free / sum
}

#[test]
fn a_light_that_is_not_even() {
    let _one = support::serial();
    let blockers = [(5.0, [-30.0, 0.0]), (6.0, [0.3, 0.6])];
    let plates = blockers.map(|(depth, x)| plate("blocker", x, [-30.0, 30.0], depth));
    let primitives: Vec<_> = std::iter::once(floor()).chain(plates).collect();
    for text in ["0,1", "1,0.25", "0,1,0", "3,0,0,1"] {
        let profile: LightProfile = text.parse().unwrap();
        let bright = |place: f32| {
            let at = place * (profile.values().len() - 1) as f32;
            let cell = (at as usize).min(profile.values().len() - 2);
            let [a, b] = [profile.values()[cell], profile.values()[cell + 1]];
            a + (b - a) * (at - cell as f32)
        };
        for technique in [
            "oess",
            "oess:outreach=hull,segments=1",
            "oess:outreach=hull,segments=3",
        ] {
            let mut scene = scene(primitives.clone(), line(LENGTH));
            scene.lights[0].light.profile = profile;
            let image = frame(&scene, &camera(), technique, &[]).visibility;
            let errors = (0..SIZE as usize).map(|column| {
                let wanted = truth(floor_x(column as u32), HEIGHT, &blockers, bright);
                (image[column + (SIZE * SIZE / 2) as usize] - wanted).abs()
            });
            let worst = errors.fold(0.0, f32::max);
            println!("{text}, {technique}: {worst}");
            assert!(worst <= 0.006, "{text}, {technique}: {worst}");
        }
    }
}

/// Where a half-plane's edge divides the line, in 32 bits on the device against 64 here; the camera sees a few
/// centimetres of the floor, as wide as the penumbra.
#[test]
fn short_lines_are_as_exact_as_long_ones() {
    let _one = support::serial();
    for part in [1.0e-3, 1.0e-2, 0.2] {
        let length = part * HEIGHT;
        let blocker = plate("blocker", [-30.0, 0.0], [-30.0, 30.0], 5.0);
        let scene = scene(vec![floor(), blocker], line(length));
        let close = SceneCamera {
            yfov: 2.0 * (0.8 * length / 2.0).atan(),
            ..camera()
        };
        for (technique, most) in [("oess", 1.0e-3), ("oess:outreach=hull", 0.005)] {
            let image = frame(&scene, &close, technique, &[]).visibility;
            let errors = (0..SIZE).map(|column| {
                let x = 0.8 * ((f64::from(column) + 0.5) / f64::from(SIZE / 2) - 1.0);
                let wanted = (0.5 + x).clamp(0.0, 1.0);
                let at = (column + SIZE * SIZE / 2) as usize;
                (f64::from(image[at]) - wanted).abs()
            });
            let worst = errors.fold(0.0, f64::max);
            println!("length {part} of the distance, {technique}: {worst}");
            assert!(
                worst <= most,
                "length {part} of the distance, {technique}: {worst}"
            );
        }
    }
}

/// The paper's artifact of receiver penetration: the floor below a wide plate that catches the penumbra is
/// dark, but lies where the maps have one.
#[test]
fn penumbrae_do_not_go_through_receivers() {
    let _one = support::serial();
    let blockers = [(3.0, [-30.0, 0.0]), (6.0, [-30.0, 3.0])];
    let plates = blockers.map(|(depth, x)| plate("blocker", x, [-30.0, 30.0], depth));
    let primitives: Vec<_> = std::iter::once(floor()).chain(plates).collect();
    let scene = scene(primitives, line(LENGTH));
    let worst = |technique: &str| {
        let image = frame(&scene, &camera(), technique, &[]).visibility;
        let errors = image.iter().enumerate().map(|(i, v)| {
            let wanted = truth(floor_x(i as u32 % SIZE), HEIGHT, &blockers, |_| 1.0);
            (v - wanted).abs()
        });
        errors.fold(0.0, f32::max)
    };
    let published = worst("oess:outreach=scatter,penumbra=place");
    println!("by place {published}");
    assert!(published > 0.1, "{published}");
    for technique in [
        "oess",
        "oess:outreach=hull",
        "oess:outreach=scatter",
        "oess:outreach=scan",
    ] {
        let error = worst(technique);
        println!("{technique}: {error}");
        assert!(error <= 0.005, "{technique}: {error}");
    }
}

/// The paper's object alternation: where a nearer blocker begins to count, one edge alone jumps to it.
#[test]
fn two_candidates_are_better_than_one() {
    let _one = support::serial();
    let blockers = [(3.0, [0.2, 30.0]), (6.0, [0.1, 30.0])];
    let plates = blockers.map(|(depth, x)| plate("blocker", x, [-30.0, 30.0], depth));
    let primitives: Vec<_> = std::iter::once(floor()).chain(plates).collect();
    let scene = scene(primitives, line(LENGTH));
    let worst = |technique: &str| {
        let image = frame(&scene, &camera(), technique, &[]).visibility;
        let errors = image.iter().enumerate().map(|(i, v)| {
            let wanted = truth(floor_x(i as u32 % SIZE), HEIGHT, &blockers, |_| 1.0);
            (v - wanted).abs()
        });
        errors.fold(0.0, f32::max)
    };
    let errors =
        ["scatter", "scan", "hull"].map(|outreach| worst(&format!("oess:outreach={outreach}")));
    println!("one {}, two {}, hull {}", errors[0], errors[1], errors[2]);
    assert!(errors[1] <= 0.03 && errors[2] <= 0.006, "{errors:?}");
    assert!(errors[0] > errors[1], "{errors:?}");
}

/// Slats of which each end sees the next one alone on its way to the light, under a line of 2 m.
const SLATS: [(f32, [f32; 2]); 4] = [
    (5.0, [-0.5, -0.4]),
    (5.0, [-0.05, 0.05]),
    (6.0, [0.15, 0.3]),
    (5.0, [0.4, 0.5]),
];

/// The line's two ends see all that hides it from a half-plane's penumbra, and nothing more is done; of
/// slats they see two.
#[test]
fn segments_are_looked_at_where_something_hides_between_the_ends() {
    let _one = support::serial();
    let half_plane = [(5.0, [-30.0, 0.0])];
    let lines = |blockers: &[(f32, [f32; 2])], length: f32| {
        let plates = blockers
            .iter()
            .map(|(depth, x)| plate("blocker", *x, [-3.0, 3.0], *depth));
        scene(
            std::iter::once(floor()).chain(plates).collect(),
            line(length),
        )
    };
    let worst = |image: &[f32], blockers: &[(f32, [f32; 2])]| {
        let errors = image.iter().enumerate().map(|(i, v)| {
            let wanted = truth(floor_x(i as u32 % SIZE), HEIGHT, blockers, |_| 1.0);
            (v - wanted).abs()
        });
        errors.fold(0.0, f32::max)
    };
    for (name, blockers, open) in [("half-plane", &half_plane[..], 0), ("slats", &SLATS, 1000)] {
        let scene = lines(blockers, LENGTH);
        let names = ["oess.open 0:lamp"];
        let found = frame(&scene, &camera(), "oess:outreach=hull", &names);
        let opened = found.images[0].iter().filter(|part| **part != 0).count();
        let error = worst(&found.visibility, blockers);
        let ends = frame(&scene, &camera(), "oess:outreach=hull,segments=1", &[]).visibility;
        let by_ends = worst(&ends, blockers);
        println!("{name}: {opened} open, error {error}; by ends alone {by_ends}");
        assert!(error <= 0.002, "{name}: {error}");
        if open == 0 {
            assert_eq!(opened, 0, "{name}");
            assert_eq!(found.visibility, ends, "{name}");
        } else {
            assert!(opened > open, "{name}: {opened}");
            assert!(by_ends > 0.08, "{name}: {by_ends}");
        }
    }
    // Nothing that a map shows hides between points so near to each other: no maps of further points.
    let passes = |length: f32| {
        let scene = lines(&SLATS, length);
        let request = FrameRequest {
            camera: camera(),
            size: [SIZE; 2],
            lights: vec![0],
            technique: "oess:outreach=hull".parse().unwrap(),
        };
        let frame =
            support::rig::with_renderer(&scene, |renderer| renderer.render(&request).unwrap());
        let maps = frame.passes.iter().map(|(name, _)| name);
        maps.filter(|name| name.starts_with("oess.map ")).count()
    };
    assert_eq!([passes(1.0e-3), passes(LENGTH)], [2, 9]);
}
