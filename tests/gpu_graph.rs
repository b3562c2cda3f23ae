//! Graphs recorded on a real driver under the validation layer: no message, and the right bytes.

mod support;

#[path = "gpu_graph/data.rs"]
mod data;
#[path = "gpu_graph/imports.rs"]
mod imports;
#[path = "gpu_graph/layer.rs"]
mod layer;
#[path = "support/random_graph.rs"]
mod random_graph;
#[path = "gpu_graph/shaders.rs"]
mod shaders;
#[path = "gpu_graph/work.rs"]
mod work;

use antumbra::ash::vk;
use antumbra::gpu::{Gpu, GpuError};
use antumbra::graph::simulate::simulate;
use antumbra::graph::{
    Barrier, BufferState, FakeMemory, FrameCache, Graph, HistoryStates, ImageDesc, ImageState,
    PassBuilder, PassKind, Plan, PlanResource, ResourceOrigin,
};
use imports::Imports;
use layer::assert_current_layer;
use random_graph::{Limits, Recorder, Used, random_graph};
use support::{assert_no_messages, destroy_clean, gpu, serial};
use work::World;

/// Numbers of a fixed seed for [`random_graph`].
fn numbers(seed: u32) -> Vec<u32> {
    let mut state = seed.wrapping_mul(0x9e37_79b9) | 1;
    (0..600)
        .map(|_| {
            state ^= state << 13;
            state ^= state >> 17;
            state ^= state << 5;
            state
        })
        .collect()
}

/// Gives the passes of a random graph real work, and its imports real images and buffers.
struct Work<'w, 'g> {
    world: &'w World,
    gpu: &'g mut Gpu,
    imports: &'g mut Imports,
    history: HistoryStates,
}

impl<'w> Recorder<'w> for Work<'w, '_> {
    fn record(&mut self, pass: PassBuilder<'_, 'w>, kind: PassKind, uses: &[Used]) {
        let (world, uses) = (self.world, uses.to_vec());
        pass.record(move |context| world.work(context, kind, &uses));
    }

    fn recordable(&self) -> bool {
        true
    }

    fn image(&mut self, t: usize, d: ImageDesc, a: ImageState, b: ImageState) -> vk::Image {
        self.imports.image(self.gpu, t, d, a, b)
    }

    fn buffer(&mut self, t: usize, size: u64, a: BufferState, b: BufferState) -> vk::Buffer {
        self.imports.buffer(self.gpu, t, size, a, b)
    }

    fn history(&mut self) -> Option<HistoryStates> {
        Some(self.history.clone())
    }

    fn finish(&mut self, graph: &mut Graph<'w>, kept: &[Used]) {
        self.world.judge(graph, kept);
    }
}

/// What was done over all graphs.
#[derive(Debug, Default)]
struct Sum {
    frames: usize,
    passes: usize,
    barriers: usize,
    /// Copies and contents that were compared.
    results: usize,
    imports: usize,
    /// Frames that had a last frame's image.
    continued: usize,
    /// Frames in which transients shared memory.
    aliased: usize,
}

/// Records some frames of one random graph with one cache.
fn frames(gpu: &mut Gpu, world: &mut World, seed: u32, limits: Limits, count: usize) -> Sum {
    let (mut cache, mut imports) = (FrameCache::new(), Imports::default());
    let mut sum = Sum::default();
    for number in 0..count {
        world.begin_frame();
        let history = cache.history();
        let mut work = Work {
            world,
            gpu: &mut *gpu,
            imports: &mut imports,
            history,
        };
        let graph = random_graph(&numbers(seed), limits, &mut work);
        let compiled = graph.compile(&*gpu).unwrap();
        let plan = compiled.plan().clone();
        let what = format!("graph {seed} frame {number}\n{plan}");
        assert_eq!(simulate(&plan), [], "{what}");
        if imports.wants_filling() {
            gpu.run(|gpu, cmd| {
                imports.fill(gpu, cmd);
                Ok::<_, GpuError>(())
            })
            .unwrap();
        }
        let report = gpu.run(|gpu, cmd| {
            imports.before(gpu, cmd)?;
            let report = compiled.record(gpu, &mut cache, cmd)?;
            imports.after(gpu, cmd)?;
            world.end_frame(gpu, cmd);
            Ok::<_, GpuError>(report)
        });
        let report = report.unwrap_or_else(|error| panic!("{error}: {what}"));
        let messages = gpu.take_messages();
        if !messages.is_empty() {
            println!("{what}");
        }
        assert_no_messages(&messages);
        assert_eq!(report.passes.len(), plan.passes.len());
        assert_eq!(report.barriers, plan.barrier_count());
        assert_eq!(report.transient_bytes, plan.peak_bytes());
        let previous =
            |r: &PlanResource| matches!(r.origin, ResourceOrigin::HistoryPrevious { .. });
        sum.frames += 1;
        sum.passes += report.passes.len();
        sum.barriers += report.barriers;
        sum.results += world.check(&what);
        sum.continued += usize::from(plan.resources.iter().any(previous));
        sum.aliased += usize::from(plan.peak_bytes() < plan.unaliased_bytes());
    }
    sum.imports = imports.count();
    cache.destroy(gpu);
    imports.destroy(gpu);
    sum
}

/// Plans as [`Work`] would have it recorded.
struct Dry;

impl<'f> Recorder<'f> for Dry {
    fn recordable(&self) -> bool {
        true
    }

    fn history(&mut self) -> Option<HistoryStates> {
        Some(HistoryStates::new())
    }
}

/// The first seeds whose graphs are not small: half of them many passes, half of them some with
/// transients that share memory.
fn seeds(limits: Limits, count: usize) -> Vec<u32> {
    let wanted = |seed: &u32, shared: bool| {
        let graph = random_graph(&numbers(*seed), limits, &mut Dry);
        let compiled = graph.compile(&FakeMemory).unwrap();
        let plan = compiled.plan();
        let shares = plan.peak_bytes() < plan.unaliased_bytes();
        plan.passes.len() >= if shared { 4 } else { 7 } && shares == shared
    };
    let of = |shared| {
        (0..)
            .filter(move |seed| wanted(seed, shared))
            .take(count / 2)
    };
    of(false).chain(of(true)).collect()
}

fn record_all(limits: Limits, count: usize) -> Sum {
    assert_current_layer();
    let mut gpu = gpu();
    let mut world = World::new(&mut gpu);
    let mut sum = Sum::default();
    for seed in seeds(limits, count) {
        let of = frames(&mut gpu, &mut world, seed, limits, 3);
        sum.frames += of.frames;
        sum.passes += of.passes;
        sum.barriers += of.barriers;
        sum.results += of.results;
        sum.imports += of.imports;
        sum.continued += of.continued;
        sum.aliased += of.aliased;
    }
    println!("{count} graphs on {}: {sum:?}", gpu.info().driver_name);
    world.destroy(&mut gpu);
    destroy_clean(gpu);
    sum
}

const CLOSED: Limits = Limits {
    passes: 12,
    images: 6,
    buffers: 5,
    imports: false,
};

#[test]
fn random_graphs_are_recorded_without_a_message() {
    let _one = serial();
    let sum = record_all(CLOSED, 40);
    assert_eq!(sum.frames, 120);
    assert!(
        sum.passes > 600 && sum.results > 240 && sum.aliased > 50,
        "{sum:?}"
    );
}

#[test]
fn random_graphs_with_imports_and_history_are_recorded_without_a_message() {
    let _one = serial();
    let limits = Limits {
        imports: true,
        ..CLOSED
    };
    let sum = record_all(limits, 32);
    assert_eq!(sum.frames, 96);
    assert!(
        sum.imports > 30 && sum.continued > 10 && sum.results > 200,
        "{sum:?}"
    );
}

/// The control of the two tests above: with one barrier gone, the simulator objects and so does the
/// layer, but for what [`beyond_the_layer`] names.
#[test]
fn random_graphs_without_one_of_their_barriers_are_reported() {
    let _one = serial();
    assert_current_layer();
    let (mut spoilt, mut reported) = (0, 0);
    for seed in seeds(CLOSED, 8) {
        for sixth in 0..6 {
            // The layer tells each kind of message only some times, so every mistake gets a device.
            let mut gpu = gpu();
            let mut world = World::new(&mut gpu);
            world.begin_frame();
            let (mut imports, mut cache) = (Imports::default(), FrameCache::new());
            let mut work = Work {
                world: &world,
                gpu: &mut gpu,
                imports: &mut imports,
                history: HistoryStates::new(),
            };
            let graph = random_graph(&numbers(seed), CLOSED, &mut work);
            let mut compiled = graph.compile(&gpu).unwrap();
            let mut gone = None;
            compiled
                .edit_plan(|plan| gone = remove_barrier(plan, plan.barrier_count() * sixth / 6));
            let hazards = simulate(compiled.plan());
            assert!(!hazards.is_empty(), "graph {seed}: {}", compiled.plan());
            gpu.run(|gpu, cmd| compiled.record(gpu, &mut cache, cmd))
                .unwrap();
            spoilt += 1;
            let unseen = gpu.take_messages().is_empty();
            reported += usize::from(!unseen);
            assert!(
                !unseen || gone.as_ref().is_some_and(beyond_the_layer),
                "graph {seed}: the layer does not report that {gone:?} is missing"
            );
            cache.destroy(&mut gpu);
            world.destroy(&mut gpu);
            destroy_clean(gpu);
        }
    }
    println!("{reported} of {spoilt} missing barriers were reported by the layer");
    assert!(reported * 10 > spoilt * 9, "{reported} of {spoilt}");
}

/// Whether the layer cannot know of a missing barrier: for it an attachment drawn to twice is in
/// order, and images that share memory do not touch each other.
fn beyond_the_layer(barrier: &Barrier) -> bool {
    let attachment = vk::PipelineStageFlags2::COLOR_ATTACHMENT_OUTPUT
        | vk::PipelineStageFlags2::EARLY_FRAGMENT_TESTS
        | vk::PipelineStageFlags2::LATE_FRAGMENT_TESTS;
    let again = attachment.contains(barrier.src_stages | barrier.dst_stages);
    let flush_for_images = barrier.target.is_none() && barrier.dst_access.is_empty();
    flush_for_images || (again && barrier.transition.is_none())
}

/// Takes away the barrier of this number.
fn remove_barrier(plan: &mut Plan, number: usize) -> Option<Barrier> {
    let steps = plan.steps.iter_mut();
    let batches = steps.flat_map(|step| [&mut step.hand_over, &mut step.barriers]);
    let mut before = 0;
    for batch in batches.chain([&mut plan.leave]) {
        if number < before + batch.barriers.len() {
            return Some(batch.barriers.remove(number - before));
        }
        before += batch.barriers.len();
    }
    None
}
