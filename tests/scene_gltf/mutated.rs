//! Files changed at random: whatever comes out, it is no panic.

use std::sync::OnceLock;
use std::time::Instant;

use antumbra::scene::{LoadOptions, SceneFile};
use proptest::prelude::*;
use proptest::sample::Index;
use serde_json::{Value, json};

use super::model::{Model, U8, glb, jpeg, png};
use super::{Result, data_uri, heap, lit, load_bytes, push, square_data};

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

#[test]
fn the_files_to_be_mutated_are_good() -> Result {
    let (json, data) = &originals()[0];
    for binary in [false, true] {
        let scene = load_bytes(&file(binary, json, data))?;
        assert_eq!(scene.lights.len(), 2);
        assert_eq!(scene.cameras.len(), 1);
        assert_eq!(scene.primitives.len(), 2);
    }
    Ok(())
}

/// A file with a skin, morph targets, copies and animations of every kind.
fn figure() -> Model {
    let mut model = Model::square();
    let uvs = model.floats("VEC2", &[0., 1., 1., 1., 1., 0., 0., 0.]);
    let normals = model.floats("VEC3", &[0., 0., 1.].repeat(4));
    let colors = model.normalized(U8, "VEC4", &[255, 0, 255, 255].repeat(4));
    let joints = model.accessor(U8, "VEC4", &[0, 1, 0, 0].repeat(4));
    let weights = model.normalized(U8, "VEC4", &[100, 155, 0, 0].repeat(4));
    let lift = model.floats("VEC3", &[0., 0., 0.5].repeat(4));
    for (name, accessor) in [
        ("NORMAL", normals),
        ("TEXCOORD_0", uvs),
        ("COLOR_0", colors),
        ("JOINTS_0", joints),
        ("WEIGHTS_0", weights),
        ("JOINTS_1", joints),
        ("WEIGHTS_1", weights),
    ] {
        model.attribute(name, accessor);
    }
    model.primitive()["targets"] = json!([{"POSITION": lift, "NORMAL": lift}, {"POSITION": lift}]);
    let unit = [
        1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1.,
    ];
    let inverse = model.floats("MAT4", &unit.repeat(2));
    model.json["skins"] = json!([{"joints": [1, 2], "inverseBindMatrices": inverse}]);
    let moves = model.floats("VEC3", &[0., 1., 0., 2., 2., 2., 1., 1., 1.]);
    model.json["nodes"] = json!([
        {"mesh": 0, "skin": 0, "weights": [0.5, 0]}, {"children": [2]}, {"translation": [0, 1, 0]},
        {"mesh": 0, "extensions": {"EXT_mesh_gpu_instancing": {"attributes":
            {"TRANSLATION": moves, "SCALE": moves}}}}
    ]);
    model.json["scenes"][0]["nodes"] = json!([0, 1, 3]);
    let turns = model.floats("VEC4", &[0., 0., 0., 1., 0., 0.6, 0., 0.8, 1., 0., 0., 0.]);
    let spline: Vec<f32> = (0..18).map(|i| i as f32).collect();
    let spline = model.floats("SCALAR", &spline);
    let times = [0.0, 0.5, 2.0];
    model.channel(1, "rotation", "LINEAR", &times, turns);
    model.channel(2, "translation", "STEP", &times, moves);
    model.channel(2, "scale", "LINEAR", &times, moves);
    model.channel(0, "weights", "CUBICSPLINE", &times, spline);
    model
}

/// The figure with images on it.
fn painted() -> Model {
    let mut model = figure();
    model.primitive()["material"] = json!(0);
    let noise: Vec<[u8; 4]> = (0..64u8)
        .map(|i| [i, i.wrapping_mul(37), 255 - i, i * 4])
        .collect();
    let views = [png(8, 8, &noise), jpeg(8, 8, &noise)].map(|image| model.view(&image));
    model.json["images"] = json!(views.map(|view| json!({"bufferView": view})));
    model.json["samplers"] = json!([{"wrapS": 33071, "wrapT": 33648}]);
    model.json["textures"] = json!([{"source": 0, "sampler": 0}, {"source": 1}]);
    model.json["materials"] = json!([{
        "pbrMetallicRoughness": {"metallicRoughnessTexture": {"index": 1}, "baseColorTexture":
            {"index": 0, "extensions": {"KHR_texture_transform": {"rotation": 1, "scale": [2, 2]}}}},
        "emissiveFactor": [1, 1, 1], "emissiveTexture": {"index": 1},
        "alphaMode": "MASK", "alphaCutoff": 0.3
    }]);
    model
}

/// The files to be mutated.
fn originals() -> &'static [(Value, Vec<u8>); 3] {
    static MADE: OnceLock<[(Value, Vec<u8>); 3]> = OnceLock::new();
    MADE.get_or_init(|| {
        let of = |mut json: Value, data: Vec<u8>| {
            json["buffers"] = json!([{"byteLength": data.len()}]);
            (json, data)
        };
        let (figure, painted) = (figure(), painted());
        [
            of(rich(), square_data()),
            of(figure.json, figure.data),
            of(painted.json, painted.data),
        ]
    })
}

/// The whole file, .glb or .gltf.
fn file(binary: bool, json: &Value, data: &[u8]) -> Vec<u8> {
    if binary {
        return glb(json, data);
    }
    let mut json = json.clone();
    if let Some(buffer) = json
        .pointer_mut("/buffers/0")
        .and_then(Value::as_object_mut)
    {
        buffer.insert("uri".into(), json!(data_uri(data)));
    }
    json.to_string().into_bytes()
}

#[test]
fn the_figures_to_be_mutated_are_good() -> Result {
    for (which, images) in [(1, 0), (2, 1)] {
        let (json, data) = &originals()[which];
        let bytes = file(which == 1, json, data);
        let file = SceneFile::from_slice("test.gltf", bytes, &LoadOptions::default())?;
        assert!(file.is_animated());
        let (start, later) = (file.scene_at(0.0)?, file.scene_at(0.7)?);
        assert_eq!(start.primitives.len(), 4);
        assert_eq!(start.images.len(), images);
        assert_ne!(start.primitives[0].positions, later.primitives[0].positions);
    }
    Ok(())
}

/// What a small file may take in memory at any moment, bytes.
const MOST_MEMORY: usize = 100 << 20;

/// Loads `bytes`, and holds whatever comes out to what a scene promises.
fn check_any(bytes: &[u8]) -> std::result::Result<(), TestCaseError> {
    let mut options = LoadOptions::default();
    options.max_vertices = 10_000;
    let before = heap::start();
    let start = Instant::now();
    let file = SceneFile::from_slice("test.gltf", bytes.to_vec(), &options);
    let scenes = match &file {
        Ok(file) => [-1.0, 0.3, 0.5 * file.duration(), 1.0e30]
            .map(|at| file.scene_at(at))
            .into(),
        Err(_) => Vec::new(),
    };
    let errors = file.err().into_iter();
    let (mut good, mut bad) = (Vec::new(), errors.collect::<Vec<_>>());
    for scene in scenes {
        match scene {
            Ok(scene) => good.push(scene),
            Err(error) => bad.push(error),
        }
    }
    let used = heap::peak().saturating_sub(before);
    prop_assert!(used < MOST_MEMORY, "{} bytes of memory", used);
    prop_assert!(
        start.elapsed().as_secs() < 5,
        "it took {:?}",
        start.elapsed()
    );
    for mut scene in good {
        let bounds = scene.bounds;
        prop_assert!(scene.finish().is_ok());
        prop_assert_eq!(bounds, scene.bounds);
        prop_assert!(!bounds.is_empty());
    }
    for error in bad {
        let message = error.to_string();
        prop_assert!(message.starts_with("test.gltf: "), "{}", message);
        prop_assert!(!message.contains('\n'), "{}", message);
        prop_assert!(message.len() < 600, "{}", message);
    }
    Ok(())
}

#[test]
fn small_files_cannot_ask_for_much() {
    type Grow = fn(&mut Model);
    let many: [(Grow, &str); 7] = [
        (
            |m| m.primitive()["targets"] = json!(vec![json!({"POSITION": 0}); 30_000]),
            "more than 10000",
        ),
        (
            |m| {
                m.json["accessors"][0]["count"] = json!(0);
                m.primitive()["targets"] = json!(vec![json!({}); 5_000]);
                m.json["nodes"] = json!(vec![json!({"mesh": 0}); 5_000]);
                m.json["scenes"][0]["nodes"] = json!((0..5_000).collect::<Vec<_>>());
                let primitive = json!({"attributes": {"POSITION": 0}, "targets":
                                       m.primitive()["targets"]});
                *m.primitive() = primitive;
            },
            "more than 10000",
        ),
        (
            |m| {
                m.json["accessors"][0] = json!({"componentType": 5126, "count": 9_999,
                    "type": "VEC3", "sparse": {"count": 1, "values": {"bufferView": 0},
                    "indices": {"bufferView": 1, "componentType": 5121}}});
                m.primitive()["targets"] = json!(vec![json!({"POSITION": 0}); 1_000]);
            },
            "more than 10000",
        ),
        (
            |m| {
                let output = m.floats("VEC3", &[0.0; 3000]);
                let times: Vec<f32> = (0..1000u16).map(f32::from).collect();
                m.channel(0, "translation", "LINEAR", &times, output);
                m.json["nodes"] = json!(vec![json!({"mesh": 0}); 1_000]);
                let channels: Vec<Value> = (0..1_000)
                    .map(|node| json!({"sampler": 0, "target": {"node": node, "path": "scale"}}))
                    .collect();
                m.json["animations"][0]["channels"] = json!(channels);
            },
            "more than 10000",
        ),
        (
            |m| {
                let places = m.floats("VEC3", &[0.0; 15_000]);
                m.json["nodes"][0]["extensions"] = json!({"EXT_mesh_gpu_instancing":
                    {"attributes": {"TRANSLATION": places}}});
            },
            "more than 10000",
        ),
        // A long chain, all of it joints, and many nodes that follow it: no more than done once.
        (
            |m| {
                let mut nodes: Vec<Value> =
                    (1..=20_000).map(|i| json!({"children": [i]})).collect();
                nodes.push(json!({}));
                m.json["skins"] = json!([{"joints": (0..=20_000).collect::<Vec<_>>()}]);
                let joints = m.accessor(U8, "VEC4", &[0; 16]);
                let weights = m.floats("VEC4", &[1.0; 16]);
                m.attribute("JOINTS_0", joints);
                m.attribute("WEIGHTS_0", weights);
                nodes.extend(vec![json!({"mesh": 0, "skin": 0}); 1_000]);
                m.json["scenes"][0]["nodes"] = json!((20_001..21_001).collect::<Vec<_>>());
                m.json["nodes"] = json!(nodes);
            },
            "",
        ),
        (
            |m| {
                let image = m.view(&png(64, 64, &[[7; 4]; 4096]));
                m.json["images"] = json!(vec![json!({"bufferView": image}); 500]);
                let textures: Vec<Value> = (0..500).map(|i| json!({"source": i})).collect();
                m.json["textures"] = json!(textures);
                let materials: Vec<Value> = (0..500)
                    .map(|i| json!({"pbrMetallicRoughness": {"baseColorTexture": {"index": i}}}))
                    .collect();
                m.json["materials"] = json!(materials);
                let primitives: Vec<Value> = (0..500)
                    .map(|i| json!({"attributes": {"POSITION": 0}, "material": i}))
                    .collect();
                m.json["meshes"][0]["primitives"] = json!(primitives);
            },
            "more texels than may be decoded",
        ),
    ];
    for (grow, wanted) in many {
        let mut model = Model::square();
        grow(&mut model);
        let bytes = model.glb();
        let mut options = LoadOptions::default();
        options.max_vertices = 10_000;
        options.max_texels = 1 << 20;
        let (before, start) = (heap::start(), Instant::now());
        let found = SceneFile::from_slice("test.glb", bytes, &options)
            .and_then(|file| file.scene_at(0.0))
            .map(|scene| scene.primitives.len());
        let used = heap::peak() - before;
        assert!(used < MOST_MEMORY, "{wanted}: {used} bytes");
        assert!(
            start.elapsed().as_secs() < 5,
            "{wanted}: {:?}",
            start.elapsed()
        );
        match found {
            Ok(primitives) => assert!(wanted.is_empty() && primitives == 1_000, "{wanted}"),
            Err(error) => assert!(
                !wanted.is_empty() && error.to_string().contains(wanted),
                "{error} lacks {wanted}"
            ),
        }
    }
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

/// Floats that are none or huge, and anything.
fn odd_bytes() -> impl Strategy<Value = Vec<u8>> {
    prop_oneof![
        prop::sample::select(vec![f32::NAN, f32::INFINITY, 3.0e38, -1.0e20, 0.0, 1.0e-40])
            .prop_map(|value| value.to_le_bytes().to_vec()),
        prop::collection::vec(any::<u8>(), 1..9),
    ]
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
            json!(3000),
            json!(9999),
            json!(1u64 << 27),
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

/// One change of a document.
#[derive(Clone, Debug)]
enum Change {
    Replace(Index, Value),
    Scale(Index, f64),
    Remove(Index),
    Swap(Index, Index),
    Copy(Index, Index),
}

fn change() -> impl Strategy<Value = Change> {
    let index = any::<Index>;
    prop_oneof![
        3 => (index(), odd_value()).prop_map(|(at, value)| Change::Replace(at, value)),
        1 => (index(), prop::sample::select(vec![-1.0, 0.5, 2.0, 1.0e6, 1.0e20]))
            .prop_map(|(at, factor)| Change::Scale(at, factor)),
        1 => index().prop_map(Change::Remove),
        1 => (index(), index()).prop_map(|(a, b)| Change::Swap(a, b)),
        1 => (index(), index()).prop_map(|(a, b)| Change::Copy(a, b)),
    ]
}

fn apply(json: &mut Value, change: &Change) {
    let mut places = Vec::new();
    pointers(json, "", &mut places);
    let place = |at: &Index| at.get(&places).as_str();
    match change {
        Change::Replace(at, value) => {
            if let Some(target) = json.pointer_mut(place(at)) {
                *target = value.clone();
            }
        }
        Change::Scale(at, factor) => {
            if let Some(number) = json.pointer(place(at)).and_then(Value::as_f64) {
                let scaled = number * factor;
                let whole = scaled as i64;
                let whole = (whole as f64 == scaled).then(|| json!(whole));
                if let Some(target) = json.pointer_mut(place(at)) {
                    *target = whole.unwrap_or(json!(scaled));
                }
            }
        }
        Change::Remove(at) => {
            let Some((parent, key)) = place(at).rsplit_once('/') else {
                return;
            };
            match json.pointer_mut(parent) {
                Some(Value::Array(list)) => {
                    if let Some(index) = key.parse().ok().filter(|&index| index < list.len()) {
                        list.remove(index);
                    }
                }
                Some(Value::Object(map)) => {
                    map.remove(key);
                }
                _ => {}
            }
        }
        Change::Swap(a, b) | Change::Copy(a, b) => {
            let values = [a, b].map(|at| json.pointer(place(at)).cloned().unwrap_or_default());
            let [first, second] = values;
            let (a, b) = (place(a), place(b));
            if let Some(target) = json.pointer_mut(a) {
                *target = second;
            }
            if matches!(change, Change::Swap(..))
                && let Some(target) = json.pointer_mut(b)
            {
                *target = first;
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: std::env::var("PROPTEST_CASES")
            .ok()
            .and_then(|cases| cases.parse().ok())
            .unwrap_or(1700),
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    #[test]
    fn changed_bytes_never_panic(
        which in 0usize..3,
        binary in any::<bool>(),
        changes in prop::collection::vec((any::<Index>(), any::<u8>()), 1..5),
        cut in prop::option::weighted(0.2, any::<Index>()),
    ) {
        let (json, data) = &originals()[which];
        let mut bytes = file(binary, json, data);
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
    fn changed_data_never_panics(
        which in 0usize..3,
        changes in prop::collection::vec((any::<Index>(), odd_bytes()), 1..4),
    ) {
        let (json, data) = &originals()[which];
        let mut data = data.clone();
        for (at, bytes) in changes {
            let at = at.index(data.len());
            for (target, byte) in data[at..].iter_mut().zip(bytes) {
                *target = byte;
            }
        }
        check_any(&file(true, json, &data))?;
    }

    #[test]
    fn changed_values_never_panic(
        which in 0usize..3,
        binary in any::<bool>(),
        changes in prop::collection::vec(change(), 1..3),
    ) {
        let (json, data) = &originals()[which];
        let mut json = json.clone();
        for change in &changes {
            apply(&mut json, change);
        }
        check_any(&file(binary, &json, data))?;
    }
}
