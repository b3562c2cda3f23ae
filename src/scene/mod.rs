//! What is to be rendered: triangles, materials, cameras and lights in one common space.
//!
//! **Scene space** is world space (glTF: metres, right-handed, +Y up) minus
//! [`Scene::rebase_origin`]. The subtraction happens in `f64`, so a scene far from the world's
//! origin keeps its small details once it is `f32`.
//!
//! A [`Scene`] is plain data: fill it by hand and call [`Scene::finish`], or read it from a file
//! with `Scene::load` (feature `cli`).

mod bounds;
mod camera;
mod error;
#[cfg(feature = "cli")]
mod gltf;
mod material;
mod select;

use std::path::PathBuf;

use glam::{DVec3, Vec2, Vec3};

use crate::light::AreaLight;
use error::{element, shorten};

pub use bounds::Aabb;
pub use camera::{Ray, SceneCamera};
pub use error::SceneError;
#[cfg(feature = "cli")]
pub use gltf::{LoadOptions, SceneFile};
pub use material::{AlphaMode, Material, Texture, TextureImage, Wrap};

/// Largest magnitude of a coordinate in scene space, metres. Products of four such numbers, as in
/// determinants, stay within `f32`.
pub const MAX_COORDINATE: f32 = 1.0e9;

/// A scene at one moment: everything is in scene space, nothing is left to be transformed.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Scene {
    /// For messages and reports; the file's name without its ending.
    pub name: String,
    /// The file it was read from.
    pub source: Option<PathBuf>,
    /// The point of the world, in metres, that is the origin of scene space.
    pub rebase_origin: DVec3,
    /// Triangle meshes; each [`Primitive::material`] is an index into `materials`.
    pub primitives: Vec<Primitive>,
    /// Surfaces.
    pub materials: Vec<Material>,
    /// Images of surfaces; each [`Texture::image`] is an index into them.
    pub images: Vec<TextureImage>,
    /// Perspective cameras in document order.
    pub cameras: Vec<SceneCamera>,
    /// Lights in document order.
    pub lights: Vec<SceneLight>,
    /// The box around all vertices that a triangle uses.
    pub bounds: Aabb,
    /// INDEX and name of each orthographic camera: counted, but of no use here.
    pub orthographic_cameras: Vec<(usize, String)>,
}

/// One indexed triangle mesh of one material.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Primitive {
    /// For messages; made up where the file names nothing.
    pub name: String,
    /// The glTF node that placed it; `None` for a mesh that no file holds.
    pub node: Option<usize>,
    /// Index into [`Scene::materials`].
    pub material: usize,
    /// Scene space, metres.
    pub positions: Vec<Vec3>,
    /// Where the positions would be without skin and morph targets, in a space of the node's; empty for
    /// a mesh that neither moves. Says which corners are one point of the surface at every moment.
    pub rest: Vec<Vec3>,
    /// Unit shading normals, one for each position. The geometric normal is the triangle's own.
    pub normals: Vec<Vec3>,
    /// Where each position lies in the material's base texture: (0, 0) is the image's top left
    /// corner, (1, 1) its bottom right one. One for each position, or none at all.
    pub uvs: Vec<Vec2>,
    /// Three for each triangle, each an index into `positions`; counter-clockwise seen from the
    /// front.
    pub indices: Vec<u32>,
}

impl Primitive {
    /// Number of triangles.
    pub fn triangle_count(&self) -> usize {
        self.indices.len() / 3
    }
}

/// A light and where it came from.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneLight {
    /// Name of the node, of its light, or a made-up one.
    pub name: String,
    /// Index of the glTF node; `None` for a light that no file holds.
    pub node: Option<usize>,
    /// The light in scene space.
    pub light: AreaLight,
}

impl Scene {
    /// Reads a glTF 2.0 file, .glb or .gltf, told apart by content.
    ///
    /// External buffers and images (PNG, JPEG) must lie in the folder of the file or below it. An
    /// animated file is shown at [`LoadOptions::time`]; [`SceneFile`] shows it at several moments.
    ///
    /// # Errors
    /// A [`SceneError`] that names the file and the element: a file that is missing, no glTF,
    /// truncated or invalid, data that is missing or out of range, a scene without triangles.
    #[cfg(feature = "cli")]
    pub fn load(
        path: impl AsRef<std::path::Path>,
        options: &LoadOptions,
    ) -> Result<Self, SceneError> {
        gltf::load(path.as_ref(), options)
    }

    /// As [`load`](Self::load), from the bytes of a file. `path` need not exist: messages name it,
    /// and external buffers are looked for in its folder.
    ///
    /// # Errors
    /// As for [`load`](Self::load).
    #[cfg(feature = "cli")]
    pub fn load_slice(
        path: impl AsRef<std::path::Path>,
        bytes: &[u8],
        options: &LoadOptions,
    ) -> Result<Self, SceneError> {
        gltf::load_slice(path.as_ref(), bytes, options)
    }

    /// Number of triangles of all primitives.
    pub fn triangle_count(&self) -> usize {
        self.primitives.iter().map(Primitive::triangle_count).sum()
    }

    /// Checks a scene and computes [`Scene::bounds`]; everything that renders a scene may then rely
    /// on what the fields promise.
    ///
    /// # Errors
    /// The first thing that is wrong: [`SceneError::Invalid`], [`SceneError::Light`] or
    /// [`SceneError::NoTriangles`].
    pub fn finish(&mut self) -> Result<(), SceneError> {
        let invalid = |element: String, reason: String| SceneError::Invalid {
            file: self.label(),
            element,
            reason,
        };
        let mut bounds = Aabb::EMPTY;
        for (i, primitive) in self.primitives.iter().enumerate() {
            let label = || element("primitive", i, &primitive.name);
            if primitive.material >= self.materials.len() {
                let reason = format!("it names material {}, which is missing", primitive.material);
                return Err(invalid(label(), reason));
            }
            let (vertices, normals) = (primitive.positions.len(), primitive.normals.len());
            if vertices != normals || primitive.indices.len() % 3 != 0 {
                let reason = format!(
                    "it has {vertices} positions, {normals} normals and {} indices; give one \
                     normal a position and three indices a triangle",
                    primitive.indices.len()
                );
                return Err(invalid(label(), reason));
            }
            let rest = primitive.rest.len();
            if rest != 0 && rest != vertices {
                let reason = format!("it has {vertices} positions and {rest} rest positions");
                return Err(invalid(label(), reason));
            }
            let uvs = primitive.uvs.len();
            if uvs != 0 && uvs != vertices {
                let reason = format!("it has {vertices} positions and {uvs} texture coordinates");
                return Err(invalid(label(), reason));
            }
            for (vertex, position) in primitive.positions.iter().enumerate() {
                // Written so that NaN fails.
                if !(position.abs().max_element() <= MAX_COORDINATE && position.is_finite()) {
                    let reason = format!(
                        "vertex {vertex} lies at {position}; coordinates must be finite and at \
                         most {MAX_COORDINATE:e} m from the scene's origin"
                    );
                    return Err(invalid(label(), reason));
                }
            }
            let is_unit = |n: &Vec3| (n.length_squared() - 1.0).abs() < 1.0e-2;
            if let Some(vertex) = primitive.normals.iter().position(|n| !is_unit(n)) {
                let reason = format!("the normal of vertex {vertex} is not of length 1");
                return Err(invalid(label(), reason));
            }
            for (at, &index) in primitive.indices.iter().enumerate() {
                let Some(position) = primitive.positions.get(index as usize) else {
                    let reason = format!("index {at} names vertex {index} of {vertices}");
                    return Err(invalid(label(), reason));
                };
                bounds.insert(*position);
            }
        }
        for (i, material) in self.materials.iter().enumerate() {
            if let Some(reason) = self.material_fault(material) {
                return Err(invalid(element("material", i, &material.name), reason));
            }
        }
        for (i, image) in self.images.iter().enumerate() {
            let texels = image.width as usize * image.height as usize;
            if texels == 0 || texels != image.texels.len() {
                let reason = format!(
                    "it is {}x{} and has {} texels",
                    image.width,
                    image.height,
                    image.texels.len()
                );
                return Err(invalid(element("image", i, &image.name), reason));
            }
        }
        for (i, camera) in self.cameras.iter().enumerate() {
            if let Some(fault) = camera.fault() {
                return Err(invalid(element("camera", i, &camera.name), fault));
            }
        }
        for light in &self.lights {
            light.light.validate().map_err(|source| SceneError::Light {
                file: self.label(),
                light: shorten(&light.name),
                source,
            })?;
        }
        if self.triangle_count() == 0 {
            return Err(SceneError::NoTriangles { file: self.label() });
        }
        self.bounds = bounds;
        Ok(())
    }

    fn material_fault(&self, material: &Material) -> Option<String> {
        let unit = |c: f32| (0.0..=1.0).contains(&c);
        let (colour, emissive) = (material.base_color, material.emissive);
        let cutoff = material.mask_cutoff().unwrap_or(0.0);
        if !colour.to_array().into_iter().all(unit) {
            Some(format!("base colour {colour} is not within 0 to 1"))
        } else if !(cutoff >= 0.0 && cutoff.is_finite()) {
            Some(format!("alpha cutoff {cutoff} is not finite and 0 or more"))
        } else if !(unit(material.metallic) && unit(material.roughness)) {
            Some(format!(
                "metallic {} or roughness {} is not within 0 to 1",
                material.metallic, material.roughness
            ))
        } else if !(emissive.is_finite() && emissive.min_element() >= 0.0) {
            Some(format!(
                "emissive colour {emissive} is not finite and 0 or more"
            ))
        } else {
            let image = material.base_texture?.image;
            (image >= self.images.len())
                .then(|| format!("it names image {image}, which is missing"))
        }
    }

    /// What messages call this scene: its file, else its name.
    pub fn label(&self) -> String {
        match &self.source {
            // A message is one line, whatever a file is called.
            Some(path) => path.display().to_string().replace(char::is_control, "?"),
            None if self.name.is_empty() => "scene".into(),
            None => self.name.clone(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::light::LightShape;

    fn triangle() -> Scene {
        Scene {
            name: "triangle".into(),
            primitives: vec![Primitive {
                name: "only".into(),
                positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::splat(9.0)],
                normals: vec![Vec3::Z; 4],
                indices: vec![0, 1, 2],
                ..Default::default()
            }],
            materials: vec![Material::default()],
            ..Default::default()
        }
    }

    #[test]
    fn bounds_hold_used_vertices_only() -> Result<(), SceneError> {
        let mut scene = triangle();
        scene.finish()?;
        assert_eq!(scene.bounds.min, Vec3::ZERO);
        assert_eq!(scene.bounds.max, Vec3::new(1.0, 1.0, 0.0));
        Ok(())
    }

    #[test]
    fn finish_names_what_is_wrong() {
        type Break = fn(&mut Scene);
        let broken: [(Break, &str); 10] = [
            (|s| s.primitives[0].indices[1] = 4, "names vertex 4 of 4"),
            (|s| s.primitives[0].material = 1, "material 1"),
            (|s| s.primitives[0].positions[3].y = f32::NAN, "vertex 3"),
            (|s| s.primitives[0].positions[0].x = 2e9, "vertex 0"),
            (|s| s.primitives[0].normals[2] = Vec3::ZERO, "vertex 2"),
            (|s| s.primitives[0].indices.truncate(2), "2 indices"),
            (
                |s| s.primitives[0].rest = vec![Vec3::ZERO; 2],
                "2 rest positions",
            ),
            (|s| s.primitives.clear(), "no triangles"),
            (|s| s.materials[0].base_color.x = f32::NAN, "material 0"),
            (
                |s| {
                    s.lights.push(SceneLight {
                        name: "lamp".into(),
                        node: None,
                        light: AreaLight::new(
                            LightShape::Disk { radius: -1.0 },
                            Vec3::ZERO,
                            Vec3::Z,
                            Vec3::X,
                        ),
                    });
                },
                "light `lamp`",
            ),
        ];
        for (break_it, wanted) in broken {
            let mut scene = triangle();
            break_it(&mut scene);
            let message = match scene.finish() {
                Ok(()) => panic!("accepted: {wanted}"),
                Err(error) => error.to_string(),
            };
            assert!(message.contains(wanted), "{message}");
            assert!(message.starts_with("triangle: "), "{message}");
        }
    }
}
