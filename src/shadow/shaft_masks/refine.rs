//! More samples for the tiles that need them.
//!
//! Every mask tells how far off its pixel is likely to be: a sample that is seen beside one that is
//! hidden stands for a cell of the light that an edge crosses, and of each such cell a part is
//! guessed. The squares of these errors add up. The tiles with the largest error get four times the
//! samples, in rounds, until the picture's is as small as asked for; or those with a pixel whose
//! proven bound is too large. The tiles' lists are those of the first masks.

use super::bound::no_bound;
use super::masks::{Masks, words_of_tile};
use super::walk::{WalkRest, runs_in_dispatch};
use super::{BLOCK, Lists, Made, NAME, OTHER_DISPATCH, PARTS, POOL_WIDTH, ShaftOptions, Sizes};
use super::{add_params, part_list, part_list_for_two, texels};
use crate::geometry::tile_counts;
use crate::gpu::{ComputePipelineDesc, spirv};
use crate::graph::{
    Access, Bind, BufferDesc, BufferId, Graph, ImageDesc, ImageId, PassKind, Stage,
};
use crate::shadow::{ShadowInputs, Tally};
use ash::vk;
use bytemuck::{Pod, Zeroable};
use std::collections::BTreeMap;

/// Texels of a tile: `ESTIMATE_TEXELS` in `shaft_masks/estimates.glsl`.
const ESTIMATE_TEXELS: u32 = 4;

/// Most samples of a tile: their rows.
const MOST_SIDE: u32 = 32;

/// Words that one round has room for: 32 MiB.
const ROUND_WORDS: u32 = 1 << 23;

/// Rounds for each number of samples where the time is looked at between them.
const TIMED_ROUNDS: u32 = 6;

/// Squared error of a pixel for each change between neighbouring samples, in units of one sample's
/// area squared. Fitted to rays: see [`ShaftOptions::target_error`].
const CHANGE_SQUARE: f32 = 1.0 / 12.0;

/// `Push` of `shaft_masks/select.comp`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct Push {
    target_square: f32,
    bound: f32,
    scale: f32,
    work: u32,
    capacity: u32,
    rounds: u32,
    tick_ms: f32,
    most_ms: f32,
    parts_down: u32,
}

/// What tiles are chosen for.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Goal {
    /// Estimated root mean square error of the picture.
    Error(f32),
    /// Proven bound on each pixel.
    Bound(f32),
}

/// Declares the estimates, of no tile yet.
pub(super) fn no_estimates(graph: &mut Graph<'_>, inputs: &ShadowInputs<'_>) -> ImageId {
    let name = &inputs.light_name;
    let [across, down] = tile_counts(inputs.camera.size());
    let desc = ImageDesc::new(vk::Format::R32_UINT, across * ESTIMATE_TEXELS, down * PARTS);
    let estimates = graph.create_image(format!("{NAME}.estimates {name}"), desc);
    let mut pass = graph.pass(format!("{NAME}.no_estimates {name}"), PassKind::Transfer);
    let estimates = pass.overwrite(estimates, Access::Clear);
    pass.record(move |ctx| ctx.clear_image(estimates, [0.0; 4]));
    estimates
}

/// What the estimates say when all is done: `tiles_lit`, `tiles_umbra`, `tiles_penumbra`, which are the
/// tiles, or parts of one, that some of the light is above; of the last `tiles_256` and `tiles_1024`, which have
/// so many samples, `tile_entries`, the edges and triangles on their lists,
/// `estimated_error_millionths`, of their partly lit pixels, and `bound_1024ths`, the largest bound of
/// a pixel where bounds were made.
pub(super) fn tally(estimates: ImageId) -> Tally {
    let image = estimates;
    Tally { image, count }
}

/// Of these the counts of tiles, where no masks are made.
pub(super) fn tile_tally(estimates: ImageId) -> Tally {
    let image = estimates;
    Tally {
        image,
        count: count_tiles,
    }
}

/// `LEVEL_LIT` and `LEVEL_DARK` in `shaft_masks/estimates.glsl`.
const LEVEL_LIT: u32 = 0x100;
const LEVEL_DARK: u32 = 0x101;

fn tiles_at(texels: &[u32], level: u32) -> u64 {
    let tiles = texels.chunks_exact(ESTIMATE_TEXELS as usize);
    tiles.filter(|tile| tile[2] == level).count() as u64
}

fn count_tiles(texels: &[u32]) -> Vec<(&'static str, u64)> {
    let of = |level: u32| tiles_at(texels, level);
    let [few, more, most] = [1, 2, 3].map(of);
    vec![
        ("tiles_lit", of(LEVEL_LIT)),
        ("tiles_umbra", of(LEVEL_DARK)),
        ("tiles_penumbra", few + more + most),
    ]
}

fn count(texels: &[u32]) -> Vec<(&'static str, u64)> {
    let tiles = || texels.chunks_exact(ESTIMATE_TEXELS as usize);
    let penumbra = || tiles().filter(|tile| (1..=3).contains(&tile[2]));
    let squares = penumbra().map(|tile| {
        let samples = f64::from(BLOCK * BLOCK) * 4.0_f64.powi(tile[2] as i32 - 1);
        f64::from(CHANGE_SQUARE) * f64::from(tile[0] & 0xf_ffff) / (samples * samples)
    });
    let pixels: u32 = penumbra().map(|tile| tile[0] >> 20).sum();
    let error = (squares.sum::<f64>() / f64::from(pixels.max(1))).sqrt();
    let mut counts = count_tiles(texels);
    counts.extend([
        ("tiles_256", tiles_at(texels, 2)),
        ("tiles_1024", tiles_at(texels, 3)),
        (
            "tile_entries",
            penumbra().map(|tile| u64::from(tile[3])).sum(),
        ),
        ("estimated_error_millionths", (1.0e6 * error).round() as u64),
        (BOUND, penumbra().map(bound_parts).max().unwrap_or(0)),
    ]);
    counts
}

/// The counter of the largest bound: a number of cells, of 1024.
const BOUND: &str = "bound_1024ths";

fn bound_parts(tile: &[u32]) -> u64 {
    (f32::from_bits(tile[1]) * 1024.0) as u64
}

/// The bound asked for and the largest one of any pixel, if that is above it.
pub(in crate::shadow) fn missed_bound(
    options: &ShaftOptions,
    counters: &BTreeMap<String, u64>,
) -> Option<[f32; 2]> {
    let asked = options.bound?;
    let reached = *counters.get(BOUND)? as f32 / 1024.0;
    (reached > asked).then_some([asked, reached])
}

/// The rounds after the first masks.
pub(super) struct Refining {
    first: Masks,
    options: ShaftOptions,
    spent: BufferId,
}

impl Refining {
    /// `spent` as [`begin`] made it.
    pub(super) fn new(first: Masks, options: ShaftOptions, spent: BufferId) -> Self {
        Self {
            first,
            options,
            spent,
        }
    }

    /// Declares the passes; returns the visibility, and its bound.
    pub(super) fn add(
        self,
        graph: &mut Graph<'_>,
        inputs: &ShadowInputs<'_>,
        mut made: Made,
    ) -> (Made, ImageId) {
        let Self {
            first,
            options,
            mut spent,
        } = self;
        let mut bound = no_bound(graph, inputs);
        let goals = [
            options.bound.map(Goal::Bound),
            options.target_error.map(Goal::Error),
        ];
        let goals: Vec<Goal> = goals.into_iter().flatten().collect();
        if goals.is_empty() || options.side == MOST_SIDE {
            (bound, made.estimates) = first.add_bound(graph, inputs, bound, made.estimates);
            return (made, bound);
        }
        // Bounds are made as soon as tiles are chosen by them, else at the end.
        let by_bound = options.bound.is_some();
        if by_bound {
            (bound, made.estimates) = first.add_bound(graph, inputs, bound, made.estimates);
        }
        let Masks {
            nodes,
            shafts,
            mut lists,
            sizes,
            ..
        } = first;
        let [across, down] = tile_counts(inputs.camera.size());
        let parts = across * down * PARTS;
        let mut all = vec![first];
        let sides = [2 * BLOCK, MOST_SIDE];
        for side in sides.into_iter().filter(|side| *side > options.side) {
            let blocks = (side / BLOCK).pow(2);
            let sizes = Sizes { blocks, ..sizes };
            let label = format!("_{}", side * side);
            let params = add_params(graph, inputs, &sizes, side, &format!("params{label}"));
            let capacity = (ROUND_WORDS / words_of_tile(blocks)).min(parts);
            let full = parts.div_ceil(capacity);
            let rounds = match options.budget_ms {
                Some(_) => full.max(TIMED_ROUNDS),
                None => full,
            };
            for goal in &goals {
                for round in 0..rounds {
                    let mut masks = Masks {
                        sizes,
                        label: label.clone(),
                        slots: capacity,
                        params,
                        nodes,
                        shafts,
                        lists,
                    };
                    // Without a clock a round takes what it can.
                    let left = if options.budget_ms.is_some() {
                        rounds - round
                    } else {
                        1
                    };
                    let choice = Choice {
                        goal: *goal,
                        options: &options,
                        rounds: left,
                    };
                    (made.estimates, spent) =
                        choice.add(graph, inputs, &mut masks, made.estimates, spent);
                    lists.lists = masks.lists.lists;
                    made = masks.add(graph, inputs, made);
                    if by_bound {
                        (bound, made.estimates) =
                            masks.add_bound(graph, inputs, bound, made.estimates);
                    }
                    all.push(masks);
                }
            }
        }
        if !by_bound {
            for masks in &mut all {
                // What changed in them since is not looked at.
                masks.lists.lists = lists.lists;
                (bound, made.estimates) = masks.add_bound(graph, inputs, bound, made.estimates);
            }
        }
        (made, bound)
    }
}

/// Bytes of `Spent` in `shaft_masks/select.comp`.
const SPENT_BYTES: u64 = 24;

/// Where in it the clock stands at the beginning, and later.
const BEGIN_OFFSET: u64 = 8;
const NOW_OFFSET: u64 = 16;

/// Declares what is spent: nothing yet. The clock begins here.
pub(super) fn begin(
    graph: &mut Graph<'_>,
    inputs: &ShadowInputs<'_>,
    options: &ShaftOptions,
) -> BufferId {
    let name = &inputs.light_name;
    let desc = BufferDesc { size: SPENT_BYTES };
    let spent = graph.create_buffer(format!("{NAME}.spent {name}"), desc);
    let mut pass = graph.pass(format!("{NAME}.rounds {name}"), PassKind::Transfer);
    let spent = pass.overwrite(spent, Access::Clear);
    pass.record(move |ctx| ctx.update_buffer(spent, 0, &[0; SPENT_BYTES as usize]));
    match options.budget_ms {
        Some(_) => add_clock(graph, inputs, spent, BEGIN_OFFSET),
        None => spent,
    }
}

fn add_clock(
    graph: &mut Graph<'_>,
    inputs: &ShadowInputs<'_>,
    spent: BufferId,
    offset: u64,
) -> BufferId {
    let name = &inputs.light_name;
    let mut pass = graph.pass(format!("{NAME}.clock {name}"), PassKind::Transfer);
    let spent = pass.write(spent, Access::CopyWrite);
    pass.record(move |ctx| ctx.write_clock(spent, offset));
    spent
}

/// How a round's tiles are chosen.
struct Choice<'o> {
    goal: Goal,
    options: &'o ShaftOptions,
    /// This round and those after it that share the tiles.
    rounds: u32,
}

impl Choice<'_> {
    /// Declares the passes; fills in the lists of the masks. Returns the estimates and what is spent.
    fn add(
        &self,
        graph: &mut Graph<'_>,
        inputs: &ShadowInputs<'_>,
        masks: &mut Masks,
        estimates: ImageId,
        spent: BufferId,
    ) -> (ImageId, BufferId) {
        let spent = match self.options.budget_ms {
            Some(_) => add_clock(graph, inputs, spent, NOW_OFFSET),
            None => spent,
        };
        let (name, label) = (&inputs.light_name, masks.label.clone());
        let [_, down] = tile_counts(inputs.camera.size());
        let sizes = masks.sizes;
        let mut selected = part_list_for_two(graph, inputs, &format!("selected{label}"));
        let mut partial = part_list(graph, inputs, &format!("partial{label}"));
        let mut walk_rest = WalkRest::create(graph, inputs, &label);
        let sixteen = BufferDesc { size: 16 };
        let further = graph.create_buffer(format!("{NAME}.further{label} {name}"), sixteen);
        let mut pass = graph.pass(format!("{NAME}.clear{label} {name}"), PassKind::Transfer);
        selected.clear(&mut pass);
        partial.clear(&mut pass);
        let further = pass.overwrite(further, Access::Clear);
        walk_rest.arguments = pass.overwrite(walk_rest.arguments, Access::Clear);
        let runs = runs_in_dispatch(masks.nodes, &sizes);
        let of_blocks = [0u32, 1, sizes.blocks, 0];
        let arguments = [
            (selected.arguments, 0, [0, 1, 1, 0]),
            (selected.arguments, OTHER_DISPATCH, of_blocks),
            (further, 0, of_blocks),
            (partial.arguments, 0, of_blocks),
            (walk_rest.arguments, 0, [0, 1, runs * sizes.blocks, 0]),
        ];
        pass.record(move |ctx| {
            for (buffer, offset, values) in arguments {
                ctx.update_buffer(buffer, offset, bytemuck::cast_slice(&values))?;
            }
            Ok(())
        });

        let tasks = texels(
            vk::Format::R32G32B32A32_UINT,
            sizes.pool_rows * POOL_WIDTH / sizes.task_entries,
        );
        let tasks = graph.create_image(format!("{NAME}.tasks{label} {name}"), tasks);
        let params = masks.params;
        let mut pass = graph.pass(format!("{NAME}.select{label} {name}"), PassKind::Compute);
        pass.read(params, Access::Uniform(Stage::Compute));
        let estimates = pass.write(estimates, Access::StorageReadWrite(Stage::Compute));
        let lists = pass.write(masks.lists.lists, Access::StorageReadWrite(Stage::Compute));
        selected.fill(&mut pass);
        partial.fill(&mut pass);
        let further = pass.write(further, Access::StorageReadWrite(Stage::Compute));
        let tasks = pass.overwrite(tasks, Access::StorageWrite(Stage::Compute));
        let spent = pass.write(spent, Access::StorageReadWrite(Stage::Compute));
        let (target_square, bound) = match self.goal {
            Goal::Error(target) => (target * target, 0.0),
            Goal::Bound(bound) => (-1.0, bound),
        };
        let samples = (BLOCK * BLOCK) as f32;
        let mut push = Push {
            target_square,
            bound,
            scale: CHANGE_SQUARE / (samples * samples),
            work: self.options.budget_work.unwrap_or(u32::MAX),
            capacity: masks.slots,
            rounds: self.rounds,
            tick_ms: 0.0,
            most_ms: self.options.budget_ms.unwrap_or(f32::MAX),
            parts_down: down * PARTS,
        };
        let task_entries = sizes.task_entries;
        pass.record(move |ctx| {
            push.tick_ms = ctx.gpu().tick_ms();
            let bindings = [
                Bind::uniform(0, params),
                Bind::storage_image(1, estimates),
                Bind::storage_image(2, lists),
                Bind::storage_buffer(3, selected.arguments),
                Bind::storage_image(4, selected.tiles),
                Bind::storage_buffer(5, further),
                Bind::storage_image(6, tasks),
                Bind::storage_buffer(7, partial.arguments),
                Bind::storage_image(8, partial.tiles),
                Bind::storage_buffer(9, spent),
            ];
            let pipeline = ComputePipelineDesc {
                constants: vec![(4, task_entries)],
                ..ComputePipelineDesc::new(&spirv::SHAFT_MASKS_SELECT_COMP)
            };
            ctx.bind_compute(&pipeline, &bindings, bytemuck::bytes_of(&push))?;
            ctx.dispatch([1, 1, 1]);
            Ok(())
        });
        masks.lists = Lists {
            tiles: selected,
            sorted: None,
            lists,
            further,
            tasks,
            partial,
            walk_rest,
            pieces: selected,
            ..masks.lists
        };
        (estimates, spent)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_are_missed_by_what_any_pixel_is_above() {
        // Lit; 64 samples with 5 cells undecided; 1024 with 79.
        let parts = |parts: f32| (parts / 1024.0).to_bits();
        let tiles = [
            0,
            parts(0.0),
            LEVEL_LIT,
            0,
            0,
            parts(80.0),
            1,
            0,
            0,
            parts(79.0),
            3,
            0,
        ];
        let counted: BTreeMap<String, u64> = count(&tiles)
            .into_iter()
            .map(|(name, n)| (name.to_string(), n))
            .collect();
        assert_eq!(counted[BOUND], 80);
        let missed = |bound| {
            let options = ShaftOptions {
                bound,
                ..ShaftOptions::DEFAULT
            };
            missed_bound(&options, &counted)
        };
        assert_eq!(missed(None), None);
        assert_eq!(missed(Some(80.0 / 1024.0)), None);
        assert_eq!(missed(Some(0.078)), Some([0.078, 80.0 / 1024.0]));
    }
}
