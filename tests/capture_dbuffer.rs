//! `dbuffer` against sampled truth: half-planes, strips smaller than the light, corners, blockers
//! behind each other, balls, under every shape of light that it does.

mod support;

use antumbra::capture::{CapturedFrame, FrameRequest};
use antumbra::light::{AreaLight, LightShape};
use antumbra::scene::{AlphaMode, Material, Primitive, Scene, SceneCamera};
use glam::Vec3;
use support::plates::{HEIGHT, SIZE, camera, floor, floor_x, plate, scene};

const DISK: LightShape = LightShape::Disk { radius: 1.0 };

/// A level rectangle: depth below the light, x range, z range.
type Plate = (f32, [f32; 2], [f32; 2]);

fn render(scene: &Scene, techniques: &[&str]) -> Vec<Vec<f32>> {
    support::rig::with_renderer(scene, |renderer| {
        let images = techniques.iter().map(|technique| {
            let request = FrameRequest {
                camera: camera(),
                size: [SIZE; 2],
                lights: vec![0],
                technique: technique.parse().unwrap(),
            };
            let mut frame = renderer.render(&request).unwrap();
            frame.lights.remove(0).visibility
        });
        images.collect()
    })
}

/// Places on a unit disk, or -1 to 1 along both axes of a square, evenly.
fn places(shape: LightShape, count: u32) -> Vec<[f32; 2]> {
    let place = |i: u32| match shape {
        LightShape::Rect { .. } => {
            let side = (count as f32).sqrt() as u32;
            [i % side, i / side].map(|at| 2.0 * (at as f32 + 0.5) / side as f32 - 1.0)
        }
        _ => {
            let radius = ((i as f32 + 0.5) / count as f32).sqrt();
            let turn = 2.399_963_2 * i as f32;
            [radius * turn.cos(), radius * turn.sin()]
        }
    };
    let count = match shape {
        LightShape::Rect { .. } => ((count as f32).sqrt() as u32).pow(2),
        _ => count,
    };
    (0..count).map(place).collect()
}

/// The part of a light at the place of [`scene`]'s that is seen from a point.
fn truth(
    p: Vec3,
    light: &AreaLight,
    places: &[[f32; 2]],
    blocks: impl Fn(Vec3, Vec3) -> bool,
) -> f32 {
    let (x, y, to) = (
        light.axis_x,
        light.direction.cross(light.axis_x),
        light.center - p,
    );
    let way = |[u, v]: [f32; 2]| match light.shape {
        LightShape::Disk { radius } => to + (x * u + y * v) * radius,
        LightShape::Rect { width, height } => to + x * (0.5 * width * u) + y * (0.5 * height * v),
        LightShape::Sphere { radius } => {
            let rest = 1.0 - radius * radius / to.length_squared();
            let z = to.normalize();
            let x = z.any_orthonormal_vector();
            to * rest + (x * u + z.cross(x) * v) * (radius * rest.sqrt())
        }
        LightShape::Sun { angular_diameter } => {
            // Far enough to be beyond all blockers.
            ((x * u + y * v) * (0.5 * angular_diameter).tan() - light.direction) * 100.0
        }
        other => panic!("{other:?}"),
    };
    let seen = places.iter().filter(|place| !blocks(p, way(**place)));
    seen.count() as f32 / places.len() as f32
}

/// Whether a ray meets one of some plates, before the light that it goes to.
fn meets_plates(plates: &[Plate], p: Vec3, way: Vec3) -> bool {
    plates.iter().any(|(depth, x, z)| {
        let at = p + way * ((HEIGHT - depth - p.y) / way.y);
        x[0] < at.x && at.x < x[1] && z[0] < at.z && at.z < z[1]
    })
}

const ENDLESS: [f32; 2] = [-30.0, 30.0];

fn under(plates: &[Plate], shape: LightShape) -> Scene {
    let plates = plates
        .iter()
        .map(|(depth, x, z)| plate("blocker", *x, *z, *depth));
    let all: Vec<Primitive> = std::iter::once(floor()).chain(plates).collect();
    scene(all, shape)
}

/// Root mean square and largest error over a picture of the floor, every `step`-th pixel.
fn errors(image: &[f32], step: u32, mut truth: impl FnMut(Vec3) -> f32) -> (f32, f32) {
    let (mut squares, mut worst, mut count) = (0.0, 0.0_f32, 0);
    for y in (0..SIZE).step_by(step as usize) {
        for x in (0..SIZE).step_by(step as usize) {
            // -Z is up in the picture, so rows go along +Z.
            let p = Vec3::new(floor_x(x), 0.0, floor_x(y));
            let error = (image[(y * SIZE + x) as usize] - truth(p)).abs();
            squares += error * error;
            worst = worst.max(error);
            count += 1;
        }
    }
    ((squares / count as f32).sqrt(), worst)
}

/// What 10,000 samples are off by at an edge.
const SAMPLED: f32 = 0.003;

fn plate_errors(plates: &[Plate], shape: LightShape, technique: &str, step: u32) -> (f32, f32) {
    let scene = under(plates, shape);
    let image = &render(&scene, &[technique])[0];
    let (light, places) = (scene.lights[0].light, places(shape, 10_000));
    errors(image, step, |p| {
        truth(p, &light, &places, |p, way| meets_plates(plates, p, way))
    })
}

/// Where no blocker is behind another, edges alone tell the light: nothing is sampled.
#[test]
fn single_blockers_are_exact() {
    let _one = support::serial();
    let square = LightShape::Rect {
        width: 2.0,
        height: 1.4,
    };
    let cases: [(&str, Plate, LightShape); 6] = [
        ("half-plane", (5.0, [-30.0, 0.0], ENDLESS), DISK),
        ("near the light", (2.0, [0.05, 30.0], ENDLESS), DISK),
        ("strip", (5.0, [-0.25, 0.25], ENDLESS), DISK),
        (
            "smaller than the light",
            (4.0, [-0.3, 0.2], [-0.1, 0.25]),
            DISK,
        ),
        ("corner", (5.0, [-30.0, 0.0], [-30.0, 0.0]), DISK),
        ("corner", (5.0, [-30.0, 0.1], [-0.2, 30.0]), square),
    ];
    for (what, plate, shape) in cases {
        let (rms, worst) = plate_errors(&[plate], shape, "dbuffer", 3);
        println!("{what}: {rms} {worst}");
        assert!(worst <= 0.003 + SAMPLED, "{what}: {rms}, {worst}");
    }
}

/// Triangles that block light.
fn triangles(primitives: &[Primitive]) -> Vec<[Vec3; 3]> {
    let corners = |mesh: &Primitive| {
        let chunks = mesh.indices.chunks_exact(3);
        let at = |i: u32| mesh.positions[i as usize];
        chunks
            .map(|c| [at(c[0]), at(c[1]), at(c[2])])
            .collect::<Vec<_>>()
    };
    primitives.iter().flat_map(corners).collect()
}

fn meets_triangles(triangles: &[[Vec3; 3]], p: Vec3, way: Vec3) -> bool {
    triangles.iter().any(|corners| {
        let [a, b, c] = corners.map(|corner| corner - p);
        let [u, v, w] = [(b, c), (c, a), (a, b)].map(|(a, b)| way.dot(a.cross(b)));
        let normal = (b - a).cross(c - a);
        let t = normal.dot(a) / normal.dot(way);
        let inside = (u > 0.0 && v > 0.0 && w > 0.0) || (u < 0.0 && v < 0.0 && w < 0.0);
        inside && t > 1.0e-5 && t < 1.0
    })
}

/// A closed box.
fn cuboid(low: Vec3, high: Vec3) -> Primitive {
    let at = |i: u32| Vec3::select(glam::BVec3::new(i & 1 > 0, i & 2 > 0, i & 4 > 0), high, low);
    let faces = [
        [0, 1, 3, 2],
        [4, 6, 7, 5],
        [0, 4, 5, 1],
        [2, 3, 7, 6],
        [0, 2, 6, 4],
        [1, 5, 7, 3],
    ];
    let quads = faces
        .iter()
        .flat_map(|f| [f[0], f[1], f[2], f[0], f[2], f[3]]);
    Primitive {
        name: "box".to_string(),
        normals: vec![Vec3::Y; 8],
        positions: (0..8).map(at).collect(),
        indices: quads.collect(),
        ..Primitive::default()
    }
}

/// A wide plate on the left of an edge that meets the light's plane twice the light's radius from its
/// centre, as far as `end`, and its triangles.
fn inclined_edge(end: f32) -> (Scene, Vec<[Vec3; 3]>) {
    // From (2, 10, 0) downwards.
    let on_edge = |t: f32| Vec3::new(2.0 - 2.4 * t, HEIGHT - 6.0 * t, 0.3 * t);
    let [top, bottom] = [on_edge(0.05), on_edge(end)];
    let aside = Vec3::new(0.0, 0.0, -20.0);
    let slab = support::plates::quad("slab", [top, bottom, bottom + aside, top + aside]);
    let blockers = triangles(std::slice::from_ref(&slab));
    (scene(vec![floor(), slab], DISK), blockers)
}

#[test]
fn an_inclined_edge_is_exact() {
    let _one = support::serial();
    let (scene, blockers) = inclined_edge(1.3);
    let image = &render(&scene, &["dbuffer"])[0];
    let (light, places) = (scene.lights[0].light, places(DISK, 10_000));
    let found = errors(image, 3, |p| {
        truth(p, &light, &places, |p, way| {
            meets_triangles(&blockers, p, way)
        })
    });
    println!("inclined: {found:?}");
    assert!(found.1 <= 0.003 + SAMPLED, "{found:?}");
}

/// Blockers behind each other, of which edges alone know only the sum.
#[test]
fn overlaps_count_once() {
    let _one = support::serial();
    let cases: [(&str, Vec<Plate>, f32); 3] = [
        (
            "crossed",
            vec![(3.0, [-30.0, 0.0], ENDLESS), (6.0, ENDLESS, [-30.0, 0.0])],
            0.02,
        ),
        (
            "parallel",
            vec![(3.0, [-30.0, 0.0], ENDLESS), (6.0, [-30.0, 0.0], ENDLESS)],
            0.02,
        ),
        (
            "three strips",
            vec![
                (3.0, [-0.2, 0.1], ENDLESS),
                (5.0, ENDLESS, [-0.3, 0.2]),
                (6.5, [-0.1, 0.2], [-0.2, 0.4]),
            ],
            0.02,
        ),
    ];
    for (what, plates, limit) in cases {
        for shape in [
            DISK,
            LightShape::Rect {
                width: 2.0,
                height: 2.0,
            },
        ] {
            let (rms, worst) = plate_errors(&plates, shape, "dbuffer", 3);
            println!("{what}: {rms} {worst}");
            assert!(rms <= limit, "{what} under {shape:?}: {rms}, {worst}");
        }
    }
}

/// A body has two layers and a sheet one: the samples' correction by what edges know tells them apart. With
/// one proportion for both these were 0.017 and 0.013 off.
#[test]
fn bodies_and_sheets_are_told_apart() {
    let _one = support::serial();
    let bar = |x: [f32; 2], z: [f32; 2]| {
        cuboid(
            Vec3::new(x[0], HEIGHT - 3.1, z[0]),
            Vec3::new(x[1], HEIGHT - 3.0, z[1]),
        )
    };
    let thin = [-0.1, 0.05];
    let cases = [
        ("over", bar(thin, ENDLESS), [-0.3, 30.0], 0.0145),
        ("along", bar(ENDLESS, thin), [0.1, 30.0], 0.0105),
    ];
    for (what, bar, z, limit) in cases {
        let sheet = plate("sheet", ENDLESS, z, 5.0);
        let blockers = triangles(&[bar.clone(), sheet.clone()]);
        let scene = scene(vec![floor(), bar, sheet], DISK);
        let image = &render(&scene, &["dbuffer"])[0];
        let (light, places) = (scene.lights[0].light, places(DISK, 5_000));
        let found = errors(image, 3, |p| {
            truth(p, &light, &places, |p, way| {
                meets_triangles(&blockers, p, way)
            })
        });
        println!("{what}: {found:?}");
        assert!(found.0 <= limit, "{what}: {found:?}");
    }
}

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

/// With all shapes of lights.
#[test]
fn a_cube_has_even_penumbrae_under_every_light() {
    let _one = support::serial();
    let shapes = [
        DISK,
        LightShape::Rect {
            width: 1.6,
            height: 1.0,
        },
        LightShape::Sphere { radius: 1.2 },
        LightShape::Sun {
            angular_diameter: 0.2,
        },
    ];
    let cube = cuboid(Vec3::new(-0.7, 4.0, -0.5), Vec3::new(0.2, 4.9, 0.4));
    let blockers = triangles(std::slice::from_ref(&cube));
    for shape in shapes {
        let scene = scene(vec![floor(), cube.clone()], shape);
        let image = &render(&scene, &["dbuffer"])[0];
        let (light, places) = (scene.lights[0].light, places(shape, 3_000));
        let found = errors(image, 4, |p| {
            truth(p, &light, &places, |p, way| {
                meets_triangles(&blockers, p, way)
            })
        });
        println!("{shape:?}: {found:?}");
        assert!(found.0 <= 0.004 && found.1 <= 0.012, "{shape:?}: {found:?}");
    }
}

/// The D-buffer as published but for the surface that it keeps, with the disk's area.
const DISTANCES: &str = "dbuffer:buffer=distances";
const EDGES: &str = "dbuffer:buffer=edges";

/// Errors of several techniques, with one renderer; every third pixel.
fn all_errors(
    scene: &Scene,
    techniques: &[&str],
    blocks: impl Fn(Vec3, Vec3) -> bool,
) -> Vec<(f32, f32)> {
    let light = scene.lights[0].light;
    let places = places(light.shape, 10_000);
    let mut known = std::collections::HashMap::new();
    let images = render(scene, techniques);
    let found = images.iter().map(|image| {
        errors(image, 3, |p| {
            let key = (p.x.to_bits(), p.z.to_bits());
            *known
                .entry(key)
                .or_insert_with(|| truth(p, &light, &places, &blocks))
        })
    });
    found.collect()
}

/// A1: an edge parallel to the light, with the disk's area and with the published curve for it.
#[test]
fn a_buffer_is_exact_at_an_edge_parallel_to_the_light() {
    let _one = support::serial();
    let plates = [(5.0, [-30.0, 0.0], ENDLESS)];
    let cubic = format!("{DISTANCES},curve=cubic");
    let published = format!("{cubic},keep=greatest");
    let found = all_errors(
        &under(&plates, DISK),
        &[DISTANCES, EDGES, &cubic, &published],
        |p, way| meets_plates(&plates, p, way),
    );
    println!("parallel: {found:?}");
    for ((_, worst), limit) in found.into_iter().zip([0.003, 0.003, 0.042, 0.042]) {
        assert!(worst <= limit + SAMPLED, "{worst}");
    }
}

/// A2: similar triangles are off at an edge that meets the light's plane twice its radius from its
/// centre, the edge's image on the light is not.
#[test]
fn a_buffer_of_edges_is_exact_at_an_inclined_edge() {
    let _one = support::serial();
    let (scene, blockers) = inclined_edge(1.8);
    // At the end of the picture the edge is a metre over the floor, and its penumbra narrow.
    let fine = format!("{DISTANCES},resolution=2048");
    let found = all_errors(&scene, &[&fine, EDGES], |p, way| {
        meets_triangles(&blockers, p, way)
    });
    println!("inclined: {found:?}");
    assert!(found[0].1 <= 0.02 + SAMPLED, "{found:?}");
    assert!(found[1].1 <= 0.003 + SAMPLED, "{found:?}");
}

/// A3: a strip narrower than the light, seen past on both sides, and what one edge makes of it.
#[test]
fn a_strip_needs_two_layers() {
    let _one = support::serial();
    let plates = [(5.0, [-0.25, 0.25], ENDLESS)];
    let two = format!("{EDGES},layers=2");
    let found = all_errors(&under(&plates, DISK), &[EDGES, &two], |p, way| {
        meets_plates(&plates, p, way)
    });
    println!("strip: {found:?}");
    assert!(found[0].1 > 0.1, "{found:?}");
    assert!(found[1].1 <= 0.01 + SAMPLED, "{found:?}");
}

/// A4: the nearest surface of the umbra's makes no false umbra, the farthest does.
#[test]
fn the_nearest_surface_makes_no_false_umbra() {
    let _one = support::serial();
    let plates = [(5.0, [-1.0, 1.0], [-1.0, 1.0])];
    let scene = under(&plates, DISK);
    let greatest = format!("{DISTANCES},keep=greatest");
    let images = render(&scene, &[DISTANCES, &greatest]);
    let (light, places) = (scene.lights[0].light, places(DISK, 10_000));
    let mut dark = [0; 2];
    let mut most = 0.0_f32;
    for (x, y) in (0..SIZE).flat_map(|y| (0..SIZE).map(move |x| (x, y))) {
        let p = Vec3::new(floor_x(x), 0.0, floor_x(y));
        let real = truth(p, &light, &places, |p, way| meets_plates(&plates, p, way));
        let at = (y * SIZE + x) as usize;
        for (dark, image) in dark.iter_mut().zip(&images) {
            *dark += usize::from(image[at] == 0.0 && real > 0.005);
        }
        most = most.max((images[0][at] - real).abs());
    }
    println!("square: dark {dark:?}, most {most}");
    assert!(dark[0] == 0 && dark[1] > 0, "{dark:?}");
    assert!(most <= 0.26, "{most}");
}

/// A6: an edge parallel to the light is no special case: tilted by 1e-7 it does the same.
#[test]
fn an_edge_tilted_a_little_does_the_same() {
    let _one = support::serial();
    let edge = |tilt: f32| {
        let corner = |x: f32, z: f32| Vec3::new(x, HEIGHT - 5.0 + tilt * z, z);
        let corners = [
            corner(-30.0, -30.0),
            corner(-30.0, 30.0),
            corner(0.0, 30.0),
            corner(0.0, -30.0),
        ];
        let blocker = support::plates::quad("blocker", corners);
        render(&scene(vec![floor(), blocker], DISK), &[DISTANCES, EDGES])
    };
    let (level, tilted) = (edge(0.0), edge(1.0e-7));
    for (level, tilted) in level.iter().zip(&tilted) {
        let change = level.iter().zip(tilted).map(|(a, b)| (a - b).abs());
        let change = change.fold(0.0, f32::max);
        assert!(change <= 1.0e-4, "{change}");
        assert!(level.iter().any(|v| *v > 0.4 && *v < 0.6));
    }
}

/// A7: light goes on evenly where the hard shadow of a cube ends. What is there to see of a jump is how the
/// error changes from a pixel to the next: truth has none.
#[test]
fn nothing_jumps_where_the_hard_shadow_of_a_cube_ends() {
    let _one = support::serial();
    let cube = cuboid(Vec3::new(-0.7, 4.0, -0.5), Vec3::new(0.2, 4.9, 0.4));
    let blockers = triangles(std::slice::from_ref(&cube));
    let scene = scene(vec![floor(), cube], DISK);
    let images = render(
        &scene,
        &[
            "hard",
            "dbuffer",
            EDGES,
            "dbuffer:buffer=edges,layers=4",
            DISTANCES,
        ],
    );
    let (light, places) = (scene.lights[0].light, places(DISK, 10_000));
    let at = |i: u32| Vec3::new(floor_x(i % SIZE), 0.0, floor_x(i / SIZE));
    let hard = &images[0];
    let all = 0..SIZE * (SIZE - 1);
    let pairs: Vec<[u32; 2]> = all
        .flat_map(|i| [[i, i + 1], [i, i + SIZE]])
        .filter(|[i, j]| i / SIZE == j / SIZE || i % SIZE == j % SIZE)
        .filter(|[i, j]| hard[*i as usize] != hard[*j as usize])
        .collect();
    assert!(pairs.len() > 40);
    let mut most = [0.0_f32; 5];
    for pair in pairs {
        let real = pair.map(|i| {
            truth(at(i), &light, &places, |p, way| {
                meets_triangles(&blockers, p, way)
            })
        });
        for (most, image) in most.iter_mut().zip(&images) {
            let off = [0, 1].map(|k| image[pair[k] as usize] - real[k]);
            *most = most.max((off[0] - off[1]).abs());
        }
    }
    println!("jumps: {most:?}");
    assert!(most[0] > 0.5, "{most:?}");
    assert!(most[1] <= 0.01 + SAMPLED, "{most:?}");
    // Buffers know one edge, or join a few by two.
    let limits = [0.04, 0.09, 0.04];
    assert!(
        most[2..].iter().zip(limits).all(|(m, limit)| *m <= limit),
        "{most:?}"
    );
}

/// Figures 1 and 7 of the paper: seen from its centre the light's silhouettes are those of the upper
/// plate alone, but the lower one bounds the umbra. Lit is lit and umbra is umbra, but for a pixel's
/// width at their boundaries.
#[test]
fn boundaries_are_right_where_the_centre_misleads() {
    let _one = support::serial();
    let plates = [
        (3.0, [-0.3, 0.3], [-0.3, 0.3]),
        (6.0, [-0.5, 0.5], [-0.5, 0.5]),
    ];
    let shape = LightShape::Disk { radius: 0.2 };
    let scene = under(&plates, shape);
    let images = render(&scene, &["dbuffer"]);
    let (light, places) = (scene.lights[0].light, places(shape, 10_000));
    let real: Vec<f32> = (0..SIZE * SIZE)
        .map(|i| {
            let p = Vec3::new(floor_x(i % SIZE), 0.0, floor_x(i / SIZE));
            truth(p, &light, &places, |p, way| meets_plates(&plates, p, way))
        })
        .collect();
    // A pixel and its neighbours, all lit or all in the umbra.
    let around = |i: u32, value: f32| {
        let (x, y) = (i % SIZE, i / SIZE);
        let near = |at: u32| at.saturating_sub(1)..(at + 2).min(SIZE);
        near(y).all(|y| near(x).all(|x| real[(y * SIZE + x) as usize] == value))
    };
    for (image, limit) in images.iter().zip([0.99]) {
        for value in [0.0, 1.0] {
            let all: Vec<u32> = (0..SIZE * SIZE).filter(|i| around(*i, value)).collect();
            let right = all.iter().filter(|i| image[**i as usize] == value).count();
            println!("{value}: {right} of {}", all.len());
            assert!(all.len() > 100);
            assert!(
                right as f64 >= limit * all.len() as f64,
                "{right} of {}",
                all.len()
            );
        }
    }
}

/// Many small plates side by side, as one mesh: so many across and down, metres from one to the next, and of them the
/// part that is no gap.
fn many_plates(across: u32, pitch: f32, part: f32) -> Primitive {
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
