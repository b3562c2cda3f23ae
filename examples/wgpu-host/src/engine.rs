//! A device of wgpu's that antumbra can be a guest on, and the messages that its validation layer has.

use std::sync::atomic::{AtomicUsize, Ordering};

use antumbra::ash::vk;
use antumbra::gpu::{ExtraFeatures, HostDevice, OptionalFeatures, requirements};
use wgpu::hal::api::Vulkan;

use crate::{FRAMES_IN_FLIGHT, Outcome};

pub struct Engine {
    pub device: wgpu::Device,
    pub queue: wgpu::Queue,
}

impl Engine {
    /// The first device of Vulkan's, under its validation layer where that is installed.
    pub fn new() -> Outcome<Self> {
        log::set_logger(&MESSAGES)?;
        log::set_max_level(log::LevelFilter::Warn);
        let instance = wgpu::Instance::new(wgpu::InstanceDescriptor {
            backends: wgpu::Backends::VULKAN,
            flags: wgpu::InstanceFlags::VALIDATION | wgpu::InstanceFlags::DEBUG,
            ..wgpu::InstanceDescriptor::new_without_display_handle()
        });
        let adapters = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::VULKAN));
        let adapter = adapters.into_iter().next().ok_or("no Vulkan device")?;
        let wanted = wgpu::DeviceDescriptor {
            label: Some("host"),
            required_limits: wgpu::Limits::downlevel_defaults().using_resolution(adapter.limits()),
            ..Default::default()
        };
        let (device, queue) = open(&adapter, &wanted)?;
        Ok(Self { device, queue })
    }

    /// The device as antumbra takes it. wgpu goes on owning everything.
    pub fn lend(&self) -> Outcome<HostDevice> {
        const OTHER: &str = "not a device of Vulkan's";
        // SAFETY: the handles are copied, and used only while the engine lives.
        unsafe {
            let device = self.device.as_hal::<Vulkan>().ok_or(OTHER)?;
            let shared = device.shared_instance();
            Ok(HostDevice {
                entry: Some(shared.entry().clone()),
                instance: shared.raw_instance().clone(),
                physical: device.raw_physical_device(),
                device: device.raw_device().clone(),
                queue_family: device.queue_family_index(),
                queue: device.raw_queue(),
                api_version: api_version(shared, device.raw_physical_device()),
                frames_in_flight: FRAMES_IN_FLIGHT as u32,
                allocator: None,
                debug_utils: shared.extensions().contains(&vk::EXT_DEBUG_UTILS_NAME),
                optional: OptionalFeatures::default(),
            })
        }
    }

    /// Waits until a submission is done; `None` for all of them.
    pub fn wait(&self, submission: Option<wgpu::SubmissionIndex>) -> Outcome<()> {
        self.device.poll(wgpu::PollType::Wait {
            submission_index: submission,
            timeout: None,
        })?;
        Ok(())
    }
}

/// What instance and device both have.
fn api_version(instance: &wgpu::hal::vulkan::InstanceShared, physical: vk::PhysicalDevice) -> u32 {
    // SAFETY: the device belongs to the instance.
    let properties = unsafe {
        let raw = instance.raw_instance();
        raw.get_physical_device_properties(physical)
    };
    // wgpu asks for version 1.3 where the loader has it.
    properties
        .api_version
        .min(instance.instance_api_version())
        .min(vk::API_VERSION_1_3)
}

/// wgpu's own device for `wanted`, with our features switched on besides its own.
fn open(
    adapter: &wgpu::Adapter,
    wanted: &wgpu::DeviceDescriptor<'_>,
) -> Outcome<(wgpu::Device, wgpu::Queue)> {
    // SAFETY: the device is made as wgpu would make it, from its extensions and features, with more features on;
    // what is missing is asked for first.
    unsafe {
        let hal = adapter
            .as_hal::<Vulkan>()
            .ok_or("not an adapter of Vulkan's")?;
        let (instance, physical) = (hal.shared_instance(), hal.raw_physical_device());
        let raw = instance.raw_instance();
        let missing = requirements().missing(raw, physical, api_version(instance, physical));
        if !missing.is_empty() {
            return Err(format!("the device lacks {}", missing.join(", ")).into());
        }
        const FAMILY: u32 = 0; // wgpu uses no other
        let extensions = hal.required_device_extensions(wanted.required_features);
        let names: Vec<_> = extensions.iter().map(|name| name.as_ptr()).collect();
        let queues = [vk::DeviceQueueCreateInfo::default()
            .queue_family_index(FAMILY)
            .queue_priorities(&[1.0])];
        let info = vk::DeviceCreateInfo::default()
            .queue_create_infos(&queues)
            .enabled_extension_names(&names);
        let mut theirs = hal.physical_device_features(&extensions, wanted.required_features);
        let mut ours = ExtraFeatures::default();
        let info = ours.complete(theirs.add_to_device_create(info));
        let device = raw.create_device(physical, &info, None)?;
        let opened = hal.device_from_raw(
            device,
            None,
            &extensions,
            wanted.required_features,
            &wanted.required_limits,
            &wanted.memory_hints,
            FAMILY,
            0,
        )?;
        Ok(adapter.create_device_from_hal::<Vulkan>(opened, wanted)?)
    }
}

/// Prints what wgpu and the validation layer warn of, and counts it.
struct Messages(AtomicUsize);

static MESSAGES: Messages = Messages(AtomicUsize::new(0));

/// How many messages there have been.
pub fn messages() -> usize {
    MESSAGES.0.load(Ordering::Relaxed)
}

impl log::Log for Messages {
    fn enabled(&self, data: &log::Metadata<'_>) -> bool {
        data.level() <= log::Level::Warn
    }

    fn log(&self, record: &log::Record<'_>) {
        if self.enabled(record.metadata()) {
            self.0.fetch_add(1, Ordering::Relaxed);
            eprintln!("{}: {}", record.target(), record.args());
        }
    }

    fn flush(&self) {}
}
