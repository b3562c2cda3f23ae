//! A tree of a trunk, branches and cut-out leaves.

use std::f64::consts::TAU;

use super::super::document::{Document, Surface, Wrap};
use super::super::math::{Chance, V3, across, add, cross, mix, scale, unit};
use super::super::mesh::Mesh;
use super::super::png::Image;
use super::super::shapes::{plane, tube};

const LEAVES: u32 = 1300;

/// The sun and a lamp on a tree and a bush.
pub fn foliage() -> Document {
    let mut b = Document::default();
    let bark = b.material("bark", [0.36, 0.25, 0.17]);
    let leaf_image = b.texture("leaf", &leaf_image().to_png(), Wrap::Clamp);
    let leaf = b.surface(&Surface {
        name: "leaf",
        color: [0.9, 1.0, 0.8],
        roughness: 0.7,
        texture: Some(leaf_image),
        cutoff: Some(0.5),
        ..Surface::default()
    });
    let ground_image = b.texture("paving", &paving_image().to_png(), Wrap::Repeat);
    let ground = b.surface(&Surface {
        name: "paving",
        texture: Some(ground_image),
        ..Surface::default()
    });
    let mut floor = plane(24.0);
    let uv = |p: &V3| [p[0] * 0.5, p[2] * 0.5];
    floor.uvs = floor.positions.iter().map(uv).collect();
    b.add("ground", ground, &floor);
    let mut tree = Tree {
        wood: Mesh::default(),
        ends: Vec::new(),
        chance: Chance(7),
    };
    tree.branch([0.0, 0.0, 0.0], [0.05, 1.0, 0.0], 1.0, 0.075, 3);
    b.add("wood", bark, &tree.wood);
    let leaves = tree.leaves();
    b.add("leaves", leaf, &leaves);
    b.light(
        "sun",
        r#""type":"directional","color":[1,0.95,0.84],"intensity":3.2,"extras":{"angular_diameter_deg":2.5}"#,
        [-3.4, 6.0, -0.8],
        [0.0, 0.0, 0.0],
    );
    b.light(
        "lamp",
        r#""type":"spot","color":[0.72,0.84,1],"intensity":26,"spot":{"innerConeAngle":0.5,"outerConeAngle":0.9},"extras":{"shape":"disk","radius":0.25}"#,
        [3.2, 4.6, -2.2],
        [-0.2, 0.9, 0.2],
    );
    b.camera("camera", 36.0, [0.9, 4.2, 5.7], [0.3, 0.9, 0.1]);
    b
}

struct Tree {
    wood: Mesh,
    /// Where leaves sit: a place and the way out.
    ends: Vec<(V3, V3)>,
    chance: Chance,
}

impl Tree {
    /// A bent branch and those that grow from it, `levels` deep.
    fn branch(&mut self, from: V3, way: V3, length: f64, radius: f64, levels: u32) {
        const STEPS: u32 = 5;
        let mut path = vec![(from, radius)];
        let (mut at, mut way) = (from, unit(way));
        for i in 1..=STEPS {
            let bend = scale(self.chance.in_ball(), 0.16);
            way = unit(add(add(way, bend), [0.0, 0.03, 0.0]));
            at = add(at, scale(way, length / f64::from(STEPS)));
            let thin = 1.0 - 0.45 * f64::from(i) / f64::from(STEPS);
            path.push((at, radius * thin));
            if levels < 2 {
                self.ends.push((at, way));
            }
        }
        let sides = [4, 5, 7, 12][levels as usize];
        self.wood.append(&tube(sides, &path));
        if levels == 0 {
            return;
        }
        let (u, v) = across(way);
        let count = 4 + u32::from(levels == 3);
        let start = self.chance.between(0.0, TAU);
        for i in 0..count {
            let turn = start + TAU * f64::from(i) / f64::from(count);
            let (s, c) = (turn + self.chance.between(-0.3, 0.3)).sin_cos();
            let out = add(scale(u, c), scale(v, s));
            let spread = self.chance.between(0.7, 1.1);
            let way = add(way, scale(out, spread));
            let place = path[path.len() - 1 - (i as usize % 2)];
            let shorter = self.chance.between(0.6, 0.76);
            self.branch(place.0, way, length * shorter, place.1 * 0.75, levels - 1);
        }
    }

    fn leaves(&mut self) -> Mesh {
        let mut mesh = Mesh::default();
        for i in 0..LEAVES {
            let pick = i as usize * self.ends.len() / LEAVES as usize;
            let (at, out) = self.ends[pick];
            let at = add(at, scale(self.chance.in_ball(), 0.16));
            let stray = self.chance.in_ball();
            // The tip hangs a little, the face looks up a little.
            let along = unit(add(mix(out, stray, 0.7), [0.0, -0.25, 0.0]));
            let face = add(self.chance.in_ball(), [0.0, 0.8, 0.0]);
            let side = unit(cross(along, face));
            let normal = cross(side, along);
            let size = self.chance.between(0.12, 0.18);
            let corner = |x: f64, y: f64| {
                let p = add(scale(side, 0.36 * x * size), scale(along, y * size));
                (add(at, p), [0.5 + 0.5 * x, 1.0 - y])
            };
            mesh.textured(
                normal,
                &[
                    corner(-1.0, 0.0),
                    corner(1.0, 0.0),
                    corner(1.0, 1.0),
                    corner(-1.0, 1.0),
                ],
            );
        }
        mesh
    }
}

fn byte(x: f64) -> u8 {
    (255.0 * x.clamp(0.0, 1.0)).round() as u8
}

/// A leaf with its tip up. Alpha falls over some texels, so that the outline at 0.5 is smooth;
/// colour goes on beyond it. Without sines: the same texels everywhere.
fn leaf_image() -> Image {
    let (width, height) = (64, 64);
    Image::new(width, height, |i, j| {
        let x = (i as f64 + 0.5) / width as f64 * 2.0 - 1.0;
        let y = 1.0 - (j as f64 + 0.5) / height as f64;
        // The blade from 0.14 to 0.97 of the height, widest below its middle; a stalk beneath.
        let t = ((y - 0.14) / 0.83).clamp(0.0, 1.0);
        let blade = 0.86 * 6.75 * t * (1.0 - t) * (1.0 - t) * (0.55 + 0.45 * (1.0 + t));
        let stalk = if y < 0.3 { 0.07 } else { 0.0 };
        let inside = blade.min(0.9).max(stalk) - x.abs();
        let ends = (0.97 - y).min(y - 0.03) * 2.0;
        let alpha = 0.5 + 4.0 * inside.min(ends);
        let vein = (1.0 - 14.0 * x.abs()).max(0.0) * 0.22;
        let rib = (y * 9.0 - x.abs() * 2.2).rem_euclid(1.0);
        let rib = if rib < 0.16 { 0.07 } else { 0.0 };
        let light = 0.30 + 0.14 * y + vein + rib;
        [
            byte(light * 0.86 + 0.06),
            byte(light * 1.32 + 0.04),
            byte(light * 0.46),
            byte(alpha),
        ]
    })
}

/// Four paving stones with joints between them.
fn paving_image() -> Image {
    let mut chance = Chance(3);
    let tones = [0.66, 0.72, 0.69, 0.63];
    Image::new(64, 64, |i, j| {
        let joint = i % 32 == 0 || j % 32 == 0;
        let tone = tones[(i / 32 + 2 * (j / 32)) % 4];
        let grain = ((chance.part() * 4.0).floor() - 1.5) / 120.0;
        let tone = if joint { 0.46 } else { tone + grain };
        [byte(tone), byte(tone * 0.97), byte(tone * 0.91), 255]
    })
}
