//! `hard` against the exact shadow of the light's centre, cast ray by ray on the CPU in f64.

mod support;

use antumbra::capture::{FrameRenderer, FrameRequest};
use antumbra::light::AreaLight;
use antumbra::scene::{LoadOptions, Scene, SceneCamera};
use antumbra::shadow::Technique;
use glam::{DVec3, UVec2};
use std::path::Path;

const SIZE: u32 = 128;

fn load(name: &str) -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("assets")
        .join(name);
    Scene::load(&path, &LoadOptions::default()).unwrap()
}

/// All triangles of a scene.
struct Tracer(Vec<[DVec3; 3]>);

impl Tracer {
    fn new(scene: &Scene) -> Self {
        let corners = |p: &antumbra::scene::Primitive| {
            let point = |i: &u32| p.positions[*i as usize].as_dvec3();
            let triangles = p.indices.chunks_exact(3);
            triangles
                .map(|t| [point(&t[0]), point(&t[1]), point(&t[2])])
                .collect::<Vec<_>>()
        };
        Self(scene.primitives.iter().flat_map(corners).collect())
    }

    /// Distance along the ray, in lengths of `direction`, and number of the triangle met first.
    fn first(
        &self,
        origin: DVec3,
        direction: DVec3,
        most: f64,
        own: usize,
    ) -> Option<(f64, usize)> {
        let mut nearest = None;
        let mut limit = most;
        for (index, [a, b, c]) in self.0.iter().enumerate() {
            let (ab, ac) = (*b - *a, *c - *a);
            let h = direction.cross(ac);
            let det = ab.dot(h);
            let s = origin - *a;
            let q = s.cross(ab);
            let (u, v, t) = (s.dot(h) / det, direction.dot(q) / det, ac.dot(q) / det);
            let inside = u >= 0.0 && v >= 0.0 && u + v <= 1.0;
            if index != own && inside && t > 0.0 && t < limit {
                limit = t;
                nearest = Some((t, index));
            }
        }
        nearest
    }
}

/// What the centre's visibility should be at each pixel; `None` where nothing is hit, where the
/// light is on or below the surface, and where primary rays graze an edge between surfaces, which
/// rasterisation may give to either.
fn truth(scene: &Scene, camera: &SceneCamera, light: &AreaLight) -> Vec<Option<f32>> {
    let tracer = Tracer::new(scene);
    let pixels = (0..SIZE).flat_map(|y| (0..SIZE).map(move |x| UVec2::new(x, y)));
    pixels
        .map(|pixel| {
            let ray = camera.ray(pixel, UVec2::splat(SIZE));
            let (eye, direction) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
            let (t, own) = tracer.first(eye, direction, f64::INFINITY, usize::MAX)?;
            let point = eye + direction * t;
            let [a, b, c] = tracer.0[own];
            let normal = (b - a).cross(c - a);
            let normal = if normal.dot(direction) > 0.0 {
                -normal
            } else {
                normal
            };
            let (to_light, most) = if light.shape.is_sun() {
                (-light.direction.as_dvec3(), f64::INFINITY)
            } else {
                (light.center.as_dvec3() - point, 1.0)
            };
            if normal.dot(to_light) <= 0.0 {
                return None;
            }
            let blocked = tracer.first(point, to_light, most, own).is_some();
            Some(if blocked { 0.0 } else { 1.0 })
        })
        .collect()
}

/// Part of the pixels with a truth where `hard` says something else.
fn wrong_part(name: &str) -> f64 {
    let scene = load(name);
    let camera = scene.select_camera(None).unwrap();
    let request = FrameRequest {
        camera: camera.clone(),
        size: [SIZE; 2],
        lights: vec![0],
        technique: Technique::Hard,
    };
    let _one = support::serial();
    let mut renderer = FrameRenderer::new(support::gpu(), &scene).unwrap();
    let frame = renderer.render(&request).unwrap();
    support::assert_no_messages(&renderer.destroy().unwrap());
    let truth = truth(&scene, &camera, &scene.lights[0].light);
    let pairs = truth.iter().zip(&frame.lights[0].visibility);
    let known: Vec<(f32, f32)> = pairs.filter_map(|(t, v)| t.map(|t| (t, *v))).collect();
    let dark = known.iter().filter(|(t, _)| *t == 0.0).count();
    assert!(
        dark > 100 && dark < known.len() - 100,
        "{name} has light and shadow"
    );
    let wrong = known.iter().filter(|(t, v)| t != v).count();
    println!("{name}: {wrong} of {} pixels wrong", known.len());
    wrong as f64 / known.len() as f64
}

#[test]
fn hard_shadows_are_where_they_belong() {
    for name in [
        "sphere_over_plane.gltf",
        "poles.gltf",
        "blockers.gltf",
        "sun_court.glb",
    ] {
        let wrong = wrong_part(name);
        assert!(
            wrong <= 0.001,
            "{name}: {:.3} % of the pixels are wrong",
            100.0 * wrong
        );
    }
}
