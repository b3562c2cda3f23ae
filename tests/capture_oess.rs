//! `oess` against closed forms: half-planes, strips and slots under a line, lines that shrink to a
//! point.

mod support;

use antumbra::light::LightShape;
use antumbra::scene::{Primitive, Scene};
use support::plates::{HEIGHT, SIZE, floor, floor_x, plate, scene};
use support::rig::render;

/// Half the length of the line along x, metres.
const HALF: f32 = 1.0;

/// Depth of a plate below the light and its range along x; it is endless along z.
type Plate = (f32, [f32; 2]);

fn line(length: f32) -> LightShape {
    LightShape::Line { length }
}

/// Part of the line that level plates, given by depth and x range, leave free of a point of the floor.
fn truth(x: f32, plates: &[Plate]) -> f32 {
    const STEPS: u32 = 4000;
    let free = (0..STEPS).filter(|step| {
        let from = HALF * ((*step as f32 + 0.5) / (STEPS / 2) as f32 - 1.0);
        plates.iter().all(|(depth, range)| {
            let at = from + (x - from) * depth / HEIGHT;
            at < range[0] || at > range[1]
        })
    });
    free.count() as f32 / STEPS as f32
}

/// The largest error over the picture, in which nothing changes along z.
fn worst(image: &[f32], plates: &[Plate]) -> f32 {
    let truths: Vec<f32> = (0..SIZE).map(|i| truth(floor_x(i), plates)).collect();
    let errors = image.iter().enumerate();
    let errors = errors.map(|(i, v)| (v - truths[i % SIZE as usize]).abs());
    errors.fold(0.0, f32::max)
}

fn plates(blockers: &[Plate]) -> Scene {
    let plates = blockers
        .iter()
        .map(|(depth, x)| plate("blocker", *x, [-30.0, 30.0], *depth));
    let primitives: Vec<Primitive> = std::iter::once(floor()).chain(plates).collect();
    scene(primitives, line(2.0 * HALF))
}

/// What the reference line of [`truth`] is rounded by.
const ROUNDING: f32 = 1.0 / 4000.0;

#[test]
fn half_planes_strips_and_slots_are_exact() {
    let _one = support::serial();
    let cases: &[(&str, &[Plate])] = &[
        ("half-plane", &[(5.0, [-30.0, 0.0])]),
        ("half-plane, near the light", &[(2.0, [0.1, 30.0])]),
        ("half-plane, near the floor", &[(7.9, [-30.0, 0.3])]),
        ("wide strip", &[(5.0, [-1.2, 1.2])]),
        ("narrow strip, seen by neither end", &[(5.0, [-0.2, 0.2])]),
        ("slot", &[(5.0, [-30.0, -0.15]), (5.0, [0.15, 30.0])]),
        (
            "slot of two depths",
            &[(4.0, [-30.0, -0.1]), (6.0, [0.2, 30.0])],
        ),
        (
            "parallel half-planes",
            &[(3.0, [0.2, 30.0]), (6.0, [0.1, 30.0])],
        ),
    ];
    for (name, blockers) in cases {
        let techniques = [
            "oess",
            "oess:outreach=hull",
            "oess:outreach=hull,edges=texels",
        ];
        let images = render(&plates(blockers), &techniques);
        let errors: Vec<f32> = images.iter().map(|i| worst(i, blockers)).collect();
        println!("{name}: {errors:?}");
        for error in &errors[..2] {
            assert!(*error <= 0.005 + ROUNDING, "{name}: {errors:?}");
        }
    }
}

#[test]
fn nothing_is_full_light_and_a_cover_is_none() {
    let _one = support::serial();
    let techniques = [
        "oess",
        "oess:outreach=hull",
        "oess:outreach=hull,segments=3",
    ];
    let empty = render(&plates(&[]), &techniques);
    assert!(empty.iter().flatten().all(|v| *v == 1.0));
    let covered = render(&plates(&[(5.0, [-20.0, 20.0])]), &techniques);
    assert!(covered.iter().flatten().all(|v| *v == 0.0));
}

#[test]
fn a_line_of_no_length_is_the_hard_shadow() {
    let _one = support::serial();
    let blockers = [
        floor(),
        plate("blocker", [-0.3, 0.2], [-0.5, 0.1], 5.0),
        plate("other", [0.1, 0.4], [0.0, 0.6], 7.0),
    ];
    for length in [1.0e-9, 1.0e-4, 1.0e-3] {
        let scene = scene(blockers.to_vec(), line(length));
        let images = render(&scene, &["hard", "oess", "oess:outreach=hull"]);
        assert!(images[0].contains(&0.0) && images[0].contains(&1.0));
        for image in &images[1..] {
            let pairs = image.iter().zip(&images[0]);
            let off = pairs.filter(|(a, b)| (*a - *b).abs() > 1.0e-3).count();
            println!("{length} m: {off} pixels differ");
            let most = if length < 1.0e-5 {
                0
            } else {
                SIZE as usize / 8
            };
            assert!(off <= most, "{length} m: {off} pixels differ");
        }
    }
}
