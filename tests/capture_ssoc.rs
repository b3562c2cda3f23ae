//! `ssoc` against closed forms and sampled truth: half-planes, tilted receivers, strips, squares, and
//! balls under disks, spheres and a sun.

mod support;

use antumbra::capture::FrameRequest;
use antumbra::light::LightShape;
use antumbra::scene::{AlphaMode, Material, Primitive, Scene, Texture, TextureImage, Wrap};
use antumbra::shadow::Technique;
use glam::{Vec2, Vec3};
use std::collections::BTreeMap;
use support::plates::{HEIGHT, SIZE, camera, errors, floor, floor_x, plate, quad, scene};
use support::rig::render;

const DISK: LightShape = LightShape::Disk { radius: 1.0 };

/// Places on a unit disk, evenly over its area.
fn disk(count: u32) -> impl Iterator<Item = [f32; 2]> {
    (0..count).map(move |i| {
        let radius = ((i as f32 + 0.5) / count as f32).sqrt();
        let turn = 2.399_963_2 * i as f32;
        [radius * turn.cos(), radius * turn.sin()]
    })
}

/// Part of a level disk light that level rectangles (depth, x range, z range) leave free of a point.
fn truth(p: Vec3, radius: f32, plates: &[(f32, [f32; 2], [f32; 2])], samples: u32) -> f32 {
    let free = disk(samples).filter(|[u, v]| {
        let from = Vec3::new(radius * u, HEIGHT, radius * v);
        plates.iter().all(|(depth, x, z)| {
            let at = from + (p - from) * (depth / (HEIGHT - p.y));
            at.x < x[0] || at.x > x[1] || at.z < z[0] || at.z > z[1]
        })
    });
    free.count() as f32 / samples as f32
}

/// As [`truth`], of a light that falls from 1 in its middle to 0 at its rim, as 1 - s^2.
fn truth_of_falloff(p: Vec3, plates: &[(f32, [f32; 2], [f32; 2])]) -> f32 {
    let (mut free, mut all) = (0.0, 0.0);
    for [u, v] in disk(20_000) {
        let power = 1.0 - u * u - v * v;
        let from = Vec3::new(u, HEIGHT, v);
        let blocked = plates.iter().any(|(depth, x, z)| {
            let at = from + (p - from) * (depth / (HEIGHT - p.y));
            (x[0]..=x[1]).contains(&at.x) && (z[0]..=z[1]).contains(&at.z)
        });
        free += if blocked { 0.0 } else { power };
        all += power;
    }
    free / all
}

const ENDLESS: [f32; 2] = [-30.0, 30.0];

fn under(plates: &[(f32, [f32; 2], [f32; 2])], shape: LightShape) -> Scene {
    let plates = plates
        .iter()
        .map(|(depth, x, z)| plate("blocker", *x, *z, *depth));
    let all: Vec<Primitive> = std::iter::once(floor()).chain(plates).collect();
    scene(all, shape)
}

/// Largest change of the error from one pixel of a row to the next: what shows as stairs.
fn largest_stair(image: &[f32], truth: impl Fn(Vec3) -> f32) -> f32 {
    let rows = (0..SIZE).flat_map(|y| (1..SIZE).map(move |x| (x, y)));
    let error = |x: u32, y: u32| {
        image[(y * SIZE + x) as usize] - truth(Vec3::new(floor_x(x), 0.0, floor_x(y)))
    };
    let stairs = rows.map(|(x, y)| (error(x, y) - error(x - 1, y)).abs());
    stairs.fold(0.0, f32::max)
}

/// A long inclined edge of many pieces shows no stairs however coarse the maps: texels say
/// which edge counts, and not how far away it is.
#[test]
fn an_inclined_edge_shows_no_stairs() {
    let _one = support::serial();
    let depth = 5.0;
    let (sine, cosine) = 0.3_f32.sin_cos();
    let across = Vec3::new(cosine, 0.0, sine);
    let along = Vec3::new(-sine, 0.0, cosine);
    let truth = |p: Vec3| {
        // The edge's line in the unit disk of the light.
        let part = depth / HEIGHT;
        let line = (-across.dot(p) * part / (1.0 - part)).clamp(-1.0, 1.0);
        (line.acos() - line * (1.0 - line * line).sqrt()) / std::f32::consts::PI
    };
    const PIECES: i32 = 200;
    let at = |i: i32, far: f32| {
        let along = along * (20.0 * (2.0 * i as f32 / PIECES as f32 - 1.0));
        Vec3::new(0.0, HEIGHT - depth, 0.0) + along - across * far
    };
    let plates = (0..PIECES).map(|i| {
        let corners = [at(i, 0.0), at(i + 1, 0.0), at(i + 1, 30.0), at(i, 30.0)];
        quad("piece", corners)
    });
    let all = std::iter::once(floor()).chain(plates).collect();
    let techniques = ["ssoc", "ssoc:bands=64", "ssoc:lookups=1,bands=64"];
    let images = render(&scene(all, DISK), &techniques);
    let stairs: Vec<_> = images.iter().map(|i| largest_stair(i, truth)).collect();
    println!("stairs {stairs:?}");
    assert!(stairs.iter().all(|s| *s <= 0.002), "{stairs:?}");
}

/// What 20,000 samples of a disk are off by at an edge.
const SAMPLED: f32 = 0.002;

/// B1: one straight edge, level or not, parallel to the light or not.
#[test]
fn a_half_plane_is_exact() {
    let _one = support::serial();
    for (depth, x) in [
        (5.0, [-30.0, 0.0]),
        (2.0, [0.05, 30.0]),
        (8.0, [-30.0, 0.3]),
    ] {
        let plates = [(depth, x, ENDLESS)];
        let images = render(&under(&plates, DISK), &["ssoc"]);
        let row: Vec<f32> = (0..SIZE)
            .map(|i| truth(Vec3::new(floor_x(i), 0.0, 0.0), 1.0, &plates, 20_000))
            .collect();
        let worst = images.iter().map(|image| {
            let errors = image.iter().enumerate();
            let errors = errors.map(|(i, v)| (v - row[i % SIZE as usize]).abs());
            errors.fold(0.0, f32::max)
        });
        let worst: Vec<f32> = worst.collect();
        println!("depth {depth}: {worst:?}");
        assert!(worst[0] <= 0.003 + SAMPLED, "depth {depth}: {}", worst[0]);
    }
}

/// B1 with the published cubic, which is off by 0.042 at most where the edge's width is found right.
#[test]
fn a_half_plane_by_the_cubic_is_as_wrong_as_the_cubic() {
    let _one = support::serial();
    for (depth, x) in [(5.0, [-30.0, 0.0]), (2.0, [0.05, 30.0])] {
        let plates = [(depth, x, ENDLESS)];
        let image = &render(&under(&plates, DISK), &["ssoc:area=cubic"])[0];
        let row: Vec<f32> = (0..SIZE)
            .map(|i| truth(Vec3::new(floor_x(i), 0.0, 0.0), 1.0, &plates, 20_000))
            .collect();
        let errors = image.iter().enumerate();
        let errors = errors.map(|(i, v)| (v - row[i % SIZE as usize]).abs());
        let worst = errors.fold(0.0, f32::max);
        assert!(worst <= 0.042 + SAMPLED, "depth {depth}: {worst}");
    }
}

/// B2: from full shadow to full light as far as the light's size says.
#[test]
fn the_penumbra_has_its_width() {
    let _one = support::serial();
    // A light of 0.6 m, of which the floor shows 2 r (H - h) / h.
    let (radius, depth) = (0.6, 4.0);
    let plates = [(depth, [-30.0, 0.0], ENDLESS)];
    let image = &render(&under(&plates, LightShape::Disk { radius }), &["ssoc"])[0];
    let row = &image[(SIZE * SIZE / 2) as usize..][..SIZE as usize];
    let partly = row.iter().filter(|v| **v > 0.0 && **v < 1.0).count() as f32;
    let pixel = 3.2 / SIZE as f32;
    let wanted = 2.0 * radius * (HEIGHT - depth) / depth;
    assert!(
        (partly * pixel - wanted).abs() <= 2.0 * pixel,
        "{}",
        partly * pixel
    );
}

/// B3: a receiver inclined by 60 degrees does not shadow itself and has the penumbra of its points.
#[test]
fn a_steep_receiver_is_lit_up_to_the_penumbra() {
    let _one = support::serial();
    let tangent = 3.0_f32.sqrt();
    let at = |x: f32, z: f32| Vec3::new(x, x * tangent, z);
    let slope = quad(
        "slope",
        [at(-3.0, -9.0), at(-3.0, 9.0), at(1.2, 9.0), at(1.2, -9.0)],
    );
    let plates = [(5.0, [-30.0, 0.0], ENDLESS)];
    let mut under = under(&plates, DISK);
    under.primitives[0] = slope;
    under.finish().unwrap();
    let image = &render(&under, &["ssoc"])[0];
    let mut worst = 0.0_f32;
    for y in [8, 32, 50] {
        for i in 24..SIZE {
            let k = floor_x(i) / 2.0;
            let x = 2.0 * k / (1.0 + k * tangent);
            let z = floor_x(y) / 2.0 * (2.0 - x * tangent);
            let wanted = truth(at(x, z), 1.0, &plates, 20_000);
            let found = image[(y * SIZE + i) as usize];
            worst = worst.max((found - wanted).abs());
            assert!(wanted < 1.0 || found >= 0.99, "{i}: {found}");
        }
    }
    println!("steep: {worst}");
    assert!(worst <= 0.01, "{worst}");
}

/// B4: both sides of a strip, and the corner of a square.
#[test]
fn strips_add_up() {
    let _one = support::serial();
    let strip = [(5.0, [-0.25, 0.25], ENDLESS)];
    let images = render(
        &under(&strip, DISK),
        &["ssoc", "ssoc:lookups=1", "ssoc:combine=product"],
    );
    let measured = images
        .iter()
        .map(|i| errors(i, 4, |p| truth(p, 1.0, &strip, 20_000)));
    let measured: Vec<_> = measured.collect();
    println!("strip: {measured:?}");
    assert!(measured[0].1 <= 0.02, "{:?}", measured[0]);
    assert!(
        measured[1].1 > 0.1 && measured[2].1 > 0.1,
        "the options do nothing: {measured:?}"
    );
}

#[test]
fn corners_are_close() {
    let _one = support::serial();
    let corner = [(5.0, [-30.0, 0.0], [-30.0, 0.0])];
    let images = render(&under(&corner, DISK), &["ssoc", "ssoc:lookups=1"]);
    let measured = images
        .iter()
        .map(|i| errors(i, 3, |p| truth(p, 1.0, &corner, 20_000)));
    let measured: Vec<_> = measured.collect();
    println!("corner: {measured:?}");
    assert!(measured[0].1 <= 0.03, "{:?}", measured[0]);
}

/// A light that is brighter in its middle: both sides of a strip, and a corner.
#[test]
fn a_light_may_be_brighter_in_its_middle() {
    let _one = support::serial();
    let strip = [(5.0, [-0.25, 0.25], ENDLESS)];
    let corner = [(5.0, [-30.0, 0.0], [-30.0, 0.0])];
    let images = render(&under(&strip, DISK), &["ssoc:emission=falloff", "ssoc"]);
    let measured: Vec<_> = images
        .iter()
        .map(|i| errors(i, 4, |p| truth_of_falloff(p, &strip)))
        .collect();
    println!("strip: {measured:?}");
    assert!(measured[0].1 <= 0.02, "{measured:?}");
    assert!(measured[1].1 > 0.1, "the option does nothing: {measured:?}");
    let image = &render(&under(&corner, DISK), &["ssoc:emission=falloff"])[0];
    let (rms, worst) = errors(image, 4, |p| truth_of_falloff(p, &corner));
    println!("corner: rms {rms}, largest {worst}");
    assert!(worst <= 0.04, "{worst}");
}

/// A ball of `rings` rings around `middle`.
fn ball(middle: Vec3, radius: f32, rings: u32) -> Primitive {
    let sectors = 2 * rings;
    let mut mesh = Primitive {
        name: "ball".to_string(),
        ..Primitive::default()
    };
    for i in 0..=rings {
        for j in 0..sectors {
            let (polar, turn) = (i as f32 / rings as f32, j as f32 / sectors as f32);
            let (s, c) = (polar * std::f32::consts::PI).sin_cos();
            let (sine, cosine) = (turn * std::f32::consts::TAU).sin_cos();
            let normal = Vec3::new(s * cosine, c, s * sine);
            mesh.normals.push(normal);
            mesh.positions.push(middle + radius * normal);
        }
    }
    let corner = |i: u32, j: u32| i * sectors + j % sectors;
    for (i, j) in (0..rings).flat_map(|i| (0..sectors).map(move |j| (i, j))) {
        let [a, b] = [corner(i, j), corner(i, j + 1)];
        let [c, d] = [corner(i + 1, j), corner(i + 1, j + 1)];
        mesh.indices.extend([a, b, c, b, d, c]);
    }
    mesh
}

/// B5: a sphere light of 0.27 of its distance, seen past a ball.
#[test]
fn a_large_sphere_light_behind_a_ball() {
    let _one = support::serial();
    let (middle, radius, light) = (Vec3::new(-2.0, 5.0, 0.0), 2.0, 1.35);
    let shape = LightShape::Sphere { radius: light };
    let scene = scene(vec![floor(), ball(middle, radius, 64)], shape);
    let image = &render(&scene, &["ssoc"])[0];
    let center = Vec3::new(0.0, HEIGHT, 0.0);
    // Rays from a point to the disk that it sees of the light.
    let free = |p: Vec3, passes: &dyn Fn(Vec3) -> bool| {
        let to = center - p;
        let d = to.length();
        let (axis, r) = (to / d, light * (1.0 - light * light / (d * d)).sqrt());
        let x = axis.any_orthonormal_vector();
        let y = axis.cross(x);
        let from = p + axis * (d - light * light / d);
        let free = disk(4000).filter(|[u, v]| passes(from + (x * *u + y * *v) * r - p));
        free.count() as f32 / 4000.0
    };
    let seen = |p: Vec3| {
        free(p, &|way| {
            let way = way.normalize();
            (p + way * (middle - p).dot(way)).distance(middle) > radius
        })
    };
    // The outline that the light's centre sees: a circle on the ball.
    let away = center - middle;
    let facing = away.normalize();
    let part = radius / away.length();
    let inside = middle + facing * (radius * part);
    let outline = radius * (1.0 - part * part).sqrt();
    let seen_past_outline = |p: Vec3| {
        free(p, &|way| {
            let at = p + way * ((inside - p).dot(facing) / way.dot(facing));
            at.distance(inside) > outline
        })
    };
    let (rms, worst) = errors(image, 4, seen);
    let (of_outline, _) = errors(image, 4, seen_past_outline);
    println!("ball: rms {rms}, largest {worst}; of its outline: rms {of_outline}");
    // What is between the ball and its outline is the method's own error: rms 0.0165 here.
    assert!(of_outline <= 0.01, "{of_outline}");
    assert!(rms <= 0.01 + 0.0165, "{rms}");
}

#[test]
fn a_light_of_no_size_is_hard_and_nothing_is_full_light() {
    let _one = support::serial();
    let plates = [(5.0, [-0.3, 0.2], [-0.5, 0.1])];
    let small = LightShape::Disk { radius: 1.0e-6 };
    let images = render(&under(&plates, small), &["ssoc", "hard"]);
    let off = images[0].iter().zip(&images[1]);
    let off = off.filter(|(a, b)| (*a - *b).abs() > 1.0e-3).count();
    assert!(off <= 2, "{off} pixels differ");
    let empty = render(&under(&[], DISK), &["ssoc"]);
    assert!(empty[0].iter().all(|v| *v == 1.0));
    let covered = render(&under(&[(5.0, [-9.0, 9.0], [-9.0, 9.0])], DISK), &["ssoc"]);
    assert!(covered[0].iter().all(|v| *v == 0.0));
}

/// Parts that rounding has moved apart, and corners amid another part's side, let no light through.
#[test]
fn cracks_are_no_outlines() {
    let _one = support::serial();
    let parts = [
        (5.0, [-30.0, 0.1], ENDLESS),
        (5.0, [0.1 + 1.0e-6, 30.0], [-30.0, 0.2]),
        (5.0, [0.1, 30.0], [0.2, 30.0]),
    ];
    let image = &render(&under(&parts, DISK), &["ssoc"])[0];
    let most = image.iter().copied().fold(0.0, f32::max);
    assert!(most <= 1.0e-3, "{most}");
}

/// Where a second plate hides what is past the edge of the first, no light gets past that edge.
#[test]
fn what_is_beyond_an_edge_may_be_hidden_too() {
    let _one = support::serial();
    let all = [
        (3.0, [-30.0, 0.1], ENDLESS),
        (5.0, [-9.0, 9.0], [-9.0, 9.0]),
    ];
    let image = &render(&under(&all, DISK), &["ssoc"])[0];
    let most = image.iter().copied().fold(0.0, f32::max);
    println!("beyond an edge: {most}");
    assert!(most <= 1.0e-3, "{most}");
}

/// A plate whose texture could have holes has no edges on the list, and what is past a solid strip
/// before it is not free.
#[test]
fn cut_out_plates_hide_what_is_past_solid_ones() {
    let _one = support::serial();
    let all = [(5.0, [-30.0, 0.1], ENDLESS), (4.0, [-0.3, -0.1], ENDLESS)];
    let mut scene = under(&all, DISK);
    scene.images.push(TextureImage {
        name: "opaque".to_string(),
        width: 1,
        height: 1,
        texels: vec![[255; 4]],
    });
    scene.materials.push(Material {
        alpha_mode: AlphaMode::Mask { cutoff: 0.5 },
        base_texture: Some(Texture {
            image: 0,
            wrap: [Wrap::Clamp; 2],
        }),
        ..Material::default()
    });
    scene.primitives[1].material = 1;
    scene.primitives[1].uvs = vec![Vec2::ZERO; 4];
    scene.finish().unwrap();
    for image in render(&scene, &["ssoc", "ssoc:combine=rule"]) {
        let (rms, worst) = errors(&image, 4, |p| truth(p, 1.0, &all, 4000));
        println!("cut-out plate: rms {rms}, largest {worst}");
        assert!(rms <= 0.04 && worst <= 0.15, "{rms}, {worst}");
    }
}

/// Texels of a fine mesh lie before the plane of a receiver on it where the mesh is hollow.
#[test]
fn a_finely_meshed_bowl_does_not_shadow_itself() {
    let _one = support::serial();
    const CELLS: u32 = 200;
    let mut bowl = Primitive::default();
    for i in 0..=CELLS {
        for j in 0..=CELLS {
            let [x, z] = [i, j].map(|i| 0.6 * (i as f32 / CELLS as f32 - 0.5));
            bowl.positions
                .push(Vec3::new(x, 0.2 + 2.0 * (x * x + z * z), z));
            bowl.normals.push(Vec3::Y);
        }
    }
    for (i, j) in (0..CELLS).flat_map(|i| (0..CELLS).map(move |j| (i, j))) {
        let a = i * (CELLS + 1) + j;
        let [b, c, d] = [a + 1, a + CELLS + 1, a + CELLS + 2];
        bowl.indices.extend([a, b, c, c, b, d]);
    }
    let small = LightShape::Disk { radius: 0.1 };
    let bowl = scene(vec![bowl], small);
    let images = render(&bowl, &["hard", "ssoc"]);
    // A device with 16 steps to a texel bends triangles of a texel's width more than the mesh does: 71 of
    // 4096 pixels of SwiftShader.
    let few_steps = support::rig::with_renderer(&bowl, |renderer| {
        renderer.gpu().info().limits.sub_pixel_precision_bits < 8
    });
    let most = if few_steps { 80 } else { 0 };
    for image in images {
        let dark = image.iter().filter(|v| **v < 0.99).count();
        assert!(dark <= most, "{dark} pixels");
    }
}

/// Counts of the distortion maps, and a word where the light is too large for them.
#[test]
fn crowded_maps_are_counted() {
    let _one = support::serial();
    // Plates 0.05 m wide, as far apart.
    let row: Vec<_> = (-20..20)
        .map(|i| (5.0, [0.1 * i as f32, 0.1 * i as f32 + 0.05], [-1.0, 1.0]))
        .collect();
    let technique: Technique = "ssoc".parse().unwrap();
    let counted = |radius: f32| {
        let scene = under(&row, LightShape::Disk { radius });
        let request = FrameRequest {
            camera: camera(),
            size: [SIZE; 2],
            lights: vec![0],
            technique,
        };
        support::rig::with_renderer(&scene, |renderer| {
            let plain = renderer.render(&request).unwrap();
            assert!(plain.lights[0].counters.is_empty());
            assert!(!plain.report.passes.iter().any(|p| p.contains("collisions")));
            let counted = renderer.render_counted(&request).unwrap();
            assert_eq!(counted.lights[0].visibility, plain.lights[0].visibility);
            counted.lights[0].counters.clone()
        })
    };
    let share = |counters: &BTreeMap<String, u64>| {
        counters["crowded_texels"] as f64 / counters["band_texels"] as f64
    };
    let [small, large] = [0.01, 1.0].map(counted);
    println!("{small:?}, {large:?}");
    // The floor's four edges and those of the plates.
    assert_eq!((small["silhouettes"], large["silhouettes"]), (164, 164));
    assert!(share(&small) < 0.1 && share(&large) > 0.9);
    assert!(technique.remark(&small).is_none());
    let word = technique.remark(&large).unwrap();
    assert!(word.contains("outgrown"), "{word}");
}

/// A floor's own border is a silhouette, and hides nothing from the floor.
#[cfg(feature = "cli")]
#[test]
fn a_floor_is_not_darkened_by_its_border() {
    use antumbra::scene::LoadOptions;
    let _one = support::serial();
    let path =
        std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/sphere_over_plane.gltf");
    let scene = Scene::load(&path, &LoadOptions::default()).unwrap();
    let request = |technique: &str| FrameRequest {
        camera: scene.cameras[0].clone(),
        size: [256; 2],
        lights: vec![0],
        technique: technique.parse().unwrap(),
    };
    let [hard, soft] = support::rig::with_renderer(&scene, |renderer| {
        ["hard", "ssoc"].map(|technique| {
            let frame = renderer.render(&request(technique)).unwrap();
            frame.lights[0].visibility.clone()
        })
    });
    // Where a ball leaves the light's centre in sight, it leaves half of the light.
    let dark = |(v, w): &(&f32, &f32)| **v == 1.0 && **w < 0.4;
    let wrong = hard.iter().zip(&soft).filter(dark).count();
    println!("{wrong} of {} pixels", hard.len());
    assert!(wrong * 500 < hard.len(), "{wrong} pixels");
}
