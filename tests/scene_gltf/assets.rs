//! The scenes of `assets/`.

use std::path::Path;

use antumbra::light::LightShape;
use antumbra::scene::{LoadOptions, Primitive, Scene, SceneFile};
use glam::{DVec3, UVec2, Vec3};

use super::{Result, area_vector, make_assets, triangles};

#[test]
fn committed_assets_are_what_the_maker_writes() -> Result {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets");
    for (name, bytes) in make_assets::scenes() {
        let committed = std::fs::read(folder.join(name))?;
        assert!(
            committed == bytes,
            "assets/{name} is stale; run `cargo run --example make_assets`"
        );
    }
    Ok(())
}

#[test]
fn every_asset_loads_at_every_moment() -> Result {
    for (name, bytes) in make_assets::scenes() {
        let file = SceneFile::from_slice(name, bytes, &LoadOptions::default())?;
        let start = file.scene_at(0.0)?;
        assert!(
            !start.cameras.is_empty() && !start.lights.is_empty(),
            "{name}"
        );
        let middle = file.scene_at(0.4 * file.duration())?;
        assert_eq!(file.is_animated(), start != middle, "{name}");
        assert_eq!(start.rebase_origin, middle.rebase_origin, "{name}");
        assert_eq!(start.triangle_count(), middle.triangle_count(), "{name}");
        let textured = |p: &Primitive| start.materials[p.material].base_texture.is_some();
        for primitive in &start.primitives {
            assert_eq!(textured(primitive), !primitive.uvs.is_empty(), "{name}");
        }
    }
    Ok(())
}

#[test]
fn assets_show_their_shadow() -> Result {
    let wanted = [
        ("sphere_over_plane", LightShape::Disk { radius: 0.5 }, 2882),
        (
            "poles",
            LightShape::Rect {
                width: 1.6,
                height: 0.6,
            },
            458,
        ),
        ("blockers", LightShape::Sphere { radius: 0.4 }, 16),
        (
            "sun_court",
            LightShape::Sun {
                angular_diameter: 1.5f32.to_radians(),
            },
            1966,
        ),
    ];
    for ((file, bytes), (name, shape, count)) in make_assets::scenes().into_iter().zip(wanted) {
        let scene = Scene::load_slice(file, &bytes, &LoadOptions::default())?;
        assert_eq!(scene.name, name);
        assert_eq!(scene.triangle_count(), count, "{file}");
        assert_eq!(scene.rebase_origin, DVec3::ZERO, "{file}");
        let camera = scene.select_camera(None)?;
        let light = scene.lights[scene.select_light(None)?].light;
        assert_eq!(light.shape, shape, "{file}");
        // The picture shows geometry nearly everywhere, and a fair part of what faces the light is
        // in shadow.
        let triangles = triangles(&scene);
        let size = UVec2::splat(24);
        let (mut hits, mut facing, mut shadowed) = (0, 0, 0);
        for pixel in 0..size.x * size.y {
            let ray = camera.ray(UVec2::new(pixel % size.x, pixel / size.x), size);
            let Some((distance, triangle)) = nearest(&triangles, ray.origin, ray.direction) else {
                continue;
            };
            hits += 1;
            let point = ray.origin + distance * ray.direction;
            let normal = area_vector(triangle).normalize();
            let normal = if normal.dot(ray.direction) > 0.0 {
                -normal
            } else {
                normal
            };
            let to_light = if light.shape.is_sun() {
                -100.0 * light.direction
            } else {
                light.center - point
            };
            if normal.dot(to_light) > 0.0 {
                facing += 1;
                let blocker = nearest(&triangles, point + 1e-3 * normal, to_light);
                shadowed += i32::from(blocker.is_some_and(|(t, _)| t < 1.0));
            }
        }
        assert!(hits > 520, "{file}: {hits} of 576 pixels hit");
        let share = f64::from(shadowed) / f64::from(facing);
        assert!((0.03..0.4).contains(&share), "{file}: {share} in shadow");
    }
    Ok(())
}

/// The first triangle along a ray and its distance in lengths of `direction`.
fn nearest(triangles: &[[Vec3; 3]], origin: Vec3, direction: Vec3) -> Option<(f32, [Vec3; 3])> {
    let distance = |[a, b, c]: [Vec3; 3]| -> Option<f32> {
        let (e, f) = (b - a, c - a);
        let p = direction.cross(f);
        let det = e.dot(p);
        let s = (origin - a) / det;
        let q = s.cross(e);
        let (u, v, t) = (s.dot(p), direction.dot(q), f.dot(q));
        (det != 0.0 && u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 1e-4).then_some(t)
    };
    let hits = triangles.iter().filter_map(|t| Some((distance(*t)?, *t)));
    hits.min_by(|a, b| a.0.total_cmp(&b.0))
}
