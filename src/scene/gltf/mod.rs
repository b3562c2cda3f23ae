//! glTF 2.0 files: from bytes to a [`Scene`].
//!
//! The `gltf` crate parses and validates the JSON. Everything that reads bytes (container, buffers,
//! accessors) is checked here, because a file may declare more than it holds.

mod accessor;
mod buffers;
mod container;
mod document;
mod lights;
mod mesh;
mod nodes;

use std::collections::BTreeMap;
use std::path::Path;

use glam::{DVec3, Vec4};
use gltf::Document;

use super::camera::SceneCamera;
use super::error::shorten;
use super::{AlphaMode, Material, Scene, SceneError};
use accessor::Accessors;
use mesh::LocalPrimitive;
use nodes::PlacedNode;

/// How a file is read.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct LoadOptions {
    /// Largest number of vertices, and of indices, that all meshes together may have once every
    /// node has its own copy: a bound on memory for files that are not trusted.
    pub max_vertices: u64,
}

impl Default for LoadOptions {
    fn default() -> Self {
        Self {
            max_vertices: 1 << 27,
        }
    }
}

/// The file that messages are about.
#[derive(Clone, Copy)]
struct Source<'a> {
    path: &'a Path,
}

impl Source<'_> {
    fn label(&self) -> String {
        // A message is one line, whatever a file is called.
        self.path
            .display()
            .to_string()
            .replace(char::is_control, "?")
    }

    fn invalid(&self, element: impl Into<String>, reason: impl Into<String>) -> SceneError {
        SceneError::Invalid {
            file: self.label(),
            element: element.into(),
            reason: reason.into(),
        }
    }
}

/// `` `name` `` after `kind` and `index`, short and on one line.
fn element(kind: &str, index: usize, name: Option<&str>) -> String {
    match name {
        Some(name) if !name.is_empty() => format!("{kind} {index} `{}`", shorten(name)),
        _ => format!("{kind} {index}"),
    }
}

/// A glTF file in memory, to be seen at any moment of its animation.
#[derive(Debug)]
pub struct SceneFile {
    path: std::path::PathBuf,
    bytes: Vec<u8>,
    options: LoadOptions,
}

impl SceneFile {
    /// Reads a file.
    ///
    /// # Errors
    /// As for [`Scene::load`].
    pub fn open(path: impl AsRef<Path>, options: &LoadOptions) -> Result<Self, SceneError> {
        let path = path.as_ref();
        let bytes = std::fs::read(path).map_err(|source| SceneError::Read {
            file: path.into(),
            source,
        })?;
        Ok(Self {
            path: path.into(),
            bytes,
            options: options.clone(),
        })
    }

    /// The scene `seconds` after the start of its animation; before the start and after the end it
    /// stands still.
    ///
    /// # Errors
    /// As for [`Scene::load`].
    pub fn scene_at(&self, seconds: f64) -> Result<Scene, SceneError> {
        let _ = seconds;
        load_slice(&self.path, &self.bytes, &self.options)
    }
}

pub(super) fn load(path: &Path, options: &LoadOptions) -> Result<Scene, SceneError> {
    let bytes = std::fs::read(path).map_err(|source| SceneError::Read {
        file: path.into(),
        source,
    })?;
    load_slice(path, &bytes, options)
}

pub(super) fn load_slice(
    path: &Path,
    bytes: &[u8],
    options: &LoadOptions,
) -> Result<Scene, SceneError> {
    let source = Source { path };
    let parts = container::split(source, bytes)?;
    let (document, side) = document::parse(source, parts.json)?;
    let buffers = buffers::load(source, &document, parts.bin)?;
    let accessors = Accessors {
        source,
        buffers: &buffers,
        limit: options.max_vertices,
    };
    let placed = nodes::place(source, &document, &side)?;
    let meshes = read_meshes(&accessors, &document, &placed, options.max_vertices)?;

    let mut scene = Scene {
        name: path
            .file_stem()
            .map_or_else(String::new, |stem| stem.to_string_lossy().into()),
        source: Some(path.into()),
        rebase_origin: rebase_origin(&placed, &meshes),
        ..Scene::default()
    };
    add_materials(&mut scene, &document);
    for node in &placed {
        for (local, primitive) in meshes.get(&node.mesh).into_iter().flatten().enumerate() {
            let name = mesh::instance_name(&document, node, local);
            scene.primitives.push(primitive.place(
                node,
                name,
                scene.rebase_origin,
                &scene.materials,
            ));
        }
    }
    add_cameras(&mut scene, source, &document, &placed)?;
    lights::add(&mut scene, source, &document, &side, &placed)?;
    scene.finish()?;
    Ok(scene)
}

/// The triangle primitives of every mesh that a node shows, each read once.
fn read_meshes(
    accessors: &Accessors<'_>,
    document: &Document,
    placed: &[PlacedNode],
    limit: u64,
) -> Result<BTreeMap<Option<usize>, Vec<LocalPrimitive>>, SceneError> {
    let mut meshes = BTreeMap::new();
    let (mut vertices, mut indices) = (0u64, 0u64);
    for node in placed {
        let Some(mesh) = node.mesh.and_then(|index| document.meshes().nth(index)) else {
            continue;
        };
        let primitives = match meshes.entry(node.mesh) {
            std::collections::btree_map::Entry::Occupied(entry) => entry.into_mut(),
            std::collections::btree_map::Entry::Vacant(entry) => {
                entry.insert(mesh::read(accessors, &mesh)?)
            }
        };
        for primitive in primitives {
            vertices += primitive.positions.len() as u64;
            indices += primitive.indices.len() as u64;
        }
        if vertices.max(indices) > limit {
            return Err(SceneError::TooLarge {
                file: accessors.source.label(),
                element: element("mesh", mesh.index(), mesh.name()),
                limit,
            });
        }
    }
    Ok(meshes)
}

/// The middle of all triangles in world space, rounded to a power of two of about the scene's size:
/// a scene near the origin stays where it is, and rounding keeps round coordinates round.
fn rebase_origin(
    placed: &[PlacedNode],
    meshes: &BTreeMap<Option<usize>, Vec<LocalPrimitive>>,
) -> DVec3 {
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for node in placed {
        for primitive in meshes.get(&node.mesh).into_iter().flatten() {
            for position in primitive.used_positions() {
                let world = node.world.transform_point3(position.as_dvec3());
                low = low.min(world);
                high = high.max(world);
            }
        }
    }
    let size = (high - low).length();
    let quantum = size.log2().ceil().exp2();
    let origin = (0.5 * (low + high) / quantum).round() * quantum;
    if size > 0.0 && origin.is_finite() {
        // Adding 0 turns -0 into 0.
        origin + 0.0
    } else {
        DVec3::ZERO
    }
}

/// All materials, and last the one for primitives that name none.
fn add_materials(scene: &mut Scene, document: &Document) {
    scene.materials.extend(document.materials().map(|material| {
        let [r, g, b, a] = material.pbr_metallic_roughness().base_color_factor();
        Material {
            name: material.name().unwrap_or_default().into(),
            base_color: Vec4::new(r, g, b, a).clamp(Vec4::ZERO, Vec4::ONE),
            double_sided: material.double_sided(),
            alpha_mode: match material.alpha_mode() {
                gltf::material::AlphaMode::Opaque => AlphaMode::Opaque,
                gltf::material::AlphaMode::Blend => AlphaMode::Blend,
                gltf::material::AlphaMode::Mask => AlphaMode::Mask {
                    cutoff: material.alpha_cutoff().unwrap_or(0.5),
                },
            },
            ..Material::default()
        }
    }));
    scene.materials.push(Material::default());
}

fn add_cameras(
    scene: &mut Scene,
    source: Source<'_>,
    document: &Document,
    placed: &[PlacedNode],
) -> Result<(), SceneError> {
    let json = &document.as_json().cameras;
    let with_camera = placed
        .iter()
        .filter_map(|node| Some((node, json.get(node.camera?)?)));
    for (index, (node, camera)) in with_camera.enumerate() {
        let name = [node.name.as_deref(), camera.name.as_deref()]
            .into_iter()
            .flatten()
            .find(|name| !name.is_empty())
            .map_or_else(|| format!("camera {index}"), Into::into);
        let is_perspective = matches!(
            camera.type_,
            gltf::json::validation::Checked::Valid(gltf::json::camera::Type::Perspective)
        );
        if !is_perspective {
            scene.orthographic_cameras.push((index, name));
            continue;
        }
        let element = || element("camera", index, Some(&name));
        let Some(lens) = &camera.perspective else {
            return Err(source.invalid(element(), "its `perspective` is missing"));
        };
        let frame = nodes::frame(node.world.matrix3, nodes::Keep::Y);
        let camera = SceneCamera {
            node: Some(node.index),
            index,
            position: (node.world.translation - scene.rebase_origin).as_vec3(),
            right: frame.x_axis.as_vec3(),
            up: frame.y_axis.as_vec3(),
            forward: -frame.z_axis.as_vec3(),
            yfov: lens.yfov,
            znear: lens.znear,
            zfar: lens.zfar,
            name: name.clone(),
        };
        if let Some(fault) = camera.fault() {
            return Err(source.invalid(element(), fault));
        }
        scene.cameras.push(camera);
    }
    Ok(())
}
