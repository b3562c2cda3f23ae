//! A host that lends us its device.

use std::sync::Mutex;

use antumbra::ash::{self, vk};
use antumbra::gpu::{HostDevice, RequiredFeatures, Requirements, requirements};

/// A device made by a host, with nothing but what [`requirements`] asks for, under the host's own
/// validation messenger.
pub struct Host {
    pub entry: ash::Entry,
    pub instance: ash::Instance,
    pub physical: vk::PhysicalDevice,
    pub device: ash::Device,
    pub family: u32,
    debug: ash::ext::debug_utils::Instance,
    messenger: vk::DebugUtilsMessengerEXT,
    /// Warnings and errors; boxed, because the layer holds its address.
    log: Box<Mutex<Vec<String>>>,
}

unsafe extern "system" fn host_message(
    _: vk::DebugUtilsMessageSeverityFlagsEXT,
    _: vk::DebugUtilsMessageTypeFlagsEXT,
    data: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
    log: *mut std::ffi::c_void,
) -> vk::Bool32 {
    // SAFETY: the layer's data is valid, and the log lives longer than the instance.
    unsafe {
        let text = (*data)
            .message_as_c_str()
            .map_or_else(String::new, |s| s.to_string_lossy().into_owned());
        (*log.cast::<Mutex<Vec<String>>>())
            .lock()
            .unwrap()
            .push(text);
    }
    vk::FALSE
}

impl Host {
    /// Makes the device with these features; fails without a driver or the layer.
    pub fn new(features: &mut RequiredFeatures) -> Self {
        // SAFETY: ordinary set-up with live handles throughout; the layer was shown to be there by
        // the other tests.
        unsafe {
            let entry = ash::Entry::load().unwrap();
            let app = vk::ApplicationInfo::default().api_version(requirements().api_version);
            let layers = [c"VK_LAYER_KHRONOS_validation".as_ptr()];
            let extensions = [vk::EXT_DEBUG_UTILS_NAME.as_ptr()];
            let info = vk::InstanceCreateInfo::default()
                .application_info(&app)
                .enabled_layer_names(&layers)
                .enabled_extension_names(&extensions);
            let instance = entry
                .create_instance(&info, None)
                .expect("install a driver and the layer: apt install mesa-vulkan-drivers vulkan-validationlayers");
            let log = Box::new(Mutex::new(Vec::new()));
            let debug = ash::ext::debug_utils::Instance::new(&entry, &instance);
            let info = vk::DebugUtilsMessengerCreateInfoEXT {
                message_severity: vk::DebugUtilsMessageSeverityFlagsEXT::WARNING
                    | vk::DebugUtilsMessageSeverityFlagsEXT::ERROR,
                message_type: vk::DebugUtilsMessageTypeFlagsEXT::VALIDATION,
                pfn_user_callback: Some(host_message),
                p_user_data: std::ptr::from_ref(&*log).cast_mut().cast(),
                ..Default::default()
            };
            let messenger = debug.create_debug_utils_messenger(&info, None).unwrap();
            let physical = instance
                .enumerate_physical_devices()
                .unwrap()
                .into_iter()
                .find(|&p| {
                    requirements()
                        .missing(
                            &instance,
                            p,
                            instance.get_physical_device_properties(p).api_version,
                        )
                        .is_empty()
                })
                .unwrap();
            let family = Requirements::queue_family(&instance, physical).unwrap();
            let queues = [vk::DeviceQueueCreateInfo::default()
                .queue_family_index(family)
                .queue_priorities(&[1.0])];
            let names: Vec<_> = requirements()
                .device_extensions
                .iter()
                .map(|e| std::ffi::CString::new(e.name).unwrap())
                .collect();
            let names: Vec<_> = names.iter().map(|n| n.as_ptr()).collect();
            let mut chain = features.chain();
            let info = vk::DeviceCreateInfo::default()
                .queue_create_infos(&queues)
                .enabled_extension_names(&names)
                .push_next(&mut chain);
            let device = instance.create_device(physical, &info, None).unwrap();
            Self {
                entry,
                instance,
                physical,
                device,
                family,
                debug,
                messenger,
                log,
            }
        }
    }

    /// What the host hands over.
    pub fn lend(&self, frames_in_flight: u32) -> HostDevice {
        HostDevice {
            optional: antumbra::gpu::OptionalFeatures::default(),
            entry: Some(self.entry.clone()),
            instance: self.instance.clone(),
            physical: self.physical,
            device: self.device.clone(),
            queue_family: self.family,
            // SAFETY: the family was made with one queue.
            queue: unsafe { self.device.get_device_queue(self.family, 0) },
            api_version: requirements().api_version,
            frames_in_flight,
            allocator: None,
            debug_utils: true,
        }
    }

    /// Takes all down and fails when the layer had anything to say in all the time, leaked objects
    /// included.
    pub fn end(self) {
        // SAFETY: all of it is ours, and the device is idle.
        unsafe {
            self.device.destroy_device(None);
            let messages = std::mem::take(&mut *self.log.lock().unwrap());
            assert!(messages.is_empty(), "{}", messages.join("\n"));
            self.debug
                .destroy_debug_utils_messenger(self.messenger, None);
            self.instance.destroy_instance(None);
        }
    }
}
