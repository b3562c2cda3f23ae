//! `antumbra info`: devices, drivers, and what is missing.

use std::fmt::Write as _;

use ash::vk;
use clap::Args;

use super::error::CliError;
use super::print_text;
use crate::gpu::{self, DeviceSummary};
use crate::shadow::Technique;

const EXAMPLES: &str = "\
Examples:
  antumbra info
  VK_DRIVER_FILES=/usr/share/vulkan/icd.d/lvp_icd.x86_64.json antumbra info";

/// List devices and drivers, what is needed of them and what they lack
#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct InfoArgs {}

pub(super) fn run(_args: &InfoArgs) -> Result<(), CliError> {
    let devices = gpu::enumerate()?;
    print_text(&to_text(&devices))
}

fn version(version: u32) -> String {
    format!(
        "{}.{}.{}",
        vk::api_version_major(version),
        vk::api_version_minor(version),
        vk::api_version_patch(version)
    )
}

fn kind(kind: vk::PhysicalDeviceType) -> &'static str {
    match kind {
        vk::PhysicalDeviceType::DISCRETE_GPU => "discrete GPU",
        vk::PhysicalDeviceType::INTEGRATED_GPU => "integrated GPU",
        vk::PhysicalDeviceType::VIRTUAL_GPU => "virtual GPU",
        vk::PhysicalDeviceType::CPU => "software",
        _ => "other",
    }
}

fn to_text(devices: &[DeviceSummary]) -> String {
    let mut text = String::new();
    let mut line = |line: String| {
        // Writing to a String cannot fail.
        let _ = writeln!(text, "{line}");
    };
    line(format!("antumbra {}", env!("CARGO_PKG_VERSION")));
    line(String::new());
    line("Devices (--device takes the index or part of the name)".into());
    let default = devices.iter().position(|device| device.missing.is_empty());
    for (at, device) in devices.iter().enumerate() {
        let info = &device.info;
        line(format!("  {}", device.label()));
        line(format!(
            "     {}, Vulkan {}, driver {}",
            kind(info.device_type),
            version(info.api_version),
            if info.driver_info.is_empty() {
                "of unknown version"
            } else {
                &info.driver_info
            }
        ));
        if device.missing.is_empty() {
            let note = if default == Some(at) {
                " (the default)"
            } else {
                ""
            };
            line(format!("     fits{note}"));
        }
        for missing in &device.missing {
            line(format!("     lacks {missing}"));
        }
    }
    if default.is_none() {
        line("  none of them fits".into());
    }

    let needed = gpu::requirements();
    line(String::new());
    line("Needed by every technique".into());
    let version = needed.api_version;
    line(format!(
        "  Vulkan {}.{}",
        vk::api_version_major(version),
        vk::api_version_minor(version)
    ));
    let extensions = needed.device_extensions.iter();
    for requirement in needed.features.iter().chain(extensions) {
        line(format!("  {}: {}", requirement.name, requirement.reason));
    }

    line(String::new());
    line("Techniques".into());
    let fitting: Vec<String> = (devices.iter())
        .filter(|device| device.missing.is_empty())
        .map(|device| device.index.to_string())
        .collect();
    for technique in Technique::ALL {
        let state = if fitting.is_empty() {
            "needs a device that fits".into()
        } else {
            format!("needs nothing more; runs on device {}", fitting.join(", "))
        };
        line(format!("  {}: {state}", technique.name()));
    }
    text
}
