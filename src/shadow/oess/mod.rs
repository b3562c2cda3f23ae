//! Technique `oess`: Occluding Edges Soft Shadows of line lights (C. L. Reimann, B. Dreier).
//!
//! Both ends of the line get a shadow map, with the images' x axis along the line: a row is one plane
//! through the light, and in that plane shadows are a matter of two dimensions. An occluding edge
//! divides the line into a part that is seen and one that is not.
//!
//! Published are edges found from neighbouring texels of one row, and written to all texels of the
//! penumbra that begins there. Here the edge of a texel is the tangent from its surface to the hull
//! of its row, which is the exact one for all that the end sees, and a scan along the row finds it
//! in linear time (`glsl/oess/outreach.comp`). A receiver then looks at the triangle at its edge, so
//! that neither texels nor rows show (`glsl/oess/oess.glsl`).
//!
//! | pass | makes |
//! |---|---|
//! | `params` | views |
//! | `map` | depths and triangles seen from each end |
//! | `outreach` | each texel's occluding edge, and where its surface ends |
//! | `start`, `tiles` | the picture's tiles that need work |
//! | `visibility` | visibility, and the influence of both ends |

mod options;
mod outreach;
mod views;

pub use options::{Find, OessOptions, Outreach};

use super::light_view::LightView;
use super::map::{ShadowMap, add_maps_of_size};
use super::receivers::add_receivers;
use super::{ShadowInputs, ShadowMask, hard};
use crate::geometry::DrawTarget;
use crate::gpu::{ComputePipelineDesc, SamplerDesc, spirv};
use crate::graph::{Access, Bind, BufferDesc, BufferId, Graph, ImageDesc, PassKind, Stage};
use crate::light::{AreaLight, LightProfile, LightShape, MAX_PROFILE, ShapeKind};
use ash::vk;
use bytemuck::{Pod, Zeroable};
use views::{LineViews, MOST_SECTORS, line_views};

/// The technique's name.
pub(super) const NAME: &str = "oess";

/// Light shapes that it can do.
pub(super) const SHAPES: &[ShapeKind] = &[ShapeKind::Line, ShapeKind::Point];

/// Most points of a line that have a map.
const MOST_POINTS: usize = 5;

/// `OessParams` in `oess/params.glsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct OessParams {
    start: [f32; 4],
    axis: [f32; 4],
    counts: [u32; 4],
    shift: [[f32; 4]; MOST_SECTORS],
    profile: [[f32; 4]; MAX_PROFILE],
    views: [LightView; MOST_SECTORS * MOST_POINTS],
}

/// A line whose length is a smaller part than this of the distance to what it lights is a point: no
/// texel of a map could tell its ends apart.
const SHORTEST: f32 = 1.0e-5;

/// Declares the passes.
pub(super) fn add_passes<'f>(
    graph: &mut Graph<'f>,
    inputs: &ShadowInputs<'f>,
    options: OessOptions,
) -> ShadowMask {
    let length = match inputs.light.shape {
        LightShape::Line { length } => length,
        _ => 0.0,
    };
    if length <= SHORTEST * farthest_receiver(inputs) {
        return hard::add_passes(graph, inputs);
    }
    let points = options.segments as usize + 1;
    let boxes = inputs.scene.draws().iter().map(|draw| draw.bounds);
    let boxes: Vec<_> = boxes.collect();
    let views = line_views(&inputs.light, &inputs.receivers, &boxes, points);
    let params = params_of(&inputs.light, &views, &options, length);
    let buffer = add_params(graph, inputs, params);
    let maps = add_maps_of_size(
        graph,
        inputs,
        NAME,
        &views.views,
        DrawTarget::Ids,
        options.resolution,
    );
    let outreach = outreach::add_outreach(graph, inputs, &options, &maps, &params);
    add_visibility(graph, inputs, &options, buffer, &maps, outreach)
}

fn farthest_receiver(inputs: &ShadowInputs<'_>) -> f32 {
    let center = inputs.light.center.as_dvec3();
    let points = inputs.receivers.iter().flatten();
    points.map(|p| p.distance(center)).fold(0.0, f64::max) as f32
}

fn params_of(
    light: &AreaLight,
    views: &LineViews,
    options: &OessOptions,
    length: f32,
) -> OessParams {
    let segments = options.segments;
    let points = segments as usize + 1;
    let segment = length / segments as f32;
    let start = light.center - light.axis_x * (0.5 * length);
    let (cells, profile) = profile_of(&light.profile);
    let mut params = OessParams {
        start: start.extend(segment).to_array(),
        axis: light.axis_x.extend(cells as f32).to_array(),
        counts: [
            views.sectors as u32,
            points as u32,
            options.resolution,
            options.resolution,
        ],
        shift: [[0.0; 4]; MOST_SECTORS],
        profile,
        views: [LightView::default(); MOST_SECTORS * MOST_POINTS],
    };
    for (layer, view) in views.views.views.iter().enumerate() {
        params.views[layer] = *view;
        // A point at depth z moves by segment / z; the map holds scale.z / z.
        let texels = segment * view.scale[0] * options.resolution as f32;
        params.shift[layer / points] = [texels / view.scale[2], 0.0, 0.0, 0.0];
    }
    params
}

/// `profile` in `oess/params.glsl`, and the number of its cells: 0 for an even light.
fn profile_of(profile: &LightProfile) -> (usize, [[f32; 4]; MAX_PROFILE]) {
    let mut cells = [[0.0; 4]; MAX_PROFILE];
    if profile.is_even() {
        return (0, cells);
    }
    let values: Vec<f64> = profile.values().iter().map(|v| f64::from(*v)).collect();
    let count = values.len() - 1;
    let width = 1.0 / count as f64;
    let whole: f64 = values.windows(2).map(|v| 0.5 * width * (v[0] + v[1])).sum();
    let (mut before, mut moment) = (0.0, 0.0);
    for (i, pair) in values.windows(2).enumerate() {
        let (a, rise) = (pair[0] / whole, (pair[1] - pair[0]) / whole);
        cells[i] = [a, rise, before, moment].map(|v| v as f32);
        before += width * (a + 0.5 * rise);
        let inner = 0.5 * a + rise / 3.0;
        moment += width * width * (i as f64 * (a + 0.5 * rise) + inner);
    }
    (count, cells)
}

fn add_params(graph: &mut Graph<'_>, inputs: &ShadowInputs<'_>, params: OessParams) -> BufferId {
    let name = &inputs.light_name;
    let size = size_of::<OessParams>() as u64;
    let buffer = graph.create_buffer(format!("{NAME}.params {name}"), BufferDesc { size });
    let mut pass = graph.pass(format!("{NAME}.params {name}"), PassKind::Transfer);
    let buffer = pass.overwrite(buffer, Access::Clear);
    pass.record(move |ctx| ctx.update_buffer(buffer, 0, bytemuck::bytes_of(&params)));
    buffer
}

fn add_visibility<'f>(
    graph: &mut Graph<'f>,
    inputs: &ShadowInputs<'f>,
    options: &OessOptions,
    params: BufferId,
    maps: &ShadowMap,
    outreach: outreach::OutreachMaps,
) -> ShadowMask {
    let name = &inputs.light_name;
    let receivers = add_receivers(graph, inputs, NAME, inputs.light.shape.bounding_radius());
    let list = receivers.list;
    let ShadowMap {
        depth: map_depth,
        ids: Some(map_ids),
    } = *maps
    else {
        unreachable!("triangle numbers were asked for");
    };
    let [width, height] = inputs.camera.size();
    let desc = ImageDesc::new(vk::Format::R32G32_SFLOAT, width, height);
    let influences = graph.create_image(format!("{NAME}.influences {name}"), desc);
    let (gbuffer, ids) = (inputs.gbuffer, inputs.ids);
    let (view_params, part) = inputs.view_params;
    let compute = Access::Sampled(Stage::Compute);
    let mut pass = graph.pass(format!("{NAME}.visibility {name}"), PassKind::Compute);
    pass.read_part(view_params, part, Access::Uniform(Stage::Compute));
    pass.read(params, Access::Uniform(Stage::Compute));
    let images = [
        gbuffer.view_depth,
        gbuffer.geometric_normal,
        gbuffer.ids,
        map_depth,
        map_ids,
        outreach.forward,
        outreach.backward,
        ids.triangles,
    ];
    for image in images.into_iter().chain(ids.mask_images()) {
        pass.read(image, compute);
    }
    list.read(&mut pass);
    let visibility = pass.write(receivers.visibility, Access::StorageWrite(Stage::Compute));
    let influences = pass.overwrite(influences, Access::StorageWrite(Stage::Compute));
    let masked = u32::from(inputs.scene.has_masks());
    let options = *options;
    pass.record(move |ctx| {
        let nearest = SamplerDesc::nearest();
        let bindings = [
            Bind::uniform(0, view_params).part(part),
            Bind::uniform(1, params),
            Bind::sampled(2, gbuffer.view_depth, nearest),
            Bind::sampled(3, gbuffer.geometric_normal, nearest),
            Bind::sampled(4, gbuffer.ids, nearest),
            Bind::sampled(5, map_depth, nearest).array(),
            Bind::sampled(6, map_ids, nearest).array(),
            Bind::sampled(7, outreach.forward, nearest).array(),
            Bind::sampled(8, outreach.backward, nearest).array(),
            Bind::sampled(9, ids.triangles, nearest),
            Bind::sampled(10, ids.materials, nearest),
            Bind::sampled(11, ids.triangle_uvs, nearest),
            Bind::sampled(12, ids.texels, nearest),
            Bind::storage_image(13, visibility),
            Bind::uniform(14, list.arguments),
            Bind::sampled(15, list.tiles, nearest),
            Bind::storage_image(16, influences),
        ];
        // Four steps of the grid that vertices snap to: SNAP_TEXELS in hard.glsl.
        let steps = ctx.gpu().info().limits.sub_pixel_precision_bits.min(16);
        let snap = 4.0 / (1u32 << steps) as f32;
        let pipeline = ComputePipelineDesc {
            constants: vec![
                (0, snap.to_bits()),
                (1, masked),
                (2, u32::from(options.exact)),
                (3, options.walk),
                (4, u32::from(options.gaps)),
                (5, u32::from(options.outreach != Outreach::Hull)),
                (6, u32::from(options.by_place)),
            ],
            ..ComputePipelineDesc::new(&spirv::OESS_VISIBILITY_COMP)
        };
        ctx.bind_compute(&pipeline, &bindings, &[])?;
        list.dispatch(ctx)
    });
    ShadowMask::new(visibility)
}
