//! Each case by itself.

use crate::compare::{Change, known};
use crate::limits::{is_quick, judge, leak, limits, techniques};
use crate::rig::{PIXELS, Rig, SIDE};
use crate::support;
use antumbra::light::ShapeKind;
use antumbra::reference::{Reference, Sampling, Settings};
use antumbra::shadow::Technique;
use antumbra::stress::{Case, LIGHT_FACTORS, cases, large, steps_of_blockers};
use std::time::Instant;

fn can_do(technique: Technique, case: &Case) -> bool {
    technique.check(case.area_light()).is_ok()
}

/// V in [0, 1] (which the rig checks), the same from frame to frame and from device to device; V = 1
/// where nothing can be in between, in a closed room too; and under a light of no size the shadow of
/// its centre.
#[test]
fn every_case() {
    let _one = support::serial();
    let (mut rig, mut other) = (Rig::new(), Rig::new());
    let mut faults = Vec::new();
    for (number, case) in cases().iter().enumerate() {
        let truth = known(case);
        let point = case.light_of_no_size();
        let of_point = known(&point);
        for technique in techniques() {
            let title = format!("{:28} {:5}", case.name, technique.name());
            let limits = limits(technique);
            // `ANTUMBRA_TEST_FEWER`: for a driver on which the slow techniques take minutes.
            let fewer =
                std::env::var_os("ANTUMBRA_TEST_FEWER").is_some() && case.expected.is_none();
            if fewer && !is_quick(technique) && number % 2 == 1 {
                continue;
            }
            if can_do(technique, case) {
                let first = rig.draw(case, technique);
                // Every other case, where frames take long.
                if is_quick(technique) || number.is_multiple_of(2) {
                    let second = rig.draw(case, technique);
                    assert_eq!(first, second, "{title}: a second time");
                }
                if number % 4 == 0 {
                    assert_eq!(first, other.draw(case, technique), "{title}: anew");
                }
                if let Some(expected) = case.expected {
                    let all = vec![expected; PIXELS];
                    let leak = if expected == 0.0 {
                        leak(technique)
                    } else {
                        0.0
                    };
                    let off = Change::of(&all, &first, |i| truth.sure[i], leak);
                    println!(
                        "{title} {} of {} pixels are not {expected}, by {} at most",
                        off.changed, off.pixels, off.most
                    );
                    let room = case.name == "empty-room";
                    if off.part() > if room { limits.own_walls } else { 0.0 } {
                        faults.push(format!("{title}: {off:?}, not {expected}"));
                    }
                }
            }
            if can_do(technique, &point) {
                let found = rig.draw(&point, technique);
                let sure = |i: usize| truth.sure[i] && of_point.sure[i];
                let off = Change::of(&of_point.center, &found, sure, 1.0e-3);
                let away = |i: usize| sure(i) && !of_point.edge[i];
                let stray = Change::of(&of_point.center, &found, away, 1.0e-3);
                println!(
                    "{title} without size: {} of {} pixels off, {} away from edges",
                    off.changed, off.pixels, stray.changed
                );
                let most = if case.fine { limits.fine } else { 0.0 };
                if stray.part() > most {
                    faults.push(format!("{title}: without size {stray:?} away from edges"));
                }
                // Off by less than a texel: a sixth of the pixels within one of an edge.
                let edges = (0..PIXELS)
                    .filter(|i| sure(*i) && of_point.edge[*i])
                    .count();
                if technique == Technique::Hard && !case.fine && off.changed > 2 + edges / 50 {
                    faults.push(format!("{title}: without size {off:?} at {edges} edges"));
                }
            }
        }
    }
    rig.end();
    other.end();
    judge(&faults);
}

/// Five decades of sizes.
#[test]
fn lights_of_any_size() {
    let _one = support::serial();
    let mut rig = Rig::new();
    let all = cases();
    for kind in ShapeKind::ALL {
        let of_kind = |case: &&Case| case.area_light().shape.kind() == kind;
        for case in all.iter().filter(of_kind).take(1) {
            for technique in techniques() {
                let mut means = Vec::new();
                for factor in LIGHT_FACTORS {
                    let case = case.light_scaled(factor);
                    if can_do(technique, &case) {
                        let picture = rig.draw(&case, technique);
                        let sum: f64 = picture.iter().map(|v| f64::from(*v)).sum();
                        means.push(sum / PIXELS as f64);
                    }
                }
                println!("{:28} {:5} mean {means:.3?}", case.name, technique.name());
            }
        }
    }
    rig.end();
}

/// With the fit of the map fixed, one blocker more hides more.
#[test]
fn a_blocker_more_never_brightens() {
    let _one = support::serial();
    let mut rig = Rig::new();
    let mut faults = Vec::new();
    let mut shapes = Vec::new();
    for case in cases() {
        let shape = case.area_light().shape;
        if !shapes.iter().any(|(kind, _)| *kind == shape.kind()) {
            shapes.push((shape.kind(), shape));
        }
    }
    assert_eq!(shapes.len(), ShapeKind::ALL.len());
    // The same number of samples everywhere: then no pixel gets brighter at all.
    let even: Technique = "shaft-masks:target-error=none".parse().unwrap();
    for (kind, shape) in shapes {
        let steps = steps_of_blockers(shape);
        let sure: Vec<Vec<bool>> = steps.iter().map(|case| known(case).sure).collect();
        for technique in techniques().chain([even]) {
            if !can_do(technique, &steps[0]) {
                continue;
            }
            let mut limits = limits(technique);
            if technique == even {
                limits.brighter = 0.0;
            }
            let pictures: Vec<_> = steps.iter().map(|case| rig.draw(case, technique)).collect();
            for (at, pair) in pictures.windows(2).enumerate() {
                let brighter = |i: usize| sure[at][i] && sure[at + 1][i];
                let step = if limits.step < 1.0 {
                    limits.step * 1.01
                } else {
                    0.5
                };
                let raised: Vec<f32> = pair[0]
                    .iter()
                    .zip(&pair[1])
                    .map(|(v, w)| v.max(*w))
                    .collect();
                let change = Change::of(&pair[0], &raised, brighter, step);
                let any = Change::of(&pair[0], &raised, brighter, 0.0);
                let title = format!("{:6} {:5} blocker {at}", kind.name(), technique.name());
                println!(
                    "{title}: {} of {} pixels brighter, {} by more than a step, most {:.2}",
                    any.changed, any.pixels, change.changed, change.most
                );
                if change.part() > limits.brighter {
                    faults.push(format!("{title}: {change:?}"));
                }
                if limits.brighter == 0.0 && any.changed > 0 {
                    faults.push(format!("{title}: {any:?}"));
                }
            }
        }
    }
    rig.end();
    judge(&faults);
}

/// Triangles narrower than a pixel: of some pixels rasterisation finds the neighbour of the triangle that the ray
/// meets, and where the sheet is hollow that one's plane lies behind it. What is fully lit is not hidden by that, with
/// techniques that decide by the triangles themselves.
#[test]
fn a_finely_divided_sheet_does_not_hide_its_own_points() {
    let _one = support::serial();
    let mut rig = Rig::new();
    let mut faults = Vec::new();
    for triangles in [5_000, 20_000, 60_000] {
        let case = large(triangles);
        let reference = Reference::new(&case.scene).unwrap();
        let settings = Settings {
            camera: &case.camera,
            size: [SIDE; 2],
            light: case.area_light(),
            sampling: &Sampling::Plain { samples: 64 },
        };
        let truth = reference.render(&settings, &|_| ()).unwrap();
        for technique in ["hard", "ssoc", "dbuffer", "shaft-masks"] {
            let picture = rig.draw(&case, technique.parse().unwrap());
            let is_lit = |i: &usize| truth.valid[*i] && truth.visibility[*i] == 1.0;
            let lit: Vec<usize> = (0..PIXELS).filter(is_lit).collect();
            assert!(lit.len() > PIXELS / 3);
            let dark: Vec<&usize> = lit.iter().filter(|i| picture[**i] < 0.9).collect();
            if !dark.is_empty() {
                faults.push(format!("{triangles} {technique}: {dark:?}"));
            }
        }
    }
    rig.end();
    assert!(faults.is_empty(), "{faults:#?}");
}

/// Run by hand: memory and time of 1.5 million triangles.
#[test]
#[ignore = "a minute and 600 MB"]
fn one_and_a_half_million_triangles() {
    let _one = support::serial();
    let begin = Instant::now();
    let case = large(1_500_000);
    let count = case.scene.triangle_count();
    println!("{count} triangles made in {:.1?}", begin.elapsed());
    assert!(count > 1_490_000);
    let truth = known(&case);
    println!("truth at {:.1?}", begin.elapsed());
    let mut rig = Rig::new();
    for technique in techniques() {
        let now = Instant::now();
        let first = rig.draw(&case, technique);
        let upload = now.elapsed();
        let now = Instant::now();
        assert_eq!(first, rig.draw(&case, technique));
        let off = Change::of(&truth.center, &first, |i| truth.sure[i], 0.5);
        println!(
            "{}: first {upload:.1?}, then {:.1?}; {} of {} pixels off the hard truth by more than a half",
            technique.name(),
            now.elapsed(),
            off.changed,
            off.pixels
        );
    }
    rig.end();
}
