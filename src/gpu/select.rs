//! Which devices there are, what they are like, and which one to take.

use std::ffi::CStr;

use ash::vk;

use super::error::{CallResult, GpuError};
use super::host::{Requirements, requirements};

/// What a device says about itself.
#[derive(Clone, Debug)]
pub struct DeviceInfo {
    /// The device's name.
    pub name: String,
    /// The driver's name.
    pub driver_name: String,
    /// The driver's own version text.
    pub driver_info: String,
    /// Which driver it is.
    pub driver_id: vk::DriverId,
    /// Vulkan version of the device, as `VK_MAKE_API_VERSION`.
    pub api_version: u32,
    /// Driver version, in the vendor's own encoding.
    pub driver_version: u32,
    /// PCI vendor, or a Khronos vendor number.
    pub vendor_id: u32,
    /// The vendor's number of the device.
    pub device_id: u32,
    /// Discrete, integrated, CPU, ..
    pub device_type: vk::PhysicalDeviceType,
    /// Identifies what a pipeline cache fits.
    pub pipeline_cache_uuid: [u8; 16],
    /// Identifies the driver build.
    pub driver_uuid: [u8; 16],
    /// The device's limits.
    pub limits: vk::PhysicalDeviceLimits,
}

/// A device as listed, with what keeps us from using it.
#[derive(Clone, Debug)]
pub struct DeviceSummary {
    /// Position in the list, as `--device` takes it.
    pub index: usize,
    /// What it says about itself.
    pub info: DeviceInfo,
    /// What it lacks, each with the reason; empty when it fits.
    pub missing: Vec<String>,
}

impl DeviceSummary {
    /// `index: name (driver)`, for lists and errors.
    #[must_use]
    pub fn label(&self) -> String {
        if self.info.driver_name.is_empty() {
            format!("{}: {}", self.index, self.info.name)
        } else {
            format!(
                "{}: {} ({})",
                self.index, self.info.name, self.info.driver_name
            )
        }
    }
}

/// A fixed-size C string from the driver, up to its end, with anything unprintable replaced.
fn text(chars: &[std::ffi::c_char]) -> String {
    let bytes: Vec<u8> = chars
        .iter()
        .map(|&c| c.to_ne_bytes()[0])
        .chain([0])
        .collect();
    CStr::from_bytes_until_nul(&bytes)
        .map_or_else(|_| String::new(), |s| s.to_string_lossy().trim().to_owned())
}

/// Asks the device about itself.
pub(super) fn device_info(instance: &ash::Instance, physical: vk::PhysicalDevice) -> DeviceInfo {
    // SAFETY: both handles are live, and this entry point exists on every Vulkan version.
    let base = unsafe { instance.get_physical_device_properties(physical) };
    let mut driver = vk::PhysicalDeviceDriverProperties::default();
    let mut id = vk::PhysicalDeviceIDProperties::default();
    if base.api_version >= vk::API_VERSION_1_2 {
        let mut all = vk::PhysicalDeviceProperties2::default()
            .push_next(&mut driver)
            .push_next(&mut id);
        // SAFETY: the device is of version 1.2 or later, which knows both chained structures.
        unsafe { instance.get_physical_device_properties2(physical, &mut all) };
    }
    DeviceInfo {
        name: text(&base.device_name),
        driver_name: text(&driver.driver_name),
        driver_info: text(&driver.driver_info),
        driver_id: driver.driver_id,
        api_version: base.api_version,
        driver_version: base.driver_version,
        vendor_id: base.vendor_id,
        device_id: base.device_id,
        device_type: base.device_type,
        pipeline_cache_uuid: base.pipeline_cache_uuid,
        driver_uuid: id.driver_uuid,
        limits: base.limits,
    }
}

/// All devices of an instance, with what each lacks.
pub(super) fn list(
    instance: &ash::Instance,
) -> Result<Vec<(vk::PhysicalDevice, DeviceSummary)>, GpuError> {
    // SAFETY: the instance is live.
    let devices = match unsafe { instance.enumerate_physical_devices() } {
        Err(vk::Result::ERROR_INITIALIZATION_FAILED) => return Err(GpuError::NoDriver),
        other => other.call("vkEnumeratePhysicalDevices", "the instance")?,
    };
    if devices.is_empty() {
        return Err(GpuError::NoDriver);
    }
    let summaries = devices.into_iter().enumerate().map(|(index, physical)| {
        let info = device_info(instance, physical);
        let mut missing = requirements().missing(instance, physical, info.api_version);
        if Requirements::queue_family(instance, physical).is_none() {
            missing
                .push("a queue for graphics and compute (all passes share one queue)".to_owned());
        }
        (
            physical,
            DeviceSummary {
                index,
                info,
                missing,
            },
        )
    });
    Ok(summaries.collect())
}

/// Position of the device to take: the wanted one, else the first that fits.
pub(super) fn choose(devices: &[DeviceSummary], wanted: Option<&str>) -> Result<usize, GpuError> {
    let Some(wanted) = wanted else {
        return devices
            .iter()
            .position(|d| d.missing.is_empty())
            .ok_or_else(|| GpuError::NoneFits {
                devices: devices
                    .iter()
                    .map(|d| format!("{} lacks {}", d.label(), d.missing.join(", ")))
                    .collect(),
            });
    };
    let needle = wanted.trim().to_lowercase();
    let by_index = needle
        .parse::<usize>()
        .ok()
        .filter(|&index| index < devices.len());
    let named = |d: &DeviceSummary| {
        [&d.info.name, &d.info.driver_name]
            .iter()
            .any(|name| name.to_lowercase().contains(&needle))
    };
    let matching: Vec<usize> = match by_index {
        Some(index) => vec![index],
        None if needle.is_empty() => Vec::new(),
        None => (0..devices.len()).filter(|&i| named(&devices[i])).collect(),
    };
    let Some(&first) = matching.first() else {
        return Err(GpuError::NoDevice {
            wanted: wanted.to_owned(),
            available: devices.iter().map(DeviceSummary::label).collect(),
        });
    };
    match matching
        .into_iter()
        .find(|&i| devices[i].missing.is_empty())
    {
        Some(index) => Ok(index),
        None => Err(GpuError::Missing {
            device: devices[first].info.name.clone(),
            what: devices[first].missing.clone(),
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn device(index: usize, name: &str, driver: &str, missing: &[&str]) -> DeviceSummary {
        DeviceSummary {
            index,
            info: DeviceInfo {
                name: name.to_owned(),
                driver_name: driver.to_owned(),
                driver_info: String::new(),
                driver_id: vk::DriverId::default(),
                api_version: vk::API_VERSION_1_3,
                driver_version: 0,
                vendor_id: 0,
                device_id: 0,
                device_type: vk::PhysicalDeviceType::CPU,
                pipeline_cache_uuid: [0; 16],
                driver_uuid: [0; 16],
                limits: vk::PhysicalDeviceLimits::default(),
            },
            missing: missing.iter().map(|m| (*m).to_owned()).collect(),
        }
    }

    fn three() -> Vec<DeviceSummary> {
        vec![
            device(0, "Old Thing 9", "acme", &["Vulkan 1.3 (it has 1.1)"]),
            device(1, "llvmpipe (LLVM 15.0.6, 256 bits)", "llvmpipe", &[]),
            device(2, "Radeon 7900", "radv", &[]),
        ]
    }

    #[test]
    fn the_first_that_fits_is_the_default() {
        assert_eq!(choose(&three(), None).ok(), Some(1));
    }

    #[test]
    fn names_and_indices_choose() {
        assert_eq!(choose(&three(), Some("2")).ok(), Some(2));
        assert_eq!(choose(&three(), Some("RADV")).ok(), Some(2));
        assert_eq!(choose(&three(), Some("llvmPIPE")).ok(), Some(1));
        assert_eq!(
            choose(&three(), Some("7900")).ok(),
            Some(2),
            "a number beyond the list is part of a name"
        );
    }

    #[test]
    fn an_unknown_name_lists_the_devices() {
        let text = choose(&three(), Some("voodoo"))
            .map_err(|e| e.to_string())
            .unwrap_err();
        assert!(
            text.contains("\"voodoo\"") && text.contains("2: Radeon 7900 (radv)"),
            "{text}"
        );
        assert!(choose(&three(), Some("")).is_err());
        assert!(choose(&three(), Some("3")).is_err());
    }

    #[test]
    fn a_chosen_device_that_does_not_fit_says_what_it_lacks() {
        let text = choose(&three(), Some("0"))
            .map_err(|e| e.to_string())
            .unwrap_err();
        assert_eq!(text, "device \"Old Thing 9\" lacks Vulkan 1.3 (it has 1.1)");
    }

    #[test]
    fn none_that_fits_names_each_with_its_reason() {
        let devices = [
            device(0, "A", "", &["x", "y"]),
            device(1, "B", "drv", &["z"]),
        ];
        let text = choose(&devices, None)
            .map_err(|e| e.to_string())
            .unwrap_err();
        assert_eq!(
            text,
            "no Vulkan device fits: 0: A lacks x, y; 1: B (drv) lacks z"
        );
        assert!(choose(&[], None).is_err());
    }
}
