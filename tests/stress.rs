//! Hard scenes, ray traced on the CPU: what must hold of any shadow, whatever makes it.
#![cfg(feature = "cli")]

use antumbra::light::ShapeKind;
use antumbra::reference::{Reference, Sampling, Settings, Surface, Truth};
use antumbra::scene::{LoadOptions, SceneFile};
use antumbra::stress::{
    Case, LIGHT_FACTORS, Similarity, broken_frame, cases, large, steps_of_blockers,
};
use glam::{DQuat, DVec3, EulerRot, UVec2, Vec3};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

const SIZE: [u32; 2] = [64; 2];
const PIXELS: usize = 64 * 64;
const SAMPLES: u32 = 64;

/// The same samples at a pixel, whatever the scene.
fn cast(case: &Case) -> Truth {
    let settings = Settings {
        camera: &case.camera,
        size: SIZE,
        light: case.area_light(),
        sampling: &Sampling::Plain { samples: SAMPLES },
    };
    let reference = Reference::new(&case.scene).unwrap();
    let truth = reference.render(&settings, &|_| ()).unwrap();
    for v in &truth.visibility {
        assert!((0.0..=1.0).contains(v), "{}: {v}", case.name);
    }
    truth
}

/// As [`cast`], once for all tests of this process: `visibility_is_a_part_and_the_same_every_time` casts anew.
/// Cases are told by their names.
fn cast_once(case: &Case) -> Arc<Truth> {
    static CAST: Mutex<BTreeMap<String, Arc<OnceLock<Arc<Truth>>>>> = Mutex::new(BTreeMap::new());
    let mut all = CAST.lock().unwrap_or_else(PoisonError::into_inner);
    let place = all.entry(case.name.clone()).or_default().clone();
    drop(all);
    place.get_or_init(|| Arc::new(cast(case))).clone()
}

fn surfaces(case: &Case) -> Vec<Option<Surface>> {
    let reference = Reference::new(&case.scene).unwrap();
    let pixels = (0..PIXELS as u32).map(|i| UVec2::new(i % SIZE[0], i / SIZE[0]));
    pixels
        .map(|pixel| reference.surface(&case.camera, SIZE, pixel))
        .collect()
}

/// Pixels, valid in both, that differ by more than `step`, and the largest difference.
fn changes(a: &Truth, b: &Truth, step: f32) -> (usize, f32) {
    let (mut count, mut most) = (0, 0.0_f32);
    for i in 0..a.visibility.len() {
        if a.valid[i] && b.valid[i] {
            let change = (a.visibility[i] - b.visibility[i]).abs();
            count += usize::from(change > step);
            most = most.max(change);
        }
    }
    (count, most)
}

fn flipped_rows(truth: &mut Truth) {
    let width = SIZE[0] as usize;
    (truth.visibility.chunks_mut(width)).for_each(<[f32]>::reverse);
    truth.valid.chunks_mut(width).for_each(<[bool]>::reverse);
}

#[test]
fn cases_are_the_same_every_time_and_of_all_kinds() {
    let all = cases();
    assert_eq!(all, cases());
    let names: BTreeSet<&str> = all.iter().map(|case| case.name.as_str()).collect();
    assert_eq!(names.len(), all.len());
    let shapes: BTreeSet<ShapeKind> = (all.iter())
        .map(|case| case.area_light().shape.kind())
        .collect();
    assert_eq!(shapes, ShapeKind::ALL.into_iter().collect());
    assert!(all.iter().all(|case| case.scene.triangle_count() < 2_000));
    assert_eq!(all[0].scene.triangle_count(), 1);
    let sheet = large(20_000).scene.triangle_count();
    assert!((19_900..20_100).contains(&sheet), "{sheet}");
}

#[test]
fn visibility_is_a_part_and_the_same_every_time() {
    for case in cases() {
        let truth = cast(&case);
        let valid = truth.valid.iter().filter(|valid| **valid).count();
        let own = |i: &usize| truth.valid[*i];
        let partial = (0..PIXELS)
            .filter(own)
            .filter(|i| truth.visibility[*i] > 0.0 && truth.visibility[*i] < 1.0)
            .count();
        let dark = (0..PIXELS)
            .filter(own)
            .filter(|i| truth.visibility[*i] == 0.0)
            .count();
        println!(
            "{:28} {valid:4} valid, {partial:4} partly lit, {:4} dark",
            case.name, dark
        );
        assert_eq!(truth, cast(&case), "{}", case.name);
        assert!(valid > PIXELS / 8, "{}: {valid} valid pixels", case.name);
        if let Some(expected) = case.expected {
            for i in (0..PIXELS).filter(own) {
                let found = truth.visibility[i];
                assert_eq!(found, expected, "{}: pixel {i}", case.name);
            }
        } else {
            assert!(partial + dark > 0, "{}: nothing is in shadow", case.name);
        }
    }
}

#[test]
fn a_light_of_no_size_casts_the_shadow_of_its_centre() {
    for case in cases() {
        let point = case.light_of_no_size();
        let truth = cast(&point);
        let reference = Reference::new(&point.scene).unwrap();
        let light = point.area_light();
        let hard = reference
            .center_visibility(&point.camera, SIZE, light)
            .unwrap();
        let wrong = |truth: &Truth| {
            (0..PIXELS)
                .filter(|i| truth.valid[*i] && truth.visibility[*i] != hard[*i])
                .count()
        };
        assert_eq!(wrong(&truth), 0, "{}", case.name);
        // A millionth of a metre is less than a thousandth of a pixel here.
        let small = wrong(&cast(&case.light_scaled(1.0e-6)));
        println!(
            "{:28} {small} pixels differ under a millionth of the light",
            case.name
        );
        assert!(small <= 2, "{}: {small}", case.name);
    }
}

#[test]
fn a_light_of_any_size() {
    for case in cases() {
        for factor in LIGHT_FACTORS {
            cast(&case.light_scaled(factor));
        }
    }
}

/// Sample by sample: with one blocker less no sample is lost.
#[test]
fn a_blocker_never_brightens() {
    let steps = ShapeKind::ALL.into_iter().zip(all_shapes());
    let pairs = steps.flat_map(|(_, shape)| {
        let steps = steps_of_blockers(shape);
        let pairs: Vec<_> = steps
            .windows(2)
            .map(|w| (w[0].clone(), w[1].clone()))
            .collect();
        pairs
    });
    let taken = cases()
        .into_iter()
        .filter_map(|case| Some((case.without_last()?, case)));
    for (fewer, more) in pairs.chain(taken) {
        let (a, b) = (cast(&fewer), cast(&more));
        let (before, after) = (surfaces(&fewer), surfaces(&more));
        let same = |i: &usize| match (&before[*i], &after[*i]) {
            (Some(x), Some(y)) => (x.position, x.normal) == (y.position, y.normal),
            _ => false,
        };
        let (mut darker, mut count) = (0, 0);
        for i in (0..PIXELS).filter(same) {
            let (v, w) = (a.visibility[i], b.visibility[i]);
            assert!(w <= v, "{}: pixel {i} from {v} to {w}", more.name);
            darker += usize::from(w < v);
            count += 1;
        }
        println!(
            "{:28} {darker} of {count} pixels darker by one blocker",
            more.name
        );
    }
}

fn all_shapes() -> Vec<antumbra::light::LightShape> {
    let all = cases();
    let of = |kind: ShapeKind| {
        let lights = all.iter().map(|case| case.area_light().shape);
        lights.into_iter().find(|shape| shape.kind() == kind)
    };
    ShapeKind::ALL.into_iter().filter_map(of).collect()
}

/// Pixels, of all in the picture, that rounding may decide anew: 0.05 %.
const MAY_FLIP: usize = PIXELS / 2_000;

#[test]
fn the_same_scene_in_other_guises() {
    let turn = DQuat::from_euler(EulerRot::YXZ, 0.7, 1.9, -0.4);
    let guises = [
        ("1e-3", Similarity::scaled(1.0e-3)),
        ("7", Similarity::scaled(7.0)),
        ("1e4", Similarity::scaled(1.0e4)),
        ("turned", Similarity::turned(turn)),
        ("moved", Similarity::moved(DVec3::new(98.0, -33.0, 41.0))),
    ];
    for case in cases() {
        let truth = cast_once(&case);
        let mut line = format!("{:28}", case.name);
        for (name, guise) in &guises {
            // The same samples, but for one that rounding moves across an edge.
            let found = cast(&case.seen_as(guise));
            let (count, most) = changes(&truth, &found, 1.01 / SAMPLES as f32);
            line += &format!(" {name}: {count} to {most:.2}");
            if count > MAY_FLIP {
                for (i, surface) in surfaces(&case).into_iter().enumerate() {
                    let (v, w) = (truth.visibility[i], found.visibility[i]);
                    if truth.valid[i] && found.valid[i] && (v - w).abs() > 1.01 / SAMPLES as f32 {
                        let at = (i % 64, i / 64);
                        let s = surface.map(|s| (s.position, s.normal, s.primitive, s.triangle));
                        println!("{} {at:?}: {v} {name} {w}: {s:?}", case.name);
                    }
                }
            }
            assert!(count <= MAY_FLIP, "{line}");
        }
        // Other samples: two estimates of 64 independent samples differ by 0.09.
        let mut found = cast(&case.mirrored());
        flipped_rows(&mut found);
        let (mut squares, mut count) = (0.0, 0);
        for i in (0..PIXELS).filter(|i| truth.valid[*i] && found.valid[*i]) {
            let (v, w) = (truth.visibility[i], found.visibility[i]);
            if v.min(w) < 1.0 && v.max(w) > 0.0 {
                squares += f64::from(v - w).powi(2);
                count += 1;
            }
        }
        let rms = (squares / f64::from(count.max(1))).sqrt();
        let (_, most) = changes(&truth, &found, 0.0);
        line += &format!(" mirrored: rms {rms:.3} to {most:.2}");
        assert!(rms < (2.0 * 0.25 / f64::from(SAMPLES)).sqrt(), "{line}");
        assert!(most < 0.3, "{line}");
        println!("{line}");
    }
}

/// Moving the light by a thousandth of its distance: no pixel jumps but at edges of hard shadows.
#[test]
fn a_small_move_is_a_small_change() {
    for case in cases() {
        let distance = if case.area_light().shape.is_sun() {
            1.0
        } else {
            2.0
        };
        let step = Vec3::new(0.6, 0.0, 0.8) * 1.0e-3 * distance;
        let (a, b) = (cast_once(&case), cast(&case.light_moved(step)));
        let mut steps: Vec<f32> = (0..PIXELS)
            .filter(|i| a.valid[*i] && b.valid[*i])
            .map(|i| (a.visibility[i] - b.visibility[i]).abs())
            .collect();
        steps.sort_by(f32::total_cmp);
        let p = |part: f64| steps[((steps.len() - 1) as f64 * part) as usize];
        let moved = steps.iter().filter(|step| **step > 0.0).count();
        println!(
            "{:28} {moved} of {} pixels changed; 99 %: {:.3}, 99.9 %: {:.3}",
            case.name,
            steps.len(),
            p(0.99),
            p(0.999)
        );
        // Three samples of 64 in all but one pixel of a hundred.
        assert!(
            p(0.99) <= 3.01 / SAMPLES as f32,
            "{}: {}",
            case.name,
            p(0.99)
        );
    }
}

#[test]
fn far_from_the_origin_in_a_file() {
    for case in cases() {
        let truth = cast_once(&case);
        let mut line = format!("{:28}", case.name);
        for distance in [0.0, 1.0e2, 1.0e4, 1.0e6] {
            let origin = DVec3::new(distance, -0.25 * distance, 0.5 * distance);
            let far = case.through_file(origin).unwrap();
            let found = cast(&far);
            let (count, most) = changes(&truth, &found, 1.01 / SAMPLES as f32);
            line += &format!(" {distance:e}: {count} to {most:.2}");
            assert!(count <= MAY_FLIP, "{line}");
        }
        println!("{line}");
    }
}

#[test]
fn a_frame_that_cannot_be_is_refused_and_the_others_are_fine() {
    let animated = broken_frame();
    let file = SceneFile::from_slice("frames.glb", animated.bytes, &LoadOptions::default());
    let file = file.unwrap();
    for (frame, moment) in animated.moments.iter().enumerate() {
        match file.scene_at(*moment) {
            Ok(scene) => {
                assert_ne!(frame, animated.broken);
                assert_eq!(scene.triangle_count(), 2);
                let corner = scene.primitives[1].positions[2];
                let wanted = Vec3::new(0.0, 1.0 + 0.1 * frame as f32, 1.0);
                assert!((corner - wanted).length() < 1.0e-6, "{corner}");
            }
            Err(error) => {
                let message = error.to_string();
                assert_eq!(frame, animated.broken, "{message}");
                assert!(message.starts_with("frames.glb: "), "{message}");
                assert!(
                    message.contains("vertex 0") && !message.contains('\n'),
                    "{message}"
                );
                println!("{message}");
            }
        }
    }
}

#[test]
fn a_vertex_that_is_no_number_is_refused() {
    for bad in [f32::NAN, f32::INFINITY, 3.0e38] {
        let mut case = cases().swap_remove(3);
        case.scene.primitives[1].positions[2].y = bad;
        let message = case.scene.finish().unwrap_err().to_string();
        let wanted = format!("{}: primitive 1 `box`: vertex 2 ", case.name);
        assert!(message.starts_with(&wanted), "{message}");
        assert!(!message.contains('\n'), "{message}");
        let refused = case.through_file(DVec3::ZERO).unwrap_err().to_string();
        assert!(
            refused.contains("vertex 2") && !refused.contains('\n'),
            "{refused}"
        );
    }
}
