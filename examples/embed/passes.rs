//! The host's own passes: a G-buffer before the shadow, lighting after it.

use antumbra::ash::vk;
use antumbra::renderer::PixelCamera;
use antumbra::scene::SceneCamera;
use glam::{Mat4, Vec3};

use super::host::{Buffer, Host, Image, extent_3d, whole};
use super::{Outcome, SIZE, normal_of};

const SURFACE_VERT: &str = "#version 460
layout(location = 0) in vec3 position;
layout(location = 1) in vec3 normal;
layout(location = 0) out vec3 p;
layout(location = 1) flat out vec3 n;
layout(push_constant) uniform Push { mat4 clip; vec4 eye; vec4 forward; };
void main() {
    p = position;
    n = normal;
    gl_Position = clip * vec4(position, 1.0);
}";

// What antumbra asks of a G-buffer: distance along the view direction in metres, and the geometric
// normal, turned to the camera, octahedral in 32 bits.
const SURFACE_FRAG: &str = "#version 460
layout(location = 0) in vec3 p;
layout(location = 1) flat in vec3 n;
layout(location = 0) out float view_depth;
layout(location = 1) out uint normal;
layout(push_constant) uniform Push { mat4 clip; vec4 eye; vec4 forward; };
void main() {
    view_depth = dot(p - eye.xyz, forward.xyz);
    vec3 v = dot(n, p - eye.xyz) > 0.0 ? -n : n;
    vec2 o = v.xy / (abs(v.x) + abs(v.y) + abs(v.z));
    vec2 signs = mix(vec2(-1.0), vec2(1.0), greaterThanEqual(o, vec2(0.0)));
    normal = packSnorm2x16(v.z < 0.0 ? (1.0 - abs(o.yx)) * signs : o);
}";

const SCREEN_VERT: &str = "#version 460
void main() {
    gl_Position = vec4(vec2(gl_VertexIndex & 1, gl_VertexIndex >> 1) * 4.0 - 1.0, 0.0, 1.0);
}";

const LIGHTING_FRAG: &str = "#version 460
layout(set = 0, binding = 0) uniform sampler2D view_depth;
layout(set = 0, binding = 1) uniform usampler2D normal;
layout(set = 0, binding = 2) uniform sampler2D mask;
layout(location = 0) out vec4 color;
layout(push_constant) uniform Push { vec4 eye; vec4 corner; vec4 right; vec4 down; vec4 lamp; };
void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    float depth = texelFetch(view_depth, pixel, 0).x;
    vec2 o = unpackSnorm2x16(texelFetch(normal, pixel, 0).x);
    vec3 n = vec3(o, 1.0 - abs(o.x) - abs(o.y));
    vec2 signs = mix(vec2(-1.0), vec2(1.0), greaterThanEqual(o, vec2(0.0)));
    n = normalize(n.z < 0.0 ? vec3((1.0 - abs(o.yx)) * signs, n.z) : n);
    vec3 ray = corner.xyz + gl_FragCoord.x * right.xyz + gl_FragCoord.y * down.xyz;
    vec3 l = lamp.xyz - (eye.xyz + depth * ray);
    float light = max(dot(n, normalize(l)), 0.0) * 16.0 / dot(l, l) * texelFetch(mask, pixel, 0).x;
    color = vec4(depth > 0.0 ? sqrt(vec3(0.04, 0.05, 0.06) + 0.7 * vec3(1.0, 0.9, 0.8) * light)
                             : vec3(0.2, 0.3, 0.4), 1.0);
}";

/// Images, pipelines and vertices of the host's passes.
pub struct Passes {
    pub view_depth: Image,
    pub normal: Image,
    pub mask: Image,
    pub picture: Buffer,
    depth: Image,
    color: Image,
    vertices: Buffer,
    vertex_count: u32,
    surface: Pipeline,
    lighting: Pipeline,
    set_layout: vk::DescriptorSetLayout,
    pool: vk::DescriptorPool,
    set: vk::DescriptorSet,
    sampler: vk::Sampler,
}

struct Pipeline {
    raw: vk::Pipeline,
    layout: vk::PipelineLayout,
}

impl Passes {
    pub fn new(host: &Host, triangles: &[[Vec3; 3]]) -> Outcome<Self> {
        use vk::{BufferUsageFlags as B, Format as F, ImageUsageFlags as U};
        let attachment = U::COLOR_ATTACHMENT | U::SAMPLED;
        let view_depth = Image::new(host, F::R32_SFLOAT, attachment)?;
        let normal = Image::new(host, F::R32_UINT, attachment)?;
        let mask = Image::new(host, F::R32_SFLOAT, U::TRANSFER_DST | U::SAMPLED)?;
        let depth = Image::new(host, F::D32_SFLOAT, U::DEPTH_STENCIL_ATTACHMENT)?;
        let color = Image::new(
            host,
            F::R8G8B8A8_UNORM,
            U::COLOR_ATTACHMENT | U::TRANSFER_SRC,
        )?;
        let picture = Buffer::new(host, (SIZE * SIZE * 4) as usize, B::TRANSFER_DST)?;
        let corners: Vec<f32> = triangles
            .iter()
            .flat_map(|triangle| {
                let normal = normal_of(triangle);
                triangle.map(|p| [p.to_array(), normal.to_array()])
            })
            .flatten()
            .flatten()
            .collect();
        let bytes: &[u8] = bytemuck::cast_slice(&corners);
        let vertices = Buffer::new(host, bytes.len(), B::VERTEX_BUFFER)?;
        vertices.write(host, bytes)?;
        let vertex_count = 3 * triangles.len() as u32;

        let device = &host.device;
        // SAFETY: plain creation from live objects; the set is written before it is used.
        let (set_layout, pool, set, sampler) = unsafe {
            let sampler = device.create_sampler(&Default::default(), None)?;
            let kind = vk::DescriptorType::COMBINED_IMAGE_SAMPLER;
            let bindings: Vec<_> = (0..3)
                .map(|binding| {
                    vk::DescriptorSetLayoutBinding::default()
                        .binding(binding)
                        .descriptor_type(kind)
                        .descriptor_count(1)
                        .stage_flags(vk::ShaderStageFlags::FRAGMENT)
                })
                .collect();
            let info = vk::DescriptorSetLayoutCreateInfo::default().bindings(&bindings);
            let set_layout = device.create_descriptor_set_layout(&info, None)?;
            let sizes = [vk::DescriptorPoolSize {
                ty: kind,
                descriptor_count: 3,
            }];
            let info = vk::DescriptorPoolCreateInfo::default()
                .max_sets(1)
                .pool_sizes(&sizes);
            let pool = device.create_descriptor_pool(&info, None)?;
            let layouts = [set_layout];
            let info = vk::DescriptorSetAllocateInfo::default()
                .descriptor_pool(pool)
                .set_layouts(&layouts);
            let set = device.allocate_descriptor_sets(&info)?[0];
            for (binding, image) in (0..).zip([&view_depth, &normal, &mask]) {
                let images = [vk::DescriptorImageInfo {
                    sampler,
                    image_view: image.view,
                    image_layout: vk::ImageLayout::SHADER_READ_ONLY_OPTIMAL,
                }];
                let write = vk::WriteDescriptorSet::default()
                    .dst_set(set)
                    .dst_binding(binding)
                    .descriptor_type(kind)
                    .image_info(&images);
                device.update_descriptor_sets(&[write], &[]);
            }
            (set_layout, pool, set, sampler)
        };
        let surface = Pipeline::new(
            host,
            [SURFACE_VERT, SURFACE_FRAG],
            &[view_depth.format, normal.format],
            Some(depth.format),
            &[],
            size_of::<SurfacePush>(),
        )?;
        let lighting = Pipeline::new(
            host,
            [SCREEN_VERT, LIGHTING_FRAG],
            &[color.format],
            None,
            &[set_layout],
            size_of::<LightingPush>(),
        )?;
        Ok(Self {
            view_depth,
            normal,
            mask,
            picture,
            depth,
            color,
            vertices,
            vertex_count,
            surface,
            lighting,
            set_layout,
            pool,
            set,
            sampler,
        })
    }

    /// The surface at each pixel. Leaves it as attachments just written.
    pub fn draw_surfaces(&self, host: &Host, cmd: vk::CommandBuffer, camera: &SceneCamera) {
        let push = SurfacePush {
            clip: camera.view_projection_reversed(1.0),
            eye: camera.position.extend(0.0).to_array(),
            forward: camera.forward.extend(0.0).to_array(),
        };
        let targets = [&self.view_depth, &self.normal];
        begin(host, cmd, &targets, Some(&self.depth));
        // SAFETY: the command buffer is recording, and all objects outlive its execution.
        unsafe {
            let device = &host.device;
            device.cmd_bind_pipeline(cmd, vk::PipelineBindPoint::GRAPHICS, self.surface.raw);
            device.cmd_push_constants(
                cmd,
                self.surface.layout,
                STAGES,
                0,
                bytemuck::bytes_of(&push),
            );
            device.cmd_bind_vertex_buffers(cmd, 0, &[self.vertices.raw], &[0]);
            device.cmd_draw(cmd, self.vertex_count, 1, 0, 0);
            device.cmd_end_rendering(cmd);
        }
    }

    /// The picture, lit through the mask, and its copy to where the CPU reads it.
    pub fn draw_lighting(
        &self,
        host: &Host,
        cmd: vk::CommandBuffer,
        camera: &SceneCamera,
        lamp: Vec3,
    ) {
        let push = LightingPush {
            camera: PixelCamera::new(camera, [SIZE; 2]),
            lamp: lamp.extend(0.0).to_array(),
        };
        begin(host, cmd, &[&self.color], None);
        // SAFETY: as above.
        unsafe {
            let device = &host.device;
            let bind_point = vk::PipelineBindPoint::GRAPHICS;
            let layout = self.lighting.layout;
            device.cmd_bind_pipeline(cmd, bind_point, self.lighting.raw);
            device.cmd_bind_descriptor_sets(cmd, bind_point, layout, 0, &[self.set], &[]);
            device.cmd_push_constants(cmd, layout, STAGES, 0, bytemuck::bytes_of(&push));
            device.cmd_draw(cmd, 3, 1, 0, 0);
            device.cmd_end_rendering(cmd);
            let drawn = vk::ImageMemoryBarrier2::default()
                .src_stage_mask(vk::PipelineStageFlags2::COLOR_ATTACHMENT_OUTPUT)
                .src_access_mask(vk::AccessFlags2::COLOR_ATTACHMENT_WRITE)
                .dst_stage_mask(vk::PipelineStageFlags2::COPY)
                .dst_access_mask(vk::AccessFlags2::TRANSFER_READ)
                .old_layout(vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL)
                .new_layout(vk::ImageLayout::TRANSFER_SRC_OPTIMAL)
                .image(self.color.raw)
                .subresource_range(whole(vk::ImageAspectFlags::COLOR));
            barrier(host, cmd, &[drawn], &[]);
            let region = vk::BufferImageCopy::default()
                .image_subresource(vk::ImageSubresourceLayers {
                    aspect_mask: vk::ImageAspectFlags::COLOR,
                    layer_count: 1,
                    ..Default::default()
                })
                .image_extent(extent_3d());
            device.cmd_copy_image_to_buffer(
                cmd,
                self.color.raw,
                vk::ImageLayout::TRANSFER_SRC_OPTIMAL,
                self.picture.raw,
                &[region],
            );
            // For the CPU, and for the next frame's copy.
            let copied = vk::MemoryBarrier2::default()
                .src_stage_mask(vk::PipelineStageFlags2::COPY)
                .src_access_mask(vk::AccessFlags2::TRANSFER_WRITE)
                .dst_stage_mask(vk::PipelineStageFlags2::HOST | vk::PipelineStageFlags2::COPY)
                .dst_access_mask(vk::AccessFlags2::HOST_READ | vk::AccessFlags2::TRANSFER_WRITE);
            barrier(host, cmd, &[], &[copied]);
        }
    }

    pub fn destroy(&self, host: &Host) {
        for image in [
            &self.view_depth,
            &self.normal,
            &self.mask,
            &self.depth,
            &self.color,
        ] {
            image.destroy(host);
        }
        self.picture.destroy(host);
        self.vertices.destroy(host);
        // SAFETY: the device is idle.
        unsafe {
            for pipeline in [&self.surface, &self.lighting] {
                host.device.destroy_pipeline(pipeline.raw, None);
                host.device.destroy_pipeline_layout(pipeline.layout, None);
            }
            host.device.destroy_descriptor_pool(self.pool, None);
            host.device
                .destroy_descriptor_set_layout(self.set_layout, None);
            host.device.destroy_sampler(self.sampler, None);
        }
    }
}

const STAGES: vk::ShaderStageFlags = vk::ShaderStageFlags::from_raw(
    vk::ShaderStageFlags::VERTEX.as_raw() | vk::ShaderStageFlags::FRAGMENT.as_raw(),
);

#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
struct SurfacePush {
    clip: Mat4,
    eye: [f32; 4],
    forward: [f32; 4],
}

#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
struct LightingPush {
    camera: PixelCamera,
    lamp: [f32; 4],
}

fn barrier(
    host: &Host,
    cmd: vk::CommandBuffer,
    images: &[vk::ImageMemoryBarrier2<'_>],
    memory: &[vk::MemoryBarrier2<'_>],
) {
    let info = vk::DependencyInfo::default()
        .image_memory_barriers(images)
        .memory_barriers(memory);
    // SAFETY: the command buffer is recording.
    unsafe { host.device.cmd_pipeline_barrier2(cmd, &info) };
}

/// Begins rendering to attachments whose contents are replaced, after everything that still uses them.
fn begin(host: &Host, cmd: vk::CommandBuffer, targets: &[&Image], depth: Option<&Image>) {
    let before = |image: &Image, aspect, layout| {
        vk::ImageMemoryBarrier2::default()
            .src_stage_mask(vk::PipelineStageFlags2::ALL_COMMANDS)
            .src_access_mask(vk::AccessFlags2::MEMORY_WRITE)
            .dst_stage_mask(vk::PipelineStageFlags2::ALL_GRAPHICS)
            .dst_access_mask(vk::AccessFlags2::MEMORY_READ | vk::AccessFlags2::MEMORY_WRITE)
            .new_layout(layout)
            .image(image.raw)
            .subresource_range(whole(aspect))
    };
    let color_layout = vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL;
    let depth_layout = vk::ImageLayout::DEPTH_ATTACHMENT_OPTIMAL;
    let mut barriers: Vec<_> = targets
        .iter()
        .map(|image| before(image, vk::ImageAspectFlags::COLOR, color_layout))
        .collect();
    barriers.extend(depth.map(|image| before(image, vk::ImageAspectFlags::DEPTH, depth_layout)));
    barrier(host, cmd, &barriers, &[]);
    let attachment = |image: &Image, layout, store_op| {
        vk::RenderingAttachmentInfo::default()
            .image_view(image.view)
            .image_layout(layout)
            .load_op(vk::AttachmentLoadOp::CLEAR)
            .store_op(store_op)
    };
    let store = vk::AttachmentStoreOp::STORE;
    let colors: Vec<_> = targets
        .iter()
        .map(|image| attachment(image, color_layout, store))
        .collect();
    let depth =
        depth.map(|image| attachment(image, depth_layout, vk::AttachmentStoreOp::DONT_CARE));
    let mut info = vk::RenderingInfo::default()
        .render_area(area())
        .layer_count(1)
        .color_attachments(&colors);
    if let Some(depth) = &depth {
        info = info.depth_attachment(depth);
    }
    let viewport = vk::Viewport {
        width: SIZE as f32,
        height: SIZE as f32,
        max_depth: 1.0,
        ..Default::default()
    };
    // SAFETY: the command buffer is recording, and the images are in these layouts.
    unsafe {
        host.device.cmd_begin_rendering(cmd, &info);
        host.device.cmd_set_viewport(cmd, 0, &[viewport]);
        host.device.cmd_set_scissor(cmd, 0, &[area()]);
    }
}

fn area() -> vk::Rect2D {
    vk::Rect2D {
        offset: vk::Offset2D::default(),
        extent: vk::Extent2D {
            width: SIZE,
            height: SIZE,
        },
    }
}

impl Pipeline {
    fn new(
        host: &Host,
        sources: [&str; 2],
        colors: &[vk::Format],
        depth: Option<vk::Format>,
        sets: &[vk::DescriptorSetLayout],
        push_bytes: usize,
    ) -> Outcome<Self> {
        let device = &host.device;
        let ranges = [vk::PushConstantRange {
            stage_flags: STAGES,
            offset: 0,
            size: push_bytes as u32,
        }];
        let info = vk::PipelineLayoutCreateInfo::default()
            .set_layouts(sets)
            .push_constant_ranges(&ranges);
        let floats = |location, offset| vk::VertexInputAttributeDescription {
            location,
            binding: 0,
            format: vk::Format::R32G32B32_SFLOAT,
            offset,
        };
        let attributes = [floats(0, 0), floats(1, 12)];
        let streams = [vk::VertexInputBindingDescription {
            binding: 0,
            stride: 24,
            input_rate: vk::VertexInputRate::VERTEX,
        }];
        let mut input = vk::PipelineVertexInputStateCreateInfo::default();
        if depth.is_some() {
            input = input
                .vertex_attribute_descriptions(&attributes)
                .vertex_binding_descriptions(&streams);
        }
        let assembly = vk::PipelineInputAssemblyStateCreateInfo::default()
            .topology(vk::PrimitiveTopology::TRIANGLE_LIST);
        let viewport = vk::PipelineViewportStateCreateInfo::default()
            .viewport_count(1)
            .scissor_count(1);
        let raster = vk::PipelineRasterizationStateCreateInfo::default().line_width(1.0);
        let samples = vk::PipelineMultisampleStateCreateInfo::default()
            .rasterization_samples(vk::SampleCountFlags::TYPE_1);
        // Depth is reversed: 1 near the camera, 0 far away.
        let test = vk::PipelineDepthStencilStateCreateInfo::default()
            .depth_test_enable(depth.is_some())
            .depth_write_enable(depth.is_some())
            .depth_compare_op(vk::CompareOp::GREATER);
        let blend = vk::PipelineColorBlendAttachmentState {
            color_write_mask: vk::ColorComponentFlags::RGBA,
            ..Default::default()
        };
        let blends = vec![blend; colors.len()];
        let blend = vk::PipelineColorBlendStateCreateInfo::default().attachments(&blends);
        let dynamic = [vk::DynamicState::VIEWPORT, vk::DynamicState::SCISSOR];
        let dynamic = vk::PipelineDynamicStateCreateInfo::default().dynamic_states(&dynamic);
        let mut rendering = vk::PipelineRenderingCreateInfo::default()
            .color_attachment_formats(colors)
            .depth_attachment_format(depth.unwrap_or_default());
        let kinds = [shaderc::ShaderKind::Vertex, shaderc::ShaderKind::Fragment];
        let flags = [vk::ShaderStageFlags::VERTEX, vk::ShaderStageFlags::FRAGMENT];
        let compiler = shaderc::Compiler::new()?;
        // SAFETY: the modules and all structures live until the pipeline is made.
        unsafe {
            let mut modules = Vec::new();
            for (source, kind) in sources.into_iter().zip(kinds) {
                let spirv = compiler.compile_into_spirv(source, kind, "host", "main", None)?;
                let info = vk::ShaderModuleCreateInfo::default().code(spirv.as_binary());
                modules.push(device.create_shader_module(&info, None)?);
            }
            let stages: Vec<_> = modules
                .iter()
                .zip(flags)
                .map(|(module, stage)| {
                    vk::PipelineShaderStageCreateInfo::default()
                        .stage(stage)
                        .module(*module)
                        .name(c"main")
                })
                .collect();
            let layout = device.create_pipeline_layout(&info, None)?;
            let info = vk::GraphicsPipelineCreateInfo::default()
                .stages(&stages)
                .vertex_input_state(&input)
                .input_assembly_state(&assembly)
                .viewport_state(&viewport)
                .rasterization_state(&raster)
                .multisample_state(&samples)
                .depth_stencil_state(&test)
                .color_blend_state(&blend)
                .dynamic_state(&dynamic)
                .layout(layout)
                .push_next(&mut rendering);
            let made = device.create_graphics_pipelines(Default::default(), &[info], None);
            let raw = made.map_err(|(_, error)| error)?[0];
            for module in modules {
                device.destroy_shader_module(module, None);
            }
            Ok(Self { raw, layout })
        }
    }
}
