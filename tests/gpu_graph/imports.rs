//! A host that lends images and buffers in odd states: before the frame it really uses them in the
//! state it says they enter in, after the frame in the state it asked for, with no barrier of its
//! own in between.

use std::collections::BTreeMap;

use antumbra::ash::vk;
use antumbra::gpu::{
    Buffer, ComputePipelineDesc, Gpu, GpuError, GraphicsPipelineDesc, Image, ImageSpec,
    MemoryLocation, Retired, SamplerDesc, SetResource, SetWrite,
};
use antumbra::graph::{Access, BufferState, ImageDesc, ImageState, Stage};

use crate::random_graph::texel;
use crate::shaders::{self, Resource, ShaderUse, word};
use crate::support::work::bind;

const ALL: vk::PipelineStageFlags2 = vk::PipelineStageFlags2::ALL_COMMANDS;
const READ: vk::AccessFlags2 = vk::AccessFlags2::MEMORY_READ;
const WRITE: vk::AccessFlags2 = vk::AccessFlags2::MEMORY_WRITE;

struct LentImage {
    image: Image,
    desc: ImageDesc,
    tag: usize,
    enter: ImageState,
    leave: ImageState,
    /// Where the last frame left it.
    layout: vk::ImageLayout,
}

struct LentBuffer {
    buffer: Buffer,
    tag: usize,
    enter: BufferState,
    leave: BufferState,
    filled: bool,
}

/// Everything that the host lends to one graph, by tag.
#[derive(Default)]
pub struct Imports {
    images: BTreeMap<usize, LentImage>,
    buffers: BTreeMap<usize, LentBuffer>,
}

impl Imports {
    pub fn image(
        &mut self,
        gpu: &mut Gpu,
        tag: usize,
        desc: ImageDesc,
        enter: ImageState,
        leave: ImageState,
    ) -> vk::Image {
        let lent = self.images.entry(tag).or_insert_with(|| {
            let usage = vk::ImageUsageFlags::SAMPLED
                | vk::ImageUsageFlags::STORAGE
                | vk::ImageUsageFlags::COLOR_ATTACHMENT
                | vk::ImageUsageFlags::TRANSFER_SRC
                | vk::ImageUsageFlags::TRANSFER_DST;
            let spec = ImageSpec {
                mip_levels: desc.mips,
                array_layers: desc.layers,
                ..ImageSpec::new_2d(desc.format, desc.width, desc.height, usage)
            };
            LentImage {
                image: gpu
                    .create_image(&format!("lent image {tag}"), &spec)
                    .unwrap(),
                desc,
                tag,
                enter,
                leave,
                layout: vk::ImageLayout::UNDEFINED,
            }
        });
        lent.image.raw
    }

    pub fn buffer(
        &mut self,
        gpu: &mut Gpu,
        tag: usize,
        size: u64,
        enter: BufferState,
        leave: BufferState,
    ) -> vk::Buffer {
        let lent = self.buffers.entry(tag).or_insert_with(|| {
            // All kinds of use that Vulkan 1.0 has.
            let usage = vk::BufferUsageFlags::from_raw(0x1ff);
            let (name, place) = (format!("lent buffer {tag}"), MemoryLocation::GpuOnly);
            LentBuffer {
                buffer: gpu.create_buffer(&name, size, usage, place).unwrap(),
                tag,
                enter,
                leave,
                filled: false,
            }
        });
        lent.buffer.raw
    }

    pub fn count(&self) -> usize {
        self.images.len() + self.buffers.len()
    }

    pub fn destroy(self, gpu: &mut Gpu) {
        self.images
            .into_values()
            .for_each(|lent| gpu.destroy_image(lent.image));
        self.buffers
            .into_values()
            .for_each(|lent| gpu.destroy_buffer(lent.buffer));
    }

    /// Whether some buffer has no contents yet: what enters idle must have got them in an earlier
    /// submission.
    pub fn wants_filling(&self) -> bool {
        self.buffers.values().any(|lent| !lent.filled)
    }

    /// Gives all buffers their contents.
    pub fn fill(&mut self, gpu: &Gpu, cmd: vk::CommandBuffer) {
        for lent in self.buffers.values_mut() {
            update(gpu, cmd, lent);
            lent.filled = true;
        }
    }

    /// What the host does before the frame.
    pub fn before(&mut self, gpu: &mut Gpu, cmd: vk::CommandBuffer) -> Result<(), GpuError> {
        for lent in self.images.values_mut() {
            let enter = lent.enter;
            if enter.layout == vk::ImageLayout::UNDEFINED {
                continue;
            }
            let clear = vk::ImageLayout::TRANSFER_DST_OPTIMAL;
            let (stages, access) = (
                vk::PipelineStageFlags2::CLEAR,
                vk::AccessFlags2::TRANSFER_WRITE,
            );
            move_image(gpu, cmd, lent, (ALL, READ | WRITE), (stages, access), clear);
            clear_image(gpu, cmd, lent, clear);
            let target = (enter.stages, enter.access);
            move_image(gpu, cmd, lent, (stages, access), target, enter.layout);
            use_image(gpu, cmd, lent, enter)?;
        }
        for lent in self.buffers.values() {
            use_buffer(gpu, cmd, lent, lent.enter)?;
        }
        Ok(())
    }

    /// What the host does behind the frame.
    pub fn after(&mut self, gpu: &mut Gpu, cmd: vk::CommandBuffer) -> Result<(), GpuError> {
        for lent in self.images.values_mut() {
            lent.layout = lent.leave.layout;
            use_image(gpu, cmd, lent, lent.leave)?;
        }
        for lent in self.buffers.values() {
            use_buffer(gpu, cmd, lent, lent.leave)?;
        }
        Ok(())
    }
}

type Scope = (vk::PipelineStageFlags2, vk::AccessFlags2);

fn move_image(
    gpu: &Gpu,
    cmd: vk::CommandBuffer,
    lent: &mut LentImage,
    source: Scope,
    target: Scope,
    layout: vk::ImageLayout,
) {
    let barriers = [vk::ImageMemoryBarrier2::default()
        .src_stage_mask(source.0)
        .src_access_mask(source.1)
        .dst_stage_mask(target.0)
        .dst_access_mask(target.1)
        .old_layout(lent.layout)
        .new_layout(layout)
        .image(lent.image.raw)
        .subresource_range(whole(&lent.desc))];
    let info = vk::DependencyInfo::default().image_memory_barriers(&barriers);
    // SAFETY: recording, outside rendering; the image is live.
    unsafe { gpu.device().cmd_pipeline_barrier2(cmd, &info) };
    lent.layout = layout;
}

fn whole(desc: &ImageDesc) -> vk::ImageSubresourceRange {
    range(0, desc.mips, 0, desc.layers)
}

fn range(mip: u32, mips: u32, layer: u32, layers: u32) -> vk::ImageSubresourceRange {
    vk::ImageSubresourceRange {
        aspect_mask: vk::ImageAspectFlags::COLOR,
        base_mip_level: mip,
        level_count: mips,
        base_array_layer: layer,
        layer_count: layers,
    }
}

fn clear_image(gpu: &Gpu, cmd: vk::CommandBuffer, lent: &LentImage, layout: vk::ImageLayout) {
    let clear = vk::ClearColorValue {
        float32: [texel(lent.tag); 4],
    };
    let (image, range) = (lent.image.raw, whole(&lent.desc));
    // SAFETY: recording, outside rendering; the image is live.
    unsafe {
        gpu.device()
            .cmd_clear_color_image(cmd, image, layout, &clear, &[range])
    };
}

/// An access of the host's that the state names. Reads do not look at what they read.
fn use_image(
    gpu: &mut Gpu,
    cmd: vk::CommandBuffer,
    lent: &LentImage,
    state: ImageState,
) -> Result<(), GpuError> {
    let levels = 0..lent.desc.mips;
    match (state.layout, state.stages) {
        (vk::ImageLayout::GENERAL, ALL) => clear_image(gpu, cmd, lent, state.layout),
        (vk::ImageLayout::GENERAL, vk::PipelineStageFlags2::COMPUTE_SHADER) => {
            for mip in levels {
                let view = view(gpu, lent, range(mip, 1, 0, lent.desc.layers))?;
                let what = SetResource::StorageImage { view };
                let access = Access::StorageReadWrite(Stage::Compute);
                dispatch(gpu, cmd, image_use(lent, access), lent.tag, what)?;
            }
        }
        (vk::ImageLayout::READ_ONLY_OPTIMAL, vk::PipelineStageFlags2::FRAGMENT_SHADER) => {
            let what = SetResource::SampledImage {
                view: view(gpu, lent, whole(&lent.desc))?,
                layout: state.layout,
                sampler: gpu.sampler(&SamplerDesc::nearest())?,
            };
            let access = Access::Sampled(Stage::Fragment);
            draw(gpu, cmd, image_use(lent, access), lent.tag, what)?;
        }
        (vk::ImageLayout::ATTACHMENT_OPTIMAL, vk::PipelineStageFlags2::COLOR_ATTACHMENT_OUTPUT) => {
            for (mip, layer) in levels.flat_map(|m| (0..lent.desc.layers).map(move |l| (m, l))) {
                let view = view(gpu, lent, range(mip, 1, layer, 1))?;
                let side = (lent.desc.width >> mip).max(1);
                render(gpu, cmd, Some((view, texel(lent.tag))), side, |_| Ok(()))?;
            }
        }
        other => panic!("the host has no use of an image in {other:?}"),
    }
    Ok(())
}

fn use_buffer(
    gpu: &mut Gpu,
    cmd: vk::CommandBuffer,
    lent: &LentBuffer,
    state: BufferState,
) -> Result<(), GpuError> {
    let (buffer, bytes) = (lent.buffer.raw, lent.buffer.size);
    let used = |access| ShaderUse {
        number: 0,
        resource: Resource::Buffer { bytes },
        access,
    };
    match state.stages {
        vk::PipelineStageFlags2::NONE => {}
        ALL => update(gpu, cmd, lent),
        vk::PipelineStageFlags2::COMPUTE_SHADER => {
            let what = SetResource::StorageBuffer {
                buffer,
                offset: 0,
                range: bytes,
            };
            let access = Access::StorageReadWrite(Stage::Compute);
            dispatch(gpu, cmd, used(access), lent.tag, what)?;
        }
        vk::PipelineStageFlags2::FRAGMENT_SHADER => {
            let format = vk::Format::R32_UINT;
            let view = gpu.create_buffer_view("lent buffer", buffer, format, 0, bytes)?;
            gpu.retire(Retired::BufferView(view));
            let what = SetResource::UniformTexelBuffer(view);
            draw(
                gpu,
                cmd,
                used(Access::TexelRead(Stage::Fragment)),
                lent.tag,
                what,
            )?;
        }
        other => panic!("the host has no use of a buffer in {other:?}"),
    }
    Ok(())
}

fn update(gpu: &Gpu, cmd: vk::CommandBuffer, lent: &LentBuffer) {
    let words: Vec<u32> = (0..lent.buffer.size as usize / 4)
        .map(|i| word(i, lent.tag))
        .collect();
    let bytes = bytemuck::cast_slice(&words);
    // SAFETY: recording, outside rendering; the buffer is live and as large.
    unsafe {
        gpu.device()
            .cmd_update_buffer(cmd, lent.buffer.raw, 0, bytes)
    };
}

fn image_use(lent: &LentImage, access: Access) -> ShaderUse {
    ShaderUse {
        number: 0,
        resource: Resource::Image {
            array: lent.desc.layers > 1,
        },
        access,
    }
}

fn view(
    gpu: &mut Gpu,
    lent: &LentImage,
    range: vk::ImageSubresourceRange,
) -> Result<vk::ImageView, GpuError> {
    let kind = if range.layer_count > 1 {
        vk::ImageViewType::TYPE_2D_ARRAY
    } else {
        vk::ImageViewType::TYPE_2D
    };
    let view = gpu.create_view("lent image", lent.image.raw, kind, lent.desc.format, range)?;
    gpu.retire(Retired::View(view));
    Ok(view)
}

fn dispatch(
    gpu: &mut Gpu,
    cmd: vk::CommandBuffer,
    used: ShaderUse,
    tag: usize,
    resource: SetResource,
) -> Result<(), GpuError> {
    let pipeline = gpu.compute_pipeline(&ComputePipelineDesc::new(shaders::compute(&[used])))?;
    let set = gpu.allocate_set(&pipeline)?;
    gpu.write_set(
        set,
        &[SetWrite {
            binding: 0,
            resource,
        }],
    )?;
    let push = push(tag, pipeline.push_bytes);
    bind(gpu, cmd, &pipeline, Some(set), &push);
    // SAFETY: everything the dispatch needs is bound.
    unsafe { gpu.device().cmd_dispatch(cmd, 1, 1, 1) };
    Ok(())
}

fn draw(
    gpu: &mut Gpu,
    cmd: vk::CommandBuffer,
    used: ShaderUse,
    tag: usize,
    resource: SetResource,
) -> Result<(), GpuError> {
    let (vertex, fragment) = (shaders::vertex(&[]), shaders::fragment(&[used]));
    let pipeline = gpu.graphics_pipeline(&GraphicsPipelineDesc::new(vertex, Some(fragment)))?;
    let set = gpu.allocate_set(&pipeline)?;
    gpu.write_set(
        set,
        &[SetWrite {
            binding: 0,
            resource,
        }],
    )?;
    let push = push(tag, pipeline.push_bytes);
    render(gpu, cmd, None, 4, |gpu| {
        bind(gpu, cmd, &pipeline, Some(set), &push);
        // SAFETY: inside rendering, with everything that the draw needs bound and set.
        unsafe { gpu.device().cmd_draw(cmd, 3, 1, 0, 0) };
        Ok(())
    })
}

fn push(tag: usize, bytes: u32) -> Vec<u8> {
    let words = [tag as u32; 32];
    bytemuck::cast_slice(&words)[..bytes as usize].to_vec()
}

/// Renders into one attachment, cleared to a value, or into none.
fn render(
    gpu: &mut Gpu,
    cmd: vk::CommandBuffer,
    attachment: Option<(vk::ImageView, f32)>,
    side: u32,
    commands: impl FnOnce(&mut Gpu) -> Result<(), GpuError>,
) -> Result<(), GpuError> {
    let area = vk::Rect2D {
        offset: vk::Offset2D::default(),
        extent: vk::Extent2D {
            width: side,
            height: side,
        },
    };
    let color: Vec<_> = attachment
        .iter()
        .map(|(view, value)| {
            vk::RenderingAttachmentInfo::default()
                .image_view(*view)
                .image_layout(vk::ImageLayout::ATTACHMENT_OPTIMAL)
                .load_op(vk::AttachmentLoadOp::CLEAR)
                .store_op(vk::AttachmentStoreOp::STORE)
                .clear_value(vk::ClearValue {
                    color: vk::ClearColorValue {
                        float32: [*value; 4],
                    },
                })
        })
        .collect();
    let info = vk::RenderingInfo::default()
        .render_area(area)
        .layer_count(1)
        .color_attachments(&color);
    let viewport = vk::Viewport {
        width: side as f32,
        height: side as f32,
        max_depth: 1.0,
        ..Default::default()
    };
    // SAFETY: recording, outside rendering; the view is live and in the layout that is named.
    unsafe {
        gpu.device().cmd_begin_rendering(cmd, &info);
        gpu.device().cmd_set_viewport(cmd, 0, &[viewport]);
        gpu.device().cmd_set_scissor(cmd, 0, &[area]);
    }
    let result = commands(gpu);
    // SAFETY: rendering was begun above.
    unsafe { gpu.device().cmd_end_rendering(cmd) };
    result
}
