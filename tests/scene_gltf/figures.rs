//! Skins and morph targets.

use std::f32::consts::FRAC_1_SQRT_2;

use antumbra::scene::{LoadOptions, Scene, SceneFile};
use glam::Vec3;
use serde_json::json;

use super::model::{Model, U8, U16};
use super::{Result, area_vector, assert_close, push, triangles};

/// A quarter turn about Z.
const QUARTER: [f32; 4] = [0.0, 0.0, FRAC_1_SQRT_2, FRAC_1_SQRT_2];

fn load(model: &Model) -> Result<Scene> {
    let scene = Scene::load_slice("test.glb", &model.glb(), &LoadOptions::default());
    Ok(scene?)
}

fn message(model: &Model) -> String {
    match load(model) {
        Ok(_) => panic!("accepted: {}", model.json),
        Err(error) => error.to_string(),
    }
}

fn vertex(scene: &Scene, index: usize) -> Vec3 {
    (scene.primitives[0].positions[index].as_dvec3() + scene.rebase_origin).as_vec3()
}

/// A strip from (0, 0, 0) to (0, 2, 0), its four vertices at x = 0 and at heights 0, 1, 1.5 and 2
/// (and z beside, so that there are triangles), on two joints: node 1 at the origin, and on it
/// node 2, one up. Vertices follow joint 0; both by half; both by half; joint 1.
fn arm() -> Model {
    let mut model = Model::square();
    let positions = [0., 0., 0., 0., 1., 0., 0., 1.5, 1., 0., 2., 0.];
    let positions = model.floats("VEC3", &positions);
    let normals = model.floats("VEC3", &[1., 0., 0.].repeat(4));
    let joints = model.accessor(U8, "VEC4", &[0, 1, 0, 0].repeat(4));
    let weights = [
        1., 0., 0., 0., 0.5, 0.5, 0., 0., 0.5, 0.5, 0., 0., 0., 1., 0., 0.,
    ];
    let weights = model.floats("VEC4", &weights);
    for (name, accessor) in [
        ("POSITION", positions),
        ("NORMAL", normals),
        ("JOINTS_0", joints),
        ("WEIGHTS_0", weights),
    ] {
        model.attribute(name, accessor);
    }
    let matrix = |y: f32| {
        let [x, z, w] = [[1., 0., 0., 0.], [0., 0., 1., 0.], [0., y, 0., 1.]];
        [x, [0., 1., 0., 0.], z, w].concat()
    };
    let inverse = [matrix(0.0), matrix(-1.0)].concat();
    let inverse = model.floats("MAT4", &inverse);
    model.json["skins"] = json!([{"name": "bones", "joints": [1, 2],
                                  "inverseBindMatrices": inverse}]);
    // The node's own transform must not count.
    model.json["nodes"] = json!([
        {"mesh": 0, "skin": 0, "translation": [9, 9, 9], "scale": [-5, 5, 5]},
        {"children": [2]},
        {"translation": [0, 1, 0]}
    ]);
    model.json["scenes"][0]["nodes"] = json!([0, 1]);
    model
}

#[test]
fn a_bent_arm() -> Result {
    let mut model = arm();
    let scene = load(&model)?;
    for (index, wanted) in [[0., 0., 0.], [0., 1., 0.], [0., 1.5, 1.], [0., 2., 0.]]
        .into_iter()
        .enumerate()
    {
        assert_close(vertex(&scene, index), Vec3::from_array(wanted));
        assert_close(scene.primitives[0].normals[index], Vec3::X);
    }
    model.json["nodes"][2]["rotation"] = json!(QUARTER);
    let bent = load(&model)?;
    // Joint 1 takes (0, y, z) to (1 - y, 1, z); half of it and half of what it was.
    for (index, wanted) in [[0., 0., 0.], [0., 1., 0.], [-0.25, 1.25, 1.], [-1., 1., 0.]]
        .into_iter()
        .enumerate()
    {
        assert_close(vertex(&bent, index), Vec3::from_array(wanted));
    }
    let normals = &bent.primitives[0].normals;
    assert_close(normals[0], Vec3::X);
    assert_close(normals[1], Vec3::new(FRAC_1_SQRT_2, FRAC_1_SQRT_2, 0.0));
    assert_close(normals[3], Vec3::Y);
    // The same by animation, with the origin of the rest pose.
    let mut model = arm();
    let output = model.floats("VEC4", &[[0., 0., 0., 1.], QUARTER].concat());
    model.channel(2, "rotation", "LINEAR", &[0.0, 1.0], output);
    let file = SceneFile::from_slice("test.glb", model.glb(), &LoadOptions::default())?;
    let animated = file.scene_at(1.0)?;
    for index in 0..4 {
        assert_close(vertex(&animated, index), vertex(&bent, index));
    }
    assert_eq!(animated.rebase_origin, file.scene_at(0.0)?.rebase_origin);
    Ok(())
}

#[test]
fn joints_and_weights_of_other_types_and_a_second_set() -> Result {
    let mut model = arm();
    model.json["nodes"][2]["rotation"] = json!(QUARTER);
    let wanted = load(&model)?;
    // Joint 0 is named in the first set and joint 1 in the second; weights need not add up to 1.
    let joints: Vec<u8> = [0u16, 7, 7, 7]
        .repeat(4)
        .iter()
        .flat_map(|j| j.to_le_bytes())
        .collect();
    let first = model.accessor(U16, "VEC4", &joints);
    let second = model.accessor(U8, "VEC4", &[9, 1, 9, 9].repeat(4));
    let (mut low, mut high) = (vec![0u8; 16], Vec::new());
    for (vertex, weights) in [[255, 0], [60, 60], [100, 100], [0, 30]]
        .into_iter()
        .enumerate()
    {
        low[4 * vertex] = weights[0];
        high.extend([0u16, 257 * u16::from(weights[1]), 0, 0]);
    }
    let high: Vec<u8> = high
        .iter()
        .flat_map(|weight| weight.to_le_bytes())
        .collect();
    let low = model.normalized(U8, "VEC4", &low);
    let high = model.normalized(U16, "VEC4", &high);
    for (name, accessor) in [
        ("JOINTS_0", first),
        ("JOINTS_1", second),
        ("WEIGHTS_0", low),
        ("WEIGHTS_1", high),
    ] {
        model.attribute(name, accessor);
    }
    let found = load(&model)?;
    for index in 0..4 {
        assert_close(vertex(&found, index), vertex(&wanted, index));
    }
    // No weight at all: the joint that is named first.
    let none = model.floats("VEC4", &[0.0; 16]);
    model.attribute("WEIGHTS_0", none);
    model.attribute("WEIGHTS_1", none);
    assert_close(vertex(&load(&model)?, 3), Vec3::new(0.0, 2.0, 0.0));
    Ok(())
}

#[test]
fn stretched_joints_lean_normals_the_right_way() -> Result {
    let mut model = arm();
    let slanted = [FRAC_1_SQRT_2, FRAC_1_SQRT_2, 0.0].repeat(4);
    let slanted = model.floats("VEC3", &slanted);
    model.attribute("NORMAL", slanted);
    model.json["nodes"][1]["scale"] = json!([2, 1, 1]);
    let scene = load(&model)?;
    let wanted = Vec3::new(0.5, 1.0, 0.0).normalize();
    assert_close(scene.primitives[0].normals[0], wanted);
    // Mirrored by a joint: the front stays in front.
    model.json["nodes"][1]["scale"] = json!([-1, 1, 1]);
    let mirrored = load(&model)?;
    let wanted = Vec3::new(-FRAC_1_SQRT_2, FRAC_1_SQRT_2, 0.0);
    assert_close(mirrored.primitives[0].normals[0], wanted);
    let area = |scene: &Scene| triangles(scene).into_iter().map(area_vector).sum::<Vec3>();
    model.json["nodes"][1]["scale"] = json!([1, 1, 1]);
    assert_close(area(&mirrored), -area(&load(&model)?));
    Ok(())
}

#[test]
fn joints_outside_the_scene_and_no_inverse_bind_matrices() -> Result {
    let mut model = arm();
    model.json["scenes"][0]["nodes"] = json!([0]);
    model.json["nodes"][1]["translation"] = json!([3, 0, 0]);
    assert_close(vertex(&load(&model)?, 3), Vec3::new(3.0, 2.0, 0.0));
    // Then the mesh is modelled in each joint's own space.
    model.json["skins"][0] = json!({"joints": [1, 2]});
    assert_close(vertex(&load(&model)?, 3), Vec3::new(3.0, 3.0, 0.0));
    Ok(())
}

#[test]
fn a_mesh_without_joints_stays_with_its_node() -> Result {
    let mut model = arm();
    for name in ["JOINTS_0", "WEIGHTS_0"] {
        let attributes = model.primitive()["attributes"].as_object_mut();
        attributes.map(|attributes| attributes.remove(name));
    }
    assert_close(vertex(&load(&model)?, 3), Vec3::new(9.0, 19.0, 9.0));
    Ok(())
}

#[test]
fn broken_skins_are_named() {
    type Break = fn(&mut Model);
    let broken: [(Break, &str); 12] = [
        (|m| m.json["nodes"][0]["skin"] = json!(4), "nodes[0].skin"),
        (
            |m| m.json["skins"][0]["joints"] = json!([]),
            "skin 0 `bones`: it has no joints",
        ),
        (
            |m| m.json["skins"][0]["joints"] = json!([1, 17]),
            "skins[0].joints[1]",
        ),
        (
            |m| m.json["skins"][0]["joints"] = json!([1]),
            "mesh 0, primitive 0: vertex 1 follows joint 1 of skin 0 `bones`, which has 1",
        ),
        (
            |m| m.json["skins"][0]["joints"] = json!([1, 2, 1]),
            "3 joints and 2 inverse bind matrices",
        ),
        (
            |m| {
                let mut matrices = [0.0; 32];
                matrices[20] = f32::NAN;
                m.json["skins"][0]["inverseBindMatrices"] = json!(m.floats("MAT4", &matrices));
            },
            "inverse bind matrix 0 is not finite, or its last row",
        ),
        (
            |m| m.json["skins"][0]["inverseBindMatrices"] = json!(0),
            "accessor 0: it must have 16 components",
        ),
        (
            |m| {
                let weights = m.floats("VEC4", &[0., 0., 0., f32::NAN].repeat(4));
                m.attribute("WEIGHTS_0", weights);
            },
            "a joint weight of vertex 0 is not finite and 0 or more",
        ),
        (
            |m| {
                let joints = m.floats("VEC4", &[0.0; 16]);
                m.attribute("JOINTS_0", joints);
            },
            "joints must be unsigned integers",
        ),
        (
            |m| {
                let joints = m.accessor(U8, "VEC4", &[0; 12]);
                m.attribute("JOINTS_0", joints);
            },
            "4 positions, 3 joints and 4 weights",
        ),
        (
            |m| {
                let attributes = m.primitive()["attributes"].as_object_mut();
                attributes.map(|attributes| attributes.remove("WEIGHTS_0"));
            },
            "JOINTS_0 and WEIGHTS_0 go together",
        ),
        (
            |m| {
                m.json["scenes"][0]["nodes"] = json!([0]);
                m.json["nodes"][2]["children"] = json!([1]);
            },
            "node 1: it is its own ancestor",
        ),
    ];
    for (break_it, wanted) in broken {
        let mut model = arm();
        break_it(&mut model);
        let message = message(&model);
        assert!(message.contains(wanted), "{message} lacks {wanted}");
        assert!(!message.contains('\n'), "{message}");
    }
}

/// The square with two morph targets: the first lifts corner 2 by 1 along Z (a sparse accessor),
/// the second moves all by (1, 0, 0).
fn soft() -> Model {
    let mut model = Model::square();
    let (which, value) = (model.view(&[2]), [0.0f32, 0.0, 1.0]);
    let value = model.view(&super::floats(&value));
    let sparse = model.push(
        "accessors",
        json!({"componentType": 5126, "count": 4, "type": "VEC3", "sparse": {"count": 1,
               "indices": {"bufferView": which, "componentType": 5121},
               "values": {"bufferView": value}}}),
    );
    let shift = model.floats("VEC3", &[1., 0., 0.].repeat(4));
    model.primitive()["targets"] = json!([{"POSITION": sparse}, {"POSITION": shift}]);
    model
}

#[test]
fn morph_weights_come_from_animation_node_or_mesh() -> Result {
    let mut model = soft();
    let corner = |model: &Model| -> Result<Vec3> { Ok(vertex(&load(model)?, 2)) };
    assert_close(corner(&model)?, Vec3::new(1.0, 1.0, 0.0));
    model.json["meshes"][0]["weights"] = json!([0.5, 0]);
    assert_close(corner(&model)?, Vec3::new(1.0, 1.0, 0.5));
    model.json["nodes"][0]["weights"] = json!([-2, 0.25]);
    assert_close(corner(&model)?, Vec3::new(1.25, 1.0, -2.0));
    let output = model.floats("SCALAR", &[0., 0., 1., 4.]);
    model.channel(0, "weights", "LINEAR", &[0.0, 1.0], output);
    let file = SceneFile::from_slice("test.glb", model.glb(), &LoadOptions::default())?;
    assert_close(vertex(&file.scene_at(0.0)?, 2), Vec3::new(1.0, 1.0, 0.0));
    assert_close(vertex(&file.scene_at(0.75)?, 2), Vec3::new(4.0, 1.0, 0.75));
    // A spline's tangents stand in blocks, one number a target: in, value, out.
    let mut model = soft();
    let output = [9., 9., 0., 1., 0., 0., 0., 0., 1., 3., 9., 9.];
    let output = model.floats("SCALAR", &output);
    model.channel(0, "weights", "CUBICSPLINE", &[0.0, 1.0], output);
    let file = SceneFile::from_slice("test.glb", model.glb(), &LoadOptions::default())?;
    assert_close(vertex(&file.scene_at(0.5)?, 2), Vec3::new(3.0, 1.0, 0.5));
    Ok(())
}

#[test]
fn normals_follow_the_morph() -> Result {
    // Flat ones are made anew: the lifted triangles lean.
    let mut model = soft();
    model.json["nodes"][0]["weights"] = json!([1, 0]);
    let scene = load(&model)?;
    // (1, 0, 0) x (1, 1, 1) = (0, -1, 1).
    assert_close(
        scene.primitives[0].normals[0],
        Vec3::new(0.0, -FRAC_1_SQRT_2, FRAC_1_SQRT_2),
    );
    // Given ones get their displacement: (0, 0, 1) + 0.75 / 1 along Y is a 3-4-5 triangle.
    let normals = model.floats("VEC3", &[0., 0., 1.].repeat(4));
    let lean = model.floats("VEC3", &[0., 0.75, 0.].repeat(4));
    model.attribute("NORMAL", normals);
    model.primitive()["targets"][0]["NORMAL"] = json!(lean);
    let scene = load(&model)?;
    assert_close(scene.primitives[0].normals[1], Vec3::new(0.0, 0.6, 0.8));
    Ok(())
}

#[test]
fn morph_comes_before_skin() -> Result {
    let mut model = arm();
    let up = model.floats("VEC3", &[0., 1., 0.].repeat(4));
    model.primitive()["targets"] = json!([{"POSITION": up}]);
    model.json["nodes"][0]["weights"] = json!([1]);
    model.json["nodes"][2]["rotation"] = json!(QUARTER);
    // (0, 3, 0) on joint 1, which takes (0, y, 0) to (1 - y, 1, 0).
    assert_close(vertex(&load(&model)?, 3), Vec3::new(-2.0, 1.0, 0.0));
    Ok(())
}

#[test]
fn broken_morph_targets_are_named() {
    type Break = fn(&mut Model);
    let broken: [(Break, &str); 7] = [
        (
            |m| m.json["nodes"][0]["weights"] = json!([1]),
            "1 weights for 2 morph targets",
        ),
        (
            |m| m.json["meshes"][0]["weights"] = json!([1, 2, 3]),
            "3 weights for 2",
        ),
        (
            |m| m.json["nodes"][0]["weights"] = json!([1e39, 0]),
            "weight is not finite",
        ),
        (
            |m| m.primitive()["targets"][1]["POSITION"] = json!(55),
            "meshes[0].primitives[0].targets[1]",
        ),
        (
            |m| {
                let short = m.floats("VEC3", &[0.0; 9]);
                m.primitive()["targets"][1]["POSITION"] = json!(short);
            },
            "4 positions, and POSITION of morph target 1 3",
        ),
        (
            |m| {
                let bad = m.floats("VEC3", &[0., 0., 0., 0., 0., f32::INFINITY].repeat(2));
                m.primitive()["targets"][1]["POSITION"] = json!(bad);
            },
            "POSITION of morph target 1 of vertex 1 is not finite",
        ),
        (
            |m| {
                let plain = json!({"attributes": {"POSITION": 0}});
                push(&mut m.json["meshes"][0], "primitives", plain);
            },
            "primitive 1: it has 0 morph targets and the first primitive 2",
        ),
    ];
    for (break_it, wanted) in broken {
        let mut model = soft();
        break_it(&mut model);
        let message = message(&model);
        assert!(message.contains(wanted), "{message} lacks {wanted}");
    }
}
