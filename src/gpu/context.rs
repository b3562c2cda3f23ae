//! The device and everything that lives as long as it does.

use std::mem::ManuallyDrop;
use std::path::PathBuf;
use std::sync::{Arc, Mutex};

use ash::vk;
use gpu_allocator::vulkan::{Allocator, AllocatorCreateDesc};
use gpu_allocator::{AllocationSizes, AllocatorDebugSettings};

use super::debug::{MessageLog, Messenger, ValidationMessage};
use super::descriptors::Descriptors;
use super::error::{CallResult, GpuError};
use super::host::{HostDevice, OptionalFeatures, RequiredFeatures, Requirements, requirements};
use super::instance::OwnInstance;
use super::memory::MemoryUse;
use super::pipelines::Pipelines;
use super::retire::Retired;
use super::samplers::Samplers;
use super::select::{self, DeviceInfo, DeviceSummary};
use super::submit::Submitter;
use super::timestamps::Timestamps;

/// How to create a device of our own.
#[derive(Clone, Debug, Default)]
pub struct GpuOptions {
    /// Part of a device or driver name (case does not matter), or an index into [`enumerate`]; the
    /// first device that fits when `None`. Software drivers count like any other.
    pub device: Option<String>,
    /// Run under the Khronos validation layer with synchronization validation, and collect its
    /// messages.
    pub validation: bool,
    /// File of the on-disk pipeline cache; none is kept when `None`.
    pub pipeline_cache: Option<PathBuf>,
    /// Reported to the driver.
    pub application_name: String,
    /// Puts functions of the caller's own between us and the driver, for tools that look at calls and
    /// tests that make them fail. It is handed the device's functions and returns those that are used
    /// from then on, also by the allocator; the handle has to stay the same.
    pub intercept: Option<fn(ash::Device) -> ash::Device>,
}

/// A Vulkan device with allocator, pipelines, descriptors, samplers and timers.
///
/// Created on a device of our own with [`Gpu::create`] or on a host's with [`Gpu::from_host`], and
/// ended with [`Gpu::destroy`]; dropping it without that leaks and warns.
pub struct Gpu {
    pub(super) info: DeviceInfo,
    pub(super) physical: vk::PhysicalDevice,
    pub(super) optional: OptionalFeatures,
    pub(super) device: ash::Device,
    pub(super) queue: vk::Queue,
    pub(super) queue_family: u32,
    pub(super) debug_utils: Option<ash::ext::debug_utils::Device>,
    pub(super) log: Arc<MessageLog>,
    /// Dropped by hand: an allocator of our own has to be gone before the device, and never after
    /// it.
    pub(super) allocator: ManuallyDrop<Arc<Mutex<Allocator>>>,
    pub(super) memory_use: MemoryUse,
    /// Allocations until the one that is refused.
    pub(super) refused_allocation: Option<u64>,
    /// The slot of the frame being recorded, below `frames_in_flight`.
    pub(super) slot: usize,
    pub(super) frames_in_flight: u32,
    pub(super) retired: Vec<Vec<Retired>>,
    pub(super) pipelines: Pipelines,
    pub(super) descriptors: Descriptors,
    pub(super) samplers: Samplers,
    pub(super) timestamps: Timestamps,
    /// Only on a device of our own.
    pub(super) submitter: Option<Submitter>,
    instance: ash::Instance,
    messenger: Option<Messenger>,
    /// Keeps the Vulkan library loaded.
    entry: Option<ash::Entry>,
    destroyed: bool,
}

/// Lists the devices of this machine, also those that do not fit, without creating one.
///
/// # Errors
/// No loader, no driver.
pub fn enumerate() -> Result<Vec<DeviceSummary>, GpuError> {
    let own = OwnInstance::create("antumbra", false)?;
    let list = select::list(&own.instance);
    own.destroy();
    Ok(list?.into_iter().map(|(_, summary)| summary).collect())
}

impl Gpu {
    /// Loads the Vulkan library and creates an instance and a device.
    ///
    /// # Errors
    /// No loader, no driver, no device of that name, no device that fits, no validation layer (when
    /// asked for), or a failing call.
    pub fn create(options: &GpuOptions) -> Result<Self, GpuError> {
        let own = OwnInstance::create(&options.application_name, options.validation)?;
        let (physical, device, queue_family) =
            match create_device(&own.instance, options.device.as_deref()) {
                Ok(created) => created,
                Err(error) => {
                    own.destroy();
                    return Err(error);
                }
            };
        let device = match options.intercept {
            Some(intercept) => intercept(device),
            None => device,
        };
        // SAFETY: the family and its one queue were asked for when the device was created.
        let queue = unsafe { device.get_device_queue(queue_family, 0) };
        let host = HostDevice {
            api_version: vk::API_VERSION_1_3,
            debug_utils: own.debug_utils,
            entry: Some(own.entry.clone()),
            instance: own.instance.clone(),
            physical,
            device: device.clone(),
            queue_family,
            queue,
            frames_in_flight: 1,
            allocator: None,
            optional: OptionalFeatures::supported(&own.instance, physical),
        };
        match Self::build(host, true, own.log.clone()) {
            Ok(mut gpu) => {
                gpu.messenger = own.messenger;
                gpu.set_name(gpu.queue, "antumbra queue");
                if let Some(path) = &options.pipeline_cache {
                    gpu.use_pipeline_cache(path.clone());
                }
                Ok(gpu)
            }
            Err(error) => {
                // SAFETY: the device is ours, and `build` has destroyed what it made on it.
                unsafe { device.destroy_device(None) };
                own.destroy();
                Err(error)
            }
        }
    }

    /// Works on a host's device. See [`HostDevice`] for what the host promises.
    ///
    /// # Errors
    /// [`GpuError::Missing`] names what the physical device lacks.
    pub fn from_host(host: HostDevice) -> Result<Self, GpuError> {
        let mut missing = requirements().missing(&host.instance, host.physical, host.api_version);
        // SAFETY: the handles are live by the host's promise.
        let families = unsafe {
            host.instance
                .get_physical_device_queue_family_properties(host.physical)
        };
        let wanted = vk::QueueFlags::GRAPHICS | vk::QueueFlags::COMPUTE;
        let family = usize::try_from(host.queue_family)
            .ok()
            .and_then(|index| families.get(index));
        if !family.is_some_and(|family| family.queue_flags.contains(wanted)) {
            missing.push(format!(
                "graphics and compute on queue family {} (all passes share it)",
                host.queue_family
            ));
        }
        if host.frames_in_flight == 0 {
            missing.push("at least one frame in flight (its slot owns the descriptors)".to_owned());
        }
        if !missing.is_empty() {
            let device = select::device_info(&host.instance, host.physical).name;
            return Err(GpuError::Missing {
                device,
                what: missing,
            });
        }
        Self::build(host, false, Arc::default())
    }

    fn build(host: HostDevice, own: bool, log: Arc<MessageLog>) -> Result<Self, GpuError> {
        let info = select::device_info(&host.instance, host.physical);
        let debug_utils = host
            .debug_utils
            .then(|| ash::ext::debug_utils::Device::new(&host.instance, &host.device));
        // SAFETY: the handles are live.
        let families = unsafe {
            host.instance
                .get_physical_device_queue_family_properties(host.physical)
        };
        let valid_bits = usize::try_from(host.queue_family)
            .ok()
            .and_then(|index| families.get(index))
            .map_or(0, |family| family.timestamp_valid_bits);
        let allocator = match host.allocator {
            Some(allocator) => allocator,
            None => Arc::new(Mutex::new(own_allocator(
                &host.instance,
                &host.device,
                host.physical,
            )?)),
        };
        let slots = host.frames_in_flight.max(1);
        let slot_count = slots as usize;
        let mut gpu = Self {
            timestamps: Timestamps::new(slot_count, valid_bits, info.limits.timestamp_period),
            info,
            physical: host.physical,
            optional: host.optional,
            device: host.device,
            queue: host.queue,
            queue_family: host.queue_family,
            debug_utils,
            log,
            allocator: ManuallyDrop::new(allocator),
            memory_use: MemoryUse::default(),
            refused_allocation: None,
            slot: slot_count - 1,
            frames_in_flight: slots,
            retired: (0..slot_count).map(|_| Vec::new()).collect(),
            pipelines: Pipelines::default(),
            descriptors: Descriptors::new(slot_count),
            samplers: Samplers::default(),
            submitter: None,
            instance: host.instance,
            messenger: None,
            entry: host.entry,
            destroyed: false,
        };
        if own && let Err(error) = gpu.create_submitter() {
            gpu.destroy_objects();
            gpu.destroyed = true;
            return Err(error);
        }
        Ok(gpu)
    }

    /// Begins a frame: frees what the frame that last used this slot retired, takes back its
    /// descriptor sets, and makes its timings ready for [`Gpu::collect_timings`].
    ///
    /// On a host's device, the host calls this before it records a frame, once the frame
    /// `frames_in_flight` earlier has finished. On our own device [`Gpu::run`] does it.
    ///
    /// # Errors
    /// A failing call.
    pub fn begin_frame(&mut self) -> Result<(), GpuError> {
        self.slot = (self.slot + 1) % self.retired.len();
        let garbage = std::mem::take(&mut self.retired[self.slot]);
        for object in garbage {
            self.free_retired(object);
        }
        self.reclaim_sets();
        self.begin_timestamps()
    }

    /// Frees all that was made here, then, on a device of our own, the device and the instance. What
    /// the caller created and has not destroyed or retired is reported by the layer as left over.
    /// Returns every validation message that has not been taken, including those about objects that
    /// are still alive.
    ///
    /// On a host's device, the host has to have waited for all our work first.
    ///
    /// # Errors
    /// [`GpuError::Timeout`] when our own device does not come to rest; then everything is leaked
    /// rather than pulled away from under it.
    pub fn destroy(mut self) -> Result<Vec<ValidationMessage>, GpuError> {
        self.destroyed = true;
        if self.submitter.is_some()
            && let Err(error) = self.wait_until_idle()
        {
            self.leak();
            return Err(error);
        }
        let own = self.submitter.is_some();
        self.destroy_objects();
        if own {
            // SAFETY: device and instance are ours, the device is idle, and nothing made here is
            // left on it.
            unsafe { self.device.destroy_device(None) };
            if let Some(messenger) = &mut self.messenger {
                messenger.destroy();
            }
            // SAFETY: the device, the only child of the instance, is gone.
            unsafe { self.instance.destroy_instance(None) };
        }
        Ok(self.take_messages())
    }

    fn destroy_objects(&mut self) {
        self.destroy_submitter();
        for garbage in std::mem::take(&mut self.retired) {
            for object in garbage {
                self.free_retired(object);
            }
        }
        self.destroy_timestamps();
        self.destroy_descriptors();
        self.destroy_pipelines();
        self.destroy_samplers();
        // SAFETY: this runs once, when the Gpu is consumed or was never handed out; nothing touches
        // the allocator later. Our own frees its memory blocks here; a host's goes on living.
        unsafe { ManuallyDrop::drop(&mut self.allocator) };
    }

    /// Gives up without touching the device: the library and the log that the layer writes to have
    /// to stay.
    fn leak(&mut self) {
        std::mem::forget(self.entry.take());
        std::mem::forget(Arc::clone(&self.log));
    }

    /// The device's functions.
    #[must_use]
    pub fn device(&self) -> &ash::Device {
        &self.device
    }

    /// The instance's functions.
    #[must_use]
    pub fn instance(&self) -> &ash::Instance {
        &self.instance
    }

    /// The physical device.
    #[must_use]
    pub fn physical_device(&self) -> vk::PhysicalDevice {
        self.physical
    }

    /// The queue that runs our command buffers.
    #[must_use]
    pub fn queue(&self) -> vk::Queue {
        self.queue
    }

    /// The queue's family.
    #[must_use]
    pub fn queue_family(&self) -> u32 {
        self.queue_family
    }

    /// What the device says about itself.
    #[must_use]
    pub fn info(&self) -> &DeviceInfo {
        &self.info
    }

    /// Features that the device has and that we could do without.
    #[must_use]
    pub fn optional(&self) -> OptionalFeatures {
        self.optional
    }

    /// How many frames may be in flight: 1 on our own device.
    #[must_use]
    pub fn frames_in_flight(&self) -> u32 {
        self.frames_in_flight
    }

    /// Which of the frame slots is being recorded, below [`Gpu::frames_in_flight`].
    #[must_use]
    pub fn frame_slot(&self) -> usize {
        self.slot
    }

    /// Whether the device belongs to a host.
    #[must_use]
    pub fn is_hosted(&self) -> bool {
        self.submitter.is_none()
    }
}

impl Drop for Gpu {
    fn drop(&mut self) {
        if !self.destroyed {
            log::warn!(
                "a Gpu on \"{}\" was dropped without Gpu::destroy; its objects leak",
                self.info.name
            );
            self.leak();
        }
    }
}

impl std::fmt::Debug for Gpu {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Gpu")
            .field("device", &self.info.name)
            .field("hosted", &self.is_hosted())
            .finish_non_exhaustive()
    }
}

fn create_device(
    instance: &ash::Instance,
    wanted: Option<&str>,
) -> Result<(vk::PhysicalDevice, ash::Device, u32), GpuError> {
    let (handles, summaries): (Vec<_>, Vec<_>) = select::list(instance)?.into_iter().unzip();
    let chosen = select::choose(&summaries, wanted)?;
    let (physical, name) = (handles[chosen], &summaries[chosen].info.name);
    let Some(family) = Requirements::queue_family(instance, physical) else {
        return Err(GpuError::Missing {
            device: name.clone(),
            what: vec!["a graphics and compute queue".to_owned()],
        });
    };
    let queues = [vk::DeviceQueueCreateInfo::default()
        .queue_family_index(family)
        .queue_priorities(&[1.0])];
    let extensions: Vec<_> = requirements()
        .device_extensions
        .iter()
        .map(|e| super::debug::c_string(e.name))
        .collect();
    let extension_names: Vec<_> = extensions.iter().map(|e| e.as_ptr()).collect();
    let mut features = RequiredFeatures::new();
    let mut chain = features.chain();
    OptionalFeatures::supported(instance, physical).enable(&mut chain.features);
    let info = vk::DeviceCreateInfo::default()
        .queue_create_infos(&queues)
        .enabled_extension_names(&extension_names)
        .push_next(&mut chain);
    // SAFETY: the physical device is one of the instance's and has all that is asked for; all
    // pointers are live.
    let device =
        unsafe { instance.create_device(physical, &info, None) }.call("vkCreateDevice", name)?;
    Ok((physical, device, family))
}

fn own_allocator(
    instance: &ash::Instance,
    device: &ash::Device,
    physical: vk::PhysicalDevice,
) -> Result<Allocator, GpuError> {
    const MIB: u64 = 1 << 20;
    // Small first blocks keep tiny scenes tiny: a software driver's memory is the machine's.
    let sizes = AllocationSizes::new(16 * MIB, 8 * MIB)
        .with_max_device_memblock_size(256 * MIB)
        .with_max_host_memblock_size(64 * MIB);
    Allocator::new(&AllocatorCreateDesc {
        instance: instance.clone(),
        device: device.clone(),
        physical_device: physical,
        debug_settings: AllocatorDebugSettings::default(),
        buffer_device_address: false,
        allocation_sizes: sizes,
    })
    .map_err(|source| GpuError::Allocation {
        object: "the allocator".to_owned(),
        bytes: 0,
        source,
    })
}

#[cfg(test)]
mod tests {
    use super::Gpu;

    #[test]
    fn a_gpu_can_move_to_a_hosts_render_thread() {
        fn is_send<T: Send>() {}
        is_send::<Gpu>();
    }
}
