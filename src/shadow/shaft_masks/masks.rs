//! The passes that work on the lists.

use super::{Lists, Made, NAME, Sizes, texels};
use crate::geometry::TILE_SIZE;
use crate::gpu::{ComputePipelineDesc, SamplerDesc, spirv};
use crate::graph::{Access, Bind, BufferId, Graph, ImageId, PassKind, Stage};
use crate::shadow::{ShadowInputs, shape_number};
use ash::vk;
use bytemuck::{Pod, Zeroable};

/// Most workgroups along an axis that every device allows.
const MOST_GROUPS: u32 = 65_535;

/// Runs of nodes that one dispatch works on; it has a workgroup for each and each block of samples.
pub(super) fn runs_in_dispatch(nodes: u32, sizes: &Sizes) -> u32 {
    (nodes / sizes.run_nodes + 1).min(MOST_GROUPS / sizes.blocks)
}

/// Words of a tile: two for each pixel and block of samples.
pub(super) fn words_of_tile(blocks: u32) -> u32 {
    TILE_SIZE * TILE_SIZE * 2 * blocks
}

/// `Push` of `shaft_masks/masks.comp`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct Push {
    first_run: u32,
    run: u32,
    further: u32,
}

/// What the tiles are worked on for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Step {
    /// The beginnings of their lists.
    Tiles,
    /// The rest of long lists.
    Further,
    /// Triangles that lists do not know, among the nodes from the given run on.
    Walk(u32),
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
        let mut made = (made, words);
        let runs = self.nodes / self.sizes.run_nodes + 1;
        let in_one = runs_in_dispatch(self.nodes, &self.sizes) as usize;
        let walks = (0..runs).step_by(in_one).map(Step::Walk);
        for step in [Step::Tiles, Step::Further].into_iter().chain(walks) {
            made = self.add_pass(graph, inputs, made, step);
        }
        self.add_resolve(graph, inputs, made)
    }

    fn add_pass(
        &self,
        graph: &mut Graph<'_>,
        inputs: &ShadowInputs<'_>,
        (made, words): (Made, ImageId),
        step: Step,
    ) -> (Made, ImageId) {
        let name = &inputs.light_name;
        let (ids, gbuffer) = (inputs.ids, inputs.gbuffer);
        let (view_params, part) = inputs.view_params;
        let (params, shafts) = (self.params, self.shafts);
        let Lists {
            tiles,
            lists,
            edges,
            triangles,
            further,
            tasks,
            partial,
            ..
        } = self.lists;
        let (arguments, list, what) = match step {
            Step::Tiles => (tiles.arguments, tiles.tiles, "masks"),
            Step::Further => (further, tiles.tiles, "further"),
            Step::Walk(_) => (partial.arguments, partial.tiles, "walk"),
        };
        let label = &self.label;
        let mut pass = graph.pass(format!("{NAME}.{what}{label} {name}"), PassKind::Compute);
        pass.read_part(view_params, part, Access::Uniform(Stage::Compute));
        pass.read(params, Access::Uniform(Stage::Compute));
        let images = [
            gbuffer.view_depth,
            gbuffer.ids,
            ids.triangles,
            ids.hierarchy,
            shafts,
            edges,
            triangles,
            lists,
            tasks,
            ids.triangle_uvs,
            ids.materials,
        ];
        for image in images {
            pass.read(image, Access::StorageRead(Stage::Compute));
        }
        for image in [list, ids.texels] {
            pass.read(image, Access::Sampled(Stage::Compute));
        }
        pass.read(arguments, Access::Indirect);
        pass.read(arguments, Access::Uniform(Stage::Compute));
        let visibility = pass.write(made.visibility, Access::StorageWrite(Stage::Compute));
        let estimates = pass.write(made.estimates, Access::StorageReadWrite(Stage::Compute));
        let words = if step == Step::Tiles {
            pass.overwrite(words, Access::StorageWrite(Stage::Compute))
        } else {
            pass.write(words, Access::StorageReadWrite(Stage::Compute))
        };
        let run = self.sizes.run_nodes;
        let (walk, first_run) = match step {
            Step::Tiles | Step::Further => (0, 0),
            Step::Walk(first_run) => (1, first_run),
        };
        let push = Push {
            first_run,
            run,
            further: u32::from(step == Step::Further),
        };
        let constants = vec![
            (0, shape_number(&inputs.light.shape)),
            (1, walk),
            (3, u32::from(inputs.scene.has_masks())),
            (4, self.sizes.task_entries),
        ];
        pass.record(move |ctx| {
            let nearest = SamplerDesc::nearest();
            let bindings = [
                Bind::uniform(0, view_params).part(part),
                Bind::uniform(1, params),
                Bind::storage_image(2, gbuffer.view_depth),
                Bind::storage_image(3, gbuffer.ids),
                Bind::storage_image(4, ids.triangles),
                Bind::storage_image(5, ids.hierarchy),
                Bind::storage_image(6, ids.materials),
                Bind::storage_image(7, ids.triangle_uvs),
                Bind::sampled(8, ids.texels, nearest),
                Bind::uniform(9, arguments),
                Bind::sampled(10, list, nearest),
                Bind::storage_image(11, shafts),
                Bind::storage_image(12, edges),
                Bind::storage_image(13, lists),
                Bind::storage_image(14, visibility),
                Bind::storage_image(15, tasks),
                Bind::storage_image(16, words),
                Bind::storage_image(17, triangles),
                Bind::storage_image(18, estimates),
            ];
            let pipeline = ComputePipelineDesc {
                constants,
                ..ComputePipelineDesc::new(&spirv::SHAFT_MASKS_MASKS_COMP)
            };
            ctx.bind_compute(&pipeline, &bindings, bytemuck::bytes_of(&push))?;
            ctx.dispatch_indirect(arguments, 0)
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
