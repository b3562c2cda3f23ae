//! How long planning a frame of 64 passes takes.

#[path = "../tests/support/random_graph.rs"]
mod random_graph;
#[path = "../tests/support/shadow_frame.rs"]
mod shadow_frame;

use antumbra::graph::{FakeMemory, Graph};
use criterion::{BatchSize, Criterion, criterion_group, criterion_main};
use random_graph::{Limits, Nothing, random_graph};
use shadow_frame::{pass_count, shadow_frame};
use std::hint::black_box;

const PASSES: usize = 64;

/// Lights that make [`shadow_frame`] one of so many passes.
const LIGHTS: u32 = 7;

fn realistic() -> Graph<'static> {
    let mut graph = Graph::new();
    shadow_frame(&mut graph, LIGHTS);
    graph
}

const LIMITS: Limits = Limits {
    passes: PASSES,
    images: 40,
    buffers: 20,
    imports: true,
};

fn numbers(seed: u32) -> Vec<u32> {
    let mut state = seed.wrapping_mul(0x9e37_79b9) | 1;
    let xorshift = |_| {
        state ^= state << 13;
        state ^= state >> 17;
        state ^= state << 5;
        state
    };
    (0..4000).map(xorshift).collect()
}

fn random(seed: u32) -> Graph<'static> {
    random_graph(&numbers(seed), LIMITS, &mut Nothing)
}

/// Passes that run, of a random graph that declares so many passes as wanted.
fn live_passes(seed: u32) -> Option<usize> {
    let compiled = random(seed).compile(&FakeMemory).ok()?;
    let plan = compiled.plan();
    (plan.passes.len() + plan.culled.len() == PASSES).then_some(plan.passes.len())
}

fn plan(c: &mut Criterion) {
    assert_eq!(pass_count(LIGHTS), PASSES);
    let mut group = c.benchmark_group("plan 64 passes");
    group.bench_function("shadows of several lights", |b| {
        b.iter_batched(
            realistic,
            |g| black_box(g.compile(&FakeMemory).is_ok()),
            BatchSize::SmallInput,
        )
    });
    // Of some random graphs, the one in which most passes run.
    let seed = (0..1000).max_by_key(|seed| live_passes(*seed)).unwrap_or(0);
    println!(
        "random graph: {:?} of {PASSES} passes run",
        live_passes(seed)
    );
    group.bench_function("random", |b| {
        b.iter_batched(
            || random(seed),
            |g| black_box(g.compile(&FakeMemory).is_ok()),
            BatchSize::SmallInput,
        )
    });
    group.finish();
    c.bench_function("declare and plan 64 passes", |b| {
        b.iter(|| black_box(realistic().compile(&FakeMemory).is_ok()))
    });
}

criterion_group!(benches, plan);
criterion_main!(benches);
