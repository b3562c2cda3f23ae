//! Compiled shaders and what their interface looks like.

use ash::vk;

/// One descriptor binding of set 0, as declared in the shader.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct BindingInfo {
    /// The binding's number.
    pub binding: u32,
    /// The descriptor type.
    pub kind: vk::DescriptorType,
    /// Array length, 1 when it is no array.
    pub count: u32,
    /// The name of the variable or block in the shader.
    pub name: &'static str,
}

/// A SPIR-V module with one entry point `main` and its reflected interface.
///
/// The modules of `glsl/` are constants in [`spirv`](super::spirv). Bindings are those that the
/// source declares: the optimiser may drop an unused one from the code, but it stays part of the
/// interface and has to be written.
#[derive(Debug)]
pub struct Shader {
    /// Path below `glsl/`, such as `shadow/hard.comp`.
    pub name: &'static str,
    /// The single stage.
    pub stage: vk::ShaderStageFlags,
    /// SPIR-V 1.6.
    pub words: &'static [u32],
    /// Bindings of set 0 in ascending order.
    pub bindings: &'static [BindingInfo],
    /// Size of the push constant block, 0 without one. At most 128.
    pub push_constant_bytes: u32,
    /// Local size of a compute shader with its default specialization constants; zeros for other
    /// stages.
    pub workgroup: [u32; 3],
}

impl Shader {
    /// Number of workgroups that cover `size` invocations in each direction, for the default local
    /// size.
    #[must_use]
    pub fn groups(&self, size: [u32; 3]) -> [u32; 3] {
        std::array::from_fn(|i| size[i].div_ceil(self.workgroup[i].max(1)))
    }
}
