//! A tube lamp, and all kinds of light at once.

use super::super::document::{Document, Place, Surface};
use super::super::math::{V3, look_at};
use super::super::shapes::{block, column, lathe, plane, rod, sphere};

/// A tube over blockers of several heights: sharp along it, soft across.
pub fn tube() -> Document {
    let mut b = Document::default();
    let ground = b.material("ground", [0.64, 0.62, 0.60]);
    let colors = [
        ("coral", [0.82, 0.34, 0.26]),
        ("sand", [0.84, 0.70, 0.44]),
        ("sea", [0.18, 0.44, 0.58]),
        ("moss", [0.34, 0.48, 0.22]),
        ("plum", [0.46, 0.22, 0.40]),
    ];
    let [coral, sand, sea, moss, plum] = colors.map(|(name, color)| b.material(name, color));
    b.add("plane", ground, &plane(40.0));
    let tower = block([0.35, 1.5, 0.35], 0.35, [-1.15, 0.0, -0.6]);
    b.add("tower", coral, &tower);
    b.add(
        "stump",
        sand,
        &column(32, 0.34, 0.55).moved([0.15, 0.0, 0.75]),
    );
    b.add(
        "pole",
        sea,
        &column(20, 0.06, 1.9).moved([0.55, 0.0, -0.75]),
    );
    b.add(
        "kerb",
        moss,
        &block([1.5, 0.16, 0.16], -0.1, [1.15, 0.0, 0.25]),
    );
    b.add(
        "wall",
        plum,
        &block([0.12, 0.8, 1.0], 0.1, [-0.75, 0.0, 0.75]),
    );
    // A bar each way, at the same height.
    let bar = |a: V3, c: V3| rod(12, a, c, 0.03, 0.03);
    b.add("bar along", sand, &bar([0.9, 0.9, -1.0], [1.9, 0.9, -1.0]));
    b.add(
        "bar across",
        sand,
        &bar([1.4, 0.96, -1.5], [1.4, 0.96, -0.5]),
    );
    for (i, [x, z]) in [[0.95, -1.0], [1.85, -1.0]].into_iter().enumerate() {
        let leg = rod(12, [x, 0.0, z], [x, 0.9, z], 0.02, 0.02);
        b.add(&format!("leg {i}"), sand, &leg);
    }
    b.add(
        "ball",
        coral,
        &sphere(8).scaled(0.24).moved([1.25, 0.62, 0.95]),
    );
    b.light_up(
        "tube",
        r#""type":"point","color":[0.94,0.97,1],"intensity":70,"extras":{"shape":"line","length":1.8}"#,
        [0.1, 3.3, -1.0],
        [0.1, 0.0, -1.0],
        [0.0, 0.0, -1.0],
    );
    b.camera("camera", 36.0, [0.9, 4.4, 6.0], [0.25, 0.4, -0.05]);
    b
}

/// Eight lights of all kinds; bodies rough, glossy and of metal.
pub fn lights() -> Document {
    let mut b = Document::default();
    let ground = b.surface(&Surface {
        name: "ground",
        color: [0.5, 0.5, 0.5],
        roughness: 0.9,
        ..Surface::default()
    });
    let back = b.surface(&Surface {
        name: "back",
        color: [0.40, 0.38, 0.44],
        ..Surface::default()
    });
    let mut body = |name, color, metallic, roughness| {
        b.surface(&Surface {
            name,
            color,
            metallic,
            roughness,
            ..Surface::default()
        })
    };
    let rough = body("rough clay", [0.72, 0.36, 0.24], 0.0, 1.0);
    let glossy = body("glossy blue", [0.10, 0.24, 0.58], 0.0, 0.12);
    let satin = body("satin green", [0.24, 0.52, 0.30], 0.0, 0.4);
    let gold = body("gold", [1.0, 0.77, 0.34], 1.0, 0.25);
    let steel = body("steel", [0.56, 0.57, 0.58], 1.0, 0.5);
    b.add("ground", ground, &plane(30.0));
    b.add(
        "back wall",
        back,
        &block([12.0, 5.0, 0.2], 0.0, [0.0, 0.0, -2.6]),
    );
    b.add(
        "clay box",
        rough,
        &block([0.6, 0.9, 0.6], 0.4, [-1.5, 0.0, -0.6]),
    );
    b.add(
        "glossy ball",
        glossy,
        &sphere(10).scaled(0.42).moved([-0.45, 0.42, 0.55]),
    );
    b.add(
        "green slab",
        satin,
        &block([0.9, 0.12, 0.6], -0.3, [0.4, 0.75, -0.8]),
    );
    b.add(
        "slab foot",
        steel,
        &column(20, 0.05, 0.75).moved([0.4, 0.0, -0.8]),
    );
    b.add(
        "gold cone",
        gold,
        &lathe(
            40,
            &[
                [0.0, 0.0],
                [0.4, 0.0],
                [0.4, 0.0],
                [0.08, 0.85],
                [0.08, 0.85],
                [0.0, 0.85],
            ],
        )
        .moved([0.65, 0.0, 0.6]),
    );
    b.add(
        "steel pole",
        steel,
        &column(24, 0.07, 1.9).moved([1.5, 0.0, -0.4]),
    );
    b.add(
        "gold ball",
        gold,
        &sphere(8).scaled(0.2).moved([1.5, 2.05, -0.4]),
    );
    b.light(
        "disk",
        r#""type":"point","color":[1,0.62,0.34],"intensity":34,"extras":{"shape":"disk","radius":0.35}"#,
        [-2.9, 3.2, 1.8],
        [-0.4, 0.3, 0.0],
    );
    b.light(
        "rect",
        r#""type":"point","color":[0.34,0.60,1],"intensity":34,"extras":{"shape":"rect","width":0.9,"height":0.4}"#,
        [2.9, 3.0, 2.2],
        [0.4, 0.3, -0.2],
    );
    b.light(
        "sphere",
        r#""type":"point","color":[1,0.94,0.80],"intensity":7,"extras":{"shape":"sphere","radius":0.2}"#,
        [-0.6, 2.5, -0.9],
        [-0.6, 2.5, -1.9],
    );
    b.light_up(
        "line",
        r#""type":"point","color":[0.55,1,0.66],"intensity":9,"extras":{"shape":"line","length":1.4}"#,
        [0.6, 3.1, 0.3],
        [0.6, 0.0, 0.3],
        [0.0, 0.0, -1.0],
    );
    b.light(
        "sun",
        r#""type":"directional","color":[1,0.95,0.86],"intensity":0.9,"extras":{"angular_diameter_deg":3}"#,
        [-2.0, 6.0, 4.0],
        [0.0, 0.0, 0.0],
    );
    b.light(
        "spot",
        r#""type":"spot","color":[1,0.60,0.72],"intensity":45,"spot":{"innerConeAngle":0.16,"outerConeAngle":0.3},"extras":{"shape":"disk","radius":0.12}"#,
        [1.2, 3.6, 3.4],
        [0.5, 0.2, 0.3],
    );
    // Nits. The largest scale counts: 1 m high and 0.5 m wide, 0.6 m across.
    b.area_light(
        "area rect",
        r#""type":"rect","color":[1,0.88,0.70],"intensity":14,"size":0.5,"rect":{"aspect":0.5}"#,
        &Place {
            rotation: Some(look_at([-3.6, 1.4, 0.4], [0.0, 0.5, 0.0], [0.0, 1.0, 0.0])),
            scale: Some([2.0, 2.0, 2.0]),
            ..Place::at([-3.6, 1.4, 0.4])
        },
    );
    b.area_light(
        "area disk",
        r#""type":"disk","color":[0.72,0.84,1],"intensity":26,"size":0.3"#,
        &Place {
            rotation: Some(look_at([3.2, 2.2, -1.2], [0.3, 0.5, 0.0], [0.0, 1.0, 0.0])),
            scale: Some([1.0, 2.0, 1.0]),
            ..Place::at([3.2, 2.2, -1.2])
        },
    );
    b.camera("camera", 34.0, [0.3, 3.2, 6.0], [0.1, 0.62, -0.2]);
    b
}
