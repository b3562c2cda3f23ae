//! Technique `dbuffer`: shadows whose boundaries are right, from the silhouettes of the whole light
//! (B. Jakobsen, N. J. Christensen, B. D. Larsen, K. S. Petersen: Boundary Correct Real-Time Soft
//! Shadows, Computer Graphics International 2004).
//!
//! As published, an edge is a silhouette if some point of the light sees it as one, so that both the
//! umbra's and the penumbra's boundary are right, not only the hard shadow of the light's centre.
//! Published is one edge for each receiver, found in a buffer that is drawn from the light's centre.
//! Here each tile of the picture lists the edges between its surfaces and the light, and each
//! receiver takes all of them: every edge hides the part of the light beyond it, exactly, and the
//! layers before some places of the light tell which parts overlap (`glsl/dbuffer/coverage.glsl`).
//! So blockers that are concave, smaller than the light or behind each other are right.
//!
//! | pass | makes |
//! |---|---|
//! | `params` | places on the light |
//! | `map`, `visibility` of `dbuffer.hard` | what sees the light's centre |
//! | `silhouettes.*` | the list of edges ([`super::silhouettes`]), kept while light and casters stand still; like `boxes` and `lists` only if the scene has edges |
//! | `boxes` | the ends of edges, boxes around 16, 256 and 4096 of them |
//! | `start`, `tiles`, `shafts` | tiles that some of the light is above, what is between both |
//! | `lists` | the edges of each tile, in chunks with boxes around them |
//! | `cutouts` | its triangles with holes, if the scene has any: these hide samples of the light |
//! | `overflow` | whether lists have found no room: if all have some, the next passes up to `settle` run over nothing |
//! | `demand`, `fit` | empty lists; the tiles that ask for the least, as many as there is room for |
//! | `lists.again`, `cutouts.again` | the lists of these tiles |
//! | `through` | whether a surface cuts through the light: then rays to samples of it decide, as in tiles with very many edges |
//! | `settle` | tiles without edges; a list of the others |
//! | `visibility` | visibility of the others |

mod buffer;
mod lists;
mod options;
mod overflow;
mod samples;

pub use options::{Buffer, Curve, DbufferOptions, Keep};

use super::receivers::add_receivers;
use super::shaft_masks::add_shafts;
use super::silhouettes::{NO_EDGES, SilhouetteRule, add_silhouettes, skip_edges};
use super::uniform::add_uniform;
use super::{LightParams, ShadowInputs, ShadowMask, ViewParams, casters, hard, shape_number};
use crate::gpu::{ComputePipelineDesc, SamplerDesc, spirv};
use crate::graph::{Access, Bind, BufferPart, Graph, ImageId, PassKind, Stage};
use crate::light::{AreaLight, LightShape, ShapeKind};
use bytemuck::{Pod, Zeroable};
use lists::Sizes;
pub(super) use lists::{Found, Lists};

/// The technique's name.
pub(super) const NAME: &str = "dbuffer";

/// Light shapes that it can do.
pub(super) const SHAPES: &[ShapeKind] = &[
    ShapeKind::Point,
    ShapeKind::Disk,
    ShapeKind::Rect,
    ShapeKind::Sphere,
    ShapeKind::Sun,
];

/// `DbufferParams` in `dbuffer/params.glsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct DbufferParams {
    counts: [u32; 4],
    samples: [[f32; 4]; samples::MOST_TEXELS],
    sizes: [u32; 4],
}

/// Declares the passes.
pub(super) fn add_passes<'f>(
    graph: &mut Graph<'f>,
    inputs: &ShadowInputs<'f>,
    options: DbufferOptions,
) -> ShadowMask {
    let name = &inputs.light_name;
    let shape = inputs.light.shape;
    if shape == LightShape::Point || inputs.scene.triangle_count() == 0 {
        let image = format!("visibility {name}");
        return ShadowMask::new(hard::add_hard(graph, inputs, NAME, image));
    }
    if let Some(light) = as_disk(&inputs.light, &options) {
        let inputs = lit_by(graph, inputs, light);
        return add_passes(graph, &inputs, options);
    }
    if options.buffer != Buffer::Lists {
        let [width, height] = inputs.camera.size();
        let params = DbufferParams {
            counts: [width, height, 0, 0],
            samples: samples::texels(options.samples, false),
            sizes: [0; 4],
        };
        return buffer::add_buffer(graph, inputs, &options, params);
    }
    let base = format!("{NAME}.hard");
    let hard = hard::add_hard(graph, inputs, &base, format!("{base} {name}"));
    let (tools, found, visibility) = add_edge_lists(graph, inputs, NAME, &options, hard);
    add_visibility(graph, inputs, &options, &tools, &found, visibility)
}

/// Declares the passes that list each tile's edges, given what sees the light's centre: all but visibility of the
/// listed tiles. Returns the visibility image too, in which the other tiles are done.
pub(super) fn add_edge_lists(
    graph: &mut Graph<'_>,
    inputs: &ShadowInputs<'_>,
    technique: &'static str,
    options: &DbufferOptions,
    hard: ImageId,
) -> (Lists, Found, ImageId) {
    let shape = inputs.light.shape;
    let size = inputs.camera.size();
    let sizes = Sizes::new(inputs, options);
    let nodes = inputs.scene.node_count() as u32;
    let params = DbufferParams {
        counts: [size[0], size[1], nodes, sizes.chunks],
        samples: samples::texels(options.samples, matches!(shape, LightShape::Rect { .. })),
        sizes: [sizes.blocks, sizes.lists, options.most_edges, 0],
    };
    let name = format!("{technique}.params {}", inputs.light_name);
    let params = add_uniform(graph, name, params);
    let silhouettes = if sizes.blocks > 0 {
        let rule = SilhouetteRule::Layers;
        Some(add_silhouettes(graph, inputs, technique, rule, 1))
    } else {
        let passes = ["silhouettes", "boxes", "lists"];
        skip_edges(graph, inputs, technique, &passes, NO_EDGES);
        None
    };
    let receivers = add_receivers(graph, inputs, technique, shape.reach());
    let (shafts, _) = add_shafts(graph, inputs, (technique, 1), params, &receivers);
    let tools = Lists {
        technique,
        params,
        silhouettes,
        receivers,
        shafts,
        hard,
        sizes,
    };
    let (found, visibility) = tools.add(graph, inputs);
    (tools, found, visibility)
}

/// The disk of the same area, where a rectangle shall count as that: a D-buffer knows disks alone.
fn as_disk(light: &AreaLight, options: &DbufferOptions) -> Option<AreaLight> {
    let LightShape::Rect { width, height } = light.shape else {
        return None;
    };
    let radius = (width * height / std::f32::consts::PI).sqrt();
    (options.as_disk || options.buffer != Buffer::Lists).then_some(AreaLight {
        shape: LightShape::Disk { radius },
        ..*light
    })
}

/// The same inputs with another light.
fn lit_by<'f>(
    graph: &mut Graph<'f>,
    inputs: &ShadowInputs<'f>,
    light: AreaLight,
) -> ShadowInputs<'f> {
    let params = ViewParams {
        camera: inputs.camera,
        light: LightParams::new(&light),
    };
    let size = size_of::<ViewParams>() as u64;
    let buffer = add_uniform(graph, format!("{NAME}.disk {}", inputs.light_name), params);
    ShadowInputs {
        light_name: inputs.light_name.clone(),
        light,
        camera: inputs.camera,
        gbuffer: inputs.gbuffer,
        tile_bounds: inputs.tile_bounds,
        view_params: (buffer, BufferPart { offset: 0, size }),
        receivers: inputs.receivers.clone(),
        casters: casters(&light, &inputs.receivers, inputs.scene),
        scene: inputs.scene,
        ids: inputs.ids,
        silhouettes: inputs.silhouettes,
    }
}

fn add_visibility<'f>(
    graph: &mut Graph<'f>,
    inputs: &ShadowInputs<'f>,
    options: &DbufferOptions,
    tools: &Lists,
    found: &Found,
    visibility: ImageId,
) -> ShadowMask {
    let name = &inputs.light_name;
    let ids = inputs.ids;
    let (view_params, part) = inputs.view_params;
    let (params, hard) = (tools.params, tools.hard);
    let Found {
        pool,
        chunk_boxes,
        lists,
        ends,
        tiles,
        through,
    } = *found;
    let mut pass = graph.pass(format!("{NAME}.visibility {name}"), PassKind::Compute);
    pass.read_part(view_params, part, Access::Uniform(Stage::Compute));
    pass.read(params, Access::Uniform(Stage::Compute));
    pass.read(through, Access::Uniform(Stage::Compute));
    let sampled = tools.sampled(inputs);
    let found = [ends, pool, chunk_boxes, lists, hard];
    for image in sampled.into_iter().chain(found).chain(ids.mask_images()) {
        pass.read(image, Access::Sampled(Stage::Compute));
    }
    tiles.read(&mut pass);
    let visibility = pass.write(visibility, Access::StorageWrite(Stage::Compute));
    let shape = shape_number(&inputs.light.shape);
    let masked = u32::from(inputs.scene.has_masks());
    let fours = options.samples / 4;
    pass.record(move |ctx| {
        let nearest = SamplerDesc::nearest();
        let places = [2, 3, 4, 5, 9, 10, 11].into_iter();
        let sampled = places.zip(sampled);
        let mut bindings: Vec<Bind> = sampled
            .map(|(binding, image)| Bind::sampled(binding, image, nearest))
            .collect();
        bindings.extend([
            Bind::uniform(0, view_params).part(part),
            Bind::uniform(1, params),
            Bind::sampled(6, ids.materials, nearest),
            Bind::sampled(7, ids.triangle_uvs, nearest),
            Bind::sampled(8, ids.footprints, nearest),
            Bind::sampled(12, pool, nearest),
            Bind::sampled(13, lists, nearest),
            Bind::sampled(14, hard, nearest),
            Bind::storage_image(15, visibility),
            Bind::uniform(16, tiles.arguments),
            Bind::sampled(17, tiles.tiles, nearest),
            Bind::uniform(18, through),
            Bind::sampled(19, ends, nearest),
            Bind::sampled(20, chunk_boxes, nearest),
        ]);
        let pipeline = ComputePipelineDesc {
            constants: vec![(0, shape), (1, fours), (2, masked)],
            ..ComputePipelineDesc::new(&spirv::DBUFFER_VISIBILITY_COMP)
        };
        ctx.bind_compute(&pipeline, &bindings, &[])?;
        tiles.dispatch(ctx)
    });
    ShadowMask {
        silhouettes: tools.silhouettes,
        ..ShadowMask::new(visibility)
    }
}
