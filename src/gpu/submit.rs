//! Recording, submitting and waiting, on a device of our own.

use std::time::Duration;

use ash::vk;

use super::context::Gpu;
use super::error::{CallResult, GpuError};

/// Far above any frame, so that only a hang meets it, also on a loaded software driver under
/// validation.
const LIMIT: Duration = Duration::from_secs(300);

pub(super) struct Submitter {
    pool: vk::CommandPool,
    cmd: vk::CommandBuffer,
    fence: vk::Fence,
    limit: Duration,
    work: Work,
}

/// What the last submission does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Work {
    /// Nothing any more.
    Done,
    /// It may be running: the wait for it failed.
    Running,
    /// It may be running after the time limit.
    TimedOut,
    /// Nothing, on a device that was lost.
    Lost,
}

impl Gpu {
    pub(super) fn create_submitter(&mut self) -> Result<(), GpuError> {
        let name = "the frame's command buffer";
        let pool_info = vk::CommandPoolCreateInfo::default()
            .queue_family_index(self.queue_family)
            .flags(vk::CommandPoolCreateFlags::TRANSIENT);
        // SAFETY: the family is the one the device was made with.
        let pool = unsafe { self.device.create_command_pool(&pool_info, None) }
            .call("vkCreateCommandPool", name)?;
        let mut submitter = Submitter {
            pool,
            cmd: vk::CommandBuffer::null(),
            fence: vk::Fence::null(),
            limit: LIMIT,
            work: Work::Done,
        };
        let buffer_info = vk::CommandBufferAllocateInfo::default()
            .command_pool(pool)
            .level(vk::CommandBufferLevel::PRIMARY)
            .command_buffer_count(1);
        // SAFETY: the pool is new and ours.
        let buffers = unsafe { self.device.allocate_command_buffers(&buffer_info) };
        let made = buffers
            .call("vkAllocateCommandBuffers", name)
            .and_then(|buffers| {
                // SAFETY: the device is live.
                let fence = unsafe {
                    self.device
                        .create_fence(&vk::FenceCreateInfo::default(), None)
                };
                Ok((buffers, fence.call("vkCreateFence", "the frame's fence")?))
            });
        match made {
            Ok((buffers, fence)) => {
                submitter.cmd = buffers.first().copied().unwrap_or_default();
                submitter.fence = fence;
            }
            Err(error) => {
                // SAFETY: nothing was recorded into the pool's buffers.
                unsafe { self.device.destroy_command_pool(pool, None) };
                return Err(error);
            }
        }
        self.set_name(submitter.pool, "frame command pool");
        self.set_name(submitter.cmd, "frame commands");
        self.set_name(submitter.fence, "frame fence");
        self.submitter = Some(submitter);
        Ok(())
    }

    pub(super) fn destroy_submitter(&mut self) {
        if let Some(submitter) = self.submitter.take() {
            // SAFETY: ours, and the device is idle. Destroying the pool frees its command buffer.
            unsafe {
                self.device.destroy_fence(submitter.fence, None);
                self.device.destroy_command_pool(submitter.pool, None);
            }
        }
    }

    /// Changes how long [`Gpu::run`] and [`Gpu::destroy`] wait before they call the device hung; 5
    /// minutes at first.
    pub fn set_time_limit(&mut self, limit: Duration) {
        if let Some(submitter) = &mut self.submitter {
            submitter.limit = limit;
        }
    }

    /// Begins a frame, lets `record` fill its command buffer, submits it and waits until the device
    /// has finished.
    ///
    /// When `record` fails nothing is submitted. Times are ready for [`Gpu::collect_timings`]
    /// afterwards.
    ///
    /// # Errors
    /// What `record` returns, [`GpuError::HostOwned`] on a host's device, [`GpuError::Timeout`],
    /// [`GpuError::Busy`] or [`GpuError::Lost`] after an earlier error, or a failing call. After a
    /// failing wait the device may still use what was recorded: [`retire`](Gpu::retire) it.
    pub fn run<T, E: From<GpuError>>(
        &mut self,
        record: impl FnOnce(&mut Self, vk::CommandBuffer) -> Result<T, E>,
    ) -> Result<T, E> {
        let cmd = self.begin_commands()?;
        let value = record(self, cmd);
        // The buffer is ended in any case, so that the next frame finds it in a known state.
        // SAFETY: `begin_commands` has begun it.
        let ended = unsafe { self.device.end_command_buffer(cmd) }
            .call("vkEndCommandBuffer", "the frame's commands");
        let value = value?;
        ended?;
        self.submit(cmd)?;
        self.wait()?;
        self.harvest_timestamps()?;
        Ok(value)
    }

    fn own_submitter(&mut self, what: &'static str) -> Result<&mut Submitter, GpuError> {
        (self.submitter.as_mut()).ok_or(GpuError::HostOwned { what })
    }

    fn begin_commands(&mut self) -> Result<vk::CommandBuffer, GpuError> {
        let device = || self.info.name.clone();
        match self.submitter.as_ref().map(|submitter| submitter.work) {
            Some(Work::TimedOut) => return Err(GpuError::Busy { device: device() }),
            Some(Work::Lost) => return Err(GpuError::Lost { device: device() }),
            Some(Work::Running) => self.wait()?,
            Some(Work::Done) | None => {}
        }
        let submitter = self.own_submitter("submitting")?;
        let (pool, cmd) = (submitter.pool, submitter.cmd);
        self.begin_frame()?;
        let info = vk::CommandBufferBeginInfo::default()
            .flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
        // SAFETY: the last submission has finished, so the pool's buffer is not in use.
        unsafe {
            self.device
                .reset_command_pool(pool, vk::CommandPoolResetFlags::empty())
        }
        .call("vkResetCommandPool", "the frame's commands")?;
        // SAFETY: the buffer was just reset.
        unsafe { self.device.begin_command_buffer(cmd, &info) }
            .call("vkBeginCommandBuffer", "the frame's commands")?;
        Ok(cmd)
    }

    fn submit(&mut self, cmd: vk::CommandBuffer) -> Result<(), GpuError> {
        let fence = self.own_submitter("submitting")?.fence;
        // SAFETY: the last submission has finished, so the fence is not in use.
        unsafe { self.device.reset_fences(&[fence]) }.call("vkResetFences", "the frame's fence")?;
        let commands = [vk::CommandBufferSubmitInfo::default().command_buffer(cmd)];
        let submits = [vk::SubmitInfo2::default().command_buffer_infos(&commands)];
        // SAFETY: the buffer is recorded and ended, the fence unsignalled and not in use.
        let submitted = unsafe { self.device.queue_submit2(self.queue, &submits, fence) };
        self.own_submitter("submitting")?.work = match submitted {
            Ok(()) => Work::Running,
            Err(vk::Result::ERROR_DEVICE_LOST) => Work::Lost,
            Err(_) => Work::Done,
        };
        submitted.call("vkQueueSubmit2", "the frame")
    }

    fn wait(&mut self) -> Result<(), GpuError> {
        let submitter = self.own_submitter("waiting")?;
        let (fences, limit) = ([submitter.fence], submitter.limit);
        let nanoseconds = u64::try_from(limit.as_nanos()).unwrap_or(u64::MAX);
        // SAFETY: the fence is ours and was submitted.
        let waited = unsafe { self.device.wait_for_fences(&fences, true, nanoseconds) };
        self.own_submitter("waiting")?.work = match waited {
            Ok(()) => Work::Done,
            Err(vk::Result::TIMEOUT) => Work::TimedOut,
            Err(vk::Result::ERROR_DEVICE_LOST) => Work::Lost,
            Err(_) => Work::Running,
        };
        if waited == Err(vk::Result::TIMEOUT) {
            let device = self.info.name.clone();
            return Err(GpuError::Timeout { device, limit });
        }
        waited.call("vkWaitForFences", "the frame")
    }

    /// Gives a submission that may be running one more time limit to end.
    pub(super) fn wait_until_idle(&mut self) -> Result<(), GpuError> {
        match self.submitter.as_ref().map(|submitter| submitter.work) {
            Some(Work::Running | Work::TimedOut) => match self.wait() {
                // A lost device runs nothing any more, and its objects may be destroyed.
                Err(GpuError::Call {
                    result: vk::Result::ERROR_DEVICE_LOST,
                    ..
                }) => Ok(()),
                other => other,
            },
            Some(Work::Done | Work::Lost) | None => Ok(()),
        }
    }
}
