//! The passes that find each texel's occluding edge.

use super::{NAME, OessParams, ShadowInputs};
use crate::gpu::{ComputePipelineDesc, SamplerDesc, spirv};
use crate::graph::{Access, Bind, Graph, ImageDesc, ImageId, ImagePart, PassKind, Stage};
use crate::shadow::map::ShadowMap;
use ash::vk;
use bytemuck::{Pod, Zeroable};

/// Outreach maps, R32_UINT: `oess/params.glsl`. A layer for each sector and segment.
#[derive(Clone, Copy, Debug)]
pub(super) struct Outreach {
    /// From segments' first ends.
    pub forward: ImageId,
    /// From their last ends.
    pub backward: ImageId,
}

/// Push constants of `oess/outreach.comp`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct OutreachPush {
    shift: f32,
    backward: u32,
    layer: u32,
}

pub(super) fn add_outreach(
    graph: &mut Graph<'_>,
    inputs: &ShadowInputs<'_>,
    maps: &ShadowMap,
    params: &OessParams,
) -> Outreach {
    let [sectors, points, width, height] = params.counts;
    let layers = sectors * (points - 1);
    let name = &inputs.light_name;
    let size = if layers == 0 { [1, 1] } else { [width, height] };
    let depth = maps.depth;
    let mut direction = |backward: bool| {
        let word = if backward { "backward" } else { "forward" };
        let desc = ImageDesc::new(vk::Format::R32_UINT, size[0], size[1]).layers(layers.max(1));
        let mut image = graph.create_image(format!("{NAME}.{word} {name}"), desc);
        // Steps that each row took: for those who ask for the image.
        let steps = ImageDesc::new(vk::Format::R32_UINT, size[1], 1).layers(layers.max(1));
        let mut steps = graph.create_image(format!("{NAME}.{word}_steps {name}"), steps);
        for layer in 0..layers.max(1) {
            let (sector, segment) = (layer / (points - 1), layer % (points - 1));
            let map = sector * points + segment + u32::from(backward);
            let map = ImagePart::layer(if layers == 0 { 0 } else { map });
            let part = ImagePart::layer(layer);
            let pass_name = format!("{NAME}.outreach {name}.{word}.{layer}");
            let mut pass = graph.pass(pass_name, PassKind::Compute);
            pass.read_part(depth, map, Access::Sampled(Stage::Compute));
            // A row reads nothing but what the same invocation wrote.
            image = pass.overwrite_part(image, part, Access::StorageWrite(Stage::Compute));
            steps = pass.overwrite_part(steps, part, Access::StorageWrite(Stage::Compute));
            let (written, counted) = (image, steps);
            let push = OutreachPush {
                shift: params.shift[sector as usize][0],
                backward: u32::from(backward),
                layer,
            };
            pass.record(move |ctx| {
                let shader = &spirv::OESS_OUTREACH_COMP;
                let bindings = [
                    Bind::sampled(0, depth, SamplerDesc::nearest()).part(map),
                    Bind::storage_image(1, written).part(part),
                    Bind::storage_image(2, counted).part(part),
                ];
                let pipeline = ComputePipelineDesc::new(shader);
                ctx.bind_compute(&pipeline, &bindings, bytemuck::bytes_of(&push))?;
                ctx.dispatch(shader.groups([size[1], 1, 1]));
                Ok(())
            });
        }
        image
    };
    Outreach {
        forward: direction(false),
        backward: direction(true),
    }
}
