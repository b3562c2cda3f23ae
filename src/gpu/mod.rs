//! The device: choosing or borrowing one, memory, pipelines, descriptors, samplers, timings, names.
//!
//! [`Gpu::create`] makes a device of our own and [`Gpu::run`] records, submits and waits on it;
//! [`Gpu::from_host`] works on a host's device and never submits or waits. Everything is created
//! lazily, cached by description and named; [`Gpu::destroy`] frees it all and hands back what the
//! validation layer had to say.
//!
//! Functions that take Vulkan handles rely on their being live objects of this device, as Vulkan
//! itself does.

mod context;
mod debug;
mod descriptors;
mod error;
mod host;
mod instance;
mod memory;
mod pipeline_cache;
mod pipeline_desc;
mod pipelines;
mod retire;
mod samplers;
mod select;
mod shader;
pub mod spirv;
mod submit;
mod timestamps;

pub use context::{Gpu, GpuOptions, enumerate};
pub use debug::{MessageSeverity, ValidationMessage};
pub use descriptors::{SetResource, SetWrite};
pub use error::GpuError;
pub use gpu_allocator::MemoryLocation;
pub use gpu_allocator::vulkan::Allocation;
pub use host::{
    ExtraFeatures, HostDevice, OptionalFeatures, RequiredFeatures, Requirement, Requirements,
    requirements,
};
pub use memory::{Buffer, Image, ImageSpec, MemoryUse};
pub use pipeline_desc::{
    Blend, ComputePipelineDesc, DepthState, GraphicsPipelineDesc, PipelineHandle, VertexStream,
};
pub use retire::Retired;
pub use samplers::SamplerDesc;
pub use select::{DeviceInfo, DeviceSummary};
pub use shader::{BindingInfo, Shader};
pub use timestamps::TimingId;
