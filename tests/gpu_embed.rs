//! A host that owns the device records our frame into its own command buffer and gets what we get on
//! a device of our own.
#![cfg(feature = "cli")]

mod support;

use antumbra::ash::vk;
use antumbra::capture::{FrameRenderer, FrameRequest};
use antumbra::gpu::{Gpu, MemoryLocation, RequiredFeatures};
use antumbra::graph::{
    Access, BufferDesc, BufferState, FrameCache, Graph, HostBuffer, HostImage, ImageDesc,
    ImagePart, ImageState, PassKind,
};
use antumbra::renderer::{NamedLight, SceneBuffers, add_frame};
use antumbra::scene::{LoadOptions, Scene};
use antumbra::shadow::Technique;
use std::path::Path;
use support::host::Host;

const SIZE: u32 = 96;

/// The host's own command pool, buffer and fence.
struct Frame<'h> {
    host: &'h Host,
    pool: vk::CommandPool,
    cmd: vk::CommandBuffer,
    fence: vk::Fence,
}

impl<'h> Frame<'h> {
    fn new(host: &'h Host) -> Self {
        let info = vk::CommandPoolCreateInfo::default().queue_family_index(host.family);
        // SAFETY: plain creation on the host's live device.
        unsafe {
            let pool = host.device.create_command_pool(&info, None).unwrap();
            let info = vk::CommandBufferAllocateInfo::default()
                .command_pool(pool)
                .command_buffer_count(1);
            let cmd = host.device.allocate_command_buffers(&info).unwrap()[0];
            let fence = host.device.create_fence(&Default::default(), None).unwrap();
            Self {
                host,
                pool,
                cmd,
                fence,
            }
        }
    }

    /// Records, submits and waits, as a host does.
    fn submit(&self, record: impl FnOnce(vk::CommandBuffer)) {
        let device = &self.host.device;
        // SAFETY: the pool's buffer is not in use: every submission is waited for here.
        unsafe {
            device
                .reset_command_pool(self.pool, vk::CommandPoolResetFlags::empty())
                .unwrap();
            device
                .begin_command_buffer(self.cmd, &Default::default())
                .unwrap();
            record(self.cmd);
            device.end_command_buffer(self.cmd).unwrap();
            let commands = [vk::CommandBufferSubmitInfo::default().command_buffer(self.cmd)];
            let submit = vk::SubmitInfo2::default().command_buffer_infos(&commands);
            let queue = device.get_device_queue(self.host.family, 0);
            device.queue_submit2(queue, &[submit], self.fence).unwrap();
            device
                .wait_for_fences(&[self.fence], true, u64::MAX)
                .unwrap();
            device.reset_fences(&[self.fence]).unwrap();
        }
    }

    fn end(self) {
        // SAFETY: the last submission has finished.
        unsafe {
            self.host.device.destroy_fence(self.fence, None);
            self.host.device.destroy_command_pool(self.pool, None);
        }
    }
}

#[test]
fn a_host_records_the_same_frame() {
    let _one = support::serial();
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/poles.gltf");
    let scene = Scene::load(&path, &LoadOptions::default()).unwrap();
    let camera = scene.select_camera(None).unwrap();
    let request = FrameRequest {
        camera: camera.clone(),
        size: [SIZE; 2],
        lights: vec![0],
        technique: Technique::Hard,
    };
    let mut renderer = FrameRenderer::new(support::gpu(), &scene).unwrap();
    let expected = renderer.render(&request).unwrap().lights[0]
        .visibility
        .clone();
    support::assert_no_messages(&renderer.destroy().unwrap());

    let host = Host::new(&mut RequiredFeatures::new());
    let frame = Frame::new(&host);
    // Two frames in flight, so that two sets of transients take turns.
    let mut gpu = Gpu::from_host(host.lend(2)).unwrap();
    let mut cache = FrameCache::new();
    let mut buffers = None;
    frame.submit(|cmd| {
        gpu.begin_frame().unwrap();
        buffers = Some(SceneBuffers::upload(&mut gpu, cmd, &scene).unwrap());
    });
    let buffers = buffers.unwrap();

    // The host's own image, in a state of the host's choosing before and after.
    let desc = ImageDesc::new(vk::Format::R32_SFLOAT, SIZE, SIZE);
    let usage = vk::ImageUsageFlags::TRANSFER_DST | vk::ImageUsageFlags::TRANSFER_SRC;
    let spec = antumbra::gpu::ImageSpec::new_2d(desc.format, SIZE, SIZE, usage);
    let image = gpu.create_image("the host's mask", &spec).unwrap();
    let bytes = u64::from(SIZE * SIZE * 4);
    let target = vk::BufferUsageFlags::TRANSFER_DST | vk::BufferUsageFlags::TRANSFER_SRC;
    let buffer = gpu
        .create_buffer("the host's copy", bytes, target, MemoryLocation::GpuToCpu)
        .unwrap();
    let lights = [NamedLight {
        name: "lamp".to_string(),
        light: scene.lights[0].light,
    }];
    let left = ImageState {
        layout: vk::ImageLayout::GENERAL,
        stages: vk::PipelineStageFlags2::COMPUTE_SHADER,
        access: vk::AccessFlags2::SHADER_STORAGE_READ,
    };
    for number in 0..5 {
        frame.submit(|cmd| {
            gpu.begin_frame().unwrap();
            let mut graph = Graph::continuing(cache.history());
            let declared = add_frame(
                &mut graph,
                &buffers,
                &camera,
                [SIZE; 2],
                &lights,
                Technique::Hard,
            )
            .unwrap();
            let enter = if number == 0 {
                ImageState::UNDEFINED
            } else {
                left
            };
            let mask = graph.import_image(
                "mask",
                HostImage {
                    image: image.raw,
                    desc,
                    usage,
                    enter,
                    leave: left,
                },
            );
            let copy = graph.import_buffer(
                "copy",
                HostBuffer {
                    buffer: buffer.raw,
                    desc: BufferDesc { size: bytes },
                    usage: target,
                    enter: BufferState::IDLE,
                    leave: BufferState::HOST_READ,
                },
            );
            // Through a buffer into the host's image: what a host's own pass would do with it.
            let visibility = declared.visibility[0];
            let mut pass = graph.pass("to the host's buffer", PassKind::Transfer);
            pass.read(visibility, Access::CopyRead);
            let copy = pass.overwrite(copy, Access::CopyWrite);
            let whole = ImagePart::whole(&desc);
            pass.record(move |ctx| ctx.copy_image_to_buffer(visibility, whole, copy, 0));
            let mut pass = graph.pass("to the host's image", PassKind::Transfer);
            pass.read(copy, Access::CopyRead);
            let mask = pass.overwrite(mask, Access::CopyWrite);
            pass.record(move |ctx| ctx.copy_buffer_to_image(copy, 0, mask, whole));
            let compiled = graph.compile(&gpu).unwrap();
            let culled: Vec<_> = compiled
                .plan()
                .culled
                .iter()
                .filter(|p| p.reason.contains("nobody reads"))
                .map(|p| p.name.to_string())
                .collect();
            assert_eq!(
                culled,
                ["shade.base", "shade.light lamp"],
                "nobody asked for the picture"
            );
            compiled.record(&mut gpu, &mut cache, cmd).unwrap();
        });
        let mapped = buffer.mapped().unwrap();
        let visibility: &[f32] = bytemuck::cast_slice(mapped);
        assert!(
            visibility == expected,
            "frame {number} differs from that of our own device"
        );
    }

    cache.destroy(&mut gpu);
    buffers.destroy(&mut gpu);
    gpu.destroy_image(image);
    gpu.destroy_buffer(buffer);
    gpu.destroy().unwrap();
    frame.end();
    host.end();
}
