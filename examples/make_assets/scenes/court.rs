//! A court in the sun.

use super::super::document::Document;
use super::super::math::V3;
use super::super::shapes::{arch_wall, column, cuboid, sphere};

pub fn sun_court() -> Document {
    let mut b = Document::default();
    let paving = b.material("paving", [0.58, 0.52, 0.45]);
    let plaster = b.material("plaster", [0.80, 0.70, 0.56]);
    let stone = b.material("stone", [0.78, 0.76, 0.72]);
    let ochre = b.material("ochre", [0.72, 0.42, 0.24]);
    let slab = |low: V3, high: V3| {
        let mid = |i: usize| 0.5 * (low[i] + high[i]);
        let size = |i: usize| high[i] - low[i];
        cuboid([size(0), size(1), size(2)]).moved([mid(0), mid(1), mid(2)])
    };
    b.add(
        "paving",
        paving,
        &slab([-7.0, -0.3, -14.0], [7.0, 0.0, 9.0]),
    );
    b.add(
        "arch wall",
        plaster,
        &arch_wall(14.0, 8.5, 0.7, 1.3, 2.2).moved([0.0, 0.0, -5.0]),
    );
    b.add(
        "left wall",
        ochre,
        &slab([-6.5, 0.0, -4.65], [-6.0, 1.2, 9.0]),
    );
    b.add(
        "right wall",
        ochre,
        &slab([6.0, 0.0, -4.65], [6.5, 8.5, 9.0]),
    );
    b.add(
        "far wall",
        ochre,
        &slab([-7.0, 0.0, -12.5], [7.0, 7.0, -12.0]),
    );
    let shaft = column(24, 0.26, 2.9);
    for i in 0..4 {
        let at = [-2.6, 0.0, -3.2 + 2.0 * f64::from(i)];
        b.add(
            &format!("base {i}"),
            stone,
            &cuboid([0.8, 0.3, 0.8]).moved([at[0], 0.15, at[2]]),
        );
        b.add(
            &format!("shaft {i}"),
            stone,
            &shaft.moved([at[0], 0.3, at[2]]),
        );
        b.add(
            &format!("capital {i}"),
            stone,
            &cuboid([0.75, 0.2, 0.75]).moved([at[0], 3.3, at[2]]),
        );
    }
    b.add("beam", stone, &slab([-2.9, 3.4, -4.65], [-2.3, 3.85, 3.3]));
    for i in 0..3 {
        let (h, d) = (0.16 * f64::from(3 - i), 0.34 * f64::from(i));
        b.add(
            &format!("step {i}"),
            stone,
            &slab([-1.9, 0.0, -4.65], [1.9, h, -4.1 + d]),
        );
    }
    b.add(
        "plinth",
        stone,
        &cuboid([0.9, 0.6, 0.9]).moved([2.3, 0.3, 0.2]),
    );
    b.add(
        "globe",
        ochre,
        &sphere(8).scaled(0.55).moved([2.3, 1.15, 0.2]),
    );
    b.light(
        "sun",
        r#""type":"directional","color":[1,0.96,0.88],"intensity":3.8,"extras":{"angular_diameter_deg":1.5}"#,
        [-7.0, 7.0, 3.0],
        [0.0, 0.5, 0.2],
    );
    b.camera("camera", 46.0, [-1.0, 3.1, 9.6], [0.5, 1.7, -3.0]);
    b
}
