//! Large scenes and far ones.

use std::time::Instant;

use antumbra::scene::{LoadOptions, Scene, SceneFile};
use glam::{DVec3, Vec3};
use serde_json::json;

use super::model::{Model, U16};
use super::{Result, lit};

/// A sheet of `side` x `side` squares with normals, 2 triangles each.
fn sheet(side: u32) -> Model {
    let mut model = Model::square();
    let corner = |i: u32| [i % (side + 1), i / (side + 1)].map(|c| c as f32 / side as f32);
    let count = (side + 1) * (side + 1);
    let positions: Vec<f32> = (0..count)
        .map(corner)
        .flat_map(|[x, y]| [x, y, (9.0 * x).sin() * (7.0 * y).cos()])
        .collect();
    let indices: Vec<u8> = (0..side * side)
        .map(|i| (i / side) * (side + 1) + i % side)
        .flat_map(|i| [i, i + 1, i + side + 2, i, i + side + 2, i + side + 1])
        .flat_map(u32::to_le_bytes)
        .collect();
    let positions = model.floats("VEC3", &positions);
    let normals = model.floats("VEC3", &[0., 0., 1.].repeat(count as usize));
    let indices = model.accessor(5125, "SCALAR", &indices);
    model.attribute("POSITION", positions);
    model.attribute("NORMAL", normals);
    model.primitive()["indices"] = json!(indices);
    model
}

#[test]
fn a_million_and_a_half_triangles() -> Result {
    let bytes = sheet(870).glb();
    let start = Instant::now();
    let scene = Scene::load_slice("test.glb", &bytes, &LoadOptions::default())?;
    println!("{} bytes in {:?}", bytes.len(), start.elapsed());
    assert_eq!(scene.triangle_count(), 2 * 870 * 870);
    // A liveness guard; it takes a fraction of a second.
    assert!(start.elapsed().as_secs() < 20);
    Ok(())
}

#[test]
fn a_hundred_thousand_skinned_vertices() -> Result {
    let mut model = sheet(316);
    let count = 317 * 317;
    let joints = [0u16, 1, 2, 3].repeat(count);
    let joints: Vec<u8> = joints.into_iter().flat_map(u16::to_le_bytes).collect();
    let joints = model.accessor(U16, "VEC4", &joints);
    let weights = model.floats("VEC4", &[0.4, 0.3, 0.2, 0.1].repeat(count));
    model.attribute("JOINTS_0", joints);
    model.attribute("WEIGHTS_0", weights);
    model.json["skins"] = json!([{"joints": [1, 2, 3, 4]}]);
    model.json["nodes"] = json!([{"mesh": 0, "skin": 0}, {}, {}, {}, {}]);
    model.json["scenes"][0]["nodes"] = json!([0, 1, 2, 3, 4]);
    let output = model.floats("VEC3", &[0., 0., 0., 0., 0., 10.]);
    model.channel(4, "translation", "LINEAR", &[0.0, 1.0], output);
    let file = SceneFile::from_slice("test.glb", model.glb(), &LoadOptions::default())?;
    let rest = file.scene_at(0.0)?;
    let start = Instant::now();
    let moved = file.scene_at(1.0)?;
    println!("{count} skinned vertices in {:?}", start.elapsed());
    for i in [0, count / 2, count - 1] {
        let by = moved.primitives[0].positions[i] - rest.primitives[0].positions[i];
        assert!((by - Vec3::Z).length() < 1.0e-5, "{by}");
    }
    Ok(())
}

/// Everything that has a place, moved by `far`: a skinned sheet, one in a tree, a light, a camera.
fn placed(far: DVec3) -> Model {
    let mut model = sheet(4);
    let base = lit(
        json!({"type": "point"}),
        json!({"translation": [1.3, 2.7, 3.1]}),
    );
    model.json["extensions"] = base["extensions"].clone();
    model.json["cameras"] =
        json!([{"type": "perspective", "perspective": {"yfov": 1, "znear": 0.1}}]);
    let joints = model.accessor(super::model::U8, "VEC4", &[0, 1, 0, 0].repeat(25));
    let weights = model.floats("VEC4", &[0.3, 0.7, 0., 0.].repeat(25));
    model.attribute("JOINTS_0", joints);
    model.attribute("WEIGHTS_0", weights);
    model.json["skins"] = json!([{"joints": [4, 5]}]);
    model.json["nodes"] = json!([
        {"children": [1, 2, 3, 4], "translation": far.to_array()},
        {"mesh": 0, "translation": [0.1, 0.2, 0.3], "rotation": [0.6, 0, 0, 0.8]},
        {"mesh": 0, "skin": 0},
        {"camera": 0, "extensions": {"KHR_lights_punctual": {"light": 0}},
         "translation": [1.3, 2.7, 3.1]},
        {"translation": [0.7, 0.11, 0], "children": [5]},
        {"translation": [0, 0.013, 0.4], "rotation": [0, 0.6, 0, 0.8]}
    ]);
    model.json["scenes"][0]["nodes"] = json!([0]);
    let output = model.floats("VEC3", &[0.7, 0.11, 0., 0.9, 1.7, 0.3]);
    model.channel(4, "translation", "LINEAR", &[0.0, 1.0], output);
    model
}

#[test]
fn far_from_the_origin_is_as_at_home() -> Result {
    let open = |far: DVec3| {
        let bytes = placed(far).glb();
        SceneFile::from_slice("test.glb", bytes, &LoadOptions::default())
    };
    let home = open(DVec3::ZERO)?;
    // Multiples of what the origin is rounded to, so that the very same coordinates come out.
    let far = DVec3::new(100_000.0, -80_000.0, 64_000.0);
    let away = open(far)?;
    for seconds in [0.0, 0.37, 1.0] {
        let (home, away) = (home.scene_at(seconds)?, away.scene_at(seconds)?);
        assert_eq!(away.rebase_origin, home.rebase_origin + far);
        let mut worst = 0.0f32;
        for (a, b) in home.primitives.iter().zip(&away.primitives) {
            for (a, b) in a.positions.iter().zip(&b.positions) {
                worst = worst.max((*a - *b).abs().max_element());
            }
            for (a, b) in a.normals.iter().zip(&b.normals) {
                worst = worst.max((*a - *b).abs().max_element());
            }
        }
        let (a, b) = (&home.cameras[0], &away.cameras[0]);
        worst = worst.max((a.position - b.position).abs().max_element());
        let (a, b) = (&home.lights[0].light, &away.lights[0].light);
        worst = worst.max((a.center - b.center).abs().max_element());
        // Coordinates are below 8, where an f32 has steps of 2^-21 at most.
        assert!(worst <= 2.0f32.powi(-21), "{worst}");
    }
    Ok(())
}
