//! Scenes from glTF files: what is read, how lights and cameras come out, and what is said about
//! broken files. Needs no GPU.
#![cfg(feature = "cli")]

#[path = "../../examples/make_assets/main.rs"]
mod make_assets;

mod animation;
mod assets;
mod broken;
mod figures;
mod heap;
mod large;
mod lights;
mod meshes;
mod model;
mod mutated;
mod textures;

use antumbra::scene::{LoadOptions, Scene, SceneError};
use glam::Vec3;
use serde_json::{Value, json};

type Result<T = ()> = std::result::Result<T, Box<dyn std::error::Error>>;

fn load_bytes(bytes: &[u8]) -> std::result::Result<Scene, SceneError> {
    Scene::load_slice("test.gltf", bytes, &LoadOptions::default())
}

fn load(json: &Value) -> std::result::Result<Scene, SceneError> {
    load_bytes(json.to_string().as_bytes())
}

fn message(json: &Value) -> String {
    match load(json) {
        Ok(scene) => panic!("accepted: {scene:?}"),
        Err(error) => error.to_string(),
    }
}

fn data_uri(bytes: &[u8]) -> String {
    use base64::Engine as _;
    let text = base64::engine::general_purpose::STANDARD.encode(bytes);
    format!("data:application/octet-stream;base64,{text}")
}

/// Little-endian bytes of floats.
fn floats(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

/// Four corners of the unit square, then the indices 0 1 2 0 2 3 as bytes.
fn square_data() -> Vec<u8> {
    let corners = [0., 0., 0., 1., 0., 0., 1., 1., 0., 0., 1., 0.];
    let mut data = floats(&corners);
    data.extend([0, 1, 2, 0, 2, 3]);
    data
}

/// A file with the unit square in node 0, to be changed by the tests.
fn square() -> Value {
    let data = square_data();
    json!({
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"name": "quad", "mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3",
             "min": [0, 0, 0], "max": [1, 1, 0]},
            {"bufferView": 1, "componentType": 5121, "count": 6, "type": "SCALAR"}
        ],
        "bufferViews": [
            {"buffer": 0, "byteLength": 48},
            {"buffer": 0, "byteOffset": 48, "byteLength": 6}
        ],
        "buffers": [{"byteLength": data.len(), "uri": data_uri(&data)}]
    })
}

fn push(json: &mut Value, list: &str, element: Value) {
    if let Some(list) = json[list].as_array_mut() {
        list.push(element);
    }
}

/// The square with a node for one light: `light` of KHR_lights_punctual, `node` its transform.
fn lit(light: Value, node: Value) -> Value {
    let mut json = square();
    json["extensions"] = json!({"KHR_lights_punctual": {"lights": [light]}});
    let mut node = node;
    node["extensions"] = json!({"KHR_lights_punctual": {"light": 0}});
    push(&mut json, "nodes", node);
    json["scenes"][0]["nodes"] = json!([0, 1]);
    json
}

fn area_lit(light: Value, node: Value) -> Value {
    let mut json = square();
    json["extensionsRequired"] = json!(["EXT_lights_area"]);
    json["extensionsUsed"] = json!(["EXT_lights_area"]);
    json["extensions"] = json!({"EXT_lights_area": {"lights": [light]}});
    let mut node = node;
    node["extensions"] = json!({"EXT_lights_area": {"light": 0}});
    push(&mut json, "nodes", node);
    json["scenes"][0]["nodes"] = json!([0, 1]);
    json
}

/// Every triangle as its three positions.
fn triangles(scene: &Scene) -> Vec<[Vec3; 3]> {
    let corners = |p: &antumbra::scene::Primitive| {
        let corner = |i: &u32| p.positions[*i as usize];
        p.indices.iter().map(corner).collect::<Vec<_>>()
    };
    let all: Vec<Vec3> = scene.primitives.iter().flat_map(corners).collect();
    all.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect()
}

fn area_vector(triangle: [Vec3; 3]) -> Vec3 {
    0.5 * (triangle[1] - triangle[0]).cross(triangle[2] - triangle[0])
}

#[track_caller]
fn assert_close(found: Vec3, wanted: Vec3) {
    assert!((found - wanted).length() < 1e-5, "{found} is not {wanted}");
}
