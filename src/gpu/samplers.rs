//! Samplers, made once per description.

use std::collections::HashMap;

use ash::vk;

use super::context::Gpu;
use super::error::{CallResult, GpuError};

/// Describes a sampler. No anisotropy, no bias.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct SamplerDesc {
    /// Filter within a level.
    pub filter: vk::Filter,
    /// Filter between levels.
    pub mipmap: vk::SamplerMipmapMode,
    /// What lies outside, in all directions.
    pub address: vk::SamplerAddressMode,
    /// Border of [`vk::SamplerAddressMode::CLAMP_TO_BORDER`].
    pub border: vk::BorderColor,
    /// For comparing (shadow) samplers: result is 1 where `reference OP texel`.
    pub compare: Option<vk::CompareOp>,
}

impl SamplerDesc {
    /// Nearest texel, clamped to the edge.
    #[must_use]
    pub fn nearest() -> Self {
        Self {
            filter: vk::Filter::NEAREST,
            mipmap: vk::SamplerMipmapMode::NEAREST,
            address: vk::SamplerAddressMode::CLAMP_TO_EDGE,
            border: vk::BorderColor::FLOAT_OPAQUE_WHITE,
            compare: None,
        }
    }

    /// Bilinear within the nearest level, clamped to the edge.
    #[must_use]
    pub fn linear() -> Self {
        Self {
            filter: vk::Filter::LINEAR,
            ..Self::nearest()
        }
    }

    /// Compares the four nearest texels and interpolates the results, clamped to the edge.
    #[must_use]
    pub fn compare(op: vk::CompareOp) -> Self {
        Self {
            compare: Some(op),
            ..Self::linear()
        }
    }

    fn name(&self) -> String {
        let compare = self
            .compare
            .map_or_else(String::new, |op| format!(" compare {op:?}"));
        format!("sampler {:?} {:?}{compare}", self.filter, self.address)
    }
}

#[derive(Default)]
pub(super) struct Samplers(HashMap<SamplerDesc, vk::Sampler>);

impl Gpu {
    /// The sampler of a description; it lives as long as the device.
    ///
    /// # Errors
    /// A failing call.
    pub fn sampler(&mut self, desc: &SamplerDesc) -> Result<vk::Sampler, GpuError> {
        if let Some(&sampler) = self.samplers.0.get(desc) {
            return Ok(sampler);
        }
        let info = vk::SamplerCreateInfo::default()
            .mag_filter(desc.filter)
            .min_filter(desc.filter)
            .mipmap_mode(desc.mipmap)
            .address_mode_u(desc.address)
            .address_mode_v(desc.address)
            .address_mode_w(desc.address)
            .border_color(desc.border)
            .compare_enable(desc.compare.is_some())
            .compare_op(desc.compare.unwrap_or(vk::CompareOp::ALWAYS))
            .max_lod(vk::LOD_CLAMP_NONE);
        let name = desc.name();
        // SAFETY: the description is complete and uses no optional feature.
        let sampler =
            unsafe { self.device.create_sampler(&info, None) }.call("vkCreateSampler", &name)?;
        self.set_name(sampler, &name);
        self.samplers.0.insert(*desc, sampler);
        Ok(sampler)
    }

    pub(super) fn destroy_samplers(&mut self) {
        for (_, sampler) in self.samplers.0.drain() {
            // SAFETY: ours, and the device is idle.
            unsafe { self.device.destroy_sampler(sampler, None) };
        }
    }
}
