//! Scenes that are fine to look at and hard on a reader.

use super::super::document::{Document, Place, Surface};
use super::super::math::{V3, about, combined};
use super::super::mesh::Mesh;
use super::super::shapes::{column, cuboid, frustum, lathe, plane, rod, sheet, smoothed, sphere};

/// Nodes that mirror and stretch, nested; meshes inside out, open, doubled, with triangles of no
/// area.
pub fn mirrored() -> Document {
    let mut b = Document::default();
    let ground = b.material("ground", [0.62, 0.60, 0.58]);
    let red = b.material("red", [0.74, 0.22, 0.18]);
    let blue = b.material("blue", [0.20, 0.38, 0.66]);
    let gold = b.material("gold", [0.82, 0.62, 0.22]);
    let green = b.material("green", [0.30, 0.54, 0.30]);
    // Shaded on both sides all the same: nothing culls.
    let single = b.surface(&Surface {
        name: "single-sided",
        color: [0.68, 0.46, 0.66],
        double_sided: false,
        ..Surface::default()
    });
    b.add("plane", ground, &plane(30.0));
    // A lopsided body, so that a mirror shows: an arm to the right only.
    let arm = rod(10, [0.0, 0.62, 0.0], [0.42, 0.82, 0.0], 0.05, 0.03);
    let hand = sphere(3).scaled(0.08).moved([0.45, 0.84, 0.0]);
    let foot = frustum([0.42, 0.3], [0.14, 0.14], 0.7);
    let pawn = Mesh::joined([
        foot,
        arm,
        hand,
        sphere(4).scaled(0.15).moved([0.0, 0.8, 0.0]),
    ]);
    let pawn = b.mesh("pawn", &[(red, &pawn)]);
    let at = |x: f64, z: f64| Place::at([x, 0.0, z]);
    let scaled = |x: f64, z: f64, scale: V3| Place {
        scale: Some(scale),
        ..at(x, z)
    };
    b.instance("plain", pawn, &at(-1.75, -0.3));
    b.instance(
        "mirrored in x",
        pawn,
        &scaled(-0.75, -0.3, [-1.0, 1.0, 1.0]),
    );
    b.instance("stretched", pawn, &scaled(0.35, -0.5, [0.6, 1.7, -1.5]));
    // Upside down, hung up again by its parent; the parent's stretch shears the turned child.
    let child = b.instance(
        "turned child",
        pawn,
        &Place {
            rotation: Some(about([0.0, 0.0, 1.0], 0.5)),
            scale: Some([1.0, -1.0, 1.0]),
            ..Place::at([0.15, 0.95, 0.0])
        },
    );
    let turn = combined(about([0.0, 1.0, 0.0], 0.6), about([1.0, 0.0, 0.0], 0.0));
    let inner = b.group(
        "mirror",
        &Place {
            rotation: Some(turn),
            scale: Some([-1.2, 0.8, 0.9]),
            ..Place::default()
        },
        &[child],
    );
    let matrix = [
        1.0, 0.0, 0.0, 0.0, //
        0.15, 1.1, 0.0, 0.0, //
        0.0, 0.0, 0.8, 0.0, //
        1.45, 0.1, -0.4, 1.0,
    ];
    let sheared = Place {
        matrix: Some(matrix),
        ..Place::default()
    };
    b.group("sheared", &sheared, &[inner]);
    // Inside out; open.
    let ball = sphere(6).scaled(0.3).inside_out();
    b.add("inside-out ball", blue, &ball.moved([-1.2, 0.3, 0.95]));
    let bowl = lathe(28, &[[0.05, 0.0], [0.2, 0.06], [0.32, 0.18], [0.38, 0.36]]);
    b.add("open bowl", gold, &bowl.moved([-0.25, 0.005, 1.1]));
    let tube = column(20, 0.16, 0.6).without_normals();
    let open = Mesh {
        // Without the two ends, which come last.
        indices: tube.indices[..20 * 6].to_vec(),
        ..tube
    };
    b.add("open tube", single, &open.moved([0.5, 0.0, 0.95]));
    b.add(
        "flag",
        single,
        &sheet(0.7, 0.5)
            .tilted(1.25)
            .turned(0.5)
            .moved([1.15, 0.5, 0.85]),
    );
    // The same box twice, and once more with the other winding; then corners in one point and in
    // one line.
    let cube = cuboid([0.42, 0.42, 0.42])
        .turned(0.4)
        .moved([1.75, 0.21, 0.9]);
    let mut doubled = Mesh::joined([cube.clone(), cube.clone()]);
    let again: Vec<u32> = cube.inside_out().indices;
    doubled.indices.extend(again);
    doubled.indices.extend([0, 0, 1, 5, 5, 5]);
    let first = doubled.positions.len() as u32;
    for i in 0..3 {
        doubled.positions.push([1.6 + 0.1 * f64::from(i), 0.6, 0.9]);
        doubled.normals.push([0.0, 1.0, 0.0]);
    }
    doubled.indices.extend([first, first + 1, first + 2]);
    b.add("doubled box", green, &doubled);
    b.light(
        "disk",
        r#""type":"point","color":[1,0.95,0.88],"intensity":100,"extras":{"shape":"disk","radius":0.35}"#,
        [-3.3, 4.2, 0.3],
        [0.2, 0.2, 0.2],
    );
    b.camera("camera", 36.0, [0.6, 3.7, 6.2], [0.12, 0.45, 0.3]);
    b
}

/// A still life 100 km away from the origin.
pub fn far_away() -> Document {
    let mut b = Document::default();
    let cloth = b.material("cloth", [0.58, 0.60, 0.66]);
    let glaze = b.material("glaze", [0.16, 0.36, 0.52]);
    let apple = b.material("apple", [0.68, 0.16, 0.12]);
    let lemon = b.material("lemon", [0.86, 0.70, 0.16]);
    let oak = b.material("oak", [0.52, 0.34, 0.18]);
    b.add("table", cloth, &plane(12.0));
    let jug = smoothed(&[
        [0.0, 0.0],
        [0.09, 0.0],
        [0.09, 0.0],
        [0.15, 0.07],
        [0.175, 0.16],
        [0.15, 0.27],
        [0.085, 0.37],
        [0.07, 0.44],
        [0.095, 0.5],
        [0.085, 0.5],
        [0.06, 0.44],
        [0.06, 0.3],
    ]);
    b.add("jug", glaze, &lathe(36, &jug).moved([-0.22, 0.0, -0.12]));
    b.add(
        "apple",
        apple,
        &sphere(6).scaled(0.085).moved([0.1, 0.085, 0.1]),
    );
    b.add(
        "second apple",
        apple,
        &sphere(6).scaled(0.08).moved([0.24, 0.08, -0.02]),
    );
    let fruit = sphere(6).scaled(0.06).moved([-0.12, 0.06, 0.26]);
    b.add("lemon", lemon, &fruit);
    b.add(
        "board",
        oak,
        &cuboid([0.5, 0.02, 0.34])
            .turned(0.4)
            .moved([0.38, 0.18, -0.22]),
    );
    b.add(
        "box",
        oak,
        &cuboid([0.2, 0.17, 0.16])
            .turned(0.4)
            .moved([0.38, 0.085, -0.22]),
    );
    b.light(
        "disk",
        r#""type":"point","color":[1,0.92,0.80],"intensity":5,"extras":{"shape":"disk","radius":0.1}"#,
        [-0.95, 1.25, -0.3],
        [0.0, 0.1, 0.0],
    );
    b.camera("camera", 34.0, [0.16, 1.15, 1.62], [0.1, 0.14, 0.0]);
    let all = b.roots();
    b.group("far away", &Place::at([60000.0, 0.0, -80000.0]), &all);
    b
}
