//! Technique `shaft-masks`: for each tile of pixels the triangles between its surfaces and the light,
//! for each pixel the light samples that they hide.
//!
//! A tile's shaft holds all segments from its surfaces to the light (Haines and Wallace 1991). Its
//! walk down the scene's hierarchy settles tiles that are fully lit and lists the triangles that may
//! matter to the others. Where a mesh shows one side to a whole tile only the edges at which it ends
//! or folds matter, as in soft shadow volumes (Laine and others 2005): a sample's number of blockers
//! is a sum over such edges. The other triangles are drawn one by one onto the light as each pixel
//! sees it, into a mask of samples (Eisemann and Decoret 2007; Schwarz and Stamminger 2007). Both
//! find what a ray tracer with the same samples would: overlapping blockers are right, and there is
//! neither bias nor noise. Lists of triangles for each receiver are also what GEARS (Wang, Wang, Shi,
//! Popescu 2012) traces rays with.
//!
//! | pass | makes |
//! |---|---|
//! | `params` | rows of samples |
//! | `start`, `tiles` | the picture's tiles that some of the light is above |
//! | `shafts`, `shafts_rough` | the tiles, in two parts where they span a gap in depth; their shafts, and boxes around their surfaces |
//! | `no_rest`, `settle` | lit and dark tiles settled, as far as a short walk tells |
//! | `groups` | the others, in groups of up to four beside each other |
//! | `lists`, `lists.singles` | candidates of each group, or of each of its tiles where they have many |
//! | `overflow`, `lists.again` | the same with equal room for all, where they had too little |
//! | `entries` | edges and triangles of each group |
//! | `classes` | those that matter to each tile; more lit tiles and dark ones settled; the others listed by kind |
//! | `masks_pieces` | what the beginnings of long lists hide, or each block of more than 64 samples |
//! | `masks`, `masks_plain` | visibility of the others |
//! | `further` | what the rest of long lists hides |
//! | `walk` | what triangles hide that lists had no room for, each pixel by itself |
//! | `walk_rest` | the rest of long walks |
//! | `resolve` | visibility of the tiles of the last two, and where there are more than 64 samples |
//! | `no_estimates` | the tiles' estimates, which `entries`, `masks` and `resolve` fill in |
//! | `rounds`, `select` | the tiles that get four times the samples |
//! | `masks_256` .. `resolve_1024` | their visibility |
//! | `no_bound`, `bound` | a bound on the error, if anything reads it |

mod bound;
mod groups;
mod lists;
mod masks;
mod options;
mod refine;
mod samples;
mod walk;

pub use options::ShaftOptions;
pub(super) use refine::missed_bound;
pub use samples::light_samples;

use super::receivers::{Receivers, add_receivers};
use super::uniform::add_uniform;
use super::{ShadowInputs, ShadowMask, Tally, shape_number};
use crate::geometry::{TILE_SIZE, TileList, tile_counts};
use crate::gpu::{ComputePipelineDesc, SamplerDesc, spirv};
use crate::graph::{
    Access, Bind, BufferDesc, BufferId, Graph, ImageDesc, ImageId, PassKind, Stage,
};
use ash::vk;
use bytemuck::{Pod, Zeroable};

/// The technique's name.
pub(super) const NAME: &str = "shaft-masks";

/// `MOST_ROWS` in `shaft_masks/params.glsl`.
const MOST_ROWS: usize = 32;

/// Rows and columns of a block of samples: `ROWS` in `shaft_masks/words.glsl`.
const BLOCK: u32 = 8;

/// `SHAFT_TEXELS` in `shaft_masks/shaft.glsl`.
const SHAFT_TEXELS: u32 = 17;

/// `LIST_TEXELS` in `shaft_masks/lists.glsl`.
const LIST_TEXELS: u32 = 6;

/// Triangles of a chunk of a list: `CHUNK` in `shaft_masks/lists.glsl`.
const CHUNK: u32 = 32;

/// Its texels: four triangles each, and one more.
const CHUNK_TEXELS: u32 = CHUNK / 4 + 1;

/// Width of the image that holds the lists: `TRIANGLE_IMAGE_WIDTH` in `common/triangles.glsl`.
const POOL_WIDTH: u32 = 4096;

/// Most rows of the image that holds the lists: 64 MiB.
const MOST_POOL_ROWS: u32 = 4096;

/// `ShaftParams` in `shaft_masks/params.glsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct ShaftParams {
    counts: [u32; 4],
    pattern: [u32; 4],
    rows: [[f32; 4]; MOST_ROWS],
    strips: [[f32; 4]; MOST_ROWS],
}

/// Fewest tiles that lists have room for.
const LEAST_TILES: u32 = 1024;

/// Parts of a tile that spans a gap in depth.
const PARTS: u32 = 2;

/// What is between the tiles that need masks and the light.
#[derive(Clone, Copy, Debug)]
struct Lists {
    /// The tiles.
    tiles: TileList,
    /// Those that are not in `pieces`, as two lists in one image: plain ones (`PLAIN` in `shaft_masks/masks.glsl`) from
    /// its begin on, others from its end. `None` where all are in pieces.
    sorted: Option<[TileList; 2]>,
    /// RGBA32_UINT, [`LIST_TEXELS`] texels a tile: `Entries` in `shaft_masks/lists.glsl`.
    lists: ImageId,
    /// R32_UINT: edges.
    edges: ImageId,
    /// R32_UINT: triangles.
    triangles: ImageId,
    /// Arguments of a dispatch over `tasks`.
    further: BufferId,
    /// RGBA32_UINT: parts of long lists.
    tasks: ImageId,
    /// Tiles whose lists do not know all triangles.
    partial: TileList,
    walk_rest: walk::WalkRest,
    /// Tiles whose masks are made in pieces: of long lists, or of several blocks of samples. The other dispatch is one
    /// over the blocks of each.
    pieces: TileList,
}

/// Sizes of what the device fills.
#[derive(Clone, Copy, Debug)]
struct Sizes {
    /// Rows of the image that holds candidates.
    pool_rows: u32,
    /// Rows of the image that holds edges.
    edge_rows: u32,
    /// Triangles of a task: `TASK_ENTRIES` in `shaft_masks/lists.glsl`.
    task_entries: u32,
    /// Nodes of a task that walks the hierarchy.
    run_nodes: u32,
    /// Blocks of samples.
    blocks: u32,
}

impl Sizes {
    fn new(tiles: u32, options: &ShaftOptions, masked: bool) -> Self {
        // A small picture's tiles are wide, and so are their shafts.
        let rows = (tiles.max(LEAST_TILES) * options.room).div_ceil(POOL_WIDTH);
        // A cut-out triangle costs a look for each sample, others a few operations a row.
        let (task_entries, run_nodes) = if masked { (128, 230) } else { (512, 5120) };
        Self {
            pool_rows: rows.min(MOST_POOL_ROWS),
            edge_rows: rows.div_ceil(2).min(MOST_POOL_ROWS),
            task_entries,
            run_nodes,
            blocks: (options.side / BLOCK).pow(2),
        }
    }

    fn chunks(&self) -> u32 {
        self.pool_rows * POOL_WIDTH / CHUNK
    }
}

/// An image of so many texels in rows of [`POOL_WIDTH`].
fn texels(format: vk::Format, count: u32) -> ImageDesc {
    ImageDesc::new(format, POOL_WIDTH, count.div_ceil(POOL_WIDTH).max(1))
}

/// The visibility so far, and what is known of its error.
#[derive(Clone, Copy, Debug)]
struct Made {
    /// R32F, of the picture's size.
    visibility: ImageId,
    /// R32_UINT, four texels a tile: `shaft_masks/estimates.glsl`.
    estimates: ImageId,
}

/// Declares the passes.
pub(super) fn add_passes<'f>(
    graph: &mut Graph<'f>,
    inputs: &ShadowInputs<'f>,
    options: ShaftOptions,
) -> ShadowMask {
    let [across, down] = tile_counts(inputs.camera.size());
    let tiles = across * down;
    let sizes = Sizes::new(tiles, &options, inputs.scene.has_masks());
    let spent = refine::begin(graph, inputs, &options);
    let params = add_params(graph, inputs, &sizes, options.side, "params");
    let receivers = add_receivers(graph, inputs, NAME, inputs.light.shape.reach());
    let (shafts, parts) = add_shafts(graph, inputs, (NAME, PARTS), params, &receivers);
    let making = lists::Making {
        params,
        shafts,
        sizes,
        estimates: refine::no_estimates(graph, inputs),
    };
    let (lists, made) = making.add(graph, inputs, parts, receivers.visibility);
    let masks = masks::Masks {
        sizes,
        label: String::new(),
        slots: tiles,
        nodes: inputs.scene.node_count() as u32,
        params,
        shafts,
        lists,
    };
    let made = masks.add(graph, inputs, made);
    let (made, bound) = refine::Refining::new(masks, options, spent).add(graph, inputs, made);
    ShadowMask {
        error_bound: Some(bound),
        tally: Some(refine::tally(made.estimates)),
        ..ShadowMask::new(made.visibility)
    }
}

/// Declares the passes that settle, for another technique, the tiles that see all of the light or
/// nothing of it, from the pixels' centres; the others stay on the list. Returns how many there are of each, too. Without
/// `classes` nothing is declared, and all tiles stay.
pub(super) fn add_classes(
    graph: &mut Graph<'_>,
    inputs: &ShadowInputs<'_>,
    technique: &str,
    receivers: Receivers,
    classes: bool,
) -> (Receivers, Option<Tally>) {
    if !classes {
        return (receivers, None);
    }
    let [across, down] = tile_counts(inputs.camera.size());
    let options = ShaftOptions::DEFAULT;
    let sizes = Sizes::new(across * down, &options, inputs.scene.has_masks());
    let params = add_params(graph, inputs, &sizes, options.side, "params");
    let (shafts, parts) = add_shafts(graph, inputs, (technique, 1), params, &receivers);
    let making = lists::Making {
        params,
        shafts,
        sizes,
        estimates: refine::no_estimates(graph, inputs),
    };
    let (lists, made) = making.add(graph, inputs, parts, receivers.visibility);
    let receivers = Receivers {
        list: lists.tiles,
        visibility: made.visibility,
    };
    (receivers, Some(refine::tile_tally(made.estimates)))
}

/// Declares the uniform buffer of masks of `side` rows of samples.
fn add_params(
    graph: &mut Graph<'_>,
    inputs: &ShadowInputs<'_>,
    sizes: &Sizes,
    side: u32,
    what: &str,
) -> BufferId {
    let size = inputs.camera.size();
    let nodes = inputs.scene.node_count() as u32;
    let mut params = ShaftParams {
        counts: [size[0], size[1], nodes, sizes.chunks()],
        pattern: [
            side / BLOCK,
            (side / BLOCK).pow(2),
            sizes.edge_rows * POOL_WIDTH,
            level_of(side),
        ],
        rows: [[0.0; 4]; MOST_ROWS],
        strips: [[0.0; 4]; MOST_ROWS],
    };
    let rows = samples::rows(&inputs.light.shape, side);
    for (at, row) in rows.into_iter().enumerate() {
        params.rows[at] = row.texel();
        params.strips[at] = row.strip_texel(&inputs.light.shape);
    }
    let name = format!("{NAME}.{what} {}", inputs.light_name);
    add_uniform(graph, name, params)
}

/// 1 of 8 rows of samples, one more for twice as many.
fn level_of(side: u32) -> u32 {
    (side / BLOCK).ilog2() + 1
}

/// A list of tiles or their parts.
fn part_list(graph: &mut Graph<'_>, inputs: &ShadowInputs<'_>, what: &str) -> TileList {
    let [across, down] = tile_counts(inputs.camera.size());
    let size = [across * TILE_SIZE, down * TILE_SIZE * PARTS];
    TileList::create(graph, &format!("{NAME}.{what} {}", inputs.light_name), size)
}

/// The same with arguments of another dispatch over it, at [`OTHER_DISPATCH`].
fn part_list_for_two(graph: &mut Graph<'_>, inputs: &ShadowInputs<'_>, what: &str) -> TileList {
    let name = format!("{NAME}.{what}.arguments {}", inputs.light_name);
    TileList {
        arguments: graph.create_buffer(name, BufferDesc { size: 32 }),
        ..part_list(graph, inputs, what)
    }
}

/// Offset of the arguments of another dispatch over a list.
const OTHER_DISPATCH: u64 = 16;

/// Declares the pass that finds the shaft of each listed tile. `params`: a uniform buffer of the size
/// of [`ShaftParams`] that begins with the width and height of the picture.
/// With `most_parts` 1 tiles are left whole, and the parts listed are the tiles.
pub(super) fn add_shafts(
    graph: &mut Graph<'_>,
    inputs: &ShadowInputs<'_>,
    (technique, most_parts): (&str, u32),
    params: BufferId,
    receivers: &Receivers,
) -> (ImageId, TileList) {
    let name = &inputs.light_name;
    let [across, down] = tile_counts(inputs.camera.size());
    let format = vk::Format::R32G32B32A32_SFLOAT;
    let desc = ImageDesc::new(format, across * SHAFT_TEXELS, down * most_parts);
    let shafts = graph.create_image(format!("{technique}.shafts {name}"), desc);
    let (gbuffer, triangles) = (inputs.gbuffer, inputs.ids.triangles);
    let (view_params, part) = inputs.view_params;
    let tiles = receivers.list;
    let mut parts = part_list(graph, inputs, "parts");
    let size = inputs.camera.size();
    let mut rough = TileList::create(graph, &format!("{technique}.rough {name}"), size);
    let mut pass = graph.pass(format!("{technique}.begin {name}"), PassKind::Transfer);
    parts.clear(&mut pass);
    rough.clear(&mut pass);
    let cleared = [parts, rough];
    pass.record(move |ctx| cleared.iter().try_for_each(|list| list.record_clear(ctx)));
    let shape = shape_number(&inputs.light.shape);
    let tile_bounds = inputs.tile_bounds;
    let images = [gbuffer.view_depth, gbuffer.ids, triangles, tile_bounds];
    // Those of tiles with one triangle, then the others.
    let mut made = shafts;
    for is_rough in [false, true] {
        let (listed, what) = match is_rough {
            false => (tiles, "shafts"),
            true => (rough, "shafts_rough"),
        };
        let mut pass = graph.pass(format!("{technique}.{what} {name}"), PassKind::Compute);
        pass.read_part(view_params, part, Access::Uniform(Stage::Compute));
        pass.read(params, Access::Uniform(Stage::Compute));
        for image in images {
            pass.read(image, Access::StorageRead(Stage::Compute));
        }
        listed.read(&mut pass);
        if is_rough {
            parts.extend(&mut pass);
            made = pass.write(made, Access::StorageWrite(Stage::Compute));
        } else {
            parts.fill(&mut pass);
            rough.fill(&mut pass);
            made = pass.overwrite(made, Access::StorageWrite(Stage::Compute));
        }
        let (shafts, rough) = (made, rough);
        pass.record(move |ctx| {
            let nearest = SamplerDesc::nearest();
            let mut bindings = vec![
                Bind::uniform(0, view_params).part(part),
                Bind::uniform(1, params),
                Bind::storage_image(2, gbuffer.view_depth),
                Bind::storage_image(3, gbuffer.ids),
                Bind::storage_image(4, triangles),
                Bind::uniform(5, listed.arguments),
                Bind::sampled(6, listed.tiles, nearest),
                Bind::storage_image(7, shafts),
                Bind::storage_buffer(8, parts.arguments),
                Bind::storage_image(9, parts.tiles),
                Bind::storage_image(10, tile_bounds),
            ];
            let shader = match is_rough {
                false => &spirv::SHAFT_MASKS_SHAFTS_COMP,
                true => &spirv::SHAFT_MASKS_ROUGH_COMP,
            };
            if !is_rough {
                bindings.push(Bind::storage_buffer(11, rough.arguments));
                bindings.push(Bind::storage_image(12, rough.tiles));
            }
            let pipeline = ComputePipelineDesc {
                constants: vec![(0, shape), (2, most_parts)],
                ..ComputePipelineDesc::new(shader)
            };
            ctx.bind_compute(&pipeline, &bindings, &[])?;
            if is_rough {
                return listed.dispatch(ctx);
            }
            ctx.dispatch(shader.groups([across * down, 1, 1]));
            Ok(())
        });
    }
    (made, parts)
}
