//! How long passes take on the device.

use ash::vk;

use super::context::Gpu;
use super::error::{CallResult, GpuError};

/// Scopes per query pool; a slot gets another pool when they are used up.
const SCOPES: u32 = 128;

/// A timing scope that is open.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[must_use = "a scope that is never ended has no time"]
pub struct TimingId(Option<usize>);

#[derive(Default)]
struct Slot {
    pools: Vec<vk::QueryPool>,
    /// Scope `i` owns queries `2 i` and `2 i + 1`, counted through the pools.
    names: Vec<String>,
}

pub(super) struct Timestamps {
    slots: Vec<Slot>,
    valid_bits: u32,
    /// Nanoseconds a tick.
    period: f32,
    ready: Vec<(String, f64)>,
}

impl Timestamps {
    pub(super) fn new(slots: usize, valid_bits: u32, period: f32) -> Self {
        Self {
            slots: (0..slots).map(|_| Slot::default()).collect(),
            valid_bits,
            period,
            ready: Vec::new(),
        }
    }
}

/// Milliseconds from one tick to another on a counter of `valid_bits` that may have wrapped once in
/// between.
fn elapsed_ms(begin: u64, end: u64, valid_bits: u32, period_ns: f32) -> f64 {
    let mask = if valid_bits >= 64 {
        u64::MAX
    } else {
        (1 << valid_bits) - 1
    };
    let ticks = (end & mask).wrapping_sub(begin & mask) & mask;
    #[allow(clippy::cast_precision_loss, reason = "2^53 ns are 104 days")]
    let ticks = ticks as f64;
    ticks * f64::from(period_ns) * 1e-6
}

/// Pool and query of a scope's beginning.
fn place(scope: usize) -> (usize, u32) {
    let per_pool = SCOPES as usize;
    #[allow(clippy::cast_possible_truncation, reason = "below SCOPES")]
    let within = (scope % per_pool) as u32;
    (scope / per_pool, 2 * within)
}

impl Gpu {
    /// Starts timing what is recorded from here on, under a name. Does nothing on a queue without
    /// timestamps.
    ///
    /// # Errors
    /// A failing call.
    pub fn begin_timing(
        &mut self,
        cmd: vk::CommandBuffer,
        name: &str,
    ) -> Result<TimingId, GpuError> {
        if self.timestamps.valid_bits == 0 {
            return Ok(TimingId(None));
        }
        let scope = self.timestamps.slots[self.slot].names.len();
        let (pool, query) = place(scope);
        if pool == self.timestamps.slots[self.slot].pools.len() {
            let info = vk::QueryPoolCreateInfo::default()
                .query_type(vk::QueryType::TIMESTAMP)
                .query_count(2 * SCOPES);
            // SAFETY: the description is complete.
            let raw = unsafe { self.device.create_query_pool(&info, None) }
                .call("vkCreateQueryPool", "the timestamps")?;
            self.set_name(raw, &format!("timestamps {}.{pool}", self.slot));
            // SAFETY: hostQueryReset is enabled, and the pool is new.
            unsafe { self.device.reset_query_pool(raw, 0, 2 * SCOPES) };
            self.timestamps.slots[self.slot].pools.push(raw);
        }
        let slot = &mut self.timestamps.slots[self.slot];
        slot.names.push(name.to_owned());
        // SAFETY: the query was reset when the frame began, and the command buffer is being
        // recorded.
        unsafe {
            self.device.cmd_write_timestamp2(
                cmd,
                vk::PipelineStageFlags2::ALL_COMMANDS,
                slot.pools[pool],
                query,
            );
            // Waits for nothing and orders nothing. Mesa's software driver keeps a timestamp back until
            // its next flush, and a dispatch is none: the scope would begin after its own work.
            (self.device).cmd_pipeline_barrier2(cmd, &vk::DependencyInfo::default());
        }
        Ok(TimingId(Some(scope)))
    }

    /// Stops timing a scope of the frame being recorded.
    pub fn end_timing(&mut self, cmd: vk::CommandBuffer, id: TimingId) {
        let Some(scope) = id.0 else { return };
        let slot = &self.timestamps.slots[self.slot];
        assert!(
            scope < slot.names.len(),
            "a timing scope of another frame was ended"
        );
        let (pool, query) = place(scope);
        // SAFETY: as in `begin_timing`; the second query of the scope is written here only.
        unsafe {
            self.device.cmd_write_timestamp2(
                cmd,
                vk::PipelineStageFlags2::ALL_COMMANDS,
                slot.pools[pool],
                query + 1,
            );
        }
    }

    /// Writes the device's clock into a buffer, 64 bits in ticks of [`Gpu::tick_ms`], once all that
    /// was recorded before is done. Writes nothing on a queue without timestamps.
    ///
    /// # Errors
    /// A failing call.
    pub(crate) fn write_clock(
        &mut self,
        cmd: vk::CommandBuffer,
        buffer: vk::Buffer,
        offset: u64,
    ) -> Result<(), GpuError> {
        let Some(scope) = self.begin_timing(cmd, "clock")?.0 else {
            return Ok(());
        };
        let (pool, query) = place(scope);
        let pool = self.timestamps.slots[self.slot].pools[pool];
        let flags = vk::QueryResultFlags::TYPE_64 | vk::QueryResultFlags::WAIT;
        // SAFETY: the query was just written; the buffer was declared for a copy and has the room.
        unsafe {
            self.device
                .cmd_copy_query_pool_results(cmd, pool, query, 1, buffer, offset, 8, flags);
        }
        Ok(())
    }

    /// Milliseconds of a tick of the device's clock.
    pub(crate) fn tick_ms(&self) -> f32 {
        self.timestamps.period * 1.0e-6
    }

    /// The times of the last finished frame in milliseconds, in the order in which the scopes were
    /// begun, once. Empty on a queue without timestamps. On our own device that is the last
    /// [`Gpu::run`]; on a host's, the frame whose slot [`Gpu::begin_frame`] took over.
    pub fn collect_timings(&mut self) -> Vec<(String, f64)> {
        std::mem::take(&mut self.timestamps.ready)
    }

    /// Reads what the slot's last frame wrote and makes its queries new.
    pub(super) fn begin_timestamps(&mut self) -> Result<(), GpuError> {
        self.harvest_timestamps()
    }

    /// Reads the current slot's times. Scopes that never ran are left out.
    pub(super) fn harvest_timestamps(&mut self) -> Result<(), GpuError> {
        let slot = &mut self.timestamps.slots[self.slot];
        if slot.names.is_empty() {
            return Ok(());
        }
        let names = std::mem::take(&mut slot.names);
        let mut ready = Vec::with_capacity(names.len());
        let mut read = Ok(());
        for (chunk, &pool) in names.chunks(SCOPES as usize).zip(&slot.pools) {
            // Value and availability of each query.
            let mut results = vec![[0_u64; 2]; 2 * chunk.len()];
            let flags = vk::QueryResultFlags::TYPE_64 | vk::QueryResultFlags::WITH_AVAILABILITY;
            // SAFETY: the pool has that many queries and the frame that wrote them has finished.
            match unsafe {
                self.device
                    .get_query_pool_results(pool, 0, &mut results, flags)
            } {
                Ok(()) | Err(vk::Result::NOT_READY) => {}
                // Then none is there. The queries have to be made new all the same.
                Err(result) => read = Err(result),
            }
            for (name, pair) in chunk.iter().zip(results.chunks_exact(2)) {
                if let &[[begin, begin_there], [end, end_there]] = pair
                    && begin_there != 0
                    && end_there != 0
                {
                    let ms = elapsed_ms(
                        begin,
                        end,
                        self.timestamps.valid_bits,
                        self.timestamps.period,
                    );
                    ready.push((name.clone(), ms));
                }
            }
            // SAFETY: hostQueryReset is enabled, and no frame in flight uses this slot's pools.
            unsafe { self.device.reset_query_pool(pool, 0, 2 * SCOPES) };
        }
        self.timestamps.ready = ready;
        read.call("vkGetQueryPoolResults", "the timestamps")
    }

    pub(super) fn destroy_timestamps(&mut self) {
        for pool in self
            .timestamps
            .slots
            .iter_mut()
            .flat_map(|slot| slot.pools.drain(..))
        {
            // SAFETY: ours, and the device is idle.
            unsafe { self.device.destroy_query_pool(pool, None) };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wrapped_counter_still_gives_the_difference() {
        assert!((elapsed_ms(1_000_000, 3_000_000, 64, 1.0) - 2.0).abs() < 1e-12);
        let top = (1_u64 << 36) - 1;
        assert!((elapsed_ms(top - 499_999, 500_000, 36, 2.0) - 2.0).abs() < 1e-12);
        assert!((elapsed_ms(u64::MAX - 499_999, 500_000, 64, 2.0) - 2.0).abs() < 1e-12);
        // Bits above the valid ones are undefined and must not matter.
        assert!((elapsed_ms(0xff << 40 | 10, 0x0f << 40 | 1_000_010, 36, 1.0) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn scopes_fill_one_pool_after_the_other() {
        assert_eq!(place(0), (0, 0));
        assert_eq!(place(127), (0, 254));
        assert_eq!(place(128), (1, 0));
    }
}
