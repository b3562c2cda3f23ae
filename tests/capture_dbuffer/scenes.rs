//! Scenes that are hard on it: far cameras, faces seen edge-on, very many edges, little room, holes, and what is
//! kept from frame to frame.

use super::*;
use crate::buffer::{EDGES, all_errors};

/// Receivers near the origin are rounded as coarsely as the camera that sees them stands far away: none is
/// below its own floor, so nothing is darker than the same scene somewhere else.
#[test]
fn a_far_camera_sees_no_black_pixels_near_the_origin() {
    let _one = support::serial();
    let sun = LightShape::Sun {
        angular_diameter: 0.2,
    };
    let image = |shift: f32| {
        let mut scene = under(&[(9.0, [-30.0, 0.0], ENDLESS)], sun);
        for point in scene.primitives.iter_mut().flat_map(|p| &mut p.positions) {
            point.x += shift;
        }
        scene.finish().unwrap();
        let (forward, right) = (Vec3::new(-0.51, -0.73, -0.455), Vec3::new(0.6, 0.0, -0.8));
        let forward = forward.normalize();
        let right = (right - forward * right.dot(forward)).normalize();
        let camera = SceneCamera {
            position: Vec3::new(shift, 0.0, 0.0) - forward * 13.7,
            forward,
            right,
            up: right.cross(forward),
            yfov: 0.04,
            ..camera()
        };
        let request = FrameRequest {
            camera,
            size: [SIZE; 2],
            lights: vec![0],
            technique: "dbuffer".parse().unwrap(),
        };
        support::rig::with_renderer(&scene, |renderer| {
            renderer
                .render(&request)
                .unwrap()
                .lights
                .remove(0)
                .visibility
        })
    };
    let (near, far) = (image(0.0), image(64.0));
    let off = near.iter().zip(&far).map(|(a, b)| (a - b).abs());
    let off = off.fold(0.0, f32::max);
    println!("moved: {off}");
    assert!(off <= 0.01, "{off}");
    assert!(near.iter().any(|v| *v > 0.2) && near.iter().any(|v| *v < 0.8));
}

/// A receiver in the plane of a box's side sees its two triangles edge-on: both count as front or back alike.
#[test]
fn receivers_in_the_plane_of_a_face_are_no_exception() {
    let _one = support::serial();
    // The floor's pixels in a column and a row lie in planes of the cube's sides.
    let low = Vec3::new(floor_x(26), 0.3, floor_x(30));
    let cube = cuboid(low, low + Vec3::splat(0.5));
    let blockers = triangles(std::slice::from_ref(&cube));
    let scene = scene(vec![floor(), cube], DISK);
    let image = &render(&scene, &["dbuffer"])[0];
    let (light, places) = (scene.lights[0].light, places(DISK, 10_000));
    let mut worst = 0.0_f32;
    for (x, y) in (0..SIZE).flat_map(|i| [(26, i), (i, 30)]) {
        let p = Vec3::new(floor_x(x), 0.0, floor_x(y));
        // The cube itself stands before some of these.
        let down = camera().position - p;
        if meets_triangles(&blockers, p, down) {
            continue;
        }
        let real = truth(p, &light, &places, |p, way| {
            meets_triangles(&blockers, p, way)
        });
        worst = worst.max((image[(y * SIZE + x) as usize] - real).abs());
    }
    println!("in the plane: {worst}");
    assert!(worst <= 0.003 + SAMPLED, "{worst}");
}

/// Many small plates side by side, as one mesh: so many across and down, metres from one to the next, and of them the
/// part that is no gap.
pub(crate) fn many_plates(across: u32, pitch: f32, part: f32) -> Primitive {
    let at = |i: u32| (i as f32 - 0.5 * across as f32) * pitch;
    let plates = (0..across * across).map(|i| {
        let [x, z] = [at(i % across), at(i / across)];
        let end = part * pitch;
        plate("plates", [x, x + end], [z, z + end], 5.0)
    });
    let mut all = Primitive {
        name: "plates".to_string(),
        ..Primitive::default()
    };
    for one in plates {
        let first = all.positions.len() as u32;
        all.indices.extend(one.indices.iter().map(|i| first + i));
        all.positions.extend(one.positions);
        all.normals.extend(one.normals);
    }
    all
}

/// Forty thousand silhouettes from end to end: with a light as large as a few plates lists and edges do for
/// them, still exactly; with a large one there are thousands before each receiver, and rays decide.
#[test]
fn tens_of_thousands_of_edges_are_no_exception() {
    let _one = support::serial();
    const ACROSS: u32 = 100;
    let (pitch, part) = (0.03, 0.6);
    let plates = many_plates(ACROSS, pitch, part);
    let blocks = |p: Vec3, way: Vec3| {
        let at = (p + way * ((HEIGHT - 5.0 - p.y) / way.y)) / pitch + 0.5 * ACROSS as f32;
        let within = |x: f32| (0.0..ACROSS as f32).contains(&x) && x.fract() < part;
        within(at.x) && within(at.z)
    };
    for (radius, limit) in [(0.1, 0.002 + SAMPLED), (1.0, 0.08)] {
        let shape = LightShape::Disk { radius };
        let scene = scene(vec![floor(), plates.clone()], shape);
        let request = FrameRequest {
            camera: camera(),
            size: [SIZE; 2],
            lights: vec![0],
            technique: "dbuffer".parse().unwrap(),
        };
        let frame =
            support::rig::with_renderer(&scene, |renderer| renderer.render(&request).unwrap());
        // Four around each plate, and one across.
        assert_eq!(frame.counters["edges"], 5 * u64::from(ACROSS * ACROSS) + 5);
        let (light, places) = (scene.lights[0].light, places(shape, 10_000));
        let found = errors(&frame.lights[0].visibility, 3, |p| {
            truth(p, &light, &places, blocks)
        });
        println!("plates under {radius}: {found:?}");
        assert!(found.0 <= limit, "{found:?}");
    }
}

/// What no list has room for is found again.
#[test]
fn little_room_changes_nothing() {
    let _one = support::serial();
    let plates = [(3.0, [-0.2, 0.1], ENDLESS), (5.0, ENDLESS, [-0.3, 0.2])];
    let images = render(&under(&plates, DISK), &["dbuffer", "dbuffer:room=0"]);
    assert_eq!(images[0], images[1]);
}

/// Where a tile has more edges than asked for, rays to the samples tell the same but for sampling.
#[test]
fn rays_do_for_edges() {
    let _one = support::serial();
    let plates = [(3.0, [-0.2, 0.1], ENDLESS), (5.0, ENDLESS, [-0.3, 0.2])];
    let techniques = ["dbuffer:samples=64", "dbuffer:samples=64,most-edges=0"];
    let found = all_errors(&under(&plates, DISK), &techniques, |p, way| {
        meets_plates(&plates, p, way)
    });
    println!("rays: {found:?}");
    assert!(found[0].0 <= 0.01 && found[1].0 <= 0.02 && found[1] != found[0]);
}

/// Silhouettes depend on light and casters alone: a camera that moves does not search for them anew,
/// and its pictures are the same as with a new list. Neither does a rectangle that counts as a disk.
#[test]
fn silhouettes_are_kept_while_light_and_caster_stand_still() {
    let _one = support::serial();
    let plates = [(3.0, [-0.2, 0.1], ENDLESS), (5.0, ENDLESS, [-0.3, 0.2])];
    let square = LightShape::Rect {
        width: 1.0,
        height: 1.0,
    };
    let still = under(&plates, square);
    let request = |technique: &str| FrameRequest {
        camera: camera(),
        size: [SIZE; 2],
        lights: vec![0],
        technique: technique.parse().unwrap(),
    };
    let searches = |frame: &CapturedFrame| {
        let passes = frame.report.passes.iter();
        passes.filter(|n| n.contains("silhouettes.")).count()
    };
    support::rig::with_renderer(&still, |renderer| {
        for technique in ["dbuffer", "dbuffer:light=disk", EDGES] {
            let mut request = request(technique);
            let first = renderer.render_static(&request).unwrap();
            assert_eq!(searches(&first), 3, "{technique}");
            request.camera.position.x += 0.1;
            let moved = renderer.render_static(&request).unwrap();
            assert_eq!(searches(&moved), 0, "{technique}");
            let kept = ["masks_kept", "silhouettes_kept"].map(|name| moved.counters[name]);
            assert_eq!(kept, [0, 1], "{technique}");
            let anew = renderer.render(&request).unwrap();
            assert_eq!(searches(&anew), 3, "{technique}");
            let [first, moved, anew] =
                [first, moved, anew].map(|mut f| f.lights.remove(0).visibility);
            assert!(moved == anew && moved != first, "{technique}");
        }
    });
    let mut other = still;
    other.lights[0].light.center.x += 0.3;
    support::rig::with_renderer(&other, |renderer| {
        let elsewhere = renderer.render_static(&request(EDGES)).unwrap();
        assert_eq!(searches(&elsewhere), 3);
    });
}

#[test]
fn a_light_of_no_size_is_hard_and_nothing_is_full_light() {
    let _one = support::serial();
    let plates = [(5.0, [-0.3, 0.2], [-0.5, 0.1])];
    let small = LightShape::Disk { radius: 1.0e-6 };
    let images = render(&under(&plates, small), &["dbuffer", "hard"]);
    let off = images[0].iter().zip(&images[1]);
    let off = off.filter(|(a, b)| (*a - *b).abs() > 1.0e-3).count();
    assert!(off <= 2, "{off} pixels differ");
    let empty = render(&under(&[], DISK), &["dbuffer"]);
    assert!(empty[0].iter().all(|v| *v == 1.0));
    let covered = render(
        &under(&[(5.0, [-9.0, 9.0], [-9.0, 9.0])], DISK),
        &["dbuffer"],
    );
    assert!(covered[0].iter().all(|v| *v == 0.0));
}

/// Triangles with holes have no silhouettes: they hide samples of the light.
#[test]
fn cut_outs_hide_what_is_not_a_hole() {
    let _one = support::serial();
    let plates = [
        (5.0, [-0.3, 0.2], [-0.4, 0.4]),
        (4.0, [0.3, 0.9], [-0.4, 0.6]),
    ];
    let mut scene = under(&plates, DISK);
    let places = places(DISK, 10_000);
    for (alpha, shown) in [(0.9, 2), (0.1, 1)] {
        scene.materials.truncate(1);
        scene.materials.push(Material {
            alpha_mode: AlphaMode::Mask { cutoff: 0.5 },
            base_color: glam::Vec4::new(1.0, 1.0, 1.0, alpha),
            ..Material::default()
        });
        scene.primitives[2].material = 1;
        scene.finish().unwrap();
        let image = &render(&scene, &["dbuffer"])[0];
        let (light, solid) = (scene.lights[0].light, &plates[..shown]);
        let found = errors(image, 3, |p| {
            truth(p, &light, &places, |p, way| meets_plates(solid, p, way))
        });
        println!("cut out, alpha {alpha}: {found:?}");
        assert!(found.0 <= 0.02, "alpha {alpha}: {found:?}");
    }
}
