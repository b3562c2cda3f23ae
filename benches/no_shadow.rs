//! What a frame costs in which nothing casts a shadow, against the same frame with shadows off: medians of
//! frames in turn, from the start of the host's work until the device is done.
//!
//! `cargo bench --bench no_shadow [-- ROUNDS]`

#[path = "../tests/support/plates.rs"]
#[allow(dead_code, reason = "the tests use more of it")]
mod plates;

use std::time::Instant;

use antumbra::gpu::{Gpu, GpuOptions};
use antumbra::graph::{FrameCache, Graph};
use antumbra::light::LightShape;
use antumbra::renderer::{NamedLight, SceneBuffers, add_frame, add_frame_without_shadows};
use antumbra::scene::Scene;
use antumbra::shadow::Technique;
use plates::{camera, floor, plate, scene};

type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

const SIZE: [u32; 2] = [512, 512];
/// Rounds, each of one frame of each kind, the first two left out.
const ROUNDS: usize = 41;

/// A floor, and as many plates that stand beside the light's way to what is in view.
fn with_bystanders(count: usize) -> Scene {
    let mut primitives = vec![floor()];
    for i in 0..count {
        let x = 12.0 + (i % 16) as f32;
        let z = (i / 16) as f32 - 16.0;
        primitives.push(plate("bystander", [x, x + 0.8], [z, z + 0.8], 5.0));
    }
    scene(primitives, LightShape::Disk { radius: 0.5 })
}

struct Bench {
    gpu: Gpu,
    cache: FrameCache,
    buffers: SceneBuffers,
    lights: Vec<NamedLight>,
}

impl Bench {
    fn new(scene: &Scene, lights: usize) -> Outcome<Self> {
        let mut gpu = Gpu::create(&GpuOptions::default())?;
        let mut made = None;
        gpu.run(|gpu, cmd| {
            let mut buffers = SceneBuffers::upload(gpu, cmd, scene)?;
            buffers.add_edges(gpu, cmd, scene)?;
            made = Some(buffers);
            Ok::<_, Box<dyn std::error::Error>>(())
        })?;
        let lights = (0..lights).map(|index| {
            let mut light = scene.lights[0].light;
            light.center.x += index as f32;
            NamedLight {
                name: index.to_string(),
                light,
            }
        });
        Ok(Self {
            gpu,
            cache: FrameCache::new(),
            buffers: made.ok_or("nothing was uploaded")?,
            lights: lights.collect(),
        })
    }

    /// Milliseconds of a frame, and its passes; without a technique shadows are off.
    fn frame(&mut self, technique: Option<Technique>) -> Outcome<(f64, usize)> {
        let begin = Instant::now();
        let mut graph = Graph::continuing(self.cache.history());
        let (buffers, lights) = (&self.buffers, &self.lights);
        let frame = match technique {
            Some(technique) => add_frame(&mut graph, buffers, &camera(), SIZE, lights, technique)?,
            None => add_frame_without_shadows(&mut graph, buffers, &camera(), SIZE, lights),
        };
        graph.keep(frame.radiance);
        let compiled = graph.compile(&self.gpu)?;
        let passes = compiled.plan().passes.len();
        let cache = &mut self.cache;
        (self.gpu).run(|gpu, cmd| compiled.record(gpu, cache, cmd).map(|_| ()))?;
        Ok((begin.elapsed().as_secs_f64() * 1.0e3, passes))
    }

    fn end(mut self) -> Outcome<()> {
        self.cache.destroy(&mut self.gpu);
        self.buffers.destroy(&mut self.gpu);
        self.gpu.destroy()?;
        Ok(())
    }
}

fn median(times: &mut [f64]) -> f64 {
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

fn main() -> Outcome<()> {
    let asked = std::env::args().skip(1).find_map(|word| word.parse().ok());
    let rounds: usize = asked.unwrap_or(ROUNDS).max(3);
    let kinds = ["off", "hard", "pcss", "ssoc", "auto"];
    println!("milliseconds, medians of {} frames in turn", rounds - 2);
    println!(
        "bystanders  lights  passes  {}",
        kinds.map(|kind| format!("{kind:>14}")).concat()
    );
    for (bystanders, lights) in [(0, 1), (512, 1), (512, 4)] {
        let mut bench = Bench::new(&with_bystanders(bystanders), lights)?;
        let mut times = vec![Vec::new(); kinds.len()];
        let mut passes = Vec::new();
        for round in 0..rounds {
            for (kind, times) in kinds.iter().zip(&mut times) {
                let technique = match *kind {
                    "off" => None,
                    name => Some(name.parse()?),
                };
                let (ms, count) = bench.frame(technique)?;
                passes.push(count);
                if round >= 2 {
                    times.push(ms);
                }
            }
        }
        bench.end()?;
        passes.sort_unstable();
        passes.dedup();
        let medians: Vec<f64> = times.iter_mut().map(|times| median(times)).collect();
        let cells = medians
            .iter()
            .map(|ms| format!("{ms:8.3} {:4.2}x", ms / medians[0]));
        let cells: Vec<String> = cells.collect();
        println!(
            "{bystanders:10}  {lights:6}  {passes:6?}  {}",
            cells.join("")
        );
    }
    Ok(())
}
