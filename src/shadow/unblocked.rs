//! Visibility where nothing can block a light: what is above each surface's own horizon.

use super::receivers::add_receivers;
use super::{ShadowInputs, shape_number};
use crate::gpu::{ComputePipelineDesc, SamplerDesc, spirv};
use crate::graph::{Access, Bind, Graph, ImageId, PassKind, Stage};

/// Declares the passes; returns the R32F image of visibility.
pub(super) fn add_unblocked(
    graph: &mut Graph<'_>,
    inputs: &ShadowInputs<'_>,
    technique: &str,
) -> ImageId {
    let receivers = add_receivers(graph, inputs, technique, inputs.light.shape.reach());
    let list = receivers.list;
    let gbuffer = inputs.gbuffer;
    let (view_params, part) = inputs.view_params;
    let name = format!("{technique}.unblocked {}", inputs.light_name);
    let mut pass = graph.pass(name, PassKind::Compute);
    pass.read_part(view_params, part, Access::Uniform(Stage::Compute));
    for image in [gbuffer.view_depth, gbuffer.geometric_normal] {
        pass.read(image, Access::Sampled(Stage::Compute));
    }
    list.read(&mut pass);
    let visibility = pass.write(receivers.visibility, Access::StorageWrite(Stage::Compute));
    let constants = vec![(0, shape_number(&inputs.light.shape))];
    pass.record(move |ctx| {
        let nearest = SamplerDesc::nearest();
        let bindings = [
            Bind::uniform(0, view_params).part(part),
            Bind::sampled(1, gbuffer.view_depth, nearest),
            Bind::sampled(2, gbuffer.geometric_normal, nearest),
            Bind::uniform(3, list.arguments),
            Bind::sampled(4, list.tiles, nearest),
            Bind::storage_image(5, visibility),
        ];
        let pipeline = ComputePipelineDesc {
            constants,
            ..ComputePipelineDesc::new(&spirv::SHADOW_UNBLOCKED_COMP)
        };
        ctx.bind_compute(&pipeline, &bindings, &[])?;
        list.dispatch(ctx)
    });
    visibility
}
