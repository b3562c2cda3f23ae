//! Triangle meshes of stress scenes, and the scene they are put into.

use glam::Vec3;

use super::Case;
use crate::light::AreaLight;
use crate::scene::{Aabb, Material, Primitive, Scene, SceneCamera, SceneLight};

/// Triangles, each with corners of its own: flat shading.
pub(super) type Soup = Vec<[Vec3; 3]>;

/// Two triangles over four corners, counter-clockwise from the front.
pub(super) fn quad([a, b, c, d]: [Vec3; 4]) -> Soup {
    vec![[a, b, c], [a, c, d]]
}

/// A rectangle around `center` with these half edges; its front is towards `u` x `v`.
pub(super) fn patch(center: Vec3, u: Vec3, v: Vec3) -> Soup {
    quad([
        center - u - v,
        center + u - v,
        center + u + v,
        center - u + v,
    ])
}

/// A horizontal rectangle that faces up.
pub(super) fn floor(center: Vec3, half_x: f32, half_z: f32) -> Soup {
    patch(center, Vec3::Z * half_z, Vec3::X * half_x)
}

/// A box, facing outwards; the faces in the order -x, +x, -y, +y, -z, +z, two triangles each.
pub(super) fn cuboid(min: Vec3, max: Vec3) -> Soup {
    let corners = Aabb { min, max }.corners();
    let faces = [
        [0, 4, 6, 2],
        [1, 3, 7, 5],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 2, 3, 1],
        [4, 5, 7, 6],
    ];
    let face = |face: [usize; 4]| quad(face.map(|corner| corners[corner]));
    faces.into_iter().flat_map(face).collect()
}

/// The same triangles from their other side.
pub(super) fn turned_over(soup: &Soup) -> Soup {
    soup.iter().map(|[a, b, c]| [*a, *c, *b]).collect()
}

/// A mesh with shared corners.
#[derive(Clone, Debug, Default)]
pub(super) struct Mesh {
    pub positions: Vec<Vec3>,
    pub faces: Vec<[u32; 3]>,
}

/// A ball of `bands` bands of latitude and twice as many of longitude.
pub(super) fn ball(center: Vec3, radius: f32, bands: u32) -> Mesh {
    let around = 2 * bands;
    let mut mesh = Mesh::default();
    for band in 0..=bands {
        let (sine, cosine) = (std::f32::consts::PI * band as f32 / bands as f32).sin_cos();
        for step in 0..around {
            let (z, x) = (std::f32::consts::TAU * step as f32 / around as f32).sin_cos();
            let direction = Vec3::new(sine * x, cosine, sine * z);
            mesh.positions.push(center + radius * direction);
        }
    }
    for band in 0..bands {
        for step in 0..around {
            let next = (step + 1) % around;
            let at = |band: u32, step: u32| band * around + step;
            let (a, b) = (at(band, step), at(band, next));
            let (c, d) = (at(band + 1, step), at(band + 1, next));
            // At the poles one of the two has no area.
            if band > 0 {
                mesh.faces.push([a, b, c]);
            }
            if band + 1 < bands {
                mesh.faces.push([b, d, c]);
            }
        }
    }
    mesh
}

/// A wavy sheet of `side` x `side` squares, two triangles each, over a square of half width `half`.
pub(super) fn waves(center: Vec3, half: f32, height: f32, side: u32) -> Mesh {
    let mut mesh = Mesh::default();
    let step = |i: u32| 2.0 * i as f32 / side as f32 - 1.0;
    for j in 0..=side {
        for i in 0..=side {
            let (x, z) = (step(i), step(j));
            let y = (9.0 * x + 2.0 * z).sin() * (7.0 * z - x).cos();
            mesh.positions
                .push(center + Vec3::new(half * x, height * y, half * z));
        }
    }
    for j in 0..side {
        for i in 0..side {
            let a = j * (side + 1) + i;
            let c = a + side + 1;
            mesh.faces.push([a, c, a + 1]);
            mesh.faces.push([a + 1, c, c + 1]);
        }
    }
    mesh
}

/// Unit vector; +Y for one without a direction.
fn unit(v: Vec3) -> Vec3 {
    let v = v.as_dvec3();
    v.try_normalize().unwrap_or(glam::DVec3::Y).as_vec3()
}

/// A primitive of flat triangles.
pub(super) fn flat(name: &str, soup: &Soup) -> Primitive {
    let positions: Vec<Vec3> = soup.concat();
    Primitive {
        name: name.to_string(),
        normals: (soup.iter())
            .flat_map(|[a, b, c]| [unit((*b - *a).cross(*c - *a)); 3])
            .collect(),
        indices: (0..positions.len() as u32).collect(),
        positions,
        ..Primitive::default()
    }
}

/// A primitive of a mesh with shared corners, shaded smoothly.
pub(super) fn smooth(name: &str, mesh: &Mesh) -> Primitive {
    let mut sums = vec![Vec3::ZERO; mesh.positions.len()];
    for face in &mesh.faces {
        let [a, b, c] = face.map(|corner| mesh.positions[corner as usize]);
        for corner in face {
            sums[*corner as usize] += (b - a).cross(c - a);
        }
    }
    Primitive {
        name: name.to_string(),
        normals: sums.into_iter().map(unit).collect(),
        positions: mesh.positions.clone(),
        indices: mesh.faces.concat(),
        ..Primitive::default()
    }
}

/// A camera at `eye` that looks at `target`, +Y up.
pub(super) fn camera(eye: Vec3, target: Vec3, yfov: f32) -> SceneCamera {
    let forward = (target - eye).normalize();
    let side = forward.cross(Vec3::Y);
    let right = if side.length() > 1.0e-3 {
        side.normalize()
    } else {
        Vec3::X
    };
    SceneCamera {
        name: "stress".into(),
        position: eye,
        right,
        up: right.cross(forward).normalize(),
        forward,
        yfov,
        znear: 0.05,
        zfar: None,
        ..SceneCamera::framing(&Aabb::EMPTY)
    }
}

/// A case in the making.
#[derive(Clone)]
pub(super) struct Stage {
    scene: Scene,
}

impl Stage {
    pub fn new() -> Self {
        Self {
            scene: Scene {
                materials: vec![Material {
                    double_sided: true,
                    ..Material::default()
                }],
                ..Scene::default()
            },
        }
    }

    pub fn add(mut self, primitive: Primitive) -> Self {
        self.scene.primitives.push(primitive);
        self
    }

    pub fn flat(self, name: &str, soup: &Soup) -> Self {
        self.add(flat(name, soup))
    }

    pub fn smooth(self, name: &str, mesh: &Mesh) -> Self {
        self.add(smooth(name, mesh))
    }

    pub fn case(
        mut self,
        name: &'static str,
        what: &'static str,
        camera: SceneCamera,
        light: AreaLight,
    ) -> Case {
        self.scene.name = name.to_string();
        self.scene.cameras = vec![camera.clone()];
        self.scene.lights = vec![SceneLight {
            name: "lamp".into(),
            node: None,
            light,
        }];
        finish(&mut self.scene);
        Case {
            name: name.to_string(),
            what,
            scene: self.scene,
            camera,
            light: 0,
            expected: None,
            fine: false,
        }
    }
}

/// Checks a scene that was made here.
pub(super) fn finish(scene: &mut Scene) {
    let fault = scene.finish().err();
    assert!(
        fault.is_none(),
        "a stress scene must be valid: {}",
        fault.map(|fault| fault.to_string()).unwrap_or_default()
    );
}
