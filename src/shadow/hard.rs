//! Technique `hard`: one shadow map from the light's centre.
//!
//! Every light shape counts as its centre, so there is no penumbra: the baseline that soft
//! techniques are compared with, and the limit they reach when a light shrinks. The map holds
//! triangles beside depths, and a receiver's ray is tested against those around its texel: edges
//! lie where they belong and no bias is needed (`glsl/hard/hard.glsl`).
//!
//! Passes: parameters, one map pass a view, visibility. A light without casters has none of the
//! first two, and its visibility is the part above each receiver's tangent plane.

use super::light_view::{LightView, MAX_LIGHT_VIEWS, light_views};
use super::{ShadowInputs, ShadowMask};
use crate::gpu::{ComputePipelineDesc, SamplerDesc, spirv};
use crate::graph::{Access, Bind, BufferDesc, Graph, ImageDesc, ImagePart, Load, PassKind, Stage};
use crate::renderer::{PixelCamera, draw_ids};
use ash::vk;
use bytemuck::{Pod, Zeroable};

/// Width and height of each map in texels.
pub const MAP_SIZE: u32 = 2048;

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
    let name = &inputs.light_name;
    let light = inputs.light;
    let scene = inputs.scene;
    let views = light_views(&light, &inputs.receivers, &scene.bounds());
    let [width, height] = inputs.camera.size();

    let mut params = HardParams {
        camera: inputs.camera,
        light: if light.shape.is_sun() {
            (-light.direction).extend(0.0).to_array()
        } else {
            light.center.extend(1.0).to_array()
        },
        counts: [views.views.len() as u32, MAP_SIZE, width, height],
        views: Default::default(),
    };
    params.views[..views.views.len()].copy_from_slice(&views.views);

    let buffer = graph.create_buffer(
        format!("hard.params {name}"),
        BufferDesc {
            size: size_of::<HardParams>() as u64,
        },
    );
    let mut pass = graph.pass(format!("hard.params {name}"), PassKind::Transfer);
    let buffer = pass.overwrite(buffer, Access::Clear);
    pass.record(move |ctx| ctx.update_buffer(buffer, 0, bytemuck::bytes_of(&params)));

    // Arrays of at least one layer, so that the shader's bindings always have something: a light
    // without casters has single texels cleared and never read.
    let layers = views.views.len().max(1) as u32;
    let size = if views.views.is_empty() { 1 } else { MAP_SIZE };
    let image = |format| ImageDesc::new(format, size, size).layers(layers);
    let depth = image(vk::Format::D32_SFLOAT);
    let mut map_depth = graph.create_image(format!("hard.map_depth {name}"), depth);
    let numbers = image(vk::Format::R32_UINT);
    let mut map_ids = graph.create_image(format!("hard.map_ids {name}"), numbers);
    for layer in 0..layers {
        let mut pass = graph.pass(format!("hard.map {name}.{layer}"), PassKind::Graphics);
        let part = ImagePart::layer(layer);
        map_ids = pass.color_part(map_ids, part, Load::Clear([0.0; 4]));
        map_depth = pass.depth_part(map_depth, part, Load::Clear([0.0; 4]));
        let Some(matrix) = views.clip_from_scene.get(layer as usize).copied() else {
            continue;
        };
        pass.read(inputs.vertices, Access::Vertex);
        pass.read(inputs.indices, Access::Index);
        let (vertices, indices) = (inputs.vertices, inputs.indices);
        pass.record(move |ctx| draw_ids(ctx, scene, vertices, indices, &matrix));
    }

    let desc = ImageDesc::new(vk::Format::R32_SFLOAT, width, height);
    let visibility = graph.create_image(format!("visibility {name}"), desc);
    let mut pass = graph.pass(format!("hard.visibility {name}"), PassKind::Compute);
    pass.read(buffer, Access::Uniform(Stage::Compute));
    pass.read(inputs.view_depth, Access::Sampled(Stage::Compute));
    pass.read(inputs.geometric_normal, Access::Sampled(Stage::Compute));
    for image in [map_depth, map_ids, inputs.triangles, inputs.ids] {
        pass.read(image, Access::Sampled(Stage::Compute));
    }
    let visibility = pass.overwrite(visibility, Access::StorageWrite(Stage::Compute));
    let (view_depth, geometric_normal) = (inputs.view_depth, inputs.geometric_normal);
    let (triangles, ids) = (inputs.triangles, inputs.ids);
    pass.record(move |ctx| {
        let shader = &spirv::HARD_VISIBILITY_COMP;
        let nearest = SamplerDesc::nearest();
        let bindings = [
            Bind::uniform(0, buffer),
            Bind::sampled(1, view_depth, nearest),
            Bind::sampled(2, geometric_normal, nearest),
            Bind::sampled(3, map_depth, nearest).array(),
            Bind::sampled(4, map_ids, nearest).array(),
            Bind::sampled(5, triangles, nearest),
            Bind::sampled(6, ids, nearest),
            Bind::storage_image(7, visibility),
        ];
        // Four steps of the grid that vertices snap to: SNAP_TEXELS in hard.glsl.
        let steps = ctx.gpu().info().limits.sub_pixel_precision_bits.min(16);
        let snap = 4.0 / (1u32 << steps) as f32;
        let pipeline = ComputePipelineDesc {
            constants: vec![(0, snap.to_bits())],
            ..ComputePipelineDesc::new(shader)
        };
        ctx.bind_compute(&pipeline, &bindings, &[])?;
        ctx.dispatch(shader.groups([width, height, 1]));
        Ok(())
    });
    ShadowMask { visibility }
}
