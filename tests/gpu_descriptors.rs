//! Descriptor sets of every kind, and what is refused, on a real driver under the validation layer.

mod support;

use antumbra::ash::vk;
use antumbra::gpu::{
    ComputePipelineDesc, GpuError, ImageSpec, MemoryLocation, SamplerDesc, SetResource, SetWrite,
};
use support::work::{COMPUTE, SCALE, STORAGE, bind, full_barrier, storage};
use support::{compile, destroy_clean, gpu, serial};

#[test]
fn descriptors_are_checked_against_the_shader() {
    let _one = serial();
    let mut gpu = gpu();
    let shader = compile(COMPUTE, SCALE);
    let buffer = gpu
        .create_buffer("any", 256, STORAGE, MemoryLocation::GpuOnly)
        .unwrap();
    let resource = storage(buffer.raw);
    let sampler = gpu.sampler(&SamplerDesc::linear()).unwrap();
    let mut old_set = vk::DescriptorSet::null();
    gpu.run(|gpu, _| -> Result<(), GpuError> {
        let pipeline = gpu.compute_pipeline(&ComputePipelineDesc::new(shader))?;
        let set = gpu.allocate_set(&pipeline)?;
        let error = |writes: &[SetWrite]| gpu.write_set(set, writes).unwrap_err().to_string();
        let first = SetWrite {
            binding: 0,
            resource,
        };
        assert_eq!(
            error(&[first]),
            "descriptors of test.comp: binding 1 (Out) has 0 of 1 written; all are needed"
        );
        assert_eq!(
            error(&[first, first]),
            "descriptors of test.comp: binding 0 (In) takes 1, but was given more"
        );
        let text = error(&[
            first,
            SetWrite {
                binding: 1,
                resource: SetResource::Sampler(sampler),
            },
        ]);
        assert_eq!(
            text,
            "descriptors of test.comp: binding 1 (Out) is STORAGE_BUFFER, but was given SAMPLER"
        );
        let text = error(&[SetWrite {
            binding: 9,
            resource,
        }]);
        assert_eq!(
            text,
            "descriptors of test.comp: binding 9 (?) is not declared in the shader"
        );
        gpu.write_set(
            set,
            &[
                SetWrite {
                    binding: 1,
                    resource,
                },
                first,
            ],
        )?;
        old_set = set;
        Ok(())
    })
    .unwrap();
    gpu.begin_frame().unwrap();
    let writes = [
        SetWrite {
            binding: 0,
            resource,
        },
        SetWrite {
            binding: 1,
            resource,
        },
    ];
    assert!(matches!(
        gpu.write_set(old_set, &writes),
        Err(GpuError::Stale { .. })
    ));
    gpu.destroy_buffer(buffer);
    destroy_clean(gpu);
}

#[test]
fn every_kind_of_descriptor_can_be_written_and_used() {
    let _one = serial();
    let mut gpu = gpu();
    let shader = compile(
        COMPUTE,
        "#version 460
layout(local_size_x = 1) in;
layout(binding = 0) uniform sampler2D combined[2];
layout(binding = 1) uniform texture2D separate;
layout(binding = 2) uniform sampler smp;
layout(binding = 3, r32f) uniform image2D stored;
layout(binding = 4) uniform Block { float value; } block;
layout(binding = 5, std430) buffer Out { float result[]; };
layout(binding = 6) uniform samplerBuffer texels;
layout(binding = 7, r32f) uniform imageBuffer stored_texels;
layout(binding = 8) uniform sampler2DShadow never_used;
void main() {
    imageStore(stored, ivec2(0), vec4(4.0));
    imageStore(stored_texels, 0, vec4(16.0));
    result[0] = texelFetch(combined[1], ivec2(0), 0).x + textureLod(sampler2D(separate, smp), vec2(0.5), 0.0).x;
    result[1] = block.value;
    result[2] = texelFetch(texels, 1).x;
}
",
    );
    let format = vk::Format::R32_SFLOAT;
    let usage = vk::ImageUsageFlags::SAMPLED
        | vk::ImageUsageFlags::STORAGE
        | vk::ImageUsageFlags::TRANSFER_DST;
    let image = gpu
        .create_image("image", &ImageSpec::new_2d(format, 2, 2, usage))
        .unwrap();
    let target = gpu
        .create_image("target", &ImageSpec::new_2d(format, 2, 2, usage))
        .unwrap();
    let depth_usage = vk::ImageUsageFlags::SAMPLED | vk::ImageUsageFlags::TRANSFER_DST;
    let depth_format = vk::Format::D32_SFLOAT;
    let depth = gpu
        .create_image("depth", &ImageSpec::new_2d(depth_format, 2, 2, depth_usage))
        .unwrap();
    let range = |aspect_mask| vk::ImageSubresourceRange {
        aspect_mask,
        level_count: 1,
        layer_count: 1,
        ..Default::default()
    };
    let (color, depth_range) = (
        range(vk::ImageAspectFlags::COLOR),
        range(vk::ImageAspectFlags::DEPTH),
    );
    let d2 = vk::ImageViewType::TYPE_2D;
    let view = gpu
        .create_view("view", image.raw, d2, format, color)
        .unwrap();
    let target_view = gpu
        .create_view("target view", target.raw, d2, format, color)
        .unwrap();
    let depth_view = gpu
        .create_view("depth view", depth.raw, d2, depth_format, depth_range)
        .unwrap();
    let usage = STORAGE
        | vk::BufferUsageFlags::UNIFORM_BUFFER
        | vk::BufferUsageFlags::UNIFORM_TEXEL_BUFFER
        | vk::BufferUsageFlags::STORAGE_TEXEL_BUFFER;
    let mut input = gpu
        .create_buffer("input", 64, usage, MemoryLocation::CpuToGpu)
        .unwrap();
    input
        .mapped_mut()
        .unwrap()
        .copy_from_slice(bytemuck::cast_slice(&[
            8.0_f32, 32.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
        ]));
    let scratch = gpu
        .create_buffer("scratch", 64, usage, MemoryLocation::GpuOnly)
        .unwrap();
    let result = gpu
        .create_buffer("result", 64, usage, MemoryLocation::GpuToCpu)
        .unwrap();
    let texels = gpu
        .create_buffer_view("texels", input.raw, format, 0, vk::WHOLE_SIZE)
        .unwrap();
    let stored_texels = gpu
        .create_buffer_view("stored texels", scratch.raw, format, 0, vk::WHOLE_SIZE)
        .unwrap();
    gpu.run(|gpu, cmd| -> Result<(), GpuError> {
        let sampler = gpu.sampler(&SamplerDesc::nearest())?;
        assert_eq!(sampler, gpu.sampler(&SamplerDesc::nearest())?);
        let compare = gpu.sampler(&SamplerDesc::compare(vk::CompareOp::LESS))?;
        let pipeline = gpu.compute_pipeline(&ComputePipelineDesc::new(shader))?;
        let general = vk::ImageLayout::GENERAL;
        let sampled = SetResource::SampledImage {
            view,
            layout: general,
            sampler,
        };
        let write = |binding, resource| SetWrite { binding, resource };
        let writes = [
            write(0, sampled),
            write(
                1,
                SetResource::SeparateImage {
                    view,
                    layout: general,
                },
            ),
            write(0, sampled),
            write(2, SetResource::Sampler(sampler)),
            write(3, SetResource::StorageImage { view: target_view }),
            write(
                4,
                SetResource::UniformBuffer {
                    buffer: input.raw,
                    offset: 0,
                    range: 16,
                },
            ),
            write(5, storage(result.raw)),
            write(6, SetResource::UniformTexelBuffer(texels)),
            write(7, SetResource::StorageTexelBuffer(stored_texels)),
            write(
                8,
                SetResource::SampledImage {
                    view: depth_view,
                    layout: general,
                    sampler: compare,
                },
            ),
        ];
        let set = gpu.allocate_set(&pipeline)?;
        gpu.write_set(set, &writes)?;
        // More sets than one pool holds.
        for _ in 0..200 {
            let set = gpu.allocate_set(&pipeline)?;
            gpu.write_set(set, &writes)?;
        }
        let start = |image: vk::Image, range| {
            vk::ImageMemoryBarrier2::default()
                .image(image)
                .subresource_range(range)
                .old_layout(vk::ImageLayout::UNDEFINED)
                .new_layout(general)
                .dst_stage_mask(vk::PipelineStageFlags2::ALL_COMMANDS)
                .dst_access_mask(vk::AccessFlags2::MEMORY_READ | vk::AccessFlags2::MEMORY_WRITE)
        };
        let starts = [
            start(image.raw, color),
            start(target.raw, color),
            start(depth.raw, depth_range),
        ];
        let clear = vk::ClearColorValue { float32: [0.5; 4] };
        // SAFETY: recording, with live objects.
        unsafe {
            gpu.device().cmd_pipeline_barrier2(
                cmd,
                &vk::DependencyInfo::default().image_memory_barriers(&starts),
            );
            gpu.device()
                .cmd_clear_color_image(cmd, image.raw, general, &clear, &[color]);
        }
        full_barrier(gpu, cmd);
        bind(gpu, cmd, &pipeline, Some(set), &[]);
        // SAFETY: everything the dispatch needs is bound.
        unsafe { gpu.device().cmd_dispatch(cmd, 1, 1, 1) };
        full_barrier(gpu, cmd);
        Ok(())
    })
    .unwrap();
    let values: &[f32] = bytemuck::cast_slice(result.mapped().unwrap());
    assert_eq!(values[..3], [1.0, 8.0, 32.0]);
    for view in [view, target_view, depth_view] {
        gpu.destroy_view(view);
    }
    gpu.destroy_buffer_view(texels);
    gpu.destroy_buffer_view(stored_texels);
    for buffer in [input, scratch, result] {
        gpu.destroy_buffer(buffer);
    }
    for image in [image, target, depth] {
        gpu.destroy_image(image);
    }
    destroy_clean(gpu);
}
