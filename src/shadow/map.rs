//! Maps of what a light's centre sees, of all that can block it.

use super::ShadowInputs;
use super::light_view::LightViews;
use crate::geometry::{DrawTarget, draw_part, read_for_draw};
use crate::graph::{Graph, ImageDesc, ImageId, ImagePart, Load, PassKind};
use ash::vk;
use std::rc::Rc;

/// Width and height of each map in texels.
pub const MAP_SIZE: u32 = 2048;

/// One layer for each view of a light, and at least one.
#[derive(Clone, Copy, Debug)]
pub(super) struct ShadowMap {
    /// D32: reversed depth, 0 where nothing was seen.
    pub depth: ImageId,
    /// R32_UINT: one more than the number of the triangle seen, if asked for.
    pub ids: Option<ImageId>,
}

/// Declares one pass for each view, of this width and height in texels. A light without views gets
/// single texels that are cleared and never read, so that shaders have something bound.
pub(super) fn add_maps<'f>(
    graph: &mut Graph<'f>,
    inputs: &ShadowInputs<'f>,
    technique: &str,
    views: &LightViews,
    target: DrawTarget,
    size: u32,
) -> ShadowMap {
    let casters = Rc::clone(&inputs.casters);
    add_maps_of(graph, inputs, technique, views, target, (size, casters))
}

/// As [`add_maps`], of those of the scene's draws that are asked for.
pub(super) fn add_maps_of<'f>(
    graph: &mut Graph<'f>,
    inputs: &ShadowInputs<'f>,
    technique: &str,
    views: &LightViews,
    target: DrawTarget,
    (size, draws): (u32, Rc<[bool]>),
) -> ShadowMap {
    let name = &inputs.light_name;
    let layers = views.views.len().max(1) as u32;
    let side = if views.views.is_empty() { 1 } else { size };
    let image = |format| ImageDesc::new(format, side, side).layers(layers);
    let depth = image(vk::Format::D32_SFLOAT);
    let mut depth = graph.create_image(format!("{technique}.map_depth {name}"), depth);
    let numbers = image(vk::Format::R32_UINT);
    let mut ids = (target == DrawTarget::Ids)
        .then(|| graph.create_image(format!("{technique}.map_ids {name}"), numbers));
    let scene = inputs.scene;
    for layer in 0..layers {
        let mut pass = graph.pass(
            format!("{technique}.map {name}.{layer}"),
            PassKind::Graphics,
        );
        let part = ImagePart::layer(layer);
        ids = ids.map(|ids| pass.color_part(ids, part, Load::Clear([0.0; 4])));
        depth = pass.depth_part(depth, part, Load::Clear([0.0; 4]));
        let Some(matrix) = views.clip_from_scene.get(layer as usize).copied() else {
            continue;
        };
        read_for_draw(&mut pass, scene, &inputs.ids);
        let scene_ids = inputs.ids;
        let draws = Rc::clone(&draws);
        pass.record(move |ctx| {
            let keep = |draw: usize| draws[draw];
            draw_part(ctx, scene, &scene_ids, &matrix, target, keep)
        });
    }
    ShadowMap { depth, ids }
}
