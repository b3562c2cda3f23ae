//! The scene on the device: vertices and indices to draw, triangles and materials to look up.

use super::scene_layout::{Layout, Vertex};
use crate::gpu::{Buffer, Gpu, GpuError, Image, ImageSpec, MemoryLocation, Retired};
use crate::graph::{
    Access, BufferDesc, BufferId, BufferState, FrameCache, Graph, GraphError, HostBuffer,
    HostImage, ImageDesc, ImageId, ImagePart, ImageState, PassKind,
};
use crate::scene::{Aabb, Scene};
use ash::vk;

/// Width in texels of the triangle and material images: `TRIANGLE_IMAGE_WIDTH` in
/// `common/triangles.glsl`.
const IMAGE_WIDTH: usize = 4096;

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
}

/// The scene's buffers and images on the device. Static: uploaded once.
#[derive(Debug)]
pub struct SceneBuffers {
    /// None in a stand-in that only plans ([`SceneBuffers::plan_only`]).
    device: Option<DeviceBuffers>,
    sizes: Sizes,
    draws: Vec<Draw>,
    bounds: Aabb,
    triangles: usize,
    degenerate: usize,
}

#[derive(Debug)]
struct DeviceBuffers {
    vertices: Buffer,
    indices: Buffer,
    triangles: Image,
    materials: Image,
}

#[derive(Clone, Copy, Debug)]
struct Sizes {
    vertex_bytes: u64,
    index_bytes: u64,
    triangles: ImageDesc,
    materials: ImageDesc,
}

/// The scene's resources in one graph.
#[derive(Clone, Copy, Debug)]
pub struct SceneIds {
    /// Position and triangle number of each vertex.
    pub vertices: BufferId,
    /// 32-bit indices.
    pub indices: BufferId,
    /// `common/triangles.glsl`.
    pub triangles: ImageId,
    /// Linear base colour of each material.
    pub materials: ImageId,
}

impl SceneBuffers {
    /// Records the upload of a scene into `cmd`. Later commands on the same queue can use it at
    /// once; what it was copied from is freed when the frame's slot begins anew.
    pub fn upload(
        gpu: &mut Gpu,
        cmd: vk::CommandBuffer,
        scene: &Scene,
    ) -> Result<Self, UploadError> {
        let most_rows = gpu.info().limits.max_image_dimension2_d as usize;
        let most = most_rows * IMAGE_WIDTH / 4;
        let triangles = scene.triangle_count();
        if triangles > most {
            return Err(UploadError::TooManyTriangles { triangles, most });
        }
        let layout = Layout::new(scene);
        let mut buffers = Self::without_device(scene, &layout);
        let mut staging = Vec::new();
        let device = buffers.make(gpu, cmd, &layout, &mut staging);
        for buffer in staging {
            gpu.retire(Retired::Buffer(buffer));
        }
        buffers.device = Some(device?);
        Ok(buffers)
    }

    /// A stand-in without device, for planning frames of a scene.
    pub fn plan_only(scene: &Scene) -> Self {
        Self::without_device(scene, &Layout::new(scene))
    }

    fn without_device(scene: &Scene, layout: &Layout) -> Self {
        let image = |texels: usize| {
            let rows = texels.div_ceil(IMAGE_WIDTH).max(1) as u32;
            let format = vk::Format::R32G32B32A32_SFLOAT;
            ImageDesc::new(format, IMAGE_WIDTH as u32, rows)
        };
        Self {
            device: None,
            sizes: Sizes {
                vertex_bytes: (size_of::<Vertex>() * layout.vertices.len()).max(4) as u64,
                index_bytes: (4 * layout.indices.len()).max(4) as u64,
                triangles: image(layout.triangles.len()),
                materials: image(layout.materials.len()),
            },
            draws: layout.draws.clone(),
            bounds: scene.bounds,
            triangles: layout.indices.len() / 3,
            degenerate: layout.degenerate,
        }
    }

    fn make(
        &self,
        gpu: &mut Gpu,
        cmd: vk::CommandBuffer,
        layout: &Layout,
        staging: &mut Vec<Buffer>,
    ) -> Result<DeviceBuffers, UploadError> {
        let sizes = self.sizes;
        let target = vk::BufferUsageFlags::TRANSFER_DST;
        let vertex = vk::BufferUsageFlags::VERTEX_BUFFER | target;
        let index = vk::BufferUsageFlags::INDEX_BUFFER | target;
        let only = MemoryLocation::GpuOnly;
        let sampled = vk::ImageUsageFlags::SAMPLED | vk::ImageUsageFlags::TRANSFER_DST;
        let spec =
            |desc: ImageDesc| ImageSpec::new_2d(desc.format, desc.width, desc.height, sampled);

        let mut made = Made::default();
        let result = (|| {
            made.buffers.push(gpu.create_buffer(
                "scene vertices",
                sizes.vertex_bytes,
                vertex,
                only,
            )?);
            made.buffers.push(gpu.create_buffer(
                "scene indices",
                sizes.index_bytes,
                index,
                only,
            )?);
            made.images
                .push(gpu.create_image("scene triangles", &spec(sizes.triangles))?);
            made.images
                .push(gpu.create_image("scene materials", &spec(sizes.materials))?);
            let mut graph = Graph::new();
            for (buffer, bytes) in made.buffers.iter().zip([
                bytemuck::cast_slice(&layout.vertices),
                bytemuck::cast_slice(&layout.indices),
            ]) {
                upload_buffer(gpu, &mut graph, buffer, bytes, staging)?;
            }
            for (image, (desc, texels)) in made.images.iter().zip([
                (sizes.triangles, &layout.triangles),
                (sizes.materials, &layout.materials),
            ]) {
                upload_image(gpu, &mut graph, image, desc, texels, staging)?;
            }
            let compiled = graph.compile(gpu)?;
            let mut cache = FrameCache::new();
            let recorded = compiled.record(gpu, &mut cache, cmd);
            cache.destroy(gpu);
            recorded?;
            Ok(())
        })();
        if let Err(error) = result {
            // Commands that use them may have been recorded.
            made.buffers
                .into_iter()
                .for_each(|b| gpu.retire(Retired::Buffer(b)));
            made.images
                .into_iter()
                .for_each(|i| gpu.retire(Retired::Image(i)));
            return Err(error);
        }
        let mut buffers = made.buffers.into_iter();
        let mut images = made.images.into_iter();
        match (buffers.next(), buffers.next(), images.next(), images.next()) {
            (Some(vertices), Some(indices), Some(triangles), Some(materials)) => {
                Ok(DeviceBuffers {
                    vertices,
                    indices,
                    triangles,
                    materials,
                })
            }
            _ => unreachable!("two buffers and two images were made above"),
        }
    }

    /// Destroys everything; no frame may still use it.
    pub fn destroy(self, gpu: &mut Gpu) {
        if let Some(device) = self.device {
            gpu.destroy_buffer(device.vertices);
            gpu.destroy_buffer(device.indices);
            gpu.destroy_image(device.triangles);
            gpu.destroy_image(device.materials);
        }
    }

    /// Ranges to draw, one for each primitive with triangles.
    pub fn draws(&self) -> &[Draw] {
        &self.draws
    }

    /// Box around all vertices, scene space.
    pub fn bounds(&self) -> Aabb {
        self.bounds
    }

    /// Number of triangles with area.
    pub fn triangle_count(&self) -> usize {
        self.triangles
    }

    /// Number of triangles without area, which are left out.
    pub fn degenerate_count(&self) -> usize {
        self.degenerate
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

    /// Brings the scene's resources into a graph.
    pub fn import(&self, graph: &mut Graph<'_>) -> SceneIds {
        let device = self.device.as_ref();
        let buffer = |raw: Option<vk::Buffer>, size: u64, usage: vk::BufferUsageFlags| HostBuffer {
            buffer: raw.unwrap_or_default(),
            desc: BufferDesc { size },
            usage,
            enter: BufferState::IDLE,
            leave: BufferState::IDLE,
        };
        let image = |raw: Option<vk::Image>, desc: ImageDesc| HostImage {
            image: raw.unwrap_or_default(),
            desc,
            usage: vk::ImageUsageFlags::SAMPLED | vk::ImageUsageFlags::TRANSFER_DST,
            enter: STATIC,
            leave: STATIC,
        };
        let vertices = buffer(
            device.map(|d| d.vertices.raw),
            self.sizes.vertex_bytes,
            vk::BufferUsageFlags::VERTEX_BUFFER,
        );
        let indices = buffer(
            device.map(|d| d.indices.raw),
            self.sizes.index_bytes,
            vk::BufferUsageFlags::INDEX_BUFFER,
        );
        let triangles = image(device.map(|d| d.triangles.raw), self.sizes.triangles);
        let materials = image(device.map(|d| d.materials.raw), self.sizes.materials);
        SceneIds {
            vertices: graph.import_buffer("scene.vertices", vertices),
            indices: graph.import_buffer("scene.indices", indices),
            triangles: graph.import_image("scene.triangles", triangles),
            materials: graph.import_image("scene.materials", materials),
        }
    }
}

/// State of the scene's images between frames: the upload made them visible to every stage that
/// reads them, and nobody writes them, so nobody waits.
const STATIC: ImageState = ImageState {
    layout: vk::ImageLayout::READ_ONLY_OPTIMAL,
    stages: vk::PipelineStageFlags2::NONE,
    access: vk::AccessFlags2::NONE,
};

/// What an upload has made so far.
#[derive(Default)]
struct Made {
    buffers: Vec<Buffer>,
    images: Vec<Image>,
}

fn stage(
    gpu: &mut Gpu,
    graph: &mut Graph<'_>,
    bytes: &[u8],
    staging: &mut Vec<Buffer>,
) -> Result<Option<BufferId>, GpuError> {
    if bytes.is_empty() {
        return Ok(None);
    }
    let size = bytes.len() as u64;
    let usage = vk::BufferUsageFlags::TRANSFER_SRC;
    let mut buffer = gpu.create_buffer("upload", size, usage, MemoryLocation::CpuToGpu)?;
    let mapped = buffer
        .mapped_mut()
        .map(|target| target.copy_from_slice(bytes));
    let raw = buffer.raw;
    staging.push(buffer);
    if mapped.is_none() {
        return Err(GpuError::Invalid {
            object: "upload".to_string(),
            problem: "its memory is not visible to the host".to_string(),
        });
    }
    let host = HostBuffer {
        buffer: raw,
        desc: BufferDesc { size },
        usage,
        enter: BufferState::IDLE,
        leave: BufferState::IDLE,
    };
    Ok(Some(graph.import_buffer("upload", host)))
}

fn upload_buffer(
    gpu: &mut Gpu,
    graph: &mut Graph<'_>,
    target: &Buffer,
    bytes: &[u8],
    staging: &mut Vec<Buffer>,
) -> Result<(), GpuError> {
    let size = bytes.len() as u64;
    let Some(source) = stage(gpu, graph, bytes, staging)? else {
        return Ok(());
    };
    let host = HostBuffer {
        buffer: target.raw,
        desc: BufferDesc { size: target.size },
        usage: target.usage,
        enter: BufferState::IDLE,
        leave: BufferState {
            stages: vk::PipelineStageFlags2::VERTEX_INPUT,
            access: vk::AccessFlags2::from_raw(
                vk::AccessFlags2::VERTEX_ATTRIBUTE_READ.as_raw()
                    | vk::AccessFlags2::INDEX_READ.as_raw(),
            ),
        },
    };
    let target = graph.import_buffer("scene", host);
    let mut pass = graph.pass("upload", PassKind::Transfer);
    pass.read(source, Access::CopyRead);
    let target = pass.write(target, Access::CopyWrite);
    pass.record(move |ctx| ctx.copy_buffer(source, 0, target, 0, size));
    Ok(())
}

fn upload_image(
    gpu: &mut Gpu,
    graph: &mut Graph<'_>,
    target: &Image,
    desc: ImageDesc,
    texels: &[[f32; 4]],
    staging: &mut Vec<Buffer>,
) -> Result<(), GpuError> {
    let mut padded = texels.to_vec();
    padded.resize((desc.width * desc.height) as usize, [0.0; 4]);
    let Some(source) = stage(gpu, graph, bytemuck::cast_slice(&padded), staging)? else {
        return Ok(());
    };
    let host = HostImage {
        image: target.raw,
        desc,
        usage: target.spec.usage,
        enter: ImageState::UNDEFINED,
        leave: ImageState {
            stages: vk::PipelineStageFlags2::from_raw(
                vk::PipelineStageFlags2::FRAGMENT_SHADER.as_raw()
                    | vk::PipelineStageFlags2::COMPUTE_SHADER.as_raw(),
            ),
            access: vk::AccessFlags2::SHADER_SAMPLED_READ,
            ..STATIC
        },
    };
    let target = graph.import_image("scene", host);
    let mut pass = graph.pass("upload", PassKind::Transfer);
    pass.read(source, Access::CopyRead);
    let target = pass.overwrite(target, Access::CopyWrite);
    let part = ImagePart::whole(&desc);
    pass.record(move |ctx| ctx.copy_buffer_to_image(source, 0, target, part));
    Ok(())
}
