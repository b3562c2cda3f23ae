//! Technique `ssoc`: the Soft Shadow Occlusion Camera (Q. Mo, V. Popescu, C. Wyman).
//!
//! Silhouette edges seen from the light's centre are drawn into two distortion maps, one for what is
//! inside of the hard shadow and one for what is outside, as bands as wide as the edge's penumbra can
//! get. A receiver near an edge warps its place in the light's image by how much of the light the
//! edge hides, and looks there for further edges.
//!
//! Published are six values a texel: a point of the edge, its normal, depths before and behind it.
//! Here a texel holds the number of the edge, and the receiver reads the edge itself: in place of an
//! image-space estimate the plane through receiver and edge cuts the light, which is exact for
//! inclined edges too, and no texel of the map shows along it.
//!
//! Published is that the visibilities of up to four edges are joined two by two, which knows too
//! little of how they lie to each other. By default ([`Combine::Cells`]) the light is cut into cells
//! instead, and each is decided by the outline nearest to it: the first edge's answer is exact where
//! its line is the only one, and changes by the cells that other edges cross. Of overlapping bands
//! the edge wins that comes nearest to hiding the light's centre; published is the nearest in the
//! image. An edge beside which a surface goes on, as at cracks that rounding leaves between parts, is no
//! outline and is left out. Where alpha cuts holes into triangles no edges are known, and receivers that have such
//! triangles before the light are left to the shadow map, filtered as by `pcss`.
//!
//! | pass | makes |
//! |---|---|
//! | `params` | views |
//! | `map` | depths and triangles seen from the light's centre |
//! | `silhouettes.*` | the list of edges ([`super::silhouettes`]) |
//! | `outlines` | where along each edge it is an outline |
//! | `bands` | the outer and the inner distortion map of a view |
//! | `bands_second` | with `layers=2`: what another edge was before there |
//! | `no_bands` | if the scene has no edges or the light no size, in place of these four: maps of a texel without an edge |
//! | `start`, `tiles` | the picture's tiles that need work |
//! | `visibility` | visibility |
//! | `collisions`, `crowding` | how many bands share texels, if anyone wants the counts |

mod crowding;
mod options;

pub(super) use crowding::remark;

pub use options::{Combine, SsocOptions};

use super::light_view::{LightView, MAX_LIGHT_VIEWS, light_views, note_left_out};
use super::map::{ShadowMap, add_maps_of};
use super::pcss::nearest_blocker;
use super::receivers::add_receivers;
use super::shaft_masks::add_classes;
use super::silhouettes::{
    NO_EDGES, SilhouetteRule, Silhouettes, add_blank, add_silhouettes, edge_count, skip_edges,
};
use super::uniform::add_uniform;
use super::{ShadowInputs, ShadowMask, shape_number};
use crate::geometry::{DrawTarget, image_place};
use crate::gpu::{ComputePipelineDesc, DepthState, GraphicsPipelineDesc, SamplerDesc, spirv};
use crate::graph::{
    Access, Bind, BufferId, Graph, ImageDesc, ImageId, ImagePart, Load, PassBuilder, PassKind,
    Stage,
};
use crate::light::{LightShape, ShapeKind};
use ash::vk;
use bytemuck::{Pod, Zeroable};
use glam::Vec3;
use std::rc::Rc;

/// The technique's name.
pub(super) const NAME: &str = "ssoc";

/// Light shapes that it can do.
pub(super) const SHAPES: &[ShapeKind] = &[
    ShapeKind::Point,
    ShapeKind::Disk,
    ShapeKind::Sphere,
    ShapeKind::Sun,
];

/// `SsocParams` in `ssoc/params.glsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
struct SsocParams {
    counts: [u32; 4],
    bands: [u32; 4],
    reach: [f32; 4],
    search: [f32; 4],
    views: [LightView; MAX_LIGHT_VIEWS],
}

/// Push constants of `ssoc/bands.vert` and `.frag`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct BandsPush {
    center: [f32; 4],
    view: u32,
    side: u32,
}

/// Vertices of one side of an edge: `VERTICES` in `ssoc/bands.vert`.
const VERTICES: u32 = 36;

/// Half width of a band in texels, at least: a receiver's texel may lie that far from the edge.
const LEAST_TEXELS: f32 = 1.5;

/// Edges nearer to the light than this part of the farthest receiver's distance are cut off.
const NEAR: f32 = 1.0e-4;

/// Views reach at most this far beyond the receivers, as the tangent of an angle at the light.
const MOST_MARGIN: f64 = 0.25;

/// Declares the passes.
pub(super) fn add_passes<'f>(
    graph: &mut Graph<'f>,
    inputs: &ShadowInputs<'f>,
    options: SsocOptions,
) -> ShadowMask {
    let light = inputs.light;
    let reach = light.shape.reach();
    let casters = inputs.scene.bounds();
    let far = farthest(inputs);
    let boxes = inputs.scene.draws().iter().map(|draw| draw.bounds);
    let nearest = nearest_blocker(&light, boxes);
    let margin = if light.shape.is_sun() {
        f64::from(reach * casters.radius())
    } else {
        f64::from(reach / far.max(f32::MIN_POSITIVE)).min(MOST_MARGIN)
    };
    let views = light_views(&light, &inputs.receivers, &casters, margin);
    note_left_out(graph, inputs, NAME, &views);
    let [width, height] = inputs.camera.size();
    let needless = if matches!(light.shape, LightShape::Point) {
        Some("a point has no penumbra")
    } else {
        (edge_count(inputs) == 0).then_some(NO_EDGES)
    };
    let side = needless.map_or(options.bands, |_| 1);
    let mut params = SsocParams {
        counts: [views.views.len() as u32, options.resolution, width, height],
        bands: [side, 0, 0, 0],
        reach: [reach, far, far * NEAR, LEAST_TEXELS],
        ..SsocParams::default()
    };
    params.search[0] = nearest as f32;
    for (place, view) in params.views.iter_mut().zip(&views.views) {
        *place = *view;
        if light.shape.is_sun() {
            // Stored depth 1 is the near end of the view.
            params.search[0] = (1.0 - view.scale[3]) / view.scale[2];
        }
    }
    let buffer = add_uniform(
        graph,
        format!("{NAME}.params {}", inputs.light_name),
        params,
    );
    let target = DrawTarget::Ids;
    // What cannot block is drawn too: a body's edge on the floor that it stands on is no outline.
    let all: Rc<[bool]> = vec![true; inputs.scene.draws().len()].into();
    let drawn = (options.resolution, all);
    let map = add_maps_of(graph, inputs, NAME, &views, target, drawn);
    let ShadowMap {
        depth,
        ids: Some(ids),
    } = map
    else {
        unreachable!("triangle numbers were asked for");
    };
    let map = (depth, ids);
    let layers = views.views.len() as u32;
    if let Some(reason) = needless {
        let blank = add_no_bands(graph, inputs, &options, layers, reason);
        let bands = (blank, blank);
        return add_visibility(graph, inputs, &options, buffer, map, bands);
    }
    let list = add_silhouettes(graph, inputs, NAME, SilhouetteRule::Center, VERTICES);
    let outlines = add_outlines(graph, inputs, layers, buffer, map, list);
    let drawing = Bands {
        side: if layers == 0 { 1 } else { options.bands },
        layers,
        params: buffer,
        outlines,
        list,
    };
    let bands = drawing.add_maps(graph, inputs, None);
    let second = (options.layers > 1).then(|| drawing.add_maps(graph, inputs, Some(bands)));
    let bands = (bands, second.unwrap_or(bands));
    let mask = add_visibility(graph, inputs, &options, buffer, map, bands);
    ShadowMask {
        silhouettes: Some(list),
        tally: Some(drawing.add_counts(graph, inputs)),
        ..mask
    }
}

/// Distance of the farthest receiver from the light's centre; of a sun the depth along its
/// direction.
fn farthest(inputs: &ShadowInputs<'_>) -> f32 {
    let center = inputs.light.center.as_dvec3();
    let direction = inputs.light.direction.as_dvec3();
    let points = inputs.receivers.iter().flatten();
    if inputs.light.shape.is_sun() {
        let depths = points.map(|p| p.dot(direction));
        return depths.fold(f64::NEG_INFINITY, f64::max).max(-1.0e30) as f32;
    }
    points.map(|p| p.distance(center)).fold(0.0, f64::max) as f32
}

/// Where the light's centre is, of a sun the origin.
fn origin(inputs: &ShadowInputs<'_>) -> [f32; 4] {
    let sun = inputs.light.shape.is_sun();
    let center = if sun { Vec3::ZERO } else { inputs.light.center };
    center.extend(0.0).to_array()
}

/// Declares the pass that tells where along each edge it is an outline. `map`: depths, and numbers of
/// triangles plus one.
fn add_outlines(
    graph: &mut Graph<'_>,
    inputs: &ShadowInputs<'_>,
    views: u32,
    params: BufferId,
    map: (ImageId, ImageId),
    list: Silhouettes,
) -> ImageId {
    let name = &inputs.light_name;
    let [width, height] = image_place(inputs.scene.edge_count());
    let desc = ImageDesc::new(vk::Format::R32G32B32A32_UINT, width, height).layers(views.max(1));
    let outlines = graph.create_image(format!("{NAME}.outlines {name}"), desc);
    let (edges, points, triangles) = (inputs.ids.edges, inputs.ids.points, inputs.ids.triangles);
    let (depths, ids) = map;
    let mut pass = graph.pass(format!("{NAME}.outlines {name}"), PassKind::Compute);
    pass.read(params, Access::Uniform(Stage::Compute));
    pass.read(list.arguments, Access::Indirect);
    pass.read(list.arguments, Access::Uniform(Stage::Compute));
    for image in [list.list, edges, points, depths, ids, triangles] {
        pass.read(image, Access::Sampled(Stage::Compute));
    }
    let outlines = pass.overwrite(outlines, Access::StorageWrite(Stage::Compute));
    let push = origin(inputs);
    pass.record(move |ctx| {
        let nearest = SamplerDesc::nearest();
        let bindings = [
            Bind::uniform(0, params),
            Bind::sampled(1, list.list, nearest),
            Bind::sampled(2, edges, nearest),
            Bind::sampled(3, points, nearest),
            Bind::sampled(4, depths, nearest).array(),
            Bind::sampled(5, ids, nearest).array(),
            Bind::sampled(6, triangles, nearest),
            Bind::uniform(7, list.arguments),
            Bind::storage_image(8, outlines).array(),
        ];
        let pipeline = ComputePipelineDesc::new(&spirv::SSOC_OUTLINES_COMP);
        ctx.bind_compute(&pipeline, &bindings, bytemuck::bytes_of(&push))?;
        list.dispatch(ctx)
    });
    outlines
}

/// Declares distortion maps of a texel without an edge, and notes what is left out.
fn add_no_bands(
    graph: &mut Graph<'_>,
    inputs: &ShadowInputs<'_>,
    options: &SsocOptions,
    views: u32,
    reason: &str,
) -> ImageId {
    let passes = ["silhouettes", "outlines", "bands", "bands_second"];
    let made = if options.layers > 1 { 4 } else { 3 };
    skip_edges(graph, inputs, NAME, &passes[..made], reason);
    let name = format!("{NAME}.no_bands {}", inputs.light_name);
    add_blank(graph, name, vk::Format::R32_UINT, 2 * views.max(1))
}

/// What bands are drawn of, and where to.
#[derive(Clone, Copy)]
struct Bands {
    /// Texels across and down a map.
    side: u32,
    /// Views, each with an outer and an inner map.
    layers: u32,
    params: BufferId,
    /// RGBA32_UINT, as the list of edges, a layer for each view: a bit for each place along an edge.
    outlines: ImageId,
    list: Silhouettes,
}

impl Bands {
    /// The distortion maps: R32_UINT, one more than the number of the edge, 0 for none, and its faces'
    /// side in the highest bit; for each view a layer for the outer and one for the inner map. With
    /// `first` given, of what these maps do not hold.
    fn add_maps(
        &self,
        graph: &mut Graph<'_>,
        inputs: &ShadowInputs<'_>,
        first: Option<ImageId>,
    ) -> ImageId {
        let what = if first.is_some() {
            "bands_second"
        } else {
            "bands"
        };
        let name = &inputs.light_name;
        let image = |format| ImageDesc::new(format, self.side, self.side);
        let maps = 2 * self.layers.max(1);
        let numbers = image(vk::Format::R32_UINT).layers(maps);
        let mut bands = graph.create_image(format!("{NAME}.{what} {name}"), numbers);
        for layer in 0..maps {
            // Nearness of the edge, as a depth.
            let apart = image(vk::Format::D32_SFLOAT);
            let apart = graph.create_image(format!("{NAME}.{what}_apart {name}.{layer}"), apart);
            let pass_name = format!("{NAME}.{what} {name}.{layer}");
            let mut pass = graph.pass(pass_name, PassKind::Graphics);
            bands = pass.color_part(bands, ImagePart::layer(layer), Load::Clear([0.0; 4]));
            let _ = pass.depth(apart, Load::Clear([0.0; 4]));
            if self.layers > 0 {
                let fragment = match first {
                    None => &spirv::SSOC_BANDS_FRAG,
                    Some(_) => &spirv::SSOC_BANDS_SECOND_FRAG,
                };
                let mut pipeline =
                    GraphicsPipelineDesc::new(&spirv::SSOC_BANDS_VERT, Some(fragment));
                pipeline.depth = Some(DepthState {
                    compare: vk::CompareOp::GREATER,
                    write: true,
                });
                self.draw(pass, inputs, layer, pipeline, first);
            }
        }
        bands
    }

    /// Draws one side of all edges into the pass's images.
    fn draw(
        &self,
        mut pass: PassBuilder<'_, '_>,
        inputs: &ShadowInputs<'_>,
        layer: u32,
        pipeline: GraphicsPipelineDesc,
        first: Option<ImageId>,
    ) {
        let Self {
            params,
            outlines,
            list,
            ..
        } = *self;
        let push = BandsPush {
            center: origin(inputs),
            view: layer / 2,
            side: layer % 2,
        };
        let (edges, points) = (inputs.ids.edges, inputs.ids.points);
        let seen = ImagePart::layer(layer / 2);
        list.read(&mut pass, inputs);
        pass.read(params, Access::Uniform(Stage::Vertex));
        pass.read_part(outlines, seen, Access::Sampled(Stage::Vertex));
        let own = ImagePart::layer(layer);
        if let Some(first) = first {
            pass.read_part(first, own, Access::Sampled(Stage::Fragment));
        }
        pass.record(move |ctx| {
            let nearest = SamplerDesc::nearest();
            let mut bindings = vec![
                Bind::uniform(0, params),
                Bind::sampled(1, list.list, nearest),
                Bind::sampled(2, edges, nearest),
                Bind::sampled(3, points, nearest),
                Bind::sampled(4, outlines, nearest).part(seen),
            ];
            bindings.extend(first.map(|first| Bind::sampled(5, first, nearest).part(own)));
            ctx.bind_graphics(pipeline.clone(), &bindings, bytemuck::bytes_of(&push))?;
            list.draw(ctx)
        });
    }
}

fn add_visibility<'f>(
    graph: &mut Graph<'f>,
    inputs: &ShadowInputs<'f>,
    options: &SsocOptions,
    params: BufferId,
    (map_depth, map_ids): (ImageId, ImageId),
    (bands, second): (ImageId, ImageId),
) -> ShadowMask {
    let name = &inputs.light_name;
    let receivers = add_receivers(graph, inputs, NAME, inputs.light.shape.reach());
    let (receivers, settled) = add_classes(graph, inputs, NAME, receivers, options.classes);
    let list = receivers.list;
    let (gbuffer, ids) = (inputs.gbuffer, inputs.ids);
    let (view_params, part) = inputs.view_params;
    let mut pass = graph.pass(format!("{NAME}.visibility {name}"), PassKind::Compute);
    pass.read_part(view_params, part, Access::Uniform(Stage::Compute));
    pass.read(params, Access::Uniform(Stage::Compute));
    let images = [
        gbuffer.view_depth,
        gbuffer.geometric_normal,
        gbuffer.ids,
        map_depth,
        map_ids,
        bands,
        ids.edges,
        ids.points,
        ids.triangles,
    ];
    let other = (second != bands).then_some(second);
    for image in images.into_iter().chain(ids.mask_images()).chain(other) {
        pass.read(image, Access::Sampled(Stage::Compute));
    }
    list.read(&mut pass);
    let visibility = pass.write(receivers.visibility, Access::StorageWrite(Stage::Compute));
    let shape = shape_number(&inputs.light.shape);
    let options = *options;
    let masked = u32::from(inputs.scene.has_masks());
    pass.record(move |ctx| {
        let nearest = SamplerDesc::nearest();
        let bindings = [
            Bind::uniform(0, view_params).part(part),
            Bind::uniform(1, params),
            Bind::sampled(2, gbuffer.view_depth, nearest),
            Bind::sampled(3, gbuffer.geometric_normal, nearest),
            Bind::sampled(4, map_depth, nearest).array(),
            Bind::sampled(5, bands, nearest).array(),
            Bind::sampled(6, ids.edges, nearest),
            Bind::sampled(7, ids.points, nearest),
            Bind::storage_image(8, visibility),
            Bind::uniform(9, list.arguments),
            Bind::sampled(10, list.tiles, nearest),
            Bind::sampled(11, map_ids, nearest).array(),
            Bind::sampled(12, gbuffer.ids, nearest),
            Bind::sampled(13, ids.triangles, nearest),
            Bind::sampled(14, ids.materials, nearest),
            Bind::sampled(15, ids.triangle_uvs, nearest),
            Bind::sampled(16, ids.footprints, nearest),
            Bind::sampled(17, second, nearest).array(),
        ];
        let steps = ctx.gpu().info().limits.sub_pixel_precision_bits.min(16);
        let snap = 4.0 / (1u32 << steps) as f32;
        let pipeline = ComputePipelineDesc {
            constants: vec![
                (0, snap.to_bits()),
                (1, masked),
                (2, shape),
                (3, options.lookups),
                (4, options.combine as u32),
                (5, u32::from(options.cubic)),
                (6, options.layers),
                (7, u32::from(options.falloff)),
            ],
            ..ComputePipelineDesc::new(&spirv::SSOC_VISIBILITY_COMP)
        };
        ctx.bind_compute(&pipeline, &bindings, &[])?;
        list.dispatch(ctx)
    });
    ShadowMask {
        settled,
        ..ShadowMask::new(visibility)
    }
}
