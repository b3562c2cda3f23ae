//! A few bodies on a plane.

use std::f64::consts::PI;

use super::super::document::Document;
use super::super::math::V3;
use super::super::shapes::{column, cuboid, plane, sheet, sphere};

pub fn sphere_over_plane() -> Document {
    let mut b = Document::default();
    let ground = b.material("ground", [0.62, 0.60, 0.56]);
    let clay = b.material("clay", [0.80, 0.33, 0.20]);
    b.add("plane", ground, &plane(40.0));
    b.add(
        "sphere",
        clay,
        &sphere(12).scaled(0.8).moved([0.0, 1.3, 0.0]),
    );
    b.light(
        "lamp",
        r#""type":"spot","color":[1,0.95,0.86],"intensity":90,"spot":{"innerConeAngle":0.7,"outerConeAngle":1.2},"extras":{"shape":"disk","radius":0.5}"#,
        [-3.2, 4.6, 1.2],
        [0.3, 0.6, 0.0],
    );
    b.camera("camera", 36.0, [0.4, 4.5, 6.5], [0.4, 0.55, 0.0]);
    b
}

pub fn poles() -> Document {
    let mut b = Document::default();
    let ground = b.material("ground", [0.55, 0.58, 0.60]);
    let pole = b.material("pole", [0.85, 0.72, 0.38]);
    let teal = b.material("teal", [0.16, 0.48, 0.50]);
    let brick = b.material("brick", [0.62, 0.24, 0.17]);
    b.add("plane", ground, &plane(60.0));
    for i in 0..7 {
        let t = f64::from(i) / 6.0;
        let (radius, height) = (0.035 + 0.015 * t, 2.7 - 0.9 * t);
        let at = [-1.9 + 3.2 * t, 0.0, -1.8 + 0.7 * (PI * t).sin()];
        b.add(
            &format!("pole {i}"),
            pole,
            &column(16, radius, height).moved(at),
        );
    }
    let cube = |size: V3, turn: f64, at: V3| {
        cuboid(size)
            .turned(turn)
            .moved([at[0], at[1] + 0.5 * size[1], at[2]])
    };
    b.add(
        "low box",
        teal,
        &cube([0.9, 0.7, 0.9], 0.5, [-0.9, 0.0, 0.5]),
    );
    b.add(
        "tall box",
        brick,
        &cube([0.5, 1.5, 0.5], -0.3, [0.9, 0.0, 0.2]),
    );
    b.add(
        "small box",
        teal,
        &cube([0.35, 0.35, 0.35], 0.2, [-0.95, 0.7, 0.45]),
    );
    b.light(
        "panel",
        r#""type":"point","color":[1,0.97,0.92],"intensity":130,"extras":{"shape":"rect","width":1.6,"height":0.6}"#,
        [-3.6, 5.4, 1.4],
        [0.4, 0.3, -0.6],
    );
    b.camera("camera", 36.0, [0.7, 5.0, 6.8], [0.7, 0.45, -0.9]);
    b
}

pub fn blockers() -> Document {
    let mut b = Document::default();
    let ground = b.material("ground", [0.60, 0.60, 0.64]);
    let blue = b.material("blue", [0.22, 0.34, 0.68]);
    let yellow = b.material("yellow", [0.86, 0.64, 0.16]);
    b.add("plane", ground, &plane(50.0));
    // The sheet has no thickness, the slab has; seen from the light, each covers part of the other.
    let sheet = sheet(1.7, 1.1).tilted(0.45).turned(0.35);
    b.add("sheet", blue, &sheet.moved([-0.25, 1.9, -0.2]));
    let slab = cuboid([1.5, 0.08, 0.9]).tilted(-0.3).turned(-0.5);
    b.add("slab", yellow, &slab.moved([0.5, 0.85, 0.25]));
    b.light(
        "bulb",
        r#""type":"point","color":[1,0.93,0.82],"intensity":85,"extras":{"shape":"sphere","radius":0.4}"#,
        [-2.0, 4.8, 1.0],
        [0.0, 0.0, 0.0],
    );
    b.camera("camera", 36.0, [0.6, 4.6, 6.4], [0.6, 0.6, 0.0]);
    b
}
