//! From a plan to commands: the only part of the graph that sees a device.

mod context;
mod copies;
mod resources;

pub use context::{Bind, PassContext};
pub use resources::FrameCache;

use super::compile::CompiledGraph;
use super::pass::{Attachment, Load, PassKind, RecordFn};
use super::plan::{Barrier, Batch, Plan, PlanPass, ResourceShape};
use super::resource::{ImagePart, Part};
use crate::gpu::{Gpu, GpuError};
use ash::vk;
use context::Handles;

/// What recording a frame did.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct FrameReport {
    /// Names of the passes recorded, in order. [`Gpu::collect_timings`] has their times under the
    /// same names once the frame has finished.
    pub passes: Vec<String>,
    /// Number of barriers recorded.
    pub barriers: usize,
    /// Number of `vkCmdPipelineBarrier2` that they took.
    pub barrier_commands: usize,
    /// Bytes of transient memory of the frame.
    pub transient_bytes: u64,
}

impl CompiledGraph<'_> {
    /// Records the frame into `cmd`, which must be in the recording state and outside rendering.
    /// Nothing is submitted or waited for.
    ///
    /// `cache` keeps transient memory and history images from frame to frame. Call
    /// [`Gpu::begin_frame`] first ([`Gpu::run`] does so).
    pub fn record(
        self,
        gpu: &mut Gpu,
        cache: &mut FrameCache,
        cmd: vk::CommandBuffer,
    ) -> Result<FrameReport, GpuError> {
        let CompiledGraph {
            plan,
            mut records,
            hosts,
        } = self;
        let handles = cache.handles(gpu, &plan, &hosts)?;
        let mut views = cache.take_views(gpu, &plan);
        let result = (|| {
            let mut report = FrameReport {
                transient_bytes: plan.peak_bytes(),
                ..FrameReport::default()
            };
            for step in &plan.steps {
                for batch in [&step.hand_over, &step.barriers] {
                    record_batch(gpu, cmd, &plan, &handles, batch, &mut report);
                }
                for index in &step.passes {
                    let pass = &plan.passes[*index];
                    let mut context = PassContext {
                        gpu,
                        cmd,
                        plan: &plan,
                        pass,
                        handles: &handles,
                        views: &mut views,
                    };
                    context.gpu.begin_label(cmd, &pass.name);
                    let recorded = record_pass(&mut context, records[*index].take());
                    context.gpu.end_label(cmd);
                    recorded?;
                    report.passes.push(pass.name.to_string());
                }
            }
            record_batch(gpu, cmd, &plan, &handles, &plan.leave, &mut report);
            Ok(report)
        })();
        cache.put_views(gpu, &plan, views);
        if result.is_ok() {
            cache.remember_history(&plan);
        }
        result
    }
}

/// Records a pass. After an error too the command buffer is outside rendering, and can be ended.
fn record_pass(
    context: &mut PassContext<'_>,
    record: Option<RecordFn<'_>>,
) -> Result<(), GpuError> {
    let (cmd, pass) = (context.cmd, context.pass);
    let timing = context.gpu.begin_timing(cmd, &pass.name)?;
    if pass.kind == PassKind::Graphics {
        begin_rendering(context)?;
    }
    let recorded = record.map_or(Ok(()), |record| record(context));
    if pass.kind == PassKind::Graphics {
        // SAFETY: `cmd` is recording and rendering was begun above.
        unsafe { context.gpu.device().cmd_end_rendering(cmd) };
    }
    context.gpu.end_timing(cmd, timing);
    recorded
}

fn record_batch(
    gpu: &Gpu,
    cmd: vk::CommandBuffer,
    plan: &Plan,
    handles: &Handles,
    batch: &Batch,
    report: &mut FrameReport,
) {
    if batch.barriers.is_empty() {
        return;
    }
    let mut memory = Vec::new();
    let mut buffers = Vec::new();
    let mut images = Vec::new();
    for barrier in &batch.barriers {
        match barrier.target {
            None => memory.push(
                vk::MemoryBarrier2::default()
                    .src_stage_mask(barrier.src_stages)
                    .src_access_mask(barrier.src_access)
                    .dst_stage_mask(barrier.dst_stages)
                    .dst_access_mask(barrier.dst_access),
            ),
            Some((resource, Part::Buffer(part))) => buffers.push(
                vk::BufferMemoryBarrier2::default()
                    .src_stage_mask(barrier.src_stages)
                    .src_access_mask(barrier.src_access)
                    .dst_stage_mask(barrier.dst_stages)
                    .dst_access_mask(barrier.dst_access)
                    .src_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
                    .dst_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
                    .buffer(handles.buffers[resource])
                    .offset(part.offset)
                    .size(part.size),
            ),
            Some((resource, Part::Image(part))) => {
                images.push(image_barrier(plan, handles, barrier, resource, part));
            }
        }
    }
    let info = vk::DependencyInfo::default()
        .memory_barriers(&memory)
        .buffer_memory_barriers(&buffers)
        .image_memory_barriers(&images);
    // SAFETY: `cmd` is recording and outside rendering; handles are those of this frame.
    unsafe { gpu.device().cmd_pipeline_barrier2(cmd, &info) };
    report.barriers += batch.barriers.len();
    report.barrier_commands += 1;
}

fn image_barrier(
    plan: &Plan,
    handles: &Handles,
    barrier: &Barrier,
    resource: usize,
    part: ImagePart,
) -> vk::ImageMemoryBarrier2<'static> {
    let aspect = match plan.resources[resource].shape {
        ResourceShape::Image { desc, .. } => desc.aspect(),
        ResourceShape::Buffer { .. } => vk::ImageAspectFlags::COLOR,
    };
    // Equal layouts make a barrier without transition, whatever the layout is.
    let (old, new) = match barrier.transition {
        Some(transition) => (transition.old, transition.new),
        None => (vk::ImageLayout::UNDEFINED, vk::ImageLayout::UNDEFINED),
    };
    vk::ImageMemoryBarrier2::default()
        .src_stage_mask(barrier.src_stages)
        .src_access_mask(barrier.src_access)
        .dst_stage_mask(barrier.dst_stages)
        .dst_access_mask(barrier.dst_access)
        .old_layout(old)
        .new_layout(new)
        .src_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
        .dst_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
        .image(handles.images[resource])
        .subresource_range(part.subresource_range(aspect))
}

fn begin_rendering(context: &mut PassContext<'_>) -> Result<(), GpuError> {
    let pass = context.pass;
    let [width, height] = context.extent();
    let mut color = Vec::new();
    let mut depth = None;
    for attachment in &pass.attachments {
        let info = attachment_info(context, attachment)?;
        if attachment.depth {
            depth = Some(info);
        } else {
            color.push(info);
        }
    }
    let area = vk::Rect2D {
        offset: vk::Offset2D::default(),
        extent: vk::Extent2D { width, height },
    };
    let mut info = vk::RenderingInfo::default()
        .render_area(area)
        .layer_count(1)
        .color_attachments(&color);
    if let Some(depth) = &depth {
        info = info.depth_attachment(depth);
    }
    let viewport = vk::Viewport {
        x: 0.0,
        y: 0.0,
        width: width as f32,
        height: height as f32,
        min_depth: 0.0,
        max_depth: 1.0,
    };
    let device = context.gpu.device();
    // SAFETY: `cmd` is recording and outside rendering; the attachments are views of this frame in
    // the layouts that the plan's barriers brought them to.
    unsafe {
        device.cmd_begin_rendering(context.cmd, &info);
        device.cmd_set_viewport(context.cmd, 0, &[viewport]);
        device.cmd_set_scissor(context.cmd, 0, &[area]);
    }
    Ok(())
}

fn attachment_info(
    context: &mut PassContext<'_>,
    attachment: &Attachment,
) -> Result<vk::RenderingAttachmentInfo<'static>, GpuError> {
    let view = context.view_of(attachment.resource, attachment.part, false)?;
    let (load, value) = match attachment.load {
        Load::Keep => (vk::AttachmentLoadOp::LOAD, [0.0; 4]),
        Load::Clear(value) => (vk::AttachmentLoadOp::CLEAR, value),
        Load::Discard => (vk::AttachmentLoadOp::DONT_CARE, [0.0; 4]),
    };
    let (layout, store) = if attachment.writes {
        let layout = vk::ImageLayout::ATTACHMENT_OPTIMAL;
        (layout, vk::AttachmentStoreOp::STORE)
    } else {
        // Storing would count as a write of a read-only attachment.
        let layout = vk::ImageLayout::READ_ONLY_OPTIMAL;
        (layout, vk::AttachmentStoreOp::NONE)
    };
    let clear_value = if attachment.depth {
        vk::ClearValue {
            depth_stencil: vk::ClearDepthStencilValue {
                depth: value[0],
                stencil: 0,
            },
        }
    } else {
        vk::ClearValue {
            color: vk::ClearColorValue { float32: value },
        }
    };
    Ok(vk::RenderingAttachmentInfo::default()
        .image_view(view)
        .image_layout(layout)
        .load_op(load)
        .store_op(store)
        .clear_value(clear_value))
}

/// Name of what a pass did wrong, for errors.
fn misuse(pass: &PlanPass, problem: String) -> GpuError {
    GpuError::Invalid {
        object: format!("pass `{}`", pass.name),
        problem,
    }
}
