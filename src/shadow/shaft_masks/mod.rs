//! Technique `shaft-masks`: for each tile of pixels the triangles between its surfaces and the light,
//! for each pixel the light samples that they hide.
//!
//! A tile's shaft holds all segments from its surfaces to the light (Haines and Wallace 1991). Its
//! walk down the scene's hierarchy settles tiles that are fully lit or surely dark and lists the
//! triangles for the others. There each pixel rasterises the list onto the light as it sees it,
//! into a mask of samples (Eisemann and Decoret 2007; Schwarz and Stamminger 2007), as a ray tracer
//! with the same samples would find them: overlapping blockers are right, and there is neither bias
//! nor noise. Lists of triangles for each receiver are also what GEARS (Wang, Wang, Shi, Popescu
//! 2012) traces rays with.
//!
//! | pass | makes |
//! |---|---|
//! | `params` | rows of samples |
//! | `start`, `tiles` | the picture's tiles that some of the light is above |
//! | `shafts` | their shafts |
//! | `lists` | lit and dark tiles settled; lists of the others |
//! | `masks` | visibility of the others |

mod options;
mod samples;

pub use options::ShaftOptions;
pub use samples::light_samples;

use super::receivers::{Receivers, add_receivers};
use super::{ShadowInputs, ShadowMask, shape_number};
use crate::geometry::{TileList, tile_counts};
use crate::gpu::{ComputePipelineDesc, SamplerDesc, spirv};
use crate::graph::{
    Access, Bind, BufferDesc, BufferId, Graph, ImageDesc, ImageId, PassKind, Stage,
};
use crate::light::LightShape;
use ash::vk;
use bytemuck::{Pod, Zeroable};

/// The technique's name.
pub(super) const NAME: &str = "shaft-masks";

/// `MOST_ROWS` in `shaft_masks/params.glsl`.
const MOST_ROWS: usize = 32;

/// `SHAFT_TEXELS` in `shaft_masks/shaft.glsl`.
const SHAFT_TEXELS: u32 = 9;

/// Texels of a chunk of a list: `CHUNK` + 1 in `shaft_masks/lists.glsl`.
const CHUNK_TEXELS: u32 = 32;

/// Width of the image that holds the lists: `TRIANGLE_IMAGE_WIDTH` in `common/triangles.glsl`.
const POOL_WIDTH: u32 = 4096;

/// Most rows of the image that holds the lists: 64 MiB.
const MOST_POOL_ROWS: u32 = 4096;

/// `ShaftParams` in `shaft_masks/params.glsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct ShaftParams {
    counts: [u32; 4],
    rows: [[f32; 4]; MOST_ROWS],
}

/// Lists of triangles for the tiles that need masks.
struct Lists {
    /// The tiles.
    tiles: TileList,
    /// R32_UINT: chunks of entries.
    pool: ImageId,
    /// RGBA32_UINT: `TriangleList` of each tile.
    lists: ImageId,
}

/// Declares the passes.
pub(super) fn add_passes<'f>(
    graph: &mut Graph<'f>,
    inputs: &ShadowInputs<'f>,
    options: ShaftOptions,
) -> ShadowMask {
    let size = inputs.camera.size();
    let [across, down] = tile_counts(size);
    let pool_rows = (across * down * options.room).div_ceil(POOL_WIDTH);
    let pool_rows = pool_rows.min(MOST_POOL_ROWS);
    let chunks = pool_rows * POOL_WIDTH / CHUNK_TEXELS;
    let nodes = inputs.scene.node_count() as u32;
    let mut params = ShaftParams {
        counts: [size[0], size[1], nodes, chunks],
        rows: [[0.0; 4]; MOST_ROWS],
    };
    let rows = samples::rows(&inputs.light.shape, options.side);
    for (texel, row) in params.rows.iter_mut().zip(rows) {
        *texel = row.texel();
    }
    let buffer = add_params(graph, inputs, params);
    let receivers = add_receivers(graph, inputs, NAME, reach(&inputs.light.shape));
    let shafts = add_shafts(graph, inputs, buffer, &receivers);
    let pool = ImageDesc::new(vk::Format::R32_UINT, POOL_WIDTH, pool_rows.max(1));
    let (lists, visibility) = add_lists(graph, inputs, buffer, &receivers, shafts, pool);
    let visibility = add_masks(graph, inputs, options, buffer, shafts, &lists, visibility);
    ShadowMask::new(visibility)
}

/// Distance from the light's centre to its farthest point, of a sun at distance 1.
fn reach(shape: &LightShape) -> f32 {
    match shape {
        LightShape::Sun { angular_diameter } => (0.5 * angular_diameter).tan(),
        shape => shape.bounding_radius(),
    }
}

fn add_params(graph: &mut Graph<'_>, inputs: &ShadowInputs<'_>, params: ShaftParams) -> BufferId {
    let name = &inputs.light_name;
    let size = size_of::<ShaftParams>() as u64;
    let buffer = graph.create_buffer(format!("{NAME}.params {name}"), BufferDesc { size });
    let mut pass = graph.pass(format!("{NAME}.params {name}"), PassKind::Transfer);
    let buffer = pass.overwrite(buffer, Access::Clear);
    pass.record(move |ctx| ctx.update_buffer(buffer, 0, bytemuck::bytes_of(&params)));
    buffer
}

fn add_shafts(
    graph: &mut Graph<'_>,
    inputs: &ShadowInputs<'_>,
    params: BufferId,
    receivers: &Receivers,
) -> ImageId {
    let name = &inputs.light_name;
    let [across, down] = tile_counts(inputs.camera.size());
    let format = vk::Format::R32G32B32A32_SFLOAT;
    let desc = ImageDesc::new(format, across * SHAFT_TEXELS, down);
    let shafts = graph.create_image(format!("{NAME}.shafts {name}"), desc);
    let (gbuffer, triangles) = (inputs.gbuffer, inputs.ids.triangles);
    let (view_params, part) = inputs.view_params;
    let tiles = receivers.list;
    let shape = shape_number(&inputs.light.shape);
    let mut pass = graph.pass(format!("{NAME}.shafts {name}"), PassKind::Compute);
    pass.read_part(view_params, part, Access::Uniform(Stage::Compute));
    pass.read(params, Access::Uniform(Stage::Compute));
    for image in [gbuffer.view_depth, gbuffer.ids, triangles] {
        pass.read(image, Access::Sampled(Stage::Compute));
    }
    tiles.read(&mut pass);
    let shafts = pass.overwrite(shafts, Access::StorageWrite(Stage::Compute));
    pass.record(move |ctx| {
        let nearest = SamplerDesc::nearest();
        let bindings = [
            Bind::uniform(0, view_params).part(part),
            Bind::uniform(1, params),
            Bind::sampled(2, gbuffer.view_depth, nearest),
            Bind::sampled(3, gbuffer.ids, nearest),
            Bind::sampled(4, triangles, nearest),
            Bind::uniform(5, tiles.arguments),
            Bind::sampled(6, tiles.tiles, nearest),
            Bind::storage_image(7, shafts),
        ];
        let shader = &spirv::SHAFT_MASKS_SHAFTS_COMP;
        let pipeline = ComputePipelineDesc {
            constants: vec![(0, shape)],
            ..ComputePipelineDesc::new(shader)
        };
        ctx.bind_compute(&pipeline, &bindings, &[])?;
        ctx.dispatch(shader.groups([across * down, 1, 1]));
        Ok(())
    });
    shafts
}

fn add_lists(
    graph: &mut Graph<'_>,
    inputs: &ShadowInputs<'_>,
    params: BufferId,
    receivers: &Receivers,
    shafts: ImageId,
    pool: ImageDesc,
) -> (Lists, ImageId) {
    let name = &inputs.light_name;
    let size = inputs.camera.size();
    let [across, down] = tile_counts(size);
    let mut penumbra = TileList::create(graph, &format!("{NAME}.penumbra {name}"), size);
    let used = graph.create_buffer(format!("{NAME}.used {name}"), BufferDesc { size: 16 });
    let mut pass = graph.pass(format!("{NAME}.clear {name}"), PassKind::Transfer);
    penumbra.clear(&mut pass);
    let used = pass.overwrite(used, Access::Clear);
    let cleared = penumbra;
    pass.record(move |ctx| {
        cleared.record_clear(ctx)?;
        ctx.update_buffer(used, 0, &[0; 16])
    });

    let pool = graph.create_image(format!("{NAME}.pool {name}"), pool);
    let desc = ImageDesc::new(vk::Format::R32G32B32A32_UINT, across, down);
    let lists = graph.create_image(format!("{NAME}.lists {name}"), desc);
    let (ids, view_depth, tile_bounds) =
        (inputs.ids, inputs.gbuffer.view_depth, inputs.tile_bounds);
    let (view_params, part) = inputs.view_params;
    let tiles = receivers.list;
    let shape = shape_number(&inputs.light.shape);
    let mut pass = graph.pass(format!("{NAME}.lists {name}"), PassKind::Compute);
    pass.read_part(view_params, part, Access::Uniform(Stage::Compute));
    pass.read(params, Access::Uniform(Stage::Compute));
    let images = [
        tile_bounds,
        ids.triangles,
        ids.hierarchy,
        shafts,
        view_depth,
    ];
    for image in images {
        pass.read(image, Access::Sampled(Stage::Compute));
    }
    tiles.read(&mut pass);
    penumbra.fill(&mut pass);
    let used = pass.write(used, Access::StorageReadWrite(Stage::Compute));
    let pool = pass.overwrite(pool, Access::StorageWrite(Stage::Compute));
    let lists = pass.overwrite(lists, Access::StorageWrite(Stage::Compute));
    let visibility = pass.write(receivers.visibility, Access::StorageWrite(Stage::Compute));
    pass.record(move |ctx| {
        let nearest = SamplerDesc::nearest();
        let bindings = [
            Bind::uniform(0, view_params).part(part),
            Bind::uniform(1, params),
            Bind::sampled(2, tile_bounds, nearest),
            Bind::sampled(3, ids.triangles, nearest),
            Bind::sampled(4, ids.hierarchy, nearest),
            Bind::uniform(5, tiles.arguments),
            Bind::sampled(6, tiles.tiles, nearest),
            Bind::sampled(7, shafts, nearest),
            Bind::storage_buffer(8, penumbra.arguments),
            Bind::storage_image(9, penumbra.tiles),
            Bind::storage_buffer(10, used),
            Bind::storage_image(11, pool),
            Bind::storage_image(12, lists),
            Bind::storage_image(13, visibility),
            Bind::sampled(14, view_depth, nearest),
        ];
        let shader = &spirv::SHAFT_MASKS_LISTS_COMP;
        let pipeline = ComputePipelineDesc {
            constants: vec![(0, shape)],
            ..ComputePipelineDesc::new(shader)
        };
        ctx.bind_compute(&pipeline, &bindings, &[])?;
        ctx.dispatch(shader.groups([across * down, 1, 1]));
        Ok(())
    });
    let lists = Lists {
        tiles: penumbra,
        pool,
        lists,
    };
    (lists, visibility)
}

fn add_masks(
    graph: &mut Graph<'_>,
    inputs: &ShadowInputs<'_>,
    options: ShaftOptions,
    params: BufferId,
    shafts: ImageId,
    lists: &Lists,
    visibility: ImageId,
) -> ImageId {
    let name = &inputs.light_name;
    let (ids, gbuffer) = (inputs.ids, inputs.gbuffer);
    let (view_params, part) = inputs.view_params;
    let (tiles, pool, lists) = (lists.tiles, lists.pool, lists.lists);
    let mut pass = graph.pass(format!("{NAME}.masks {name}"), PassKind::Compute);
    pass.read_part(view_params, part, Access::Uniform(Stage::Compute));
    pass.read(params, Access::Uniform(Stage::Compute));
    let images = [
        gbuffer.view_depth,
        gbuffer.ids,
        ids.triangles,
        ids.hierarchy,
        shafts,
        pool,
        lists,
    ];
    for image in images.into_iter().chain(ids.mask_images()) {
        pass.read(image, Access::Sampled(Stage::Compute));
    }
    tiles.read(&mut pass);
    let visibility = pass.write(visibility, Access::StorageWrite(Stage::Compute));
    let constants = vec![
        (0, shape_number(&inputs.light.shape)),
        (1, options.side),
        (2, options.side),
        (3, u32::from(inputs.scene.has_masks())),
    ];
    pass.record(move |ctx| {
        let nearest = SamplerDesc::nearest();
        let bindings = [
            Bind::uniform(0, view_params).part(part),
            Bind::uniform(1, params),
            Bind::sampled(2, gbuffer.view_depth, nearest),
            Bind::sampled(3, gbuffer.ids, nearest),
            Bind::sampled(4, ids.triangles, nearest),
            Bind::sampled(5, ids.hierarchy, nearest),
            Bind::sampled(6, ids.materials, nearest),
            Bind::sampled(7, ids.triangle_uvs, nearest),
            Bind::sampled(8, ids.texels, nearest),
            Bind::uniform(9, tiles.arguments),
            Bind::sampled(10, tiles.tiles, nearest),
            Bind::sampled(11, shafts, nearest),
            Bind::sampled(12, pool, nearest),
            Bind::sampled(13, lists, nearest),
            Bind::storage_image(14, visibility),
        ];
        let pipeline = ComputePipelineDesc {
            constants,
            ..ComputePipelineDesc::new(&spirv::SHAFT_MASKS_MASKS_COMP)
        };
        ctx.bind_compute(&pipeline, &bindings, &[])?;
        tiles.dispatch(ctx)
    });
    visibility
}
