//! A furnished room with a lamp in its middle and a window.

use super::super::document::{Document, Place, Surface, Wrap};
use super::super::math::{Chance, V3, about, look_at};
use super::super::mesh::Mesh;
use super::super::png::Image;
use super::super::shapes::{block, cuboid, lathe, rod, slab, sphere};

/// Inside of the room: left, floor, back; right, ceiling, front.
const LOW: V3 = [-2.2, 0.0, -2.6];
const HIGH: V3 = [2.2, 2.6, 2.2];
/// The window in the left wall: Y and Z of its opening, and how deep it is.
const WINDOW: [[f64; 2]; 2] = [[0.95, 1.95], [-1.5, -0.3]];
const DEPTH: f64 = 0.18;
/// The middle of the lamp, and the top of the table.
const LAMP: V3 = [0.0, 1.86, -0.35];
const TABLE: [f64; 3] = [0.0, 0.74, -0.45];

/// The camera stands inside too. Walls, floor and ceiling are one primitive.
pub fn room() -> Document {
    let mut b = Document::default();
    let image = b.texture("shell", &shell_image().to_png(), Wrap::Clamp);
    let shell_material = b.surface(&Surface {
        name: "shell",
        texture: Some(image),
        double_sided: false,
        ..Surface::default()
    });
    let image = b.texture("painting", &painting().to_png(), Wrap::Clamp);
    let canvas = b.surface(&Surface {
        name: "painting",
        texture: Some(image),
        roughness: 0.8,
        ..Surface::default()
    });
    let glass = b.surface(&Surface {
        name: "window pane",
        color: [0.7, 0.8, 0.9],
        emissive: [0.6, 0.8, 1.0],
        ..Surface::default()
    });
    let mut wood = |name, color, roughness| {
        b.surface(&Surface {
            name,
            color,
            roughness,
            ..Surface::default()
        })
    };
    let oak = wood("oak", [0.56, 0.36, 0.19], 0.5);
    let walnut = wood("walnut", [0.30, 0.19, 0.12], 0.45);
    let white = wood("white paint", [0.80, 0.80, 0.77], 0.6);
    let glaze = wood("glaze", [0.14, 0.40, 0.46], 0.15);
    let clay = wood("clay", [0.74, 0.42, 0.28], 0.8);
    let lime = wood("lime", [0.46, 0.62, 0.20], 0.5);
    let rug = wood("rug", [0.50, 0.16, 0.17], 1.0);
    let brass = b.surface(&Surface {
        name: "brass",
        color: [0.88, 0.70, 0.36],
        metallic: 1.0,
        roughness: 0.35,
        ..Surface::default()
    });
    b.add("shell", shell_material, &shell());
    b.add("pane", glass, &pane());
    b.add("window bars", white, &window_bars());
    b.add("rug", rug, &slab([-1.15, 0.0, -1.35], [1.15, 0.012, 0.55]));
    b.add("table", oak, &table());
    let chair = b.mesh("chair", &[(walnut, &chair())]);
    let chairs = [
        ("chair", [-0.35, 0.012, -1.12], 0.1),
        ("second chair", [0.5, 0.012, 0.28], 2.9),
        ("third chair", [-1.15, 0.012, -0.25], 1.75),
    ];
    for (name, at, turn) in chairs {
        let place = Place {
            rotation: Some(about([0.0, 1.0, 0.0], turn)),
            ..Place::at(at)
        };
        b.instance(name, chair, &place);
    }
    b.add("shelf", oak, &shelf());
    let books = books();
    for (name, material, mesh) in [
        ("red books", rug, &books[0]),
        ("clay boxes", clay, &books[1]),
        ("blue books", glaze, &books[2]),
        ("white boxes", white, &books[3]),
    ] {
        b.add(name, material, mesh);
    }
    let [x, y, z] = TABLE;
    b.add("vase", glaze, &vase().moved([x - 0.32, y, z - 0.1]));
    b.add("bowl", clay, &bowl().moved([x + 0.2, y, z + 0.05]));
    let fruit = sphere(4).scaled(0.042);
    let fruits = [[0.15, 0.07, 0.04], [0.24, 0.07, 0.02], [0.2, 0.075, 0.11]];
    let fruits = fruits.map(|p| fruit.moved([x + p[0], y + p[1], z + p[2]]));
    b.add("fruit", lime, &Mesh::joined(fruits));
    b.add("painting", canvas, &canvas_mesh());
    b.add("frame", walnut, &frame());
    b.add("lamp", brass, &lamp());
    b.light(
        "lamp",
        r#""type":"point","color":[1,0.86,0.66],"intensity":34,"extras":{"shape":"sphere","radius":0.1}"#,
        LAMP,
        [LAMP[0], LAMP[1], LAMP[2] - 1.0],
    );
    let [[low, high], [back, front]] = WINDOW;
    let middle = [
        LOW[0] - DEPTH + 0.03,
        0.5 * (low + high),
        0.5 * (back + front),
    ];
    b.area_light(
        "window",
        r#""type":"rect","color":[0.72,0.86,1],"intensity":34,"size":0.96,"rect":{"aspect":1.2}"#,
        &Place {
            rotation: Some(look_at(
                middle,
                [0.0, middle[1], middle[2]],
                [0.0, 1.0, 0.0],
            )),
            ..Place::at(middle)
        },
    );
    b.camera("camera", 62.0, [1.85, 1.72, 2.0], [-0.25, 0.78, -0.9]);
    b
}

/// Place in the shell's image: floor above, walls below, ceiling last.
fn shell_uv(p: V3, normal: V3) -> [f64; 2] {
    let part = |axis: usize| ((p[axis] - LOW[axis]) / (HIGH[axis] - LOW[axis])).clamp(0.0, 1.0);
    let within = |low: f64, high: f64, t: f64| low + (high - low) * t;
    if normal[1] == 1.0 && p[1] == LOW[1] {
        [within(0.004, 0.996, part(0)), within(0.004, 0.496, part(2))]
    } else if normal[1] == -1.0 && p[1] == HIGH[1] {
        [within(0.1, 0.9, part(0)), within(0.97, 0.98, part(2))]
    } else {
        let along = if normal[0] == 0.0 { 0 } else { 2 };
        [within(0.01, 0.99, part(along)), within(0.92, 0.52, part(1))]
    }
}

fn shell() -> Mesh {
    let mut mesh = Mesh::default();
    // Corners by their coordinates across `axis`, in the order of the two other axes.
    let mut face = |axis: usize, at: f64, sign: f64, low: [f64; 2], high: [f64; 2]| {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        let corner = |a: f64, b: f64| {
            let mut p = [0.0; 3];
            (p[axis], p[u], p[v]) = (at, a, b);
            p
        };
        let mut normal = [0.0; 3];
        normal[axis] = sign;
        let mut corners = [
            corner(low[0], low[1]),
            corner(high[0], low[1]),
            corner(high[0], high[1]),
            corner(low[0], high[1]),
        ];
        if sign < 0.0 {
            corners.reverse();
        }
        let corners = corners.map(|p| (p, shell_uv(p, normal)));
        mesh.textured(normal, &corners);
    };
    let [[y0, y1], [z0, z1]] = WINDOW;
    let ([x, floor, back], [right, ceiling, front]) = (LOW, HIGH);
    face(1, floor, 1.0, [back, x], [front, right]);
    face(1, ceiling, -1.0, [back, x], [front, right]);
    face(2, back, 1.0, [x, floor], [right, ceiling]);
    face(2, front, -1.0, [x, floor], [right, ceiling]);
    face(0, right, -1.0, [floor, back], [ceiling, front]);
    // The left wall around the window, and the sides of the opening.
    face(0, x, 1.0, [floor, back], [y0, front]);
    face(0, x, 1.0, [y1, back], [ceiling, front]);
    face(0, x, 1.0, [y0, back], [y1, z0]);
    face(0, x, 1.0, [y0, z1], [y1, front]);
    face(1, y0, 1.0, [z0, x - DEPTH], [z1, x]);
    face(1, y1, -1.0, [z0, x - DEPTH], [z1, x]);
    face(2, z0, 1.0, [x - DEPTH, y0], [x, y1]);
    face(2, z1, -1.0, [x - DEPTH, y0], [x, y1]);
    mesh
}

fn pane() -> Mesh {
    let [[y0, y1], [z0, z1]] = WINDOW;
    let x = LOW[0] - DEPTH;
    let mut mesh = Mesh::default();
    let corners = [[x, y0, z1], [x, y0, z0], [x, y1, z0], [x, y1, z1]];
    mesh.flat([1.0, 0.0, 0.0], &corners);
    mesh
}

fn window_bars() -> Mesh {
    let [[y0, y1], [z0, z1]] = WINDOW;
    let x = LOW[0] - 0.06;
    let (y, z) = (0.5 * (y0 + y1), 0.5 * (z0 + z1));
    let bar = |low: [f64; 2], high: [f64; 2]| {
        slab([x - 0.02, low[0], low[1]], [x + 0.02, high[0], high[1]])
    };
    Mesh::joined([
        bar([y0, z - 0.02], [y1, z + 0.02]),
        bar([y + 0.08, z0], [y + 0.12, z - 0.02]),
        bar([y + 0.08, z + 0.02], [y + 0.12, z1]),
        // The sill.
        slab(
            [LOW[0], y0 - 0.05, z0 - 0.06],
            [LOW[0] + 0.14, y0 - 0.01, z1 + 0.06],
        ),
    ])
}

fn table() -> Mesh {
    let [x, y, z] = TABLE;
    let leg = |sx: f64, sz: f64| {
        block(
            [0.06, y - 0.052, 0.06],
            0.0,
            [x + 0.55 * sx, 0.012, z + 0.3 * sz],
        )
    };
    Mesh::joined([
        slab([x - 0.65, y - 0.04, z - 0.4], [x + 0.65, y, z + 0.4]),
        leg(-1.0, -1.0),
        leg(1.0, -1.0),
        leg(1.0, 1.0),
        leg(-1.0, 1.0),
    ])
}

/// Stands on the XZ plane and looks to +Z.
fn chair() -> Mesh {
    let mut parts = vec![slab([-0.21, 0.43, -0.2], [0.21, 0.46, 0.22])];
    for x in [-0.18, 0.18] {
        parts.push(block([0.035, 0.43, 0.035], 0.0, [x, 0.0, 0.18]));
        parts.push(block([0.035, 0.92, 0.035], 0.0, [x, 0.0, -0.22]));
    }
    for i in 0..4 {
        let y = 0.58 + 0.1 * f64::from(i);
        parts.push(slab([-0.163, y, -0.23], [0.163, y + 0.035, -0.215]));
    }
    Mesh::joined(parts)
}

/// On the back wall, to the right.
const SHELF: [f64; 2] = [0.85, 1.95];
const BOARDS: [f64; 5] = [0.08, 0.5, 0.92, 1.34, 1.72];

fn shelf() -> Mesh {
    let (back, front) = (LOW[2], LOW[2] + 0.3);
    let [left, right] = SHELF;
    let mut parts = Vec::new();
    for x in [left, right] {
        parts.push(slab([x - 0.015, 0.0, back], [x + 0.015, 1.745, front]));
    }
    for y in BOARDS {
        parts.push(slab(
            [left + 0.015, y, back],
            [right - 0.015, y + 0.025, front],
        ));
    }
    Mesh::joined(parts)
}

/// Four heaps of boxes on the boards of the shelf, one a colour.
fn books() -> [Mesh; 4] {
    let mut heaps = [(); 4].map(|()| Mesh::default());
    let mut chance = Chance(21);
    for y in &BOARDS[..4] {
        let mut x = SHELF[0] + 0.05;
        loop {
            let heap = (chance.part() * 4.0) as usize;
            // Books are thin and high.
            let (width, height) = match heap {
                0 | 2 => (chance.between(0.025, 0.055), chance.between(0.2, 0.3)),
                _ => (chance.between(0.12, 0.2), chance.between(0.1, 0.2)),
            };
            let gap = if chance.part() < 0.25 { 0.09 } else { 0.004 };
            if x + width > SHELF[1] - 0.03 {
                break;
            }
            let front = LOW[2] + chance.between(0.2, 0.27);
            let low = [x, y + 0.025, LOW[2] + 0.04];
            heaps[heap].append(&slab(low, [x + width, y + 0.025 + height, front]));
            x += width + gap;
        }
    }
    heaps
}

fn vase() -> Mesh {
    let outline = [
        [0.0, 0.0],
        [0.05, 0.0],
        [0.05, 0.0],
        [0.075, 0.04],
        [0.092, 0.09],
        [0.094, 0.14],
        [0.08, 0.19],
        [0.056, 0.235],
        [0.042, 0.275],
        [0.044, 0.305],
        [0.055, 0.33],
        [0.05, 0.33],
        [0.038, 0.3],
        [0.036, 0.26],
        [0.0, 0.22],
    ];
    lathe(28, &outline)
}

fn bowl() -> Mesh {
    let outline = [
        [0.0, 0.0],
        [0.055, 0.0],
        [0.055, 0.0],
        [0.1, 0.02],
        [0.135, 0.055],
        [0.15, 0.1],
        [0.143, 0.1],
        [0.125, 0.06],
        [0.09, 0.03],
        [0.0, 0.018],
    ];
    lathe(32, &outline)
}

/// Middle and half size of the painting.
const PAINTING: [[f64; 2]; 2] = [[-0.75, 1.55], [0.44, 0.33]];

fn canvas_mesh() -> Mesh {
    let [[x, y], [w, h]] = PAINTING;
    let mut mesh = Mesh::default();
    let corner = |a: f64, b: f64| {
        let at = [x + a * w, y + b * h, LOW[2] + 0.015];
        (at, [0.5 + 0.5 * a, 0.5 - 0.5 * b])
    };
    let corners = [
        corner(-1.0, -1.0),
        corner(1.0, -1.0),
        corner(1.0, 1.0),
        corner(-1.0, 1.0),
    ];
    mesh.textured([0.0, 0.0, 1.0], &corners);
    mesh
}

fn frame() -> Mesh {
    let [[x, y], [w, h]] = PAINTING;
    let (back, front, t) = (LOW[2], LOW[2] + 0.04, 0.045);
    let bar =
        |low: [f64; 2], high: [f64; 2]| slab([low[0], low[1], back], [high[0], high[1], front]);
    Mesh::joined([
        bar([x - w - t, y - h - t], [x + w + t, y - h]),
        bar([x - w - t, y + h], [x + w + t, y + h + t]),
        bar([x - w - t, y - h], [x - w, y + h]),
        bar([x + w, y - h], [x + w + t, y + h]),
    ])
}

/// Cord and cap; the light itself is no geometry.
fn lamp() -> Mesh {
    let [x, y, z] = LAMP;
    let cord = rod(8, [x, y + 0.16, z], [x, HIGH[1], z], 0.006, 0.006);
    let cap = lathe(28, &[[0.13, 0.09], [0.1, 0.125], [0.05, 0.15], [0.0, 0.16]]);
    let rose = cuboid([0.1, 0.02, 0.1]).moved([x, HIGH[1] - 0.01, z]);
    Mesh::joined([cord, cap.moved(LAMP), rose])
}

fn byte(x: f64) -> u8 {
    (255.0 * x.clamp(0.0, 1.0)).round() as u8
}

/// Boards, then a wall with a skirting, then the ceiling.
fn shell_image() -> Image {
    const BOARDS: usize = 11;
    let mut chance = Chance(5);
    let tones: Vec<f64> = (0..BOARDS * 4).map(|_| chance.between(0.78, 1.0)).collect();
    Image::new(256, 256, |i, j| {
        if j < 128 {
            let board = i * BOARDS / 256;
            let joint = (i * BOARDS) % 256 < BOARDS;
            let row = j + 11 * board % 48;
            let end = row.is_multiple_of(48);
            let tone = tones[board * 4 + row / 48 % 4] * if joint || end { 0.6 } else { 1.0 };
            [byte(0.72 * tone), byte(0.56 * tone), byte(0.41 * tone), 255]
        } else if j < 241 {
            // The skirting is the last tenth of a metre above the floor.
            match j {
                230.. => [214, 212, 204, 255],
                229 => [150, 148, 140, 255],
                186..=188 => [176, 186, 176, 255],
                189.. => [160, 178, 172, 255],
                _ => [222, 214, 196, 255],
            }
        } else {
            [236, 234, 228, 255]
        }
    })
}

/// Hills before an evening sky.
fn painting() -> Image {
    let (width, height) = (128, 128);
    Image::new(width, height, |i, j| {
        let x = (i as f64 + 0.5) / width as f64;
        let y = (j as f64 + 0.5) / height as f64;
        let hump = |at: f64, wide: f64| (1.0 - ((x - at) / wide).powi(2)).max(0.0);
        let sun = (x - 0.66).powi(2) * 1.8 + (y - 0.40).powi(2);
        let color = if y > 0.84 - 0.16 * hump(0.2, 0.6) {
            [0.16, 0.28, 0.20]
        } else if y > 0.70 - 0.20 * hump(0.85, 0.5) {
            [0.30, 0.40, 0.34]
        } else if y > 0.62 - 0.24 * hump(0.35, 0.4) {
            [0.44, 0.46, 0.56]
        } else if sun < 0.012 {
            [0.99, 0.90, 0.62]
        } else {
            // Bands, as by a broad brush.
            let t = (y * 18.0).floor() / 12.0;
            [0.46 + 0.5 * t, 0.52 + 0.22 * t, 0.66 - 0.14 * t]
        };
        let [r, g, b] = color.map(byte);
        [r, g, b, 255]
    })
}
