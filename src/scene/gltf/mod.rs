//! glTF 2.0 files: from bytes to a [`Scene`].
//!
//! The `gltf` crate parses and validates the JSON. Everything that reads bytes (container, buffers,
//! accessors, images) is checked here, because a file may declare more than it holds.

mod accessor;
mod animation;
mod buffers;
mod cameras;
mod container;
mod document;
mod instance;
mod lights;
mod materials;
mod mesh;
mod morph;
mod nodes;
mod skin;
mod textures;

use std::cell::Cell;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use glam::{DAffine3, DVec3};
use gltf::Document;

use super::error::shorten;
use super::{Material, Scene, SceneError, TextureImage};
use accessor::Accessors;
use animation::{Animation, Pose};
use document::Side;
use instance::Placement;
use materials::Surface;
use mesh::LocalPrimitive;
use nodes::{PlacedNode, Tree};
use skin::Skin;

/// How a file is read.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct LoadOptions {
    /// The moment that [`Scene::load`] shows, seconds after the start of the animation, as in
    /// [`SceneFile::scene_at`].
    pub time: f64,
    /// Largest number of vertices, and of indices, that all meshes together may have once every
    /// node has its own copy: a bound on memory for files that are not trusted. All accessors
    /// together may have eight times as many elements.
    pub max_vertices: u64,
    /// Largest number of texels that may be decoded from all images together, four bytes each: a
    /// bound on memory likewise.
    pub max_texels: u64,
    /// Largest width and height of an image, texels.
    pub max_image_side: u32,
}

impl Default for LoadOptions {
    fn default() -> Self {
        Self {
            time: 0.0,
            max_vertices: 1 << 27,
            max_texels: 1 << 30,
            max_image_side: 16_384,
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

fn element(kind: &str, index: usize, name: Option<&str>) -> String {
    super::error::element(kind, index, name.unwrap_or_default())
}

/// A glTF file in memory, read and decoded once, to be seen at any moment of its animation.
///
/// All animations of the file play together, from their common start. Where two of them, or two
/// channels of one, move the same property of the same node, the first in document order counts.
/// Before its first key and after its last one a property stands still.
///
/// [`Scene::rebase_origin`] is chosen from the rest pose, the scene as it is without animation, and
/// is the same at all times.
#[derive(Debug)]
pub struct SceneFile {
    path: PathBuf,
    document: Document,
    side: Side,
    tree: Tree,
    animation: Animation,
    /// By index, those that are shown.
    meshes: BTreeMap<usize, Vec<LocalPrimitive>>,
    /// By index, those that are used.
    skins: BTreeMap<usize, Skin>,
    /// By node: its copies (EXT_mesh_gpu_instancing), in the space of the node.
    copies: BTreeMap<usize, Vec<DAffine3>>,
    materials: Vec<Material>,
    images: Vec<TextureImage>,
    rebase_origin: DVec3,
}

impl SceneFile {
    /// Reads a file, with its buffers and images.
    ///
    /// # Errors
    /// As for [`Scene::load`].
    pub fn open(path: impl AsRef<Path>, options: &LoadOptions) -> Result<Self, SceneError> {
        let path = path.as_ref();
        let bytes = std::fs::read(path).map_err(|source| SceneError::Read {
            file: path.into(),
            source,
        })?;
        Self::read(path, &bytes, options)
    }

    /// As [`open`](Self::open), from the bytes of a file. `path` need not exist: messages name it,
    /// and external buffers and images are looked for in its folder.
    ///
    /// # Errors
    /// As for [`Scene::load`].
    pub fn from_slice(
        path: impl AsRef<Path>,
        bytes: Vec<u8>,
        options: &LoadOptions,
    ) -> Result<Self, SceneError> {
        Self::read(path.as_ref(), &bytes, options)
    }

    /// The JSON of a file's `bytes`, which `path` names in messages. It is not parsed.
    ///
    /// # Errors
    /// [`SceneError::NotGltf`].
    pub fn json_of<'a>(path: &Path, bytes: &'a [u8]) -> Result<&'a [u8], SceneError> {
        Ok(container::split(Source { path }, bytes)?.json)
    }

    /// The whole content of a file that the scene at `path` names by `uri`.
    ///
    /// # Errors
    /// It cannot be read, or lies outside the folder of the scene.
    pub fn read_named(path: &Path, uri: &str) -> std::io::Result<Vec<u8>> {
        buffers::read_uri(path, uri, u64::MAX)
    }

    fn read(path: &Path, bytes: &[u8], options: &LoadOptions) -> Result<Self, SceneError> {
        let source = Source { path };
        let parts = container::split(source, bytes)?;
        let (document, side) = document::parse(source, parts.json)?;
        let buffers = buffers::load(source, &document, parts.bin)?;
        let accessors = Accessors {
            source,
            buffers: &buffers,
            limit: options.max_vertices,
            left: Cell::new(options.max_vertices.saturating_mul(8)),
        };
        let tree = Tree::read(source, &document, &side)?;
        let animation = Animation::read(&accessors, &document, &tree)?;
        let rest = Pose::default();
        let placed = tree.place(source, &document, &rest)?;
        let surfaces = materials::read(&document);
        let copies = instance::copies(&accessors, &document, &side, &placed)?;
        let mut meshes = read_meshes(&accessors, &document, &placed, &copies, &surfaces)?;
        let skins = read_skins(&accessors, &document, &placed, &meshes)?;
        let (materials, images) =
            materials::finish(source, &document, &buffers, options, surfaces, &mut meshes)?;
        drop(buffers);
        let mut file = Self {
            path: path.into(),
            document,
            side,
            tree,
            animation,
            meshes,
            skins,
            copies,
            materials,
            images,
            rebase_origin: DVec3::ZERO,
        };
        file.rebase_origin = file.rest_origin(&placed)?;
        Ok(file)
    }

    /// True if anything in the file moves.
    pub fn is_animated(&self) -> bool {
        !self.animation.is_empty()
    }

    /// Seconds from the start of the animation to its last key; 0 if nothing moves.
    pub fn duration(&self) -> f64 {
        self.animation.duration()
    }

    /// The scene `seconds` after the start of its animation; before the start and after the end it
    /// stands still. NaN counts as 0.
    ///
    /// # Errors
    /// A [`SceneError`] that names the file and the element: what [`Scene::finish`] refuses, and
    /// transforms that leave the range of numbers at that moment.
    pub fn scene_at(&self, seconds: f64) -> Result<Scene, SceneError> {
        let mut scene = self.without_images(seconds)?;
        scene.images.clone_from(&self.images);
        scene.finish()?;
        Ok(scene)
    }

    /// As [`scene_at`](Self::scene_at), for one moment only.
    fn into_scene_at(self, seconds: f64) -> Result<Scene, SceneError> {
        let mut scene = self.without_images(seconds)?;
        scene.images = self.images;
        scene.finish()?;
        Ok(scene)
    }

    fn source(&self) -> Source<'_> {
        Source { path: &self.path }
    }

    /// All of the scene but its images.
    fn without_images(&self, seconds: f64) -> Result<Scene, SceneError> {
        let (source, document) = (self.source(), &self.document);
        let pose = self.animation.pose(&self.tree, seconds);
        let placed = self.tree.place(source, document, &pose)?;
        let name = self.path.file_stem();
        let mut scene = Scene {
            name: name.map_or_else(String::new, |stem| stem.to_string_lossy().into()),
            source: Some(self.path.clone()),
            rebase_origin: self.rebase_origin,
            materials: self.materials.clone(),
            ..Scene::default()
        };
        self.each_instance(&placed, &pose, self.rebase_origin, |shown| {
            let mut name = instance::name(document, shown.node, shown.local);
            if let Some(copy) = shown.copy {
                name.push_str(&format!("[{copy}]"));
            }
            let (placement, weights) = (shown.placement, shown.weights);
            let primitive = (shown.primitive).place(shown.node.index, name, placement, weights);
            scene.primitives.push(primitive);
        })?;
        cameras::add(&mut scene, source, document, &placed)?;
        lights::add(&mut scene, source, document, &self.side, &placed)?;
        Ok(scene)
    }

    /// Every primitive as often as a node shows it, in document order.
    fn each_instance(
        &self,
        placed: &[PlacedNode],
        pose: &Pose,
        origin: DVec3,
        mut show: impl FnMut(&Shown<'_>),
    ) -> Result<(), SceneError> {
        let source = self.source();
        let mut joints = BTreeMap::new();
        if !self.skins.is_empty() {
            let worlds = self.tree.worlds(pose);
            for (&index, skin) in &self.skins {
                let matrices = skin.matrices(source, &worlds, origin)?;
                joints.insert(index, Placement::Skinned(matrices));
            }
        }
        for node in placed {
            let Some(primitives) = node.mesh.and_then(|mesh| self.meshes.get(&mesh)) else {
                continue;
            };
            let targets = primitives.first().map_or(0, |first| first.targets.len());
            let weights = morph::weights(source, &self.document, node, pose, targets)?;
            let joints = node.skin.and_then(|skin| joints.get(&skin));
            let copies = self.copies.get(&node.index);
            for copy in 0..copies.map_or(1, Vec::len) {
                let mut world = node.world;
                world.translation -= origin;
                if let Some(local) = copies.and_then(|copies| copies.get(copy)) {
                    world *= *local;
                }
                let rigid = Placement::Rigid(world);
                for (local, primitive) in primitives.iter().enumerate() {
                    let joints = joints.filter(|_| !primitive.influences.is_empty());
                    // A skin says where the mesh is, wherever its node is: a copy would be the same.
                    if joints.is_some() && copy > 0 {
                        continue;
                    }
                    show(&Shown {
                        node,
                        primitive,
                        local,
                        copy: copies.map(|_| copy),
                        placement: joints.unwrap_or(&rigid),
                        weights: &weights,
                    });
                }
            }
        }
        Ok(())
    }

    /// The middle of all triangles of the rest pose in world space, rounded to a power of two of
    /// about the scene's size: a scene near the origin stays where it is, and rounding keeps round
    /// coordinates round.
    fn rest_origin(&self, placed: &[PlacedNode]) -> Result<DVec3, SceneError> {
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        self.each_instance(placed, &Pose::default(), DVec3::ZERO, |shown| {
            let bounds = shown.primitive.bounds(shown.placement, shown.weights);
            low = low.min(bounds.0);
            high = high.max(bounds.1);
        })?;
        let size = (high - low).length();
        let quantum = size.log2().ceil().exp2();
        let origin = (0.5 * (low + high) / quantum).round() * quantum;
        Ok(if size > 0.0 && origin.is_finite() {
            // Adding 0 turns -0 into 0.
            origin + 0.0
        } else {
            DVec3::ZERO
        })
    }
}

/// A primitive as one node shows it.
struct Shown<'a> {
    node: &'a PlacedNode,
    primitive: &'a LocalPrimitive,
    /// Number of the primitive in its mesh.
    local: usize,
    /// Number of the node's copy, if it has copies.
    copy: Option<usize>,
    placement: &'a Placement,
    weights: &'a [f64],
}

pub(super) fn load(path: &Path, options: &LoadOptions) -> Result<Scene, SceneError> {
    SceneFile::open(path, options)?.into_scene_at(options.time)
}

pub(super) fn load_slice(
    path: &Path,
    bytes: &[u8],
    options: &LoadOptions,
) -> Result<Scene, SceneError> {
    SceneFile::read(path, bytes, options)?.into_scene_at(options.time)
}

/// The triangle primitives of every mesh that a node shows, each read once.
fn read_meshes(
    accessors: &Accessors<'_>,
    document: &Document,
    placed: &[PlacedNode],
    copies: &BTreeMap<usize, Vec<DAffine3>>,
    surfaces: &[Surface],
) -> Result<BTreeMap<usize, Vec<LocalPrimitive>>, SceneError> {
    let mut meshes = BTreeMap::new();
    let (mut vertices, mut indices, mut displacements) = (0u64, 0u64, 0u64);
    for node in placed {
        let Some(mesh) = node.mesh.and_then(|index| document.meshes().nth(index)) else {
            continue;
        };
        let primitives: &Vec<LocalPrimitive> = match meshes.entry(mesh.index()) {
            std::collections::btree_map::Entry::Occupied(entry) => entry.into_mut(),
            std::collections::btree_map::Entry::Vacant(entry) => {
                entry.insert(mesh::read(accessors, &mesh, surfaces)?)
            }
        };
        let times = copies
            .get(&node.index)
            .map_or(1, |copies| copies.len() as u64);
        for primitive in primitives {
            let count = primitive.positions.len() as u64;
            // An empty copy costs memory too.
            vertices = vertices.saturating_add(times.saturating_mul(count.max(1)));
            indices = indices.saturating_add(times * primitive.indices.len() as u64);
            let targets = primitive.targets.len() as u64;
            displacements = displacements.saturating_add(times * targets * count.max(1) / 8);
        }
        if vertices.max(indices).max(displacements) > accessors.limit {
            return Err(SceneError::TooLarge {
                file: accessors.source.label(),
                element: element("mesh", mesh.index(), mesh.name()),
                limit: accessors.limit,
            });
        }
    }
    Ok(meshes)
}

/// The skins of all nodes that show a mesh, checked against the meshes that follow them.
fn read_skins(
    accessors: &Accessors<'_>,
    document: &Document,
    placed: &[PlacedNode],
    meshes: &BTreeMap<usize, Vec<LocalPrimitive>>,
) -> Result<BTreeMap<usize, Skin>, SceneError> {
    let source = accessors.source;
    let mut skins = BTreeMap::new();
    let mut checked = BTreeSet::new();
    for node in placed {
        let (Some(mesh), Some(index)) = (node.mesh, node.skin) else {
            continue;
        };
        if let std::collections::btree_map::Entry::Vacant(entry) = skins.entry(index) {
            entry.insert(Skin::read(accessors, document, index)?);
        }
        let (Some(skin), Some(primitives)) = (skins.get(&index), meshes.get(&mesh)) else {
            continue;
        };
        if !checked.insert((mesh, index)) {
            continue;
        }
        for (number, primitive) in primitives.iter().enumerate() {
            let name = || format!("{}, primitive {number}", element("mesh", mesh, None));
            if primitive.influences.is_empty() {
                let label = source.label();
                log::warn!("{label}: {}: no joints, so its skin is ignored", name());
            }
            if let Some(fault) = skin.fault(&primitive.influences) {
                return Err(source.invalid(name(), fault));
            }
        }
    }
    Ok(skins)
}
