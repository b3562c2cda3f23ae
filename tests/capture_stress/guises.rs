//! The same case in other guises, and a small step from where it was.

use crate::compare::{Change, flipped, known, sure};
use crate::limits::{MAY_FLIP, is_quick, judge, limits, techniques};
use crate::rig::{PIXELS, Rig};
use crate::support;
use antumbra::shadow::Technique;
use antumbra::stress::{Case, SCALES, Similarity, cases};
use glam::{DQuat, DVec3, EulerRot, Vec3};

/// Whether the case of this number is asked of a technique: one that takes its light, and every other one, of
/// those whose frames take long every fourth; techniques take turns. With `ANTUMBRA_TEST_ALL` none is left
/// out, as in `scenes::every_case`.
fn is_asked(technique: Technique, case: &Case, number: usize) -> bool {
    let turn = techniques().position(|other| other == technique);
    let every = if is_quick(technique) { 2 } else { 4 };
    let is_due = (number + turn.unwrap_or(0)).is_multiple_of(every);
    let all = std::env::var_os("ANTUMBRA_TEST_ALL").is_some();
    technique.check(case.area_light()).is_ok() && (is_due || all)
}

/// A uniform scale, and a place far away that is taken out when the file is read, change no more than
/// one pixel in 2000: the map is fitted alike.
#[test]
fn scaled_or_far_away() {
    let _one = support::serial();
    let mut rig = Rig::new();
    let mut faults = Vec::new();
    for (number, case) in cases().iter().enumerate() {
        let scales: Vec<f64> = match number {
            3 => SCALES.to_vec(),
            _ => vec![SCALES[0], SCALES[6]],
        };
        let far = DVec3::new(1.0e6, -2.5e5, 5.0e5);
        let mut guises: Vec<Case> = (scales.into_iter())
            .map(|scale| case.seen_as(&Similarity::scaled(scale)))
            .collect();
        if number % 5 == 3 {
            let distances = [1.0e-4, 1.0e-2, 1.0];
            guises.extend(distances.map(|part| case.through_file(part * far).unwrap()));
        }
        let guises: Vec<_> = guises
            .into_iter()
            .map(|guise| (sure(&guise), guise))
            .collect();
        let here = sure(case);
        for technique in techniques() {
            if !is_asked(technique, case, number) {
                continue;
            }
            let before = rig.draw_once(case, technique);
            let mut line = format!("{:28} {:5}", case.name, technique.name());
            for (sure, guise) in &guises {
                let after = rig.draw(guise, technique);
                let change = Change::of(&before, &after, |i| here[i] && sure[i], 1.0e-3);
                line += &format!(" {}/{:.2}", change.changed, change.most);
                if change.part() > limits(technique).flips {
                    let title = format!("{}, {}", guise.name, technique.name());
                    faults.push(format!("{title}: {change:?}"));
                }
            }
            println!("{line}");
        }
    }
    rig.end();
    judge(&faults);
}

/// Turned, moved and mirrored: maps are fitted to boxes along the axes, so that their texels lie
/// elsewhere. `hard` decides by triangles and hardly notices.
#[test]
fn turned_moved_or_mirrored() {
    let _one = support::serial();
    let mut rig = Rig::new();
    let mut faults = Vec::new();
    let turn = DQuat::from_euler(EulerRot::YXZ, 0.7, 1.9, -0.4);
    let similarity = Similarity {
        scale: 1.0,
        turn,
        shift: DVec3::new(9.0, -4.0, 7.0),
    };
    for (number, case) in cases().into_iter().enumerate() {
        let here = sure(&case);
        let turned = case.seen_as(&similarity);
        let mirrored = case.mirrored();
        let there = sure(&turned);
        for technique in techniques() {
            if !is_asked(technique, &case, number) {
                continue;
            }
            let limits = limits(technique);
            let before = rig.draw_once(&case, technique);
            let sure = |i: usize| here[i] && there[i];
            let found = rig.draw(&turned, technique);
            let image = flipped(&rig.draw(&mirrored, technique));
            for (guise, after) in [("turned", found), ("mirrored", image)] {
                let title = format!("{:28} {:5} {guise}", case.name, technique.name());
                let change = Change::of(&before, &after, sure, 1.01 * limits.step.min(0.5));
                println!(
                    "{title}: {} of {} by more than a step, rms {:.3}, mean {:+.4}, most {:.2}",
                    change.changed, change.pixels, change.rms, change.mean, change.most
                );
                let hard = technique == Technique::Hard;
                let fine = if case.fine { limits.fine } else { MAY_FLIP };
                // Where shadows are finer than a texel, or a light so small that no pixel is partly lit, one pixel
                // in a thousand says nothing of the others.
                let all_or_none = case.area_light().shape.reach() < 1.0e-5;
                let few = (case.fine || all_or_none) && change.part() <= limits.fine.min(0.001);
                if hard && change.part() > fine || change.rms > limits.turned && !few {
                    faults.push(format!("{title}: {change:?}"));
                }
                // What is finer than a texel may come and go as a whole.
                let shift = if case.fine { limits.fine } else { 0.0 };
                if change.mean.abs() > shift.max(limits.turned_mean) {
                    faults.push(format!(
                        "{title}: the whole picture changes by {}",
                        change.mean
                    ));
                }
            }
        }
    }
    rig.end();
    judge(&faults);
}

/// Light and camera go on by a millimetre or so a frame: no flicker.
#[test]
fn a_small_move_is_a_small_change() {
    let _one = support::serial();
    let mut rig = Rig::new();
    let mut faults = Vec::new();
    for (number, case) in cases().into_iter().enumerate() {
        let sun = case.area_light().shape.is_sun();
        let light = Vec3::new(0.6, 0.0, 0.8) * if sun { 5.0e-4 } else { 1.0e-3 };
        let camera = Vec3::new(0.3, 0.4, -0.2) * 1.0e-3 * case.camera.position.length() / 5.0;
        let moves = [
            ("light", case.light_moved(light)),
            ("camera", case.camera_moved(camera)),
        ];
        let here = known(&case);
        for (what, moved) in moves {
            let there = known(&moved);
            let sure = |i: usize| here.sure[i] && there.sure[i];
            let truth = Change::of(&here.center, &there.center, sure, 0.5);
            for technique in techniques() {
                if !is_asked(technique, &case, number) {
                    continue;
                }
                let limits = limits(technique);
                let before = rig.draw_once(&case, technique);
                let after = rig.draw(&moved, technique);
                let change = Change::of(&before, &after, sure, limits.jump);
                let title = format!("{:28} {:5} {what}", case.name, technique.name());
                println!(
                    "{title}: {} of {} jump (truth {}), 99.9 % within {:.3}, mean {:+.5}",
                    change.changed, change.pixels, truth.changed, change.p999, change.mean
                );
                if change.part() > truth.part() + limits.jumps {
                    faults.push(format!("{title}: {change:?}, of the truth {truth:?}"));
                }
            }
        }
    }
    assert_eq!(PIXELS, 64 * 64);
    rig.end();
    judge(&faults);
}
