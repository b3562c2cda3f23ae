//! Smooth closed bodies under a sphere light, after the figures of the occlusion camera's paper.

use super::super::document::Document;
use super::super::field::Field;
use super::super::math::V3;
use super::super::mesh::Mesh;
use super::super::net::{Room, mesh_of};
use super::grounded;

/// The light of the paper's bodies, of radius 0.1 m.
fn lamp(b: &mut Document, at: V3, target: V3) {
    b.light(
        "lamp",
        r#""type":"point","color":[1,0.95,0.86],"intensity":60,"extras":{"shape":"sphere","radius":0.1}"#,
        at,
        target,
    );
}

fn room(low: V3, side: f64) -> Room {
    Room { low, side }
}

/// A sitting animal with long ears, 1.5 m high.
pub fn bunny(triangles: usize) -> Document {
    let mirrored = |f: &dyn Fn(f64) -> Field| [f(1.0), f(-1.0)];
    let mut parts = vec![
        Field::ellipsoid([0.0, 0.46, -0.08], [0.34, 0.40, 0.44]),
        Field::ball([0.0, 0.62, 0.22], 0.25),
        Field::ellipsoid([0.0, 0.93, 0.36], [0.20, 0.20, 0.25]),
        Field::ball([0.0, 0.36, -0.55], 0.12),
    ];
    parts.extend(mirrored(&|s| {
        Field::ellipsoid([0.26 * s, 0.28, -0.10], [0.16, 0.24, 0.30])
    }));
    parts.extend(mirrored(&|s| {
        Field::rod(
            [0.24 * s, 0.075, -0.10],
            [0.22 * s, 0.075, 0.34],
            0.075,
            0.07,
        )
    }));
    parts.extend(mirrored(&|s| {
        Field::rod([0.12 * s, 0.50, 0.34], [0.12 * s, 0.07, 0.40], 0.08, 0.065)
    }));
    parts.extend(mirrored(&|s| {
        Field::rod([0.09 * s, 1.06, 0.28], [0.17 * s, 1.44, 0.10], 0.05, 0.065)
    }));
    let field = Field::joined(parts, 0.10);
    let mesh = mesh_of(&field, room([-0.8, -0.05, -0.8], 1.65), triangles);
    let mut b = grounded();
    let clay = b.material("clay", [0.78, 0.62, 0.48]);
    b.add("bunny", clay, &mesh.turned(0.7));
    lamp(&mut b, [-2.2, 3.6, 1.4], [0.0, 0.6, 0.0]);
    b.camera("camera", 34.0, [1.0, 3.0, 4.8], [0.45, 0.5, -0.1]);
    b
}

/// A four-legged animal: legs and their shadows cross each other in the light's view.
pub fn animal() -> Document {
    let mut parts = vec![
        Field::rod([0.0, 0.95, -0.45], [0.0, 0.98, 0.42], 0.24, 0.22),
        Field::ellipsoid([0.0, 0.88, -0.02], [0.23, 0.25, 0.45]),
    ];
    for (x, z, bend) in [
        (0.15, 0.45, 0.05),
        (-0.15, 0.38, -0.08),
        (0.16, -0.5, -0.10),
        (-0.16, -0.42, 0.06),
    ] {
        parts.extend(Field::chain(&[
            ([x, 0.86, z], 0.13),
            ([x * 0.95, 0.46, z + bend], 0.062),
            ([x * 0.95, 0.10, z + 0.3 * bend], 0.042),
            ([x * 0.95, 0.04, z + 0.3 * bend + 0.05], 0.05),
        ]));
    }
    parts.extend(Field::chain(&[
        ([0.0, 1.05, 0.48], 0.17),
        ([0.0, 1.36, 0.72], 0.11),
        ([0.0, 1.48, 0.80], 0.12),
        ([0.0, 1.34, 1.02], 0.065),
    ]));
    for side in [1.0, -1.0] {
        parts.extend(Field::chain(&[
            ([0.05 * side, 1.56, 0.76], 0.04),
            ([0.12 * side, 1.70, 0.74], 0.02),
        ]));
    }
    parts.extend(Field::chain(&[
        ([0.0, 1.08, -0.62], 0.05),
        ([0.0, 0.95, -0.80], 0.04),
        ([0.0, 0.55, -0.86], 0.055),
    ]));
    let field = Field::joined(parts, 0.06);
    let mesh = mesh_of(&field, room([-1.1, -0.1, -1.1], 2.3), 70_000);
    let mut b = grounded();
    let hide = b.material("hide", [0.60, 0.40, 0.24]);
    b.add("animal", hide, &mesh.turned(0.9));
    lamp(&mut b, [-2.0, 3.4, 1.6], [0.0, 0.7, 0.0]);
    b.camera("camera", 36.0, [1.0, 3.0, 5.2], [0.5, 0.55, -0.2]);
    b
}

fn teapot(triangles: usize) -> Mesh {
    let mut pot = vec![
        Field::ellipsoid([0.0, 0.40, 0.0], [0.46, 0.38, 0.46]),
        Field::ellipsoid([0.0, 0.08, 0.0], [0.28, 0.08, 0.28]),
    ];
    pot.extend(Field::chain(&[
        ([0.34, 0.34, 0.0], 0.14),
        ([0.58, 0.46, 0.0], 0.075),
        ([0.72, 0.70, 0.0], 0.05),
        ([0.82, 0.74, 0.0], 0.05),
    ]));
    let body = Field::joined(pot, 0.06);
    let handle = Field::ring([-0.50, 0.44, 0.0], [0.0, 0.0, 1.0], 0.20, 0.042);
    let lid = Field::ellipsoid([0.0, 0.755, 0.0], [0.26, 0.07, 0.26]);
    let knob = Field::joined(vec![lid, Field::ball([0.0, 0.87, 0.0], 0.062)], 0.05);
    // The lid is set off by a groove, the spout is open.
    let groove = Field::ring([0.0, 0.735, 0.0], [0.0, 1.0, 0.0], 0.275, 0.018);
    let spout = Field::rod([0.70, 0.72, 0.0], [0.92, 0.78, 0.0], 0.028, 0.034);
    let all = Field::joined(vec![body, handle, knob], 0.02).without(vec![groove, spout], 0.01);
    mesh_of(&all, room([-0.95, -0.5, -0.95], 1.9), triangles)
}

/// Two teapots, one upon a saucer.
pub fn teapots() -> Document {
    let mut b = grounded();
    let glaze = b.material("glaze", [0.30, 0.46, 0.62]);
    let cream = b.material("cream", [0.82, 0.76, 0.64]);
    b.add(
        "teapot",
        glaze,
        &teapot(40_000).turned(0.5).moved([-0.35, 0.0, 0.1]),
    );
    let small = teapot(20_000)
        .scaled(0.55)
        .turned(-2.0)
        .moved([0.75, 0.05, 0.45]);
    b.add("small teapot", cream, &small);
    let saucer = Field::ellipsoid([0.0, 0.03, 0.0], [0.42, 0.03, 0.42]);
    let saucer = mesh_of(&saucer, room([-0.6, -0.6, -0.6], 1.2), 6_000);
    b.add("saucer", cream, &saucer.moved([0.75, 0.0, 0.45]));
    lamp(&mut b, [-2.4, 3.0, 1.0], [0.0, 0.3, 0.0]);
    b.camera("camera", 34.0, [0.6, 2.6, 4.0], [0.3, 0.25, 0.1]);
    b
}

/// An aircraft 1.1 m above the ground; the paper has the light's radius at 0, 0.1 and 0.3.
pub fn aircraft() -> Document {
    let level = [0.0, 1.0, 0.0];
    let mut parts = vec![
        Field::rod([0.0, 0.0, -0.85], [0.0, 0.0, 0.80], 0.085, 0.13),
        Field::ellipsoid([0.0, 0.10, 0.52], [0.085, 0.10, 0.22]),
    ];
    for side in [1.0, -1.0] {
        let wing = |center, half, angle: f64| Field::slab(center, half, 0.016, level, angle * side);
        parts.push(wing([0.55 * side, -0.02, 0.05], [0.56, 0.018, 0.15], 0.28));
        parts.push(wing([0.22 * side, 0.03, -0.80], [0.24, 0.016, 0.085], 0.32));
        parts.push(Field::rod(
            [0.45 * side, -0.10, -0.02],
            [0.45 * side, -0.10, 0.30],
            0.05,
            0.062,
        ));
    }
    parts.push(Field::slab(
        [0.0, 0.20, -0.82],
        [0.016, 0.20, 0.10],
        0.015,
        [1.0, 0.0, 0.0],
        -0.35,
    ));
    let field = Field::joined(parts, 0.04);
    let mesh = mesh_of(&field, room([-1.25, -1.25, -1.25], 2.5), 50_000);
    let mut b = grounded();
    let paint = b.material("paint", [0.72, 0.72, 0.76]);
    let mesh = mesh.tilted(0.25).turned(0.8).moved([0.0, 1.1, 0.0]);
    b.add("aircraft", paint, &mesh);
    lamp(&mut b, [-1.6, 4.4, 0.8], [0.0, 0.8, 0.0]);
    b.camera("camera", 38.0, [0.9, 3.6, 4.6], [0.4, 0.45, -0.1]);
    b
}

/// A plate with small dents that the light grazes: each casts a shadow into itself.
pub fn dents() -> Document {
    let plate = Field::slab(
        [0.0, 0.10, 0.0],
        [0.8, 0.10, 0.8],
        0.02,
        [0.0, 1.0, 0.0],
        0.0,
    );
    let mut holes = Vec::new();
    for row in 0..5 {
        for column in 0..5 {
            let at = |i: i32| 0.29 * f64::from(i - 2);
            let (i, radius) = (f64::from(row * 5 + column), 0.05 + 0.012 * f64::from(row));
            // From flat ones to some deeper than half a ball.
            let depth = radius * (0.2 + 0.05 * i);
            let center = [at(column), 0.20 + radius - depth, at(row)];
            holes.push(Field::ball(center, radius));
        }
    }
    let field = plate.without(holes, 0.008);
    let mesh = mesh_of(&field, room([-1.0, -0.9, -1.0], 2.0), 120_000);
    let mut b = grounded();
    let clay = b.material("clay", [0.74, 0.66, 0.58]);
    b.add("plate", clay, &mesh.turned(0.3));
    lamp(&mut b, [-2.6, 1.9, 1.0], [0.0, 0.1, 0.0]);
    b.camera("camera", 34.0, [0.3, 2.8, 2.6], [0.1, 0.1, 0.0]);
    b
}
