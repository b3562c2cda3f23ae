//! A host's device with nothing but our requirements enabled serves us, and stays the host's.

mod support;

use std::sync::{Arc, Mutex};

use antumbra::ash::vk;
use antumbra::gpu::{
    ComputePipelineDesc, Gpu, GpuError, HostDevice, MemoryLocation, RequiredFeatures, Retired,
    SetWrite, ValidationMessage,
};
use support::host::Host;
use support::work::{COMPUTE, SCALE, STORAGE, bind, full_barrier, storage};
use support::{assert_no_messages, compile, serial};

#[test]
fn a_host_lends_its_device_for_overlapping_frames() {
    let _one = serial();
    let host = Host::new(&mut RequiredFeatures::new());
    let mut gpu = Gpu::from_host(host.lend(2)).unwrap();
    assert!(gpu.is_hosted());
    assert_eq!(gpu.frames_in_flight(), 2);
    assert!(matches!(
        gpu.run(|_, _| Ok::<_, GpuError>(())),
        Err(GpuError::HostOwned { .. })
    ));

    let shader = compile(COMPUTE, SCALE);
    let mut source = gpu
        .create_buffer("source", 256, STORAGE, MemoryLocation::CpuToGpu)
        .unwrap();
    source
        .mapped_mut()
        .unwrap()
        .copy_from_slice(bytemuck::cast_slice(&[11_u32; 64]));
    let results: Vec<_> = (0..5)
        .map(|i| {
            gpu.create_buffer(
                &format!("result {i}"),
                256,
                STORAGE,
                MemoryLocation::GpuToCpu,
            )
            .unwrap()
        })
        .collect();
    // SAFETY: an ordinary frame loop of a host; every fence is waited for before its slot is used
    // again.
    unsafe {
        let device = &host.device;
        let pool_info = vk::CommandPoolCreateInfo::default()
            .queue_family_index(host.family)
            .flags(vk::CommandPoolCreateFlags::RESET_COMMAND_BUFFER);
        let pool = device.create_command_pool(&pool_info, None).unwrap();
        let info = vk::CommandBufferAllocateInfo::default()
            .command_pool(pool)
            .command_buffer_count(2);
        let commands = device.allocate_command_buffers(&info).unwrap();
        let signalled = vk::FenceCreateInfo::default().flags(vk::FenceCreateFlags::SIGNALED);
        let fences: Vec<_> = (0..2)
            .map(|_| device.create_fence(&signalled, None).unwrap())
            .collect();
        let queue = gpu.queue();
        for (frame, result) in results.iter().enumerate() {
            let (cmd, fence) = (commands[frame % 2], fences[frame % 2]);
            device.wait_for_fences(&[fence], true, u64::MAX).unwrap();
            device.reset_fences(&[fence]).unwrap();
            gpu.begin_frame().unwrap();
            // The first two frames take over slots that nobody used before.
            let times = gpu.collect_timings();
            assert_eq!(
                times.len(),
                usize::from(frame >= 2),
                "frame {frame}: {times:?}"
            );
            device
                .begin_command_buffer(cmd, &vk::CommandBufferBeginInfo::default())
                .unwrap();
            let pipeline = gpu
                .compute_pipeline(&ComputePipelineDesc::new(shader))
                .unwrap();
            let set = gpu.allocate_set(&pipeline).unwrap();
            let writes = [
                SetWrite {
                    binding: 0,
                    resource: storage(source.raw),
                },
                SetWrite {
                    binding: 1,
                    resource: storage(result.raw),
                },
            ];
            gpu.write_set(set, &writes).unwrap();
            let timing = gpu.begin_timing(cmd, "scale").unwrap();
            bind(
                &gpu,
                cmd,
                &pipeline,
                Some(set),
                bytemuck::cast_slice(&[64, frame as u32]),
            );
            device.cmd_dispatch(cmd, 1, 1, 1);
            gpu.end_timing(cmd, timing);
            full_barrier(&gpu, cmd);
            device.end_command_buffer(cmd).unwrap();
            let buffers = [vk::CommandBufferSubmitInfo::default().command_buffer(cmd)];
            let submit = vk::SubmitInfo2::default().command_buffer_infos(&buffers);
            device.queue_submit2(queue, &[submit], fence).unwrap();
        }
        device.wait_for_fences(&fences, true, u64::MAX).unwrap();
        for fence in fences {
            device.destroy_fence(fence, None);
        }
        device.destroy_command_pool(pool, None);
    }
    for (frame, result) in (0_u32..).zip(&results) {
        let values: &[u32] = bytemuck::cast_slice(result.mapped().unwrap());
        assert_eq!(values, [11 * frame + 5; 64]);
    }
    assert_eq!(gpu.pipelines_created(), 1);
    for buffer in results {
        gpu.retire(Retired::Buffer(buffer));
    }
    gpu.retire(Retired::Buffer(source));
    let messages: Vec<ValidationMessage> = gpu.destroy().unwrap();
    assert_no_messages(&messages);
    host.end();
}

#[test]
fn a_hosts_allocator_is_used_and_outlives_us() {
    let _one = serial();
    let host = Host::new(&mut RequiredFeatures::new());
    let allocator =
        gpu_allocator::vulkan::Allocator::new(&gpu_allocator::vulkan::AllocatorCreateDesc {
            instance: host.instance.clone(),
            device: host.device.clone(),
            physical_device: host.physical,
            debug_settings: Default::default(),
            buffer_device_address: false,
            allocation_sizes: Default::default(),
        })
        .unwrap();
    let allocator = Arc::new(Mutex::new(allocator));
    let lent = HostDevice {
        allocator: Some(Arc::clone(&allocator)),
        ..host.lend(1)
    };
    let mut gpu = Gpu::from_host(lent).unwrap();
    let buffer = gpu
        .create_buffer("shared memory", 4096, STORAGE, MemoryLocation::GpuOnly)
        .unwrap();
    assert!(
        allocator
            .lock()
            .unwrap()
            .generate_report()
            .total_allocated_bytes
            >= 4096
    );
    gpu.retire(Retired::Buffer(buffer));
    gpu.destroy().unwrap();
    assert_eq!(Arc::strong_count(&allocator), 1);
    assert_eq!(
        allocator
            .lock()
            .unwrap()
            .generate_report()
            .total_allocated_bytes,
        0
    );
    drop(allocator);
    host.end();
}

#[test]
fn a_host_that_cannot_run_us_is_told_what_is_missing() {
    let _one = serial();
    let host = Host::new(&mut RequiredFeatures::new());
    let old = HostDevice {
        api_version: vk::API_VERSION_1_2,
        ..host.lend(1)
    };
    let text = Gpu::from_host(old).unwrap_err().to_string();
    assert!(text.contains("Vulkan 1.3 (it has 1.2)"), "{text}");
    let queue = HostDevice {
        queue_family: 77,
        ..host.lend(1)
    };
    let text = Gpu::from_host(queue).unwrap_err().to_string();
    assert!(text.contains("queue family 77"), "{text}");
    let frames = host.lend(0);
    assert!(
        Gpu::from_host(frames)
            .unwrap_err()
            .to_string()
            .contains("frame in flight")
    );
    host.end();
}
