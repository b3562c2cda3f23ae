//! Moving nodes: keyframes, and what follows them.

use std::f32::consts::FRAC_1_SQRT_2;

use antumbra::scene::{LoadOptions, Scene, SceneFile};
use glam::{DVec3, Vec3};
use serde_json::{Value, json};

use super::model::{I16, Model};
use super::{Result, assert_close, lit, push};

fn open(model: &Model) -> Result<SceneFile> {
    let file = SceneFile::from_slice("test.glb", model.glb(), &LoadOptions::default());
    Ok(file?)
}

fn message(model: &Model) -> String {
    match open(model) {
        Ok(_) => panic!("accepted: {}", model.json),
        Err(error) => error.to_string(),
    }
}

/// World position of corner 0 and of corner 1 of the square, (0, 0, 0) and (1, 0, 0) at rest.
fn corners(file: &SceneFile, seconds: f64) -> Result<[Vec3; 2]> {
    let scene = file.scene_at(seconds)?;
    let world = |i: usize| scene.primitives[0].positions[i].as_dvec3() + scene.rebase_origin;
    Ok([world(0).as_vec3(), world(1).as_vec3()])
}

#[test]
fn straight_lines_between_keys_and_rest_outside_them() -> Result {
    let mut model = Model::square();
    let output = model.floats("VEC3", &[1., 0., 0., 3., 4., 0., 3., 4., 8.]);
    model.channel(0, "translation", "LINEAR", &[1.0, 2.0, 4.0], output);
    let file = open(&model)?;
    assert!(file.is_animated());
    assert_eq!(file.duration(), 4.0);
    for (seconds, wanted) in [
        (-7.0, [1., 0., 0.]),
        (f64::NEG_INFINITY, [1., 0., 0.]),
        (f64::NAN, [1., 0., 0.]),
        (1.0, [1., 0., 0.]),
        (1.25, [1.5, 1., 0.]),
        (2.0, [3., 4., 0.]),
        (3.5, [3., 4., 6.]),
        (4.0, [3., 4., 8.]),
        (f64::INFINITY, [3., 4., 8.]),
    ] {
        assert_close(corners(&file, seconds)?[0], Vec3::from_array(wanted));
    }
    assert!(!open(&Model::square())?.is_animated());
    assert_eq!(open(&Model::square())?.duration(), 0.0);
    Ok(())
}

#[test]
fn the_time_of_the_options_is_what_load_shows() -> Result {
    let mut model = Model::square();
    let output = model.floats("VEC3", &[0., 0., 0., 4., 0., 0.]);
    model.channel(0, "translation", "LINEAR", &[0.0, 1.0], output);
    let file = open(&model)?;
    let mut options = LoadOptions::default();
    for time in [0.0, 0.25, 1.0] {
        options.time = time;
        let loaded = Scene::load_slice("test.glb", &model.glb(), &options)?;
        assert_eq!(loaded, file.scene_at(time)?);
        assert_eq!(loaded.bounds.min.x, 4.0 * time as f32);
    }
    Ok(())
}

#[test]
fn turns_take_the_shorter_way_at_even_speed() -> Result {
    // A quarter turn about Z, and the same one as its negative.
    for sign in [1.0, -1.0] {
        let half = sign * FRAC_1_SQRT_2;
        let mut model = Model::square();
        let output = model.floats("VEC4", &[0., 0., 0., 1., 0., 0., half, half]);
        model.channel(0, "rotation", "LINEAR", &[0.0, 3.0], output);
        let file = open(&model)?;
        for (seconds, degrees) in [(1.0, 30.0f32), (1.5, 45.0), (2.0, 60.0), (3.0, 90.0)] {
            let (sin, cos) = degrees.to_radians().sin_cos();
            assert_close(corners(&file, seconds)?[1], Vec3::new(cos, sin, 0.0));
        }
    }
    // The same turn in 16-bit integers; a step holds until the next key.
    let mut model = Model::square();
    let keys: [i16; 8] = [0, 0, 0, 32767, 0, 0, 23170, 23170];
    let bytes: Vec<u8> = keys.iter().flat_map(|key| key.to_le_bytes()).collect();
    let output = model.normalized(I16, "VEC4", &bytes);
    model.channel(0, "rotation", "STEP", &[0.0, 3.0], output);
    let file = open(&model)?;
    assert_close(corners(&file, 2.999)?[1], Vec3::X);
    assert_close(corners(&file, 3.0)?[1], Vec3::Y);
    Ok(())
}

#[test]
fn cubic_splines_use_the_tangents_times_the_length() -> Result {
    let mut model = Model::square();
    // In-tangent, value, out-tangent of x; y and z stay 0.
    let numbers = [100.0, 1.0, 3.0, -1.0, 5.0, 100.0];
    let output: Vec<f32> = numbers.iter().flat_map(|x| [*x, 0.0, 0.0]).collect();
    let output = model.floats("VEC3", &output);
    model.channel(0, "translation", "CUBICSPLINE", &[0.0, 2.0], output);
    let file = open(&model)?;
    // At s = 1/4 the Hermite basis is 27/32, 9/64, 5/32, -3/64; tangents count twice, for 2 s:
    // 27/32 * 1 + 2 * 9/64 * 3 + 5/32 * 5 + 2 * 3/64 = 2.5625.
    assert_close(corners(&file, 0.5)?[0], Vec3::new(2.5625, 0.0, 0.0));
    assert_close(corners(&file, 0.0)?[0], Vec3::X);
    assert_close(corners(&file, 9.0)?[0], 5.0 * Vec3::X);

    // A quarter turn with tangents 0: at the middle both ends count the same, so 45 degrees.
    let mut model = Model::square();
    let mut output = [0.0; 24];
    output[7] = 1.0;
    output[16..20].copy_from_slice(&[0.0, 0.0, FRAC_1_SQRT_2, FRAC_1_SQRT_2]);
    let output = model.floats("VEC4", &output);
    model.channel(0, "rotation", "CUBICSPLINE", &[0.0, 1.0], output);
    let wanted = Vec3::new(FRAC_1_SQRT_2, FRAC_1_SQRT_2, 0.0);
    assert_close(corners(&open(&model)?, 0.5)?[1], wanted);
    Ok(())
}

#[test]
fn all_animations_play_and_the_first_one_wins() -> Result {
    let mut model = Model::square();
    let first = model.floats("VEC3", &[1., 0., 0.]);
    let second = model.floats("VEC3", &[0., 9., 0.]);
    let scale = model.floats("VEC3", &[3., 1., 1.]);
    model.channel(0, "translation", "LINEAR", &[0.0], first);
    model.channel(0, "translation", "LINEAR", &[7.0], second);
    let times = model.floats("SCALAR", &[2.0]);
    model.push(
        "animations",
        json!({"samplers": [{"input": times, "output": second}, {"input": times, "output": scale}],
               "channels": [{"sampler": 0, "target": {"node": 0, "path": "translation"}},
                            {"sampler": 1, "target": {"node": 0, "path": "scale"}}]}),
    );
    let file = open(&model)?;
    assert_eq!(corners(&file, 5.0)?, [Vec3::X, 4.0 * Vec3::X]);
    assert_eq!(file.duration(), 2.0, "of what counts");
    Ok(())
}

#[test]
fn what_is_not_animated_stays_and_the_origin_too() -> Result {
    let mut model = Model::square();
    model.json["nodes"] = json!([{"mesh": 0, "scale": [2, 2, 2]},
        {"children": [0], "translation": [100_000, 0, 0], "rotation": [0, 0, 1, 0]}]);
    model.json["scenes"][0]["nodes"] = json!([1]);
    let output = model.floats("VEC3", &[0., 0., 0., 0., 0., 1.0e6]);
    model.channel(0, "translation", "LINEAR", &[0.0, 1.0], output);
    let file = open(&model)?;
    let origin = file.scene_at(0.0)?.rebase_origin;
    assert!(
        (origin - DVec3::new(1.0e5, 0.0, 0.0)).length() < 8.0,
        "{origin}"
    );
    for seconds in [0.0, 0.3, 1.0] {
        let scene = file.scene_at(seconds)?;
        assert_eq!(scene.rebase_origin, origin);
        // Half a turn about Z, twice as large, far away, and up by the animation.
        let corner = scene.primitives[0].positions[1].as_dvec3() + origin;
        let wanted = DVec3::new(1.0e5 - 2.0, 0.0, 1.0e6 * seconds);
        assert!((corner - wanted).length() < 0.1, "{corner}");
    }
    Ok(())
}

#[test]
fn lights_and_cameras_follow_their_nodes() -> Result {
    let mut model = Model::square();
    model.json = lit(json!({"type": "spot", "spot": {}}), json!({}));
    model.json["cameras"] =
        json!([{"type": "perspective", "perspective": {"yfov": 1, "znear": 0.1}}]);
    model.json["nodes"][1]["camera"] = json!(0);
    model.json["nodes"][1]["children"] = json!([2]);
    model.push(
        "nodes",
        json!({"translation": [0, 0, 1], "extensions": {"KHR_lights_punctual": {"light": 0}}}),
    );
    let turn = model.floats(
        "VEC4",
        &[0., 0., 0., 1., 0., FRAC_1_SQRT_2, 0., FRAC_1_SQRT_2],
    );
    model.channel(1, "rotation", "LINEAR", &[0.0, 1.0], turn);
    let place = model.floats("VEC3", &[0., 0., 0., 0., 5., 0.]);
    model.channel(1, "translation", "LINEAR", &[0.0, 1.0], place);
    let scene = open(&model)?.scene_at(1.0)?;
    let [own, child] = [scene.lights[0].light, scene.lights[1].light];
    let camera = &scene.cameras[0];
    // A quarter turn about Y takes -Z to -X, and +Z to +X.
    assert_close(own.center, Vec3::new(0.0, 5.0, 0.0));
    assert_close(own.direction, Vec3::NEG_X);
    assert_close(child.center, Vec3::new(1.0, 5.0, 0.0));
    assert_close(child.direction, Vec3::NEG_X);
    assert_close(camera.position, own.center);
    assert_close(camera.forward, Vec3::NEG_X);
    assert_close(camera.right, Vec3::NEG_Z);
    Ok(())
}

#[test]
fn broken_animations_are_named() {
    type Break = fn(&mut Model);
    let broken: [(Break, &str); 14] = [
        (
            |m| moved(m, &[0.0, f32::NAN], 2),
            "the time of key 1 is not finite",
        ),
        (
            |m| moved(m, &[f32::INFINITY, 1.0], 2),
            "the time of key 0 is not finite",
        ),
        (
            |m| moved(m, &[0.0, 2.0, 1.0], 3),
            "key 2 comes before key 1: 1 s after 2 s",
        ),
        (
            |m| moved(m, &[0.0, 1.0], 3),
            "2 keys need 6 numbers as output, and it has 9",
        ),
        (|m| moved(m, &[], 0), "it has no keys"),
        (
            |m| {
                let output = m.floats("VEC3", &[0., 0., 0., 0., f32::NAN, 0.]);
                m.channel(0, "scale", "LINEAR", &[0.0, 1.0], output);
            },
            "a value of key 1 is not finite",
        ),
        (
            |m| {
                let output = m.floats("VEC4", &[0., 0., 0., 1., 0., 0., 0., 0.]);
                m.channel(0, "rotation", "LINEAR", &[0.0, 1.0], output);
            },
            "the rotation of key 1 is no unit quaternion",
        ),
        (
            |m| {
                let output = m.floats("VEC3", &[0.; 3]);
                m.channel(0, "rotation", "LINEAR", &[0.0], output);
            },
            "it must have 4 components",
        ),
        (
            |m| {
                moved(m, &[0.0], 1);
                m.json["animations"][0]["channels"][0]["target"]["node"] = json!(8);
            },
            "node 8, which is missing",
        ),
        (
            |m| {
                moved(m, &[0.0], 1);
                m.json["animations"][0]["channels"][0]["sampler"] = json!(1);
            },
            "animations[0].channels[0].sampler",
        ),
        (
            |m| {
                moved(m, &[0.0], 1);
                m.json["animations"][0]["samplers"][0]["input"] = json!(99);
            },
            "animations[0].samplers[0].input",
        ),
        (
            |m| {
                moved(m, &[0.0], 1);
                m.json["animations"][0]["samplers"][0]["interpolation"] = json!("SMOOTH");
            },
            "animations[0].samplers[0].interpolation",
        ),
        (
            |m| {
                moved(m, &[0.0], 1);
                m.json["animations"][0]["channels"][0]["target"]["path"] = json!("colour");
            },
            "channel 0: its path is none of",
        ),
        (
            |m| {
                moved(m, &[0.0], 1);
                m.json["nodes"][0]["matrix"] =
                    json!([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]);
            },
            "node 0, which has a `matrix`",
        ),
    ];
    for (break_it, wanted) in broken {
        let mut model = Model::square();
        break_it(&mut model);
        let message = message(&model);
        assert!(message.starts_with("test.glb: "), "{message}");
        assert!(message.contains(wanted), "{message} lacks {wanted}");
        assert!(!message.contains('\n'), "{message}");
    }
}

/// Moves node 0 by `values` keys of nothing.
fn moved(model: &mut Model, times: &[f32], values: usize) {
    let output = model.floats("VEC3", &vec![0.0; 3 * values]);
    model.channel(0, "translation", "LINEAR", times, output);
}

#[test]
fn a_moment_that_leaves_the_range_of_numbers_is_an_error() -> Result {
    let mut model = Model::square();
    let output = model.floats("VEC3", &[0., 0., 0., 0., 3.0e38, 0.]);
    model.channel(0, "translation", "LINEAR", &[0.0, 1.0], output);
    let file = open(&model)?;
    assert!(file.scene_at(0.0).is_ok());
    let error = file.scene_at(1.0).err().map(|error| error.to_string());
    assert!(error.is_some_and(|error| error.contains("primitive 0 `quad`: vertex 0 lies at")));
    Ok(())
}

#[test]
fn copies_of_a_node_are_shown() -> Result {
    let mut model = Model::square();
    let translation = model.floats("VEC3", &[5., 0., 0., 0., 0., 7.]);
    let half = FRAC_1_SQRT_2;
    let rotation = model.floats("VEC4", &[0., 0., 0., 1., 0., 0., half, half]);
    let scale = model.floats("VEC3", &[2., 2., 2., 1., 1., 1.]);
    model.json["extensionsRequired"] = json!(["EXT_mesh_gpu_instancing"]);
    let attributes = |value: Value| json!({"EXT_mesh_gpu_instancing": {"attributes": value}});
    model.json["nodes"][0]["translation"] = json!([0, 1, 0]);
    model.json["nodes"][0]["extensions"] = attributes(
        json!({"TRANSLATION": translation, "ROTATION": rotation, "SCALE": scale, "_ID": 0}),
    );
    let scene = open(&model)?.scene_at(0.0)?;
    let names: Vec<&str> = scene.primitives.iter().map(|p| p.name.as_str()).collect();
    assert_eq!(names, ["quad[0]", "quad[1]"]);
    let corner = |i: usize| {
        let corner = scene.primitives[i].positions[1].as_dvec3() + scene.rebase_origin;
        corner.as_vec3()
    };
    assert_close(corner(0), Vec3::new(7.0, 1.0, 0.0));
    assert_close(corner(1), Vec3::new(0.0, 2.0, 7.0));
    for (value, wanted) in [
        (
            json!({"TRANSLATION": 0, "SCALE": scale}),
            "not of one length",
        ),
        (
            json!({"TRANSLATION": 77}),
            "TRANSLATION names a missing accessor",
        ),
        (
            json!({"ROTATION": "x"}),
            "ROTATION names a missing accessor",
        ),
    ] {
        model.json["nodes"][0]["extensions"] = attributes(value);
        let message = message(&model);
        assert!(message.contains(wanted), "{message}");
        assert!(
            message.contains("node 0 `quad`: EXT_mesh_gpu_instancing"),
            "{message}"
        );
    }
    Ok(())
}

#[test]
fn animations_of_other_things_than_nodes_are_left_out() -> Result {
    let mut model = Model::square();
    let output = model.floats("VEC3", &[1., 0., 0.]);
    model.channel(0, "translation", "LINEAR", &[0.0], output);
    push(
        &mut model.json["animations"][0],
        "channels",
        json!({"sampler": 0, "target": {"path": "pointer", "extensions":
               {"KHR_animation_pointer": {"pointer": "/materials/0/emissiveFactor"}}}}),
    );
    push(
        &mut model.json["animations"][0],
        "channels",
        json!({"sampler": 0, "target": {"path": "scale"}}),
    );
    assert_eq!(corners(&open(&model)?, 0.0)?[0], Vec3::X);
    Ok(())
}
