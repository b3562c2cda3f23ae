//! The passes that bound the error.

use super::NAME;
use super::masks::Masks;
use crate::gpu::{ComputePipelineDesc, SamplerDesc, spirv};
use crate::graph::{Access, Bind, Graph, ImageDesc, ImageId, PassKind, Stage};
use crate::shadow::{ShadowInputs, shape_number};
use ash::vk;

/// Declares an R32F image of the picture's size for the most that each pixel's visibility is off,
/// 0 to 1, but for rounding. Nothing is made of it where nobody reads it.
pub(super) fn no_bound(graph: &mut Graph<'_>, inputs: &ShadowInputs<'_>) -> ImageId {
    let name = &inputs.light_name;
    let [width, height] = inputs.camera.size();
    let desc = ImageDesc::new(vk::Format::R32_SFLOAT, width, height);
    let bound = graph.create_image(format!("visibility bound {name}"), desc);
    // Of tiles that are settled without masks all is known.
    let mut pass = graph.pass(format!("{NAME}.no_bound {name}"), PassKind::Transfer);
    let bound = pass.overwrite(bound, Access::Clear);
    pass.record(move |ctx| ctx.clear_image(bound, [0.0; 4]));
    bound
}

impl Masks {
    /// Declares the pass that fills in the bound of those tiles that these masks are the last of;
    /// returns it with the estimates.
    pub(super) fn add_bound(
        &self,
        graph: &mut Graph<'_>,
        inputs: &ShadowInputs<'_>,
        bound: ImageId,
        estimates: ImageId,
    ) -> (ImageId, ImageId) {
        let (name, label) = (&inputs.light_name, &self.label);
        let (ids, gbuffer) = (inputs.ids, inputs.gbuffer);
        let (view_params, part) = inputs.view_params;
        let (params, shafts, lists) = (self.params, self.shafts, self.lists);
        let tiles = lists.tiles;
        let mut pass = graph.pass(format!("{NAME}.bound{label} {name}"), PassKind::Compute);
        pass.read_part(view_params, part, Access::Uniform(Stage::Compute));
        pass.read(params, Access::Uniform(Stage::Compute));
        let images = [
            gbuffer.view_depth,
            gbuffer.ids,
            ids.triangles,
            shafts,
            lists.edges,
            lists.triangles,
            lists.lists,
        ];
        for image in images {
            pass.read(image, Access::StorageRead(Stage::Compute));
        }
        tiles.read(&mut pass);
        let bound = pass.write(bound, Access::StorageWrite(Stage::Compute));
        let estimates = pass.write(estimates, Access::StorageReadWrite(Stage::Compute));
        let constants = vec![
            (0, shape_number(&inputs.light.shape)),
            (3, u32::from(inputs.scene.has_masks())),
        ];
        pass.record(move |ctx| {
            let nearest = SamplerDesc::nearest();
            let bindings = [
                Bind::uniform(0, view_params).part(part),
                Bind::uniform(1, params),
                Bind::storage_image(2, gbuffer.view_depth),
                Bind::storage_image(3, gbuffer.ids),
                Bind::storage_image(4, ids.triangles),
                Bind::uniform(5, tiles.arguments),
                Bind::sampled(6, tiles.tiles, nearest),
                Bind::storage_image(7, shafts),
                Bind::storage_image(8, lists.edges),
                Bind::storage_image(9, lists.triangles),
                Bind::storage_image(10, lists.lists),
                Bind::storage_image(11, bound),
                Bind::storage_image(12, estimates),
            ];
            let pipeline = ComputePipelineDesc {
                constants,
                ..ComputePipelineDesc::new(&spirv::SHAFT_MASKS_BOUND_COMP)
            };
            ctx.bind_compute(&pipeline, &bindings, &[])?;
            tiles.dispatch(ctx)
        });
        (bound, estimates)
    }
}
