//! The scene on the device: vertices and indices to draw, triangles and materials to look up.

use crate::gpu::{Buffer, Gpu, GpuError, Image, ImageSpec, MemoryLocation, Retired};
use crate::graph::{
    Access, BufferDesc, BufferId, BufferState, FrameCache, Graph, GraphError, HostBuffer,
    HostImage, ImageDesc, ImageId, ImagePart, ImageState, PassKind,
};
use crate::scene::{Aabb, Primitive, Scene};
use ash::vk;
use bytemuck::{Pod, Zeroable};
use glam::{Vec2, Vec3};

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

/// A vertex of `raster/ids.vert`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
struct Vertex {
    position: [f32; 3],
    /// The triangle whose first vertex this is; of no meaning in other places.
    triangle: u32,
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

/// A scene laid out for the device, before it is there.
#[derive(Debug, Default)]
struct Layout {
    vertices: Vec<Vertex>,
    indices: Vec<u32>,
    /// Rows of [`IMAGE_WIDTH`] texels.
    triangles: Vec<[f32; 4]>,
    materials: Vec<[f32; 4]>,
    draws: Vec<Draw>,
    /// Triangles without area, which no ray meets and no pixel shows.
    degenerate: usize,
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

impl Layout {
    fn new(scene: &Scene) -> Self {
        let mut layout = Self::default();
        for primitive in &scene.primitives {
            layout.add(primitive);
        }
        layout.materials = scene
            .materials
            .iter()
            .map(|material| material.base_color.to_array())
            .collect();
        layout
    }

    fn add(&mut self, primitive: &Primitive) {
        let first_vertex = self.vertices.len();
        let first_index = self.indices.len();
        let vertex = |position: &Vec3| Vertex {
            position: position.to_array(),
            triangle: u32::MAX,
        };
        self.vertices.extend(primitive.positions.iter().map(vertex));
        let mut bounds = Aabb::EMPTY;
        for corners in primitive.indices.chunks_exact(3) {
            let corners = [corners[0], corners[1], corners[2]].map(|corner| corner as usize);
            let points = corners.map(|corner| primitive.positions[corner]);
            let Some(normal) = unit_normal(points) else {
                self.degenerate += 1;
                continue;
            };
            points.iter().for_each(|point| bounds.insert(*point));
            let triangle = (self.indices.len() / 3) as u32;
            let indices = self.own_first_vertex(first_vertex, corners, points[0], triangle);
            self.indices.extend(indices);
            for (corner, point) in corners.iter().zip(points) {
                let normal = pack_corner_normal(primitive.normals[*corner]);
                self.triangles.push(point.extend(normal).to_array());
            }
            let material = primitive.material as f32;
            self.triangles.push(normal.extend(material).to_array());
        }
        let index_count = (self.indices.len() - first_index) as u32;
        if index_count > 0 {
            self.draws.push(Draw {
                first_index: first_index as u32,
                index_count,
                bounds,
            });
        }
    }

    /// Indices of a triangle, turned so that its first vertex is no other triangle's first vertex:
    /// flat outputs take their value from there. Adds a vertex where all three are taken, so a
    /// mesh ends up with about as many vertices as triangles instead of three times as many.
    fn own_first_vertex(
        &mut self,
        base: usize,
        corners: [usize; 3],
        point: Vec3,
        triangle: u32,
    ) -> [u32; 3] {
        for turn in 0..3 {
            let [a, b, c] = [0, 1, 2].map(|i| base + corners[(i + turn) % 3]);
            if self.vertices[a].triangle == u32::MAX {
                self.vertices[a].triangle = triangle;
                return [a, b, c].map(|vertex| vertex as u32);
            }
        }
        self.vertices.push(Vertex {
            position: point.to_array(),
            triangle,
        });
        [
            self.vertices.len() - 1,
            base + corners[1],
            base + corners[2],
        ]
        .map(|v| v as u32)
    }
}

/// Unit normal of a triangle on its counter-clockwise side; `None` without area.
fn unit_normal([a, b, c]: [Vec3; 3]) -> Option<Vec3> {
    let [a, b, c] = [a, b, c].map(|point| point.as_dvec3());
    let normal = (b - a).cross(c - a);
    // In f64, products of f32 differences cannot underflow to nothing unless there is no area.
    normal.try_normalize().map(|normal| normal.as_vec3())
}

/// Twin of `unpack_corner_normal` in `common/triangles.glsl`.
fn pack_corner_normal(normal: Vec3) -> f32 {
    let sum = normal.x.abs() + normal.y.abs() + normal.z.abs();
    let mut p = Vec2::new(normal.x, normal.y) / sum.max(f32::MIN_POSITIVE);
    if normal.z < 0.0 {
        let sign = |v: f32| if v >= 0.0 { 1.0 } else { -1.0 };
        p = Vec2::new((1.0 - p.y.abs()) * sign(p.x), (1.0 - p.x.abs()) * sign(p.y));
    }
    let cell = |v: f32| ((v + 1.0) * 2047.5).round().clamp(0.0, 4095.0);
    cell(p.x) + 4096.0 * cell(p.y)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Material;

    fn grid(n: u32) -> Primitive {
        let positions: Vec<Vec3> = (0..=n)
            .flat_map(|y| (0..=n).map(move |x| Vec3::new(x as f32, 0.0, y as f32)))
            .collect();
        let corner = |x: u32, y: u32| y * (n + 1) + x;
        let quads = (0..n).flat_map(|y| (0..n).map(move |x| (x, y)));
        let indices = quads.flat_map(|(x, y)| {
            let [a, b] = [corner(x, y), corner(x + 1, y)];
            let [c, d] = [corner(x, y + 1), corner(x + 1, y + 1)];
            [a, c, b, b, c, d]
        });
        Primitive {
            normals: vec![Vec3::Y; positions.len()],
            indices: indices.collect(),
            positions,
            ..Primitive::default()
        }
    }

    #[test]
    fn every_triangle_has_a_first_vertex_of_its_own() {
        let mut primitive = grid(20);
        primitive.indices.extend([3, 3, 7]);
        let positions = primitive.positions.clone();
        let original = primitive.indices.clone();
        let scene = Scene {
            primitives: vec![primitive],
            materials: vec![Material::default()],
            ..Scene::default()
        };
        let layout = Layout::new(&scene);
        assert_eq!(layout.degenerate, 1);
        assert_eq!(layout.indices.len(), 2400);
        assert!(
            layout.vertices.len() < 2 * positions.len(),
            "few vertices are added"
        );
        for (number, triangle) in layout.indices.chunks_exact(3).enumerate() {
            assert_eq!(
                layout.vertices[triangle[0] as usize].triangle,
                number as u32
            );
            // The same corners in the same sense of rotation.
            let points = [0, 1, 2].map(|i| layout.vertices[triangle[i] as usize].position);
            let wanted = [0, 1, 2].map(|i| positions[original[3 * number + i] as usize].to_array());
            let turned = (0..3).any(|turn| (0..3).all(|i| points[i] == wanted[(i + turn) % 3]));
            assert!(turned);
        }
    }

    #[test]
    fn corner_normals_are_whole_numbers_that_floats_hold() {
        for normal in [Vec3::X, Vec3::NEG_Z, Vec3::new(0.6, -0.48, -0.64)] {
            let packed = pack_corner_normal(normal);
            assert_eq!(packed, packed.floor());
            assert!(packed < 16_777_216.0);
        }
    }
}
