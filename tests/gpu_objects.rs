//! Pipelines, memory and timings on a real driver under the validation layer.

mod support;

use antumbra::ash::vk;
use antumbra::gpu::{
    Blend, ComputePipelineDesc, DepthState, GpuError, GraphicsPipelineDesc, ImageSpec,
    MemoryLocation, Retired, VertexStream,
};
use support::work::{COMPUTE, SCALE, STORAGE, bind, full_barrier, scale};
use support::{compile, destroy_clean, gpu, serial};

#[test]
fn compute_there_and_back() {
    let _one = serial();
    let mut gpu = gpu();
    let shader = compile(COMPUTE, SCALE);
    assert_eq!(
        (
            shader.workgroup,
            shader.push_constant_bytes,
            shader.bindings.len()
        ),
        ([64, 1, 1], 8, 2)
    );
    let input: Vec<u32> = (0..1000).collect();
    let expected = |factor, shift| {
        input
            .iter()
            .map(|i| i * factor + shift)
            .collect::<Vec<u32>>()
    };
    assert_eq!(scale(&mut gpu, shader, None, &input, 3), expected(3, 5));
    assert_eq!(gpu.pipelines_created(), 1);
    assert_eq!(scale(&mut gpu, shader, None, &input, 7), expected(7, 5));
    assert_eq!(
        gpu.pipelines_created(),
        1,
        "the second frame uses the first one's pipeline"
    );
    assert_eq!(
        scale(&mut gpu, shader, Some(100), &input, 7),
        expected(7, 100)
    );
    assert_eq!(
        gpu.pipelines_created(),
        2,
        "another constant is another pipeline"
    );
    let twin = compile(COMPUTE, SCALE);
    assert_eq!(scale(&mut gpu, twin, None, &input, 1), expected(1, 5));
    assert_eq!(
        gpu.pipelines_created(),
        2,
        "the same name and code are the same pipeline"
    );
    assert_eq!(
        (gpu.memory_use().device_bytes, gpu.memory_use().host_bytes),
        (0, 0)
    );
    assert!(gpu.memory_use().peak_host_bytes >= 8000);
    destroy_clean(gpu);
}

#[test]
fn timings_name_their_scopes_once() {
    let _one = serial();
    let mut gpu = gpu();
    let shader = compile(COMPUTE, SCALE);
    let input = vec![1; 4096];
    let _ = scale(&mut gpu, shader, None, &input, 3);
    let times = gpu.collect_timings();
    assert_eq!(times.len(), 1);
    assert_eq!(times[0].0, "scale");
    assert!(times[0].1 > 0.0 && times[0].1 < 60_000.0, "{times:?}");
    assert!(gpu.collect_timings().is_empty());

    // More scopes than a query pool holds, and one that is never ended.
    gpu.run(|gpu, cmd| -> Result<(), GpuError> {
        let _open = gpu.begin_timing(cmd, "open")?;
        for i in 0..300 {
            let id = gpu.begin_timing(cmd, &format!("scope {i}"))?;
            gpu.end_timing(cmd, id);
        }
        Ok(())
    })
    .unwrap();
    let names: Vec<String> = gpu
        .collect_timings()
        .into_iter()
        .map(|(name, _)| name)
        .collect();
    assert_eq!(
        names,
        (0..300).map(|i| format!("scope {i}")).collect::<Vec<_>>()
    );
    destroy_clean(gpu);
}

#[test]
fn a_frame_whose_recording_fails_is_not_submitted() {
    let _one = serial();
    let mut gpu = gpu();
    let failed = gpu.run(|gpu, cmd| -> Result<(), GpuError> {
        let _ = gpu.begin_timing(cmd, "lost")?;
        Err(GpuError::Stale { what: "the test" })
    });
    assert!(matches!(failed, Err(GpuError::Stale { what: "the test" })));
    gpu.run(|_, _| Ok::<_, GpuError>(())).unwrap();
    assert!(gpu.collect_timings().is_empty());
    destroy_clean(gpu);
}

#[test]
fn graphics_with_every_kind_of_state() {
    let _one = serial();
    let mut gpu = gpu();
    let vertex = compile(
        vk::ShaderStageFlags::VERTEX,
        "#version 460
layout(location = 0) in vec2 corner;
layout(location = 1) in float depth;
layout(push_constant) uniform Push { layout(offset = 0) vec2 scale; layout(offset = 8) float value; } push;
void main() { gl_Position = vec4(corner * push.scale, depth, 1.0); }
",
    );
    let fragment = compile(
        vk::ShaderStageFlags::FRAGMENT,
        "#version 460
layout(location = 0) out float color;
layout(push_constant) uniform Push { layout(offset = 0) vec2 scale; layout(offset = 8) float value; } push;
void main() { color = push.value; }
",
    );
    let size = 16;
    let color_format = vk::Format::R32_SFLOAT;
    let depth_format = vk::Format::D32_SFLOAT;
    let color = gpu
        .create_image(
            "colour",
            &ImageSpec::new_2d(
                color_format,
                size,
                size,
                vk::ImageUsageFlags::COLOR_ATTACHMENT | vk::ImageUsageFlags::TRANSFER_SRC,
            ),
        )
        .unwrap();
    let depth = gpu
        .create_image(
            "depth",
            &ImageSpec::new_2d(
                depth_format,
                size,
                size,
                vk::ImageUsageFlags::DEPTH_STENCIL_ATTACHMENT,
            ),
        )
        .unwrap();
    let range = |aspect| vk::ImageSubresourceRange {
        aspect_mask: aspect,
        base_mip_level: 0,
        level_count: 1,
        base_array_layer: 0,
        layer_count: 1,
    };
    let (color_range, depth_range) = (
        range(vk::ImageAspectFlags::COLOR),
        range(vk::ImageAspectFlags::DEPTH),
    );
    let view_2d = vk::ImageViewType::TYPE_2D;
    let color_view = gpu
        .create_view("colour view", color.raw, view_2d, color_format, color_range)
        .unwrap();
    let depth_view = gpu
        .create_view("depth view", depth.raw, view_2d, depth_format, depth_range)
        .unwrap();
    let mut corners = gpu
        .create_buffer(
            "corners",
            3 * 8,
            vk::BufferUsageFlags::VERTEX_BUFFER,
            MemoryLocation::CpuToGpu,
        )
        .unwrap();
    corners
        .mapped_mut()
        .unwrap()
        .copy_from_slice(bytemuck::cast_slice(&[
            -1.0_f32, -1.0, 3.0, -1.0, -1.0, 3.0,
        ]));
    let mut depths = gpu
        .create_buffer(
            "depths",
            3 * 4,
            vk::BufferUsageFlags::VERTEX_BUFFER,
            MemoryLocation::CpuToGpu,
        )
        .unwrap();
    depths
        .mapped_mut()
        .unwrap()
        .copy_from_slice(bytemuck::cast_slice(&[0.25_f32, 0.5, 0.75]));
    let texels = u64::from(size * size);
    let pixels = gpu
        .create_buffer(
            "pixels",
            4 * texels,
            vk::BufferUsageFlags::TRANSFER_DST,
            MemoryLocation::GpuToCpu,
        )
        .unwrap();

    let desc = GraphicsPipelineDesc {
        vertex_layout: vec![
            VertexStream {
                stride: 8,
                attributes: vec![(0, vk::Format::R32G32_SFLOAT, 0)],
                per_instance: false,
            },
            VertexStream {
                stride: 4,
                attributes: vec![(1, vk::Format::R32_SFLOAT, 0)],
                per_instance: true,
            },
        ],
        depth: Some(DepthState {
            compare: vk::CompareOp::GREATER_OR_EQUAL,
            write: true,
        }),
        color_formats: vec![color_format],
        depth_format: Some(depth_format),
        blend: Blend::Max,
        ..GraphicsPipelineDesc::new(vertex, Some(fragment))
    };
    gpu.run(|gpu, cmd| -> Result<(), GpuError> {
        let pipeline = gpu.graphics_pipeline(&desc)?;
        assert_eq!(gpu.graphics_pipeline(&desc)?, pipeline);
        assert!(!pipeline.has_bindings);
        let to = |image, range, layout, stage, access| {
            vk::ImageMemoryBarrier2::default()
                .image(image)
                .subresource_range(range)
                .old_layout(vk::ImageLayout::UNDEFINED)
                .new_layout(layout)
                .dst_stage_mask(stage)
                .dst_access_mask(access)
        };
        let before = [
            to(
                color.raw,
                color_range,
                vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL,
                vk::PipelineStageFlags2::COLOR_ATTACHMENT_OUTPUT,
                vk::AccessFlags2::COLOR_ATTACHMENT_WRITE | vk::AccessFlags2::COLOR_ATTACHMENT_READ,
            ),
            to(
                depth.raw,
                depth_range,
                vk::ImageLayout::DEPTH_ATTACHMENT_OPTIMAL,
                vk::PipelineStageFlags2::EARLY_FRAGMENT_TESTS
                    | vk::PipelineStageFlags2::LATE_FRAGMENT_TESTS,
                vk::AccessFlags2::DEPTH_STENCIL_ATTACHMENT_WRITE
                    | vk::AccessFlags2::DEPTH_STENCIL_ATTACHMENT_READ,
            ),
        ];
        let area = vk::Rect2D {
            extent: vk::Extent2D {
                width: size,
                height: size,
            },
            ..Default::default()
        };
        let colors = [vk::RenderingAttachmentInfo::default()
            .image_view(color_view)
            .image_layout(vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL)
            .load_op(vk::AttachmentLoadOp::CLEAR)
            .store_op(vk::AttachmentStoreOp::STORE)];
        let mut far = vk::ClearValue::default();
        far.depth_stencil = vk::ClearDepthStencilValue {
            depth: 0.6,
            stencil: 0,
        };
        let depth_info = vk::RenderingAttachmentInfo::default()
            .image_view(depth_view)
            .image_layout(vk::ImageLayout::DEPTH_ATTACHMENT_OPTIMAL)
            .load_op(vk::AttachmentLoadOp::CLEAR)
            .store_op(vk::AttachmentStoreOp::DONT_CARE)
            .clear_value(far);
        let rendering = vk::RenderingInfo::default()
            .render_area(area)
            .layer_count(1)
            .color_attachments(&colors)
            .depth_attachment(&depth_info);
        let viewport = vk::Viewport {
            width: size as f32,
            height: size as f32,
            max_depth: 1.0,
            ..Default::default()
        };
        let after = [vk::ImageMemoryBarrier2::default()
            .image(color.raw)
            .subresource_range(color_range)
            .old_layout(vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL)
            .new_layout(vk::ImageLayout::TRANSFER_SRC_OPTIMAL)
            .src_stage_mask(vk::PipelineStageFlags2::COLOR_ATTACHMENT_OUTPUT)
            .src_access_mask(vk::AccessFlags2::COLOR_ATTACHMENT_WRITE)
            .dst_stage_mask(vk::PipelineStageFlags2::COPY)
            .dst_access_mask(vk::AccessFlags2::TRANSFER_READ)];
        let copy = [vk::BufferImageCopy::default()
            .image_subresource(vk::ImageSubresourceLayers {
                aspect_mask: vk::ImageAspectFlags::COLOR,
                mip_level: 0,
                base_array_layer: 0,
                layer_count: 1,
            })
            .image_extent(vk::Extent3D {
                width: size,
                height: size,
                depth: 1,
            })];
        let device = gpu.device().clone();
        // SAFETY: the command buffer is being recorded, and all objects are live.
        unsafe {
            device.cmd_pipeline_barrier2(
                cmd,
                &vk::DependencyInfo::default().image_memory_barriers(&before),
            );
            device.cmd_begin_rendering(cmd, &rendering);
            device.cmd_set_viewport(cmd, 0, &[viewport]);
            device.cmd_set_scissor(cmd, 0, &[area]);
            device.cmd_bind_vertex_buffers(cmd, 0, &[corners.raw, depths.raw], &[0, 0]);
        }
        // Depths 0.25, 0.5 and 0.75 against 0.6 in the buffer: only the third instance passes.
        for (instance, value) in [(0, 9.0_f32), (1, 8.0), (2, 3.0), (2, 2.0)] {
            bind(
                gpu,
                cmd,
                &pipeline,
                None,
                bytemuck::cast_slice(&[1.0, 1.0, value]),
            );
            // SAFETY: as above, inside the rendering.
            unsafe { device.cmd_draw(cmd, 3, 1, 0, instance) };
        }
        // SAFETY: as above.
        unsafe {
            device.cmd_end_rendering(cmd);
            device.cmd_pipeline_barrier2(
                cmd,
                &vk::DependencyInfo::default().image_memory_barriers(&after),
            );
            device.cmd_copy_image_to_buffer(
                cmd,
                color.raw,
                vk::ImageLayout::TRANSFER_SRC_OPTIMAL,
                pixels.raw,
                &copy,
            );
        }
        full_barrier(gpu, cmd);
        Ok(())
    })
    .unwrap();
    let values: &[f32] = bytemuck::cast_slice(pixels.mapped().unwrap());
    assert_eq!(
        values,
        vec![3.0; texels as usize],
        "the greater of the two instances that pass the depth test"
    );
    assert_eq!(gpu.pipelines_created(), 1);

    // Retired objects go with the next frames, in the order in which they were given.
    gpu.retire(Retired::View(color_view));
    gpu.retire(Retired::View(depth_view));
    gpu.retire(Retired::Image(color));
    gpu.retire(Retired::Image(depth));
    gpu.retire(Retired::Buffer(corners));
    gpu.retire(Retired::Buffer(depths));
    gpu.retire(Retired::Buffer(pixels));
    assert!(gpu.memory_use().device_bytes > 0);
    gpu.run(|_, _| Ok::<_, GpuError>(())).unwrap();
    assert_eq!(gpu.memory_use().device_bytes, 0);
    destroy_clean(gpu);
}

#[test]
fn what_vulkan_forbids_is_an_error_before_the_driver_sees_it() {
    let _one = serial();
    let mut gpu = gpu();
    let text = gpu
        .create_buffer("empty", 0, STORAGE, MemoryLocation::GpuOnly)
        .unwrap_err()
        .to_string();
    assert_eq!(text, "empty: a buffer of 0 bytes");
    let usage = vk::ImageUsageFlags::SAMPLED;
    let most = gpu.info().limits.max_image_dimension2_d;
    let sampled = |format, width, height| ImageSpec::new_2d(format, width, height, usage);
    let float = vk::Format::R32_SFLOAT;
    for (spec, part) in [
        (sampled(float, 0, 4), "none may be 0"),
        (sampled(float, most + 1, 4), "beyond the device's"),
        (
            ImageSpec {
                mip_levels: 4,
                ..sampled(float, 4, 4)
            },
            "4 levels",
        ),
        (
            ImageSpec {
                array_layers: 1 << 20,
                ..sampled(float, 4, 4)
            },
            "layers",
        ),
        (sampled(vk::Format::ASTC_12X12_SRGB_BLOCK, 16, 16), ""),
    ] {
        let made = gpu.create_image("strange", &spec);
        match made {
            Err(error) => assert!(
                error.to_string().starts_with("strange: ") && error.to_string().contains(part),
                "{error}"
            ),
            // A driver may know the last format.
            Ok(image) if part.is_empty() => gpu.destroy_image(image),
            Ok(_) => panic!("{spec:?} was taken"),
        }
    }
    let huge = gpu
        .create_buffer("huge", 1 << 46, STORAGE, MemoryLocation::GpuOnly)
        .unwrap_err()
        .to_string();
    assert!(
        huge.starts_with("cannot allocate ") && huge.contains("huge"),
        "{huge}"
    );
    let shader = compile(COMPUTE, SCALE);
    let text = gpu
        .graphics_pipeline(&GraphicsPipelineDesc::new(shader, None))
        .unwrap_err()
        .to_string();
    assert_eq!(
        text,
        "pipeline of test.comp: it is a COMPUTE shader where VERTEX is wanted"
    );
    let twice = ComputePipelineDesc {
        shader,
        constants: vec![(1, 2), (1, 3)],
    };
    let text = gpu.compute_pipeline(&twice).unwrap_err().to_string();
    assert_eq!(
        text,
        "pipeline of test.comp: specialization constant 1 has two values"
    );
    assert_eq!(gpu.memory_use().device_bytes, 0);
    destroy_clean(gpu);
}

#[test]
fn blocks_hold_placed_objects() {
    let _one = serial();
    let mut gpu = gpu();
    let spec = ImageSpec::new_2d(vk::Format::R32_SFLOAT, 64, 64, vk::ImageUsageFlags::SAMPLED);
    let image_needs = gpu.memory_requirements_image(&spec.create_info());
    let buffer_info = vk::BufferCreateInfo::default().size(1000).usage(STORAGE);
    let buffer_needs = gpu.memory_requirements_buffer(&buffer_info);
    assert!(image_needs.size >= 64 * 64 * 4 && buffer_needs.size >= 1000);
    let offset = image_needs.size.next_multiple_of(buffer_needs.alignment);
    let needs = vk::MemoryRequirements {
        size: offset + buffer_needs.size,
        alignment: image_needs.alignment.max(buffer_needs.alignment),
        memory_type_bits: image_needs.memory_type_bits & buffer_needs.memory_type_bits,
    };
    let block = gpu
        .allocate_block("transients", needs, MemoryLocation::GpuOnly)
        .unwrap();
    let image = gpu
        .create_placed_image("placed image", &spec.create_info(), &block, 0)
        .unwrap();
    let buffer = gpu
        .create_placed_buffer("placed buffer", &buffer_info, &block, offset)
        .unwrap();
    gpu.retire(Retired::PlacedImage(image));
    gpu.retire(Retired::PlacedBuffer(buffer));
    gpu.retire(Retired::Block(block, MemoryLocation::GpuOnly));
    assert!(
        gpu.allocate_block(
            "nothing",
            vk::MemoryRequirements::default(),
            MemoryLocation::GpuOnly
        )
        .is_err()
    );
    destroy_clean(gpu);
}
