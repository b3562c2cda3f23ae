//! Pipelines and their layouts, made when first asked for and kept by description.

use std::collections::HashMap;

use ash::vk;

use super::context::Gpu;
use super::error::{CallResult, GpuError};
use super::pipeline_cache::{DiskCache, hash_bytes};
use super::pipeline_desc::{
    Blend, ComputePipelineDesc, GraphicsPipelineDesc, LayoutKey, PipelineHandle, PipelineKey,
    ShaderKey, merge_interfaces,
};
use super::shader::Shader;

/// A pipeline layout with its set layout.
#[derive(Clone, Copy)]
struct Layout {
    set: vk::DescriptorSetLayout,
    pipeline: vk::PipelineLayout,
}

/// What descriptor writes are checked against.
pub(super) struct SetInterface {
    pub(super) key: LayoutKey,
    /// The shaders of the first pipeline with this layout.
    pub(super) shader: String,
}

#[derive(Default)]
pub(super) struct Pipelines {
    by_key: HashMap<PipelineKey, PipelineHandle>,
    layouts: HashMap<LayoutKey, Layout>,
    pub(super) sets: HashMap<vk::DescriptorSetLayout, SetInterface>,
    hashes: HashMap<(usize, usize), u64>,
    pub(super) cache: DiskCache,
}

impl Pipelines {
    fn key(&mut self, shader: &'static Shader) -> ShaderKey {
        // The code is static, so its address stands for it once it was hashed.
        let place = (shader.words.as_ptr() as usize, shader.words.len());
        let hash = *self
            .hashes
            .entry(place)
            .or_insert_with(|| hash_bytes(bytemuck::cast_slice(shader.words)));
        ShaderKey::new(shader, hash)
    }
}

fn sorted(constants: &[(u32, u32)]) -> Vec<(u32, u32)> {
    let mut sorted = constants.to_vec();
    sorted.sort_unstable();
    sorted.dedup();
    sorted
}

/// Specialization constants as Vulkan wants them.
struct Constants {
    entries: Vec<vk::SpecializationMapEntry>,
    data: Vec<u32>,
}

impl Constants {
    fn new(constants: &[(u32, u32)], shader: &str) -> Result<Self, GpuError> {
        if let Some(pair) = constants.windows(2).find(|pair| pair[0].0 == pair[1].0) {
            return Err(GpuError::Pipeline {
                shader: shader.to_owned(),
                problem: format!("specialization constant {} has two values", pair[0].0),
            });
        }
        let entries =
            (0_u32..)
                .zip(constants)
                .map(|(i, &(constant_id, _))| vk::SpecializationMapEntry {
                    constant_id,
                    offset: 4 * i,
                    size: 4,
                });
        Ok(Self {
            entries: entries.collect(),
            data: constants.iter().map(|c| c.1).collect(),
        })
    }

    fn info(&self) -> vk::SpecializationInfo<'_> {
        vk::SpecializationInfo::default()
            .map_entries(&self.entries)
            .data(bytemuck::cast_slice(&self.data))
    }
}

fn blend_state(blend: Blend) -> vk::PipelineColorBlendAttachmentState {
    let (src, dst, op) = match blend {
        Blend::None | Blend::Or => (
            vk::BlendFactor::ONE,
            vk::BlendFactor::ZERO,
            vk::BlendOp::ADD,
        ),
        Blend::Add => (vk::BlendFactor::ONE, vk::BlendFactor::ONE, vk::BlendOp::ADD),
        Blend::Min => (vk::BlendFactor::ONE, vk::BlendFactor::ONE, vk::BlendOp::MIN),
        Blend::Max => (vk::BlendFactor::ONE, vk::BlendFactor::ONE, vk::BlendOp::MAX),
        Blend::Multiply => (
            vk::BlendFactor::DST_COLOR,
            vk::BlendFactor::ZERO,
            vk::BlendOp::ADD,
        ),
    };
    let (src_alpha, dst_alpha) = match blend {
        Blend::Multiply => (vk::BlendFactor::DST_ALPHA, vk::BlendFactor::ZERO),
        _ => (src, dst),
    };
    vk::PipelineColorBlendAttachmentState::default()
        .blend_enable(!matches!(blend, Blend::None | Blend::Or))
        .src_color_blend_factor(src)
        .dst_color_blend_factor(dst)
        .color_blend_op(op)
        .src_alpha_blend_factor(src_alpha)
        .dst_alpha_blend_factor(dst_alpha)
        .alpha_blend_op(op)
        .color_write_mask(vk::ColorComponentFlags::RGBA)
}

fn expect_stage(shader: &Shader, stage: vk::ShaderStageFlags) -> Result<(), GpuError> {
    if shader.stage == stage {
        return Ok(());
    }
    let problem = format!(
        "it is a {:?} shader where {stage:?} is wanted",
        shader.stage
    );
    Err(GpuError::Pipeline {
        shader: shader.name.to_owned(),
        problem,
    })
}

/// Formats with a stencil part need it named even when only depth is used.
fn has_stencil(format: vk::Format) -> bool {
    matches!(
        format,
        vk::Format::D16_UNORM_S8_UINT
            | vk::Format::D24_UNORM_S8_UINT
            | vk::Format::D32_SFLOAT_S8_UINT
    )
}

impl Gpu {
    /// How many pipelines have been created so far.
    #[must_use]
    pub fn pipelines_created(&self) -> usize {
        self.pipelines.by_key.len()
    }

    /// The compute pipeline of a description, created at the first call.
    ///
    /// # Errors
    /// A description that does not fit its shader, or a failing call.
    pub fn compute_pipeline(
        &mut self,
        desc: &ComputePipelineDesc,
    ) -> Result<PipelineHandle, GpuError> {
        expect_stage(desc.shader, vk::ShaderStageFlags::COMPUTE)?;
        let values = sorted(&desc.constants);
        let constants = Constants::new(&values, desc.shader.name)?;
        let key = PipelineKey::Compute(self.pipelines.key(desc.shader), values);
        if let Some(&handle) = self.pipelines.by_key.get(&key) {
            return Ok(handle);
        }
        let name = desc.shader.name;
        let mut handle = self.interface(&[desc.shader], name, vk::PipelineBindPoint::COMPUTE)?;
        let module = self.create_module(desc.shader)?;
        let specialization = constants.info();
        let stage = vk::PipelineShaderStageCreateInfo::default()
            .stage(vk::ShaderStageFlags::COMPUTE)
            .module(module)
            .name(c"main")
            .specialization_info(&specialization);
        let infos = [vk::ComputePipelineCreateInfo::default()
            .stage(stage)
            .layout(handle.layout)];
        // SAFETY: the layout is made from the module's own interface, and every pointer is live.
        let made = unsafe {
            self.device
                .create_compute_pipelines(self.pipelines.cache.raw, &infos, None)
        };
        // SAFETY: ours; pipelines do not need their modules once made.
        unsafe { self.device.destroy_shader_module(module, None) };
        handle.pipeline = self.take_pipeline(made, "vkCreateComputePipelines", name)?;
        self.pipelines.by_key.insert(key, handle);
        Ok(handle)
    }

    /// The graphics pipeline of a description, created at the first call.
    ///
    /// # Errors
    /// A description that does not fit its shaders, or a failing call.
    pub fn graphics_pipeline(
        &mut self,
        desc: &GraphicsPipelineDesc,
    ) -> Result<PipelineHandle, GpuError> {
        expect_stage(desc.vertex, vk::ShaderStageFlags::VERTEX)?;
        let mut shaders = vec![desc.vertex];
        let mut name = desc.vertex.name.to_owned();
        if let Some(fragment) = desc.fragment {
            expect_stage(fragment, vk::ShaderStageFlags::FRAGMENT)?;
            shaders.push(fragment);
            name = format!("{name} + {}", fragment.name);
        }
        if desc.depth.is_some() && desc.depth_format.is_none() {
            let problem = "a depth test without a depth format".to_owned();
            return Err(GpuError::Pipeline {
                shader: name,
                problem,
            });
        }
        let values = sorted(&desc.constants);
        let constants = Constants::new(&values, &name)?;
        let key = PipelineKey::Graphics {
            vertex: self.pipelines.key(desc.vertex),
            fragment: desc.fragment.map(|fragment| self.pipelines.key(fragment)),
            constants: values,
            vertex_layout: desc.vertex_layout.clone(),
            state: (
                desc.topology,
                desc.cull_mode,
                desc.front_face,
                desc.depth,
                desc.blend,
            ),
            formats: (desc.color_formats.clone(), desc.depth_format),
        };
        if let Some(&handle) = self.pipelines.by_key.get(&key) {
            return Ok(handle);
        }
        let mut handle = self.interface(&shaders, &name, vk::PipelineBindPoint::GRAPHICS)?;
        let mut modules = Vec::new();
        let mut made = Ok(());
        for shader in &shaders {
            match self.create_module(shader) {
                Ok(module) => modules.push(module),
                Err(error) => made = Err(error),
            }
        }
        let made = made.and_then(|()| {
            self.create_graphics(desc, &shaders, &modules, &constants, handle.layout, &name)
        });
        for module in modules {
            // SAFETY: ours; pipelines do not need their modules once made.
            unsafe { self.device.destroy_shader_module(module, None) };
        }
        handle.pipeline = made?;
        self.pipelines.by_key.insert(key, handle);
        Ok(handle)
    }

    fn create_graphics(
        &self,
        desc: &GraphicsPipelineDesc,
        shaders: &[&'static Shader],
        modules: &[vk::ShaderModule],
        constants: &Constants,
        layout: vk::PipelineLayout,
        name: &str,
    ) -> Result<vk::Pipeline, GpuError> {
        let specialization = constants.info();
        let stages: Vec<_> = shaders
            .iter()
            .zip(modules)
            .map(|(shader, &module)| {
                vk::PipelineShaderStageCreateInfo::default()
                    .stage(shader.stage)
                    .module(module)
                    .name(c"main")
                    .specialization_info(&specialization)
            })
            .collect();
        let mut bindings = Vec::new();
        let mut attributes = Vec::new();
        for (binding, stream) in (0_u32..).zip(&desc.vertex_layout) {
            bindings.push(vk::VertexInputBindingDescription {
                binding,
                stride: stream.stride,
                input_rate: if stream.per_instance {
                    vk::VertexInputRate::INSTANCE
                } else {
                    vk::VertexInputRate::VERTEX
                },
            });
            attributes.extend(stream.attributes.iter().map(|&(location, format, offset)| {
                vk::VertexInputAttributeDescription {
                    location,
                    binding,
                    format,
                    offset,
                }
            }));
        }
        let vertex_input = vk::PipelineVertexInputStateCreateInfo::default()
            .vertex_binding_descriptions(&bindings)
            .vertex_attribute_descriptions(&attributes);
        let assembly = vk::PipelineInputAssemblyStateCreateInfo::default().topology(desc.topology);
        let viewport = vk::PipelineViewportStateCreateInfo::default()
            .viewport_count(1)
            .scissor_count(1);
        let raster = vk::PipelineRasterizationStateCreateInfo::default()
            .polygon_mode(vk::PolygonMode::FILL)
            .cull_mode(desc.cull_mode)
            .front_face(desc.front_face)
            .line_width(1.0);
        let samples = vk::PipelineMultisampleStateCreateInfo::default()
            .rasterization_samples(vk::SampleCountFlags::TYPE_1);
        let mut depth = vk::PipelineDepthStencilStateCreateInfo::default();
        if let Some(state) = desc.depth {
            depth = depth
                .depth_test_enable(true)
                .depth_write_enable(state.write)
                .depth_compare_op(state.compare);
        }
        let attachments = vec![blend_state(desc.blend); desc.color_formats.len()];
        let blend = vk::PipelineColorBlendStateCreateInfo::default()
            .logic_op_enable(desc.blend == Blend::Or)
            .logic_op(vk::LogicOp::OR)
            .attachments(&attachments);
        let dynamic = vk::PipelineDynamicStateCreateInfo::default()
            .dynamic_states(&[vk::DynamicState::VIEWPORT, vk::DynamicState::SCISSOR]);
        let depth_format = desc.depth_format.unwrap_or(vk::Format::UNDEFINED);
        let stencil_format = if has_stencil(depth_format) {
            depth_format
        } else {
            vk::Format::UNDEFINED
        };
        let mut rendering = vk::PipelineRenderingCreateInfo::default()
            .color_attachment_formats(&desc.color_formats)
            .depth_attachment_format(depth_format)
            .stencil_attachment_format(stencil_format);
        let infos = [vk::GraphicsPipelineCreateInfo::default()
            .stages(&stages)
            .vertex_input_state(&vertex_input)
            .input_assembly_state(&assembly)
            .viewport_state(&viewport)
            .rasterization_state(&raster)
            .multisample_state(&samples)
            .depth_stencil_state(&depth)
            .color_blend_state(&blend)
            .dynamic_state(&dynamic)
            .layout(layout)
            .push_next(&mut rendering)];
        // SAFETY: the layout is made from the modules' own interfaces, and every pointer is live.
        let made = unsafe {
            self.device
                .create_graphics_pipelines(self.pipelines.cache.raw, &infos, None)
        };
        self.take_pipeline(made, "vkCreateGraphicsPipelines", name)
    }

    fn create_module(&self, shader: &Shader) -> Result<vk::ShaderModule, GpuError> {
        let info = vk::ShaderModuleCreateInfo::default().code(shader.words);
        // SAFETY: the words are SPIR-V; those of `glsl/` are validated by the tests.
        let module = unsafe { self.device.create_shader_module(&info, None) }
            .call("vkCreateShaderModule", shader.name)?;
        self.set_name(module, shader.name);
        Ok(module)
    }

    fn take_pipeline(
        &self,
        made: Result<Vec<vk::Pipeline>, (Vec<vk::Pipeline>, vk::Result)>,
        call: &'static str,
        name: &str,
    ) -> Result<vk::Pipeline, GpuError> {
        let pipeline = made
            .map_err(|(_, result)| result)
            .call(call, name)?
            .first()
            .copied()
            .unwrap_or_default();
        self.set_name(pipeline, name);
        Ok(pipeline)
    }

    /// A handle with everything but the pipeline.
    fn interface(
        &mut self,
        shaders: &[&'static Shader],
        name: &str,
        bind_point: vk::PipelineBindPoint,
    ) -> Result<PipelineHandle, GpuError> {
        let key = merge_interfaces(shaders).map_err(|problem| GpuError::Pipeline {
            shader: name.to_owned(),
            problem,
        })?;
        let limit = self.info.limits.max_push_constants_size;
        if key.push_bytes > limit {
            let problem = format!(
                "{} bytes of push constants; the device takes {limit}",
                key.push_bytes
            );
            return Err(GpuError::Pipeline {
                shader: name.to_owned(),
                problem,
            });
        }
        let (push_stages, push_bytes, has_bindings) =
            (key.push_stages, key.push_bytes, !key.bindings.is_empty());
        let layout = self.layout(key, name)?;
        Ok(PipelineHandle {
            pipeline: vk::Pipeline::null(),
            layout: layout.pipeline,
            set_layout: layout.set,
            bind_point,
            push_stages,
            push_bytes,
            has_bindings,
        })
    }

    fn layout(&mut self, key: LayoutKey, name: &str) -> Result<Layout, GpuError> {
        if let Some(&layout) = self.pipelines.layouts.get(&key) {
            return Ok(layout);
        }
        let bindings: Vec<_> = key
            .bindings
            .iter()
            .map(|b| {
                vk::DescriptorSetLayoutBinding::default()
                    .binding(b.info.binding)
                    .descriptor_type(b.info.kind)
                    .descriptor_count(b.info.count)
                    .stage_flags(b.stages)
            })
            .collect();
        let set_info = vk::DescriptorSetLayoutCreateInfo::default().bindings(&bindings);
        // SAFETY: the description is complete.
        let set = unsafe { self.device.create_descriptor_set_layout(&set_info, None) }
            .call("vkCreateDescriptorSetLayout", name)?;
        self.set_name(set, &format!("set of {name}"));
        let sets = [set];
        let ranges = [vk::PushConstantRange {
            stage_flags: key.push_stages,
            offset: 0,
            size: key.push_bytes,
        }];
        let mut info = vk::PipelineLayoutCreateInfo::default().set_layouts(&sets);
        if key.push_bytes > 0 {
            info = info.push_constant_ranges(&ranges);
        }
        // SAFETY: the set layout is live and the range within the device's limit.
        let made = unsafe { self.device.create_pipeline_layout(&info, None) };
        let pipeline = match made.call("vkCreatePipelineLayout", name) {
            Ok(pipeline) => pipeline,
            Err(error) => {
                // SAFETY: just created and never used.
                unsafe { self.device.destroy_descriptor_set_layout(set, None) };
                return Err(error);
            }
        };
        self.set_name(pipeline, &format!("layout of {name}"));
        let layout = Layout { set, pipeline };
        self.pipelines.sets.insert(
            set,
            SetInterface {
                key: key.clone(),
                shader: name.to_owned(),
            },
        );
        self.pipelines.layouts.insert(key, layout);
        Ok(layout)
    }

    pub(super) fn destroy_pipelines(&mut self) {
        self.destroy_cache();
        for (_, handle) in self.pipelines.by_key.drain() {
            // SAFETY: ours, and the device is idle.
            unsafe { self.device.destroy_pipeline(handle.pipeline, None) };
        }
        for (_, layout) in self.pipelines.layouts.drain() {
            // SAFETY: ours, and its pipelines are gone.
            unsafe {
                self.device.destroy_pipeline_layout(layout.pipeline, None);
                self.device.destroy_descriptor_set_layout(layout.set, None);
            }
        }
    }
}
