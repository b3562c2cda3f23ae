//! Visibility where nothing can block a light: what is above each surface's own horizon.

use super::casters::is_before;
use super::{ShadowInputs, ShadowMask, shape_number};
use crate::gpu::{GraphicsPipelineDesc, SamplerDesc, spirv};
use crate::graph::{Access, Bind, Graph, ImageDesc, Load, PassKind, Stage};
use crate::light::LightShape;
use ash::vk;

/// Why nothing can block a light; `None` if something may.
pub(super) fn why_unblocked(inputs: &ShadowInputs<'_>) -> Option<&'static str> {
    if inputs.casters.contains(&true) {
        return None;
    }
    let before = |hull: &Vec<_>| is_before(&inputs.light, hull);
    Some(if inputs.receivers.is_empty() {
        "no surface is in view"
    } else if !inputs.receivers.iter().any(before) {
        "all that is in view is behind the light"
    } else {
        "nothing can stand between the light and what is in view"
    })
}

/// Declares the pass that takes the place of a technique's, of a light of that shape, and notes why;
/// returns the mask.
pub(super) fn add_unblocked(
    graph: &mut Graph<'_>,
    inputs: &ShadowInputs<'_>,
    technique: &str,
    shape: LightShape,
    reason: &str,
) -> ShadowMask {
    graph.skip(format!("{technique} {}", inputs.light_name), reason);
    let gbuffer = inputs.gbuffer;
    let (view_params, part) = inputs.view_params;
    let [width, height] = inputs.camera.size();
    let desc = ImageDesc::new(vk::Format::R32_SFLOAT, width, height);
    let visibility = graph.create_image(format!("visibility {}", inputs.light_name), desc);
    let name = format!("{technique}.unblocked {}", inputs.light_name);
    // Tiles would cost more than they save.
    let mut pass = graph.pass(name, PassKind::Graphics);
    pass.read_part(view_params, part, Access::Uniform(Stage::Fragment));
    for image in [gbuffer.view_depth, gbuffer.geometric_normal] {
        pass.read(image, Access::Sampled(Stage::Fragment));
    }
    let visibility = pass.color(visibility, Load::Discard);
    pass.record(move |ctx| {
        let nearest = SamplerDesc::nearest();
        let bindings = [
            Bind::uniform(0, view_params).part(part),
            Bind::sampled(1, gbuffer.view_depth, nearest),
            Bind::sampled(2, gbuffer.geometric_normal, nearest),
        ];
        let fragment = Some(&spirv::SHADOW_UNBLOCKED_FRAG);
        let mut pipeline = GraphicsPipelineDesc::new(&spirv::SCREEN_FULLSCREEN_VERT, fragment);
        pipeline.constants = vec![(0, shape_number(&shape))];
        ctx.bind_graphics(pipeline, &bindings, &[])?;
        ctx.draw(0, 3, 1);
        Ok(())
    });
    ShadowMask {
        unblocked: Some(shape),
        ..ShadowMask::new(visibility)
    }
}
