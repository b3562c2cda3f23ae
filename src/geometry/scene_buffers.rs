//! The scene on the device: vertices and indices to draw, triangles and materials to look up.

use super::adjacency::{Adjacency, same_topology};
use super::cover::Cover;
use super::hierarchy;
use super::neighbours::neighbours;
use super::scene_layout::{IMAGE_WIDTH, Layout, Vertex};
use super::uploads::{STATIC, record_uploads, upload_buffer, upload_images};
use crate::gpu::{Buffer, Gpu, GpuError, Image, MemoryLocation, OptionalFeatures, Retired};
use crate::graph::{
    BufferDesc, BufferId, BufferState, Graph, GraphError, HostBuffer, HostImage, ImageDesc, ImageId,
};
use crate::scene::{Aabb, Scene};
use ash::vk;
use glam::Vec3;

/// Why a scene cannot be brought to the device.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum UploadError {
    /// More triangles than the device's images hold.
    #[error("the scene has {triangles} triangles; this device holds {most}")]
    TooManyTriangles {
        /// Triangles of the scene.
        triangles: usize,
        /// Triangles that fit.
        most: usize,
    },
    /// More texels than the device's images hold.
    #[error(
        "the scene's textures have {texels} texels; this device holds {most}: make them smaller"
    )]
    TooManyTexels {
        /// Texels of all textures that surfaces use.
        texels: usize,
        /// Texels that fit.
        most: usize,
    },
    /// More edges than the device's images hold.
    #[error("the scene has {edges} edges; this device holds {most}")]
    TooManyEdges {
        /// Edges of the scene.
        edges: usize,
        /// Edges that fit.
        most: usize,
    },
    /// The device refused.
    #[error(transparent)]
    Gpu(#[from] GpuError),
    /// The upload's graph is wrong.
    #[error(transparent)]
    Graph(#[from] GraphError),
}

/// A range of indices with the box around it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Draw {
    /// First index.
    pub first_index: u32,
    /// Number of indices.
    pub index_count: u32,
    /// Box around its vertices, scene space.
    pub bounds: Aabb,
    /// Corners of a box around them that turns with them: [`tight_box`](super::tight_box).
    pub corners: [Vec3; 8],
    /// The material that cuts holes into it; `None` for solid triangles.
    pub mask: Option<u32>,
}

/// The scene's buffers and images on the device. Static: uploaded once; edges once they are asked for.
#[derive(Debug)]
pub struct SceneBuffers {
    /// None in a stand-in that only plans ([`SceneBuffers::plan_only`]).
    device: Option<DeviceBuffers>,
    sizes: Sizes,
    draws: Vec<Draw>,
    covers: Vec<Cover>,
    bounds: Aabb,
    triangles: usize,
    degenerate: usize,
    /// Not yet on the device if there is no `edges`.
    adjacency: Option<Adjacency>,
    edges: Option<usize>,
    edges_found: u64,
    masked: bool,
    textured: usize,
    shiny: bool,
    features: OptionalFeatures,
}

/// Number of buffers: vertices, texture coordinates of masked ones, indices.
const BUFFERS: usize = 3;
/// Number of images: triangles, texture coordinates, materials, texels, footprints, hierarchy,
/// neighbours, edges, their ends.
const IMAGES: usize = 9;
/// Place of the edges among the images; that of their ends is the next.
const EDGES: usize = 7;

#[derive(Debug)]
struct DeviceBuffers {
    buffers: Vec<Buffer>,
    images: Vec<Image>,
}

#[derive(Clone, Copy, Debug)]
struct Sizes {
    buffers: [(u64, vk::BufferUsageFlags); BUFFERS],
    images: [ImageDesc; IMAGES],
}

/// The scene's resources in one graph.
#[derive(Clone, Copy, Debug)]
pub struct SceneIds {
    /// Position and triangle number of each vertex.
    pub vertices: BufferId,
    /// Texture coordinates of the vertices that masked triangles use.
    pub mask_uvs: BufferId,
    /// 32-bit indices.
    pub indices: BufferId,
    /// `common/triangles.glsl`.
    pub triangles: ImageId,
    /// Texture coordinates of triangles: `common/materials.glsl`.
    pub triangle_uvs: ImageId,
    /// `common/materials.glsl`.
    pub materials: ImageId,
    /// Texels of all textures: `common/textures.glsl`.
    pub texels: ImageId,
    /// RGBA8_UNORM: alphas that holes are cut by, four that lie beside each other, `common/holes.glsl`;
    /// a texel of nothing where there are no holes.
    pub footprints: ImageId,
    /// Bounding volume hierarchy of the triangles: `common/hierarchy.glsl`.
    pub hierarchy: ImageId,
    /// RGBA32_UINT: edges with the faces that meet there, `silhouettes/edges.glsl`; a texel of
    /// nothing before [`SceneBuffers::add_edges`].
    pub edges: ImageId,
    /// RGBA32F: ends of edges.
    pub points: ImageId,
    /// RGBA32_UINT: of each triangle the ones across its edges, `shaft_masks/entries.comp`.
    pub neighbours: ImageId,
}

impl SceneIds {
    /// The images that shaders look for holes in.
    pub fn mask_images(&self) -> [ImageId; 3] {
        [self.triangle_uvs, self.materials, self.footprints]
    }
}

impl SceneBuffers {
    /// Records the upload of a scene into `cmd`, all but its edges, which few techniques read
    /// ([`add_edges`](Self::add_edges)). Later commands on the same queue can use it at
    /// once; what it was copied from is freed when the frame's slot begins anew.
    pub fn upload(
        gpu: &mut Gpu,
        cmd: vk::CommandBuffer,
        scene: &Scene,
    ) -> Result<Self, UploadError> {
        let most_rows = gpu.info().limits.max_image_dimension2_d as usize;
        // The hierarchy has two nodes a triangle, which are more than its four texels.
        let most = most_rows * IMAGE_WIDTH / (2 * hierarchy::NODE_TEXELS);
        let most = most.min(hierarchy::MOST_TRIANGLES);
        let triangles = scene.triangle_count();
        if triangles > most {
            return Err(UploadError::TooManyTriangles { triangles, most });
        }
        let layout = Layout::new(scene);
        let texels = layout.texels.len().max(layout.footprints.len());
        let most = most_rows * IMAGE_WIDTH;
        if texels > most {
            return Err(UploadError::TooManyTexels { texels, most });
        }
        let mut buffers = Self::without_device(scene, &layout);
        let mut staging = Vec::new();
        let device = buffers.make(gpu, cmd, &layout, &mut staging);
        for buffer in staging {
            gpu.retire(Retired::Buffer(buffer));
        }
        buffers.device = Some(device?);
        buffers.features = gpu.optional();
        Ok(buffers)
    }

    /// A stand-in without device, for planning frames of a scene on a device with all optional
    /// features; with the scene's edges if asked for.
    pub fn plan_only(scene: &Scene, with_edges: bool) -> Self {
        let mut buffers = Self::without_device(scene, &Layout::new(scene));
        if with_edges {
            let adjacency = Adjacency::new(scene);
            buffers.sizes.set_edges(&adjacency);
            buffers.edges = Some(adjacency.edge_count);
        }
        buffers
    }

    /// Finds the edges of the scene that was uploaded and records their upload into `cmd`, for
    /// techniques that read them ([`Technique::reads_edges`](crate::shadow::Technique::reads_edges)).
    /// Does nothing if they are there.
    ///
    /// # Errors
    /// [`UploadError::TooManyEdges`] or what the device says; nothing has changed then.
    pub fn add_edges(
        &mut self,
        gpu: &mut Gpu,
        cmd: vk::CommandBuffer,
        scene: &Scene,
    ) -> Result<(), UploadError> {
        if self.edges.is_some() {
            return Ok(());
        }
        let adjacency = self.adjacency.take().unwrap_or_else(|| {
            self.edges_found += 1;
            Adjacency::new(scene)
        });
        let most = gpu.info().limits.max_image_dimension2_d as usize * IMAGE_WIDTH;
        let edges = adjacency.edges.len();
        if edges > most {
            return Err(UploadError::TooManyEdges { edges, most });
        }
        let before = self.sizes;
        self.sizes.set_edges(&adjacency);
        let mut staging = Vec::new();
        let mut made = Vec::new();
        let contents: [(&str, &[u8]); 2] = [
            ("scene edges", bytemuck::cast_slice(&adjacency.edges)),
            ("scene points", bytemuck::cast_slice(&adjacency.points)),
        ];
        let descs = &self.sizes.images[EDGES..];
        let result = record_uploads(gpu, cmd, |gpu, graph| {
            upload_images(gpu, graph, &contents, descs, &mut staging, &mut made)
        });
        for buffer in staging {
            gpu.retire(Retired::Buffer(buffer));
        }
        // What was there before, or what will not be used, may be in commands already recorded.
        match (result, &mut self.device) {
            (Ok(()), Some(device)) => {
                for (place, image) in device.images[EDGES..].iter_mut().zip(made) {
                    gpu.retire(Retired::Image(std::mem::replace(place, image)));
                }
                self.edges = Some(adjacency.edge_count);
                self.adjacency = Some(adjacency);
                Ok(())
            }
            (result, _) => {
                made.into_iter().for_each(|i| gpu.retire(Retired::Image(i)));
                self.sizes = before;
                result
            }
        }
    }

    /// Takes [`add_edges`](Self::add_edges) back, whose commands never ran.
    pub fn forget_edges(&mut self) {
        // Nobody reads the images, which hold nothing, before others are in their place.
        self.edges = None;
    }

    /// Takes over what is known of the edges of another moment of the scene, if they are the same:
    /// [`add_edges`](Self::add_edges) does not have to find them anew.
    pub fn continue_edges(&mut self, scene: &Scene, earlier: (Self, &Scene)) -> Self {
        let (mut buffers, before) = earlier;
        self.edges_found += buffers.edges_found;
        if self.adjacency.is_none() && same_topology(before, scene) {
            self.adjacency = (buffers.adjacency.take()).and_then(|known| known.posed(scene));
        }
        buffers
    }

    fn without_device(scene: &Scene, layout: &Layout) -> Self {
        let image = image_of;
        let buffer = |bytes: usize, usage: vk::BufferUsageFlags| (bytes.max(4) as u64, usage);
        let floats = vk::Format::R32G32B32A32_SFLOAT;
        let vertex = vk::BufferUsageFlags::VERTEX_BUFFER;
        let nodes = hierarchy::node_count(layout.indices.len() / 3);
        Self {
            device: None,
            sizes: Sizes {
                buffers: [
                    buffer(size_of_val(layout.vertices.as_slice()), vertex),
                    buffer(size_of_val(layout.mask_uvs.as_slice()), vertex),
                    buffer(
                        size_of_val(layout.indices.as_slice()),
                        vk::BufferUsageFlags::INDEX_BUFFER,
                    ),
                ],
                images: [
                    image(floats, layout.triangles.len()),
                    image(floats, layout.triangle_uvs.len()),
                    image(floats, layout.materials.len()),
                    image(vk::Format::R8G8B8A8_SRGB, layout.texels.len()),
                    image(vk::Format::R8G8B8A8_UNORM, layout.footprints.len()),
                    image(floats, hierarchy::NODE_TEXELS * nodes),
                    image(vk::Format::R32G32B32A32_UINT, layout.triangles.len() / 4),
                    // Edges and their ends, of which there are none yet.
                    image(vk::Format::R32G32B32A32_UINT, 0),
                    image(floats, 0),
                ],
            },
            draws: layout.draws.clone(),
            covers: layout.covers.clone(),
            bounds: scene.bounds,
            triangles: layout.indices.len() / 3,
            degenerate: layout.degenerate,
            adjacency: None,
            edges: None,
            edges_found: 0,
            masked: !layout.mask_uvs.is_empty(),
            textured: layout.triangle_uvs.len() / 2,
            shiny: scene
                .materials
                .iter()
                .any(|m| m.roughness < 1.0 || m.metallic > 0.0),
            features: OptionalFeatures::ALL,
        }
    }

    fn make(
        &self,
        gpu: &mut Gpu,
        cmd: vk::CommandBuffer,
        layout: &Layout,
        staging: &mut Vec<Buffer>,
    ) -> Result<DeviceBuffers, UploadError> {
        let mut made = DeviceBuffers {
            buffers: Vec::with_capacity(BUFFERS),
            images: Vec::with_capacity(IMAGES),
        };
        let result = self.fill(gpu, cmd, layout, staging, &mut made);
        match result {
            Ok(()) => Ok(made),
            Err(error) => {
                // Commands that use them may have been recorded.
                let DeviceBuffers { buffers, images } = made;
                buffers
                    .into_iter()
                    .for_each(|b| gpu.retire(Retired::Buffer(b)));
                images
                    .into_iter()
                    .for_each(|i| gpu.retire(Retired::Image(i)));
                Err(error)
            }
        }
    }

    fn fill(
        &self,
        gpu: &mut Gpu,
        cmd: vk::CommandBuffer,
        layout: &Layout,
        staging: &mut Vec<Buffer>,
        made: &mut DeviceBuffers,
    ) -> Result<(), UploadError> {
        let buffers: [(&str, &[u8]); BUFFERS] = [
            ("scene vertices", bytemuck::cast_slice(&layout.vertices)),
            ("scene mask uvs", bytemuck::cast_slice(&layout.mask_uvs)),
            ("scene indices", bytemuck::cast_slice(&layout.indices)),
        ];
        let neighbours = neighbours(&layout.triangles);
        let nodes = hierarchy::nodes(&layout.triangles, &neighbours);
        let images: [(&str, &[u8]); IMAGES] = [
            ("scene triangles", bytemuck::cast_slice(&layout.triangles)),
            (
                "scene triangle uvs",
                bytemuck::cast_slice(&layout.triangle_uvs),
            ),
            ("scene materials", bytemuck::cast_slice(&layout.materials)),
            ("scene texels", bytemuck::cast_slice(&layout.texels)),
            ("scene footprints", bytemuck::cast_slice(&layout.footprints)),
            ("scene hierarchy", bytemuck::cast_slice(&nodes)),
            ("scene neighbours", bytemuck::cast_slice(&neighbours)),
            ("scene edges", &[]),
            ("scene points", &[]),
        ];
        record_uploads(gpu, cmd, |gpu, graph| {
            for ((name, bytes), (size, usage)) in buffers.into_iter().zip(self.sizes.buffers) {
                let usage = usage | vk::BufferUsageFlags::TRANSFER_DST;
                let buffer = gpu.create_buffer(name, size, usage, MemoryLocation::GpuOnly)?;
                let uploaded = upload_buffer(gpu, graph, &buffer, bytes, staging);
                made.buffers.push(buffer);
                uploaded?;
            }
            upload_images(
                gpu,
                graph,
                &images,
                &self.sizes.images,
                staging,
                &mut made.images,
            )
        })
    }

    /// Destroys everything; no frame may still use it.
    pub fn destroy(self, gpu: &mut Gpu) {
        if let Some(device) = self.device {
            device
                .buffers
                .into_iter()
                .for_each(|b| gpu.destroy_buffer(b));
            device.images.into_iter().for_each(|i| gpu.destroy_image(i));
        }
    }

    /// Gives everything back once no frame can still use it.
    pub fn retire(self, gpu: &mut Gpu) {
        if let Some(device) = self.device {
            let buffers = device.buffers.into_iter().map(Retired::Buffer);
            let images = device.images.into_iter().map(Retired::Image);
            buffers.chain(images).for_each(|it| gpu.retire(it));
        }
    }

    /// Features of the device that we could do without.
    pub fn features(&self) -> OptionalFeatures {
        self.features
    }

    /// Chunks of neighbouring triangles, masked ones first.
    pub fn draws(&self) -> &[Draw] {
        &self.draws
    }

    /// The largest flat parts that hide what lies behind them, largest first.
    pub fn covers(&self) -> &[Cover] {
        &self.covers
    }

    /// Box around all vertices, scene space.
    pub fn bounds(&self) -> Aabb {
        self.bounds
    }

    /// Number of triangles with area.
    pub fn triangle_count(&self) -> usize {
        self.triangles
    }

    /// Number of nodes of the hierarchy.
    pub fn node_count(&self) -> usize {
        hierarchy::node_count(self.triangles)
    }

    /// Whether any triangle has holes.
    pub fn has_masks(&self) -> bool {
        self.masked
    }

    /// Number of triangles without area or cut out as a whole, which are left out.
    pub fn degenerate_count(&self) -> usize {
        self.degenerate
    }

    /// Whether the edges are there: [`add_edges`](Self::add_edges).
    pub fn has_edges(&self) -> bool {
        self.edges.is_some()
    }

    /// Number of edges at which triangles meet or end; 0 before [`add_edges`](Self::add_edges).
    pub fn edge_count(&self) -> usize {
        self.edges.unwrap_or(0)
    }

    /// How often edges were found on the host, in earlier moments of the scene too
    /// ([`continue_edges`](Self::continue_edges)).
    pub fn edges_found(&self) -> u64 {
        self.edges_found
    }

    /// Number of triangles with texture coordinates, which come before all others.
    pub fn textured_triangle_count(&self) -> usize {
        self.textured
    }

    /// Whether any surface reflects light more to one side than to others.
    pub fn is_shiny(&self) -> bool {
        self.shiny
    }

    /// Vertex input of positions at location 0 and triangle numbers at location 1.
    pub fn id_stream(&self) -> crate::gpu::VertexStream {
        let offset = core::mem::offset_of!(Vertex, triangle) as u32;
        crate::gpu::VertexStream {
            stride: size_of::<Vertex>() as u32,
            attributes: vec![
                (0, vk::Format::R32G32B32_SFLOAT, 0),
                (1, vk::Format::R32_UINT, offset),
            ],
            per_instance: false,
        }
    }

    /// Vertex input of positions at location 0.
    pub fn position_stream(&self) -> crate::gpu::VertexStream {
        let mut stream = self.id_stream();
        stream.attributes.truncate(1);
        stream
    }

    /// Vertex input of texture coordinates at location 2.
    pub fn mask_stream(&self) -> crate::gpu::VertexStream {
        crate::gpu::VertexStream {
            stride: size_of::<[f32; 2]>() as u32,
            attributes: vec![(2, vk::Format::R32G32_SFLOAT, 0)],
            per_instance: false,
        }
    }

    /// Brings the scene's resources into a graph.
    pub fn import(&self, graph: &mut Graph<'_>) -> SceneIds {
        let device = self.device.as_ref();
        let mut buffer = |name: &str, index: usize| {
            let (size, usage) = self.sizes.buffers[index];
            let raw = device.and_then(|device| device.buffers.get(index));
            let host = HostBuffer {
                buffer: raw.map_or_else(Default::default, |buffer| buffer.raw),
                desc: BufferDesc { size },
                usage,
                enter: BufferState::IDLE,
                leave: BufferState::IDLE,
            };
            graph.import_buffer(name.to_string(), host)
        };
        let vertices = buffer("scene.vertices", 0);
        let mask_uvs = buffer("scene.mask_uvs", 1);
        let indices = buffer("scene.indices", 2);
        let mut image = |name: &str, index: usize| {
            let raw = device.and_then(|device| device.images.get(index));
            let host = HostImage {
                image: raw.map_or_else(Default::default, |image| image.raw),
                desc: self.sizes.images[index],
                usage: super::uploads::usage_of(&self.sizes.images[index]),
                enter: STATIC,
                leave: STATIC,
            };
            graph.import_image(name.to_string(), host)
        };
        SceneIds {
            vertices,
            mask_uvs,
            indices,
            triangles: image("scene.triangles", 0),
            triangle_uvs: image("scene.triangle_uvs", 1),
            materials: image("scene.materials", 2),
            texels: image("scene.texels", 3),
            footprints: image("scene.footprints", 4),
            hierarchy: image("scene.hierarchy", 5),
            neighbours: image("scene.neighbours", 6),
            edges: image("scene.edges", EDGES),
            points: image("scene.points", EDGES + 1),
        }
    }
}

impl Sizes {
    fn set_edges(&mut self, adjacency: &Adjacency) {
        self.images[EDGES] = image_of(self.images[EDGES].format, adjacency.edges.len());
        self.images[EDGES + 1] = image_of(self.images[EDGES + 1].format, adjacency.points.len());
    }
}

fn image_of(format: vk::Format, texels: usize) -> ImageDesc {
    let rows = texels.div_ceil(IMAGE_WIDTH).max(1) as u32;
    // Nothing to hold: a single texel, so that there is something to bind.
    let width = if texels == 0 { 1 } else { IMAGE_WIDTH as u32 };
    ImageDesc::new(format, width, rows)
}
