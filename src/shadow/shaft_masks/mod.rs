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
//! | `masks` | visibility of the others, or what the beginnings of long lists hide |
//! | `further` | what the rest of long lists hides |
//! | `walk` | what triangles hide that lists had no room for |
//! | `resolve` | visibility of the tiles of the last two |

mod masks;
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

/// Fewest tiles that lists have room for.
const LEAST_TILES: u32 = 1024;

/// Lists of triangles for the tiles that need masks.
#[derive(Clone, Copy, Debug)]
struct Lists {
    /// The tiles.
    tiles: TileList,
    /// R32_UINT: chunks of entries.
    pool: ImageId,
    /// RGBA32_UINT: `TriangleList` of each tile.
    lists: ImageId,
    /// Arguments of a dispatch over `tasks`.
    further: BufferId,
    /// RGBA32_UINT: parts of long lists.
    tasks: ImageId,
    /// Tiles whose lists do not know all triangles.
    partial: TileList,
}

/// Sizes of what the device fills.
#[derive(Clone, Copy, Debug)]
struct Sizes {
    /// Rows of the image that holds the lists.
    pool_rows: u32,
    /// Chunks of a task: `TASK_CHUNKS` in `shaft_masks/lists.glsl`.
    task_chunks: u32,
    /// Nodes of a task that walks the hierarchy.
    run_nodes: u32,
}

impl Sizes {
    fn new(tiles: u32, options: &ShaftOptions, masked: bool) -> Self {
        // A small picture's tiles are wide, and so are their shafts.
        let rows = (tiles.max(LEAST_TILES) * options.room).div_ceil(POOL_WIDTH);
        // A cut-out triangle costs a look for each sample, others a few operations a row.
        let (task_chunks, run_nodes) = match (masked, options.side) {
            (false, _) => (16, 1024),
            (true, 8) => (4, 256),
            (true, 16) => (1, 64),
            (true, _) => (1, 16),
        };
        Self {
            pool_rows: rows.min(MOST_POOL_ROWS),
            task_chunks,
            run_nodes,
        }
    }

    fn chunks(&self) -> u32 {
        self.pool_rows * POOL_WIDTH / CHUNK_TEXELS
    }
}

/// An image of so many texels in rows of [`POOL_WIDTH`].
fn texels(format: vk::Format, count: u32) -> ImageDesc {
    ImageDesc::new(format, POOL_WIDTH, count.div_ceil(POOL_WIDTH).max(1))
}

/// Declares the passes.
pub(super) fn add_passes<'f>(
    graph: &mut Graph<'f>,
    inputs: &ShadowInputs<'f>,
    options: ShaftOptions,
) -> ShadowMask {
    let size = inputs.camera.size();
    let [across, down] = tile_counts(size);
    let sizes = Sizes::new(across * down, &options, inputs.scene.has_masks());
    let nodes = inputs.scene.node_count() as u32;
    let mut params = ShaftParams {
        counts: [size[0], size[1], nodes, sizes.chunks()],
        rows: [[0.0; 4]; MOST_ROWS],
    };
    let rows = samples::rows(&inputs.light.shape, options.side);
    for (texel, row) in params.rows.iter_mut().zip(rows) {
        *texel = row.texel();
    }
    let buffer = add_params(graph, inputs, params);
    let receivers = add_receivers(graph, inputs, NAME, reach(&inputs.light.shape));
    let shafts = add_shafts(graph, inputs, NAME, buffer, &receivers);
    let (lists, visibility) = add_lists(graph, inputs, buffer, &receivers, shafts, sizes);
    let masks = masks::Masks {
        options,
        sizes,
        nodes,
        params: buffer,
        shafts,
        lists,
    };
    let visibility = masks.add(graph, inputs, visibility);
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

/// Declares the pass that finds the shaft of each listed tile. `params`: a uniform buffer of the size
/// of [`ShaftParams`] that begins with the width and height of the picture.
pub(super) fn add_shafts(
    graph: &mut Graph<'_>,
    inputs: &ShadowInputs<'_>,
    technique: &str,
    params: BufferId,
    receivers: &Receivers,
) -> ImageId {
    let name = &inputs.light_name;
    let [across, down] = tile_counts(inputs.camera.size());
    let format = vk::Format::R32G32B32A32_SFLOAT;
    let desc = ImageDesc::new(format, across * SHAFT_TEXELS, down);
    let shafts = graph.create_image(format!("{technique}.shafts {name}"), desc);
    let (gbuffer, triangles) = (inputs.gbuffer, inputs.ids.triangles);
    let (view_params, part) = inputs.view_params;
    let tiles = receivers.list;
    let shape = shape_number(&inputs.light.shape);
    let mut pass = graph.pass(format!("{technique}.shafts {name}"), PassKind::Compute);
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
    sizes: Sizes,
) -> (Lists, ImageId) {
    let name = &inputs.light_name;
    let size = inputs.camera.size();
    let [across, down] = tile_counts(size);
    let mut penumbra = TileList::create(graph, &format!("{NAME}.penumbra {name}"), size);
    let sixteen = BufferDesc { size: 16 };
    let mut partial = TileList::create(graph, &format!("{NAME}.partial {name}"), size);
    let used = graph.create_buffer(format!("{NAME}.used {name}"), sixteen);
    let further = graph.create_buffer(format!("{NAME}.further {name}"), sixteen);
    let mut pass = graph.pass(format!("{NAME}.clear {name}"), PassKind::Transfer);
    penumbra.clear(&mut pass);
    partial.clear(&mut pass);
    let used = pass.overwrite(used, Access::Clear);
    let further = pass.overwrite(further, Access::Clear);
    let cleared = penumbra;
    let runs = inputs.scene.node_count() as u32 / sizes.run_nodes + 1;
    let no_partial = [0u32, 1, runs.min(masks::MOST_RUNS), 0];
    let partial_arguments = partial.arguments;
    pass.record(move |ctx| {
        cleared.record_clear(ctx)?;
        ctx.update_buffer(partial_arguments, 0, bytemuck::cast_slice(&no_partial))?;
        ctx.update_buffer(used, 0, &[0; 16])?;
        ctx.update_buffer(further, 0, bytemuck::cast_slice(&[0u32, 1, 1, 0]))
    });

    let pool = texels(vk::Format::R32_UINT, sizes.pool_rows * POOL_WIDTH);
    let pool = graph.create_image(format!("{NAME}.pool {name}"), pool);
    let tasks = sizes.chunks() / sizes.task_chunks;
    let tasks = texels(vk::Format::R32G32B32A32_UINT, tasks);
    let tasks = graph.create_image(format!("{NAME}.tasks {name}"), tasks);
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
    partial.fill(&mut pass);
    let used = pass.write(used, Access::StorageReadWrite(Stage::Compute));
    let further = pass.write(further, Access::StorageReadWrite(Stage::Compute));
    let pool = pass.overwrite(pool, Access::StorageWrite(Stage::Compute));
    let tasks = pass.overwrite(tasks, Access::StorageWrite(Stage::Compute));
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
            Bind::storage_buffer(15, further),
            Bind::storage_image(16, tasks),
            Bind::storage_buffer(17, partial.arguments),
            Bind::storage_image(18, partial.tiles),
        ];
        let shader = &spirv::SHAFT_MASKS_LISTS_COMP;
        let pipeline = ComputePipelineDesc {
            constants: vec![(0, shape), (4, sizes.task_chunks)],
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
        further,
        tasks,
        partial,
    };
    (lists, visibility)
}
