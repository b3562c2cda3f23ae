//! The pass that combines what each pixel sees through the occlusion textures.

use super::options::{Combine, Filter, OcclusionOptions};
use super::prefilter::Filtered;
use super::slices::Slices;
use super::{NAME, ShadowInputs};
use crate::geometry::TileList;
use crate::gpu::{ComputePipelineDesc, SamplerDesc, spirv};
use crate::graph::{Access, Bind, Graph, ImageId, PassKind, Stage};
use crate::shadow::shape_number;
use ash::vk;

pub(super) fn add_visibility<'f>(
    graph: &mut Graph<'f>,
    inputs: &ShadowInputs<'f>,
    options: &OcclusionOptions,
    (slices, filtered): (&Slices, &Filtered),
    (list, visibility): (TileList, ImageId),
    index: usize,
) -> ImageId {
    let name = &inputs.light_name;
    let (slices, filtered) = (*slices, *filtered);
    let gbuffer = inputs.gbuffer;
    let light = inputs.light;
    let (view_params, part) = inputs.view_params;
    let compute = Access::Sampled(Stage::Compute);
    let mut pass = graph.pass(
        format!("{NAME}.visibility {name}.{index}"),
        PassKind::Compute,
    );
    pass.read_part(view_params, part, Access::Uniform(Stage::Compute));
    pass.read(slices.params, Access::Uniform(Stage::Compute));
    pass.read(slices.groups, Access::Uniform(Stage::Compute));
    for image in [
        gbuffer.view_depth,
        gbuffer.geometric_normal,
        filtered.image,
        slices.any,
        slices.bits,
    ] {
        pass.read(image, compute);
    }
    pass.read(slices.planes, Access::Uniform(Stage::Compute));
    list.read(&mut pass);
    let visibility = pass.write(visibility, Access::StorageWrite(Stage::Compute));
    let combine = match options.combine {
        Combine::Product => 0,
        Combine::Sum => 1,
        Combine::Maximum => 2,
        Combine::Thin => 3,
        Combine::Cumulative => 4,
        Combine::Bounded => 5,
    };
    let detail = options.texels_filtered(slices.most_kernel);
    let mut constants = vec![
        (0, shape_number(&light.shape)),
        (1, combine),
        (4, u32::from(index == 0)),
        (5, (detail as f32).to_bits()),
        (7, options.contact),
        (8, options.fine_slices()),
        (12, u32::from(options.count_fetches)),
    ];
    let (shader, sampler) = match options.filter {
        Filter::SummedAreas => {
            constants.extend([(2, u32::from(filtered.packed)), (3, filtered.levels)]);
            let shader = &spirv::OCCLUSION_TEXTURES_VISIBILITY_TABLES_COMP;
            (shader, SamplerDesc::nearest())
        }
        filter => {
            constants.extend([
                (2, u32::from(filter == Filter::Mipmaps)),
                (9, u32::from(filter == Filter::NBuffersLog)),
                (10, filtered.levels),
                (11, options.slices),
            ]);
            let sampler = SamplerDesc {
                mipmap: vk::SamplerMipmapMode::LINEAR,
                ..SamplerDesc::linear()
            };
            (&spirv::OCCLUSION_TEXTURES_VISIBILITY_AVERAGES_COMP, sampler)
        }
    };
    pass.record(move |ctx| {
        let nearest = SamplerDesc::nearest();
        let bindings = [
            Bind::uniform(0, view_params).part(part),
            Bind::uniform(1, slices.params),
            Bind::uniform(2, slices.groups),
            Bind::sampled(3, gbuffer.view_depth, nearest),
            Bind::sampled(4, gbuffer.geometric_normal, nearest),
            Bind::sampled(5, filtered.image, sampler).array(),
            Bind::sampled(6, slices.any, nearest),
            Bind::storage_image(7, visibility),
            Bind::uniform(8, list.arguments),
            Bind::sampled(9, list.tiles, nearest),
            Bind::sampled(10, slices.bits, nearest),
            Bind::uniform(11, slices.planes),
        ];
        let pipeline = ComputePipelineDesc {
            constants,
            ..ComputePipelineDesc::new(shader)
        };
        ctx.bind_compute(&pipeline, &bindings, &[])?;
        list.dispatch(ctx)
    });
    visibility
}
