//! Thousands of frames in one process: lights move, pictures change their size, techniques and scenes take
//! turns. Memory stays as it is, the validation layer stays silent, and the last frame is that of a process
//! that has drawn nothing before.
#![cfg(feature = "cli")]

mod support;

use std::process::Command;
use std::time::Instant;

use antumbra::capture::{CapturedFrame, FrameRenderer, FrameRequest};
use antumbra::gpu::GpuOptions;
use antumbra::light::{AreaLight, ShapeKind};
use antumbra::scene::Scene;
use antumbra::shadow::Technique;
use antumbra::stress::{Case, cases};

/// Frames of a scene before the next one is loaded.
const FRAMES_OF_A_SCENE: usize = 10;
const SIZES: [[u32; 2]; 5] = [[48, 48], [64, 40], [17, 64], [96, 96], [8, 8]];
/// Name of the variable that tells a fresh process which frame to draw: its number and the number of scenes.
const FRESH: &str = "ANTUMBRA_SOAK_FRESH";

/// What happens in each frame; after all scenes it begins anew.
struct Course {
    scenes: Vec<Case>,
}

impl Course {
    /// Of at most that many stress scenes, so that each shape of light has its share.
    fn new(count: usize) -> Self {
        let of_kind = |kind: ShapeKind| {
            let all = cases().into_iter();
            let mut found = all.filter(move |case| case.area_light().shape.kind() == kind);
            std::iter::from_fn(move || found.next())
        };
        let mut kinds: Vec<_> = ShapeKind::ALL.into_iter().map(of_kind).collect();
        let mut scenes = Vec::new();
        loop {
            let next: Vec<Case> = kinds.iter_mut().filter_map(Iterator::next).collect();
            if next.is_empty() || scenes.len() >= count {
                scenes.truncate(count);
                return Self { scenes };
            }
            scenes.extend(next);
        }
    }

    fn period(&self) -> usize {
        self.scenes.len() * FRAMES_OF_A_SCENE
    }

    /// A renderer for the first scene of several.
    fn renderer(scene: Scene) -> FrameRenderer<'static> {
        // Without the layer, as the first run of `make soak`: for telling its memory from ours.
        let plain = std::env::var_os("ANTUMBRA_SOAK_PLAIN").is_some();
        let gpu = support::create(&GpuOptions {
            validation: !plain,
            ..support::options()
        });
        FrameRenderer::owning(gpu, scene).unwrap()
    }

    fn draw(&self, number: usize, renderer: &mut Option<FrameRenderer<'static>>) -> CapturedFrame {
        let at = number % self.period();
        let case = &self.scenes[at / FRAMES_OF_A_SCENE];
        let mut scene = case.scene.clone();
        let light = &mut scene.lights[case.light].light;
        // A hundredth of its distance from the camera to and fro.
        let step = (at % 4) as f32 * 0.01;
        light.center += (case.camera.position - light.center) * step;
        let light = *light;
        // Of those that can draw such a light; every scene begins with another one.
        let able = able(&light);
        let request = FrameRequest {
            camera: case.camera.clone(),
            size: SIZES[at / 3 % SIZES.len()],
            lights: vec![case.light],
            technique: able[(at / 2 + at / FRAMES_OF_A_SCENE) % able.len()],
        };
        let renderer = match renderer {
            Some(renderer) => {
                renderer.set_scene(scene).unwrap();
                renderer
            }
            None => renderer.insert(Self::renderer(scene)),
        };
        let frame = match at % 3 {
            0 => renderer.render(&request),
            1 => renderer.render_static(&request),
            _ => renderer.render_counted(&request),
        };
        frame.unwrap_or_else(|error| panic!("frame {number}, {}: {error}", case.name))
    }
}

fn able(light: &AreaLight) -> Vec<Technique> {
    let all = Technique::ALL.iter().copied();
    all.filter(|t| t.check(light).is_ok()).collect()
}

/// All bits of a frame in 64.
fn digest(frame: &CapturedFrame) -> u64 {
    let color = frame.color.iter().flatten();
    let values = color.chain(&frame.lights[0].visibility);
    // Fowler, Noll, Vo.
    values.fold(0xcbf2_9ce4_8422_2325, |hash, value| {
        (hash ^ u64::from(value.to_bits())).wrapping_mul(0x0100_0000_01b3)
    })
}

/// Memory of the process in bytes.
fn resident_bytes() -> u64 {
    let text = std::fs::read_to_string("/proc/self/statm").unwrap_or_default();
    let pages = text
        .split(' ')
        .nth(1)
        .and_then(|pages| pages.parse::<u64>().ok());
    pages.unwrap_or(0) * 4096
}

/// Bytes that `malloc` has given out and not got back, to us, the driver and the layer, and those that it holds free
/// between them.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
fn malloc_bytes() -> [u64; 2] {
    /// `struct mallinfo2` of glibc's `malloc.h`.
    #[repr(C)]
    struct Mallinfo([usize; 10]);
    // SAFETY: it takes nothing, locks what it reads, and gives back ten numbers.
    unsafe extern "C" {
        safe fn mallinfo2() -> Mallinfo;
    }
    let Mallinfo([_, _, _, _, mapped, _, _, in_use, free, _]) = mallinfo2();
    // What was mapped by itself for large requests is not among the arenas' bytes.
    [in_use + mapped, free].map(|bytes| bytes as u64)
}

/// Not known here.
#[cfg(not(all(target_os = "linux", target_env = "gnu")))]
fn malloc_bytes() -> [u64; 2] {
    [0; 2]
}

/// What must not grow from one round through all scenes to the next.
#[derive(Debug, PartialEq, Eq)]
struct Held {
    device_bytes: u64,
    host_bytes: u64,
    pipelines: usize,
}

impl Held {
    fn of(renderer: &FrameRenderer<'_>) -> Self {
        let gpu = renderer.gpu();
        let memory = gpu.memory_use();
        Self {
            device_bytes: memory.device_bytes,
            host_bytes: memory.host_bytes,
            pipelines: gpu.pipelines_created(),
        }
    }
}

/// Bytes of memory blocks that the allocator has taken from the device. How well they are filled changes with
/// what came before.
fn reserved_bytes(renderer: &FrameRenderer<'_>) -> u64 {
    let report = renderer.gpu().allocator().generate_report();
    report.total_capacity_bytes
}

/// Draws at least that many frames, in rounds through `scenes` scenes. In the second half of them the allocator's
/// blocks, the process and what `malloc` has in use may take `growth` bytes more than in the first: a driver's caches
/// fill, free memory between what is used becomes more, and the layer keeps the names of objects that are gone (3.6 kB
/// a frame). What `malloc` has in use tells what somebody keeps from free memory between.
fn soak(scenes: usize, frames: usize, growth: u64) {
    let _one = support::serial();
    let course = Course::new(scenes);
    let rounds = frames.div_ceil(course.period());
    let mut renderer = None;
    let (mut held, mut grown) = (None, [0; 3]);
    let begin = Instant::now();
    let mut last = 0;
    for round in 0..rounds {
        for at in 0..course.period() {
            last = digest(&course.draw(round * course.period() + at, &mut renderer));
        }
        let renderer = renderer.as_ref().unwrap();
        support::assert_no_messages(&renderer.gpu().messages());
        let now = Held::of(renderer);
        let (reserved, resident) = (reserved_bytes(renderer), resident_bytes());
        let [in_use, free] = malloc_bytes();
        let [blocks, malloc, between, process] =
            [reserved, in_use, free, resident].map(|bytes| bytes as f64 * 1.0e-6);
        println!(
            "{:6} frames, {:.0?}: {now:?}, blocks {blocks:.1} MB, malloc {malloc:.1} MB in use and {between:.1} MB \
             free, process {process:.1} MB",
            (round + 1) * course.period(),
            begin.elapsed(),
        );
        let bytes = [reserved, resident, in_use];
        // The first round makes what is kept, and drivers fill caches of their own.
        match round {
            0 => held = Some(now),
            _ => assert_eq!(held.as_ref(), Some(&now)),
        }
        if 2 * round < rounds {
            grown = [0, 1, 2].map(|at| bytes[at].max(grown[at]));
        }
        let flat = bytes
            .iter()
            .zip(grown)
            .all(|(now, then)| *now <= then + growth);
        assert!(
            flat || rounds < 8,
            "bytes of blocks, process and malloc: {bytes:?} after {grown:?}"
        );
    }
    let messages = renderer.unwrap().destroy().unwrap();
    support::assert_no_messages(&messages);
    let frame = format!("{} {scenes}", rounds * course.period() - 1);
    let fresh = Command::new(std::env::current_exe().unwrap())
        .args(["--exact", "a_fresh_process", "--ignored", "--nocapture"])
        .env(FRESH, frame)
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&fresh.stdout);
    assert!(
        fresh.status.success() && text.contains(&format!("digest {last:016x}")),
        "{last:016x} is not that of a fresh process: {text}"
    );
}

#[test]
fn a_hundred_and_twenty_frames() {
    soak(6, 120, 0);
}

/// The same frame over and over takes nothing that stays: what a driver keeps for each frame shows within a few of
/// them here. Mesa 22.3's lavapipe kept 0.4 MB for each dispatch of `hard`, see `glsl/hard/visibility.comp`.
#[test]
fn a_frame_that_repeats_keeps_nothing() {
    const FIRST: usize = 6;
    const FRAMES: usize = 24;
    const MOST: u64 = 4 << 20;
    let _one = support::serial();
    let mut renderer: Option<FrameRenderer<'static>> = None;
    for case in Course::new(ShapeKind::ALL.len()).scenes {
        let scene = case.scene.clone();
        let renderer = match &mut renderer {
            Some(renderer) => {
                renderer.set_scene(scene).unwrap();
                renderer
            }
            None => renderer.insert(Course::renderer(scene)),
        };
        for technique in able(case.area_light()) {
            let request = FrameRequest {
                camera: case.camera.clone(),
                size: SIZES[0],
                lights: vec![case.light],
                technique,
            };
            let mut first = 0;
            for frame in 0..FIRST + FRAMES {
                if frame == FIRST {
                    first = resident_bytes();
                }
                renderer.render(&request).unwrap();
            }
            let grown = resident_bytes().saturating_sub(first);
            println!("{} {}: {grown}", case.name, technique.name());
            assert!(
                grown <= MOST,
                "{}, {}: {grown} bytes more after {FRAMES} equal frames",
                case.name,
                technique.name()
            );
        }
    }
    let messages = renderer.unwrap().destroy().unwrap();
    support::assert_no_messages(&messages);
}

/// Run by hand: `make soak`.
#[test]
#[ignore = "a quarter of an hour"]
fn ten_thousand_frames() {
    soak(usize::MAX, 10_000, 64 << 20);
}

#[test]
#[ignore = "what the others start"]
fn a_fresh_process() {
    let Ok(frame) = std::env::var(FRESH) else {
        return;
    };
    let (number, scenes) = frame.split_once(' ').unwrap();
    let course = Course::new(scenes.parse().unwrap());
    let mut renderer = None;
    let frame = course.draw(number.parse().unwrap(), &mut renderer);
    println!("digest {:016x}", digest(&frame));
    support::assert_no_messages(&renderer.unwrap().destroy().unwrap());
}
