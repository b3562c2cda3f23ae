//! What a pipeline is made of, and its key in the cache.

use ash::vk;

use super::shader::{BindingInfo, Shader};

/// A pipeline with what it takes to bind it. Lives as long as the device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PipelineHandle {
    /// The pipeline.
    pub pipeline: vk::Pipeline,
    /// Its layout: set 0 and one push constant range from 0.
    pub layout: vk::PipelineLayout,
    /// The layout of set 0, possibly without bindings.
    pub set_layout: vk::DescriptorSetLayout,
    /// Where to bind it.
    pub bind_point: vk::PipelineBindPoint,
    /// The stages that read push constants; empty when there are none.
    pub push_stages: vk::ShaderStageFlags,
    /// Size of the push constants in bytes.
    pub push_bytes: u32,
    /// Whether set 0 has bindings at all.
    pub has_bindings: bool,
}

/// A compute pipeline.
#[derive(Clone, Debug)]
pub struct ComputePipelineDesc {
    /// The shader.
    pub shader: &'static Shader,
    /// Specialization constants: id and the 32 bits of the value.
    pub constants: Vec<(u32, u32)>,
}

impl ComputePipelineDesc {
    /// A pipeline with the constants as the shader has them.
    #[must_use]
    pub fn new(shader: &'static Shader) -> Self {
        Self {
            shader,
            constants: Vec::new(),
        }
    }
}

/// One vertex buffer; its binding number is its place in the list.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct VertexStream {
    /// Bytes from one element to the next.
    pub stride: u32,
    /// Location, format and offset in bytes of each attribute.
    pub attributes: Vec<(u32, vk::Format, u32)>,
    /// Advance with the instance instead of the vertex.
    pub per_instance: bool,
}

/// Depth test.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct DepthState {
    /// A fragment passes when `its depth OP stored depth`.
    pub compare: vk::CompareOp,
    /// Whether passing fragments write.
    pub write: bool,
}

/// How colours join what is there, the same for all attachments.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Blend {
    /// They replace it.
    #[default]
    None,
    /// Sum.
    Add,
    /// Least, by channel.
    Min,
    /// Greatest, by channel.
    Max,
    /// Product.
    Multiply,
    /// Bits of either, in integer formats; needs
    /// [`OptionalFeatures::logic_op`](super::OptionalFeatures::logic_op).
    Or,
}

/// A graphics pipeline for dynamic rendering. Viewport and scissor are dynamic.
#[derive(Clone, Debug)]
pub struct GraphicsPipelineDesc {
    /// The vertex shader.
    pub vertex: &'static Shader,
    /// The fragment shader; none for depth alone.
    pub fragment: Option<&'static Shader>,
    /// Specialization constants of both stages: id and the 32 bits of the value.
    pub constants: Vec<(u32, u32)>,
    /// The vertex buffers.
    pub vertex_layout: Vec<VertexStream>,
    /// Primitives.
    pub topology: vk::PrimitiveTopology,
    /// Which faces to drop.
    pub cull_mode: vk::CullModeFlags,
    /// Which winding is the front.
    pub front_face: vk::FrontFace,
    /// Depth test, when there is a depth attachment that is tested.
    pub depth: Option<DepthState>,
    /// Formats of the colour attachments.
    pub color_formats: Vec<vk::Format>,
    /// Format of the depth attachment.
    pub depth_format: Option<vk::Format>,
    /// Blending of all colour attachments.
    pub blend: Blend,
}

impl GraphicsPipelineDesc {
    /// A triangle list without culling, attachments, depth test and blending.
    #[must_use]
    pub fn new(vertex: &'static Shader, fragment: Option<&'static Shader>) -> Self {
        Self {
            vertex,
            fragment,
            constants: Vec::new(),
            vertex_layout: Vec::new(),
            topology: vk::PrimitiveTopology::TRIANGLE_LIST,
            cull_mode: vk::CullModeFlags::NONE,
            front_face: vk::FrontFace::COUNTER_CLOCKWISE,
            depth: None,
            color_formats: Vec::new(),
            depth_format: None,
            blend: Blend::None,
        }
    }
}

/// A shader as a key: its name and its code.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct ShaderKey {
    name: &'static str,
    words: usize,
    hash: u64,
}

impl ShaderKey {
    pub(super) fn new(shader: &Shader, hash: u64) -> Self {
        Self {
            name: shader.name,
            words: shader.words.len(),
            hash,
        }
    }
}

/// Everything that tells two pipelines apart.
#[derive(Clone, PartialEq, Eq, Hash)]
pub(super) enum PipelineKey {
    Compute(ShaderKey, Vec<(u32, u32)>),
    Graphics {
        vertex: ShaderKey,
        fragment: Option<ShaderKey>,
        constants: Vec<(u32, u32)>,
        vertex_layout: Vec<VertexStream>,
        state: (
            vk::PrimitiveTopology,
            vk::CullModeFlags,
            vk::FrontFace,
            Option<DepthState>,
            Blend,
        ),
        formats: (Vec<vk::Format>, Option<vk::Format>),
    },
}

/// One binding of a pipeline, merged over its stages.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct LayoutBinding {
    pub(super) info: BindingInfo,
    pub(super) stages: vk::ShaderStageFlags,
}

/// Everything that tells two pipeline layouts apart.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash)]
pub(super) struct LayoutKey {
    pub(super) bindings: Vec<LayoutBinding>,
    pub(super) push_stages: vk::ShaderStageFlags,
    pub(super) push_bytes: u32,
}

/// Merges the interfaces of a pipeline's stages, or says which binding they disagree on.
pub(super) fn merge_interfaces(shaders: &[&Shader]) -> Result<LayoutKey, String> {
    let mut key = LayoutKey::default();
    for shader in shaders {
        for info in shader.bindings {
            match key
                .bindings
                .iter_mut()
                .find(|b| b.info.binding == info.binding)
            {
                Some(known) if (known.info.kind, known.info.count) == (info.kind, info.count) => {
                    known.stages |= shader.stage;
                }
                Some(known) => {
                    return Err(format!(
                        "binding {} is {:?}[{}] `{}` in one stage and {:?}[{}] `{}` in the other",
                        info.binding,
                        known.info.kind,
                        known.info.count,
                        known.info.name,
                        info.kind,
                        info.count,
                        info.name
                    ));
                }
                None => key.bindings.push(LayoutBinding {
                    info: *info,
                    stages: shader.stage,
                }),
            }
        }
        if shader.push_constant_bytes > 0 {
            key.push_stages |= shader.stage;
            key.push_bytes = key.push_bytes.max(shader.push_constant_bytes);
        }
    }
    key.bindings.sort_by_key(|b| b.info.binding);
    Ok(key)
}

#[cfg(test)]
mod tests {
    use super::*;

    const A: BindingInfo = BindingInfo {
        binding: 3,
        kind: vk::DescriptorType::UNIFORM_BUFFER,
        count: 1,
        name: "camera",
    };
    const B: BindingInfo = BindingInfo {
        binding: 0,
        kind: vk::DescriptorType::STORAGE_BUFFER,
        count: 1,
        name: "items",
    };
    const A_OTHER: BindingInfo = BindingInfo {
        kind: vk::DescriptorType::STORAGE_IMAGE,
        ..A
    };

    fn shader(stage: vk::ShaderStageFlags, bindings: &'static [BindingInfo], push: u32) -> Shader {
        Shader {
            name: "s",
            stage,
            words: &[],
            bindings,
            push_constant_bytes: push,
            workgroup: [0; 3],
        }
    }

    #[test]
    fn stages_share_bindings_and_push_constants() {
        let vertex = shader(vk::ShaderStageFlags::VERTEX, &[A], 16);
        let fragment = shader(vk::ShaderStageFlags::FRAGMENT, &[B, A], 64);
        let key = merge_interfaces(&[&vertex, &fragment]).unwrap();
        let both = vk::ShaderStageFlags::VERTEX | vk::ShaderStageFlags::FRAGMENT;
        assert_eq!(
            key.bindings,
            [
                LayoutBinding {
                    info: B,
                    stages: vk::ShaderStageFlags::FRAGMENT
                },
                LayoutBinding {
                    info: A,
                    stages: both
                }
            ]
        );
        assert_eq!((key.push_stages, key.push_bytes), (both, 64));
    }

    #[test]
    fn stages_that_disagree_are_refused_by_name() {
        let vertex = shader(vk::ShaderStageFlags::VERTEX, &[A], 0);
        let fragment = shader(vk::ShaderStageFlags::FRAGMENT, &[A_OTHER], 0);
        let text = merge_interfaces(&[&vertex, &fragment]).unwrap_err();
        assert!(
            text.contains("binding 3") && text.contains("camera") && text.contains("STORAGE_IMAGE"),
            "{text}"
        );
    }
}
