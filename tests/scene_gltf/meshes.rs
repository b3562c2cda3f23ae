//! Meshes, nodes and materials.

use antumbra::scene::AlphaMode;
use glam::{DVec3, Vec3, Vec4};
use serde_json::json;

use super::*;

#[test]
fn indices_of_every_type_give_the_same_triangles() -> Result {
    let wanted = triangles(&load(&square())?);
    assert_eq!(wanted.len(), 2);
    for (kind, size) in [(5121, 1), (5123, 2), (5125, 4)] {
        let mut json = square();
        let mut data = square_data()[..48].to_vec();
        for index in [0u32, 1, 2, 0, 2, 3] {
            data.extend(&index.to_le_bytes()[..size]);
        }
        json["accessors"][1]["componentType"] = json!(kind);
        json["bufferViews"][1]["byteLength"] = json!(6 * size);
        json["buffers"][0] = json!({"byteLength": data.len(), "uri": data_uri(&data)});
        assert_eq!(triangles(&load(&json)?), wanted, "component type {kind}");
    }
    Ok(())
}

#[test]
fn strips_fans_and_plain_vertices_are_triangulated() -> Result {
    // As a strip 0 1 3 2, as a fan 0 1 2 3: the same square, all facing +Z.
    for (mode, order) in [(5, [0u8, 1, 3, 2]), (6, [0, 1, 2, 3])] {
        let mut json = square();
        let mut data = square_data()[..48].to_vec();
        data.extend(order);
        json["meshes"][0]["primitives"][0]["mode"] = json!(mode);
        json["accessors"][1]["count"] = json!(4);
        json["bufferViews"][1]["byteLength"] = json!(4);
        json["buffers"][0] = json!({"byteLength": data.len(), "uri": data_uri(&data)});
        let triangles = triangles(&load(&json)?);
        assert_eq!(triangles.len(), 2, "mode {mode}");
        for triangle in triangles {
            assert_close(area_vector(triangle), 0.5 * Vec3::Z);
        }
    }
    let mut plain = square();
    plain["meshes"][0]["primitives"][0] = json!({"attributes": {"POSITION": 0}});
    assert_eq!(triangles(&load(&plain)?).len(), 1);
    // Points have no surface, so a file of points alone has nothing to show.
    plain["meshes"][0]["primitives"][0]["mode"] = json!(0);
    assert!(message(&plain).contains("no triangles"));
    Ok(())
}

#[test]
fn missing_normals_are_flat_and_given_ones_are_turned() -> Result {
    let scene = load(&square())?;
    let flat = &scene.primitives[0];
    assert_eq!(flat.positions.len(), 6, "flat triangles share no vertex");
    assert!(flat.normals.iter().all(|n| *n == Vec3::Z));

    let mut json = square();
    let mut data = square_data();
    data.extend([0, 0]);
    let slanted = Vec3::new(0.0, 0.6, 0.8);
    for _ in 0..4 {
        data.extend(floats(&slanted.to_array()));
    }
    push(
        &mut json,
        "bufferViews",
        json!({"buffer": 0, "byteOffset": 56, "byteLength": 48}),
    );
    push(
        &mut json,
        "accessors",
        json!({"bufferView": 2, "componentType": 5126, "count": 4, "type": "VEC3"}),
    );
    json["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = json!(2);
    json["buffers"][0] = json!({"byteLength": data.len(), "uri": data_uri(&data)});
    json["nodes"][0]["scale"] = json!([1, 2, -1]);
    let scene = load(&json)?;
    let smooth = &scene.primitives[0];
    assert_eq!(smooth.positions.len(), 4);
    // Twice as tall: the normal leans away from Y by the inverse; mirrored in Z.
    assert_close(smooth.normals[0], Vec3::new(0.0, 0.3, -0.8).normalize());
    Ok(())
}

#[test]
fn mirrored_nodes_keep_their_front() -> Result {
    let mut json = square();
    json["nodes"][0]["scale"] = json!([-1, 1, 1]);
    let scene = load(&json)?;
    for triangle in triangles(&scene) {
        assert_close(area_vector(triangle), 0.5 * Vec3::Z);
    }
    assert_close(scene.bounds.min, Vec3::new(-1.0, 0.0, 0.0));
    assert!(scene.primitives[0].normals.iter().all(|n| *n == Vec3::Z));
    Ok(())
}

#[test]
fn node_transforms_multiply_down_the_tree() -> Result {
    let mut json = square();
    json["scenes"][0]["nodes"] = json!([2]);
    json["nodes"] = json!([
        {"mesh": 0, "translation": [1, 0, 0]},
        {"children": [0], "scale": [2, 3, 4]},
        {"children": [1], "matrix": [0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1, 0, 5, 6, 7, 1]}
    ]);
    let scene = load(&json)?;
    // (0..1, 0..1) -> (1..2, 0..1) -> (2..4, 0..3) -> turned by 90 degrees -> moved.
    let origin = scene.rebase_origin.as_vec3();
    assert_close(scene.bounds.min + origin, Vec3::new(2.0, 8.0, 7.0));
    assert_close(scene.bounds.max + origin, Vec3::new(5.0, 10.0, 7.0));
    Ok(())
}

#[test]
fn small_details_survive_far_from_the_origin() -> Result {
    let mut json = lit(
        json!({"type": "point"}),
        json!({"translation": [123_456_789.125, 0.0, 3.0]}),
    );
    json["nodes"][0]["translation"] = json!([123_456_789.375, -8.0, 0.0]);
    let scene = load(&json)?;
    let quad = scene.bounds.min.as_dvec3() + scene.rebase_origin;
    assert_eq!(quad, DVec3::new(123_456_789.375, -8.0, 0.0));
    let light = scene.lights[0].light.center.as_dvec3() + scene.rebase_origin;
    assert_eq!(light, DVec3::new(123_456_789.125, 0.0, 3.0));
    assert!(scene.bounds.min.abs().max_element() < 4.0);
    Ok(())
}

#[test]
fn sparse_and_quantised_positions_are_read() -> Result {
    let mut json = square();
    let mut data = square_data();
    data.extend([2, 0]);
    data.extend(floats(&[5.0, 6.0, 7.0]));
    push(
        &mut json,
        "bufferViews",
        json!({"buffer": 0, "byteOffset": 54, "byteLength": 1}),
    );
    push(
        &mut json,
        "bufferViews",
        json!({"buffer": 0, "byteOffset": 56, "byteLength": 12}),
    );
    json["accessors"][0]["sparse"] = json!({"count": 1,
        "indices": {"bufferView": 2, "componentType": 5121}, "values": {"bufferView": 3}});
    json["buffers"][0] = json!({"byteLength": data.len(), "uri": data_uri(&data)});
    let scene = load(&json)?;
    let max = scene.bounds.max.as_dvec3() + scene.rebase_origin;
    assert_eq!(max, DVec3::new(5.0, 6.0, 7.0));
    json["accessors"][0]["sparse"]["count"] = json!(2);
    assert!(message(&json).contains("accessor 0"));

    let mut json = square();
    let mut data = Vec::new();
    for corner in [[0u16, 0], [65535, 0], [65535, 65535], [0, 65535]] {
        data.extend(corner[0].to_le_bytes());
        data.extend(corner[1].to_le_bytes());
        data.extend([0; 4]);
    }
    data.extend([0, 1, 2, 0, 2, 3]);
    json["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
    json["accessors"][0]["componentType"] = json!(5123);
    json["accessors"][0]["normalized"] = json!(true);
    json["bufferViews"] = json!([
        {"buffer": 0, "byteLength": 32, "byteStride": 8},
        {"buffer": 0, "byteOffset": 32, "byteLength": 6}
    ]);
    json["buffers"][0] = json!({"byteLength": data.len(), "uri": data_uri(&data)});
    assert_eq!(triangles(&load(&json)?), triangles(&load(&square())?));
    Ok(())
}

#[test]
fn materials_keep_colour_sides_and_alpha() -> Result {
    let mut json = square();
    json["materials"] = json!([
        {"name": "leaf", "doubleSided": true, "alphaMode": "MASK", "alphaCutoff": 0.25,
         "pbrMetallicRoughness": {"baseColorFactor": [0.1, 0.2, 0.3, 0.4]}},
        {"alphaMode": "BLEND"}
    ]);
    json["meshes"][0]["primitives"][0]["material"] = json!(0);
    let scene = load(&json)?;
    let leaf = &scene.materials[scene.primitives[0].material];
    assert_eq!(leaf.name, "leaf");
    assert!(leaf.double_sided);
    assert_eq!(leaf.alpha_mode, AlphaMode::Mask { cutoff: 0.25 });
    assert_eq!(leaf.base_color, Vec4::new(0.1, 0.2, 0.3, 0.4));
    assert_eq!(scene.materials[1].alpha_mode, AlphaMode::Blend);
    let scene = load(&square())?;
    let default = &scene.materials[scene.primitives[0].material];
    assert_eq!(default.base_color, Vec4::ONE);
    Ok(())
}

#[test]
fn only_the_default_scene_is_loaded() -> Result {
    let mut json = square();
    json["nodes"] = json!([{"mesh": 0, "name": "a"}, {"mesh": 0, "name": "b"}]);
    json["scenes"] = json!([{"nodes": [0]}, {"nodes": [1]}]);
    json["scene"] = json!(1);
    assert_eq!(load(&json)?.primitives[0].name, "b");
    json.as_object_mut().map(|o| o.remove("scene"));
    assert_eq!(load(&json)?.primitives[0].name, "a");
    json.as_object_mut().map(|o| o.remove("scenes"));
    assert_eq!(load(&json)?.primitives.len(), 2);
    Ok(())
}
