//! What is said about broken files.

use antumbra::scene::{LoadOptions, Scene, SceneError};
use serde_json::{Value, json};

use super::*;

#[test]
fn files_that_are_no_gltf_are_told_apart() -> Result {
    let glb = make_assets::scenes().remove(3).1;
    let cases: [(&[u8], &str); 9] = [
        (b"", "it is empty"),
        (b" \n\t", "it is empty"),
        (b"\x89PNG\r\n\x1a\n", "starts neither with"),
        (b"glTF", "header is cut off"),
        (b"glTF\x01\0\0\0\x0c\0\0\0", "version 1"),
        (b"glTF\x02\0\0\0\x0c\0\0\0", "first chunk"),
        (b"glTF\x02\0\0\0\0\0\0\0", "first chunk"),
        (&glb[..1000], "truncated"),
        (b"{\"asset\":", "EOF"),
    ];
    for (bytes, wanted) in cases {
        let message = match load_bytes(bytes) {
            Ok(_) => panic!("accepted {wanted}"),
            Err(error) => error.to_string(),
        };
        assert!(message.starts_with("test.gltf: "), "{message}");
        assert!(message.contains(wanted), "{message}");
    }
    for (asset, wanted) in [
        (json!({"asset": {"version": "1.0"}}), "version 1.0"),
        (json!({"asset": {}}), "no `version`"),
        (json!({}), "no `asset`"),
        (
            json!({"asset": {"version": "2.1", "minVersion": "3.0"}}),
            "version 3.0",
        ),
    ] {
        assert!(message(&asset).contains(wanted), "{}", message(&asset));
    }
    Ok(())
}

#[test]
fn broken_elements_are_named() {
    type Break = fn(&mut Value);
    let broken: [(Break, &str); 20] = [
        (|j| j["scenes"][0]["nodes"] = json!([]), "no triangles"),
        (
            |j| j["scenes"][0]["nodes"] = json!([9]),
            "scenes[0].nodes[0]",
        ),
        (
            |j| j["nodes"][0]["children"] = json!([0]),
            "node 0 `quad`: it is reached twice",
        ),
        (
            |j| j["nodes"][0]["rotation"] = json!([0, 0, 0, 0]),
            "rotation",
        ),
        (
            |j| j["nodes"][0]["scale"] = json!([1e308, 1e308, 1e308]),
            "1e9 m",
        ),
        (
            |j| j["nodes"][0]["matrix"] = json!([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 1, 0, 0, 0, 1]),
            "last row",
        ),
        (
            |j| j["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = json!(7),
            "accessor 7",
        ),
        (
            |j| j["meshes"][0]["primitives"][0]["attributes"] = json!({}),
            "POSITION",
        ),
        (
            |j| j["meshes"][0]["primitives"][0]["indices"] = json!(0),
            "accessor 0: indices",
        ),
        (
            |j| j["meshes"][0]["primitives"][0]["material"] = json!(0),
            "material",
        ),
        (
            |j| j["accessors"][0]["count"] = json!(5),
            "accessor 0: 5 elements",
        ),
        (
            |j| j["accessors"][0]["count"] = json!(3),
            "names vertex 3 of 3",
        ),
        (
            |j| j["accessors"][0]["count"] = json!(u64::MAX),
            "accessor 0: more than",
        ),
        (
            |j| j["accessors"][0]["byteOffset"] = json!(u64::MAX),
            "accessor 0",
        ),
        (
            |j| j["accessors"][0]["type"] = json!("VEC2"),
            "accessor 0: it must have 3",
        ),
        (
            |j| j["accessors"][0]["bufferView"] = json!(null),
            "accessors[0].bufferView",
        ),
        (
            |j| j["bufferViews"][0]["byteLength"] = json!(99),
            "bufferView 0 reaches beyond",
        ),
        (
            |j| j["bufferViews"][0]["byteOffset"] = json!(u64::MAX),
            "bufferView 0",
        ),
        (
            |j| j["bufferViews"][0]["byteStride"] = json!(8),
            "byteStride 8",
        ),
        (
            |j| j["extensionsRequired"] = json!(["KHR_draco_mesh_compression"]),
            "export the file without mesh compression",
        ),
    ];
    for (break_it, wanted) in broken {
        let mut json = square();
        break_it(&mut json);
        let message = message(&json);
        assert!(message.starts_with("test.gltf: "), "{message}");
        assert!(message.contains(wanted), "{message} lacks {wanted}");
        assert!(!message.contains('\n'), "{message}");
    }
}

#[test]
fn numbers_that_are_none_are_named_with_their_vertex() {
    for bad in [f32::NAN, f32::INFINITY, 3e38] {
        let mut data = square_data();
        data[28..32].copy_from_slice(&bad.to_le_bytes());
        let mut json = square();
        json["buffers"][0]["uri"] = json!(data_uri(&data));
        let message = message(&json);
        assert!(message.contains("vertex 2"), "{message}");
        assert!(message.contains("finite"), "{message}");
    }
}

#[test]
fn buffers_are_found_beside_the_scene_only() -> Result {
    let folder = tempfile::tempdir()?;
    let inside = folder.path().join("scene");
    std::fs::create_dir_all(inside.join("data"))?;
    std::fs::write(inside.join("data/my square.bin"), square_data())?;
    std::fs::write(folder.path().join("outside.bin"), square_data())?;
    let path = inside.join("scene.gltf");
    let with_uri = |uri: &str| {
        let mut json = square();
        json["buffers"][0]["uri"] = json!(uri);
        std::fs::write(&path, json.to_string())?;
        Ok::<_, std::io::Error>(Scene::load(&path, &LoadOptions::default()))
    };
    for good in ["data/my%20square.bin", "./data/my square.bin"] {
        assert_eq!(with_uri(good)??.triangle_count(), 2, "{good}");
    }
    let outside = folder.path().join("outside.bin").display().to_string();
    for (bad, wanted) in [
        ("../outside.bin", "leaves the folder"),
        ("%2e%2e/outside.bin", "leaves the folder"),
        (outside.as_str(), "leaves the folder"),
        ("", "leaves the folder"),
        ("file:///etc/passwd", "only data URIs"),
        ("http://example.com/a.bin", "only data URIs"),
        ("nothing.bin", "No such file"),
        ("data", "not a regular file"),
        ("%ff.bin", "not UTF-8"),
        ("a%00b.bin", "cannot read its data"),
        (
            "data:application/octet-stream;base64,A*==",
            "invalid base64",
        ),
        ("data:nothing", "without a comma"),
        ("data:,abc", "declares 54 bytes and has 3"),
    ] {
        let message = match with_uri(bad)? {
            Ok(_) => panic!("accepted {bad}"),
            Err(error) => error.to_string(),
        };
        assert!(message.contains("scene.gltf: buffer 0: "), "{message}");
        assert!(message.contains(wanted), "{bad}: {message}");
        assert!(!message.contains('\n'), "{message}");
    }
    std::fs::write(inside.join("short.bin"), &square_data()[..20])?;
    let message = with_uri("short.bin")?.err().map(|e| e.to_string());
    assert!(message.is_some_and(|m| m.contains("declares 54 bytes and has 20")));
    let missing = Scene::load(inside.join("no.gltf"), &LoadOptions::default());
    assert!(matches!(missing, Err(SceneError::Read { .. })));
    Ok(())
}

#[test]
fn memory_is_bounded_by_the_limit() -> Result {
    let mut options = LoadOptions::default();
    options.max_vertices = 100;
    let mut json = square();
    json["nodes"] = json!(vec![json!({"mesh": 0}); 17]);
    json["scenes"][0]["nodes"] = json!((0..17).collect::<Vec<_>>());
    let text = json.to_string();
    let error = Scene::load_slice("test.gltf", text.as_bytes(), &options);
    assert!(
        matches!(error, Err(SceneError::TooLarge { .. })),
        "{error:?}"
    );
    // Elements that no byte of the file stands for.
    let mut json = square();
    json["accessors"][0] = json!({"componentType": 5126, "count": 1u64 << 40, "type": "VEC3",
        "sparse": {"count": 1, "indices": {"bufferView": 1, "componentType": 5121},
                   "values": {"bufferView": 0}}});
    assert!(matches!(load(&json), Err(SceneError::TooLarge { .. })));
    Ok(())
}

#[test]
fn names_cannot_break_the_line() {
    let mut json = square();
    json["nodes"][0]["name"] = json!("a\nb\u{7}".repeat(50));
    json["nodes"][0]["rotation"] = json!([0, 0, 0, 0]);
    let message = message(&json);
    assert!(!message.contains(char::is_control), "{message}");
    assert!(message.len() < 200, "{message}");
}
