//! The passes that work on the lists.

use super::{Lists, Made, NAME, OTHER_DISPATCH, PARTS, Sizes, samples, texels};
use crate::geometry::{TILE_SIZE, TileList};
use crate::gpu::{ComputePipelineDesc, SamplerDesc, spirv};
use crate::graph::{Access, Bind, BufferDesc, BufferId, Graph, ImageId, PassKind, Stage};
use crate::shadow::{ShadowInputs, shape_number};
use ash::vk;
use bytemuck::{Pod, Zeroable};

/// Invocations of a workgroup: of `shaft_masks/masks.comp`.
const INVOCATIONS: u32 = 16;

/// Words of a tile: two for each pixel and block of samples.
pub(super) fn words_of_tile(blocks: u32) -> u32 {
    TILE_SIZE * TILE_SIZE * 2 * blocks
}

/// `Push` of `shaft_masks/masks.comp`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct Push {
    further: u32,
}

/// What the tiles are worked on for.
#[derive(Clone, Copy, Debug)]
enum Step {
    /// Those that are made in pieces: each block of samples, of long lists their beginnings.
    Pieces,
    /// Plain ones of the others, and the rest of them.
    Plain(TileList),
    Others(TileList),
    /// Receivers among them whose numbers of triangles have no room in digits.
    Spilled,
    /// The rest of long lists.
    Further,
}

/// What the passes share.
pub(super) struct Masks {
    pub sizes: Sizes,
    /// Added to the names of the passes.
    pub label: String,
    /// Tiles that the words have room for.
    pub slots: u32,
    /// Nodes of the hierarchy.
    pub nodes: u32,
    pub params: BufferId,
    pub shafts: ImageId,
    pub lists: Lists,
}

impl Masks {
    /// Declares the passes; returns the visibility of the tiles, and what is known of its error.
    pub(super) fn add(&self, graph: &mut Graph<'_>, inputs: &ShadowInputs<'_>, made: Made) -> Made {
        let name = &inputs.light_name;
        let words = self.slots * words_of_tile(self.sizes.blocks);
        let words = texels(vk::Format::R32_UINT, words);
        let words = graph.create_image(format!("{NAME}.words{} {name}", self.label), words);
        // Of a tile or each of its two parts, for each block of samples, the invocations of a workgroup.
        let tasks = self.slots * PARTS * self.sizes.blocks * INVOCATIONS;
        let tasks = texels(vk::Format::R32_UINT, tasks);
        let sixteen = BufferDesc { size: 16 };
        let named = |what: &str| format!("{NAME}.{what}{} {name}", self.label);
        let mut spilled = TileList {
            arguments: graph.create_buffer(named("spilled"), sixteen),
            tiles: graph.create_image(named("spilled_tasks"), tasks),
        };
        // What is bound where nothing spills.
        let mut none = TileList {
            arguments: graph.create_buffer(named("none_spilled"), sixteen),
            ..spilled
        };
        let mut pass = graph.pass(named("no_spilled"), PassKind::Transfer);
        spilled.clear(&mut pass);
        none.clear(&mut pass);
        let cleared = [spilled, none];
        pass.record(move |ctx| cleared.iter().try_for_each(|list| list.record_clear(ctx)));
        let mut made = (made, words);
        let whole = self.lists.sorted;
        let whole = whole.map(|[plain, others]| [Step::Others(others), Step::Plain(plain)]);
        let rest = [Step::Spilled, Step::Further];
        let steps = [Step::Pieces].into_iter();
        for step in steps.chain(whole.into_iter().flatten()).chain(rest) {
            made = self.add_pass(graph, inputs, made, [&mut spilled, &mut none], step);
        }
        made.1 = self.add_walks(graph, inputs, made.1);
        self.add_resolve(graph, inputs, made)
    }

    fn add_pass(
        &self,
        graph: &mut Graph<'_>,
        inputs: &ShadowInputs<'_>,
        (made, words): (Made, ImageId),
        [spilled, none]: [&mut TileList; 2],
        step: Step,
    ) -> (Made, ImageId) {
        let name = &inputs.light_name;
        let (ids, gbuffer) = (inputs.ids, inputs.gbuffer);
        let (view_params, part) = inputs.view_params;
        let (params, shafts) = (self.params, self.shafts);
        let Lists {
            lists,
            edges,
            triangles,
            further,
            tasks,
            pieces,
            ..
        } = self.lists;
        let (arguments, list, what) = match step {
            Step::Pieces => (pieces.arguments, pieces.tiles, "masks_pieces"),
            Step::Plain(plain) => (plain.arguments, plain.tiles, "masks_plain"),
            Step::Others(others) => (others.arguments, others.tiles, "masks"),
            Step::Spilled => (spilled.arguments, pieces.tiles, "masks_spilled"),
            Step::Further => (further, pieces.tiles, "further"),
        };
        let label = &self.label;
        let mut pass = graph.pass(format!("{NAME}.{what}{label} {name}"), PassKind::Compute);
        pass.read_part(view_params, part, Access::Uniform(Stage::Compute));
        pass.read(params, Access::Uniform(Stage::Compute));
        let images = [
            gbuffer.view_depth,
            gbuffer.ids,
            ids.triangles,
            shafts,
            edges,
            triangles,
            lists,
            tasks,
            ids.triangle_uvs,
            ids.materials,
            ids.footprints,
        ];
        for image in images {
            pass.read(image, Access::StorageRead(Stage::Compute));
        }
        pass.read(list, Access::Sampled(Stage::Compute));
        pass.read(arguments, Access::Indirect);
        pass.read(arguments, Access::Uniform(Stage::Compute));
        let visibility = pass.write(made.visibility, Access::StorageWrite(Stage::Compute));
        let estimates = pass.write(made.estimates, Access::StorageReadWrite(Stage::Compute));
        let words = match step {
            Step::Pieces => pass.overwrite(words, Access::StorageWrite(Stage::Compute)),
            Step::Plain(_) | Step::Others(_) | Step::Spilled => {
                pass.write(words, Access::StorageWrite(Stage::Compute))
            }
            Step::Further => pass.write(words, Access::StorageReadWrite(Stage::Compute)),
        };
        let spills = if matches!(step, Step::Pieces) {
            spilled.fill(&mut pass);
            *spilled
        } else if matches!(step, Step::Plain(_) | Step::Others(_)) {
            spilled.extend(&mut pass);
            *spilled
        } else {
            // The shader may write to it, for all that is known of it.
            let written = Access::StorageReadWrite(Stage::Compute);
            none.arguments = pass.write(none.arguments, written);
            spilled.tiles = pass.write(spilled.tiles, written);
            TileList {
                arguments: none.arguments,
                tiles: spilled.tiles,
            }
        };
        let push = Push {
            further: u32::from(matches!(step, Step::Further)),
        };
        let constants = vec![
            (0, shape_number(&inputs.light.shape)),
            (2, u32::from(matches!(step, Step::Plain(_)))),
            (3, u32::from(inputs.scene.has_masks())),
            (4, self.sizes.task_entries),
            (5, u32::from(matches!(step, Step::Others(_)))),
            (6, u32::from(matches!(step, Step::Spilled))),
            (
                7,
                u32::from(!matches!(step, Step::Plain(_) | Step::Others(_))),
            ),
            (8, u32::from(samples::is_small_sun(&inputs.light.shape))),
        ];
        let dispatched = match step {
            Step::Pieces => OTHER_DISPATCH,
            _ => 0,
        };
        pass.record(move |ctx| {
            let nearest = SamplerDesc::nearest();
            let bindings = [
                Bind::uniform(0, view_params).part(part),
                Bind::uniform(1, params),
                Bind::storage_image(2, gbuffer.view_depth),
                Bind::storage_image(3, gbuffer.ids),
                Bind::storage_image(4, ids.triangles),
                Bind::storage_image(5, ids.materials),
                Bind::storage_image(6, ids.triangle_uvs),
                Bind::storage_image(7, ids.footprints),
                Bind::uniform(8, arguments),
                Bind::sampled(9, list, nearest),
                Bind::storage_image(10, shafts),
                Bind::storage_image(11, edges),
                Bind::storage_image(12, lists),
                Bind::storage_image(13, visibility),
                Bind::storage_image(14, tasks),
                Bind::storage_image(15, words),
                Bind::storage_image(16, triangles),
                Bind::storage_image(17, estimates),
                Bind::storage_buffer(18, spills.arguments),
                Bind::storage_image(19, spills.tiles),
            ];
            let pipeline = ComputePipelineDesc {
                constants,
                ..ComputePipelineDesc::new(&spirv::SHAFT_MASKS_MASKS_COMP)
            };
            ctx.bind_compute(&pipeline, &bindings, bytemuck::bytes_of(&push))?;
            ctx.dispatch_indirect(arguments, dispatched)
        });
        let made = Made {
            visibility,
            estimates,
        };
        (made, words)
    }

    fn add_resolve(
        &self,
        graph: &mut Graph<'_>,
        inputs: &ShadowInputs<'_>,
        (made, words): (Made, ImageId),
    ) -> Made {
        let name = &inputs.light_name;
        let (params, shafts) = (self.params, self.shafts);
        let view_depth = inputs.gbuffer.view_depth;
        let Lists { pieces, lists, .. } = self.lists;
        let label = &self.label;
        let mut pass = graph.pass(format!("{NAME}.resolve{label} {name}"), PassKind::Compute);
        pass.read(params, Access::Uniform(Stage::Compute));
        pieces.read(&mut pass);
        for image in [words, view_depth, shafts, lists] {
            pass.read(image, Access::StorageRead(Stage::Compute));
        }
        let visibility = pass.write(made.visibility, Access::StorageWrite(Stage::Compute));
        let estimates = pass.write(made.estimates, Access::StorageReadWrite(Stage::Compute));
        pass.record(move |ctx| {
            let nearest = SamplerDesc::nearest();
            let pipeline = ComputePipelineDesc::new(&spirv::SHAFT_MASKS_RESOLVE_COMP);
            let bindings = [
                Bind::uniform(0, params),
                Bind::uniform(1, pieces.arguments),
                Bind::sampled(2, pieces.tiles, nearest),
                Bind::storage_image(3, words),
                Bind::storage_image(4, visibility),
                Bind::storage_image(5, view_depth),
                Bind::storage_image(6, shafts),
                Bind::storage_image(7, lists),
                Bind::storage_image(8, estimates),
            ];
            ctx.bind_compute(&pipeline, &bindings, &[])?;
            pieces.dispatch(ctx)
        });
        Made {
            visibility,
            estimates,
        }
    }
}
