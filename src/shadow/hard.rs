//! Technique `hard`: one shadow map from the light's centre.
//!
//! Every light shape counts as its centre, so there is no penumbra: the baseline that soft
//! techniques are compared with, and the limit they reach when a light shrinks. The map holds
//! triangles beside depths, and a receiver's ray is tested against those around its texel: edges
//! lie where they belong and no bias is needed (`glsl/hard/hard.glsl`).
//!
//! Passes: parameters, one map pass a view, tiles, visibility. Tiles that see nothing or are turned
//! away from the light are settled without a look at the map.

use super::light_view::{LightView, MAX_LIGHT_VIEWS, light_views, note_left_out};
use super::map::{MAP_SIZE, ShadowMap, add_maps};
use super::receivers::add_receivers_in;
use super::uniform::add_uniform;
use super::{ShadowInputs, ShadowMask};
use crate::geometry::{DrawTarget, PixelCamera};
use crate::gpu::{ComputePipelineDesc, SamplerDesc, spirv};
use crate::graph::{Access, Bind, Graph, ImageId, PassKind, Stage};
use bytemuck::{Pod, Zeroable};

/// Uniform block of `hard/visibility.comp`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct HardParams {
    /// Camera of the picture.
    pub camera: PixelCamera,
    /// Centre, or the unit vector towards a sun; w: 1 or 0.
    pub light: [f32; 4],
    /// Number of views, map size in texels, width and height of the picture in pixels.
    pub counts: [u32; 4],
    /// The views.
    pub views: [LightView; MAX_LIGHT_VIEWS],
}

pub(super) fn add_passes<'f>(graph: &mut Graph<'f>, inputs: &ShadowInputs<'f>) -> ShadowMask {
    let image = format!("visibility {}", inputs.light_name);
    ShadowMask::new(add_hard(graph, inputs, "hard", image))
}

/// As `hard` does, with a map of another width and height in texels.
pub(super) fn add_passes_at<'f>(
    graph: &mut Graph<'f>,
    inputs: &ShadowInputs<'f>,
    texels: u32,
) -> ShadowMask {
    let image = format!("visibility {}", inputs.light_name);
    ShadowMask::new(add_hard_at(graph, inputs, "hard", image, texels))
}

/// Declares the passes under another technique's name; returns the R32F image, of the given name, of
/// what sees the light's centre: 1 or 0.
pub(super) fn add_hard<'f>(
    graph: &mut Graph<'f>,
    inputs: &ShadowInputs<'f>,
    technique: &str,
    image: String,
) -> ImageId {
    add_hard_at(graph, inputs, technique, image, MAP_SIZE)
}

/// As [`add_hard`], with the map's width and height in texels.
pub(super) fn add_hard_at<'f>(
    graph: &mut Graph<'f>,
    inputs: &ShadowInputs<'f>,
    technique: &str,
    image: String,
    texels: u32,
) -> ImageId {
    let name = &inputs.light_name;
    let light = inputs.light;
    let scene = inputs.scene;
    let views = light_views(&light, &inputs.receivers, &scene.bounds(), 0.0);
    note_left_out(graph, inputs, technique, &views);
    let [width, height] = inputs.camera.size();

    let mut params = HardParams {
        camera: inputs.camera,
        light: if light.shape.is_sun() {
            (-light.direction).extend(0.0).to_array()
        } else {
            light.center.extend(1.0).to_array()
        },
        counts: [views.views.len() as u32, texels, width, height],
        views: Default::default(),
    };
    params.views[..views.views.len()].copy_from_slice(&views.views);

    let buffer = add_uniform(graph, format!("{technique}.params {name}"), params);

    let maps = add_maps(graph, inputs, technique, &views, DrawTarget::Ids, texels);
    let receivers = add_receivers_in(graph, inputs, technique, 0.0, image);
    let ShadowMap {
        depth: map_depth,
        ids: Some(map_ids),
    } = maps
    else {
        unreachable!("triangle numbers were asked for");
    };
    let list = receivers.list;
    let nearest = SamplerDesc::nearest();
    let compute = Access::Sampled(Stage::Compute);
    let (gbuffer, ids) = (inputs.gbuffer, inputs.ids);
    let mut pass = graph.pass(format!("{technique}.visibility {name}"), PassKind::Compute);
    pass.read(buffer, Access::Uniform(Stage::Compute));
    for image in [gbuffer.view_depth, gbuffer.geometric_normal, gbuffer.ids] {
        pass.read(image, compute);
    }
    for image in [map_depth, map_ids, ids.triangles] {
        pass.read(image, compute);
    }
    for image in ids.mask_images() {
        pass.read(image, compute);
    }
    list.read(&mut pass);
    let visibility = pass.write(receivers.visibility, Access::StorageWrite(Stage::Compute));
    let masked = u32::from(scene.has_masks());
    pass.record(move |ctx| {
        let bindings = [
            Bind::uniform(0, buffer),
            Bind::sampled(1, gbuffer.view_depth, nearest),
            Bind::sampled(2, gbuffer.geometric_normal, nearest),
            Bind::sampled(3, map_depth, nearest).array(),
            Bind::sampled(4, map_ids, nearest).array(),
            Bind::sampled(5, ids.triangles, nearest),
            Bind::sampled(6, gbuffer.ids, nearest),
            Bind::storage_image(7, visibility),
            Bind::uniform(8, list.arguments),
            Bind::sampled(9, list.tiles, nearest),
            Bind::sampled(10, ids.materials, nearest),
            Bind::sampled(11, ids.triangle_uvs, nearest),
            Bind::sampled(12, ids.footprints, nearest),
        ];
        // Four steps of the grid that vertices snap to: SNAP_TEXELS in hard.glsl.
        let steps = ctx.gpu().info().limits.sub_pixel_precision_bits.min(16);
        let snap = 4.0 / (1u32 << steps) as f32;
        let pipeline = ComputePipelineDesc {
            constants: vec![(0, snap.to_bits()), (1, masked)],
            ..ComputePipelineDesc::new(&spirv::HARD_VISIBILITY_COMP)
        };
        ctx.bind_compute(&pipeline, &bindings, &[])?;
        list.dispatch(ctx)
    });
    visibility
}
