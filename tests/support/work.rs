//! Small pieces of GPU work for tests.

use antumbra::ash::vk;
use antumbra::gpu::{
    ComputePipelineDesc, Gpu, GpuError, MemoryLocation, PipelineHandle, SetResource, SetWrite,
    Shader,
};

/// The compute stage.
pub const COMPUTE: vk::ShaderStageFlags = vk::ShaderStageFlags::COMPUTE;

/// `out[i] = in[i] * factor + SHIFT`.
pub const SCALE: &str = "#version 460
layout(local_size_x = 64) in;
layout(constant_id = 1) const uint SHIFT = 5;
layout(binding = 0, std430) readonly buffer In { uint source[]; };
layout(binding = 1, std430) writeonly buffer Out { uint result[]; };
layout(push_constant) uniform Push { uint count; uint factor; } push;
void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i < push.count) result[i] = source[i] * push.factor + SHIFT;
}
";

/// Usage of storage buffers.
pub const STORAGE: vk::BufferUsageFlags = vk::BufferUsageFlags::STORAGE_BUFFER;

/// A whole storage buffer.
pub fn storage(buffer: vk::Buffer) -> SetResource {
    SetResource::StorageBuffer {
        buffer,
        offset: 0,
        range: vk::WHOLE_SIZE,
    }
}

/// A barrier that makes everything before visible to everything after, the host included.
pub fn full_barrier(gpu: &Gpu, cmd: vk::CommandBuffer) {
    let barriers = [vk::MemoryBarrier2::default()
        .src_stage_mask(vk::PipelineStageFlags2::ALL_COMMANDS)
        .src_access_mask(vk::AccessFlags2::MEMORY_WRITE)
        .dst_stage_mask(vk::PipelineStageFlags2::ALL_COMMANDS | vk::PipelineStageFlags2::HOST)
        .dst_access_mask(
            vk::AccessFlags2::MEMORY_READ
                | vk::AccessFlags2::MEMORY_WRITE
                | vk::AccessFlags2::HOST_READ,
        )];
    let info = vk::DependencyInfo::default().memory_barriers(&barriers);
    // SAFETY: the command buffer is being recorded on this device.
    unsafe { gpu.device().cmd_pipeline_barrier2(cmd, &info) };
}

/// Binds a pipeline with its set and push constants.
pub fn bind(
    gpu: &Gpu,
    cmd: vk::CommandBuffer,
    pipeline: &PipelineHandle,
    set: Option<vk::DescriptorSet>,
    push: &[u8],
) {
    let device = gpu.device();
    // SAFETY: the command buffer is being recorded, and all objects are live.
    unsafe {
        device.cmd_bind_pipeline(cmd, pipeline.bind_point, pipeline.pipeline);
        if let Some(set) = set {
            device.cmd_bind_descriptor_sets(
                cmd,
                pipeline.bind_point,
                pipeline.layout,
                0,
                &[set],
                &[],
            );
        }
        if !push.is_empty() {
            device.cmd_push_constants(cmd, pipeline.layout, pipeline.push_stages, 0, push);
        }
    }
}

/// Runs [`SCALE`] over `input` on our own device.
pub fn scale(
    gpu: &mut Gpu,
    shader: &'static Shader,
    shift: Option<u32>,
    input: &[u32],
    factor: u32,
) -> Vec<u32> {
    let bytes = std::mem::size_of_val(input) as u64;
    let mut source = gpu
        .create_buffer("source", bytes, STORAGE, MemoryLocation::CpuToGpu)
        .unwrap();
    let result = gpu
        .create_buffer("result", bytes, STORAGE, MemoryLocation::GpuToCpu)
        .unwrap();
    source
        .mapped_mut()
        .unwrap()
        .copy_from_slice(bytemuck::cast_slice(input));
    let constants = shift.map(|value| (1, value)).into_iter().collect();
    let count = input.len() as u32;
    gpu.run(|gpu, cmd| -> Result<(), GpuError> {
        let pipeline = gpu.compute_pipeline(&ComputePipelineDesc { shader, constants })?;
        let set = gpu.allocate_set(&pipeline)?;
        gpu.write_set(
            set,
            &[
                SetWrite {
                    binding: 0,
                    resource: storage(source.raw),
                },
                SetWrite {
                    binding: 1,
                    resource: storage(result.raw),
                },
            ],
        )?;
        let timing = gpu.begin_timing(cmd, "scale")?;
        gpu.begin_label(cmd, "scale");
        bind(
            gpu,
            cmd,
            &pipeline,
            Some(set),
            bytemuck::cast_slice(&[count, factor]),
        );
        let groups = shader.groups([count, 1, 1]);
        // SAFETY: everything the dispatch needs is bound.
        unsafe {
            gpu.device()
                .cmd_dispatch(cmd, groups[0], groups[1], groups[2])
        };
        gpu.end_label(cmd);
        gpu.end_timing(cmd, timing);
        full_barrier(gpu, cmd);
        Ok(())
    })
    .unwrap();
    let out = bytemuck::cast_slice(result.mapped().unwrap()).to_vec();
    gpu.destroy_buffer(source);
    gpu.destroy_buffer(result);
    out
}
