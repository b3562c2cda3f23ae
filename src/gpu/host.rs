//! Running as a guest: the host's device, and what we need from it.

use std::sync::{Arc, Mutex};

use ash::vk;
use gpu_allocator::vulkan::Allocator;

/// A device that belongs to the host. We create objects on it and record into the host's command
/// buffers; nothing is submitted or waited for, and destroying the [`Gpu`](super::Gpu) frees our
/// objects only.
///
/// The host promises that the handles are valid and stay so until
/// [`Gpu::destroy`](super::Gpu::destroy) has returned, that the device was made with everything
/// that [`requirements`] lists, and that before it begins frame `n` the frame
/// `n - frames_in_flight` has finished on the device.
#[derive(Clone)]
pub struct HostDevice {
    /// The loaded Vulkan library; kept alive when given.
    pub entry: Option<ash::Entry>,
    /// The instance of the device.
    pub instance: ash::Instance,
    /// The physical device of the device.
    pub physical: vk::PhysicalDevice,
    /// The device.
    pub device: ash::Device,
    /// Family of the queue that will run our command buffers; it must do graphics and compute.
    pub queue_family: u32,
    /// That queue. Never submitted to.
    pub queue: vk::Queue,
    /// The lower of the instance's `apiVersion` and the version the device supports.
    pub api_version: u32,
    /// How many frames the host keeps in flight, at least 1.
    pub frames_in_flight: u32,
    /// The host's allocator; without one we make our own.
    pub allocator: Option<Arc<Mutex<Allocator>>>,
    /// Whether the instance has `VK_EXT_debug_utils` enabled; then our objects get names and our
    /// passes labels.
    pub debug_utils: bool,
    /// Features that we can do without and that the device was made with.
    pub optional: OptionalFeatures,
}

/// Features that make something faster where a device has them; without them it is done another way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct OptionalFeatures {
    /// `logicOp`: bits are set in integer attachments.
    pub logic_op: bool,
}

impl OptionalFeatures {
    /// All of them.
    pub const ALL: Self = Self { logic_op: true };

    /// Those that the physical device can be made with.
    #[must_use]
    pub fn supported(instance: &ash::Instance, physical: vk::PhysicalDevice) -> Self {
        // SAFETY: the handles are live by the caller's promise.
        let features = unsafe { instance.get_physical_device_features(physical) };
        Self {
            logic_op: features.logic_op == vk::TRUE,
        }
    }

    /// Switches these on in what a device is made with and leaves the others alone.
    pub fn enable(self, features: &mut vk::PhysicalDeviceFeatures) {
        if self.logic_op {
            features.logic_op = vk::TRUE;
        }
    }
}

/// Something the device has to have, and why.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Requirement {
    /// The name in the Vulkan specification.
    pub name: &'static str,
    /// What we use it for.
    pub reason: &'static str,
}

/// Everything that a device must support and have enabled to run us.
#[derive(Clone, Copy, Debug)]
pub struct Requirements {
    /// The lowest Vulkan version of instance and device.
    pub api_version: u32,
    /// Device extensions to enable.
    pub device_extensions: &'static [Requirement],
    /// Features to enable, see [`RequiredFeatures`].
    pub features: &'static [Requirement],
}

const FEATURES: &[Requirement] = &[
    Requirement {
        name: "hostQueryReset",
        reason: "per-pass timestamps are reset when a frame begins",
    },
    Requirement {
        name: "dynamicRendering",
        reason: "graphics passes have no render pass objects",
    },
    Requirement {
        name: "synchronization2",
        reason: "all barriers and timestamps use it",
    },
    Requirement {
        name: "maintenance4",
        reason: "memory is planned before images exist",
    },
];

/// What a device must support and have enabled.
#[must_use]
pub fn requirements() -> Requirements {
    Requirements {
        api_version: vk::API_VERSION_1_3,
        device_extensions: &[],
        features: FEATURES,
    }
}

/// The feature structures to chain into `VkDeviceCreateInfo`, with all that we need switched on and
/// the rest off.
///
/// A host with structures of its own switches ours on in them with [`RequiredFeatures::enable`].
#[derive(Clone, Copy, Debug, Default)]
pub struct RequiredFeatures {
    /// Vulkan 1.2 features.
    pub vulkan12: vk::PhysicalDeviceVulkan12Features<'static>,
    /// Vulkan 1.3 features.
    pub vulkan13: vk::PhysicalDeviceVulkan13Features<'static>,
}

impl RequiredFeatures {
    /// Our features on, all others off.
    #[must_use]
    pub fn new() -> Self {
        let mut features = Self::default();
        Self::enable(&mut features.vulkan12, &mut features.vulkan13);
        features
    }

    /// Switches our features on in the host's own structures and leaves the others alone.
    pub fn enable(
        vulkan12: &mut vk::PhysicalDeviceVulkan12Features<'_>,
        vulkan13: &mut vk::PhysicalDeviceVulkan13Features<'_>,
    ) {
        vulkan12.host_query_reset = vk::TRUE;
        vulkan13.dynamic_rendering = vk::TRUE;
        vulkan13.synchronization2 = vk::TRUE;
        vulkan13.maintenance4 = vk::TRUE;
    }

    /// The chain for `VkDeviceCreateInfo::pNext`.
    pub fn chain(&mut self) -> vk::PhysicalDeviceFeatures2<'_> {
        vk::PhysicalDeviceFeatures2::default()
            .push_next(&mut self.vulkan12)
            .push_next(&mut self.vulkan13)
    }

    fn has(&self, name: &str) -> bool {
        let bit = match name {
            "hostQueryReset" => self.vulkan12.host_query_reset,
            "dynamicRendering" => self.vulkan13.dynamic_rendering,
            "synchronization2" => self.vulkan13.synchronization2,
            "maintenance4" => self.vulkan13.maintenance4,
            _ => vk::FALSE,
        };
        bit == vk::TRUE
    }
}

impl Requirements {
    /// What the physical device lacks, one entry each with the reason; empty when it fits.
    ///
    /// `api_version` is the version the device may be used with, see [`HostDevice::api_version`].
    #[must_use]
    pub fn missing(
        &self,
        instance: &ash::Instance,
        physical: vk::PhysicalDevice,
        api_version: u32,
    ) -> Vec<String> {
        if api_version < self.api_version {
            // Older devices know nothing of the structures that the other questions need.
            return vec![format!(
                "Vulkan {}.{} (it has {}.{})",
                vk::api_version_major(self.api_version),
                vk::api_version_minor(self.api_version),
                vk::api_version_major(api_version),
                vk::api_version_minor(api_version),
            )];
        }
        let mut supported = RequiredFeatures::default();
        let mut chain = supported.chain();
        // SAFETY: the handles are live by the caller's promise and the device is of version 1.3,
        // which knows the chain.
        unsafe { instance.get_physical_device_features2(physical, &mut chain) };
        let mut missing: Vec<String> = self
            .features
            .iter()
            .filter(|feature| !supported.has(feature.name))
            .map(|feature| format!("feature {} ({})", feature.name, feature.reason))
            .collect();
        if !self.device_extensions.is_empty() {
            // SAFETY: as above.
            let offered = unsafe { instance.enumerate_device_extension_properties(physical) }
                .unwrap_or_default();
            let has = |name: &str| {
                offered.iter().any(|e| {
                    e.extension_name_as_c_str()
                        .is_ok_and(|n| n.to_bytes() == name.as_bytes())
                })
            };
            missing.extend(
                self.device_extensions
                    .iter()
                    .filter(|extension| !has(extension.name))
                    .map(|extension| {
                        format!("extension {} ({})", extension.name, extension.reason)
                    }),
            );
        }
        missing
    }

    /// Index of the first queue family that does graphics and compute.
    #[must_use]
    pub fn queue_family(instance: &ash::Instance, physical: vk::PhysicalDevice) -> Option<u32> {
        let wanted = vk::QueueFlags::GRAPHICS | vk::QueueFlags::COMPUTE;
        // SAFETY: the handles are live by the caller's promise.
        let families = unsafe { instance.get_physical_device_queue_family_properties(physical) };
        families
            .iter()
            .position(|family| family.queue_count > 0 && family.queue_flags.contains(wanted))
            .and_then(|index| u32::try_from(index).ok())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_listed_feature_is_switched_on() {
        let features = RequiredFeatures::new();
        for feature in requirements().features {
            assert!(
                features.has(feature.name),
                "{} is listed, but not enabled",
                feature.name
            );
            assert!(!RequiredFeatures::default().has(feature.name));
        }
    }
}
