//! What can go wrong between us and the driver.

use std::path::PathBuf;
use std::time::Duration;

use ash::vk;
use thiserror::Error;

/// An error of the GPU layer. Every message is one line and names the object and, where there is
/// one, the remedy.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum GpuError {
    /// The Vulkan loader library is missing or broken.
    #[error(
        "cannot load the Vulkan loader ({reason}); install it (Debian, Ubuntu: apt install libvulkan1)"
    )]
    NoLoader {
        /// What the dynamic linker said.
        reason: String,
    },
    /// The loader works, but no driver answers.
    #[error(
        "no Vulkan driver found; install one (Debian, Ubuntu: apt install mesa-vulkan-drivers) \
         and check VK_DRIVER_FILES and VK_ICD_FILENAMES"
    )]
    NoDriver,
    /// Validation was asked for, but the layer (or what it needs) is not there.
    #[error(
        "validation needs {what}, which is not installed \
         (Debian, Ubuntu: apt install vulkan-validationlayers; elsewhere point VK_LAYER_PATH at the folder of its manifest)"
    )]
    NoValidation {
        /// The layer or extension that is missing.
        what: String,
    },
    /// No device has the wanted name or index.
    #[error("no Vulkan device matches \"{wanted}\"; available: {}", .available.join(", "))]
    NoDevice {
        /// The name part or index that was asked for.
        wanted: String,
        /// All devices, as `index: name (driver)`.
        available: Vec<String>,
    },
    /// Devices are there, but none can run us.
    #[error("no Vulkan device fits: {}", .devices.join("; "))]
    NoneFits {
        /// Each device with what it lacks.
        devices: Vec<String>,
    },
    /// The chosen or given device lacks something that is required.
    #[error("device \"{device}\" lacks {}", .what.join(", "))]
    Missing {
        /// The device's name.
        device: String,
        /// What is missing, each with the reason why it is needed.
        what: Vec<String>,
    },
    /// A Vulkan call failed.
    #[error("{call} failed for {object}: {result:?}")]
    Call {
        /// The Vulkan entry point.
        call: &'static str,
        /// The name of the object concerned.
        object: String,
        /// What the driver returned.
        result: vk::Result,
    },
    /// Memory for an object could not be had.
    #[error("cannot allocate {bytes} bytes for {object}: {source}")]
    Allocation {
        /// The name of the object.
        object: String,
        /// The size asked for.
        bytes: u64,
        /// The allocator's reason.
        source: gpu_allocator::AllocationError,
    },
    /// The device did not finish in time. The liveness guard is far above any real frame.
    #[error(
        "the device \"{device}\" did not finish within {limit:?}; it hangs, or the work is far too large"
    )]
    Timeout {
        /// The device's name.
        device: String,
        /// The limit that passed.
        limit: Duration,
    },
    /// The device was used after a time-out, while its last work may still be running.
    #[error(
        "the device \"{device}\" still runs work that timed out; destroy it and create another"
    )]
    Busy {
        /// The device's name.
        device: String,
    },
    /// The device was used after it had been lost.
    #[error("the device \"{device}\" was lost; create another")]
    Lost {
        /// The device's name.
        device: String,
    },
    /// Something that needs a device of our own was asked of a host's device.
    #[error("{what} is not possible on a host's device: the host submits and waits")]
    HostOwned {
        /// What was asked for.
        what: &'static str,
    },
    /// A shader and a pipeline description do not go together.
    #[error("pipeline of {shader}: {problem}")]
    Pipeline {
        /// The shader's name, or both.
        shader: String,
        /// What does not fit.
        problem: String,
    },
    /// A descriptor set was written wrongly.
    #[error("descriptors of {shader}: binding {binding} ({name}) {problem}")]
    Descriptor {
        /// The shaders of the set's pipeline.
        shader: String,
        /// The binding's number.
        binding: u32,
        /// The binding's name in the shader, `?` when it has none of that number.
        name: String,
        /// What is wrong with it.
        problem: String,
    },
    /// A descriptor set or pipeline handle that this frame does not know.
    #[error(
        "{what} does not belong to the frame being recorded on this device; allocate it anew each frame"
    )]
    Stale {
        /// Which kind of handle.
        what: &'static str,
    },
    /// An argument that Vulkan forbids.
    #[error("{object}: {problem}")]
    Invalid {
        /// The name of the object concerned.
        object: String,
        /// What is wrong and what is allowed.
        problem: String,
    },
    /// The pipeline cache could not be written.
    #[error("cannot write the pipeline cache {}: {source}", .path.display())]
    CacheFile {
        /// The file.
        path: PathBuf,
        /// The reason.
        source: std::io::Error,
    },
}

/// Turns a bare `vk::Result` into [`GpuError::Call`].
pub(crate) trait CallResult<T> {
    /// Names the call and the object.
    fn call(self, call: &'static str, object: &str) -> Result<T, GpuError>;
}

impl<T> CallResult<T> for Result<T, vk::Result> {
    fn call(self, call: &'static str, object: &str) -> Result<T, GpuError> {
        self.map_err(|result| GpuError::Call {
            call,
            object: object.to_owned(),
            result,
        })
    }
}
