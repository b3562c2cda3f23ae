//! The one table from what a pass does with a resource to what Vulkan must be told.

use ash::vk;

/// The shader stage that performs a shader access.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Stage {
    /// Vertex shader.
    Vertex,
    /// Fragment shader.
    Fragment,
    /// Compute shader.
    Compute,
}

/// How a pass uses an image or a buffer.
///
/// Pipeline stages, access masks, image layouts and usage flags all follow from this value through
/// [`Access::info`]; the author of a pass never writes them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Access {
    /// Colour attachment, written.
    ColorAttachment,
    /// Colour attachment whose earlier contents are loaded, then written.
    ColorAttachmentLoad,
    /// Depth attachment, tested and written.
    DepthAttachment,
    /// Depth attachment whose earlier contents are loaded, then tested and written.
    DepthAttachmentLoad,
    /// Depth attachment, tested and never written.
    DepthTest,
    /// Image read through a sampler, or by `texelFetch`.
    Sampled(Stage),
    /// Storage image or storage buffer, read.
    StorageRead(Stage),
    /// Storage image or storage buffer, written.
    StorageWrite(Stage),
    /// Storage image or storage buffer, read and written (atomics, read-modify-write).
    StorageReadWrite(Stage),
    /// Uniform texel buffer.
    TexelRead(Stage),
    /// Uniform buffer.
    Uniform(Stage),
    /// Arguments of an indirect draw or dispatch.
    Indirect,
    /// Index buffer.
    Index,
    /// Vertex buffer.
    Vertex,
    /// Source of a copy.
    CopyRead,
    /// Destination of a copy.
    CopyWrite,
    /// Source of a blit.
    BlitRead,
    /// Destination of a blit.
    BlitWrite,
    /// Destination of a clear of an image or a fill or update of a buffer.
    Clear,
}

/// What [`Access`] means to Vulkan.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AccessInfo {
    /// Stages that perform the access.
    pub stages: vk::PipelineStageFlags2,
    /// Memory access types.
    pub access: vk::AccessFlags2,
    /// Layout that an image must be in; `None` if an image cannot be used so.
    pub layout: Option<vk::ImageLayout>,
    /// Usage flag that an image needs.
    pub image_usage: vk::ImageUsageFlags,
    /// Usage flag that a buffer needs; empty if a buffer cannot be used so.
    pub buffer_usage: vk::BufferUsageFlags,
}

/// Every access bit that writes.
pub(crate) const WRITES: vk::AccessFlags2 = vk::AccessFlags2::from_raw(
    vk::AccessFlags2::SHADER_WRITE.as_raw()
        | vk::AccessFlags2::SHADER_STORAGE_WRITE.as_raw()
        | vk::AccessFlags2::COLOR_ATTACHMENT_WRITE.as_raw()
        | vk::AccessFlags2::DEPTH_STENCIL_ATTACHMENT_WRITE.as_raw()
        | vk::AccessFlags2::TRANSFER_WRITE.as_raw()
        | vk::AccessFlags2::HOST_WRITE.as_raw()
        | vk::AccessFlags2::MEMORY_WRITE.as_raw(),
);

impl Access {
    /// The row of the table for this access.
    pub fn info(self) -> AccessInfo {
        use vk::{
            AccessFlags2 as A, BufferUsageFlags as B, ImageLayout as L, ImageUsageFlags as I,
            PipelineStageFlags2 as S,
        };
        let shader = |stage| match stage {
            Stage::Vertex => S::VERTEX_SHADER,
            Stage::Fragment => S::FRAGMENT_SHADER,
            Stage::Compute => S::COMPUTE_SHADER,
        };
        let depth = S::EARLY_FRAGMENT_TESTS | S::LATE_FRAGMENT_TESTS;
        let image = |stages, access, layout, image_usage| AccessInfo {
            stages,
            access,
            layout: Some(layout),
            image_usage,
            buffer_usage: B::empty(),
        };
        let buffer = |stages, access, buffer_usage| AccessInfo {
            stages,
            access,
            layout: None,
            image_usage: I::empty(),
            buffer_usage,
        };
        let both = |stages, access, layout, image_usage, buffer_usage| AccessInfo {
            stages,
            access,
            layout: Some(layout),
            image_usage,
            buffer_usage,
        };
        let transfer = |stages, writes: bool| {
            if writes {
                let (layout, image) = (L::TRANSFER_DST_OPTIMAL, I::TRANSFER_DST);
                both(stages, A::TRANSFER_WRITE, layout, image, B::TRANSFER_DST)
            } else {
                let (layout, image) = (L::TRANSFER_SRC_OPTIMAL, I::TRANSFER_SRC);
                both(stages, A::TRANSFER_READ, layout, image, B::TRANSFER_SRC)
            }
        };
        match self {
            Access::ColorAttachment => image(
                S::COLOR_ATTACHMENT_OUTPUT,
                A::COLOR_ATTACHMENT_WRITE,
                L::ATTACHMENT_OPTIMAL,
                I::COLOR_ATTACHMENT,
            ),
            Access::ColorAttachmentLoad => image(
                S::COLOR_ATTACHMENT_OUTPUT,
                A::COLOR_ATTACHMENT_READ | A::COLOR_ATTACHMENT_WRITE,
                L::ATTACHMENT_OPTIMAL,
                I::COLOR_ATTACHMENT,
            ),
            // A depth test reads what the clear of the same pass wrote, so even a cleared
            // attachment is both read and written, in both test stages.
            Access::DepthAttachment | Access::DepthAttachmentLoad => image(
                depth,
                A::DEPTH_STENCIL_ATTACHMENT_READ | A::DEPTH_STENCIL_ATTACHMENT_WRITE,
                L::ATTACHMENT_OPTIMAL,
                I::DEPTH_STENCIL_ATTACHMENT,
            ),
            Access::DepthTest => image(
                depth,
                A::DEPTH_STENCIL_ATTACHMENT_READ,
                L::READ_ONLY_OPTIMAL,
                I::DEPTH_STENCIL_ATTACHMENT,
            ),
            Access::Sampled(stage) => image(
                shader(stage),
                A::SHADER_SAMPLED_READ,
                L::READ_ONLY_OPTIMAL,
                I::SAMPLED,
            ),
            Access::StorageRead(stage) => both(
                shader(stage),
                A::SHADER_STORAGE_READ,
                L::GENERAL,
                I::STORAGE,
                B::STORAGE_BUFFER,
            ),
            Access::StorageWrite(stage) => both(
                shader(stage),
                A::SHADER_STORAGE_WRITE,
                L::GENERAL,
                I::STORAGE,
                B::STORAGE_BUFFER,
            ),
            Access::StorageReadWrite(stage) => both(
                shader(stage),
                A::SHADER_STORAGE_READ | A::SHADER_STORAGE_WRITE,
                L::GENERAL,
                I::STORAGE,
                B::STORAGE_BUFFER,
            ),
            Access::TexelRead(stage) => buffer(
                shader(stage),
                A::SHADER_SAMPLED_READ,
                B::UNIFORM_TEXEL_BUFFER,
            ),
            Access::Uniform(stage) => buffer(shader(stage), A::UNIFORM_READ, B::UNIFORM_BUFFER),
            Access::Indirect => buffer(
                S::DRAW_INDIRECT,
                A::INDIRECT_COMMAND_READ,
                B::INDIRECT_BUFFER,
            ),
            Access::Index => buffer(S::INDEX_INPUT, A::INDEX_READ, B::INDEX_BUFFER),
            Access::Vertex => buffer(
                S::VERTEX_ATTRIBUTE_INPUT,
                A::VERTEX_ATTRIBUTE_READ,
                B::VERTEX_BUFFER,
            ),
            Access::CopyRead => transfer(S::COPY, false),
            Access::CopyWrite => transfer(S::COPY, true),
            Access::BlitRead => transfer(S::BLIT, false),
            Access::BlitWrite => transfer(S::BLIT, true),
            Access::Clear => transfer(S::CLEAR, true),
        }
    }

    /// Whether the access writes.
    pub fn writes(self) -> bool {
        self.info().access.intersects(WRITES)
    }

    /// Whether the access reads what was there before.
    pub fn reads(self) -> bool {
        // The test of a freshly cleared depth attachment reads nothing from before the pass.
        self != Access::DepthAttachment && !(self.info().access & !WRITES).is_empty()
    }
}

/// Stages of the graphics pipeline in their logical order.
const GRAPHICS_ORDER: [vk::PipelineStageFlags2; 11] = [
    vk::PipelineStageFlags2::DRAW_INDIRECT,
    vk::PipelineStageFlags2::INDEX_INPUT,
    vk::PipelineStageFlags2::VERTEX_ATTRIBUTE_INPUT,
    vk::PipelineStageFlags2::VERTEX_SHADER,
    vk::PipelineStageFlags2::TESSELLATION_CONTROL_SHADER,
    vk::PipelineStageFlags2::TESSELLATION_EVALUATION_SHADER,
    vk::PipelineStageFlags2::GEOMETRY_SHADER,
    vk::PipelineStageFlags2::EARLY_FRAGMENT_TESTS,
    vk::PipelineStageFlags2::FRAGMENT_SHADER,
    vk::PipelineStageFlags2::LATE_FRAGMENT_TESTS,
    vk::PipelineStageFlags2::COLOR_ATTACHMENT_OUTPUT,
];

/// A mask of single stages in place of the masks that stand for several.
pub(crate) fn expand_stages(stages: vk::PipelineStageFlags2) -> vk::PipelineStageFlags2 {
    use vk::PipelineStageFlags2 as S;
    let graphics = GRAPHICS_ORDER.iter().fold(S::empty(), |all, s| all | *s);
    let transfer = S::COPY | S::RESOLVE | S::BLIT | S::CLEAR;
    let mut out = stages;
    if stages.intersects(S::ALL_COMMANDS | S::BOTTOM_OF_PIPE) {
        out |= graphics | transfer | S::COMPUTE_SHADER;
    }
    if stages.contains(S::ALL_GRAPHICS) {
        out |= graphics;
    }
    if stages.contains(S::VERTEX_INPUT) {
        out |= S::INDEX_INPUT | S::VERTEX_ATTRIBUTE_INPUT;
    }
    if stages.contains(S::PRE_RASTERIZATION_SHADERS) {
        out |= S::VERTEX_SHADER
            | S::TESSELLATION_CONTROL_SHADER
            | S::TESSELLATION_EVALUATION_SHADER
            | S::GEOMETRY_SHADER;
    }
    if stages.contains(S::ALL_TRANSFER) {
        out |= transfer;
    }
    out & !(S::ALL_COMMANDS
        | S::ALL_GRAPHICS
        | S::VERTEX_INPUT
        | S::PRE_RASTERIZATION_SHADERS
        | S::ALL_TRANSFER
        | S::TOP_OF_PIPE
        | S::BOTTOM_OF_PIPE)
}

/// A mask of single access types in place of the masks that stand for several.
pub(crate) fn expand_access(access: vk::AccessFlags2) -> vk::AccessFlags2 {
    use vk::AccessFlags2 as A;
    let shader_reads = A::SHADER_SAMPLED_READ | A::SHADER_STORAGE_READ;
    let mut out = access;
    if access.contains(A::MEMORY_READ) {
        out |= shader_reads
            | A::INDIRECT_COMMAND_READ
            | A::INDEX_READ
            | A::VERTEX_ATTRIBUTE_READ
            | A::UNIFORM_READ
            | A::INPUT_ATTACHMENT_READ
            | A::COLOR_ATTACHMENT_READ
            | A::DEPTH_STENCIL_ATTACHMENT_READ
            | A::TRANSFER_READ
            | A::HOST_READ;
    }
    if access.contains(A::SHADER_READ) {
        out |= shader_reads;
    }
    if access.contains(A::MEMORY_WRITE) {
        out |= A::SHADER_STORAGE_WRITE
            | A::COLOR_ATTACHMENT_WRITE
            | A::DEPTH_STENCIL_ATTACHMENT_WRITE
            | A::TRANSFER_WRITE
            | A::HOST_WRITE;
    }
    if access.contains(A::SHADER_WRITE) {
        out |= A::SHADER_STORAGE_WRITE;
    }
    out & !(A::MEMORY_READ | A::MEMORY_WRITE | A::SHADER_READ | A::SHADER_WRITE)
}

/// The stages of a source mask with all that come logically before them.
///
/// Vulkan specification, "Synchronization scopes": the first scope of an execution dependency
/// includes logically earlier stages, the second one logically later stages; access scopes include
/// neither.
pub(crate) fn with_earlier(stages: vk::PipelineStageFlags2) -> vk::PipelineStageFlags2 {
    let stages = expand_stages(stages);
    let mut out = stages;
    if let Some(last) = GRAPHICS_ORDER.iter().rposition(|s| stages.contains(*s)) {
        for stage in &GRAPHICS_ORDER[..last] {
            out |= *stage;
        }
    }
    if stages.contains(vk::PipelineStageFlags2::COMPUTE_SHADER) {
        out |= vk::PipelineStageFlags2::DRAW_INDIRECT;
    }
    out
}

/// The stages of a destination mask with all that come logically after them.
pub(crate) fn with_later(stages: vk::PipelineStageFlags2) -> vk::PipelineStageFlags2 {
    let stages = expand_stages(stages);
    let mut out = stages;
    if let Some(first) = GRAPHICS_ORDER.iter().position(|s| stages.contains(*s)) {
        for stage in &GRAPHICS_ORDER[first + 1..] {
            out |= *stage;
        }
    }
    if stages.contains(vk::PipelineStageFlags2::DRAW_INDIRECT) {
        out |= vk::PipelineStageFlags2::COMPUTE_SHADER;
    }
    out
}

/// The single bits of a stage mask, lowest first.
pub(crate) fn stage_bits(
    stages: vk::PipelineStageFlags2,
) -> impl Iterator<Item = vk::PipelineStageFlags2> {
    let mut rest = stages.as_raw();
    std::iter::from_fn(move || {
        (rest != 0).then(|| {
            let bit = rest & rest.wrapping_neg();
            rest ^= bit;
            vk::PipelineStageFlags2::from_raw(bit)
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use vk::PipelineStageFlags2 as S;

    #[test]
    fn logical_order_widens_execution_scopes() {
        assert!(with_earlier(S::FRAGMENT_SHADER).contains(S::VERTEX_SHADER | S::DRAW_INDIRECT));
        assert!(!with_earlier(S::FRAGMENT_SHADER).intersects(S::COLOR_ATTACHMENT_OUTPUT));
        assert!(with_later(S::DRAW_INDIRECT).contains(S::COMPUTE_SHADER | S::FRAGMENT_SHADER));
        assert_eq!(with_later(S::COMPUTE_SHADER), S::COMPUTE_SHADER);
        assert!(with_earlier(S::ALL_COMMANDS).contains(S::COMPUTE_SHADER | S::COPY));
    }

    #[test]
    fn depth_clear_reads_nothing_from_before() {
        assert!(!Access::DepthAttachment.reads() && Access::DepthAttachment.writes());
        assert!(Access::DepthTest.reads() && !Access::DepthTest.writes());
        assert!(Access::ColorAttachmentLoad.reads() && Access::ColorAttachmentLoad.writes());
    }
}
