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

/// Half side of the square that stands for a disk of radius 1: of the same area.
const ROUND_KERNEL: f64 = 0.886_226_925_452_758;

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
        (6, (ROUND_KERNEL as f32).to_bits()),
        (7, options.contact),
        (8, options.fine_slices()),
        (12, u32::from(options.count_fetches)),
        (13, u32::from(options.early)),
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Part of a unit disk beyond a line at this distance from its centre.
    fn disk_beyond(distance: f64) -> f64 {
        let d = distance.clamp(-1.0, 1.0);
        (d.acos() - d * (1.0 - d * d).sqrt()) / std::f64::consts::PI
    }

    /// The same of the square, of which the line's normal is turned by an angle against a side: its
    /// points' distances are the sum of two even distributions.
    fn square_beyond(distance: f64, angle: f64) -> f64 {
        let (sine, cosine) = angle.sin_cos();
        let (wide, narrow) = (ROUND_KERNEL * cosine, ROUND_KERNEL * sine);
        let integral = |x: f64| 0.5 * x.max(0.0).powi(2);
        if narrow < 1.0e-9 {
            return ((wide - distance) / (2.0 * wide)).clamp(0.0, 1.0);
        }
        let sum = integral(wide + narrow - distance)
            - integral(wide - narrow - distance)
            - integral(narrow - wide - distance)
            + integral(-wide - narrow - distance);
        sum / (4.0 * wide * narrow)
    }

    #[test]
    fn a_square_for_a_disk_is_wrong_by_little() {
        let (mut most, mut squares, mut count) = (0.0_f64, 0.0, 0);
        for turn in 0..=32 {
            let angle = f64::from(turn) / 32.0 * std::f64::consts::FRAC_PI_4;
            for step in -500..=500 {
                let distance = f64::from(step) / 500.0;
                let truth = disk_beyond(distance);
                let error = square_beyond(distance, angle) - truth;
                most = most.max(error.abs());
                if (0.005..=0.995).contains(&truth) {
                    squares += error * error;
                    count += 1;
                }
            }
        }
        let rms = (squares / f64::from(count)).sqrt();
        println!("square for a disk, edges of all directions: rms {rms:.4}, most {most:.4}");
        assert!((0.010..0.013).contains(&rms), "{rms}");
        assert!((0.020..0.025).contains(&most), "{most}");
    }
}
