//! The D-buffer as published: umbra and penumbra volumes drawn from the light's centre.
//!
//! | pass | makes |
//! |---|---|
//! | `params` | views |
//! | `map`, `visibility` of `dbuffer.hard` | what sees the light's centre |
//! | `map` | triangles that the light's centre sees, in the buffer's texels |
//! | `silhouettes.*` | the list of edges ([`crate::shadow::silhouettes`]) |
//! | `umbra`, `penumbra` | a layer of one surface in a view |
//! | `no_surfaces` | if the scene has no edges, in place of these and the map: a texel without a surface |
//! | `start`, `tiles` | the picture's tiles that need work |
//! | `visibility` | visibility |
//!
//! Published is that a texel decides by its own depth whether the light's centre is hidden; here a ray
//! does, and surfaces start a texel before their edge, so that no bias is needed.

use super::options::{Buffer, Curve, Keep};
use super::{DbufferOptions, DbufferParams, NAME};
use crate::geometry::DrawTarget;
use crate::gpu::{ComputePipelineDesc, DepthState, GraphicsPipelineDesc, SamplerDesc, spirv};
use crate::graph::{
    Access, Bind, BufferId, Graph, ImageDesc, ImageId, ImagePart, Load, PassKind, Stage,
};
use crate::shadow::light_view::{LightView, LightViews, MAX_LIGHT_VIEWS, light_views};
use crate::shadow::map::{ShadowMap, add_maps};
use crate::shadow::receivers::add_receivers;
use crate::shadow::silhouettes::{
    NO_EDGES, SilhouetteRule, Silhouettes, add_blank, add_silhouettes, edge_count, skip_edges,
};
use crate::shadow::uniform::add_uniform;
use crate::shadow::{ShadowInputs, ShadowMask, hard, shape_number};
use ash::vk;
use bytemuck::{Pod, Zeroable};

/// `BufferParams` in `dbuffer/buffer.glsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
struct BufferParams {
    counts: [u32; 4],
    center: [f32; 4],
    axis_x: [f32; 4],
    axis_y: [f32; 4],
    axis_z: [f32; 4],
    views: [LightView; MAX_LIGHT_VIEWS],
}

/// Push constants of `dbuffer/volumes.vert` and `.frag`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct VolumesPush {
    view: u32,
    umbra: u32,
    layer: u32,
    arcs: u32,
    edges: u32,
    greatest: u32,
    darkest: u32,
}

/// Vertices of an edge: `VERTICES` in `dbuffer/volumes.vert`.
const VERTICES: u32 = 30;

/// Surfaces of a kind that `dbuffer/buffered.comp` can look at.
const MOST_LAYERS: usize = 4;

/// Stored depth begins at this part of the farthest receiver's distance.
const NEAR: f32 = 1.0e-4;

impl BufferParams {
    fn new(inputs: &ShadowInputs<'_>, views: &LightViews, resolution: u32) -> Self {
        let light = inputs.light;
        let sun = light.shape.is_sun();
        let (begin, far) = depths(inputs);
        let center = if sun { glam::Vec3::ZERO } else { light.center };
        let [width, height] = inputs.camera.size();
        let mut params = Self {
            counts: [views.views.len() as u32, resolution, width, height],
            center: center.extend(light.shape.reach()).to_array(),
            axis_x: light.axis_x.extend(far).to_array(),
            axis_y: light.axis_y.extend(begin).to_array(),
            axis_z: light.direction.extend(0.0).to_array(),
            ..Self::default()
        };
        params.views[..views.views.len()].copy_from_slice(&views.views);
        params
    }
}

/// Where stored depth begins, and the farthest receiver: metres from the light's centre, of a sun along
/// its direction.
fn depths(inputs: &ShadowInputs<'_>) -> (f32, f32) {
    let light = inputs.light;
    let points = inputs.receivers.iter().flatten();
    if light.shape.is_sun() {
        let direction = light.direction.as_dvec3();
        let casters = inputs.scene.bounds().corners().map(|p| p.as_dvec3());
        let begin = casters.map(|p| p.dot(direction));
        let begin = begin.into_iter().fold(f64::INFINITY, f64::min).min(1.0e30);
        let far = points.map(|p| p.dot(direction)).fold(begin, f64::max);
        return (begin as f32, far as f32);
    }
    let center = light.center.as_dvec3();
    let far = points.map(|p| p.distance(center)).fold(0.0, f64::max) as f32;
    let far = far.max(f32::MIN_POSITIVE / NEAR);
    (far * NEAR, far)
}

/// The images of one surface, a layer each.
struct Surfaces {
    umbra: Vec<ImageId>,
    penumbra: Vec<ImageId>,
}

impl Surfaces {
    /// Declares a texel without a surface for each view, and notes what is left out.
    fn none(graph: &mut Graph<'_>, inputs: &ShadowInputs<'_>, views: u32) -> Self {
        let skipped = ["map", "silhouettes", "umbra", "penumbra"];
        skip_edges(graph, inputs, NAME, &skipped, NO_EDGES);
        let name = format!("{NAME}.no_surfaces {}", inputs.light_name);
        let blank = add_blank(graph, name, vk::Format::R32G32_UINT, views.max(1));
        Self {
            umbra: vec![blank],
            penumbra: vec![blank],
        }
    }
}

/// What the volumes are drawn from.
struct Drawn<'a> {
    views: &'a LightViews,
    params: BufferId,
    map: ImageId,
    list: Silhouettes,
}

/// Declares the passes of a light that is no rectangle.
pub(super) fn add_buffer<'f>(
    graph: &mut Graph<'f>,
    inputs: &ShadowInputs<'f>,
    options: &DbufferOptions,
    coverage: DbufferParams,
) -> ShadowMask {
    let name = &inputs.light_name;
    let base = format!("{NAME}.hard");
    let hard = hard::add_hard(graph, inputs, &base, format!("{base} {name}"));
    let views = light_views(
        &inputs.light,
        &inputs.receivers,
        &inputs.scene.bounds(),
        0.0,
    );
    let has_edges = edge_count(inputs) > 0;
    let side = if has_edges { options.resolution } else { 1 };
    let params = BufferParams::new(inputs, &views, side);
    let params = add_uniform(graph, format!("{NAME}.views {name}"), params);
    let coverage = add_uniform(graph, format!("{NAME}.params {name}"), coverage);
    let both = [coverage, params];
    if !has_edges {
        let surfaces = Surfaces::none(graph, inputs, views.views.len() as u32);
        let visibility = add_visibility(graph, inputs, options, both, hard, &surfaces);
        return ShadowMask::new(visibility);
    }
    let target = DrawTarget::Ids;
    let map = add_maps(graph, inputs, NAME, &views, target, options.resolution);
    let ShadowMap { ids: Some(map), .. } = map else {
        unreachable!("triangle numbers were asked for");
    };
    let list = add_silhouettes(graph, inputs, NAME, SilhouetteRule::WholeLight, VERTICES);
    let drawn = Drawn {
        views: &views,
        params,
        map,
        list,
    };
    let surfaces = Surfaces {
        umbra: drawn.add_surface(graph, inputs, options, true),
        penumbra: drawn.add_surface(graph, inputs, options, false),
    };
    let visibility = add_visibility(graph, inputs, options, both, hard, &surfaces);
    // The images are not kept: views of a light cover what the camera sees.
    ShadowMask {
        silhouettes: Some(list),
        ..ShadowMask::new(visibility)
    }
}

impl Drawn<'_> {
    /// R32G32_UINT for each layer of the buffer, with a layer for each view: `dbuffer/buffer.glsl`.
    fn add_surface(
        &self,
        graph: &mut Graph<'_>,
        inputs: &ShadowInputs<'_>,
        options: &DbufferOptions,
        umbra: bool,
    ) -> Vec<ImageId> {
        let name = &inputs.light_name;
        let what = if umbra { "umbra" } else { "penumbra" };
        let views = self.views.views.len() as u32;
        let side = if views == 0 { 1 } else { options.resolution };
        let image = |format| ImageDesc::new(format, side, side).layers(views.max(1));
        let greatest = options.keep == Keep::Greatest;
        let mut before: Option<[ImageId; 2]> = None;
        let mut surfaces = Vec::new();
        for layer in 0..options.layers {
            let texels = image(vk::Format::R32G32_UINT);
            let mut texels = graph.create_image(format!("{NAME}.{what} {name}.{layer}"), texels);
            let depth = image(vk::Format::D32_SFLOAT);
            let depth_name = format!("{NAME}.{what}_depth {name}.{layer}");
            let mut depth = graph.create_image(depth_name, depth);
            for view in 0..views.max(1) {
                let part = ImagePart::layer(view);
                let pass_name = format!("{NAME}.{what} {name}.{layer}.{view}");
                let mut pass = graph.pass(pass_name, PassKind::Graphics);
                texels = pass.color_part(texels, part, Load::Clear([0.0; 4]));
                let cleared = if greatest { 1.0 } else { 0.0 };
                depth = pass.depth_part(depth, part, Load::Clear([cleared; 4]));
                if views == 0 {
                    continue;
                }
                let push = VolumesPush {
                    view,
                    umbra: u32::from(umbra),
                    layer,
                    // Published without: there umbra quads only meet.
                    arcs: u32::from(!umbra || !greatest),
                    edges: u32::from(options.buffer == Buffer::Edges),
                    greatest: u32::from(greatest),
                    darkest: u32::from(options.keep == Keep::Darkest),
                };
                self.record(pass, inputs, push, before);
            }
            before = Some([depth, texels]);
            surfaces.push(texels);
        }
        surfaces
    }

    fn record(
        &self,
        mut pass: crate::graph::PassBuilder<'_, '_>,
        inputs: &ShadowInputs<'_>,
        push: VolumesPush,
        before: Option<[ImageId; 2]>,
    ) {
        let Self {
            params, map, list, ..
        } = *self;
        let part = ImagePart::layer(push.view);
        // The first layer has none before; something must be bound.
        let ids = inputs.ids;
        list.read(&mut pass, inputs);
        pass.read(params, Access::Uniform(Stage::Vertex));
        pass.read(params, Access::Uniform(Stage::Fragment));
        pass.read_part(map, part, Access::Sampled(Stage::Fragment));
        pass.read(ids.triangles, Access::Sampled(Stage::Fragment));
        for image in before.into_iter().flatten() {
            pass.read_part(image, part, Access::Sampled(Stage::Fragment));
        }
        let shape = shape_number(&inputs.light.shape);
        pass.record(move |ctx| {
            let nearest = SamplerDesc::nearest();
            let fragment = Some(&spirv::DBUFFER_VOLUMES_FRAG);
            let mut pipeline = GraphicsPipelineDesc::new(&spirv::DBUFFER_VOLUMES_VERT, fragment);
            pipeline.constants = vec![(0, shape)];
            pipeline.depth = Some(DepthState {
                compare: if push.greatest != 0 {
                    vk::CompareOp::LESS
                } else {
                    vk::CompareOp::GREATER
                },
                write: true,
            });
            let [before, texels] = match before {
                Some([depth, texels]) => [
                    Bind::sampled(6, depth, nearest).part(part),
                    Bind::sampled(7, texels, nearest).part(part),
                ],
                None => [
                    Bind::sampled(6, ids.triangles, nearest),
                    Bind::sampled(7, map, nearest).part(part),
                ],
            };
            let bindings = [
                Bind::uniform(0, params),
                Bind::sampled(1, list.list, nearest),
                Bind::sampled(2, ids.edges, nearest),
                Bind::sampled(3, ids.points, nearest),
                Bind::sampled(4, map, nearest).part(part),
                Bind::sampled(5, ids.triangles, nearest),
                before,
                texels,
            ];
            ctx.bind_graphics(pipeline, &bindings, bytemuck::bytes_of(&push))?;
            list.draw(ctx)
        });
    }
}

fn add_visibility<'f>(
    graph: &mut Graph<'f>,
    inputs: &ShadowInputs<'f>,
    options: &DbufferOptions,
    [coverage, params]: [BufferId; 2],
    hard: ImageId,
    surfaces: &Surfaces,
) -> ImageId {
    let name = &inputs.light_name;
    let (gbuffer, ids) = (inputs.gbuffer, inputs.ids);
    let (view_params, part) = inputs.view_params;
    let receivers = add_receivers(graph, inputs, NAME, inputs.light.shape.reach());
    let list = receivers.list;
    // Layers that there are none of are never read, but bound.
    let bound = |images: &[ImageId]| [0, 1, 2, 3].map(|i| images[i.min(images.len() - 1)]);
    let layers: [[ImageId; MOST_LAYERS]; 2] = [bound(&surfaces.umbra), bound(&surfaces.penumbra)];
    let mut pass = graph.pass(format!("{NAME}.visibility {name}"), PassKind::Compute);
    pass.read_part(view_params, part, Access::Uniform(Stage::Compute));
    pass.read(coverage, Access::Uniform(Stage::Compute));
    pass.read(params, Access::Uniform(Stage::Compute));
    let images = [
        gbuffer.view_depth,
        gbuffer.ids,
        ids.triangles,
        ids.edges,
        ids.points,
        hard,
    ];
    let surfaces = surfaces.umbra.iter().chain(&surfaces.penumbra).copied();
    for image in images.into_iter().chain(surfaces) {
        pass.read(image, Access::Sampled(Stage::Compute));
    }
    list.read(&mut pass);
    let visibility = pass.write(receivers.visibility, Access::StorageWrite(Stage::Compute));
    let shape = shape_number(&inputs.light.shape);
    let curve = match options.curve {
        Curve::Exact => 0,
        Curve::Cubic => 1,
        Curve::Sqrt => 2,
    };
    let push = [
        u32::from(options.buffer == Buffer::Edges),
        options.layers,
        u32::from(options.keep == Keep::Darkest),
        curve,
    ];
    pass.record(move |ctx| {
        let nearest = SamplerDesc::nearest();
        let mut bindings = vec![
            Bind::uniform(0, view_params).part(part),
            Bind::uniform(1, coverage),
            Bind::uniform(2, params),
            Bind::sampled(3, gbuffer.view_depth, nearest),
            Bind::sampled(4, gbuffer.ids, nearest),
            Bind::sampled(5, ids.triangles, nearest),
            Bind::sampled(6, ids.edges, nearest),
            Bind::sampled(7, ids.points, nearest),
            Bind::sampled(8, hard, nearest),
            Bind::storage_image(17, visibility),
            Bind::uniform(18, list.arguments),
            Bind::sampled(19, list.tiles, nearest),
        ];
        for (i, image) in layers.into_iter().flatten().enumerate() {
            bindings.push(Bind::sampled(9 + i as u32, image, nearest).array());
        }
        let pipeline = ComputePipelineDesc {
            constants: vec![(0, shape)],
            ..ComputePipelineDesc::new(&spirv::DBUFFER_BUFFERED_COMP)
        };
        ctx.bind_compute(&pipeline, &bindings, bytemuck::bytes_of(&push))?;
        list.dispatch(ctx)
    });
    visibility
}
