//! The passes that work on the lists.

use super::{Lists, NAME, ShaftOptions, texels};
use crate::geometry::{TILE_SIZE, tile_counts};
use crate::gpu::{ComputePipelineDesc, SamplerDesc, spirv};
use crate::graph::{Access, Bind, BufferId, Graph, ImageId, PassKind, Stage};
use crate::shadow::{ShadowInputs, shape_number};
use ash::vk;

/// What the passes share.
pub(super) struct Masks {
    pub options: ShaftOptions,
    /// Chunks of a task.
    pub task_chunks: u32,
    pub params: BufferId,
    pub shafts: ImageId,
    pub lists: Lists,
}

impl Masks {
    /// Declares the passes; returns the visibility of all tiles.
    pub(super) fn add(
        &self,
        graph: &mut Graph<'_>,
        inputs: &ShadowInputs<'_>,
        visibility: ImageId,
    ) -> ImageId {
        let name = &inputs.light_name;
        let [across, down] = tile_counts(inputs.camera.size());
        let words = across * down * TILE_SIZE * TILE_SIZE * self.options.side.pow(2) / 32;
        let words = texels(vk::Format::R32_UINT, words);
        let words = graph.create_image(format!("{NAME}.words {name}"), words);
        let (visibility, words) = self.add_pass(graph, inputs, visibility, words, false);
        let (visibility, words) = self.add_pass(graph, inputs, visibility, words, true);
        self.add_resolve(graph, inputs, visibility, words)
    }

    /// Specialization constants of all passes.
    fn constants(&self, inputs: &ShadowInputs<'_>) -> Vec<(u32, u32)> {
        vec![
            (0, shape_number(&inputs.light.shape)),
            (1, self.options.side),
            (2, self.options.side),
            (3, u32::from(inputs.scene.has_masks())),
            (4, self.task_chunks),
        ]
    }

    /// Masks of the tiles, or of the further tasks.
    fn add_pass(
        &self,
        graph: &mut Graph<'_>,
        inputs: &ShadowInputs<'_>,
        visibility: ImageId,
        words: ImageId,
        is_further: bool,
    ) -> (ImageId, ImageId) {
        let name = &inputs.light_name;
        let (ids, gbuffer) = (inputs.ids, inputs.gbuffer);
        let (view_params, part) = inputs.view_params;
        let (params, shafts) = (self.params, self.shafts);
        let Lists {
            tiles,
            pool,
            lists,
            further,
            tasks,
        } = self.lists;
        let arguments = if is_further { further } else { tiles.arguments };
        let step = if is_further { "further" } else { "masks" };
        let mut pass = graph.pass(format!("{NAME}.{step} {name}"), PassKind::Compute);
        pass.read_part(view_params, part, Access::Uniform(Stage::Compute));
        pass.read(params, Access::Uniform(Stage::Compute));
        let images = [
            gbuffer.view_depth,
            gbuffer.ids,
            ids.triangles,
            ids.hierarchy,
            shafts,
            pool,
            lists,
            tasks,
            tiles.tiles,
        ];
        for image in images.into_iter().chain(ids.mask_images()) {
            pass.read(image, Access::Sampled(Stage::Compute));
        }
        pass.read(arguments, Access::Indirect);
        pass.read(arguments, Access::Uniform(Stage::Compute));
        let visibility = pass.write(visibility, Access::StorageWrite(Stage::Compute));
        let words = if is_further {
            pass.write(words, Access::StorageReadWrite(Stage::Compute))
        } else {
            pass.overwrite(words, Access::StorageWrite(Stage::Compute))
        };
        let constants = self.constants(inputs);
        pass.record(move |ctx| {
            let nearest = SamplerDesc::nearest();
            let bindings = [
                Bind::uniform(0, view_params).part(part),
                Bind::uniform(1, params),
                Bind::sampled(2, gbuffer.view_depth, nearest),
                Bind::sampled(3, gbuffer.ids, nearest),
                Bind::sampled(4, ids.triangles, nearest),
                Bind::sampled(5, ids.hierarchy, nearest),
                Bind::sampled(6, ids.materials, nearest),
                Bind::sampled(7, ids.triangle_uvs, nearest),
                Bind::sampled(8, ids.texels, nearest),
                Bind::uniform(9, arguments),
                Bind::sampled(10, tiles.tiles, nearest),
                Bind::sampled(11, shafts, nearest),
                Bind::sampled(12, pool, nearest),
                Bind::sampled(13, lists, nearest),
                Bind::storage_image(14, visibility),
                Bind::sampled(15, tasks, nearest),
                Bind::storage_image(16, words),
            ];
            let pipeline = ComputePipelineDesc {
                constants,
                ..ComputePipelineDesc::new(&spirv::SHAFT_MASKS_MASKS_COMP)
            };
            let push = u32::from(is_further);
            ctx.bind_compute(&pipeline, &bindings, bytemuck::bytes_of(&push))?;
            ctx.dispatch_indirect(arguments, 0)
        });
        (visibility, words)
    }

    fn add_resolve(
        &self,
        graph: &mut Graph<'_>,
        inputs: &ShadowInputs<'_>,
        visibility: ImageId,
        words: ImageId,
    ) -> ImageId {
        let name = &inputs.light_name;
        let params = self.params;
        let Lists {
            lists,
            further,
            tasks,
            ..
        } = self.lists;
        let mut pass = graph.pass(format!("{NAME}.resolve {name}"), PassKind::Compute);
        pass.read(params, Access::Uniform(Stage::Compute));
        pass.read(further, Access::Indirect);
        pass.read(further, Access::Uniform(Stage::Compute));
        for image in [tasks, lists, words] {
            pass.read(image, Access::Sampled(Stage::Compute));
        }
        let visibility = pass.write(visibility, Access::StorageWrite(Stage::Compute));
        let mut constants = self.constants(inputs);
        constants.retain(|(id, _)| matches!(id, 1 | 2 | 4));
        pass.record(move |ctx| {
            let nearest = SamplerDesc::nearest();
            let bindings = [
                Bind::uniform(0, params),
                Bind::uniform(1, further),
                Bind::sampled(2, tasks, nearest),
                Bind::sampled(3, lists, nearest),
                Bind::sampled(4, words, nearest),
                Bind::storage_image(5, visibility),
            ];
            let pipeline = ComputePipelineDesc {
                constants,
                ..ComputePipelineDesc::new(&spirv::SHAFT_MASKS_RESOLVE_COMP)
            };
            ctx.bind_compute(&pipeline, &bindings, &[])?;
            ctx.dispatch_indirect(further, 0)
        });
        visibility
    }
}
