//! Commands for the passes of random graphs: real work that touches every declared use with the
//! declared access, all of it, and checks what it reads.

use std::cell::RefCell;

use antumbra::ash::vk;
use antumbra::gpu::{
    Buffer, ComputePipelineDesc, DepthState, Gpu, GpuError, GraphicsPipelineDesc, MemoryLocation,
    SamplerDesc, VertexStream,
};
use antumbra::graph::{
    Access, Bind, BufferDesc, BufferPart, BufferState, Graph, HostBuffer, ImageDesc, ImagePart,
    PassContext, PassKind, Stage,
};

use crate::random_graph::{Used, texel};
use crate::shaders::{self, Resource, ShaderUse, word};

const TAGS: usize = 16;
const BUFFER_BYTES: u64 = 16384;
const IMAGE_BYTES: u64 = 32 * 32 * 4 * 3;
const SINK_BYTES: u64 = 4 << 20;
/// Bytes of a verdict: the least alignment of a storage buffer's part.
const VERDICT_BYTES: u64 = 256;
const VERDICTS: u64 = 64;

/// What a copied region must hold.
#[derive(Clone, Copy)]
enum Expected {
    Texels(usize),
    Words(usize),
}

/// The host's buffers that passes copy from and into; each use has a region of its own, so that
/// nothing but the graph's barriers orders the graph's own accesses.
pub struct World {
    staging: Buffer,
    sink: Buffer,
    verdicts: Buffer,
    copied: RefCell<Vec<(u64, u64, Expected)>>,
    /// Number of verdict and tag of what it is about.
    judged: RefCell<Vec<(u64, usize)>>,
}

impl World {
    pub fn new(gpu: &mut Gpu) -> Self {
        let (from, into) = (
            vk::BufferUsageFlags::TRANSFER_SRC,
            vk::BufferUsageFlags::TRANSFER_DST,
        );
        let bytes = TAGS as u64 * (BUFFER_BYTES + IMAGE_BYTES);
        let upload = MemoryLocation::CpuToGpu;
        let mut staging = gpu.create_buffer("staging", bytes, from, upload).unwrap();
        let contents: Vec<u32> = (0..TAGS)
            .flat_map(|tag| {
                let words = (0..BUFFER_BYTES as usize / 4).map(move |i| word(i, tag));
                words.chain((0..IMAGE_BYTES / 4).map(move |_| texel(tag).to_bits()))
            })
            .collect();
        let mapped = staging.mapped_mut().unwrap();
        mapped[..contents.len() * 4].copy_from_slice(bytemuck::cast_slice(&contents));
        let back = MemoryLocation::GpuToCpu;
        let sink = gpu.create_buffer("sink", SINK_BYTES, into, back).unwrap();
        let storage = vk::BufferUsageFlags::STORAGE_BUFFER;
        let bytes = VERDICTS * VERDICT_BYTES;
        let verdicts = gpu.create_buffer("verdicts", bytes, storage, back).unwrap();
        Self {
            staging,
            sink,
            verdicts,
            copied: RefCell::default(),
            judged: RefCell::default(),
        }
    }

    pub fn destroy(self, gpu: &mut Gpu) {
        for buffer in [self.staging, self.sink, self.verdicts] {
            gpu.destroy_buffer(buffer);
        }
    }

    /// Forgets the last frame.
    pub fn begin_frame(&mut self) {
        self.copied.borrow_mut().clear();
        self.judged.borrow_mut().clear();
        for buffer in [&mut self.sink, &mut self.verdicts] {
            buffer.mapped_mut().unwrap().fill(0xff);
        }
    }

    /// Lets the host see what was copied. The verdicts are the graph's affair.
    pub fn end_frame(&self, gpu: &Gpu, cmd: vk::CommandBuffer) {
        let barriers = [vk::MemoryBarrier2::default()
            .src_stage_mask(vk::PipelineStageFlags2::COPY)
            .src_access_mask(vk::AccessFlags2::TRANSFER_WRITE)
            .dst_stage_mask(vk::PipelineStageFlags2::HOST)
            .dst_access_mask(vk::AccessFlags2::HOST_READ)];
        let info = vk::DependencyInfo::default().memory_barriers(&barriers);
        // SAFETY: recording, outside rendering.
        unsafe { gpu.device().cmd_pipeline_barrier2(cmd, &info) };
    }

    /// Compares what the finished frame left with what it must have left; returns how many results
    /// it looked at.
    #[track_caller]
    pub fn check(&self, what: &str) -> usize {
        let sink: &[u32] = bytemuck::cast_slice(self.sink.mapped().unwrap());
        for (offset, bytes, expected) in self.copied.borrow().iter() {
            for i in 0..*bytes as usize / 4 {
                let wanted = match expected {
                    Expected::Texels(tag) => texel(*tag).to_bits(),
                    Expected::Words(tag) => word(i, *tag),
                };
                let found = sink[*offset as usize / 4 + i];
                assert_eq!(found, wanted, "{what}: word {i} of a copy is {found:#x}");
            }
        }
        let verdicts: &[u32] = bytemuck::cast_slice(self.verdicts.mapped().unwrap());
        for (number, tag) in self.judged.borrow().iter() {
            for i in 0..VERDICT_BYTES as usize / 4 {
                let found = verdicts[(*number * VERDICT_BYTES) as usize / 4 + i];
                assert_eq!(
                    found,
                    word(i, *tag),
                    "{what}: verdict {number}: wrong contents"
                );
            }
        }
        self.copied.borrow().len() + self.judged.borrow().len()
    }

    /// A region of the sink.
    fn sink_region(&self, bytes: u64, expected: Expected) -> u64 {
        let mut copied = self.copied.borrow_mut();
        let offset = copied.last().map_or(0, |(offset, bytes, _)| offset + bytes);
        assert!(offset + bytes <= SINK_BYTES, "the sink is too small");
        copied.push((offset, bytes, expected));
        offset
    }

    /// The staging region with a buffer's contents.
    fn words_at(tag: usize) -> u64 {
        tag as u64 * (BUFFER_BYTES + IMAGE_BYTES)
    }

    /// The staging region with an image's contents.
    fn texels_at(tag: usize) -> u64 {
        Self::words_at(tag) + BUFFER_BYTES
    }

    /// Adds passes that read everything kept and write a verdict on it.
    pub fn judge<'f>(&'f self, graph: &mut Graph<'f>, kept: &[Used]) {
        let mut groups: Vec<Vec<Used>> = Vec::new();
        for used in kept {
            match groups.last_mut() {
                Some(group) if group.len() < 8 && resource(&group[0]) == resource(used) => {
                    group.push(*used);
                }
                _ => groups.push(vec![*used]),
            }
        }
        let host = HostBuffer {
            buffer: self.verdicts.raw,
            desc: BufferDesc {
                size: VERDICTS * VERDICT_BYTES,
            },
            usage: self.verdicts.usage,
            enter: BufferState::IDLE,
            leave: BufferState::HOST_READ,
        };
        let mut verdicts = graph.import_buffer("verdicts", host);
        for (number, mut uses) in groups.into_iter().enumerate() {
            let mut pass = graph.pass(format!("check {number}"), PassKind::Compute);
            for used in &uses {
                match *used {
                    Used::Image {
                        id, part, access, ..
                    } => pass.read_part(id, part, access),
                    Used::Buffer {
                        id, part, access, ..
                    } => pass.read_part(id, part, access),
                }
            }
            let part = BufferPart {
                offset: number as u64 * VERDICT_BYTES,
                size: VERDICT_BYTES,
            };
            let access = Access::StorageWrite(Stage::Compute);
            verdicts = pass.overwrite_part(verdicts, part, access);
            let tag = tag(&uses[0]);
            uses.push(Used::Buffer {
                id: verdicts,
                part,
                access,
                tag,
            });
            pass.record(move |context| {
                self.judged.borrow_mut().push((number as u64, tag));
                self.work(context, PassKind::Compute, &uses)
            });
        }
    }

    /// Records a pass.
    pub fn work(
        &self,
        context: &mut PassContext<'_>,
        kind: PassKind,
        uses: &[Used],
    ) -> Result<(), GpuError> {
        match kind {
            PassKind::Compute => compute(context, uses),
            PassKind::Graphics => graphics(context, uses),
            PassKind::Transfer => {
                let mut clears = 0;
                uses.iter().try_for_each(|used| {
                    clears += usize::from(matches!(
                        used,
                        Used::Image {
                            access: Access::Clear,
                            ..
                        }
                    ));
                    self.transfer(context, used, clears == 1)
                })
            }
        }
    }

    fn transfer(
        &self,
        context: &mut PassContext<'_>,
        used: &Used,
        first_clear: bool,
    ) -> Result<(), GpuError> {
        let cmd = context.command_buffer();
        match *used {
            Used::Image {
                id,
                desc,
                part,
                access,
                tag,
            } => {
                let image = context.image(id)?;
                let range = part.subresource_range(desc.aspect());
                let layout = access.info().layout.unwrap();
                for mip in part.base_mip..part.base_mip + part.mips {
                    let (region, bytes) = copy_region(&desc, &part, mip);
                    let device = context.gpu().device();
                    match access {
                        Access::CopyRead => {
                            let offset = self.sink_region(bytes, Expected::Texels(tag));
                            let regions = [region.buffer_offset(offset)];
                            let sink = self.sink.raw;
                            // SAFETY: recording; image and buffer are live and large enough.
                            unsafe {
                                device.cmd_copy_image_to_buffer(cmd, image, layout, sink, &regions);
                            }
                        }
                        Access::CopyWrite => {
                            let regions = [region.buffer_offset(Self::texels_at(tag))];
                            let staging = self.staging.raw;
                            // SAFETY: as above.
                            unsafe {
                                device.cmd_copy_buffer_to_image(
                                    cmd, staging, image, layout, &regions,
                                );
                            }
                        }
                        _ => {}
                    }
                }
                if access == Access::Clear {
                    let value = texel(tag);
                    let device = context.gpu().device();
                    if desc.aspect() == vk::ImageAspectFlags::DEPTH {
                        let clear = vk::ClearDepthStencilValue {
                            depth: value,
                            stencil: 0,
                        };
                        // SAFETY: recording; the image is live.
                        unsafe {
                            device.cmd_clear_depth_stencil_image(
                                cmd,
                                image,
                                layout,
                                &clear,
                                &[range],
                            );
                        }
                    } else if first_clear {
                        context.clear_image(id, [value; 4])?;
                    } else {
                        let clear = vk::ClearColorValue {
                            float32: [value; 4],
                        };
                        // SAFETY: recording; the image is live.
                        unsafe {
                            device.cmd_clear_color_image(cmd, image, layout, &clear, &[range]);
                        }
                    }
                }
            }
            Used::Buffer {
                id,
                part,
                access,
                tag,
            } => {
                let buffer = context.buffer(id)?;
                let copy = |src_offset, dst_offset| {
                    [vk::BufferCopy {
                        src_offset,
                        dst_offset,
                        size: part.size,
                    }]
                };
                let (from, to, regions) = match access {
                    Access::CopyRead => {
                        let offset = self.sink_region(part.size, Expected::Words(tag));
                        (buffer, self.sink.raw, copy(part.offset, offset))
                    }
                    Access::CopyWrite => {
                        let regions = copy(Self::words_at(tag), part.offset);
                        (self.staging.raw, buffer, regions)
                    }
                    _ => {
                        let words = (0..part.size as usize / 4).map(|i| word(i, tag));
                        let words: Vec<u32> = words.collect();
                        let bytes = bytemuck::cast_slice(&words);
                        return context.update_buffer(id, part.offset, bytes);
                    }
                };
                let device = context.gpu().device();
                // SAFETY: recording; the buffers are live and the parts within them.
                unsafe { device.cmd_copy_buffer(cmd, from, to, &regions) };
            }
        }
        Ok(())
    }
}

/// Region of all layers of one mip level, and its size in a buffer.
fn copy_region(desc: &ImageDesc, part: &ImagePart, mip: u32) -> (vk::BufferImageCopy, u64) {
    let (width, height) = ((desc.width >> mip).max(1), (desc.height >> mip).max(1));
    let region = vk::BufferImageCopy {
        image_subresource: vk::ImageSubresourceLayers {
            aspect_mask: desc.aspect(),
            mip_level: mip,
            base_array_layer: part.base_layer,
            layer_count: part.layers,
        },
        image_extent: vk::Extent3D {
            width,
            height,
            depth: 1,
        },
        ..Default::default()
    };
    (region, u64::from(width * height * part.layers * 4))
}

fn tag(used: &Used) -> usize {
    match used {
        Used::Image { tag, .. } | Used::Buffer { tag, .. } => *tag,
    }
}

fn access(used: &Used) -> Access {
    match used {
        Used::Image { access, .. } | Used::Buffer { access, .. } => *access,
    }
}

/// What tells resources apart.
fn resource(used: &Used) -> (bool, usize) {
    (matches!(used, Used::Image { .. }), tag(used))
}

/// What the shaders know of the uses; the number of a use is its place in the list.
pub fn shader_uses(uses: &[Used]) -> Vec<ShaderUse> {
    let numbered = uses.iter().enumerate();
    numbered
        .map(|(number, used)| ShaderUse {
            number: number as u32,
            access: access(used),
            resource: match used {
                Used::Image { part, .. } => Resource::Image {
                    array: part.layers > 1,
                },
                Used::Buffer { part, .. } => Resource::Buffer { bytes: part.size },
            },
        })
        .collect()
}

fn binds(uses: &[Used]) -> Vec<Bind> {
    let numbered = (0u32..).zip(uses);
    numbered
        .filter_map(|(number, used)| match *used {
            Used::Image {
                id, part, access, ..
            } => {
                let bind = match access {
                    Access::Sampled(_) => Bind::sampled(number, id, SamplerDesc::nearest()),
                    Access::StorageRead(_)
                    | Access::StorageWrite(_)
                    | Access::StorageReadWrite(_) => Bind::storage_image(number, id),
                    _ => return None,
                };
                Some(bind.part(part))
            }
            Used::Buffer {
                id, part, access, ..
            } => {
                let bind = match access {
                    Access::Uniform(_) => Bind::uniform(number, id),
                    Access::TexelRead(_) => Bind::texels(number, id, vk::Format::R32_UINT),
                    Access::StorageRead(_)
                    | Access::StorageWrite(_)
                    | Access::StorageReadWrite(_) => Bind::storage_buffer(number, id),
                    _ => return None,
                };
                Some(bind.part(part))
            }
        })
        .collect()
}

/// Push constants of the shaders of [`shaders`].
pub fn tags(uses: &[Used], bytes: u32) -> Vec<u8> {
    let mut tags = [0u32; 32];
    for (slot, used) in tags.iter_mut().zip(uses) {
        *slot = tag(used) as u32;
    }
    bytemuck::cast_slice(&tags)[..bytes as usize].to_vec()
}

/// Buffers used in one way.
fn buffers(uses: &[Used], wanted: Access) -> Vec<(antumbra::graph::BufferId, BufferPart)> {
    let found = uses.iter().filter_map(|used| match *used {
        Used::Buffer {
            id, part, access, ..
        } if access == wanted => Some((id, part)),
        _ => None,
    });
    found.collect()
}

fn compute(context: &mut PassContext<'_>, uses: &[Used]) -> Result<(), GpuError> {
    let shader = shaders::compute(&shader_uses(uses));
    let push = tags(uses, shader.push_constant_bytes);
    context.bind_compute(&ComputePipelineDesc::new(shader), &binds(uses), &push)?;
    // One dispatch does the work: a second one would race with it.
    let arguments = buffers(uses, Access::Indirect);
    let mut arguments = arguments.iter();
    match arguments.next() {
        Some((id, part)) => context.dispatch_indirect(*id, part.offset)?,
        None => context.dispatch([1; 3]),
    }
    for (id, part) in arguments {
        let shader = shaders::idle();
        let push = tags(&[], shader.push_constant_bytes);
        context.bind_compute(&ComputePipelineDesc::new(shader), &[], &push)?;
        context.dispatch_indirect(*id, part.offset)?;
    }
    Ok(())
}

fn graphics(context: &mut PassContext<'_>, uses: &[Used]) -> Result<(), GpuError> {
    let inputs = shader_uses(uses);
    let (vertex, fragment) = (shaders::vertex(&inputs), shaders::fragment(&inputs));
    let mut pipeline = GraphicsPipelineDesc::new(vertex, Some(fragment));
    pipeline.depth = uses.iter().find_map(|used| match access(used) {
        Access::DepthAttachment | Access::DepthAttachmentLoad => Some(DepthState {
            compare: vk::CompareOp::ALWAYS,
            write: true,
        }),
        Access::DepthTest => Some(DepthState {
            compare: vk::CompareOp::EQUAL,
            write: false,
        }),
        _ => None,
    });
    let streams = buffers(uses, Access::Vertex);
    pipeline.vertex_layout = (0u32..)
        .zip(&streams)
        .map(|(location, _)| VertexStream {
            stride: 4,
            attributes: vec![(location, vk::Format::R32_UINT, 0)],
            per_instance: false,
        })
        .collect();
    let push = tags(
        uses,
        vertex.push_constant_bytes.max(fragment.push_constant_bytes),
    );
    context.bind_graphics(pipeline, &binds(uses), &push)?;
    if !streams.is_empty() {
        let offsets = streams.iter().map(|(id, part)| (*id, part.offset));
        context.bind_vertices(&offsets.collect::<Vec<_>>())?;
    }
    let (indices, arguments) = (
        buffers(uses, Access::Index),
        buffers(uses, Access::Indirect),
    );
    if indices.is_empty() && arguments.is_empty() {
        // All vertices that are declared, the first three being enough.
        let vertices = streams.iter().map(|(_, part)| part.size as u32 / 4).min();
        context.draw(0, vertices.unwrap_or(3), 1);
    }
    for (id, part) in indices {
        context.bind_indices(id, part.offset)?;
        context.draw_indexed(0, part.size as u32 / 4, 0);
    }
    for (id, part) in arguments {
        context.draw_indirect(id, part.offset)?;
    }
    Ok(())
}
