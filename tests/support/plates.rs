//! Level plates over a floor under a light whose shadows have closed forms.

use antumbra::light::{AreaLight, LightShape};
use antumbra::scene::{Aabb, Material, Primitive, Scene, SceneCamera, SceneLight};
use glam::Vec3;

/// Height of the light above the floor, metres; the light is a square of 2 m over the origin.
pub const HEIGHT: f32 = 10.0;
pub const SIZE: u32 = 64;

pub fn quad(name: &str, corners: [Vec3; 4]) -> Primitive {
    Primitive {
        name: name.to_string(),
        normals: vec![Vec3::Y; 4],
        positions: corners.to_vec(),
        indices: vec![0, 1, 2, 0, 2, 3],
        ..Primitive::default()
    }
}

/// A level rectangle at a depth below the light.
pub fn plate(name: &str, x: [f32; 2], z: [f32; 2], depth: f32) -> Primitive {
    let corner = |x, z| Vec3::new(x, HEIGHT - depth, z);
    let corners = [
        corner(x[0], z[0]),
        corner(x[0], z[1]),
        corner(x[1], z[1]),
        corner(x[1], z[0]),
    ];
    quad(name, corners)
}

pub fn floor() -> Primitive {
    plate("floor", [-30.0, 30.0], [-30.0, 30.0], HEIGHT)
}

pub fn scene(primitives: Vec<Primitive>, shape: LightShape) -> Scene {
    let center = Vec3::new(0.0, HEIGHT, 0.0);
    let mut scene = Scene {
        name: "closed form".to_string(),
        primitives,
        materials: vec![Material::default()],
        lights: vec![SceneLight {
            name: "lamp".to_string(),
            node: None,
            light: AreaLight::new(shape, center, Vec3::NEG_Y, Vec3::X),
        }],
        ..Scene::default()
    };
    scene.finish().unwrap();
    scene
}

/// Looks down from 2 m above the floor and sees 1.6 m to each side: +X to the right.
pub fn camera() -> SceneCamera {
    SceneCamera {
        position: Vec3::new(0.0, 2.0, 0.0),
        forward: Vec3::NEG_Y,
        right: Vec3::X,
        up: Vec3::NEG_Z,
        yfov: 2.0 * 0.8_f32.atan(),
        znear: 0.01,
        ..SceneCamera::framing(&Aabb::EMPTY)
    }
}

/// Where a pixel's column lies on the floor.
pub fn floor_x(column: u32) -> f32 {
    1.6 * ((column as f32 + 0.5) / (SIZE / 2) as f32 - 1.0)
}

/// Root mean square and largest error over a picture of the floor, every `step`-th pixel.
pub fn errors(image: &[f32], step: u32, mut truth: impl FnMut(Vec3) -> f32) -> (f32, f32) {
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
