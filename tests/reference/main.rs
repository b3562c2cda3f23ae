//! The reference against closed forms, against itself in other guises, and against leaks.
#![cfg(feature = "cli")]

mod closed_forms;
mod guises;
mod rays;

use antumbra::light::{AreaLight, LightShape};
use antumbra::reference::{Reference, Sampling, Settings, Truth};
use antumbra::scene::{Material, Primitive, Scene, SceneCamera};
use glam::{DVec3, Vec3};

/// A scene of triangles, each with corners of its own.
pub fn scene(triangles: &[[Vec3; 3]]) -> Scene {
    let positions: Vec<Vec3> = triangles.concat();
    let normal = |t: &[Vec3; 3]| {
        let [a, b, c] = t.map(|p| p.as_dvec3());
        (b - a)
            .cross(c - a)
            .try_normalize()
            .unwrap_or(DVec3::Y)
            .as_vec3()
    };
    let mut scene = Scene {
        name: "triangles".into(),
        primitives: vec![Primitive {
            normals: triangles.iter().flat_map(|t| [normal(t); 3]).collect(),
            indices: (0..positions.len() as u32).collect(),
            positions,
            ..Default::default()
        }],
        materials: vec![Material::default()],
        ..Default::default()
    };
    scene.finish().unwrap();
    scene
}

/// Two triangles.
pub fn quad(corners: [Vec3; 4]) -> [[Vec3; 3]; 2] {
    let [a, b, c, d] = corners;
    [[a, b, c], [a, c, d]]
}

/// A square in the ground, `size` to each side of the origin.
pub fn ground(size: f32) -> Vec<[Vec3; 3]> {
    let at = |x: f32, z: f32| Vec3::new(x * size, 0.0, z * size);
    quad([at(-1.0, -1.0), at(-1.0, 1.0), at(1.0, 1.0), at(1.0, -1.0)]).to_vec()
}

/// A camera over the ground, below what hangs there, that looks straight down at a row of
/// `count` receivers from -`half` to `half` metres along the direction `turn` radians from X.
pub fn row_camera(count: u32, half: f32, turn: f32) -> SceneCamera {
    let height = 0.25;
    let right = Vec3::new(turn.cos(), 0.0, turn.sin());
    SceneCamera {
        position: Vec3::Y * height,
        right,
        up: right.cross(Vec3::Y),
        forward: Vec3::NEG_Y,
        yfov: 2.0 * (half / height / count as f32).atan(),
        znear: 0.01,
        zfar: None,
        ..SceneCamera::framing(&antumbra::scene::Aabb::EMPTY)
    }
}

/// A light at `center` that shines down, `axis_x` turned by `turn` radians.
pub fn lamp(shape: LightShape, center: Vec3, turn: f32) -> AreaLight {
    let axis = Vec3::new(turn.cos(), 0.0, turn.sin());
    AreaLight::new(shape, center, Vec3::NEG_Y, axis)
}

/// Casts a picture.
pub fn cast(
    scene: &Scene,
    camera: &SceneCamera,
    size: [u32; 2],
    light: &AreaLight,
    sampling: Sampling,
) -> Truth {
    let settings = Settings {
        camera,
        size,
        light,
        sampling: &sampling,
    };
    let reference = Reference::new(scene).unwrap();
    reference.render(&settings, &|_| ()).unwrap()
}
