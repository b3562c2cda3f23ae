//! The host's device, images and buffers: an ordinary Vulkan program, which knows nothing of shadows.

use std::ffi::CStr;
use std::sync::atomic::{AtomicUsize, Ordering};

use antumbra::ash::{self, vk};
use antumbra::gpu::{HostDevice, OptionalFeatures, RequiredFeatures, Requirements, requirements};

use super::{FRAMES_IN_FLIGHT, Outcome, SIZE};

pub fn extent_3d() -> vk::Extent3D {
    vk::Extent3D {
        width: SIZE,
        height: SIZE,
        depth: 1,
    }
}

static MESSAGES: AtomicUsize = AtomicUsize::new(0);

unsafe extern "system" fn host_message(
    _: vk::DebugUtilsMessageSeverityFlagsEXT,
    _: vk::DebugUtilsMessageTypeFlagsEXT,
    data: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
    _: *mut std::ffi::c_void,
) -> vk::Bool32 {
    MESSAGES.fetch_add(1, Ordering::Relaxed);
    // SAFETY: the layer's data is valid during the call.
    if let Some(text) = unsafe { (*data).message_as_c_str() } {
        eprintln!("{}", text.to_string_lossy());
    }
    vk::FALSE
}

/// Device, queue and a command buffer with its fence for each frame in flight.
pub struct Host {
    pub entry: ash::Entry,
    pub instance: ash::Instance,
    pub physical: vk::PhysicalDevice,
    pub device: ash::Device,
    pub family: u32,
    pub queue: vk::Queue,
    pub pools: Vec<(vk::CommandPool, vk::CommandBuffer, vk::Fence)>,
    pub messenger: Option<(ash::ext::debug_utils::Instance, vk::DebugUtilsMessengerEXT)>,
}

impl Host {
    /// A device with nothing but what [`requirements`] lists. Under the validation layer where that is
    /// installed.
    pub fn new() -> Outcome<Self> {
        const LAYER: &CStr = c"VK_LAYER_KHRONOS_validation";
        let required = requirements();
        // SAFETY: each object is made from live ones, with structures that outlive the call.
        unsafe {
            let entry = ash::Entry::load()?;
            let layers = entry.enumerate_instance_layer_properties()?;
            let validated = layers.iter().any(|l| l.layer_name_as_c_str() == Ok(LAYER));
            let layers = [LAYER.as_ptr()];
            let extensions = [vk::EXT_DEBUG_UTILS_NAME.as_ptr()];
            let app = vk::ApplicationInfo::default().api_version(required.api_version);
            let count = usize::from(validated);
            let info = vk::InstanceCreateInfo::default()
                .application_info(&app)
                .enabled_layer_names(&layers[..count])
                .enabled_extension_names(&extensions[..count]);
            let instance = entry.create_instance(&info, None)?;
            let messenger = if validated {
                let debug = ash::ext::debug_utils::Instance::new(&entry, &instance);
                let info = vk::DebugUtilsMessengerCreateInfoEXT::default()
                    .message_severity(
                        vk::DebugUtilsMessageSeverityFlagsEXT::WARNING
                            | vk::DebugUtilsMessageSeverityFlagsEXT::ERROR,
                    )
                    .message_type(vk::DebugUtilsMessageTypeFlagsEXT::VALIDATION)
                    .pfn_user_callback(Some(host_message));
                let messenger = debug.create_debug_utils_messenger(&info, None)?;
                Some((debug, messenger))
            } else {
                None
            };
            let fits = |physical: &vk::PhysicalDevice| {
                let version = instance
                    .get_physical_device_properties(*physical)
                    .api_version;
                required.missing(&instance, *physical, version).is_empty()
            };
            let devices = instance.enumerate_physical_devices()?;
            let physical = devices.into_iter().find(fits).ok_or("no device fits")?;
            let family = Requirements::queue_family(&instance, physical).ok_or("no queue fits")?;
            let queues = [vk::DeviceQueueCreateInfo::default()
                .queue_family_index(family)
                .queue_priorities(&[1.0])];
            let mut features = RequiredFeatures::new();
            let mut chain = features.chain();
            let info = vk::DeviceCreateInfo::default()
                .queue_create_infos(&queues)
                .push_next(&mut chain);
            let device = instance.create_device(physical, &info, None)?;
            let queue = device.get_device_queue(family, 0);
            let mut pools = Vec::new();
            for _ in 0..FRAMES_IN_FLIGHT {
                let info = vk::CommandPoolCreateInfo::default().queue_family_index(family);
                let pool = device.create_command_pool(&info, None)?;
                let info = vk::CommandBufferAllocateInfo::default()
                    .command_pool(pool)
                    .command_buffer_count(1);
                let cmd = device.allocate_command_buffers(&info)?[0];
                let signalled =
                    vk::FenceCreateInfo::default().flags(vk::FenceCreateFlags::SIGNALED);
                pools.push((pool, cmd, device.create_fence(&signalled, None)?));
            }
            Ok(Self {
                entry,
                instance,
                physical,
                device,
                family,
                queue,
                pools,
                messenger,
            })
        }
    }

    pub fn lend(&self) -> HostDevice {
        HostDevice {
            entry: Some(self.entry.clone()),
            instance: self.instance.clone(),
            physical: self.physical,
            device: self.device.clone(),
            queue_family: self.family,
            queue: self.queue,
            api_version: requirements().api_version,
            frames_in_flight: FRAMES_IN_FLIGHT as u32,
            allocator: None,
            debug_utils: self.messenger.is_some(),
            // The device was made without any.
            optional: OptionalFeatures::default(),
        }
    }

    /// Records and submits a frame, once the frame that had its command buffer is done.
    pub fn submit(
        &self,
        slot: usize,
        record: impl FnOnce(vk::CommandBuffer) -> Outcome<()>,
    ) -> Outcome<()> {
        let (pool, cmd, fence) = self.pools[slot];
        // SAFETY: the fence says that the command buffer is no longer in use.
        unsafe {
            self.device.wait_for_fences(&[fence], true, u64::MAX)?;
            self.device.reset_command_pool(pool, Default::default())?;
            self.device.begin_command_buffer(cmd, &Default::default())?;
            record(cmd)?;
            self.device.end_command_buffer(cmd)?;
            self.device.reset_fences(&[fence])?;
            let commands = [vk::CommandBufferSubmitInfo::default().command_buffer(cmd)];
            let submit = vk::SubmitInfo2::default().command_buffer_infos(&commands);
            self.device.queue_submit2(self.queue, &[submit], fence)?;
        }
        Ok(())
    }

    pub fn wait_idle(&self) -> Outcome<()> {
        // SAFETY: the device is alive.
        unsafe { self.device.device_wait_idle()? };
        Ok(())
    }

    pub fn allocate(
        &self,
        needs: vk::MemoryRequirements,
        wanted: vk::MemoryPropertyFlags,
    ) -> Outcome<vk::DeviceMemory> {
        // SAFETY: plain queries and an allocation on live handles.
        unsafe {
            let memory = (self.instance).get_physical_device_memory_properties(self.physical);
            let kind = (0..memory.memory_type_count).find(|i| {
                let flags = memory.memory_types[*i as usize].property_flags;
                needs.memory_type_bits >> i & 1 == 1 && flags.contains(wanted)
            });
            let info = vk::MemoryAllocateInfo::default()
                .allocation_size(needs.size)
                .memory_type_index(kind.ok_or("no memory of that kind")?);
            Ok(self.device.allocate_memory(&info, None)?)
        }
    }

    /// Takes all down; returns how many messages the validation layer had.
    pub fn end(self) -> usize {
        // SAFETY: the device is idle and everything made on it is gone.
        unsafe {
            for (pool, _, fence) in &self.pools {
                self.device.destroy_fence(*fence, None);
                self.device.destroy_command_pool(*pool, None);
            }
            self.device.destroy_device(None);
            if let Some((debug, messenger)) = &self.messenger {
                debug.destroy_debug_utils_messenger(*messenger, None);
            }
            self.instance.destroy_instance(None);
        }
        MESSAGES.load(Ordering::Relaxed)
    }
}

/// An image of the picture's size with memory and view of its own.
pub struct Image {
    pub raw: vk::Image,
    pub view: vk::ImageView,
    pub memory: vk::DeviceMemory,
    pub format: vk::Format,
    pub usage: vk::ImageUsageFlags,
}

impl Image {
    pub fn new(host: &Host, format: vk::Format, usage: vk::ImageUsageFlags) -> Outcome<Self> {
        let aspect = match format {
            vk::Format::D32_SFLOAT => vk::ImageAspectFlags::DEPTH,
            _ => vk::ImageAspectFlags::COLOR,
        };
        // SAFETY: plain creation; the memory fits the image and is bound before the view is made.
        unsafe {
            let info = vk::ImageCreateInfo::default()
                .image_type(vk::ImageType::TYPE_2D)
                .format(format)
                .extent(extent_3d())
                .mip_levels(1)
                .array_layers(1)
                .samples(vk::SampleCountFlags::TYPE_1)
                .usage(usage);
            let raw = host.device.create_image(&info, None)?;
            let needs = host.device.get_image_memory_requirements(raw);
            let memory = host.allocate(needs, vk::MemoryPropertyFlags::DEVICE_LOCAL)?;
            host.device.bind_image_memory(raw, memory, 0)?;
            let info = vk::ImageViewCreateInfo::default()
                .image(raw)
                .view_type(vk::ImageViewType::TYPE_2D)
                .format(format)
                .subresource_range(whole(aspect));
            let view = host.device.create_image_view(&info, None)?;
            Ok(Self {
                raw,
                view,
                memory,
                format,
                usage,
            })
        }
    }

    pub fn destroy(&self, host: &Host) {
        // SAFETY: the device is idle.
        unsafe {
            host.device.destroy_image_view(self.view, None);
            host.device.destroy_image(self.raw, None);
            host.device.free_memory(self.memory, None);
        }
    }
}

pub fn whole(aspect_mask: vk::ImageAspectFlags) -> vk::ImageSubresourceRange {
    vk::ImageSubresourceRange {
        aspect_mask,
        level_count: 1,
        layer_count: 1,
        ..Default::default()
    }
}

/// A buffer that the CPU writes or reads.
pub struct Buffer {
    pub raw: vk::Buffer,
    pub memory: vk::DeviceMemory,
    pub bytes: usize,
}

impl Buffer {
    pub fn new(host: &Host, bytes: usize, usage: vk::BufferUsageFlags) -> Outcome<Self> {
        let mapped = vk::MemoryPropertyFlags::HOST_VISIBLE | vk::MemoryPropertyFlags::HOST_COHERENT;
        let info = vk::BufferCreateInfo::default()
            .size(bytes as u64)
            .usage(usage);
        // SAFETY: plain creation; the memory fits the buffer.
        unsafe {
            let raw = host.device.create_buffer(&info, None)?;
            let needs = host.device.get_buffer_memory_requirements(raw);
            let memory = host.allocate(needs, mapped)?;
            host.device.bind_buffer_memory(raw, memory, 0)?;
            Ok(Self { raw, memory, bytes })
        }
    }

    pub fn write(&self, host: &Host, bytes: &[u8]) -> Outcome<()> {
        // SAFETY: the memory is mapped for its whole size, and nobody else uses it yet.
        unsafe {
            let flags = vk::MemoryMapFlags::empty();
            let place = host
                .device
                .map_memory(self.memory, 0, vk::WHOLE_SIZE, flags)?;
            let count = bytes.len().min(self.bytes);
            std::ptr::copy_nonoverlapping(bytes.as_ptr(), place.cast(), count);
            host.device.unmap_memory(self.memory);
        }
        Ok(())
    }

    pub fn read(&self, host: &Host) -> Outcome<Vec<u8>> {
        let mut bytes = vec![0; self.bytes];
        // SAFETY: as for writing; the device is idle.
        unsafe {
            let flags = vk::MemoryMapFlags::empty();
            let place = host
                .device
                .map_memory(self.memory, 0, vk::WHOLE_SIZE, flags)?;
            std::ptr::copy_nonoverlapping(place.cast(), bytes.as_mut_ptr(), self.bytes);
            host.device.unmap_memory(self.memory);
        }
        Ok(bytes)
    }

    pub fn destroy(&self, host: &Host) {
        // SAFETY: the device is idle.
        unsafe {
            host.device.destroy_buffer(self.raw, None);
            host.device.free_memory(self.memory, None);
        }
    }
}
