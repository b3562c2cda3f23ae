//! Many thin blockers in a row.

use std::f64::consts::PI;

use super::super::document::{Document, Surface};
use super::super::mesh::Mesh;
use super::super::shapes::{block, cuboid, frustum, plane, rod, slab};

/// A comb that leans on its teeth, and a short one that lies on a block. The gaps are a tenth of
/// the light: far from the teeth, their shadow is one grey band.
pub fn comb() -> Document {
    let mut b = Document::default();
    let ground = b.material("ground", [0.66, 0.63, 0.58]);
    let horn = b.material("horn", [0.72, 0.30, 0.14]);
    let jade = b.material("jade", [0.20, 0.52, 0.36]);
    let slate = b.material("slate", [0.30, 0.33, 0.38]);
    b.add("plane", ground, &plane(40.0));
    let comb = |teeth: u32, pitch: f64, length: f64| {
        let width = pitch * f64::from(teeth);
        let tooth = frustum([0.25 * pitch, 0.03], [0.6 * pitch, 0.07], length);
        let teeth = (0..teeth).map(|i| {
            let x = pitch * (f64::from(i) + 0.5) - 0.5 * width;
            tooth.moved([x, 0.0, 0.0])
        });
        let spine = slab(
            [-0.5 * width - 0.06, length - 0.01, -0.05],
            [0.5 * width + 0.06, length + 0.26, 0.05],
        );
        Mesh::joined(teeth.chain([spine]))
    };
    let leaning = comb(34, 0.085, 1.15).pitched(0.16).turned(0.1);
    b.add("comb", horn, &leaning.moved([-0.1, 0.004, -0.55]));
    b.add(
        "block",
        slate,
        &block([0.55, 0.5, 0.55], 0.3, [0.85, 0.0, 1.5]),
    );
    let lying = comb(18, 0.06, 0.55).pitched(0.5 * PI).turned(0.75);
    b.add("short comb", jade, &lying.moved([0.6, 0.54, 1.25]));
    b.light(
        "disk",
        r#""type":"point","color":[1,0.95,0.87],"intensity":110,"extras":{"shape":"disk","radius":0.4}"#,
        [-2.9, 4.0, -3.5],
        [0.4, 0.0, 1.0],
    );
    b.camera("camera", 36.0, [0.8, 4.0, 6.4], [0.25, 0.3, 0.55]);
    b
}

/// A fence of upright bars before a wire fence: bars of 6 to 24 mm, seen from some 4 m.
pub fn fences() -> Document {
    let mut b = Document::default();
    let ground = b.material("ground", [0.58, 0.56, 0.50]);
    let iron = b.surface(&Surface {
        name: "iron",
        color: [0.16, 0.20, 0.26],
        metallic: 0.4,
        roughness: 0.5,
        ..Surface::default()
    });
    let wire = b.material("wire", [0.40, 0.52, 0.36]);
    let wood = b.material("wood", [0.62, 0.40, 0.22]);
    let brick = b.material("brick", [0.66, 0.32, 0.24]);
    b.add("plane", ground, &plane(30.0));
    // Front: uprights of three sizes between two rails.
    let mut front = Vec::new();
    for i in 0..23u8 {
        let x = -1.54 + 0.14 * f64::from(i);
        let (radius, top) =
            [(0.012, 1.12), (0.003, 0.98), (0.006, 1.02), (0.003, 0.98)][usize::from(i % 4)];
        front.push(rod(8, [x, 0.0, 0.0], [x, top, 0.0], radius, radius));
    }
    for y in [0.18, 0.86] {
        front.push(cuboid([3.2, 0.02, 0.012]).moved([0.0, y, 0.0]));
    }
    b.add("front fence", iron, &Mesh::joined(front).turned(0.1));
    // Back: a grid of wires, slanted, between posts.
    let mut back = Vec::new();
    for i in 0..28 {
        let x = -1.75 + 0.125 * f64::from(i);
        for slant in [-0.35, 0.35] {
            let (low, high) = ([x - slant, 0.06, 0.0], [x + slant, 1.2, 0.0]);
            let inside = |p: f64| (-1.75..=1.75).contains(&p);
            if inside(low[0]) && inside(high[0]) {
                back.push(rod(5, low, high, 0.0035, 0.0035));
            }
        }
    }
    for y in [0.06, 1.2] {
        back.push(rod(6, [-1.75, y, 0.0], [1.75, y, 0.0], 0.005, 0.005));
    }
    let back = Mesh::joined(back).turned(-0.12);
    b.add("back fence", wire, &back.moved([0.0, 0.0, -0.85]));
    let posts = [-1.75, 0.0, 1.75].map(|x| block([0.07, 1.3, 0.07], 0.0, [x, 0.0, -0.04]));
    let posts = Mesh::joined(posts).turned(-0.12);
    b.add("posts", wood, &posts.moved([0.0, 0.0, -0.85]));
    b.add(
        "box",
        brick,
        &block([0.42, 0.34, 0.42], 0.5, [0.55, 0.0, 0.75]),
    );
    b.light(
        "panel",
        r#""type":"spot","color":[1,0.96,0.88],"intensity":120,"spot":{"innerConeAngle":0.6,"outerConeAngle":1.1},"extras":{"shape":"rect","width":0.34,"height":0.22}"#,
        [-1.5, 3.3, -4.2],
        [0.1, 0.2, 0.3],
    );
    b.camera("camera", 38.0, [0.8, 2.5, 4.1], [0.05, 0.35, 0.05]);
    b
}
