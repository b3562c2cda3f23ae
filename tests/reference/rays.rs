//! Watertightness, cut-outs, patterns, samplings and numbers of rays.

use antumbra::light::{AreaLight, LightShape};
use antumbra::reference::{Pattern, Reference, ReferenceError, Sampling, Settings};
use antumbra::scene::{
    Aabb, AlphaMode, LoadOptions, Material, Scene, SceneCamera, Texture, TextureImage, Wrap,
};
use glam::{UVec2, Vec2, Vec3, Vec4};

use super::closed_forms::ball;
use super::{cast, ground, lamp, quad, row_camera, scene};

/// One ray, from `eye` along `direction` exactly.
fn ray_camera(eye: Vec3, direction: Vec3) -> SceneCamera {
    let right = direction.normalize().any_orthonormal_vector();
    SceneCamera {
        position: eye,
        right,
        up: right.cross(direction.normalize()),
        forward: direction,
        yfov: 0.1,
        znear: 1.0e-30,
        zfar: None,
        ..SceneCamera::framing(&Aabb::EMPTY)
    }
}

/// A closed mesh whose coordinates have few bits, so that sums of them are exact.
fn snapped_ball(rings: u32, bits: f32) -> Vec<[Vec3; 3]> {
    let mut triangles = ball(Vec3::ZERO, 1.0, rings);
    for corner in triangles.iter_mut().flatten() {
        *corner = (*corner * bits).round() / bits;
    }
    triangles
}

#[test]
fn no_ray_leaves_a_closed_mesh() {
    let triangles = snapped_ball(24, 1024.0);
    let eyes = [
        Vec3::ZERO,
        Vec3::new(0.25, -0.5, 0.125),
        Vec3::new(-0.75, 0.25, 0.25),
    ];
    let mut rays = 0;
    for (scale, offset) in [
        (1.0, Vec3::ZERO),
        (1.0 / 1024.0, Vec3::ZERO),
        (8192.0, Vec3::ZERO),
        (1.0, Vec3::new(8192.0, -4096.0, 2048.0)),
    ] {
        let place = |p: Vec3| p * scale + offset;
        let moved: Vec<[Vec3; 3]> = triangles.iter().map(|t| t.map(place)).collect();
        let scene = scene(&moved);
        let reference = Reference::new(&scene).unwrap();
        for eye in eyes.map(place) {
            for &[a, b, c] in &moved {
                // Through corners, middles and quarters of edges: exactly, in f32.
                let [ab, ac] = [(b - eye) + (a - eye), (c - eye) + (a - eye)];
                for direction in [a - eye, b - eye, c - eye, ab, ac, ab + (a - eye) * 2.0] {
                    let camera = ray_camera(eye, direction);
                    let hit = reference.surface(&camera, [1, 1], UVec2::ZERO);
                    assert!(hit.is_some(), "{eye} {direction} leaves");
                    rays += 1;
                }
            }
        }
    }
    println!("{rays} rays through corners and edges, none left the mesh");
}

#[test]
fn a_closed_mesh_keeps_all_light_in() {
    // The light is inside, receivers are all around: whatever edge a segment meets, it is dark.
    let mut triangles = snapped_ball(12, 64.0);
    for corner in triangles.iter_mut().flatten() {
        *corner = *corner * 0.5 + Vec3::Y;
    }
    triangles.extend(ground(4.0));
    let scene = scene(&triangles);
    let camera = SceneCamera {
        position: Vec3::new(0.0, 4.0, 0.0),
        right: Vec3::X,
        up: Vec3::NEG_Z,
        forward: Vec3::NEG_Y,
        yfov: 0.9,
        znear: 0.01,
        zfar: None,
        ..SceneCamera::framing(&Aabb::EMPTY)
    };
    for shape in [
        LightShape::Point,
        LightShape::Sphere { radius: 0.3 },
        LightShape::Rect {
            width: 0.25,
            height: 0.5,
        },
        LightShape::Line { length: 0.5 },
    ] {
        let light = lamp(shape, Vec3::Y, 0.0);
        let truth = cast(&scene, &camera, [48, 48], &light, Sampling::samples(64));
        let lit = truth.visibility.iter().filter(|&&v| v != 0.0).count();
        assert_eq!(lit, 0, "{shape}");
    }
}

/// A sheet over the ground whose left half, by its texture, is a hole.
fn holed(cutoff: f32) -> Scene {
    let mut scene = scene(&ground(10.0));
    let sheet = quad([
        Vec3::new(-2.0, 1.0, -2.0),
        Vec3::new(2.0, 1.0, -2.0),
        Vec3::new(2.0, 1.0, 2.0),
        Vec3::new(-2.0, 1.0, 2.0),
    ]);
    let mut primitive = super::scene(&sheet).primitives.remove(0);
    primitive.uvs = (primitive.positions.iter())
        .map(|p| Vec2::new(0.25 * p.x + 0.5, 0.25 * p.z + 0.5))
        .collect();
    primitive.material = 1;
    scene.primitives.push(primitive);
    scene.images.push(TextureImage {
        name: "half".into(),
        width: 2,
        height: 1,
        texels: vec![[255, 255, 255, 0], [255, 255, 255, 255]],
    });
    scene.materials.push(Material {
        base_color: Vec4::new(1.0, 1.0, 1.0, 0.8),
        base_texture: Some(Texture {
            image: 0,
            wrap: [Wrap::Clamp; 2],
        }),
        alpha_mode: AlphaMode::Mask { cutoff },
        ..Default::default()
    });
    scene.finish().unwrap();
    scene
}

#[test]
fn holes_let_light_and_sight_through() {
    let light = lamp(LightShape::Point, Vec3::Y * 1.0e6, 0.0);
    let camera = row_camera(64, 1.5, 0.0);
    // Alpha runs from 0 to 0.8 between x = -1 and x = 1.
    for (cutoff, edge) in [(0.4, 0.0), (0.2, -0.5), (0.6, 0.5)] {
        let scene = holed(cutoff);
        let reference = Reference::new(&scene).unwrap();
        let seen = reference
            .center_visibility(&camera, [64, 1], &light)
            .unwrap();
        for (x, v) in seen.into_iter().enumerate() {
            let at = reference
                .surface(&camera, [64, 1], UVec2::new(x as u32, 0))
                .unwrap();
            let expected = f32::from(u8::from(at.position.x < edge));
            assert_eq!(v, expected, "cutoff {cutoff}, {}", at.position);
        }
        // From above, the ground shows through the hole.
        let above = SceneCamera {
            position: Vec3::new(0.0, 3.0, 0.0),
            ..camera.clone()
        };
        let height = |x: u32| {
            let at = reference
                .surface(&above, [64, 1], UVec2::new(x, 0))
                .unwrap();
            at.position.y
        };
        assert!(height(29).abs() < 1e-9 && (height(34) - 1.0).abs() < 1e-9);
    }
    let cast_soft = |cutoff| {
        let light = lamp(LightShape::Disk { radius: 0.5 }, Vec3::Y * 4.0, 0.0);
        cast(
            &holed(cutoff),
            &camera,
            [64, 1],
            &light,
            Sampling::samples(1024),
        )
    };
    // Nothing is cut out at 0, all is above the material's own alpha.
    assert!(cast_soft(0.0).visibility.iter().all(|&v| v == 0.0));
    assert!(cast_soft(0.9).visibility.iter().all(|&v| v == 1.0));
    // A penumbra about the hole's edge: monotonous, and half lit below the edge.
    let soft = cast_soft(0.4);
    let ends = (soft.visibility[0], soft.visibility[63]);
    assert_eq!(ends, (1.0, 0.0));
    let below = 0.5 * (soft.visibility[31] + soft.visibility[32]);
    assert!((below - 0.5).abs() < 0.01, "{below}");
}

#[test]
fn receivers_touching_and_coplanar() {
    // The ground twice, a wall that stands on it, and the light's own ceiling.
    let mut triangles = ground(4.0);
    triangles.extend(ground(4.0));
    triangles.extend(quad([
        Vec3::new(0.0, 0.0, -4.0),
        Vec3::new(0.0, 2.0, -4.0),
        Vec3::new(0.0, 2.0, 4.0),
        Vec3::new(0.0, 0.0, 4.0),
    ]));
    let ceiling: Vec<_> = ground(4.0)
        .into_iter()
        .map(|t| t.map(|p| p + Vec3::Y * 2.4))
        .collect();
    triangles.extend(ceiling);
    let scene = scene(&triangles);
    let light = lamp(
        LightShape::Disk { radius: 0.5 },
        Vec3::new(1.5, 2.4, 0.0),
        0.3,
    );
    let camera = row_camera(65, 1.0, 0.0);
    let truth = cast(&scene, &camera, [65, 1], &light, Sampling::samples(256));
    for (x, &v) in truth.visibility.iter().enumerate() {
        // The middle pixel sees the wall's top edge; receivers on its far side are dark near it.
        match x {
            0..=31 => assert_eq!(v, 0.0, "pixel {x}"),
            32 => {}
            _ => assert_eq!(v, 1.0, "pixel {x}"),
        }
    }
}

#[test]
fn patterns_say_which_samples_are_seen() {
    // A sheet hides all of the light with x < 0 from the receiver below the origin.
    let mut triangles = ground(4.0);
    triangles.extend(quad([
        Vec3::new(-4.0, 1.0, -4.0),
        Vec3::new(0.0, 1.0, -4.0),
        Vec3::new(0.0, 1.0, 4.0),
        Vec3::new(-4.0, 1.0, 4.0),
    ]));
    let scene = scene(&triangles);
    let camera = row_camera(1, 0.1, 0.0);
    for shape in [
        LightShape::Disk { radius: 0.5 },
        LightShape::Rect {
            width: 1.0,
            height: 0.5,
        },
        LightShape::Sphere { radius: 0.5 },
    ] {
        let light = AreaLight::new(shape, Vec3::Y * 2.0, Vec3::NEG_Y, Vec3::X);
        let text = "0.5 0.1\n-0.5 0.1\n0.01 -0.9\n-0.01 0.9\n";
        let pattern = Pattern::parse(text, "t").unwrap();
        let truth = cast(&scene, &camera, [1, 1], &light, Sampling::Pattern(pattern));
        let masks = truth.masks.unwrap();
        assert_eq!(
            (masks.samples, masks.pixel(0)),
            (4, &[0b0101][..]),
            "{shape}"
        );
        assert_eq!(truth.visibility, [0.5]);
        let grid = Pattern::named("grid16").unwrap();
        let truth = cast(&scene, &camera, [1, 1], &light, Sampling::Pattern(grid));
        let masks = truth.masks.unwrap();
        let seen: u32 = masks.pixel(0).iter().map(|word| word.count_ones()).sum();
        assert_eq!(
            (masks.samples, seen, truth.visibility[0]),
            (256, 128, 0.5),
            "{shape}"
        );
    }
}

fn asset(name: &str) -> Scene {
    let path = format!("{}/assets/{name}", env!("CARGO_MANIFEST_DIR"));
    Scene::load(path, &LoadOptions::default()).unwrap()
}

#[test]
fn the_same_bytes_on_any_number_of_threads() {
    let scene = asset("poles.gltf");
    let (camera, light) = (&scene.cameras[0], &scene.lights[0].light);
    let sampling = Sampling::Estimated {
        samples: 64,
        standard_error: Some(4e-3),
        most: 1024,
    };
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| cast(&scene, camera, [72, 48], light, sampling.clone()))
    };
    assert_eq!(on(1), on(3));
}

#[test]
fn refined_until_the_error_is_small() {
    let scene = asset("blockers.gltf");
    let (camera, light) = (&scene.cameras[0], &scene.lights[0].light);
    let size = [64, 48];
    let refined = |standard_error| {
        let sampling = Sampling::Estimated {
            samples: 64,
            standard_error,
            most: 1 << 14,
        };
        cast(&scene, camera, size, light, sampling)
    };
    let coarse = refined(None);
    let fine = refined(Some(2e-3));
    let (before, after) = (coarse.standard_error.unwrap(), fine.standard_error.unwrap());
    assert!(
        before.max > 5e-3 && after.max <= 2e-3 && after.above == 0,
        "{before:?} {after:?}"
    );
    assert!(fine.rays < 4096 * 64 * 48, "only the penumbra is refined");
    // The estimate holds against a truth that is an order better.
    let truth = cast(&scene, camera, size, light, Sampling::samples(1 << 15));
    for (found, error) in [(&coarse, before), (&fine, after)] {
        let (mut squares, mut count) = (0.0, 0);
        for (v, t) in found.visibility.iter().zip(&truth.visibility) {
            if *v > 0.0 && *v < 1.0 {
                squares += f64::from(v - t).powi(2);
                count += 1;
            }
        }
        let rmse = (squares / f64::from(count)).sqrt();
        println!("estimated {:.2e}, found {rmse:.2e} over {count}", error.rms);
        assert!((0.4..1.05).contains(&(rmse / error.rms)));
    }
}

#[test]
fn samplings_agree() {
    let scene = asset("blockers.gltf");
    let (camera, light) = (&scene.cameras[0], &scene.lights[0].light);
    let size = [64, 48];
    let truth = cast(&scene, camera, size, light, Sampling::samples(4096));
    let rmse = |sampling: Sampling| {
        let found = cast(&scene, camera, size, light, sampling);
        let pairs = found.visibility.iter().zip(&truth.visibility);
        let squares: f64 = pairs.map(|(v, t)| f64::from(v - t).powi(2)).sum();
        ((squares / found.visibility.len() as f64).sqrt(), found.rays)
    };
    let plain = |samples| rmse(Sampling::Plain { samples });
    let errors: Vec<f64> = [1, 4, 16, 64, 256].map(|n| plain(n).0).to_vec();
    println!("plain {errors:?}");
    assert!(
        errors.windows(2).all(|pair| pair[1] < 0.6 * pair[0]),
        "{errors:?}"
    );
    let (adaptive, rays) = rmse(Sampling::Adaptive { first: 9, more: 64 });
    println!(
        "adaptive {adaptive} in {rays} rays, plain 64 in {}",
        plain(64).1
    );
    assert!(adaptive < 1.5 * errors[3] && rays < plain(64).1);
}

#[test]
fn a_single_point_is_exact() {
    let scene = asset("poles.gltf");
    let camera = &scene.cameras[0];
    let light = AreaLight {
        shape: LightShape::Point,
        ..scene.lights[0].light
    };
    let truth = cast(&scene, camera, [64, 64], &light, Sampling::samples(1024));
    let reference = Reference::new(&scene).unwrap();
    let center = reference
        .center_visibility(camera, [64, 64], &light)
        .unwrap();
    assert_eq!(truth.visibility, center);
    assert!(center.contains(&0.0) && center.contains(&1.0));
    assert_eq!(truth.standard_error.unwrap().pixels, 0);
}

#[test]
fn bad_settings_are_named() {
    let scene = scene(&ground(1.0));
    let reference = Reference::new(&scene).unwrap();
    let camera = row_camera(1, 0.1, 0.0);
    let light = lamp(LightShape::Disk { radius: 1.0 }, Vec3::Y, 0.0);
    let fault = |size, light: &AreaLight, sampling: Sampling| {
        let settings = Settings {
            camera: &camera,
            size,
            light,
            sampling: &sampling,
        };
        let result = reference.render(&settings, &|_| ());
        result
            .err()
            .map(|error: ReferenceError| error.to_string())
            .unwrap_or_default()
    };
    let fine = || Sampling::samples(16);
    assert_eq!(fault([1, 1], &light, fine()), "");
    assert!(fault([0, 1], &light, fine()).contains("0x1"));
    assert!(fault([1, 1], &light, Sampling::samples(15)).contains("15 light samples"));
    assert!(fault([1, 1], &light, Sampling::Plain { samples: 0 }).contains("0 light samples"));
    let pattern = Sampling::Pattern(Pattern::parse("1 1", "t").unwrap());
    assert!(fault([1, 1], &light, pattern).contains("unit disk"));
    let nan = Sampling::Estimated {
        samples: 16,
        standard_error: Some(f64::NAN),
        most: 16,
    };
    assert!(fault([1, 1], &light, nan).contains("NaN"));
    let broken = AreaLight {
        shape: LightShape::Disk { radius: -1.0 },
        ..light
    };
    assert!(fault([1, 1], &broken, fine()).contains("radius"));
}

#[test]
fn broken_triangles_block_nothing() {
    let mut triangles = ground(4.0);
    triangles.extend([
        [
            Vec3::new(-1.0, 1.0, 0.0),
            Vec3::new(1.0, 1.0, 0.0),
            Vec3::new(0.0, 1.0, 0.0),
        ],
        [Vec3::splat(0.5); 3],
    ]);
    let mut scene = scene(&triangles);
    // As in a frame of an animation that nobody has checked.
    let primitive = &mut scene.primitives[0];
    primitive
        .positions
        .extend([Vec3::NAN, Vec3::new(0.0, 1.0, f32::INFINITY), Vec3::ONE]);
    primitive.normals.extend([Vec3::Y; 3]);
    let last = primitive.positions.len() as u32;
    primitive.indices.extend([last - 3, last - 2, last - 1]);
    primitive.indices.extend([0, last - 3, 2]);
    let light = lamp(LightShape::Disk { radius: 0.5 }, Vec3::Y * 2.0, 0.0);
    let camera = row_camera(16, 0.5, 0.0);
    let truth = cast(&scene, &camera, [16, 1], &light, Sampling::samples(64));
    assert_eq!(truth.visibility, [1.0; 16]);
}
