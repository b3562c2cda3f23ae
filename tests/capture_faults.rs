//! Frames in which something fails: a call of the driver's, an allocation, the device. Each time there is
//! an error that says what failed, nothing is left over, and the renderer goes on as if nothing had been.
#![cfg(feature = "cli")]

mod support;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Mutex, Once, PoisonError};
use std::time::Instant;

use antumbra::capture::{CaptureError, FrameRenderer, FrameRequest};
use antumbra::gpu::{Gpu, GpuError, GpuOptions};
use antumbra::light::LightShape;
use antumbra::scene::Scene;
use antumbra::shadow::Technique;
use support::faults::{self, Fault};
use support::plates::{camera, floor, plate, scene};

const SIDE: u32 = 24;

type Outcome<T> = Result<T, Box<CaptureError>>;

/// Warnings of the library and of its allocator, such as of memory that nobody freed.
static WARNINGS: Mutex<Vec<String>> = Mutex::new(Vec::new());

struct Warnings;

impl log::Log for Warnings {
    fn enabled(&self, metadata: &log::Metadata<'_>) -> bool {
        metadata.level() <= log::Level::Warn
    }

    fn log(&self, record: &log::Record<'_>) {
        if self.enabled(record.metadata()) {
            let mut warnings = WARNINGS.lock().unwrap_or_else(PoisonError::into_inner);
            warnings.push(record.args().to_string());
        }
    }

    fn flush(&self) {}
}

#[track_caller]
fn assert_no_warnings(title: &str) {
    let warnings = std::mem::take(&mut *WARNINGS.lock().unwrap_or_else(PoisonError::into_inner));
    assert!(warnings.is_empty(), "{title}: {warnings:#?}");
}

fn device() -> Result<Gpu, GpuError> {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        log::set_logger(&Warnings).unwrap();
        log::set_max_level(log::LevelFilter::Warn);
    });
    Gpu::create(&GpuOptions {
        intercept: Some(faults::wrap),
        ..support::options()
    })
}

/// What is drawn: two scenes, in which other lights and casters stand.
struct Task {
    technique: Technique,
    scenes: [Scene; 2],
}

impl Task {
    fn new(technique: Technique) -> Self {
        let shape = match technique.name() {
            "oess" => LightShape::Line { length: 2.0 },
            _ => LightShape::Disk { radius: 0.5 },
        };
        let blocker = |x: f32| plate("blocker", [x, x + 2.0], [-2.0, 2.0], 5.0);
        Self {
            technique,
            scenes: [-2.0, -1.0].map(|x| scene(vec![floor(), blocker(x)], shape)),
        }
    }

    fn renderer(&self, gpu: Gpu) -> Outcome<FrameRenderer<'static>> {
        Ok(FrameRenderer::owning(gpu, self.scenes[0].clone())?)
    }

    /// Frames of every kind: what is kept is made, used with another camera, and thrown away for another
    /// scene. Returns pictures and visibilities.
    fn frames(&self, renderer: &mut FrameRenderer<'static>) -> Outcome<Vec<u32>> {
        let mut request = FrameRequest {
            camera: camera(),
            size: [SIDE; 2],
            lights: vec![0],
            technique: self.technique,
        };
        renderer.set_scene(self.scenes[0].clone())?;
        let mut frames = vec![renderer.render_static(&request)?];
        request.camera.position.x += 0.1;
        frames.push(renderer.render_static(&request)?);
        renderer.set_scene(self.scenes[1].clone())?;
        frames.push(renderer.render_counted(&request)?);
        let mut bits = Vec::new();
        for frame in frames {
            bits.extend(frame.color.iter().flatten().map(|v| v.to_bits()));
            bits.extend(frame.lights[0].visibility.iter().map(|v| v.to_bits()));
        }
        Ok(bits)
    }
}

/// Ends a renderer: all memory is back, and the layer has nothing to say.
#[track_caller]
fn end(title: &str, renderer: FrameRenderer<'static>) {
    let mut gpu = renderer.into_gpu();
    if let Err(error) = gpu.begin_frame() {
        panic!("{title}: {error}");
    }
    let memory = gpu.memory_use();
    assert_eq!((memory.device_bytes, memory.host_bytes), (0, 0), "{title}");
    let messages = gpu
        .destroy()
        .unwrap_or_else(|error| panic!("{title}: {error}"));
    let lines: Vec<String> = messages.iter().map(ToString::to_string).collect();
    assert!(lines.is_empty(), "{title}: {lines:#?}");
    assert_no_warnings(title);
}

/// One line that names the call, or says that there is no memory for what.
#[track_caller]
fn assert_names(title: &str, error: &str, call: Option<&str>) {
    let names_call = call.is_some_and(|call| error.contains(call));
    assert!(
        error.lines().count() == 1 && (names_call || error.contains("cannot allocate")),
        "{title}: {error:?}"
    );
}

/// One task with one failure: an error, and then everything as it would have been. `expected` is what the
/// frames look like. Returns whether anything failed.
#[track_caller]
fn try_call(task: &Task, expected: &[u32], call: usize) -> bool {
    faults::arm(Fault::Nth(call));
    let renderer = device().map_err(|error| Box::new(CaptureError::from(error)));
    let renderer = renderer.and_then(|gpu| task.renderer(gpu));
    let mut renderer = match renderer {
        Ok(renderer) => renderer,
        Err(error) => {
            let title = format!("{} call {call} at the start", task.technique.name());
            assert_names(
                &title,
                &error.to_string(),
                faults::calls().get(call).copied(),
            );
            assert_no_warnings(&title);
            return true;
        }
    };
    let first = task.frames(&mut renderer);
    let failed = faults::calls().get(call).copied();
    let title = format!("{} call {call} {failed:?}", task.technique.name());
    match &first {
        Ok(bits) => assert!(failed.is_none() && bits == expected, "{title}: no error"),
        Err(error) => assert_names(&title, &error.to_string(), failed),
    }
    faults::arm(Fault::None);
    if first.is_err() {
        match task.frames(&mut renderer) {
            Ok(bits) => assert!(bits == expected, "{title}: another picture afterwards"),
            Err(error) => panic!("{title}: {error} again"),
        }
    }
    end(&title, renderer);
    first.is_err()
}

/// As [`try_call`], of an allocation.
#[track_caller]
fn try_allocation(task: &Task, expected: &[u32], nth: u64) -> bool {
    faults::arm(Fault::None);
    let mut gpu = device().unwrap();
    gpu.refuse_allocation(Some(nth));
    let mut renderer = match task.renderer(gpu) {
        Ok(renderer) => renderer,
        Err(error) => {
            let title = format!("{} allocation {nth} of the scene", task.technique.name());
            assert_names(&title, &error.to_string(), None);
            assert_no_warnings(&title);
            return true;
        }
    };
    let first = task.frames(&mut renderer);
    let title = format!("{} allocation {nth}", task.technique.name());
    match &first {
        Ok(bits) => assert!(bits == expected, "{title}"),
        Err(error) => {
            assert_names(&title, &error.to_string(), None);
            match task.frames(&mut renderer) {
                Ok(bits) => assert!(bits == expected, "{title}: another picture afterwards"),
                Err(error) => panic!("{title}: {error} again"),
            }
        }
    }
    end(&title, renderer);
    first.is_err()
}

/// The frames of a task without failure, and the calls that they take, from the device on.
fn without_failure(task: &Task) -> (Vec<u32>, Vec<&'static str>) {
    faults::arm(Fault::None);
    let mut renderer = task.renderer(device().unwrap()).unwrap();
    let expected = task.frames(&mut renderer).unwrap();
    let calls = faults::calls();
    end(task.technique.name(), renderer);
    (expected, calls)
}

/// Of each function a call in the middle and the last one, and every ninth allocation.
#[test]
fn a_call_of_each_kind_fails() {
    let _one = support::serial();
    let task = Task::new("ssoc".parse().unwrap());
    let (expected, calls) = without_failure(&task);
    let mut places: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
    for (place, call) in calls.iter().enumerate() {
        places.entry(call).or_default().push(place);
    }
    assert!(places.len() >= 25, "{places:?}");
    for of_one in places.values() {
        let mut chosen = vec![of_one[of_one.len() / 2], of_one[of_one.len() - 1]];
        chosen.dedup();
        for place in chosen {
            assert!(try_call(&task, &expected, place), "call {place}");
        }
    }
    let mut nth = 0;
    while try_allocation(&task, &expected, nth) {
        nth += 9;
    }
    assert!(nth > 18);
}

/// The techniques that `ANTUMBRA_FAULTS` names, separated by commas; all without it.
fn techniques() -> Vec<Technique> {
    match std::env::var("ANTUMBRA_FAULTS") {
        Ok(names) => names.split(',').map(|name| name.parse().unwrap()).collect(),
        Err(_) => Technique::ALL.to_vec(),
    }
}

/// Run by hand, technique by technique: of each place in the code that a call comes from, the first and the last
/// call, and every allocation.
#[test]
#[ignore = "an hour"]
fn each_call_fails() {
    let _one = support::serial();
    // Keeps the layer loaded. Each time it is loaded it takes one of the 1,024 thread-specific keys of a process and
    // does not give it back.
    let layer = support::gpu();
    for technique in techniques() {
        let task = Task::new(technique);
        faults::trace();
        let traced = task.renderer(device().unwrap());
        let mut renderer = traced.unwrap();
        task.frames(&mut renderer).unwrap();
        let sites = faults::sites();
        end(technique.name(), renderer);
        let (expected, calls) = without_failure(&task);
        assert_eq!(sites.len(), calls.len());
        let mut of_site: BTreeMap<u64, [usize; 2]> = BTreeMap::new();
        for (call, site) in sites.into_iter().enumerate() {
            of_site.entry(site).or_insert([call; 2])[1] = call;
        }
        let chosen: BTreeSet<usize> = of_site.values().flatten().copied().collect();
        let begin = Instant::now();
        for call in &chosen {
            assert!(try_call(&task, &expected, *call), "call {call}");
        }
        assert!(!try_call(&task, &expected, calls.len()));
        let mut allocations = 0;
        while try_allocation(&task, &expected, allocations) {
            allocations += 1;
        }
        println!(
            "{}: {} of {} calls from {} places, {allocations} allocations, {:.0?}",
            technique.name(),
            chosen.len(),
            calls.len(),
            of_site.len(),
            begin.elapsed()
        );
    }
    support::destroy_clean(layer);
}

#[test]
fn a_lost_device_stays_lost() {
    let _one = support::serial();
    let task = Task::new("ssoc".parse().unwrap());
    let (_, calls) = without_failure(&task);
    let of = |name| {
        calls
            .iter()
            .enumerate()
            .filter(move |(_, call)| **call == name)
    };
    // At the upload, and in a frame that follows others.
    let waits: Vec<usize> = of("vkWaitForFences").map(|(place, _)| place).collect();
    let submits: Vec<usize> = of("vkQueueSubmit2").map(|(place, _)| place).collect();
    assert!(waits.len() >= 5 && submits.len() == waits.len());
    for first in [waits[0], waits[3], submits[0], submits[3]] {
        let title = format!("lost from call {first}");
        faults::arm(Fault::LostFrom(first));
        let renderer = task.renderer(device().unwrap());
        let mut renderer = match renderer {
            Ok(renderer) => renderer,
            Err(error) => {
                assert_names(&title, &error.to_string(), Some("ERROR_DEVICE_LOST"));
                assert_no_warnings(&title);
                continue;
            }
        };
        let error = task.frames(&mut renderer).unwrap_err().to_string();
        assert_names(&title, &error, Some("ERROR_DEVICE_LOST"));
        let again = task.frames(&mut renderer).unwrap_err();
        assert_names(&title, &again.to_string(), Some("was lost; create another"));
        // Whose memory is freed as that of any other.
        faults::arm(Fault::None);
        end(&title, renderer);
    }
}
