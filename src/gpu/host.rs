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

/// Structures for those of our features that a chain of another engine's making has no place for.
///
/// An engine that makes `VkDeviceCreateInfo` itself and lends it before the device exists (as wgpu's Vulkan
/// backend does) has its features in structures that must not appear twice, so [`RequiredFeatures::chain`] cannot
/// simply be added to them.
#[derive(Clone, Copy, Debug, Default)]
pub struct ExtraFeatures {
    host_query_reset: vk::PhysicalDeviceHostQueryResetFeatures<'static>,
    dynamic_rendering: vk::PhysicalDeviceDynamicRenderingFeatures<'static>,
    synchronization2: vk::PhysicalDeviceSynchronization2Features<'static>,
    maintenance4: vk::PhysicalDeviceMaintenance4Features<'static>,
}

impl ExtraFeatures {
    /// Switches our features on where `info`'s chain has a structure for them, and chains one of ours where it has
    /// none. Nothing is switched off.
    ///
    /// # Safety
    /// The chain of `info` consists of live structures that nobody else is using.
    pub unsafe fn complete<'a>(
        &'a mut self,
        mut info: vk::DeviceCreateInfo<'a>,
    ) -> vk::DeviceCreateInfo<'a> {
        use vk::StructureType as S;
        let [mut reset, mut rendering, mut sync, mut maintenance] = [false; 4];
        let mut next = info.p_next.cast_mut().cast::<vk::BaseOutStructure<'_>>();
        while !next.is_null() {
            // SAFETY: links of the chain are live by the caller's promise, and a structure is of the kind that its
            // type says.
            unsafe {
                match (*next).s_type {
                    S::PHYSICAL_DEVICE_VULKAN_1_2_FEATURES => {
                        let features = next.cast::<vk::PhysicalDeviceVulkan12Features<'_>>();
                        (*features).host_query_reset = vk::TRUE;
                        reset = true;
                    }
                    S::PHYSICAL_DEVICE_VULKAN_1_3_FEATURES => {
                        let features = next.cast::<vk::PhysicalDeviceVulkan13Features<'_>>();
                        (*features).dynamic_rendering = vk::TRUE;
                        (*features).synchronization2 = vk::TRUE;
                        (*features).maintenance4 = vk::TRUE;
                        [rendering, sync, maintenance] = [true; 3];
                    }
                    S::PHYSICAL_DEVICE_HOST_QUERY_RESET_FEATURES => {
                        let features = next.cast::<vk::PhysicalDeviceHostQueryResetFeatures<'_>>();
                        (*features).host_query_reset = vk::TRUE;
                        reset = true;
                    }
                    S::PHYSICAL_DEVICE_DYNAMIC_RENDERING_FEATURES => {
                        let features =
                            next.cast::<vk::PhysicalDeviceDynamicRenderingFeatures<'_>>();
                        (*features).dynamic_rendering = vk::TRUE;
                        rendering = true;
                    }
                    S::PHYSICAL_DEVICE_SYNCHRONIZATION_2_FEATURES => {
                        let features =
                            next.cast::<vk::PhysicalDeviceSynchronization2Features<'_>>();
                        (*features).synchronization2 = vk::TRUE;
                        sync = true;
                    }
                    S::PHYSICAL_DEVICE_MAINTENANCE_4_FEATURES => {
                        let features = next.cast::<vk::PhysicalDeviceMaintenance4Features<'_>>();
                        (*features).maintenance4 = vk::TRUE;
                        maintenance = true;
                    }
                    _ => {}
                }
                next = (*next).p_next;
            }
        }
        *self = Self::default();
        if !reset {
            self.host_query_reset.host_query_reset = vk::TRUE;
            info = info.push_next(&mut self.host_query_reset);
        }
        if !rendering {
            self.dynamic_rendering.dynamic_rendering = vk::TRUE;
            info = info.push_next(&mut self.dynamic_rendering);
        }
        if !sync {
            self.synchronization2.synchronization2 = vk::TRUE;
            info = info.push_next(&mut self.synchronization2);
        }
        if !maintenance {
            self.maintenance4.maintenance4 = vk::TRUE;
            info = info.push_next(&mut self.maintenance4);
        }
        info
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

    /// Of each structure in a chain, its type; none may appear twice.
    fn types(info: &vk::DeviceCreateInfo<'_>) -> Vec<vk::StructureType> {
        let mut types = Vec::new();
        let mut next = info.p_next.cast::<vk::BaseInStructure<'_>>();
        while !next.is_null() {
            // SAFETY: the tests chain live structures.
            unsafe {
                types.push((*next).s_type);
                next = (*next).p_next;
            }
        }
        types
    }

    #[test]
    fn a_host_s_chain_is_completed() {
        // None of them there.
        let mut extra = ExtraFeatures::default();
        // SAFETY: an empty chain.
        let info = unsafe { extra.complete(vk::DeviceCreateInfo::default()) };
        assert_eq!(types(&info).len(), requirements().features.len());
        // One there and switched off, as wgpu leaves it.
        let mut theirs = vk::PhysicalDeviceMaintenance4Features::default();
        let mut other = vk::PhysicalDeviceMultiviewFeatures::default();
        let info = vk::DeviceCreateInfo::default()
            .push_next(&mut theirs)
            .push_next(&mut other);
        let mut extra = ExtraFeatures::default();
        // SAFETY: both structures are live.
        let info = unsafe { extra.complete(info) };
        let found = types(&info);
        assert_eq!(found.len(), 5);
        for (at, kind) in found.iter().enumerate() {
            assert!(!found[..at].contains(kind), "{kind:?} twice");
        }
        assert_eq!(theirs.maintenance4, vk::TRUE);
        assert_eq!(other.multiview, vk::FALSE);
        // All of them in the structures of the versions.
        let mut theirs12 = vk::PhysicalDeviceVulkan12Features::default();
        let mut theirs13 = vk::PhysicalDeviceVulkan13Features::default();
        let info = vk::DeviceCreateInfo::default()
            .push_next(&mut theirs12)
            .push_next(&mut theirs13);
        let mut extra = ExtraFeatures::default();
        // SAFETY: both structures are live.
        let info = unsafe { extra.complete(info) };
        assert_eq!(types(&info).len(), 2);
        let has = RequiredFeatures {
            vulkan12: theirs12,
            vulkan13: theirs13,
        };
        assert!(requirements().features.iter().all(|f| has.has(f.name)));
    }

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
