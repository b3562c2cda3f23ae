//! A tree of over a million triangles, and a bush among poles.

use std::f64::consts::TAU;

use super::super::document::{Document, Place};
use super::super::math::{Chance, V3, about, across, add, combined, scale, unit};
use super::super::mesh::Mesh;
use super::super::shapes::{column, rod};
use super::grounded;

/// A leaf from the origin along +Z, 1 long and curled: 8 triangles.
fn leaf(width: f64, curl: f64) -> Mesh {
    let spine = [(0.0, 0.0), (0.3, 0.8), (0.65, 0.9), (1.0, 0.0)];
    let mut mesh = Mesh::default();
    let at = |side: f64, (z, w): (f64, f64)| -> V3 {
        let x = 0.5 * width * w * side;
        [x, 0.35 * x.abs() - curl * z * z, z]
    };
    for side in [1.0, -1.0] {
        for pair in spine.windows(2) {
            let [low, high] = [pair[0], pair[1]];
            let corners = [at(0.0, low), at(side, low), at(side, high), at(0.0, high)];
            let [a, b, c, d] = corners;
            let mut triangle = |x: V3, y: V3, z: V3| match side > 0.0 {
                true => mesh.facet(&[x, z, y]),
                false => mesh.facet(&[x, y, z]),
            };
            if low.1 > 0.0 {
                triangle(a, b, c);
            }
            if high.1 > 0.0 {
                triangle(a, c, d);
            } else {
                triangle(a, b, d);
            }
        }
    }
    mesh
}

/// `count` leaves in a ball of radius 1 about a few twigs, each `size` long.
fn spray(count: u32, size: f64, seed: u64) -> Mesh {
    let mut chance = Chance(seed);
    let mut mesh = Mesh::default();
    for _ in 0..count {
        let leaf = leaf(chance.between(0.4, 0.6), chance.between(0.1, 0.4));
        let leaf = leaf.scaled(size * chance.between(0.7, 1.2));
        let leaf = leaf
            .pitched(chance.between(-0.4, 1.0))
            .turned(TAU * chance.part());
        let leaf = leaf.tilted(chance.between(-0.4, 0.4));
        mesh.append(&leaf.moved(scale(chance.in_ball(), 0.9)));
    }
    mesh
}

/// Grows branches from `at`; puts their ends into `tips`.
fn branch(
    wood: &mut Mesh,
    tips: &mut Vec<V3>,
    chance: &mut Chance,
    (at, way): (V3, V3),
    (length, radius): (f64, f64),
    levels: u32,
) {
    let end = add(at, scale(way, length));
    let thin = 0.68 * radius;
    wood.append(&rod(9, at, end, radius, thin));
    // Leaves grow along the outer branches too.
    if levels < 2 {
        tips.push(add(at, scale(way, 0.6 * length)));
    }
    if levels == 0 {
        tips.push(end);
        return;
    }
    let (u, v) = across(way);
    let children = 3;
    let start = chance.part();
    for i in 0..children {
        let turn = TAU * (start + (f64::from(i) + 0.4 * chance.part()) / f64::from(children));
        let (s, c) = turn.sin_cos();
        let lean = chance.between(0.45, 0.85);
        let out = add(scale(u, c * lean), scale(v, s * lean));
        let way = unit(add(add(way, out), [0.0, 0.12, 0.0]));
        let length = length * chance.between(0.66, 0.82);
        branch(
            wood,
            tips,
            chance,
            (end, way),
            (length, 0.9 * thin),
            levels - 1,
        );
    }
}

/// Sprays at each of `places`, of radius `size`, from a few shared meshes.
fn foliage(b: &mut Document, material: usize, places: &[V3], size: f64, leaves: u32) {
    const KINDS: usize = 4;
    let kinds: Vec<usize> = (0..KINDS)
        .map(|kind| {
            let spray = spray(leaves, 0.16 / size, 7 + kind as u64).scaled(size);
            b.mesh(&format!("spray {kind}"), &[(material, &spray)])
        })
        .collect();
    let mut chance = Chance(99);
    for (i, place) in places.iter().enumerate() {
        let turn = about([0.0, 1.0, 0.0], TAU * chance.part());
        let tilt = about([1.0, 0.0, 0.0], chance.between(-0.5, 0.5));
        let place = Place {
            rotation: Some(combined(turn, tilt)),
            ..Place::at(place.map(|x| (x * 1e4).round() / 1e4))
        };
        b.instance(&format!("leaves {i}"), kinds[i % KINDS], &place);
    }
}

/// A tree 8 m high of over a million triangles in sunlight; the paper has it in light of ten times
/// the sun's solid angle too.
pub fn tree() -> Document {
    let mut b = grounded();
    let bark = b.material("bark", [0.36, 0.27, 0.20]);
    let green = b.material("green", [0.26, 0.42, 0.16]);
    let (mut wood, mut tips) = (Mesh::default(), Vec::new());
    let start = ([0.0, -0.1, 0.0], [0.0, 1.0, 0.0]);
    branch(&mut wood, &mut tips, &mut Chance(5), start, (2.3, 0.22), 5);
    b.add("wood", bark, &wood);
    foliage(&mut b, green, &tips, 0.42, 260);
    b.light(
        "sun",
        r#""type":"directional","color":[1,0.95,0.86],"intensity":3,"extras":{"angular_diameter_deg":0.53}"#,
        [-5.0, 9.0, 3.0],
        [0.0, 0.0, 0.0],
    );
    b.camera("camera", 44.0, [4.0, 7.0, 15.0], [1.6, 2.6, 0.0]);
    b
}

/// Poles and a bush, all about the light in the middle above them.
fn garden() -> Document {
    let mut b = grounded();
    let pole = b.material("pole", [0.80, 0.70, 0.46]);
    let bark = b.material("bark", [0.36, 0.27, 0.20]);
    let green = b.material("green", [0.30, 0.46, 0.18]);
    for i in 0..6 {
        let x = -1.9 + 0.34 * f64::from(i);
        let at = [x, 0.0, -0.9 + 0.05 * f64::from(i * i)];
        let pole_mesh = column(16, 0.035, 1.3 + 0.12 * f64::from(i)).moved(at);
        b.add(&format!("pole {i}"), pole, &pole_mesh);
    }
    let (mut wood, mut tips) = (Mesh::default(), Vec::new());
    let mut chance = Chance(11);
    for i in 0..5 {
        let (s, c) = (TAU * f64::from(i) / 5.0).sin_cos();
        let way = unit([0.5 * c, 1.0, 0.5 * s]);
        branch(
            &mut wood,
            &mut tips,
            &mut chance,
            ([0.9, -0.02, 0.3], way),
            (0.36, 0.03),
            2,
        );
    }
    b.add("wood", bark, &wood);
    foliage(&mut b, green, &tips, 0.22, 40);
    b.camera("camera", 38.0, [0.3, 4.0, 5.2], [0.0, 0.4, -0.1]);
    b
}

fn square(b: &mut Document, name: &str, side: f64, intensity: f64, at: V3) {
    let json = format!(
        r#""type":"point","color":[1,0.96,0.90],"intensity":{intensity},"extras":{{"shape":"rect","width":{side},"height":{side}}}"#
    );
    b.light(name, &json, at, [0.0; 3]);
}

/// Under one square light; the paper has two sizes of it.
pub fn bush() -> Document {
    let mut b = garden();
    square(&mut b, "panel", 0.5, 80.0, [-0.8, 4.2, 1.4]);
    b
}

/// Under four small lights, at the corners of a large one: one light with weights, dark but there.
pub fn corners() -> Document {
    let mut b = garden();
    const SIDE: f64 = 1.8;
    const ROWS: [&str; 12] = [
        "[1,0,0,0,0,0,0,0,0,0,0,1]",
        DARK,
        DARK,
        DARK,
        DARK,
        DARK,
        DARK,
        DARK,
        DARK,
        DARK,
        DARK,
        "[1,0,0,0,0,0,0,0,0,0,0,1]",
    ];
    const DARK: &str = "[0,0,0,0,0,0,0,0,0,0,0,0]";
    let json = format!(
        r#""type":"point","color":[1,0.96,0.90],"intensity":80,"extras":{{"shape":"rect","width":{SIDE},"height":{SIDE},"weights":[{}]}}"#,
        ROWS.join(",")
    );
    b.light("corners", &json, [-0.8, 4.2, 1.4], [0.0; 3]);
    b
}
