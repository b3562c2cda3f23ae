//! The passes that find the edges of each tile.

use super::DbufferOptions;
use super::overflow::Fitting;
use crate::geometry::{TileList, image_place, tile_counts};
use crate::gpu::{ComputePipelineDesc, SamplerDesc, spirv};
use crate::graph::{
    Access, Bind, BufferDesc, BufferId, Graph, ImageDesc, ImageId, PassBuilder, PassKind, Stage,
};
use crate::shadow::receivers::Receivers;
use crate::shadow::silhouettes::{Silhouettes, edge_count};
use crate::shadow::{ShadowInputs, shape_number};
use ash::vk;

/// Silhouettes of a box of each level, and of a block: `dbuffer/lists.glsl`.
const GROUPS: [u32; 3] = [16, 256, 4096];

/// Texels of a chunk of a list: `CHUNK` + 1 in `dbuffer/lists.glsl`.
const CHUNK_TEXELS: u32 = 32;

/// Most chunks of lists: 64 MiB.
const MOST_CHUNKS: u32 = 1 << 19;

/// Fewest tiles that lists have room for: a small picture's tiles are wide, and so are their shafts.
const LEAST_TILES: u32 = 1024;

/// Sizes of what the device fills.
#[derive(Clone, Copy, Debug)]
pub(in crate::shadow) struct Sizes {
    /// Edges of the scene: the most silhouettes that there can be.
    edges: u32,
    /// Blocks of silhouettes: none where triangles have holes and there are no edges.
    pub blocks: u32,
    /// Lists of a tile: one for each block, and one of triangles with holes if there are any.
    pub lists: u32,
    /// Chunks of lists that there is room for.
    pub chunks: u32,
}

impl Sizes {
    pub(super) fn new(inputs: &ShadowInputs<'_>, options: &DbufferOptions) -> Self {
        let edges = edge_count(inputs);
        let [across, down] = tile_counts(inputs.camera.size());
        let entries = (across * down).max(LEAST_TILES) * options.room;
        let cutouts = u32::from(inputs.scene.has_masks());
        // A tile has one list at least.
        let blocks = edges.div_ceil(GROUPS[2]).max(1 - cutouts);
        Self {
            edges,
            blocks,
            lists: blocks + cutouts,
            chunks: (entries / CHUNK_TEXELS).min(MOST_CHUNKS),
        }
    }
}

/// What the passes work on.
pub(in crate::shadow) struct Lists {
    /// In names of passes and images.
    pub technique: &'static str,
    pub params: BufferId,
    /// `None` without blocks of them.
    pub silhouettes: Option<Silhouettes>,
    pub receivers: Receivers,
    pub shafts: ImageId,
    /// R32F: what sees the light's centre.
    pub hard: ImageId,
    pub sizes: Sizes,
}

/// Lists and what they are made in.
#[derive(Clone, Copy)]
pub(super) struct Made {
    /// Number of chunks that lists have asked for.
    pub used: BufferId,
    pub pool: ImageId,
    pub chunk_boxes: ImageId,
    pub lists: ImageId,
    /// Whether lists are in there already.
    begun: bool,
}

impl Made {
    /// Declares that a pass adds lists.
    fn fill(&self, pass: &mut PassBuilder<'_, '_>) -> Self {
        let written = Access::StorageWrite(Stage::Compute);
        let mut fill = |image| match self.begun {
            true => pass.write(image, written),
            false => pass.overwrite(image, written),
        };
        Self {
            pool: fill(self.pool),
            chunk_boxes: fill(self.chunk_boxes),
            lists: fill(self.lists),
            used: pass.write(self.used, Access::StorageReadWrite(Stage::Compute)),
            begun: true,
        }
    }
}

/// The silhouettes that are listed.
#[derive(Clone, Copy)]
struct Edges {
    silhouettes: Silhouettes,
    ends: ImageId,
    /// Around as many as [`GROUPS`] says.
    boxes: [ImageId; 3],
}

/// What they make.
#[derive(Clone, Copy, Debug)]
pub(in crate::shadow) struct Found {
    /// R32_UINT: chunks of places in the list of silhouettes, and of numbers of triangles.
    pub pool: ImageId,
    /// RGBA32F: boxes around what chunks list, scene space, metres.
    pub chunk_boxes: ImageId,
    /// RGBA32_UINT: `list_place` in `dbuffer/lists.glsl`.
    pub lists: ImageId,
    /// RGBA32F: both ends of each silhouette, scene space, metres. Without blocks of them nobody looks there.
    pub ends: ImageId,
    /// Tiles with edges.
    pub tiles: TileList,
    /// `Through` in `dbuffer/through.glsl`.
    pub through: BufferId,
}

/// An image of so many texels, in rows.
fn texels(format: vk::Format, count: u32) -> ImageDesc {
    let [width, height] = image_place(count as usize);
    ImageDesc::new(format, width, height)
}

impl Lists {
    /// What a pass over the found tiles samples of the picture, the scene and its silhouettes: view depths, triangle
    /// numbers, triangles, hierarchy, edges, points, and numbers of the silhouettes.
    pub fn sampled(&self, inputs: &ShadowInputs<'_>) -> [ImageId; 7] {
        let (gbuffer, ids) = (inputs.gbuffer, inputs.ids);
        // Something must be bound.
        let numbers = self.silhouettes.map_or(ids.edges, |found| found.list);
        [
            gbuffer.view_depth,
            gbuffer.ids,
            ids.triangles,
            ids.hierarchy,
            ids.edges,
            ids.points,
            numbers,
        ]
    }

    /// Declares the passes; returns the visibility image too, in which all but the found tiles are
    /// done.
    pub(super) fn add(&self, graph: &mut Graph<'_>, inputs: &ShadowInputs<'_>) -> (Found, ImageId) {
        let technique = self.technique;
        let made = self.add_pool(graph, inputs);
        let edges = self.silhouettes.map(|silhouettes| {
            let desc = texels(vk::Format::R32G32B32A32_SFLOAT, 2 * self.sizes.edges);
            let mut ends =
                graph.create_image(format!("{technique}.ends {}", inputs.light_name), desc);
            let mut boxes: Vec<ImageId> = Vec::new();
            for (level, group) in GROUPS.into_iter().enumerate() {
                let below = level
                    .checked_sub(1)
                    .map(|below| (boxes[below], GROUPS[below]));
                let found = self.add_boxes(graph, inputs, silhouettes, group, below, &mut ends);
                boxes.push(found);
            }
            Edges {
                silhouettes,
                ends,
                boxes: [boxes[0], boxes[1], boxes[2]],
            }
        });
        let made = self.add_lists(graph, inputs, edges, made, None);
        let (made, fitting) = self.add_overflow(graph, inputs, made);
        let made = self.add_lists(graph, inputs, edges, made, Some(fitting));
        // Something must be bound.
        let ends = edges.map_or(inputs.ids.points, |edges| edges.ends);
        self.add_settle(graph, inputs, &made, ends)
    }

    /// The lists of all tiles, or again those of the tiles that fit.
    fn add_lists(
        &self,
        graph: &mut Graph<'_>,
        inputs: &ShadowInputs<'_>,
        edges: Option<Edges>,
        mut made: Made,
        fitting: Option<Fitting>,
    ) -> Made {
        if let Some(edges) = edges {
            made = self.add_edges(graph, inputs, edges, made, fitting);
        }
        if inputs.scene.has_masks() {
            made = self.add_cutouts(graph, inputs, made, fitting);
        }
        made
    }

    /// What is in names of passes that make lists, and the tiles that they are of.
    fn round(&self, fitting: Option<Fitting>) -> (&'static str, TileList) {
        fitting.map_or(("", self.receivers.list), |fitting| {
            (".again", fitting.tiles)
        })
    }

    fn add_boxes(
        &self,
        graph: &mut Graph<'_>,
        inputs: &ShadowInputs<'_>,
        silhouettes: Silhouettes,
        group: u32,
        below: Option<(ImageId, u32)>,
        ends: &mut ImageId,
    ) -> ImageId {
        let (technique, name) = (self.technique, &inputs.light_name);
        let count = self.sizes.edges.div_ceil(group);
        let desc = texels(vk::Format::R32G32B32A32_SFLOAT, 2 * count);
        let boxes = graph.create_image(format!("{technique}.boxes {name}.{group}"), desc);
        let (edges, points) = (inputs.ids.edges, inputs.ids.points);
        let Silhouettes { list, arguments } = silhouettes;
        let (lower, size) = below.unwrap_or((points, 0));
        let mut pass = graph.pass(
            format!("{technique}.boxes {name}.{group}"),
            PassKind::Compute,
        );
        pass.read(arguments, Access::Uniform(Stage::Compute));
        for image in [list, edges, points] {
            pass.read(image, Access::Sampled(Stage::Compute));
        }
        if below.is_some() {
            pass.read(lower, Access::Sampled(Stage::Compute));
        }
        let boxes = pass.overwrite(boxes, Access::StorageWrite(Stage::Compute));
        // Boxes of boxes write no ends; something must be bound.
        let bound_ends = if below.is_none() {
            *ends = pass.overwrite(*ends, Access::StorageWrite(Stage::Compute));
            *ends
        } else {
            boxes
        };
        pass.record(move |ctx| {
            let nearest = SamplerDesc::nearest();
            let bindings = [
                Bind::uniform(0, arguments),
                Bind::sampled(1, list, nearest),
                Bind::sampled(2, edges, nearest),
                Bind::sampled(3, points, nearest),
                Bind::sampled(4, lower, nearest),
                Bind::storage_image(5, boxes),
                Bind::storage_image(6, bound_ends),
            ];
            let shader = &spirv::DBUFFER_BOXES_COMP;
            ctx.bind_compute(
                &ComputePipelineDesc::new(shader),
                &bindings,
                bytemuck::bytes_of(&size),
            )?;
            ctx.dispatch(shader.groups([count, 1, 1]));
            Ok(())
        });
        boxes
    }

    /// Room for the lists, with nothing in it.
    fn add_pool(&self, graph: &mut Graph<'_>, inputs: &ShadowInputs<'_>) -> Made {
        let (technique, name) = (self.technique, &inputs.light_name);
        let [across, down] = tile_counts(inputs.camera.size());
        let used = graph.create_buffer(format!("{technique}.used {name}"), BufferDesc { size: 16 });
        let mut pass = graph.pass(format!("{technique}.clear {name}"), PassKind::Transfer);
        let used = pass.overwrite(used, Access::Clear);
        pass.record(move |ctx| ctx.update_buffer(used, 0, &[0; 16]));

        // And a chunk for all that finds no room.
        let chunks = self.sizes.chunks + 1;
        let pool = texels(vk::Format::R32_UINT, chunks * CHUNK_TEXELS);
        let pool = graph.create_image(format!("{technique}.pool {name}"), pool);
        let boxed = texels(vk::Format::R32G32B32A32_SFLOAT, 2 * chunks);
        let chunk_boxes = graph.create_image(format!("{technique}.chunk_boxes {name}"), boxed);
        let desc = texels(
            vk::Format::R32G32B32A32_UINT,
            across * down * self.sizes.lists,
        );
        let lists = graph.create_image(format!("{technique}.lists {name}"), desc);
        Made {
            used,
            pool,
            chunk_boxes,
            lists,
            begun: false,
        }
    }

    fn add_edges(
        &self,
        graph: &mut Graph<'_>,
        inputs: &ShadowInputs<'_>,
        found: Edges,
        made: Made,
        fitting: Option<Fitting>,
    ) -> Made {
        let (technique, name) = (self.technique, &inputs.light_name);
        let [across, down] = tile_counts(inputs.camera.size());
        let blocks = self.sizes.blocks;
        let (params, shafts) = (self.params, self.shafts);
        let (round, tiles) = self.round(fitting);
        let Edges {
            silhouettes,
            ends,
            boxes,
        } = found;
        let Silhouettes {
            list: numbers,
            arguments,
        } = silhouettes;
        let (edges, points) = (inputs.ids.edges, inputs.ids.points);
        let pass = format!("{technique}.lists{round} {name}");
        let mut pass = graph.pass(pass, PassKind::Compute);
        pass.read(params, Access::Uniform(Stage::Compute));
        pass.read(arguments, Access::Uniform(Stage::Compute));
        let read = [shafts, ends, numbers, edges, points];
        for image in read.into_iter().chain(boxes) {
            pass.read(image, Access::Sampled(Stage::Compute));
        }
        tiles.read(&mut pass);
        let made = made.fill(&mut pass);
        pass.record(move |ctx| {
            let nearest = SamplerDesc::nearest();
            let bindings = [
                Bind::uniform(0, params),
                Bind::uniform(1, tiles.arguments),
                Bind::sampled(2, tiles.tiles, nearest),
                Bind::sampled(3, shafts, nearest),
                Bind::uniform(4, arguments),
                Bind::sampled(5, ends, nearest),
                Bind::sampled(6, boxes[0], nearest),
                Bind::sampled(7, boxes[1], nearest),
                Bind::sampled(8, boxes[2], nearest),
                Bind::storage_buffer(9, made.used),
                Bind::storage_image(10, made.pool),
                Bind::storage_image(11, made.lists),
                Bind::storage_image(12, made.chunk_boxes),
                Bind::sampled(13, numbers, nearest),
                Bind::sampled(14, edges, nearest),
                Bind::sampled(15, points, nearest),
            ];
            let shader = &spirv::DBUFFER_LISTS_COMP;
            ctx.bind_compute(&ComputePipelineDesc::new(shader), &bindings, &[])?;
            if let Some(fitting) = fitting {
                return fitting.dispatch_lists(ctx);
            }
            let [groups, ..] = shader.groups([across * down, 1, 1]);
            ctx.dispatch([blocks, groups, 1]);
            Ok(())
        });
        made
    }

    fn add_cutouts(
        &self,
        graph: &mut Graph<'_>,
        inputs: &ShadowInputs<'_>,
        made: Made,
        fitting: Option<Fitting>,
    ) -> Made {
        let (technique, name) = (self.technique, &inputs.light_name);
        let [across, down] = tile_counts(inputs.camera.size());
        let (params, shafts) = (self.params, self.shafts);
        let (round, tiles) = self.round(fitting);
        let (triangles, hierarchy) = (inputs.ids.triangles, inputs.ids.hierarchy);
        let pass = format!("{technique}.cutouts{round} {name}");
        let mut pass = graph.pass(pass, PassKind::Compute);
        pass.read(params, Access::Uniform(Stage::Compute));
        for image in [shafts, triangles, hierarchy] {
            pass.read(image, Access::Sampled(Stage::Compute));
        }
        tiles.read(&mut pass);
        let made = made.fill(&mut pass);
        pass.record(move |ctx| {
            let nearest = SamplerDesc::nearest();
            let bindings = [
                Bind::uniform(0, params),
                Bind::uniform(1, tiles.arguments),
                Bind::sampled(2, tiles.tiles, nearest),
                Bind::sampled(3, shafts, nearest),
                Bind::sampled(4, triangles, nearest),
                Bind::sampled(5, hierarchy, nearest),
                Bind::storage_buffer(6, made.used),
                Bind::storage_image(7, made.pool),
                Bind::storage_image(8, made.lists),
                Bind::storage_image(9, made.chunk_boxes),
            ];
            let shader = &spirv::DBUFFER_CUTOUTS_COMP;
            ctx.bind_compute(&ComputePipelineDesc::new(shader), &bindings, &[])?;
            if let Some(fitting) = fitting {
                return fitting.tiles.dispatch(ctx);
            }
            ctx.dispatch(shader.groups([across * down, 1, 1]));
            Ok(())
        });
        made
    }

    fn add_settle(
        &self,
        graph: &mut Graph<'_>,
        inputs: &ShadowInputs<'_>,
        made: &Made,
        ends: ImageId,
    ) -> (Found, ImageId) {
        let (technique, name) = (self.technique, &inputs.light_name);
        let size = inputs.camera.size();
        let [across, down] = tile_counts(size);
        let Made {
            pool,
            chunk_boxes,
            lists,
            ..
        } = *made;
        let mut penumbra = TileList::create(graph, &format!("{technique}.penumbra {name}"), size);
        let mut pass = graph.pass(format!("{technique}.penumbra {name}"), PassKind::Transfer);
        penumbra.clear(&mut pass);
        let cleared = penumbra;
        pass.record(move |ctx| cleared.record_clear(ctx));

        let through = add_through(graph, inputs, technique);
        let (params, shafts, hard) = (self.params, self.shafts, self.hard);
        let tiles = self.receivers.list;
        let mut pass = graph.pass(format!("{technique}.settle {name}"), PassKind::Compute);
        pass.read(params, Access::Uniform(Stage::Compute));
        pass.read(through, Access::Uniform(Stage::Compute));
        for image in [shafts, lists, hard] {
            pass.read(image, Access::Sampled(Stage::Compute));
        }
        tiles.read(&mut pass);
        penumbra.fill(&mut pass);
        let visibility = self.receivers.visibility;
        let visibility = pass.write(visibility, Access::StorageWrite(Stage::Compute));
        pass.record(move |ctx| {
            let nearest = SamplerDesc::nearest();
            let bindings = [
                Bind::uniform(0, params),
                Bind::uniform(1, tiles.arguments),
                Bind::sampled(2, tiles.tiles, nearest),
                Bind::sampled(3, shafts, nearest),
                Bind::sampled(4, lists, nearest),
                Bind::sampled(5, hard, nearest),
                Bind::storage_buffer(6, penumbra.arguments),
                Bind::storage_image(7, penumbra.tiles),
                Bind::storage_image(8, visibility),
                Bind::uniform(9, through),
            ];
            let shader = &spirv::DBUFFER_SETTLE_COMP;
            ctx.bind_compute(&ComputePipelineDesc::new(shader), &bindings, &[])?;
            ctx.dispatch(shader.groups([across * down, 1, 1]));
            Ok(())
        });
        let tiles = penumbra;
        let found = Found {
            pool,
            chunk_boxes,
            lists,
            ends,
            tiles,
            through,
        };
        (found, visibility)
    }
}

/// Whether a surface cuts through the light. Nothing cuts a sun.
fn add_through(graph: &mut Graph<'_>, inputs: &ShadowInputs<'_>, technique: &str) -> BufferId {
    let name = &inputs.light_name;
    let through = graph.create_buffer(
        format!("{technique}.through {name}"),
        BufferDesc { size: 16 },
    );
    if inputs.light.shape.is_sun() {
        let mut pass = graph.pass(format!("{technique}.through {name}"), PassKind::Transfer);
        let through = pass.overwrite(through, Access::Clear);
        pass.record(move |ctx| ctx.update_buffer(through, 0, &[0; 16]));
        return through;
    }
    let (view_params, part) = inputs.view_params;
    let (triangles, hierarchy) = (inputs.ids.triangles, inputs.ids.hierarchy);
    let shape = shape_number(&inputs.light.shape);
    let nodes = inputs.scene.node_count() as u32;
    let mut pass = graph.pass(format!("{technique}.through {name}"), PassKind::Compute);
    pass.read_part(view_params, part, Access::Uniform(Stage::Compute));
    pass.read(triangles, Access::Sampled(Stage::Compute));
    pass.read(hierarchy, Access::Sampled(Stage::Compute));
    let through = pass.overwrite(through, Access::StorageWrite(Stage::Compute));
    pass.record(move |ctx| {
        let nearest = SamplerDesc::nearest();
        let bindings = [
            Bind::uniform(0, view_params).part(part),
            Bind::sampled(1, triangles, nearest),
            Bind::sampled(2, hierarchy, nearest),
            Bind::storage_buffer(3, through),
        ];
        let pipeline = ComputePipelineDesc {
            constants: vec![(0, shape)],
            ..ComputePipelineDesc::new(&spirv::DBUFFER_THROUGH_COMP)
        };
        ctx.bind_compute(&pipeline, &bindings, bytemuck::bytes_of(&nodes))?;
        ctx.dispatch([1, 1, 1]);
        Ok(())
    });
    through
}
