//! Walks of pixels, for tiles whose triangles are on no list.

use super::masks::Masks;
use super::{Lists, NAME, PARTS, Sizes, samples, texels};
use crate::geometry::tile_counts;
use crate::gpu::{ComputePipelineDesc, SamplerDesc, spirv};
use crate::graph::{Access, Bind, BufferDesc, BufferId, Graph, ImageId, PassKind, Stage};
use crate::shadow::{ShadowInputs, shape_number};
use ash::vk;
use bytemuck::{Pod, Zeroable};

/// Most workgroups along an axis that every device allows.
const MOST_GROUPS: u32 = 65_535;

/// `Push` of `shaft_masks/pixels.comp`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct Push {
    first_run: u32,
    run: u32,
}

/// What walks look at.
#[derive(Clone, Copy, Debug)]
enum Walk {
    /// All nodes, as far as they come.
    Begin,
    /// Nodes that they did not come to, from the given run on.
    Rest(u32),
}

/// Tiles with pixels whose walks did not come to their ends.
#[derive(Clone, Copy, Debug)]
pub(super) struct WalkRest {
    /// Of a dispatch over the tiles and runs of nodes.
    pub arguments: BufferId,
    /// RGBA32_UINT: tile, node to go on with.
    tiles: ImageId,
}

impl WalkRest {
    /// Nothing is in it yet. `label`: added to its name.
    pub(super) fn create(graph: &mut Graph<'_>, inputs: &ShadowInputs<'_>, label: &str) -> Self {
        let name = format!("{NAME}.walk_rest{label} {}", inputs.light_name);
        let [across, down] = tile_counts(inputs.camera.size());
        let tiles = texels(vk::Format::R32G32B32A32_UINT, across * down * PARTS);
        Self {
            arguments: graph.create_buffer(format!("{name}.arguments"), BufferDesc { size: 16 }),
            tiles: graph.create_image(format!("{name}.list"), tiles),
        }
    }
}

/// Runs of nodes that one dispatch works on; it has a workgroup for each and each block of samples.
pub(super) fn runs_in_dispatch(nodes: u32, sizes: &Sizes) -> u32 {
    (nodes / sizes.run_nodes + 1).min(MOST_GROUPS / sizes.blocks)
}

impl Masks {
    /// Declares the passes that add to the words what triangles hide that lists do not know.
    pub(super) fn add_walks(
        &self,
        graph: &mut Graph<'_>,
        inputs: &ShadowInputs<'_>,
        mut words: ImageId,
    ) -> ImageId {
        let mut lists = self.lists;
        let runs = self.nodes / self.sizes.run_nodes + 1;
        let in_one = runs_in_dispatch(self.nodes, &self.sizes) as usize;
        let rest = (0..runs).step_by(in_one).map(Walk::Rest);
        for walk in [Walk::Begin].into_iter().chain(rest) {
            words = self.add_walk(graph, inputs, &mut lists, words, walk);
        }
        words
    }

    fn add_walk(
        &self,
        graph: &mut Graph<'_>,
        inputs: &ShadowInputs<'_>,
        made: &mut Lists,
        words: ImageId,
        walk: Walk,
    ) -> ImageId {
        let name = &inputs.light_name;
        let (ids, gbuffer) = (inputs.ids, inputs.gbuffer);
        let (view_params, part) = inputs.view_params;
        let (params, shafts) = (self.params, self.shafts);
        let Lists {
            lists,
            partial,
            walk_rest,
            ..
        } = *made;
        let (what, arguments, is_rest, first_run) = match walk {
            Walk::Begin => ("walk", partial.arguments, false, 0),
            Walk::Rest(first_run) => ("walk_rest", walk_rest.arguments, true, first_run),
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
            ids.materials,
            ids.triangle_uvs,
            ids.footprints,
            shafts,
            lists,
        ];
        for image in images {
            pass.read(image, Access::StorageRead(Stage::Compute));
        }
        pass.read(partial.tiles, Access::Sampled(Stage::Compute));
        pass.read(arguments, Access::Indirect);
        pass.read(arguments, Access::Uniform(Stage::Compute));
        let words = pass.write(words, Access::StorageReadWrite(Stage::Compute));
        // The rest lists nothing, but the shader may, for all that is known of it.
        let written = Access::StorageReadWrite(Stage::Compute);
        let found = if is_rest {
            made.partial.arguments = pass.write(partial.arguments, written);
            made.walk_rest.tiles = pass.write(walk_rest.tiles, written);
            made.partial.arguments
        } else {
            made.walk_rest.arguments = pass.write(walk_rest.arguments, written);
            made.walk_rest.tiles =
                pass.overwrite(walk_rest.tiles, Access::StorageWrite(Stage::Compute));
            made.walk_rest.arguments
        };
        let found_tiles = made.walk_rest.tiles;
        let push = Push {
            first_run,
            run: self.sizes.run_nodes,
        };
        let constants = vec![
            (0, shape_number(&inputs.light.shape)),
            (1, u32::from(is_rest)),
            (3, u32::from(inputs.scene.has_masks())),
            (8, u32::from(samples::is_small_sun(&inputs.light.shape))),
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
                Bind::storage_image(8, ids.footprints),
                Bind::uniform(9, arguments),
                Bind::sampled(10, partial.tiles, nearest),
                Bind::storage_image(11, shafts),
                Bind::storage_image(12, lists),
                Bind::storage_image(13, words),
                Bind::storage_buffer(14, found),
                Bind::storage_image(15, found_tiles),
            ];
            let pipeline = ComputePipelineDesc {
                constants,
                ..ComputePipelineDesc::new(&spirv::SHAFT_MASKS_PIXELS_COMP)
            };
            ctx.bind_compute(&pipeline, &bindings, bytemuck::bytes_of(&push))?;
            ctx.dispatch_indirect(arguments, 0)
        });
        words
    }
}
