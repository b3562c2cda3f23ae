//! One contender on one scene and light, ready to be measured again and again.

use std::any::Any;
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::rc::Rc;
use std::time::Instant;

use super::contender::Rays;
use super::results::{Failure, FailureKind, Pass, Peak, Setup, Spread, rounded};
use super::rival::{Rival, View};
use crate::capture::{CapturedFrame, FrameRenderer, FrameRequest};
use crate::gpu::{DeviceInfo, Gpu, GpuOptions};
use crate::light::AreaLight;
use crate::message::{line, one_line};
use crate::scene::{Scene, SceneCamera};

/// Frames at the very beginning, of which the first makes what is made once.
const WARM_UP_FRAMES: usize = 2;

/// What one round has to say.
#[derive(Clone, Debug, Default)]
pub(super) struct Round {
    pub(super) visibility: Vec<f32>,
    pub(super) visibility_ms: Option<f64>,
    pub(super) frame_ms: Option<f64>,
    pub(super) passes: Vec<Pass>,
    pub(super) counters: BTreeMap<String, u64>,
    pub(super) chosen: Option<String>,
}

/// Something that can be measured.
pub(super) trait Runner {
    /// Everything before the measured rounds, warm-up included.
    fn prepare(&mut self) -> Result<Setup, String>;
    /// What goes before each round and does not count: others have had the machine, and memory that was given
    /// back in between is new to the caches and to the page tables.
    fn warm_up(&mut self) -> Result<(), String>;
    /// One measured round.
    fn round(&mut self) -> Result<Round, String>;
    fn driver(&self) -> Option<String> {
        None
    }
    fn peak(&self) -> Option<Peak> {
        None
    }
    /// Gives everything back; never after a panic.
    fn end(&mut self) {}
}

/// A cell and what was measured of it.
pub(super) struct Cell<'s> {
    pub(super) label: String,
    pub(super) failure: Option<Failure>,
    pub(super) setup: Option<Setup>,
    /// Of the first round.
    pub(super) visibility: Vec<f32>,
    pub(super) identical: bool,
    rounds: Vec<Round>,
    /// All rounds together, seconds.
    spent: f64,
    runner: Option<Box<dyn Runner + 's>>,
}

impl<'s> Cell<'s> {
    pub(super) fn new(label: &str, runner: Result<Box<dyn Runner + 's>, Failure>) -> Self {
        let (runner, failure) = match runner {
            Ok(runner) => (Some(runner), None),
            Err(failure) => (None, Some(failure)),
        };
        Self {
            label: label.into(),
            failure,
            setup: None,
            visibility: Vec::new(),
            identical: true,
            rounds: Vec::new(),
            spent: 0.0,
            runner,
        }
    }

    /// False once it has failed, or has taken its time.
    fn goes_on(&self, seconds: f64) -> bool {
        self.runner.is_some() && (self.rounds.is_empty() || self.spent < seconds)
    }

    fn prepare(&mut self) {
        self.setup = self.guarded(|runner| runner.prepare());
    }

    fn measure(&mut self) {
        let start = Instant::now();
        let round = self.guarded(|runner| runner.warm_up().and_then(|()| runner.round()));
        let Some(mut round) = round else {
            return;
        };
        self.spent += start.elapsed().as_secs_f64();
        let visibility = std::mem::take(&mut round.visibility);
        if self.rounds.is_empty() {
            self.visibility = visibility;
        } else {
            let bits = |values: &[f32]| values.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
            self.identical &= bits(&visibility) == bits(&self.visibility);
        }
        self.rounds.push(round);
    }

    /// Runs something that may fail or panic; then the cell is over.
    fn guarded<T>(&mut self, f: impl FnOnce(&mut dyn Runner) -> Result<T, String>) -> Option<T> {
        let runner = self.runner.as_deref_mut()?;
        let reason = match catch_unwind(AssertUnwindSafe(|| f(runner))) {
            Ok(Ok(value)) => return Some(value),
            Ok(Err(reason)) => {
                self.end();
                reason
            }
            Err(payload) => {
                // In which state it is nobody knows: it is neither used nor dropped.
                std::mem::forget(self.runner.take());
                format!("panicked: {}", panic_text(&*payload))
            }
        };
        self.failure = Some(Failure {
            kind: FailureKind::Failed,
            reason: one_line(&reason),
        });
        None
    }

    fn end(&mut self) {
        if let Some(mut runner) = self.runner.take()
            && catch_unwind(AssertUnwindSafe(|| runner.end())).is_err()
        {
            std::mem::forget(runner);
        }
    }

    pub(super) fn driver(&self) -> Option<String> {
        self.runner.as_ref()?.driver()
    }

    pub(super) fn peak(&self) -> Option<Peak> {
        self.runner.as_ref()?.peak()
    }

    pub(super) fn repeats(&self) -> u32 {
        self.rounds.len() as u32
    }

    pub(super) fn visibility_ms(&self) -> Option<Spread> {
        Spread::of(self.rounds.iter().filter_map(|round| round.visibility_ms))
    }

    pub(super) fn frame_ms(&self) -> Option<Spread> {
        Spread::of(self.rounds.iter().filter_map(|round| round.frame_ms))
    }

    pub(super) fn counters(&self) -> BTreeMap<String, u64> {
        let last = self.rounds.last();
        last.map(|round| round.counters.clone()).unwrap_or_default()
    }

    pub(super) fn chosen(&self) -> Option<String> {
        self.rounds.last()?.chosen.clone()
    }

    /// The passes of the last round with their median times. Every round has the same.
    pub(super) fn passes(&self) -> Vec<Pass> {
        let mut passes = self
            .rounds
            .last()
            .map(|r| r.passes.clone())
            .unwrap_or_default();
        for (at, pass) in passes.iter_mut().enumerate() {
            let times = self
                .rounds
                .iter()
                .filter_map(|round| round.passes.get(at)?.gpu_ms);
            pass.gpu_ms = Spread::of(times).map(|spread| spread.median);
        }
        passes
    }
}

impl Drop for Cell<'_> {
    fn drop(&mut self) {
        self.end();
    }
}

/// Measures all cells in turn, so that a slow spell of the machine hits all alike. Each is told
/// to `on_step` before its turn.
pub(super) fn measure_in_turn(
    cells: &mut [Cell<'_>],
    repeat: u32,
    cell_seconds: f64,
    on_step: &dyn Fn(&str),
) {
    for cell in cells.iter_mut().filter(|cell| cell.runner.is_some()) {
        on_step(&cell.label);
        cell.prepare();
    }
    let count = cells.len();
    for round in 0..repeat as usize {
        for turn in 0..count {
            // Nobody always comes after the same one.
            let cell = &mut cells[(turn + round) % count];
            if cell.goes_on(cell_seconds) {
                on_step(&cell.label);
                cell.measure();
            }
        }
    }
}

fn panic_text(payload: &(dyn Any + Send)) -> &str {
    let text = payload.downcast_ref::<String>().map(String::as_str);
    let text = text.or_else(|| payload.downcast_ref::<&str>().copied());
    text.unwrap_or("without a message")
}

fn milliseconds(since: Instant) -> f64 {
    rounded(since.elapsed().as_secs_f64() * 1e3)
}

/// A technique on a device of its own, so that memory is its own and a lost device is lost to it
/// alone.
pub(super) struct GpuRunner<'s> {
    pub(super) scene: &'s Scene,
    pub(super) request: FrameRequest,
    pub(super) device: Option<String>,
    /// Called with the new device.
    pub(super) on_device: &'s dyn Fn(&mut Gpu),
    pub(super) renderer: Option<FrameRenderer<'s>>,
}

impl GpuRunner<'_> {
    fn render(&mut self) -> Result<CapturedFrame, String> {
        let Some(renderer) = &mut self.renderer else {
            return Err("there is no device".into());
        };
        let frame = renderer.render(&self.request);
        frame.map_err(|error| line(&error))
    }
}

impl Runner for GpuRunner<'_> {
    fn prepare(&mut self) -> Result<Setup, String> {
        let mut gpu = Gpu::create(&GpuOptions {
            device: self.device.clone(),
            application_name: "antumbra".into(),
            ..Default::default()
        })
        .map_err(|error| line(&error))?;
        (self.on_device)(&mut gpu);
        let start = Instant::now();
        let renderer = FrameRenderer::new(gpu, self.scene);
        self.renderer = Some(renderer.map_err(|error| line(&error))?);
        let load = milliseconds(start);
        let first_frame = self.render()?.frame_ms;
        for _ in 1..WARM_UP_FRAMES {
            self.render()?;
        }
        Ok(Setup {
            load,
            pipelines: None,
            first_frame: Some(rounded(first_frame)),
        })
    }

    fn warm_up(&mut self) -> Result<(), String> {
        self.render().map(|_| ())
    }

    fn round(&mut self) -> Result<Round, String> {
        let frame = self.render()?;
        let Some(light) = frame.lights.into_iter().next() else {
            return Err("the frame has no visibility".into());
        };
        let is_own = |name: &String| light.passes.contains(name);
        let times: Vec<f64> = (frame.passes.iter())
            .filter(|(name, _)| is_own(name))
            .map(|(_, ms)| *ms)
            .collect();
        let pass = |name: &String, gpu_ms, skipped| Pass {
            name: name.clone(),
            gpu_ms,
            skipped,
            visibility: is_own(name),
        };
        let mut passes: Vec<Pass> = if frame.passes.is_empty() {
            let recorded = frame.report.passes.iter();
            recorded
                .map(|name| pass(&name.to_string(), None, None))
                .collect()
        } else {
            let timed = frame.passes.iter();
            timed
                .map(|(name, ms)| pass(name, Some(*ms), None))
                .collect()
        };
        passes.extend(frame.plan.culled.iter().map(|culled| {
            let reason = Some(culled.reason.clone());
            pass(&culled.name.to_string(), Some(0.0), reason)
        }));
        Ok(Round {
            visibility: light.visibility,
            visibility_ms: (!times.is_empty()).then(|| times.iter().sum()),
            frame_ms: Some(frame.frame_ms),
            passes,
            counters: frame.counters,
            chosen: (light.choice.technique != self.request.technique).then(|| light.choice.spec()),
        })
    }

    fn driver(&self) -> Option<String> {
        Some(driver_text(self.renderer.as_ref()?.gpu().info()))
    }

    fn peak(&self) -> Option<Peak> {
        let memory = self.renderer.as_ref()?.gpu().memory_use();
        Some(Peak {
            device: memory.peak_device_bytes,
            host: memory.peak_host_bytes,
        })
    }

    fn end(&mut self) {
        if let Some(renderer) = self.renderer.take()
            && let Err(error) = renderer.destroy()
        {
            log::warn!("{error}");
        }
    }
}

fn driver_text(info: &DeviceInfo) -> String {
    let parts = [&info.name, &info.driver_name, &info.driver_info];
    let parts: Vec<&str> = (parts.into_iter().map(String::as_str))
        .filter(|part| !part.is_empty())
        .collect();
    parts.join(", ")
}

/// A rival; those of one engine share the hierarchy.
pub(super) struct RivalRunner<'s> {
    pub(super) rival: Rc<RefCell<Box<dyn Rival + 's>>>,
    /// Building the hierarchy, milliseconds.
    pub(super) build_ms: f64,
    pub(super) camera: SceneCamera,
    pub(super) light: AreaLight,
    pub(super) size: [u32; 2],
    pub(super) rays: Rays,
}

impl RivalRunner<'_> {
    fn cast(&self, size: [u32; 2]) -> Result<Round, String> {
        let view = View {
            camera: &self.camera,
            size,
            light: &self.light,
            rays: self.rays,
        };
        let start = Instant::now();
        let cast = self.rival.borrow_mut().cast(&view);
        let ms = start.elapsed().as_secs_f64() * 1e3;
        let cast = cast.map_err(|error| line(&*error))?;
        Ok(Round {
            visibility: cast.visibility,
            visibility_ms: Some(cast.ms.unwrap_or(ms)),
            counters: [("rays".to_string(), cast.rays)].into(),
            ..Default::default()
        })
    }
}

impl Runner for RivalRunner<'_> {
    fn prepare(&mut self) -> Result<Setup, String> {
        self.warm_up()?;
        Ok(Setup {
            load: rounded(self.build_ms),
            pipelines: None,
            first_frame: None,
        })
    }

    /// A small picture: a cast has no set-up of its own, and a large one is long.
    fn warm_up(&mut self) -> Result<(), String> {
        let small = self.size.map(|side| side.div_ceil(4));
        self.cast(small).map(|_| ())
    }

    fn round(&mut self) -> Result<Round, String> {
        self.cast(self.size)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Fails at a call, or panics at one.
    struct Fake {
        calls: u32,
        warm_ups: u32,
        fails_at: u32,
        panics_at: u32,
    }

    impl Fake {
        fn call(&mut self) -> Result<(), String> {
            self.calls += 1;
            assert!(self.calls != self.panics_at, "no more\nof this");
            (self.calls != self.fails_at)
                .then_some(())
                .ok_or_else(|| "device lost".into())
        }
    }

    impl Runner for Fake {
        fn prepare(&mut self) -> Result<Setup, String> {
            self.call().map(|()| Setup {
                load: 0.0,
                pipelines: None,
                first_frame: None,
            })
        }

        fn warm_up(&mut self) -> Result<(), String> {
            self.warm_ups += 1;
            Ok(())
        }

        fn round(&mut self) -> Result<Round, String> {
            assert_eq!(self.warm_ups, self.calls, "one before each round");
            self.call().map(|()| Round {
                visibility: vec![self.calls.min(3) as f32],
                visibility_ms: Some(f64::from(self.calls)),
                ..Default::default()
            })
        }
    }

    fn cell(label: &str, fails_at: u32, panics_at: u32) -> Cell<'static> {
        let fake = Fake {
            calls: 0,
            warm_ups: 0,
            fails_at,
            panics_at,
        };
        Cell::new(label, Ok(Box::new(fake)))
    }

    #[test]
    fn a_failing_cell_is_recorded_and_the_rest_goes_on() {
        let refused = Failure {
            kind: FailureKind::Unsupported,
            reason: "no".into(),
        };
        let mut cells = [
            cell("good", 0, 0),
            cell("at once", 1, 0),
            cell("later", 3, 0),
            cell("panics", 0, 2),
            Cell::new("refused", Err(refused.clone())),
        ];
        let steps = RefCell::new(Vec::new());
        let on_step = |label: &str| steps.borrow_mut().push(label.to_string());
        measure_in_turn(&mut cells, 3, 1e9, &on_step);
        let [good, at_once, later, panics, refusing] = &cells;
        assert_eq!((good.repeats(), &good.failure), (3, &None));
        assert_eq!(good.visibility_ms().map(|s| s.median), Some(3.0));
        assert!(!good.identical);
        let reason = |cell: &Cell| cell.failure.as_ref().map(|f| (f.kind, f.reason.clone()));
        let failed = |text: &str| Some((FailureKind::Failed, text.to_string()));
        assert_eq!(reason(at_once), failed("device lost"));
        assert_eq!(reason(later), failed("device lost"));
        assert_eq!(later.repeats(), 1);
        assert_eq!(reason(panics), failed("panicked: no more of this"));
        assert_eq!(refusing.failure, Some(refused));
        // Set-up apart, then in turn; whoever has failed has no turn.
        let wanted = [
            "good", "at once", "later", "panics", // set-up
            "good", "later", "panics", "later", "good", "good",
        ];
        assert_eq!(*steps.borrow(), wanted);
    }

    #[test]
    fn slow_cells_are_measured_fewer_times_but_once_at_least() {
        let mut cells = [cell("slow", 0, 0)];
        measure_in_turn(&mut cells, 5, 0.0, &|_| {});
        assert_eq!(cells[0].repeats(), 1);
    }
}
