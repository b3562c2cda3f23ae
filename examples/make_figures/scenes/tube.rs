//! Under a fluorescent tube, after the figures of the linear light's paper.

use std::f64::consts::TAU;

use super::super::document::Document;
use super::super::field::Field;
use super::super::math::V3;
use super::super::mesh::Mesh;
use super::super::net::{Room, mesh_of};
use super::super::shapes::{arch_wall, block, column, cuboid, lathe, rod, slab, smoothed, sphere};
use super::grounded;

fn tube(b: &mut Document, length: f64, at: V3) {
    let json = format!(
        r#""type":"point","color":[0.95,0.97,1],"intensity":75,"extras":{{"shape":"line","length":{length}}}"#
    );
    b.light_up("tube", &json, at, [at[0], 0.0, at[2]], [0.0, 0.0, -1.0]);
}

/// Small bodies, holes, round surfaces, edges along the light and aslant.
pub fn geometric() -> Document {
    let mut b = grounded();
    let colors = [
        [0.80, 0.36, 0.28],
        [0.24, 0.46, 0.62],
        [0.84, 0.70, 0.40],
        [0.36, 0.52, 0.28],
    ];
    let [red, blue, sand, moss] = colors.map(|color| b.material("paint", color));
    // Small ones.
    for i in 0..7 {
        let (s, c) = (TAU * f64::from(i) / 7.0).sin_cos();
        let at = [-1.35 + 0.32 * c, 0.05, 0.75 + 0.32 * s];
        let small = match i % 2 {
            0 => sphere(4).scaled(0.05).moved(at),
            _ => cuboid([0.08, 0.1, 0.08]).turned(f64::from(i)).moved(at),
        };
        b.add(&format!("small {i}"), sand, &small);
    }
    // Holes.
    let wall = arch_wall(0.9, 0.8, 0.15, 0.25, 0.25).turned(0.4);
    b.add("arch", blue, &wall.moved([0.95, 0.0, -0.75]));
    let sieve = (0..4).flat_map(|i| {
        let at = -0.35 + 0.2 * f64::from(i);
        [
            slab([at, 0.0, -0.38], [at + 0.1, 0.03, 0.38]),
            slab([-0.38, 0.03, at], [0.38, 0.06, at + 0.1]),
        ]
    });
    b.add(
        "sieve",
        moss,
        &Mesh::joined(sieve).tilted(0.2).moved([1.3, 0.6, 0.7]),
    );
    // Round ones.
    b.add(
        "ball",
        red,
        &sphere(12).scaled(0.3).moved([-0.35, 0.3, 0.65]),
    );
    b.add("drum", sand, &column(40, 0.22, 0.5).moved([0.35, 0.0, 0.7]));
    // Edges along the light, across it, and aslant.
    b.add(
        "along",
        moss,
        &block([0.9, 0.45, 0.12], 0.0, [-1.1, 0.0, -0.6]),
    );
    b.add(
        "across",
        red,
        &block([0.12, 0.6, 0.7], 0.0, [-0.1, 0.0, -0.75]),
    );
    b.add(
        "aslant",
        blue,
        &rod(14, [-1.8, 0.05, 0.0], [-0.6, 0.85, 0.1], 0.04, 0.04),
    );
    tube(&mut b, 1.5, [0.0, 3.0, -0.2]);
    b.camera("camera", 38.0, [0.4, 4.0, 4.6], [0.15, 0.2, 0.05]);
    b
}

/// A big ball above a flat box: their penumbrae overlap.
pub fn overlap() -> Document {
    let mut b = grounded();
    let red = b.material("red", [0.80, 0.36, 0.28]);
    let blue = b.material("blue", [0.24, 0.46, 0.62]);
    b.add(
        "ball",
        red,
        &sphere(20).scaled(0.55).moved([-0.2, 1.45, -0.1]),
    );
    b.add(
        "box",
        blue,
        &block([1.5, 0.12, 0.9], 0.35, [0.3, 0.45, 0.2]),
    );
    tube(&mut b, 1.2, [-0.6, 3.6, 0.2]);
    b.camera("camera", 38.0, [0.8, 3.6, 4.6], [0.25, 0.4, 0.0]);
    b
}

/// Things on a table, which cast shadows on themselves and on each other.
pub fn everyday() -> Document {
    let mut b = grounded();
    let wood = b.material("wood", [0.56, 0.40, 0.26]);
    let white = b.material("china", [0.84, 0.82, 0.78]);
    let steel = b.material("steel", [0.50, 0.52, 0.55]);
    let red = b.material("red", [0.74, 0.24, 0.20]);
    let top = 0.75;
    let board = slab([-0.8, top - 0.04, -0.5], [0.8, top, 0.5]);
    let legs = [[-0.75, -0.45], [0.70, -0.45], [-0.75, 0.40], [0.70, 0.40]];
    let legs = legs.map(|[x, z]| slab([x, 0.0, z], [x + 0.05, top - 0.04, z + 0.05]));
    b.add(
        "table",
        wood,
        &Mesh::joined(legs.into_iter().chain([board])),
    );
    let mug = Field::slab(
        [0.0, 0.06, 0.0],
        [0.05, 0.06, 0.05],
        0.049,
        [0.0, 1.0, 0.0],
        0.0,
    );
    let hollow = Field::rod([0.0, 0.055, 0.0], [0.0, 0.2, 0.0], 0.042, 0.042);
    let handle = Field::ring([0.065, 0.062, 0.0], [0.0, 0.0, 1.0], 0.03, 0.008);
    let mug = Field::joined(vec![mug, handle], 0.004).without(vec![hollow], 0.004);
    let low = [-0.06, -0.04, -0.09];
    let mug = mesh_of(&mug, Room { low, side: 0.18 }, 16_000).scaled(1.5);
    b.add("mug", white, &mug.turned(0.6).moved([-0.45, top, 0.2]));
    // A bowl is a thin shell.
    let outline = [
        [0.0, 0.0],
        [0.08, 0.0],
        [0.16, 0.06],
        [0.2, 0.13],
        [0.19, 0.13],
        [0.15, 0.07],
        [0.07, 0.015],
        [0.0, 0.012],
    ];
    b.add(
        "bowl",
        white,
        &lathe(48, &smoothed(&outline)).moved([0.1, top, 0.15]),
    );
    b.add(
        "apple",
        red,
        &sphere(8).scaled(0.06).moved([0.1, top + 0.075, 0.15]),
    );
    let bottle = [
        [0.0, 0.0],
        [0.055, 0.0],
        [0.055, 0.2],
        [0.02, 0.28],
        [0.02, 0.36],
        [0.0, 0.36],
    ];
    b.add("bottle", steel, &lathe(32, &bottle).moved([0.5, top, -0.2]));
    let books = [
        ([0.30, 0.04, 0.22], 0.2, 0.0),
        ([0.26, 0.05, 0.19], -0.1, 0.04),
        ([0.22, 0.03, 0.16], 0.35, 0.09),
    ];
    let books = books.map(|(size, turn, y)| block(size, turn, [-0.3, top + y, -0.25]));
    b.add("books", red, &Mesh::joined(books));
    let fork = (0..4).map(|i| {
        let x = 0.42 + 0.012 * f64::from(i);
        rod(
            6,
            [x, top + 0.006, 0.18],
            [x, top + 0.012, 0.28],
            0.003,
            0.002,
        )
    });
    let grip = rod(
        8,
        [0.438, top + 0.008, 0.36],
        [0.438, top + 0.008, 0.27],
        0.006,
        0.012,
    );
    b.add("fork", steel, &Mesh::joined(fork.chain([grip])));
    tube(&mut b, 1.2, [0.05, 2.2, -0.1]);
    b.camera("camera", 36.0, [0.5, 1.95, 2.1], [0.05, 0.62, 0.0]);
    b
}
