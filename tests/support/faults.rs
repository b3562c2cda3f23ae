//! A device's functions, of which one fails when it is told to: what a driver without memory, or a device
//! that is lost, does to a frame. A call that fails never reaches the driver.

use std::backtrace::Backtrace;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::sync::{Mutex, MutexGuard, PoisonError};

use antumbra::ash;
use antumbra::ash::vk;

/// Which calls fail. They are counted from [`arm`] on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// None.
    None,
    /// That one alone, as if there were no memory for it.
    Nth(usize),
    /// Submissions from that one on, and waits and reads of queries: the device is lost.
    LostFrom(usize),
}

struct State {
    real: Option<ash::Device>,
    fault: Fault,
    calls: Vec<&'static str>,
    /// Of each call, while they are asked for.
    sites: Option<Vec<u64>>,
}

static STATE: Mutex<State> = Mutex::new(State {
    real: None,
    fault: Fault::None,
    calls: Vec::new(),
    sites: None,
});

fn state() -> MutexGuard<'static, State> {
    STATE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Begins to count anew.
pub fn arm(fault: Fault) {
    let mut state = state();
    state.fault = fault;
    state.calls.clear();
    state.sites = None;
}

/// As [`arm`] without a fault, and notes where each call comes from.
pub fn trace() {
    arm(Fault::None);
    state().sites = Some(Vec::new());
}

/// Where the calls since [`trace`] come from: the same number where functions and lines of the whole stack are
/// the same. Passes are recorded by functions of their own, so each has its own.
pub fn sites() -> Vec<u64> {
    state().sites.clone().unwrap_or_default()
}

/// The calls that can fail since [`arm`], those that failed among them, by their names.
pub fn calls() -> Vec<&'static str> {
    state().calls.clone()
}

/// What a lost device makes fail.
const ASK_THE_DEVICE: [&str; 3] = ["vkQueueSubmit2", "vkWaitForFences", "vkGetQueryPoolResults"];

/// Counts a call; what it returns if it fails.
fn refuse(call: &'static str) -> Option<vk::Result> {
    let traced = state().sites.is_some();
    // Not under the lock: it takes milliseconds.
    let site = traced.then(|| {
        let mut hasher = DefaultHasher::new();
        Backtrace::force_capture().to_string().hash(&mut hasher);
        hasher.finish()
    });
    let mut state = state();
    let index = state.calls.len();
    state.calls.push(call);
    if let (Some(sites), Some(site)) = (&mut state.sites, site) {
        sites.push(site);
    }
    let out_of_memory = match call {
        "vkAllocateMemory" => vk::Result::ERROR_OUT_OF_DEVICE_MEMORY,
        "vkMapMemory" => vk::Result::ERROR_MEMORY_MAP_FAILED,
        "vkAllocateDescriptorSets" => vk::Result::ERROR_OUT_OF_POOL_MEMORY,
        _ => vk::Result::ERROR_OUT_OF_HOST_MEMORY,
    };
    match state.fault {
        Fault::Nth(nth) if nth == index => Some(out_of_memory),
        Fault::LostFrom(first) if index >= first && ASK_THE_DEVICE.contains(&call) => {
            Some(vk::Result::ERROR_DEVICE_LOST)
        }
        _ => None,
    }
}

fn real() -> ash::Device {
    match &state().real {
        Some(device) => device.clone(),
        None => panic!("a call on a device that was not wrapped"),
    }
}

/// For each function: its name, its place in the tables, its arguments.
macro_rules! wrappers {
    ($($call:literal $name:ident in $table:ident ($($arg:ident: $kind:ty),*);)*) => {
        mod wrapped {
            use super::*;
            $(
                pub unsafe extern "system" fn $name($($arg: $kind),*) -> vk::Result {
                    match refuse($call) {
                        Some(result) => result,
                        // SAFETY: the caller's promises are those of the function.
                        None => unsafe { (real().$table().$name)($($arg),*) },
                    }
                }
            )*
        }

        /// For `GpuOptions::intercept`. Serves one device at a time.
        pub fn wrap(device: ash::Device) -> ash::Device {
            let (mut v1_0, mut v1_3) = (device.fp_v1_0().clone(), device.fp_v1_3().clone());
            $(wrappers!(@set v1_0 v1_3 $table $name);)*
            v1_0.wait_for_fences = wait_for_fences;
            let (handle, v1_1) = (device.handle(), device.fp_v1_1().clone());
            let v1_2 = device.fp_v1_2().clone();
            state().real = Some(device);
            ash::Device::from_parts_1_3(handle, v1_0, v1_1, v1_2, v1_3)
        }
    };
    (@set $v1_0:ident $v1_3:ident fp_v1_0 $name:ident) => { $v1_0.$name = wrapped::$name; };
    (@set $v1_0:ident $v1_3:ident fp_v1_3 $name:ident) => { $v1_3.$name = wrapped::$name; };
}

type Callbacks<'a> = *const vk::AllocationCallbacks<'a>;

wrappers! {
    "vkAllocateMemory" allocate_memory in fp_v1_0 (device: vk::Device, info: *const vk::MemoryAllocateInfo<'_>, callbacks: Callbacks<'_>, out: *mut vk::DeviceMemory);
    "vkMapMemory" map_memory in fp_v1_0 (device: vk::Device, memory: vk::DeviceMemory, offset: u64, size: u64, flags: vk::MemoryMapFlags, out: *mut *mut std::ffi::c_void);
    "vkBindBufferMemory" bind_buffer_memory in fp_v1_0 (device: vk::Device, buffer: vk::Buffer, memory: vk::DeviceMemory, offset: u64);
    "vkBindImageMemory" bind_image_memory in fp_v1_0 (device: vk::Device, image: vk::Image, memory: vk::DeviceMemory, offset: u64);
    "vkCreateBuffer" create_buffer in fp_v1_0 (device: vk::Device, info: *const vk::BufferCreateInfo<'_>, callbacks: Callbacks<'_>, out: *mut vk::Buffer);
    "vkCreateBufferView" create_buffer_view in fp_v1_0 (device: vk::Device, info: *const vk::BufferViewCreateInfo<'_>, callbacks: Callbacks<'_>, out: *mut vk::BufferView);
    "vkCreateImage" create_image in fp_v1_0 (device: vk::Device, info: *const vk::ImageCreateInfo<'_>, callbacks: Callbacks<'_>, out: *mut vk::Image);
    "vkCreateImageView" create_image_view in fp_v1_0 (device: vk::Device, info: *const vk::ImageViewCreateInfo<'_>, callbacks: Callbacks<'_>, out: *mut vk::ImageView);
    "vkCreateShaderModule" create_shader_module in fp_v1_0 (device: vk::Device, info: *const vk::ShaderModuleCreateInfo<'_>, callbacks: Callbacks<'_>, out: *mut vk::ShaderModule);
    "vkCreateGraphicsPipelines" create_graphics_pipelines in fp_v1_0 (device: vk::Device, cache: vk::PipelineCache, count: u32, infos: *const vk::GraphicsPipelineCreateInfo<'_>, callbacks: Callbacks<'_>, out: *mut vk::Pipeline);
    "vkCreateComputePipelines" create_compute_pipelines in fp_v1_0 (device: vk::Device, cache: vk::PipelineCache, count: u32, infos: *const vk::ComputePipelineCreateInfo<'_>, callbacks: Callbacks<'_>, out: *mut vk::Pipeline);
    "vkCreatePipelineLayout" create_pipeline_layout in fp_v1_0 (device: vk::Device, info: *const vk::PipelineLayoutCreateInfo<'_>, callbacks: Callbacks<'_>, out: *mut vk::PipelineLayout);
    "vkCreateSampler" create_sampler in fp_v1_0 (device: vk::Device, info: *const vk::SamplerCreateInfo<'_>, callbacks: Callbacks<'_>, out: *mut vk::Sampler);
    "vkCreateDescriptorSetLayout" create_descriptor_set_layout in fp_v1_0 (device: vk::Device, info: *const vk::DescriptorSetLayoutCreateInfo<'_>, callbacks: Callbacks<'_>, out: *mut vk::DescriptorSetLayout);
    "vkCreateDescriptorPool" create_descriptor_pool in fp_v1_0 (device: vk::Device, info: *const vk::DescriptorPoolCreateInfo<'_>, callbacks: Callbacks<'_>, out: *mut vk::DescriptorPool);
    "vkAllocateDescriptorSets" allocate_descriptor_sets in fp_v1_0 (device: vk::Device, info: *const vk::DescriptorSetAllocateInfo<'_>, out: *mut vk::DescriptorSet);
    "vkCreateQueryPool" create_query_pool in fp_v1_0 (device: vk::Device, info: *const vk::QueryPoolCreateInfo<'_>, callbacks: Callbacks<'_>, out: *mut vk::QueryPool);
    "vkGetQueryPoolResults" get_query_pool_results in fp_v1_0 (device: vk::Device, pool: vk::QueryPool, first: u32, count: u32, size: usize, out: *mut std::ffi::c_void, stride: u64, flags: vk::QueryResultFlags);
    "vkCreateFence" create_fence in fp_v1_0 (device: vk::Device, info: *const vk::FenceCreateInfo<'_>, callbacks: Callbacks<'_>, out: *mut vk::Fence);
    "vkResetFences" reset_fences in fp_v1_0 (device: vk::Device, count: u32, fences: *const vk::Fence);
    "vkCreateCommandPool" create_command_pool in fp_v1_0 (device: vk::Device, info: *const vk::CommandPoolCreateInfo<'_>, callbacks: Callbacks<'_>, out: *mut vk::CommandPool);
    "vkResetCommandPool" reset_command_pool in fp_v1_0 (device: vk::Device, pool: vk::CommandPool, flags: vk::CommandPoolResetFlags);
    "vkAllocateCommandBuffers" allocate_command_buffers in fp_v1_0 (device: vk::Device, info: *const vk::CommandBufferAllocateInfo<'_>, out: *mut vk::CommandBuffer);
    "vkBeginCommandBuffer" begin_command_buffer in fp_v1_0 (cmd: vk::CommandBuffer, info: *const vk::CommandBufferBeginInfo<'_>);
    "vkEndCommandBuffer" end_command_buffer in fp_v1_0 (cmd: vk::CommandBuffer);
    "vkQueueSubmit2" queue_submit2 in fp_v1_3 (queue: vk::Queue, count: u32, infos: *const vk::SubmitInfo2<'_>, fence: vk::Fence);
}

/// Waits although the device is lost: the driver's is not, and goes on.
unsafe extern "system" fn wait_for_fences(
    device: vk::Device,
    count: u32,
    fences: *const vk::Fence,
    all: vk::Bool32,
    timeout: u64,
) -> vk::Result {
    let refused = refuse("vkWaitForFences");
    if refused.is_some_and(|result| result != vk::Result::ERROR_DEVICE_LOST) {
        return refused.unwrap_or_default();
    }
    // SAFETY: the caller's promises are those of the function.
    let waited = unsafe { (real().fp_v1_0().wait_for_fences)(device, count, fences, all, timeout) };
    refused.unwrap_or(waited)
}
