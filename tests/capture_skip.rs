//! What a frame does not need is not run, not allocated, not compiled; the plan says why; and the picture is
//! the same, bit for bit.
#![cfg(feature = "cli")]

mod support;

use antumbra::capture::{CapturedFrame, FrameRenderer, FrameRequest, plan_frame};
use antumbra::graph::{FakeMemory, Graph, Plan};
use antumbra::light::{AreaLight, LightShape};
use antumbra::renderer::{NamedLight, SceneBuffers, add_frame, add_frame_without_shadows};
use antumbra::scene::{AlphaMode, Material, Primitive, Scene, Texture, TextureImage, Wrap};
use antumbra::shadow::Technique;
use glam::{Vec2, Vec3};
use support::plates::{SIZE, camera, floor, plate, scene};
use support::rig::with_renderer;

/// Techniques that have nothing to do where nothing blocks.
const TECHNIQUES: [&str; 9] = [
    "hard",
    "pcf",
    "pcss",
    "occlusion-textures",
    "mdi",
    "ssoc",
    "dbuffer",
    "oess",
    "shaft-masks",
];
const DISK: LightShape = LightShape::Disk { radius: 0.5 };

/// A light that a technique can do.
fn light_of(technique: &str) -> LightShape {
    match technique {
        "oess" => LightShape::Line { length: 1.0 },
        _ => DISK,
    }
}

fn request(technique: &str) -> FrameRequest {
    FrameRequest {
        camera: camera(),
        size: [SIZE; 2],
        lights: vec![0],
        technique: technique.parse().unwrap(),
    }
}

/// A triangle with an obtuse angle, which shadows nothing in view: the box around it stands before the light, in the
/// corner that its longer slanted side leaves free.
fn beside() -> Primitive {
    let corners = [[-35.0, -6.0], [5.0, -6.0], [-25.0, 2.0]];
    Primitive {
        name: "beside".to_string(),
        positions: corners.map(|[x, z]| Vec3::new(x, 5.0, z)).to_vec(),
        normals: vec![Vec3::Y; 3],
        indices: vec![0, 1, 2],
        ..Primitive::default()
    }
}

fn floor_under(shape: LightShape) -> Scene {
    scene(vec![floor()], shape)
}

/// Passes of a light's visibility, without the technique's and the light's name.
fn passes(frame: &CapturedFrame, technique: &str) -> Vec<String> {
    let names = frame.lights[0].passes.iter();
    names
        .map(|name| {
            let name = name.strip_prefix(technique).unwrap_or(name);
            name.split(' ').next().unwrap_or_default().to_owned()
        })
        .collect()
}

#[track_caller]
fn assert_reason(plan: &Plan, name: &str, reason: &str) {
    let found = plan.culled.iter().find(|pass| pass.name.starts_with(name));
    assert!(
        found.is_some_and(|pass| pass.reason.contains(reason)),
        "{name}, {reason}: {:?}",
        plan.culled
    );
}

#[test]
fn nothing_that_blocks_takes_no_technique() {
    let _one = support::serial();
    for technique in TECHNIQUES {
        let shape = light_of(technique);
        let beside = scene(vec![floor(), beside()], shape);
        let request = request(technique);
        let full = with_renderer(&beside, |renderer| renderer.render(&request).unwrap());
        let frame = with_renderer(&floor_under(shape), |renderer| {
            renderer.render(&request).unwrap()
        });
        assert_eq!(passes(&frame, technique), [".unblocked"]);
        assert_reason(&frame.plan, technique, "nothing can stand between");
        assert!(full.lights[0].passes.len() > 3, "{technique}");
        // Another scene, of which the floor is the same: other ambient light, the same visibility.
        assert!(
            frame.lights[0].visibility == full.lights[0].visibility,
            "{technique}"
        );
        assert!(frame.lights[0].visibility.iter().all(|v| *v == 1.0));
        let bytes = |frame: &CapturedFrame| frame.counters["transient_bytes"];
        assert!(bytes(&frame) * 4 < bytes(&full), "{technique}");
    }
}

/// Lights of every shape, and the floor from above, lit, and from below, dark.
#[test]
fn both_sides_of_a_floor_are_the_same_without_the_technique() {
    let _one = support::serial();
    let shapes = [
        LightShape::Point,
        LightShape::Sphere { radius: 0.5 },
        LightShape::Sun {
            angular_diameter: 0.3,
        },
        LightShape::Rect {
            width: 1.0,
            height: 0.5,
        },
        LightShape::Line { length: 1.0 },
    ];
    for shape in shapes {
        let alone = floor_under(shape);
        let beside = scene(vec![floor(), beside()], shape);
        for technique in TECHNIQUES {
            let mut request = request(technique);
            if (request.technique.check(&alone.lights[0].light)).is_err() {
                continue;
            }
            for expected in [1.0, 0.0] {
                let title = format!("{technique} {shape:?} {expected}");
                let [few, full] = [&alone, &beside].map(|scene| {
                    with_renderer(scene, |renderer| renderer.render(&request).unwrap())
                });
                assert_eq!(passes(&few, technique).len(), 1, "{title}");
                assert!(
                    few.lights[0].visibility == full.lights[0].visibility,
                    "{title}"
                );
                assert!(
                    few.lights[0].visibility.iter().all(|v| *v == expected),
                    "{title}"
                );
                request.camera.position.y = -2.0;
                (request.camera.forward, request.camera.up) = (Vec3::Y, Vec3::Z);
            }
        }
    }
}

/// A light that shines away, and a camera that looks away.
#[test]
fn no_receiver_takes_no_technique() {
    let _one = support::serial();
    let blocked = vec![floor(), plate("blocker", [-2.0, 0.0], [-2.0, 2.0], 5.0)];
    let mut up = camera();
    (up.forward, up.up) = (Vec3::Y, Vec3::Z);
    for technique in TECHNIQUES {
        let mut away = scene(blocked.clone(), light_of(technique));
        away.lights[0].light.direction = Vec3::Y;
        let mut request = request(technique);
        // A line shines to all sides.
        if light_of(technique) == DISK {
            let dark = with_renderer(&away, |renderer| renderer.render(&request).unwrap());
            assert_eq!(passes(&dark, technique).len(), 1, "{technique}");
            assert_reason(&dark.plan, technique, "behind the light");
            assert_reason(&dark.plan, "shade.light", "behind it");
        }

        request.camera = up.clone();
        request.camera.position.y = 7.0;
        let lit = scene(blocked.clone(), light_of(technique));
        let empty = with_renderer(&lit, |renderer| renderer.render(&request).unwrap());
        assert_eq!(passes(&empty, technique).len(), 1, "{technique}");
        assert_reason(&empty.plan, technique, "in view");
        assert!(empty.lights[0].visibility.iter().all(|v| *v == 1.0));
    }
}

/// What a light without light makes of a picture, and of a frame of which nobody reads the visibility.
#[test]
fn a_light_that_lights_nothing_is_not_shaded() {
    let _one = support::serial();
    let blocked = vec![floor(), plate("blocker", [-2.0, 0.0], [-2.0, 2.0], 5.0)];
    let mut lit = scene(blocked, DISK);
    // A second light gives the picture its brightness.
    let mut other = lit.lights[0].clone();
    other.light.center.x = 3.0;
    lit.lights.push(other);
    type Change = fn(&mut AreaLight);
    let changes: [(&str, Change); 3] = [
        ("intensity", |light| light.intensity = 0.0),
        ("range", |light| light.range = Some(1.0)),
        ("behind", |light| light.direction = Vec3::Y),
    ];
    for (reason, change) in changes {
        let mut scene = lit.clone();
        change(&mut scene.lights[0].light);
        let mut both = request("pcss");
        both.lights = vec![0, 1];
        let frame = with_renderer(&scene, |renderer| renderer.render(&both).unwrap());
        assert_reason(&frame.plan, "shade.light 0", reason);
        let shaded = |name: &String| name.starts_with("shade.light");
        assert_eq!(
            frame
                .report
                .passes
                .iter()
                .filter(|name| shaded(name))
                .count(),
            1
        );

        // Of the same light almost in reach everything is done, and the picture is the same: what it adds
        // is lost in rounding.
        let mut faint = scene.clone();
        faint.lights[0].light = lit.lights[0].light;
        faint.lights[0].light.intensity = 1.0e-30;
        let done = with_renderer(&faint, |renderer| renderer.render(&both).unwrap());
        assert_eq!(
            done.report
                .passes
                .iter()
                .filter(|name| shaded(name))
                .count(),
            2
        );
        if reason == "intensity" {
            assert!(frame.color == done.color);
        }

        // A host that wants the picture alone has no pass of the light's.
        let buffers = SceneBuffers::plan_only(&scene, false);
        let lights: Vec<NamedLight> = (scene.lights.iter().enumerate())
            .map(|(index, found)| NamedLight {
                name: index.to_string(),
                light: found.light,
            })
            .collect();
        let mut graph = Graph::new();
        let technique = "pcss".parse().unwrap();
        let frame = add_frame(
            &mut graph,
            &buffers,
            &camera(),
            [SIZE; 2],
            &lights,
            technique,
        )
        .unwrap();
        graph.keep(frame.radiance);
        let compiled = graph.compile(&FakeMemory).unwrap();
        let plan = compiled.plan();
        let of = |light: &str| {
            let names = plan.passes.iter().map(|pass| pass.name.as_ref());
            let own = format!(" {light}");
            names
                .filter(|name| name.starts_with("pcss") && name.contains(&own))
                .count()
        };
        assert_eq!(of("0"), 0, "{reason}: {plan}");
        assert!(of("1") >= 4, "{reason}: {plan}");
    }
}

/// Pipelines are made for what runs, and only then.
#[test]
fn pipelines_of_what_is_not_needed_are_not_made() {
    let _one = support::serial();
    let made = |technique: &str, scene: &Scene| {
        let mut renderer = FrameRenderer::owning(support::gpu(), scene.clone()).unwrap();
        let request = request(technique);
        let first = renderer.render(&request).unwrap().counters["pipelines_created"];
        let second = renderer.render(&request).unwrap().counters["pipelines_created"];
        assert_eq!(second, 0, "{technique}");
        support::assert_no_messages(&renderer.destroy().unwrap());
        first
    };
    let bare = floor_under(DISK);
    let blocker = plate("blocker", [-2.0, 0.0], [-2.0, 2.0], 5.0);
    let blocked = scene(vec![floor(), blocker], DISK);
    let least = made("pcss", &bare);
    for technique in ["ssoc", "dbuffer"] {
        assert_eq!(made(technique, &bare), least, "{technique}");
    }
    // Tiles and their bounds, the map, and the filter in place of the pass of horizons.
    assert_eq!(made("pcss", &blocked), least + 3);
}

/// Tallies that nobody asked for, and the reason why they are left out, in the plan that `antumbra graph`
/// prints.
#[test]
fn passes_that_nobody_reads_are_left_out() {
    let blocker = plate("blocker", [-2.0, 0.0], [-2.0, 2.0], 5.0);
    let blocked = scene(vec![floor(), blocker], DISK);
    let plan = plan_frame(&blocked, &request("ssoc")).unwrap();
    assert_reason(&plan, "ssoc.crowding", "nobody reads");
    assert_reason(&plan, "ssoc.collisions", "nobody reads");
    let text = plan.to_string();
    assert!(
        text.contains("culled") && text.contains("nobody reads"),
        "{text}"
    );
    // The floor lies below all that is in view.
    assert_reason(&plan, "casters 0:lamp", "1 of 2 draws");
    // A lamp between the floor and a plate that is lower: nothing in view is above it.
    let low = plate("low", [-0.5, 0.0], [-0.5, 0.5], 9.75);
    let mut lamp = scene(vec![floor(), low], LightShape::Sphere { radius: 0.1 });
    lamp.lights[0].light.center = Vec3::new(0.0, 0.5, 0.0);
    for technique in ["hard", "pcss"] {
        let plan = plan_frame(&lamp, &request(technique)).unwrap();
        assert_reason(&plan, &format!("{technique}.views 0:lamp"), "1 of 6 views");
    }
    let plan = plan_frame(&floor_under(DISK), &request("ssoc")).unwrap();
    let json = plan.to_json().to_string();
    assert!(
        json.contains("nothing can stand between the light"),
        "{json}"
    );
}

/// A host that forgot something gets an error, and its graph stays as it was.
#[test]
fn what_a_technique_cannot_do_without_is_an_error() {
    let blocker = plate("blocker", [-2.0, 0.0], [-2.0, 2.0], 5.0);
    let mut blocked = scene(vec![floor(), blocker], DISK);
    for (technique, shape, reason) in [
        ("ssoc", DISK, "call SceneBuffers::add_edges once"),
        ("dbuffer", DISK, "`dbuffer` reads the scene's edges"),
        (
            "ssoc",
            LightShape::Line { length: 1.0 },
            "cannot do a line light; it does",
        ),
    ] {
        blocked.lights[0].light.shape = shape;
        let buffers = SceneBuffers::plan_only(&blocked, false);
        let light = NamedLight {
            name: "lamp".into(),
            light: blocked.lights[0].light,
        };
        let mut graph = Graph::new();
        let technique = technique.parse().unwrap();
        let (camera, size) = (camera(), [SIZE; 2]);
        let lights = [light];
        let added = add_frame(&mut graph, &buffers, &camera, size, &lights, technique);
        let error = added.unwrap_err().to_string();
        assert!(
            error.starts_with("light `lamp`: ") && error.contains(reason),
            "{error}"
        );
        assert_eq!(error.lines().count(), 1, "{error}");
        assert_eq!(graph.pass_count(), 0);
    }
}

/// A plate with holes over a floor that could have some, and if asked for a triangle that cannot, below the floor
/// and out of view.
fn cut_out(shape: LightShape, with_edges: bool) -> Scene {
    let mut parts = vec![floor(), plate("leaf", [-0.6, 0.7], [-0.5, 0.4], 5.0)];
    // The floor shows the first texel alone, which is none of the holes.
    parts[0].uvs = vec![Vec2::ZERO; 4];
    parts[1].uvs = vec![Vec2::ZERO, Vec2::Y, Vec2::ONE, Vec2::X];
    let below = plate("below", [19.9, 20.1], [-0.1, 0.1], 12.0);
    parts.push(Primitive {
        indices: vec![0, 1, 2],
        ..below
    });
    let mut scene = scene(parts, shape);
    for part in &mut scene.primitives[..2] {
        part.material = 1;
    }
    scene.images.push(TextureImage {
        name: "holes".to_string(),
        width: 4,
        height: 4,
        texels: (0..16)
            .map(|i| [255, 255, 255, [255, 0][i % 3 / 2]])
            .collect(),
    });
    scene.materials.push(Material {
        alpha_mode: AlphaMode::Mask { cutoff: 0.5 },
        base_texture: Some(Texture {
            image: 0,
            wrap: [Wrap::Clamp; 2],
        }),
        ..Material::default()
    });
    scene.finish().unwrap();
    if !with_edges {
        // Views, and light from nowhere in particular, depend on the scene's size: it stays.
        scene.primitives.truncate(2);
    }
    scene
}

/// Where alpha cuts out all triangles there are no edges, and nothing is made of them.
#[test]
fn a_scene_without_edges_has_no_passes_for_edges() {
    let _one = support::serial();
    let bands: &[&str] = &["silhouettes", "outlines", "bands"];
    let second: &[&str] = &["silhouettes", "outlines", "bands", "bands_second"];
    let lists: &[&str] = &["silhouettes", "boxes", "lists"];
    let surfaces: &[&str] = &["map", "silhouettes", "umbra", "penumbra"];
    let sphere = LightShape::Sphere { radius: 0.5 };
    let sun = LightShape::Sun {
        angular_diameter: 0.05,
    };
    for (options, shape, needless) in [
        ("ssoc", DISK, bands),
        ("ssoc", sun, bands),
        ("ssoc:layers=2", sphere, second),
        ("ssoc:combine=rule", DISK, bands),
        ("dbuffer", DISK, lists),
        ("dbuffer", sphere, lists),
        ("dbuffer:buffer=edges,layers=3", DISK, surfaces),
        ("dbuffer:buffer=distances", sun, surfaces),
    ] {
        let title = format!("{options} {shape:?}");
        let technique = options.split(':').next().unwrap();
        let request = request(options);
        let [full, frame] = [true, false].map(|with_edges| {
            let scene = cut_out(shape, with_edges);
            with_renderer(&scene, |renderer| renderer.render(&request).unwrap())
        });
        assert_eq!(
            [&full, &frame].map(|frame| frame.counters["edges"]),
            [3, 0],
            "{title}"
        );
        for name in needless {
            let has = |frame| {
                let passes = passes(frame, technique);
                let mut words = passes.iter().map(|pass| pass.split('.').nth(1));
                words.any(|word| word == Some(name))
            };
            assert!(has(&full) && !has(&frame), "{title}: {name}");
            assert_reason(
                &frame.plan,
                &format!("{technique}.{name} "),
                "the scene has no edges",
            );
        }
        assert!(
            full.lights[0].visibility == frame.lights[0].visibility,
            "{title}"
        );
        assert!(full.color == frame.color, "{title}");
        let dark = frame.lights[0].visibility.iter().filter(|v| **v < 0.5);
        assert!((200..3000).contains(&dark.count()), "{title}");
        let bytes = |frame: &CapturedFrame| frame.counters["transient_bytes"];
        assert!(bytes(&frame) < bytes(&full), "{title}");
    }
}

/// A point has no penumbra, and beside triangles with holes the edges of a line come from maps: no edge is looked for.
#[test]
fn edges_that_nobody_reads_are_not_found() {
    let _one = support::serial();
    let line = LightShape::Line { length: 1.0 };
    for (technique, shape) in [("ssoc", LightShape::Point), ("oess", line)] {
        let scene = cut_out(shape, true);
        let frame = with_renderer(&scene, |r| r.render(&request(technique)).unwrap());
        assert!(!frame.counters.contains_key("edges"), "{technique}");
        for pass in passes(&frame, technique) {
            assert!(!pass.contains("silhouettes"), "{technique}: {pass}");
            assert!(!pass.contains(".bands"), "{technique}: {pass}");
        }
        let dark = frame.lights[0].visibility.iter().filter(|v| **v < 0.5);
        assert!((200..3000).contains(&dark.count()), "{technique}");
        if technique == "ssoc" {
            assert_reason(&frame.plan, "ssoc.bands ", "a point has no penumbra");
        }
    }
}

/// A frame in which nothing casts a shadow has the passes and the memory of one with shadows off, with any number
/// of lights, and the picture of one whose technique found that nothing hides anything.
#[test]
fn a_frame_without_shadows_costs_what_shadows_off_cost() {
    let _one = support::serial();
    let scenes = |shape: LightShape| {
        let mut alone = floor_under(shape);
        let beside = scene(vec![floor(), beside()], shape);
        // What light comes from nowhere in particular depends on the scene's size.
        alone.bounds = beside.bounds;
        [beside, alone]
    };
    let [_, alone] = scenes(DISK);
    let buffers = SceneBuffers::plan_only(&alone, true);
    let of = |count: usize, light: AreaLight| {
        let lights = (0..count).map(|index| NamedLight {
            name: index.to_string(),
            light,
        });
        lights.collect::<Vec<_>>()
    };
    let plan = |technique: Option<&str>, lights: &[NamedLight]| {
        let mut graph = Graph::new();
        let (camera, size) = (camera(), [SIZE; 2]);
        let frame = match technique {
            Some(name) => {
                let technique = name.parse().unwrap();
                add_frame(&mut graph, &buffers, &camera, size, lights, technique).unwrap()
            }
            None => add_frame_without_shadows(&mut graph, &buffers, &camera, size, lights),
        };
        graph.keep(frame.radiance);
        let plan = graph.compile(&FakeMemory).unwrap().plan().clone();
        let names = plan.passes.iter().map(|pass| pass.name.to_string());
        (names.collect::<Vec<_>>(), plan.peak_bytes())
    };
    for technique in TECHNIQUES.iter().chain(&["auto"]) {
        let [beside, alone] = scenes(light_of(technique));
        for count in [1, 3] {
            let lights = of(count, alone.lights[0].light);
            assert_eq!(
                plan(Some(technique), &lights),
                plan(None, &lights),
                "{technique}"
            );
        }
        let request = request(technique);
        let [found, skipped] = [&beside, &alone]
            .map(|scene| with_renderer(scene, |renderer| renderer.render(&request).unwrap().color));
        assert!(found == skipped, "{technique}");
    }
}

/// Several lights take the memory of one, but for each one's mask.
#[test]
fn transients_of_several_lights_share_memory() {
    let blocker = plate("blocker", [-2.0, 0.0], [-2.0, 2.0], 5.0);
    let mut lit = scene(vec![floor(), blocker], DISK);
    for index in 1..4 {
        let mut other = lit.lights[0].clone();
        other.light.center.x = index as f32;
        lit.lights.push(other);
    }
    for technique in Technique::ALL {
        let mut blocked = lit.clone();
        for found in &mut blocked.lights {
            if technique.name() == "oess" {
                found.light.shape = LightShape::Line { length: 1.0 };
            }
        }
        let plan = |count: usize| {
            let request = FrameRequest {
                lights: (0..count).collect(),
                technique: *technique,
                ..request("hard")
            };
            plan_frame(&blocked, &request).unwrap()
        };
        let [one, four] = [plan(1), plan(4)];
        // A mask has 4 bytes a pixel, and of a line as many as 12.
        let masks = 3 * 12 * u64::from(SIZE * SIZE);
        // Parameters, counts, and what alignment adds.
        let slack = one.peak_bytes() / 20;
        let title = format!(
            "{}: {} bytes for one light, {} for four, {} without sharing",
            technique.name(),
            one.peak_bytes(),
            four.peak_bytes(),
            four.unaliased_bytes()
        );
        println!("{title}");
        assert!(
            four.peak_bytes() <= one.peak_bytes() + masks + slack,
            "{title}"
        );
        assert!(
            four.unaliased_bytes() > 2 * one.unaliased_bytes(),
            "{title}"
        );
    }
}
