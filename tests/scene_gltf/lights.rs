//! Lights and cameras.

use std::f32::consts::{FRAC_PI_2, FRAC_PI_4};

use antumbra::light::{DEFAULT_SUN_ANGLE, IntensityUnit, LightShape, SpotCone};
use glam::Vec3;
use serde_json::{Value, json};

use super::*;

#[test]
fn extras_give_the_shape_in_world_metres() -> Result {
    let cases = [
        (json!({}), LightShape::Point),
        (json!({"other": 1}), LightShape::Point),
        (json!([1, 2]), LightShape::Point),
        (
            json!({"shape": "disk", "radius": 0.5}),
            LightShape::Disk { radius: 0.5 },
        ),
        (
            json!({"shape": "rect", "width": 2, "height": 0.25}),
            LightShape::Rect {
                width: 2.0,
                height: 0.25,
            },
        ),
        (
            json!({"shape": "sphere", "radius": 3}),
            LightShape::Sphere { radius: 3.0 },
        ),
        (
            json!({"shape": "line", "length": 4}),
            LightShape::Line { length: 4.0 },
        ),
    ];
    for (extras, shape) in cases {
        for kind in ["point", "spot"] {
            let mut light = json!({"type": kind, "intensity": 7, "extras": extras});
            if kind == "spot" {
                light["spot"] = json!({});
            }
            // The node's scale must not reach the size.
            let scene = load(&lit(light, json!({"scale": [3, 4, 5]})))?;
            let light = scene.lights[0].light;
            assert_eq!(light.shape, shape);
            assert_eq!(light.unit, IntensityUnit::Candela);
            assert_eq!(light.intensity, 7.0);
            let cone = SpotCone {
                inner: 0.0,
                outer: FRAC_PI_4,
            };
            assert_eq!(light.spot, (kind == "spot").then_some(cone));
        }
    }
    Ok(())
}

#[test]
fn extras_say_how_bright_parts_of_a_rect_are() -> Result {
    let of = |weights: Value| {
        let extras = json!({"shape": "rect", "width": 2, "height": 1, "weights": weights});
        lit(json!({"type": "point", "extras": extras}), json!({}))
    };
    let light = load(&of(json!([[2, 0, 0], [0, 0, 1]])))?.lights[0].light;
    assert_eq!(light.weights.columns(), 3);
    assert_eq!(light.weights.values(), [1.0, 0.0, 0.0, 0.0, 0.0, 0.5]);
    assert!(light.is_uneven());
    for bad in [
        json!([[0, 0]]),
        json!([[1, -1]]),
        json!([[1, 2], [1]]),
        json!([]),
        json!([[]]),
        json!("grey.png"),
    ] {
        let message = message(&of(bad));
        assert!(message.contains("`weights` of its light is"), "{message}");
    }
    Ok(())
}

#[test]
fn directional_lights_are_suns() -> Result {
    for (extras, angle) in [
        (json!({}), DEFAULT_SUN_ANGLE),
        (json!({"angular_diameter_deg": 5}), 5f32.to_radians()),
        (json!({"angular_diameter_deg": 0}), 0.0),
    ] {
        let light = json!({"type": "directional", "intensity": 3, "extras": extras});
        let scene = load(&lit(
            light,
            json!({"rotation": [-0.5f64.sqrt(), 0, 0, 0.5f64.sqrt()]}),
        ))?;
        let light = scene.lights[0].light;
        let LightShape::Sun { angular_diameter } = light.shape else {
            panic!("{light:?}");
        };
        assert!((angular_diameter - angle).abs() < 1e-7);
        assert_eq!(light.unit, IntensityUnit::Lux);
        // -Z turned by -90 degrees about X.
        assert_close(light.direction, Vec3::NEG_Y);
    }
    Ok(())
}

#[test]
fn area_light_draft_uses_the_largest_scale() -> Result {
    let node = json!({"scale": [0.5, -3, 2], "translation": [1, 2, 3]});
    let rect = json!({"type": "rect", "size": 2, "rect": {"aspect": 1.5}, "intensity": 50});
    let light = load(&area_lit(rect, node.clone()))?.lights[0].light;
    let wanted = LightShape::Rect {
        width: 9.0,
        height: 6.0,
    };
    assert_eq!(light.shape, wanted);
    assert_eq!(light.unit, IntensityUnit::Nits);
    assert_eq!(light.candela(), 50.0 * 54.0);
    assert_close(light.center, Vec3::new(1.0, 2.0, 3.0));
    let disk = load(&area_lit(json!({"type": "disk"}), node))?.lights[0].light;
    assert_eq!(disk.shape, LightShape::Disk { radius: 1.5 });
    assert_eq!(disk.intensity, 1000.0);
    assert_eq!(disk.color, Vec3::ONE);
    let bad = area_lit(json!({"type": "sphere"}), json!({"name": "lamp"}));
    assert!(message(&bad).contains("node 1 `lamp`"), "{}", message(&bad));
    let mut missing = area_lit(json!({"type": "disk"}), json!({}));
    missing["extensions"]["EXT_lights_area"]["lights"] = json!([]);
    assert!(message(&missing).contains("light 0 is missing"));
    Ok(())
}

#[test]
fn an_area_light_wins_over_a_punctual_one_on_its_node() -> Result {
    let mut json = area_lit(json!({"type": "disk"}), json!({}));
    json["extensions"]["KHR_lights_punctual"] = json!({"lights": [{"type": "point"}]});
    json["nodes"][1]["extensions"]["KHR_lights_punctual"] = json!({"light": 0});
    let scene = load(&json)?;
    assert_eq!(scene.lights.len(), 1);
    assert_eq!(scene.lights[0].light.unit, IntensityUnit::Nits);
    Ok(())
}

#[test]
fn light_frames_ignore_scale_and_shear() -> Result {
    let rect = json!({"type": "point",
        "extras": {"shape": "rect", "width": 2, "height": 1}});
    let turned = json!({"rotation": [0, 0.5f64.sqrt(), 0, 0.5f64.sqrt()], "scale": [9, 0.1, 4]});
    let light = load(&lit(rect.clone(), turned))?.lights[0].light;
    assert_close(light.axis_x, Vec3::NEG_Z);
    assert_close(light.axis_y, Vec3::Y);
    assert_close(light.direction, Vec3::NEG_X);
    // A parent's uneven scale shears a turned child.
    let mut sheared = lit(
        rect.clone(),
        json!({"rotation": [0.2, 0.3, 0.1, 0.927_361_849_6]}),
    );
    push(
        &mut sheared,
        "nodes",
        json!({"children": [1], "scale": [1, 5, 0.2]}),
    );
    sheared["scenes"][0]["nodes"] = json!([0, 2]);
    let light = load(&sheared)?.lights[0].light;
    assert!(light.axis_x.dot(light.axis_y).abs() < 1e-6);
    assert_close(light.axis_x.cross(light.axis_y), -light.direction);
    // Squashed to nothing, a light still has a frame.
    for scale in [json!([0, 0, 0]), json!([1, 1, 0]), json!([0, 1, 1])] {
        let light = load(&lit(rect.clone(), json!({"scale": scale})))?.lights[0].light;
        assert_eq!(light.validate(), Ok(()));
        assert_close(light.direction, Vec3::NEG_Z);
    }
    Ok(())
}

#[test]
fn cones_are_brought_into_order() -> Result {
    let spot = |inner: f64, outer: f64| {
        let cone = json!({"innerConeAngle": inner, "outerConeAngle": outer});
        let light = json!({"type": "spot", "spot": cone});
        load(&lit(light, json!({}))).map(|scene| scene.lights[0].light.spot)
    };
    let cone = |inner, outer| Some(SpotCone { inner, outer });
    assert_eq!(spot(0.5, 0.5)?, cone(0.5, 0.5));
    assert_eq!(spot(0.9, 0.5)?, cone(0.5, 0.5));
    assert_eq!(spot(0.25, 1.6)?, cone(0.25, FRAC_PI_2));
    assert!(spot(0.0, 0.0).is_err());
    Ok(())
}

#[test]
fn bad_lights_are_named() {
    let extras = [
        (json!({"shape": "cube"}), "\"cube\""),
        (json!({"shape": 3}), "shape 3"),
        (json!({"shape": "disk"}), "without `radius`"),
        (json!({"shape": "disk", "radius": "1"}), "`radius`"),
        (json!({"shape": "disk", "radius": 0}), "radius `0`"),
        (json!({"shape": "disk", "radius": -1}), "radius `-1`"),
        (
            json!({"shape": "line", "length": 1e30}),
            "length `1000000000000000",
        ),
        (json!({"shape": "rect", "width": 1}), "without `height`"),
    ];
    for (extras, wanted) in extras {
        let light = json!({"type": "point", "extras": extras});
        let message = message(&lit(light, json!({"name": "lamp"})));
        assert!(message.starts_with("test.gltf: "), "{message}");
        assert!(message.contains("`lamp`"), "{message}");
        assert!(message.contains(wanted), "{message}");
    }
    let sun = json!({"type": "directional", "extras": {"angular_diameter_deg": 180}});
    assert!(message(&lit(sun, json!({}))).contains("sun angle"));
    let dark = json!({"type": "point", "intensity": -2});
    assert!(message(&lit(dark, json!({}))).contains("intensity -2"));
    let range = json!({"type": "point", "range": 0});
    assert!(message(&lit(range, json!({}))).contains("range 0"));
}

#[test]
fn cameras_look_along_minus_z_without_scale() -> Result {
    let mut json = square();
    json["cameras"] = json!([
        {"type": "orthographic", "orthographic": {"xmag": 1, "ymag": 1, "znear": 0, "zfar": 1}},
        {"type": "perspective", "perspective": {"yfov": 0.8, "znear": 0.1}},
        {"type": "perspective", "perspective": {"yfov": 0.5, "znear": 0.1, "zfar": 9,
            "aspectRatio": 2}}
    ]);
    json["nodes"] = json!([
        {"mesh": 0},
        {"camera": 0, "name": "plan"},
        {"camera": 1, "translation": [1, 2, 3], "scale": [-2, 1, 7],
         "rotation": [0, 0.5f64.sqrt(), 0, 0.5f64.sqrt()]},
        {"camera": 2, "name": "long"}
    ]);
    json["scenes"][0]["nodes"] = json!([3, 2, 1, 0]);
    let scene = load(&json)?;
    let camera = scene.select_camera(None)?;
    assert_eq!(
        (camera.name.as_str(), camera.index, camera.node),
        ("camera 1", 1, Some(2))
    );
    assert_close(camera.position, Vec3::new(1.0, 2.0, 3.0));
    assert_close(camera.forward, Vec3::NEG_X);
    assert_close(camera.up, Vec3::Y);
    assert_close(camera.right, Vec3::NEG_Z);
    assert_eq!((camera.yfov, camera.zfar), (0.8, None));
    assert_eq!(scene.select_camera(Some("2"))?.name, "long");
    assert_eq!(scene.select_camera(Some("long"))?.zfar, Some(9.0));
    assert!(scene.select_camera(Some("plan")).is_err());

    for (key, value) in [
        ("yfov", json!(0)),
        ("yfov", json!(3.2)),
        ("znear", json!(0)),
        ("zfar", json!(0.05)),
        ("zfar", json!(1e39)),
    ] {
        let mut bad = json.clone();
        bad["cameras"][2]["perspective"][key] = value.clone();
        let message = message(&bad);
        assert!(
            message.contains("camera 2 `long`"),
            "{key} {value}: {message}"
        );
    }
    Ok(())
}
