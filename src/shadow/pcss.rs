//! Techniques `pcf` and `pcss`: percentage-closer filtering of one shadow map.
//!
//! `pcf` (Reeves, Salesin, Cook 1987) averages a neighbourhood of fixed size in the map. `pcss`
//! (Fernando 2005) first looks for blockers in the area that the light covers, and then averages
//! the area that the light covers at their mean distance. Both are what engines have today; here
//! the light has its real size and shape, and depths are compared with the receiver's plane, so
//! neither needs a bias.

use super::light_view::{LightView, MAX_LIGHT_VIEWS, light_views, note_left_out};
use super::map::{MAP_SIZE, add_maps};
use super::receivers::add_receivers;
use super::uniform::add_uniform;
use super::{ShadowInputs, ShadowMask, shape_number};
use crate::geometry::DrawTarget;
use crate::gpu::{ComputePipelineDesc, SamplerDesc, spirv};
use crate::graph::{Access, Bind, Graph, PassKind, Stage};
use crate::light::{AreaLight, LightShape};
use crate::scene::Aabb;
use bytemuck::{Pod, Zeroable};
use glam::Vec3;

/// Options of `pcf` and `pcss`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PcssOptions {
    /// Taps of the filter, 1 to 256.
    pub taps: u32,
    /// Taps of the search for blockers, 1 to 256; `pcf` has none.
    pub search: u32,
    /// Radius of `pcf`'s filter in texels, 0 to 64.
    pub radius: f32,
    /// Turn the taps by a gradient noise from pixel to pixel: noise instead of bands.
    pub rotated: bool,
}

impl PcssOptions {
    /// What `pcss` does without options.
    pub const DEFAULT: Self = Self {
        taps: 32,
        search: 16,
        radius: 2.5,
        rotated: true,
    };
}

/// Uniform block of `pcss/visibility.comp`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct PcssParams {
    /// Number of views, map size in texels, width and height of the picture in pixels.
    pub counts: [u32; 4],
    /// Distance of the nearest blocker looked for along the view direction, metres; radius of a
    /// filter of fixed size in texels.
    pub search: [f32; 4],
    /// The views.
    pub views: [LightView; MAX_LIGHT_VIEWS],
    /// Half axes of the light across each view, metres.
    pub axes: [[f32; 4]; MAX_LIGHT_VIEWS],
}

/// Views reach at most this far beyond the receivers, as the tangent of an angle at the light:
/// blockers outside are missed.
const MOST_MARGIN: f64 = 0.25;

/// Declares the passes of `pcss`, or of `pcf` where `options.search` is 0.
pub(super) fn add_passes<'f>(
    graph: &mut Graph<'f>,
    inputs: &ShadowInputs<'f>,
    technique: &'static str,
    options: PcssOptions,
) -> ShadowMask {
    let name = &inputs.light_name;
    let light = inputs.light;
    let [width, height] = inputs.camera.size();
    let casters = inputs.scene.bounds();
    let nearest = nearest_blocker(&light, inputs.scene.draws().iter().map(|draw| draw.bounds));
    let reach = f64::from(light.shape.reach());
    let margin = if light.shape.is_sun() {
        reach * f64::from(casters.radius())
    } else {
        (reach / nearest).min(MOST_MARGIN)
    };
    let views = light_views(&light, &inputs.receivers, &casters, margin);
    note_left_out(graph, inputs, technique, &views);
    let mut params = PcssParams {
        counts: [views.views.len() as u32, MAP_SIZE, width, height],
        search: [nearest as f32, options.radius, 0.0, 0.0],
        ..PcssParams::default()
    };
    for (index, view) in views.views.iter().enumerate() {
        params.views[index] = *view;
        params.axes[index] = half_axes(&light, view);
        if light.shape.is_sun() {
            // Stored depth 1 is the near end of the view.
            params.search[0] = (1.0 - view.scale[3]) / view.scale[2];
        }
    }

    let buffer = add_uniform(graph, format!("{technique}.params {name}"), params);

    let map = add_maps(
        graph,
        inputs,
        technique,
        &views,
        DrawTarget::Depth,
        MAP_SIZE,
    )
    .depth;
    let receivers = add_receivers(graph, inputs, technique, reach as f32);
    let list = receivers.list;
    let gbuffer = inputs.gbuffer;
    let (view_params, part) = inputs.view_params;
    let compute = Access::Sampled(Stage::Compute);
    let mut pass = graph.pass(format!("{technique}.visibility {name}"), PassKind::Compute);
    pass.read_part(view_params, part, Access::Uniform(Stage::Compute));
    pass.read(buffer, Access::Uniform(Stage::Compute));
    for image in [gbuffer.view_depth, gbuffer.geometric_normal, map] {
        pass.read(image, compute);
    }
    list.read(&mut pass);
    let visibility = pass.write(receivers.visibility, Access::StorageWrite(Stage::Compute));
    pass.record(move |ctx| {
        let nearest = SamplerDesc::nearest();
        let bindings = [
            Bind::uniform(0, view_params).part(part),
            Bind::uniform(1, buffer),
            Bind::sampled(2, gbuffer.view_depth, nearest),
            Bind::sampled(3, gbuffer.geometric_normal, nearest),
            Bind::sampled(4, map, nearest).array(),
            Bind::storage_image(5, visibility),
            Bind::uniform(6, list.arguments),
            Bind::sampled(7, list.tiles, nearest),
        ];
        let steps = ctx.gpu().info().limits.sub_pixel_precision_bits.min(16);
        let snap = 4.0 / (1u32 << steps) as f32;
        let pipeline = ComputePipelineDesc {
            constants: vec![
                (0, shape_number(&light.shape)),
                (1, options.taps),
                (2, options.search),
                (3, snap.to_bits()),
                (4, u32::from(options.rotated)),
            ],
            ..ComputePipelineDesc::new(&spirv::PCSS_VISIBILITY_COMP)
        };
        ctx.bind_compute(&pipeline, &bindings, &[])?;
        list.dispatch(ctx)
    });
    ShadowMask::new(visibility)
}

/// Distance from the light to the nearest box with triangles, but not nearer than the light's own
/// size: a blocker there covers the light from everywhere that the search could tell apart.
pub(super) fn nearest_blocker(light: &AreaLight, boxes: impl Iterator<Item = Aabb>) -> f64 {
    let center = light.center;
    let distance = |b: Aabb| (center.clamp(b.min, b.max) - center).length();
    let nearest = boxes.map(distance).fold(f32::INFINITY, f32::min);
    let least = light.shape.bounding_radius().max(1.0e-6);
    f64::from(if nearest.is_finite() { nearest } else { 0.0 }.max(least))
}

/// The light's half axes in the plane of a view, metres: what the centre of a tap moves by.
fn half_axes(light: &AreaLight, view: &LightView) -> [f32; 4] {
    let axis = |row: [f32; 4]| Vec3::new(row[0], row[1], row[2]);
    let (right, up) = (axis(view.right), axis(view.up));
    let along = |v: Vec3| [v.dot(right), v.dot(up)];
    let ([xx, xy], [yx, yy]) = match light.shape {
        LightShape::Point => ([0.0; 2], [0.0; 2]),
        // Facing the receiver.
        LightShape::Sphere { radius } => ([radius, 0.0], [0.0, radius]),
        LightShape::Sun { .. } => ([light.shape.reach(), 0.0], [0.0, light.shape.reach()]),
        LightShape::Disk { radius } => (along(light.axis_x * radius), along(light.axis_y * radius)),
        LightShape::Rect { width, height } => (
            along(light.axis_x * (0.5 * width)),
            along(light.axis_y * (0.5 * height)),
        ),
        LightShape::Line { length } => (along(light.axis_x * (0.5 * length)), [0.0; 2]),
    };
    [xx, xy, yx, yy]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_blocker_is_that_of_the_boxes() {
        let light = AreaLight::new(
            LightShape::Disk { radius: 0.5 },
            Vec3::new(0.0, 10.0, 0.0),
            Vec3::NEG_Y,
            Vec3::X,
        );
        let at = |y: f32| Aabb {
            min: Vec3::new(-1.0, y - 1.0, -1.0),
            max: Vec3::new(1.0, y, 1.0),
        };
        let nearest = |boxes: &[Aabb]| nearest_blocker(&light, boxes.iter().copied());
        assert!((nearest(&[at(2.0), at(4.0)]) - 6.0).abs() < 1.0e-6);
        assert_eq!(
            nearest(&[at(9.8)]),
            0.5,
            "not nearer than the light is large"
        );
        assert_eq!(nearest(&[]), 0.5);
    }
}
