//! Properties of plans, over random graphs of up to 64 passes.

#[path = "support/random_graph.rs"]
mod random_graph;

use antumbra::ash::vk;
use antumbra::graph::simulate::{Problem, simulate};
use antumbra::graph::{Batch, FakeMemory, Mode, Part, Plan, ResourceOrigin, ResourceShape};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use random_graph::{Limits, Nothing, random_graph};

const LIMITS: Limits = Limits {
    passes: 64,
    images: 10,
    buffers: 6,
    imports: true,
};

fn plan(numbers: &[u32]) -> Plan {
    let graph = random_graph(numbers, LIMITS, &mut Nothing);
    match graph.compile(&FakeMemory) {
        Ok(compiled) => compiled.plan().clone(),
        Err(error) => panic!("a valid graph was refused: {error}"),
    }
}

fn numbers() -> impl Strategy<Value = Vec<u32>> {
    prop::collection::vec(any::<u32>(), 0..600)
}

/// Every plan that differs from this one by a mistake in its barriers: the barrier that was
/// spoilt, and the plan.
fn spoilt_barriers(plan: &Plan) -> Vec<(String, Plan)> {
    let mut spoilt = Vec::new();
    let batches = plan.steps.len() * 2 + 1;
    for number in 0..batches {
        let Some(batch) = batch(plan, number) else {
            continue;
        };
        for index in 0..batch.barriers.len() {
            let barrier = &batch.barriers[index];
            let mut add = |what: String, edit: &dyn Fn(&mut Batch)| {
                let mut other = plan.clone();
                if let Some(batch) = batch_mut(&mut other, number) {
                    edit(batch);
                }
                spoilt.push((format!("batch {number} barrier {index}: {what}"), other));
            };
            add("dropped".to_string(), &|batch| {
                batch.barriers.remove(index);
            });
            for bit in bits(barrier.src_stages.as_raw()) {
                let bit = vk::PipelineStageFlags2::from_raw(bit);
                add(format!("source stage {bit:?} dropped"), &|batch| {
                    batch.barriers[index].src_stages &= !bit;
                });
            }
            // A hand-over's second scope holds the first accesses of all parts of the new tenant,
            // those of later steps too, which another barrier may have covered by then: it can be
            // wider than it must, though the barrier is needed.
            let wide = number.is_multiple_of(2) && number / 2 < plan.steps.len();
            let dst = if wide && barrier.dst_stages.as_raw().count_ones() > 1 {
                0
            } else {
                barrier.dst_stages.as_raw()
            };
            for bit in bits(dst) {
                let bit = vk::PipelineStageFlags2::from_raw(bit);
                add(format!("destination stage {bit:?} dropped"), &|batch| {
                    batch.barriers[index].dst_stages &= !bit;
                });
            }
            for bit in bits(barrier.src_access.as_raw()) {
                let bit = vk::AccessFlags2::from_raw(bit);
                add(format!("source access {bit:?} dropped"), &|batch| {
                    batch.barriers[index].src_access &= !bit;
                });
            }
        }
    }
    spoilt
}

fn batch(plan: &Plan, number: usize) -> Option<&Batch> {
    match plan.steps.get(number / 2) {
        None => Some(&plan.leave),
        Some(step) if number.is_multiple_of(2) => Some(&step.hand_over),
        Some(step) => Some(&step.barriers),
    }
}

fn batch_mut(plan: &mut Plan, number: usize) -> Option<&mut Batch> {
    match plan.steps.get_mut(number / 2) {
        None => Some(&mut plan.leave),
        Some(step) if number.is_multiple_of(2) => Some(&mut step.hand_over),
        Some(step) => Some(&mut step.barriers),
    }
}

fn bits(mask: u64) -> impl Iterator<Item = u64> {
    (0..64)
        .map(|bit| 1 << bit)
        .filter(move |bit| mask & bit != 0)
}

/// Every plan in which one transient was moved to where it must not be.
fn misplaced(plan: &Plan) -> Vec<Plan> {
    let mut moved = Vec::new();
    let mut shift = |index: usize, offset: u64| {
        let mut other = plan.clone();
        if let ResourceOrigin::Transient(Some(place)) = &mut other.resources[index].origin {
            place.offset = offset;
        }
        moved.push(other);
    };
    for (index, resource) in plan.resources.iter().enumerate() {
        let ResourceOrigin::Transient(Some(place)) = resource.origin else {
            continue;
        };
        shift(index, place.offset + 1);
        let end = plan.arenas[place.arena].size - place.size;
        shift(index, end + place.alignment);
        for other in &plan.resources[..index] {
            if let (ResourceOrigin::Transient(Some(of)), Some(a), Some(b)) =
                (other.origin, resource.steps, other.steps)
                && of.arena == place.arena
                && a.0 <= b.1
                && b.0 <= a.1
            {
                shift(index, of.offset);
            }
        }
    }
    moved
}

fn cells_overlap(a: Part, b: Part) -> bool {
    match (a, b) {
        (Part::Image(a), Part::Image(b)) => {
            a.base_mip < b.base_mip + b.mips
                && b.base_mip < a.base_mip + a.mips
                && a.base_layer < b.base_layer + b.layers
                && b.base_layer < a.base_layer + a.layers
        }
        (Part::Buffer(a), Part::Buffer(b)) => {
            a.offset < b.offset + b.size && b.offset < a.offset + a.size
        }
        _ => false,
    }
}

proptest! {
    #![proptest_config(config(2000))]

    #[test]
    fn plans_have_no_hazard(numbers in numbers()) {
        let plan = plan(&numbers);
        let hazards = simulate(&plan);
        prop_assert!(hazards.is_empty(), "{hazards:#?}\n{plan}");
    }

    #[test]
    fn planning_is_deterministic(numbers in numbers()) {
        prop_assert_eq!(plan(&numbers), plan(&numbers));
        prop_assert_eq!(plan(&numbers).to_string(), plan(&numbers).to_string());
    }

    /// Live passes run once each, dependent ones in order of declaration, and culled ones write
    /// nothing that a live pass reads.
    #[test]
    fn order_is_a_permutation_of_the_live_passes(numbers in numbers()) {
        let plan = plan(&numbers);
        let in_steps: Vec<usize> = plan.steps.iter().flat_map(|s| s.passes.clone()).collect();
        prop_assert_eq!(&in_steps, &(0..plan.passes.len()).collect::<Vec<_>>());
        let mut declared: Vec<usize> = plan.passes.iter().map(|pass| pass.declared).collect();
        declared.extend(plan.culled.iter().map(|pass| pass.declared));
        declared.sort_unstable();
        prop_assert_eq!(&declared, &(0..declared.len()).collect::<Vec<_>>());
        for (place, pass) in plan.passes.iter().enumerate() {
            for other in &plan.passes[..place] {
                let dependent = pass.uses.iter().any(|a| other.uses.iter().any(|b| {
                    let same = a.resource == b.resource && cells_overlap(a.part, b.part);
                    same && (a.mode != Mode::Read || b.mode != Mode::Read)
                }));
                prop_assert!(!dependent || other.declared < pass.declared);
            }
        }
        for resource in &plan.resources {
            let unused = match resource.shape {
                ResourceShape::Image { usage, .. } => usage.is_empty(),
                ResourceShape::Buffer { usage, .. } => usage.is_empty(),
            };
            prop_assert_eq!(unused, resource.steps.is_none());
        }
    }

    #[test]
    fn aliasing_never_costs_memory(numbers in numbers()) {
        let plan = plan(&numbers);
        prop_assert!(plan.peak_bytes() <= plan.unaliased_bytes());
    }
}

proptest! {
    #![proptest_config(config(400))]

    /// No barrier, and no stage or flushed access of one, can be taken away without a hazard. So
    /// every barrier is needed, and every such mistake is caught.
    #[test]
    fn every_spoilt_barrier_is_caught(numbers in numbers()) {
        let plan = plan(&numbers);
        for (what, spoilt) in spoilt_barriers(&plan) {
            prop_assert!(!simulate(&spoilt).is_empty(), "{what} was not noticed\n{plan}");
        }
    }

    #[test]
    fn every_misplacement_is_caught(numbers in numbers()) {
        let plan = plan(&numbers);
        for spoilt in misplaced(&plan) {
            let hazards = simulate(&spoilt);
            let placement = hazards.iter().any(|hazard| {
                matches!(hazard.problem, Problem::Misplaced | Problem::SharedMemory)
            });
            prop_assert!(placement, "{plan}");
        }
    }
}

/// So many random graphs, unless `PROPTEST_CASES` says otherwise, the same on every run unless
/// `PROPTEST_RNG_SEED` does. A failing graph is printed as its plan, so nothing is kept in files.
fn config(cases: u32) -> ProptestConfig {
    let wanted = std::env::var("PROPTEST_CASES").ok();
    ProptestConfig {
        cases: wanted.and_then(|n| n.parse().ok()).unwrap_or(cases),
        failure_persistence: None,
        rng_seed: match std::env::var("PROPTEST_RNG_SEED") {
            Ok(seed) => RngSeed::Fixed(seed.parse().unwrap_or(0)),
            Err(_) => RngSeed::Fixed(1),
        },
        ..ProptestConfig::default()
    }
}

/// How much the properties above cover, on graphs of a fixed seed: printed with `--nocapture`.
#[test]
fn random_graphs_are_not_trivial() {
    let mut state = 1u32;
    let mut next = || {
        state ^= state << 13;
        state ^= state >> 17;
        state ^= state << 5;
        state
    };
    let (mut passes, mut culled, mut barriers, mut handed, mut aliased, mut spoilt) =
        (0, 0, 0, 0, 0, 0);
    for _ in 0..300 {
        let numbers: Vec<u32> = (0..600).map(|_| next()).collect();
        let plan = plan(&numbers);
        passes += plan.passes.len();
        culled += plan.culled.len();
        barriers += plan.barrier_count();
        handed += plan
            .steps
            .iter()
            .filter(|s| !s.hand_over.barriers.is_empty())
            .count();
        aliased += usize::from(plan.peak_bytes() < plan.unaliased_bytes());
        spoilt += spoilt_barriers(&plan).len() + misplaced(&plan).len();
    }
    println!(
        "300 graphs: {passes} passes live, {culled} culled, {barriers} barriers, {handed} flushes \
         at hand-over, {aliased} plans share memory, {spoilt} mutations"
    );
    assert!(passes > 1000 && culled > 300 && barriers > 1000 && handed > 0 && aliased > 50);
}
