//! Technique `oess`: Occluding Edges Soft Shadows of line lights (C. L. Reimann, B. Dreier).
//!
//! A receiver and the line span a plane, and in that plane shadows are a matter of two dimensions. An
//! occluding edge divides the line into a part that is seen and one that is not.
//!
//! Published are edges found in shadow maps of both ends, whose x axis is along the line, so that a row is
//! one such plane; as future work, edges of the mesh instead of pixels. That is what is done by default: each
//! tile of the picture lists the silhouettes between its surfaces and the line ([`super::dbuffer`] has the
//! lists), and each receiver takes those that its plane cuts (`glsl/oess/silhouettes.comp`). There are no
//! texels, rows, candidates or segments then, and nothing hides between the ends.
//!
//! | pass | makes |
//! |---|---|
//! | `map`, `visibility` of `oess.hard` | what sees the line's centre |
//! | `silhouettes.*`, `boxes`, `start`, `tiles`, `shafts`, `lists`, `through`, `settle` | the edges of each tile: [`super::dbuffer`] |
//! | `turns` | where edges lie around the line |
//! | `spans` | which turn around it each edge of a tile's list takes up |
//! | `visibility` | visibility of tiles with edges |
//!
//! With the option `outreach=hull`, and where triangles have holes, edges come from maps of the ends. The edge of a
//! texel is the tangent from its surface to the hull of its row, which is the exact one for all that the end
//! sees, and a scan along the row finds it in linear time (`glsl/oess/outreach.comp`). A receiver then looks
//! at the triangle at its edge, so that neither texels nor rows show (`glsl/oess/oess.glsl`). The steps as
//! published are the options' other values.
//!
//! | pass | makes |
//! |---|---|
//! | `params` | views |
//! | `map` | depths and triangles seen from each end |
//! | `rows` | which rows of the maps are asked for |
//! | `outreach` | each texel's occluding edge, and where its surface ends |
//! | `start`, `tiles` | the picture's tiles that need work |
//! | `visibility` | visibility, and the influence of both ends |
//! | `open` | tiles where blockers may hide between the ends, and rows of the maps around them |
//! | `outreach`, `visibility` again | for segments of the line there, whose ends have maps as well |
//!
//! The paper cuts long lights into segments. Neither end sees what hides behind the first blocker on
//! the way from it, so that the part of the line between the two blockers is open; where there is none,
//! two maps are exact, and nothing else is done for those pixels.

mod options;
mod outreach;
mod silhouettes;
mod views;
mod visibility;

pub use options::{Find, MOST_SEGMENTS, OessOptions, Outreach};

use super::light_view::LightView;
use super::map::{MAP_SIZE, add_maps_of};
use super::silhouettes::edge_count;
use super::uniform::add_uniform;
use super::{ShadowInputs, ShadowMask, hard};
use crate::geometry::DrawTarget;
use crate::graph::Graph;
use crate::light::{AreaLight, LightProfile, LightShape, MAX_PROFILE, ShapeKind};
use bytemuck::{Pod, Zeroable};
use views::{LineViews, MOST_SECTORS, line_views};

/// The technique's name.
pub(super) const NAME: &str = "oess";

/// Light shapes that it can do.
pub(super) const SHAPES: &[ShapeKind] = &[ShapeKind::Line, ShapeKind::Point];

/// Most points of a line that have a map.
const MOST_POINTS: usize = MOST_SEGMENTS as usize + 1;

/// `OessParams` in `oess/params.glsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct OessParams {
    start: [f32; 4],
    axis: [f32; 4],
    counts: [u32; 4],
    shift: [[f32; 4]; MOST_SECTORS],
    profile: [[f32; 4]; MAX_PROFILE],
    /// One after the other: sector * points + point.
    views: [[LightView; MOST_POINTS]; MOST_SECTORS],
}

/// `LineBlock` in `oess/silhouettes.comp`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct LineParams {
    start: [f32; 4],
    axis: [f32; 4],
    profile: [[f32; 4]; MAX_PROFILE],
}

impl LineParams {
    fn new(light: &AreaLight, length: f32) -> Self {
        let (cells, profile) = profile_of(&light.profile);
        let start = light.center - light.axis_x * (0.5 * length);
        Self {
            start: start.extend(length).to_array(),
            axis: light.axis_x.extend(cells as f32).to_array(),
            profile,
        }
    }
}

/// Width and height of an end's map in texels.
const END_MAP_SIZE: u32 = 1024;

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
    if length <= SHORTEST * farthest_receiver(inputs) || inputs.scene.triangle_count() == 0 {
        return hard::add_passes_at(graph, inputs, options.resolution.unwrap_or(MAP_SIZE));
    }
    let scene = inputs.scene;
    let by_mesh = options.outreach == Outreach::Silhouettes && !scene.has_masks();
    if by_mesh && edge_count(inputs) > 0 {
        let texels = options.resolution.unwrap_or(MAP_SIZE);
        let line = LineParams::new(&inputs.light, length);
        return silhouettes::add_passes(graph, inputs, line, texels);
    }
    add_maps(graph, inputs, options, length)
}

/// Declares the passes that find edges in maps of the line's ends.
fn add_maps<'f>(
    graph: &mut Graph<'f>,
    inputs: &ShadowInputs<'f>,
    options: OessOptions,
    length: f32,
) -> ShadowMask {
    let texels = options.resolution.unwrap_or(END_MAP_SIZE);
    let by_hull = matches!(options.outreach, Outreach::Hull | Outreach::Silhouettes);
    let boxes = inputs.scene.draws().iter().map(|draw| draw.bounds);
    let boxes: Vec<_> = boxes.collect();
    let by_need = options.segments.is_none() && by_hull;
    let views_of = |segments: u32| {
        let points = segments as usize + 1;
        line_views(&inputs.light, &inputs.receivers, &boxes, points, by_need)
    };
    let mut views = views_of(options.segments.unwrap_or(1));
    let segments = match options.segments {
        None if by_need => segments_for(&views, texels),
        fixed => fixed.unwrap_or(1),
    };
    if by_need && segments > 1 {
        views = views_of(segments);
    }
    let params = params_of(&inputs.light, &views, texels, segments, length);
    let buffer = add_uniform(
        graph,
        format!("{NAME}.params {}", inputs.light_name),
        params,
    );
    // What lies behind a blocker decides which edges count, and that may be ground that blocks nothing.
    let draws = vec![true; inputs.scene.draws().len()].into();
    let maps = add_maps_of(
        graph,
        inputs,
        NAME,
        &views.views,
        DrawTarget::Ids,
        (texels, draws),
    );
    let line = visibility::Line {
        options,
        data: params,
        params: buffer,
        maps,
    };
    if by_need && segments > 1 {
        line.add_by_need(graph, inputs, segments)
    } else {
        line.add_whole(graph, inputs)
    }
}

/// Segments of a line that may hide something between its ends, given the views from these. Between
/// points that are nearer than some texels in front of a receiver, nothing hides that a map would show.
fn segments_for(views: &LineViews, resolution: u32) -> u32 {
    match views.widest * f64::from(resolution) {
        texels if texels < 4.0 => 1,
        texels if texels < 16.0 => 2,
        texels if texels < 64.0 || views.sectors > 1 => 4,
        _ => MOST_SEGMENTS,
    }
}

fn farthest_receiver(inputs: &ShadowInputs<'_>) -> f32 {
    let center = inputs.light.center.as_dvec3();
    let points = inputs.receivers.iter().flatten();
    points.map(|p| p.distance(center)).fold(0.0, f64::max) as f32
}

fn params_of(
    light: &AreaLight,
    views: &LineViews,
    resolution: u32,
    segments: u32,
    length: f32,
) -> OessParams {
    let points = segments as usize + 1;
    let segment = length / segments as f32;
    let start = light.center - light.axis_x * (0.5 * length);
    let (cells, profile) = profile_of(&light.profile);
    let mut params = OessParams {
        start: start.extend(segment).to_array(),
        axis: light.axis_x.extend(cells as f32).to_array(),
        counts: [views.sectors as u32, points as u32, resolution, resolution],
        shift: [[0.0; 4]; MOST_SECTORS],
        profile,
        views: [[LightView::default(); MOST_POINTS]; MOST_SECTORS],
    };
    for (layer, view) in views.views.views.iter().enumerate() {
        params.views.as_flattened_mut()[layer] = *view;
        // A point at depth z moves by segment / z; the map holds scale.z / z.
        let texels = segment * view.scale[0] * resolution as f32;
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
