//! Frames in which nothing moves use again what the technique made.
#![cfg(feature = "cli")]

mod support;

use antumbra::capture::{CapturedFrame, FrameRenderer, FrameRequest};
use antumbra::light::LightShape;
use support::plates::{SIZE, camera, floor, plate, scene};

#[test]
fn what_stays_is_not_made_again() {
    let _one = support::serial();
    let blocker = plate("blocker", [-2.0, 0.0], [-2.0, 2.0], 5.0);
    let still = scene(vec![floor(), blocker], LightShape::Disk { radius: 0.5 });
    let mut renderer = FrameRenderer::owning(support::gpu(), still.clone()).unwrap();
    let request = FrameRequest {
        camera: camera(),
        size: [SIZE; 2],
        lights: vec![0],
        technique: "pcss".parse().unwrap(),
    };
    let plain = renderer.render(&request).unwrap();
    let first = renderer.render_static(&request).unwrap();
    let second = renderer.render_static(&request).unwrap();
    for frame in [&first, &second] {
        assert!(frame.color == plain.color);
        assert!(frame.lights[0].visibility == plain.lights[0].visibility);
    }
    let of_technique = |names: &[String]| names.iter().filter(|n| n.starts_with("pcss")).count();
    assert!(of_technique(&first.report.passes) >= 4);
    assert_eq!(of_technique(&second.report.passes), 0);
    assert_eq!(
        (first.counters["masks_kept"], second.counters["masks_kept"]),
        (0, 1)
    );
    assert!(second.counters["transient_bytes"] < first.counters["transient_bytes"]);
    let says = |frame: &CapturedFrame, name: &str, reason: &str| {
        let mut culled = frame.plan.culled.iter();
        culled.any(|pass| pass.name == name && pass.reason.contains(reason))
    };
    assert!(says(&second, "pcss 0:lamp", "nothing has moved"));
    assert!(!says(&first, "pcss 0:lamp", ""));

    // A frame in between does not matter.
    renderer.render(&request).unwrap();
    assert_eq!(
        renderer.render_static(&request).unwrap().counters["masks_kept"],
        1
    );

    // Whatever changes, is made anew: camera, technique, light, scene.
    let mut moved = request.clone();
    moved.camera.position.x += 0.1;
    let after = renderer.render_static(&moved).unwrap();
    assert_eq!(after.counters["masks_kept"], 0);
    assert!(after.lights[0].visibility == renderer.render(&moved).unwrap().lights[0].visibility);
    assert_eq!(
        renderer.render_static(&moved).unwrap().counters["masks_kept"],
        1
    );
    let mut other = moved.clone();
    other.technique = "hard".parse().unwrap();
    assert_eq!(
        renderer.render_static(&other).unwrap().counters["masks_kept"],
        0
    );
    let mut brighter = still.clone();
    brighter.lights[0].light.center.x += 1.0;
    assert!(!renderer.set_scene(brighter).unwrap());
    assert_eq!(
        renderer.render_static(&other).unwrap().counters["masks_kept"],
        0
    );
    assert!(
        renderer
            .set_scene(scene(vec![floor()], LightShape::Point))
            .unwrap()
    );
    let bare = renderer.render_static(&other).unwrap();
    assert_eq!(bare.counters["masks_kept"], 0);
    assert!(bare.lights[0].visibility.iter().all(|v| *v == 1.0));
    support::assert_no_messages(&renderer.destroy().unwrap());
}

/// A line's mask has a second image, which shading reads.
#[test]
fn influences_of_a_lines_ends_are_kept_too() {
    let _one = support::serial();
    let blocker = plate("blocker", [-2.0, 0.0], [-2.0, 2.0], 5.0);
    let still = scene(vec![floor(), blocker], LightShape::Line { length: 2.0 });
    let mut renderer = FrameRenderer::owning(support::gpu(), still).unwrap();
    let request = FrameRequest {
        camera: camera(),
        size: [SIZE; 2],
        lights: vec![0],
        technique: "oess".parse().unwrap(),
    };
    let first = renderer.render_static(&request).unwrap();
    let second = renderer.render_static(&request).unwrap();
    assert_eq!(second.counters["masks_kept"], 1);
    assert!(first.color == second.color);
    support::assert_no_messages(&renderer.destroy().unwrap());
}

/// Silhouettes depend on light and casters alone: a camera that moves does not search for them anew.
#[test]
fn silhouettes_stay_while_the_camera_moves() {
    let _one = support::serial();
    let blocker = plate("blocker", [-2.0, 0.0], [-2.0, 2.0], 5.0);
    let still = scene(vec![floor(), blocker], LightShape::Disk { radius: 0.5 });
    let mut renderer = FrameRenderer::owning(support::gpu(), still.clone()).unwrap();
    let mut request = FrameRequest {
        camera: camera(),
        size: [SIZE; 2],
        lights: vec![0],
        technique: "pcss".parse().unwrap(),
    };
    // Nobody has asked for edges yet.
    let without = renderer.render(&request).unwrap();
    assert!(!without.counters.contains_key("edges"));
    request.technique = "ssoc".parse().unwrap();
    let searches = |names: &[String]| names.iter().filter(|n| n.contains("silhouettes.")).count();
    let first = renderer.render_static(&request).unwrap();
    assert_eq!(first.counters["edges"], 10);
    assert_eq!(searches(&first.report.passes), 3);
    assert_eq!(
        searches(&renderer.render_static(&request).unwrap().report.passes),
        0
    );
    request.camera.position.x += 0.1;
    let moved = renderer.render_static(&request).unwrap();
    assert_eq!(searches(&moved.report.passes), 0);
    let mut culled = moved.plan.culled.iter();
    assert!(culled.any(|pass| {
        pass.name == "ssoc.silhouettes 0:lamp" && pass.reason.contains("casters have moved")
    }));
    let kept = ["masks_kept", "silhouettes_kept", "edges_found"].map(|name| moved.counters[name]);
    assert_eq!(kept, [0, 1, 1]);
    assert!(moved.lights[0].visibility == renderer.render(&request).unwrap().lights[0].visibility);

    let mut brighter = still.clone();
    brighter.lights[0].light.center.x += 1.0;
    renderer.set_scene(brighter).unwrap();
    let other = renderer.render_static(&request).unwrap();
    assert_eq!(searches(&other.report.passes), 3);
    assert!(other.lights[0].visibility != moved.lights[0].visibility);

    // Another moment of a mesh that a skin moves has the same edges, which are not sought again.
    let mut posed = still;
    posed.primitives[1].rest = posed.primitives[1].positions.clone();
    renderer.set_scene(posed.clone()).unwrap();
    let at_rest = renderer.render(&request).unwrap();
    posed.primitives[1].positions[1].y += 0.5;
    posed.finish().unwrap();
    renderer.set_scene(posed.clone()).unwrap();
    let bent = renderer.render(&request).unwrap();
    assert_eq!(
        (
            at_rest.counters["edges_found"],
            bent.counters["edges_found"]
        ),
        (2, 2)
    );
    support::assert_no_messages(&renderer.destroy().unwrap());
    let mut anew = FrameRenderer::owning(support::gpu(), posed).unwrap();
    let image = anew.render(&request).unwrap();
    assert!(image.color == bent.color && image.color != at_rest.color);
    support::assert_no_messages(&anew.destroy().unwrap());
}
