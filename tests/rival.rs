//! The rival ray tracer against the reference and against itself.
#![cfg(feature = "cli")]

use antumbra::light::{AreaLight, LightShape};
use antumbra::reference::{Reference, Sampling, Settings, Truth};
use antumbra::rival::{Casting, MAX_RAYS, Rival, RivalError, RivalSampling};
use antumbra::scene::{LoadOptions, Scene, SceneCamera};
use glam::Vec3;

fn asset(name: &str) -> Scene {
    let path = format!("{}/assets/{name}", env!("CARGO_MANIFEST_DIR"));
    Scene::load(path, &LoadOptions::default()).unwrap()
}

fn cast(
    scene: &Scene,
    camera: &SceneCamera,
    size: [u32; 2],
    light: &AreaLight,
    sampling: RivalSampling,
) -> Casting {
    let mut rival = Rival::new(scene).unwrap();
    rival.prepare(camera, size).unwrap();
    rival.cast(light, sampling).unwrap()
}

fn truth(scene: &Scene, camera: &SceneCamera, size: [u32; 2], light: &AreaLight) -> Truth {
    let sampling = Sampling::samples(256);
    let settings = Settings {
        camera,
        size,
        light,
        sampling: &sampling,
    };
    let reference = Reference::new(scene).unwrap();
    reference.render(&settings, &|_| ()).unwrap()
}

/// Of the valid pixels: RMSE, mean difference, and their number.
fn difference(image: &[f32], truth: &Truth) -> (f64, f64, usize) {
    let differences: Vec<f64> = (image.iter().zip(&truth.visibility))
        .zip(&truth.valid)
        .filter(|(_, valid)| **valid)
        .map(|((a, b), _)| f64::from(a - b))
        .collect();
    let n = differences.len().max(1) as f64;
    let square = differences.iter().map(|d| d * d).sum::<f64>();
    let mean = differences.iter().sum::<f64>() / n;
    ((square / n).sqrt(), mean, differences.len())
}

/// Checks a light of a scene; returns the truth.
fn agrees(scene: &Scene, size: [u32; 2], light: &AreaLight, what: &str) -> Truth {
    let camera = &scene.cameras[0];
    let truth = truth(scene, camera, size, light);
    let found = cast(scene, camera, size, light, RivalSampling::Plain(256));
    assert!(found.visibility.iter().all(|v| (0.0..=1.0).contains(v)));
    let (rmse, mean, count) = difference(&found.visibility, &truth);
    // Both have 256 samples of a low-discrepancy set. By chance alone, 256 samples of V = 1/2 are
    // off by 0.03; sets are several times better, and most valid pixels are no penumbra.
    assert!(count > 200, "{what}: {count} valid pixels");
    assert!(
        rmse < 0.01 && mean.abs() < 1e-3,
        "{what}: rmse {rmse}, mean {mean}"
    );
    truth
}

#[test]
fn agrees_with_the_reference() {
    for name in [
        "sphere_over_plane.gltf",
        "foliage.glb",
        "room.glb",
        "comb.gltf",
    ] {
        let scene = asset(name);
        let truth = agrees(&scene, [96, 96], &scene.lights[0].light, name);
        // A picture without shadows would show nothing.
        let dark = truth.visibility.iter().filter(|v| **v < 0.5).count();
        assert!(dark > 100, "{name}: {dark} dark pixels");
    }
}

#[test]
fn far_from_the_origin_and_mirrored() {
    for name in ["far_away.gltf", "mirrored.gltf"] {
        let scene = asset(name);
        agrees(&scene, [64, 64], &scene.lights[0].light, name);
    }
}

#[test]
fn every_shape_of_light() {
    let scene = asset("blockers.gltf");
    let at = &scene.lights[0].light;
    for shape in [
        LightShape::Disk { radius: 0.4 },
        LightShape::Rect {
            width: 0.9,
            height: 0.3,
        },
        LightShape::Sphere { radius: 0.5 },
        LightShape::Line { length: 1.2 },
        LightShape::Sun {
            angular_diameter: 0.2,
        },
    ] {
        let light = AreaLight { shape, ..*at };
        agrees(&scene, [64, 64], &light, &shape.kind().to_string());
    }
}

#[test]
fn inside_a_sphere_light() {
    let scene = asset("blockers.gltf");
    let radius = 3.0 * scene.bounds.max.distance(scene.bounds.min);
    let light = AreaLight {
        shape: LightShape::Sphere { radius },
        center: 0.5 * (scene.bounds.min + scene.bounds.max),
        ..scene.lights[0].light
    };
    let (camera, size) = (&scene.cameras[0], [48, 48]);
    let sampling = Sampling::samples(4096);
    let settings = Settings {
        camera,
        size,
        light: &light,
        sampling: &sampling,
    };
    let reference = Reference::new(&scene).unwrap();
    let truth = reference.render(&settings, &|_| ()).unwrap();
    // No pixel is valid: the tangent plane cuts the light everywhere.
    let error = |rays| {
        let found = cast(&scene, camera, size, &light, RivalSampling::Plain(rays));
        let pairs = found.visibility.iter().zip(&truth.visibility);
        let differences: Vec<f64> = pairs.map(|(a, b)| f64::from(a - b)).collect();
        let n = differences.len() as f64;
        let square = differences.iter().map(|d| d * d).sum::<f64>();
        ((square / n).sqrt(), differences.iter().sum::<f64>() / n)
    };
    // Nothing but noise: it goes away with more samples, by chance as their square root.
    let (few, many) = (error(64), error(1024));
    assert!(
        many.0 < 0.25 * few.0 && many.1.abs() < 1e-3,
        "{few:?} {many:?}"
    );
}

#[test]
fn point_lights_are_exact() {
    let scene = asset("sphere_over_plane.gltf");
    let light = AreaLight {
        shape: LightShape::Point,
        ..scene.lights[0].light
    };
    let (camera, size) = (&scene.cameras[0], [96, 64]);
    let reference = Reference::new(&scene).unwrap();
    let wanted = reference.center_visibility(camera, size, &light).unwrap();
    let one = cast(&scene, camera, size, &light, RivalSampling::Plain(1));
    let differ = (wanted.iter().zip(&one.visibility))
        .filter(|(a, b)| a != b)
        .count();
    // Rays that touch an edge may go either way.
    assert!(differ <= 3, "{differ}");
    // More samples of one point are the same sample, and cost nothing.
    for sampling in [
        RivalSampling::Plain(64),
        RivalSampling::Adaptive { first: 9, more: 64 },
    ] {
        let many = cast(&scene, camera, size, &light, sampling);
        assert_eq!((&many.visibility, many.rays), (&one.visibility, one.rays));
    }
}

#[test]
fn error_falls_with_the_number_of_rays() {
    let scene = asset("sphere_over_plane.gltf");
    let (camera, light, size) = (&scene.cameras[0], &scene.lights[0].light, [96, 96]);
    let truth = truth(&scene, camera, size, light);
    let error = |sampling| {
        let found = cast(&scene, camera, size, light, sampling);
        (difference(&found.visibility, &truth).0, found.rays)
    };
    let plain = [1, 4, 16, 64].map(|n| error(RivalSampling::Plain(n)));
    for pair in plain.windows(2) {
        // By chance it would be halved.
        assert!(pair[1].0 < 0.5 * pair[0].0, "{plain:?}");
        assert!(pair[1].1 > 3 * pair[0].1, "{plain:?}");
    }
    let (adaptive, rays) = error(RivalSampling::Adaptive { first: 9, more: 64 });
    assert!(
        adaptive < plain[2].0 && rays < plain[3].1,
        "{adaptive} {rays} {plain:?}"
    );
}

#[test]
fn the_same_bytes_each_time_on_any_number_of_threads() {
    for name in ["foliage.glb", "comb.gltf"] {
        let scene = asset(name);
        let (camera, light) = (&scene.cameras[0], &scene.lights[0].light);
        for sampling in [
            RivalSampling::Plain(4),
            RivalSampling::Adaptive { first: 9, more: 64 },
        ] {
            let on = |threads| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
                let found = (pool.build().unwrap())
                    .install(|| cast(&scene, camera, [75, 61], light, sampling));
                (found.visibility, found.rays)
            };
            let first = on(1);
            assert!(first == on(3) && first == on(1), "{name} {sampling:?}");
        }
    }
}

#[test]
fn bad_input_is_named() {
    let scene = asset("comb.gltf");
    let (camera, light) = (&scene.cameras[0], scene.lights[0].light);
    let mut rival = Rival::new(&scene).unwrap();
    let fault = |rival: &mut Rival<'_>, light: &AreaLight, sampling| {
        rival.cast(light, sampling).unwrap_err()
    };
    let early = fault(&mut rival, &light, RivalSampling::Plain(1));
    assert!(matches!(early, RivalError::NotPrepared), "{early}");
    for size in [[0, 8], [8, 0], [1 << 16, 1 << 16]] {
        let size = rival.prepare(camera, size).unwrap_err();
        assert!(matches!(size, RivalError::Size { .. }), "{size}");
    }
    rival.prepare(camera, [8, 8]).unwrap();
    for sampling in [
        RivalSampling::Plain(0),
        RivalSampling::Plain(MAX_RAYS + 1),
        RivalSampling::Adaptive { first: 0, more: 1 },
        RivalSampling::Adaptive { first: 1, more: 0 },
        RivalSampling::Adaptive {
            first: u32::MAX,
            more: u32::MAX,
        },
    ] {
        let rays = fault(&mut rival, &light, sampling);
        assert!(matches!(rays, RivalError::Rays { .. }), "{rays}");
    }
    let broken = AreaLight {
        center: Vec3::NAN,
        ..light
    };
    let light = fault(&mut rival, &broken, RivalSampling::Plain(1));
    assert!(matches!(light, RivalError::Light(_)), "{light}");
}

#[test]
fn nothing_is_seen_where_nothing_is() {
    let scene = asset("sphere_over_plane.gltf");
    let away = SceneCamera {
        position: Vec3::new(0.0, 1.0e4, 0.0),
        forward: Vec3::Y,
        right: Vec3::X,
        up: Vec3::Z,
        ..scene.cameras[0].clone()
    };
    let light = &scene.lights[0].light;
    let found = cast(&scene, &away, [17, 9], light, RivalSampling::Plain(4));
    assert_eq!(found.visibility, [1.0; 17 * 9]);
    assert_eq!(found.rays, 0);
}

#[cfg(feature = "embree")]
#[test]
fn embree_is_the_tracer() {
    let scene = asset("comb.gltf");
    let rival = Rival::new(&scene).unwrap();
    assert!(rival.name().starts_with("embree 3."), "{}", rival.name());
}
