//! Files changed at random: whatever comes out, it is no panic.

use antumbra::scene::{LoadOptions, Scene};
use proptest::prelude::*;
use serde_json::{Value, json};

use super::{Result, data_uri, lit, load_bytes, push, square_data};

/// A small file of every feature that is read, for the mutations.
fn rich() -> Value {
    let mut json = lit(
        json!({"type": "spot", "spot": {"outerConeAngle": 0.7}, "range": 9,
               "extras": {"shape": "rect", "width": 2, "height": 1}}),
        json!({"scale": [1, 2, 3]}),
    );
    json["extensions"]["EXT_lights_area"] =
        json!({"lights": [{"type": "rect", "rect": {"aspect": 2}}]});
    json["cameras"] = json!([{"type": "perspective", "perspective": {"yfov": 1, "znear": 0.1}}]);
    json["materials"] = json!([{"alphaMode": "MASK"}]);
    json["meshes"][0]["primitives"][0]["material"] = json!(0);
    json["meshes"][0]["primitives"] = json!([
        json["meshes"][0]["primitives"][0],
        {"attributes": {"POSITION": 0, "NORMAL": 0}, "mode": 5}
    ]);
    json["accessors"][0]["sparse"] = json!({"count": 1,
        "indices": {"bufferView": 1, "componentType": 5121}, "values": {"bufferView": 0}});
    push(
        &mut json,
        "nodes",
        json!({"camera": 0, "children": [3], "rotation": [0, 0, 0, 1]}),
    );
    push(
        &mut json,
        "nodes",
        json!({"extensions": {"EXT_lights_area": {"light": 0}},
        "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]}),
    );
    json["scenes"][0]["nodes"] = json!([0, 1, 2]);
    json
}

fn glb(json: &Value, bin: &[u8]) -> Vec<u8> {
    let mut text = json.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let mut bytes = b"glTF\x02\0\0\0".to_vec();
    bytes.extend(((12 + 8 + text.len() + 8 + bin.len()) as u32).to_le_bytes());
    for (kind, data) in [(b"JSON", &text[..]), (b"BIN\0", bin)] {
        bytes.extend((data.len() as u32).to_le_bytes());
        bytes.extend(kind);
        bytes.extend(data);
    }
    bytes
}

fn rich_glb() -> Vec<u8> {
    let mut json = rich();
    let data = square_data();
    json["buffers"] = json!([{"byteLength": data.len()}]);
    glb(&json, &data)
}

#[test]
fn the_files_to_be_mutated_are_good() -> Result {
    for bytes in [rich().to_string().into_bytes(), rich_glb()] {
        let scene = load_bytes(&bytes)?;
        assert_eq!(scene.lights.len(), 2);
        assert_eq!(scene.cameras.len(), 1);
        assert_eq!(scene.primitives.len(), 2);
    }
    Ok(())
}

/// Loads `bytes`, and holds whatever comes out to what a scene promises.
fn check_any(bytes: &[u8]) -> std::result::Result<(), TestCaseError> {
    let mut options = LoadOptions::default();
    options.max_vertices = 10_000;
    match Scene::load_slice("test.gltf", bytes, &options) {
        Ok(mut scene) => {
            let bounds = scene.bounds;
            prop_assert!(scene.finish().is_ok());
            prop_assert_eq!(bounds, scene.bounds);
            prop_assert!(!bounds.is_empty());
        }
        Err(error) => {
            let message = error.to_string();
            prop_assert!(message.starts_with("test.gltf: "), "{}", message);
            prop_assert!(!message.contains('\n'), "{}", message);
        }
    }
    Ok(())
}

/// The places of all values in a document.
fn pointers(value: &Value, at: &str, found: &mut Vec<String>) {
    found.push(at.into());
    match value {
        Value::Array(list) => {
            for (i, value) in list.iter().enumerate() {
                pointers(value, &format!("{at}/{i}"), found);
            }
        }
        Value::Object(map) => {
            for (key, value) in map {
                pointers(value, &format!("{at}/{key}"), found);
            }
        }
        _ => {}
    }
}

fn odd_value() -> impl Strategy<Value = Value> {
    prop_oneof![
        (0u64..10).prop_map(|n| json!(n)),
        any::<u64>().prop_map(|n| json!(n)),
        any::<i32>().prop_map(|n| json!(n)),
        any::<f64>().prop_map(|x| json!(x)),
        prop::sample::select(vec![
            json!(null),
            json!([]),
            json!({}),
            json!(""),
            json!(true),
            json!(-1),
            json!(1e308),
            json!(1e39),
            json!(1e-320),
            json!(5120),
            json!(5122),
            json!(5125),
            json!(5126),
            json!("VEC2"),
            json!("SCALAR"),
            json!("MAT3"),
            json!("spot"),
            json!("directional"),
            json!([0]),
            json!([0, 0, 0]),
            json!([1e30, 0, 0]),
            json!([0, 0, 0, 0]),
        ]),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: std::env::var("PROPTEST_CASES")
            .ok()
            .and_then(|cases| cases.parse().ok())
            .unwrap_or(400),
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    #[test]
    fn changed_bytes_never_panic(
        binary in any::<bool>(),
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..8),
        cut in prop::option::weighted(0.2, any::<prop::sample::Index>()),
    ) {
        let mut bytes = if binary { rich_glb() } else { rich().to_string().into_bytes() };
        for (at, byte) in changes {
            let at = at.index(bytes.len());
            bytes[at] = byte;
        }
        if let Some(cut) = cut {
            bytes.truncate(cut.index(bytes.len()));
        }
        check_any(&bytes)?;
    }

    #[test]
    fn changed_values_never_panic(
        binary in any::<bool>(),
        changes in prop::collection::vec((any::<prop::sample::Index>(), odd_value()), 1..4),
        data in prop::collection::vec(any::<u8>(), 54..60),
        keep_data in any::<bool>(),
    ) {
        let data = if keep_data { square_data() } else { data };
        let mut json = rich();
        json["buffers"] = match binary {
            true => json!([{"byteLength": 54}]),
            false => json!([{"byteLength": 54, "uri": data_uri(&data)}]),
        };
        for (at, value) in changes {
            let mut places = Vec::new();
            pointers(&json, "", &mut places);
            let place = at.get(&places);
            if let Some(target) = json.pointer_mut(place) {
                *target = value;
            }
        }
        let bytes = if binary { glb(&json, &data) } else { json.to_string().into_bytes() };
        check_any(&bytes)?;
    }
}
