//! Blockers with sharp edges under a disk, and bars under a rectangle.

use std::f64::consts::TAU;

use super::super::document::Document;
use super::super::math::{V3, add, cross, scale, sub, unit};
use super::super::mesh::Mesh;
use super::super::shapes::{block, slab};
use super::grounded;

fn disk(b: &mut Document, radius: f64, at: V3, target: V3) {
    let json = format!(
        r#""type":"point","color":[1,0.95,0.86],"intensity":70,"extras":{{"shape":"disk","radius":{radius}}}"#
    );
    b.light("disk", &json, at, target);
}

/// A prism over a star of `points` points, outer radius 1, from y = -`half` to `half`.
fn star(points: u32, inner: f64, half: f64) -> Mesh {
    let rim: Vec<[f64; 2]> = (0..2 * points)
        .map(|i| {
            let radius = if i % 2 == 0 { 1.0 } else { inner };
            let (s, c) = (TAU * f64::from(i) / f64::from(2 * points)).sin_cos();
            [radius * c, -radius * s]
        })
        .collect();
    let mut mesh = Mesh::default();
    for (i, &[ax, az]) in rim.iter().enumerate() {
        let [bx, bz] = rim[(i + 1) % rim.len()];
        let (up, down) = (half, -half);
        mesh.facet(&[[0.0, up, 0.0], [ax, up, az], [bx, up, bz]]);
        mesh.facet(&[[0.0, down, 0.0], [bx, down, bz], [ax, down, az]]);
        mesh.facet(&[[ax, down, az], [bx, down, bz], [bx, up, bz], [ax, up, az]]);
    }
    mesh
}

/// Concave blockers: seen from elsewhere on the light, their outline is made of other edges than
/// seen from its middle.
pub fn concave() -> Document {
    let mut b = grounded();
    let red = b.material("red", [0.72, 0.26, 0.20]);
    let blue = b.material("blue", [0.22, 0.36, 0.62]);
    let star = star(5, 0.42, 0.35).scaled(0.7).pitched(0.35).tilted(0.25);
    b.add("star", red, &star.moved([-0.35, 1.35, -0.1]));
    // A hook of one closed surface: the outer box and the notch in it.
    let hook = hook().turned(0.5).tilted(0.15).moved([0.95, 0.75, 0.55]);
    b.add("hook", blue, &hook);
    disk(&mut b, 0.45, [-1.2, 4.4, 1.2], [0.1, 0.5, 0.0]);
    b.camera("camera", 38.0, [0.9, 3.8, 4.8], [0.35, 0.4, 0.0]);
    b
}

/// A U of 0.8 x 0.5 x 0.6 m, its notch open along +Z.
fn hook() -> Mesh {
    let (w, h, d, t) = (0.4, 0.25, 0.3, 0.15);
    // Its outline in x and z, counter-clockwise from above.
    let outline = [
        [-w, d],
        [-w + t, d],
        [-w + t, -d + t],
        [w - t, -d + t],
        [w - t, d],
        [w, d],
        [w, -d],
        [-w, -d],
    ];
    let caps = [[0, 1, 2, 7], [2, 3, 6, 7], [3, 4, 5, 6]];
    let mut mesh = Mesh::default();
    let corner = |i: usize, y: f64| -> V3 { [outline[i][0], y, outline[i][1]] };
    for cap in caps {
        let [i, j, k, l] = cap;
        mesh.facet(&[corner(i, h), corner(j, h), corner(k, h), corner(l, h)]);
        mesh.facet(&[corner(l, -h), corner(k, -h), corner(j, -h), corner(i, -h)]);
    }
    for i in 0..outline.len() {
        let next = (i + 1) % outline.len();
        mesh.facet(&[
            corner(i, -h),
            corner(next, -h),
            corner(next, h),
            corner(i, h),
        ]);
    }
    mesh
}

/// A trefoil knot of 5,760 triangles whose middle is `height` above the ground.
pub fn knot(height: f64) -> Document {
    const ALONG: u32 = 240;
    const AROUND: u32 = 12;
    let center = |i: u32| -> V3 {
        let angle = 2.0 * TAU * f64::from(i) / f64::from(ALONG);
        let (s, c) = angle.sin_cos();
        let (high, wide) = (1.5 * angle).sin_cos();
        let radius = 0.42 + 0.17 * wide;
        [radius * c, 0.20 * high, radius * s]
    };
    let mut mesh = Mesh::default();
    for i in 0..ALONG {
        let at = center(i);
        let along = unit(sub(center(i + 1), center((i + ALONG - 1) % ALONG)));
        let out = unit(cross(along, cross([at[0], at[1], at[2]], along)));
        let side = cross(along, out);
        for k in 0..AROUND {
            let (s, c) = (TAU * f64::from(k) / f64::from(AROUND)).sin_cos();
            let normal = add(scale(out, c), scale(side, s));
            mesh.positions.push(add(at, scale(normal, 0.075)));
            mesh.normals.push(normal);
        }
    }
    for i in 0..ALONG {
        let (low, high) = (i * AROUND, (i + 1) % ALONG * AROUND);
        for k in 0..AROUND {
            let next = (k + 1) % AROUND;
            mesh.indices.extend([low + k, low + next, high + k]);
            mesh.indices.extend([low + next, high + next, high + k]);
        }
    }
    let mut b = grounded();
    let brass = b.material("brass", [0.74, 0.58, 0.26]);
    let mesh = mesh.pitched(0.3).moved([0.0, height, 0.0]);
    b.add("knot", brass, &mesh);
    disk(&mut b, 0.2, [-1.0, 4.6, 0.8], [0.0, 0.5, 0.0]);
    b.camera("camera", 38.0, [0.8, 4.2, 5.6], [0.3, 1.0, -0.1]);
    b
}

/// Bars at three heights over all that the camera sees: every pixel has blockers between itself
/// and the light, at any size of the light.
pub fn bars() -> Document {
    let mut b = grounded();
    let wood = b.material("wood", [0.66, 0.48, 0.30]);
    let rows = [1.6, 2.2, 2.8];
    for (row, high) in rows.into_iter().enumerate() {
        let bars = (-40..40).map(|i| {
            let x = 0.16 * f64::from(i) + 0.03 * row as f64;
            slab([x, high, -6.0], [x + 0.03, high + 0.03, 6.0])
        });
        b.add(&format!("bars {row}"), wood, &Mesh::joined(bars));
    }
    let stone = b.material("stone", [0.5, 0.5, 0.52]);
    b.add(
        "stone",
        stone,
        &block([0.5, 0.3, 0.5], 0.4, [0.1, 0.0, 0.0]),
    );
    b.light(
        "panel",
        r#""type":"point","color":[1,0.97,0.92],"intensity":160,"extras":{"shape":"rect","width":0.4,"height":0.4}"#,
        [0.2, 5.0, 0.2],
        [0.2, 0.0, 0.19],
    );
    b.camera("camera", 40.0, [0.0, 1.45, 2.0], [0.0, 0.0, 0.2]);
    b
}
