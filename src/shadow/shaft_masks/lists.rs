//! The passes that find what is between tiles and the light.

use super::walk::{WalkRest, runs_in_dispatch};
use super::{
    CHUNK_TEXELS, LIST_TEXELS, Lists, Made, NAME, OTHER_DISPATCH, PARTS, POOL_WIDTH, Sizes,
    part_list, part_list_for_two, texels,
};
use crate::geometry::{TileList, tile_counts};
use crate::gpu::{ComputePipelineDesc, SamplerDesc, spirv};
use crate::graph::{
    Access, Bind, BufferDesc, BufferId, Graph, ImageDesc, ImageId, PassKind, Stage,
};
use crate::shadow::{ShadowInputs, shape_number};
use ash::vk;

/// What the passes share.
pub(super) struct Making {
    pub params: BufferId,
    pub shafts: ImageId,
    pub sizes: Sizes,
    /// Of no tile yet.
    pub estimates: ImageId,
}

/// What the passes that list candidates write.
#[derive(Clone, Copy)]
struct Listed {
    penumbra: TileList,
    used: BufferId,
    pool: ImageId,
    lists: ImageId,
    estimates: ImageId,
}

/// Candidates of tiles, between the two passes.
struct Candidates {
    tiles: TileList,
    lists: ImageId,
    pool: ImageId,
    used: BufferId,
    further: BufferId,
    partial: TileList,
    walk_rest: WalkRest,
    pieces: TileList,
    /// Tiles that masks are made of.
    open: TileList,
    /// `sorted` of [`Lists`].
    sorted: [TileList; 2],
}

impl Making {
    /// Declares the passes; returns the lists, the visibility of the tiles settled so far, and the
    /// estimates.
    pub(super) fn add(
        &self,
        graph: &mut Graph<'_>,
        inputs: &ShadowInputs<'_>,
        parts: TileList,
        visibility: ImageId,
    ) -> (Lists, Made) {
        let made = Made {
            visibility,
            estimates: self.estimates,
        };
        let (rest, made) = self.add_settled(graph, inputs, parts, made);
        let (candidates, made) = self.add_candidates(graph, inputs, rest, made);
        let (candidates, entries) = self.add_entries(graph, inputs, candidates);
        self.add_classes(graph, inputs, candidates, entries, made)
    }

    /// Declares the passes that settle tiles by a short walk; returns the list of the others.
    fn add_settled(
        &self,
        graph: &mut Graph<'_>,
        inputs: &ShadowInputs<'_>,
        parts: TileList,
        made: Made,
    ) -> (TileList, Made) {
        let name = &inputs.light_name;
        let (params, shafts) = (self.params, self.shafts);
        let mut rest = part_list(graph, inputs, "rest");
        let mut pass = graph.pass(format!("{NAME}.no_rest {name}"), PassKind::Transfer);
        rest.clear(&mut pass);
        let cleared = rest;
        pass.record(move |ctx| cleared.record_clear(ctx));
        let (hierarchy, triangles) = (inputs.ids.hierarchy, inputs.ids.triangles);
        let view_depth = inputs.gbuffer.view_depth;
        let (view_params, part) = inputs.view_params;
        let shape = shape_number(&inputs.light.shape);
        let mut pass = graph.pass(format!("{NAME}.settle {name}"), PassKind::Compute);
        pass.read_part(view_params, part, Access::Uniform(Stage::Compute));
        pass.read(params, Access::Uniform(Stage::Compute));
        for image in [hierarchy, triangles, shafts, view_depth] {
            pass.read(image, Access::StorageRead(Stage::Compute));
        }
        parts.read(&mut pass);
        rest.fill(&mut pass);
        let visibility = pass.write(made.visibility, Access::StorageWrite(Stage::Compute));
        let estimates = pass.write(made.estimates, Access::StorageWrite(Stage::Compute));
        pass.record(move |ctx| {
            let nearest = SamplerDesc::nearest();
            let bindings = [
                Bind::uniform(0, view_params).part(part),
                Bind::uniform(1, params),
                Bind::storage_image(2, hierarchy),
                Bind::uniform(3, parts.arguments),
                Bind::sampled(4, parts.tiles, nearest),
                Bind::storage_image(5, shafts),
                Bind::storage_image(6, triangles),
                Bind::storage_image(7, visibility),
                Bind::storage_image(8, view_depth),
                Bind::storage_image(9, estimates),
                Bind::storage_buffer(10, rest.arguments),
                Bind::storage_image(11, rest.tiles),
            ];
            let shader = &spirv::SHAFT_MASKS_SETTLE_COMP;
            let pipeline = ComputePipelineDesc {
                constants: vec![(0, shape)],
                ..ComputePipelineDesc::new(shader)
            };
            ctx.bind_compute(&pipeline, &bindings, &[])?;
            parts.dispatch(ctx)
        });
        let made = Made {
            visibility,
            estimates,
        };
        (rest, made)
    }

    fn add_candidates(
        &self,
        graph: &mut Graph<'_>,
        inputs: &ShadowInputs<'_>,
        rest: TileList,
        made: Made,
    ) -> (Candidates, Made) {
        let name = &inputs.light_name;
        let size = inputs.camera.size();
        let [across, down] = tile_counts(size);
        let sizes = self.sizes;
        let mut penumbra = part_list_for_two(graph, inputs, "penumbra");
        let mut open = part_list(graph, inputs, "open");
        let mut plain = part_list(graph, inputs, "plain");
        let mut sorted = part_list(graph, inputs, "sorted");
        let mut partial = part_list(graph, inputs, "partial");
        let mut walk_rest = WalkRest::create(graph, inputs, "");
        let mut pieces = part_list_for_two(graph, inputs, "pieces");
        let sixteen = BufferDesc { size: 16 };
        let used = graph.create_buffer(format!("{NAME}.used {name}"), sixteen);
        let further = graph.create_buffer(format!("{NAME}.further {name}"), sixteen);
        let mut pass = graph.pass(format!("{NAME}.clear {name}"), PassKind::Transfer);
        penumbra.clear(&mut pass);
        open.clear(&mut pass);
        plain.clear(&mut pass);
        sorted.clear(&mut pass);
        partial.clear(&mut pass);
        walk_rest.arguments = pass.overwrite(walk_rest.arguments, Access::Clear);
        pieces.clear(&mut pass);
        let used = pass.overwrite(used, Access::Clear);
        let further = pass.overwrite(further, Access::Clear);
        let runs = runs_in_dispatch(inputs.scene.node_count() as u32, &sizes);
        // Workgroups across, down, and for each block of samples; number of entries.
        let none = [0u32, 1, 1, 0];
        let of_blocks = [0, 1, sizes.blocks, 0];
        let arguments = [
            (penumbra.arguments, 0, none),
            (penumbra.arguments, OTHER_DISPATCH, none),
            (open.arguments, 0, none),
            (plain.arguments, 0, none),
            (sorted.arguments, 0, none),
            (further, 0, of_blocks),
            (partial.arguments, 0, of_blocks),
            (walk_rest.arguments, 0, [0, 1, runs * sizes.blocks, 0]),
            (pieces.arguments, 0, none),
            (pieces.arguments, OTHER_DISPATCH, of_blocks),
            (used, 0, [0; 4]),
        ];
        pass.record(move |ctx| {
            for (buffer, offset, values) in arguments {
                ctx.update_buffer(buffer, offset, bytemuck::cast_slice(&values))?;
            }
            Ok(())
        });

        let format = vk::Format::R32G32B32A32_UINT;
        let pool = texels(format, sizes.chunks() * CHUNK_TEXELS);
        let pool = graph.create_image(format!("{NAME}.pool {name}"), pool);
        let format = vk::Format::R32G32B32A32_UINT;
        let desc = ImageDesc::new(format, across * LIST_TEXELS, down * PARTS);
        let lists = graph.create_image(format!("{NAME}.lists {name}"), desc);
        let mut listed = Listed {
            penumbra,
            used,
            pool,
            lists,
            estimates: made.estimates,
        };
        self.add_lists(graph, inputs, rest, &mut listed, None);
        let again = self.add_overflow(graph, inputs, rest, &mut listed);
        self.add_lists(graph, inputs, rest, &mut listed, Some(again));
        let Listed {
            penumbra,
            used,
            pool,
            lists,
            estimates,
        } = listed;
        let candidates = Candidates {
            tiles: penumbra,
            lists,
            pool,
            used,
            further,
            partial,
            walk_rest,
            pieces,
            open,
            sorted: [plain, sorted],
        };
        (candidates, Made { estimates, ..made })
    }

    /// Declares the pass that lists candidates, or lists them again with the same room for all tiles: by the given
    /// arguments.
    fn add_lists(
        &self,
        graph: &mut Graph<'_>,
        inputs: &ShadowInputs<'_>,
        rest: TileList,
        made: &mut Listed,
        again: Option<BufferId>,
    ) {
        let name = &inputs.light_name;
        let (params, shafts) = (self.params, self.shafts);
        let (hierarchy, triangles) = (inputs.ids.hierarchy, inputs.ids.triangles);
        let (view_params, part) = inputs.view_params;
        let shape = shape_number(&inputs.light.shape);
        let suffix = again.map_or("", |_| ".again");
        let mut pass = graph.pass(format!("{NAME}.lists{suffix} {name}"), PassKind::Compute);
        pass.read_part(view_params, part, Access::Uniform(Stage::Compute));
        pass.read(params, Access::Uniform(Stage::Compute));
        for image in [hierarchy, triangles, shafts] {
            pass.read(image, Access::StorageRead(Stage::Compute));
        }
        rest.read(&mut pass);
        let written = Access::StorageWrite(Stage::Compute);
        if let Some(again) = again {
            pass.read(again, Access::Indirect);
            made.penumbra.arguments = pass.write(
                made.penumbra.arguments,
                Access::StorageReadWrite(Stage::Compute),
            );
            made.penumbra.tiles = pass.write(made.penumbra.tiles, written);
            made.pool = pass.write(made.pool, written);
            made.lists = pass.write(made.lists, written);
        } else {
            made.penumbra.fill(&mut pass);
            made.pool = pass.overwrite(made.pool, written);
            made.lists = pass.overwrite(made.lists, written);
        }
        made.used = pass.write(made.used, Access::StorageReadWrite(Stage::Compute));
        made.estimates = pass.write(made.estimates, written);
        let made = *made;
        pass.record(move |ctx| {
            let nearest = SamplerDesc::nearest();
            let bindings = [
                Bind::uniform(0, view_params).part(part),
                Bind::uniform(1, params),
                Bind::storage_image(2, hierarchy),
                Bind::uniform(3, rest.arguments),
                Bind::sampled(4, rest.tiles, nearest),
                Bind::storage_image(5, shafts),
                Bind::storage_image(6, triangles),
                Bind::storage_buffer(7, made.penumbra.arguments),
                Bind::storage_image(8, made.penumbra.tiles),
                Bind::storage_buffer(9, made.used),
                Bind::storage_image(10, made.pool),
                Bind::storage_image(11, made.lists),
                Bind::storage_image(12, made.estimates),
            ];
            let pipeline = ComputePipelineDesc {
                constants: vec![(0, shape), (1, u32::from(again.is_some()))],
                ..ComputePipelineDesc::new(&spirv::SHAFT_MASKS_LISTS_COMP)
            };
            ctx.bind_compute(&pipeline, &bindings, &[])?;
            ctx.dispatch_indirect(again.unwrap_or(rest.arguments), 0)
        });
    }

    /// Declares the pass that finds out whether lists have to be made again; returns arguments of that dispatch.
    fn add_overflow(
        &self,
        graph: &mut Graph<'_>,
        inputs: &ShadowInputs<'_>,
        rest: TileList,
        made: &mut Listed,
    ) -> BufferId {
        let name = &inputs.light_name;
        let params = self.params;
        let again = BufferDesc { size: 16 };
        let again = graph.create_buffer(format!("{NAME}.overflow {name}"), again);
        let mut pass = graph.pass(format!("{NAME}.overflow {name}"), PassKind::Compute);
        for buffer in [params, rest.arguments] {
            pass.read(buffer, Access::Uniform(Stage::Compute));
        }
        made.used = pass.write(made.used, Access::StorageReadWrite(Stage::Compute));
        let again = pass.overwrite(again, Access::StorageWrite(Stage::Compute));
        let used = made.used;
        pass.record(move |ctx| {
            let bindings = [
                Bind::uniform(0, params),
                Bind::uniform(1, rest.arguments),
                Bind::storage_buffer(2, used),
                Bind::storage_buffer(3, again),
            ];
            let pipeline = ComputePipelineDesc::new(&spirv::SHAFT_MASKS_OVERFLOW_COMP);
            ctx.bind_compute(&pipeline, &bindings, &[])?;
            ctx.dispatch([1, 1, 1]);
            Ok(())
        });
        again
    }

    /// Declares the pass that makes entries for the masks from candidates; returns what it makes with them, and the
    /// images of edges and triangles.
    fn add_entries(
        &self,
        graph: &mut Graph<'_>,
        inputs: &ShadowInputs<'_>,
        candidates: Candidates,
    ) -> (Candidates, [ImageId; 2]) {
        let name = &inputs.light_name;
        let (sizes, params, shafts) = (self.sizes, self.params, self.shafts);
        let Candidates {
            tiles,
            lists,
            pool,
            used,
            ..
        } = candidates;
        let edges = texels(vk::Format::R32_UINT, sizes.edge_rows * POOL_WIDTH);
        let edges = graph.create_image(format!("{NAME}.edges {name}"), edges);
        let triangles = texels(vk::Format::R32_UINT, sizes.pool_rows * POOL_WIDTH);
        let triangles = graph.create_image(format!("{NAME}.triangles {name}"), triangles);
        let ids = inputs.ids;
        let (view_params, part) = inputs.view_params;
        let shape = shape_number(&inputs.light.shape);
        let mut pass = graph.pass(format!("{NAME}.entries {name}"), PassKind::Compute);
        pass.read_part(view_params, part, Access::Uniform(Stage::Compute));
        pass.read(params, Access::Uniform(Stage::Compute));
        for image in [ids.triangles, ids.neighbours, shafts, pool] {
            pass.read(image, Access::StorageRead(Stage::Compute));
        }
        tiles.read(&mut pass);
        let lists = pass.write(lists, Access::StorageReadWrite(Stage::Compute));
        let used = pass.write(used, Access::StorageReadWrite(Stage::Compute));
        let edges = pass.overwrite(edges, Access::StorageWrite(Stage::Compute));
        let triangles = pass.overwrite(triangles, Access::StorageWrite(Stage::Compute));
        pass.record(move |ctx| {
            let nearest = SamplerDesc::nearest();
            let bindings = [
                Bind::uniform(0, view_params).part(part),
                Bind::uniform(1, params),
                Bind::storage_image(3, ids.triangles),
                Bind::storage_image(4, ids.neighbours),
                Bind::uniform(5, tiles.arguments),
                Bind::sampled(6, tiles.tiles, nearest),
                Bind::storage_image(7, shafts),
                Bind::storage_image(8, pool),
                Bind::storage_image(9, lists),
                Bind::storage_buffer(10, used),
                Bind::storage_image(11, edges),
                Bind::storage_image(12, triangles),
            ];
            let pipeline = ComputePipelineDesc {
                constants: vec![(0, shape)],
                ..ComputePipelineDesc::new(&spirv::SHAFT_MASKS_ENTRIES_COMP)
            };
            ctx.bind_compute(&pipeline, &bindings, &[])?;
            tiles.dispatch(ctx)
        });
        let candidates = Candidates {
            lists,
            used,
            ..candidates
        };
        (candidates, [edges, triangles])
    }

    /// Declares the pass that settles tiles by their entries, and lists the others.
    fn add_classes(
        &self,
        graph: &mut Graph<'_>,
        inputs: &ShadowInputs<'_>,
        candidates: Candidates,
        [edges, triangles]: [ImageId; 2],
        made: Made,
    ) -> (Lists, Made) {
        let name = &inputs.light_name;
        let (sizes, params, shafts) = (self.sizes, self.params, self.shafts);
        let Candidates {
            tiles,
            lists,
            further,
            mut partial,
            walk_rest,
            mut pieces,
            mut open,
            sorted: [plain, mut others],
            ..
        } = candidates;
        let tasks = sizes.pool_rows * POOL_WIDTH / sizes.task_entries;
        let tasks = texels(vk::Format::R32G32B32A32_UINT, tasks);
        let tasks = graph.create_image(format!("{NAME}.tasks {name}"), tasks);
        let (scene_triangles, view_depth) = (inputs.ids.triangles, inputs.gbuffer.view_depth);
        let (view_params, part) = inputs.view_params;
        let shape = shape_number(&inputs.light.shape);
        let mut pass = graph.pass(format!("{NAME}.classes {name}"), PassKind::Compute);
        pass.read_part(view_params, part, Access::Uniform(Stage::Compute));
        pass.read(params, Access::Uniform(Stage::Compute));
        for image in [scene_triangles, shafts, view_depth, edges] {
            pass.read(image, Access::StorageRead(Stage::Compute));
        }
        tiles.read(&mut pass);
        partial.fill(&mut pass);
        pieces.fill(&mut pass);
        open.fill(&mut pass);
        others.fill(&mut pass);
        let plain = TileList {
            arguments: pass.write(plain.arguments, Access::StorageReadWrite(Stage::Compute)),
            tiles: others.tiles,
        };
        let lists = pass.write(lists, Access::StorageReadWrite(Stage::Compute));
        let further = pass.write(further, Access::StorageReadWrite(Stage::Compute));
        let tasks = pass.overwrite(tasks, Access::StorageWrite(Stage::Compute));
        let visibility = pass.write(made.visibility, Access::StorageWrite(Stage::Compute));
        let estimates = pass.write(made.estimates, Access::StorageWrite(Stage::Compute));
        pass.record(move |ctx| {
            let nearest = SamplerDesc::nearest();
            let bindings = [
                Bind::uniform(0, view_params).part(part),
                Bind::uniform(1, params),
                Bind::storage_image(2, scene_triangles),
                Bind::uniform(3, tiles.arguments),
                Bind::sampled(4, tiles.tiles, nearest),
                Bind::storage_image(5, shafts),
                Bind::storage_image(6, edges),
                Bind::storage_image(7, lists),
                Bind::storage_image(8, visibility),
                Bind::storage_image(9, view_depth),
                Bind::storage_image(10, estimates),
                Bind::storage_buffer(11, further),
                Bind::storage_image(12, tasks),
                Bind::storage_buffer(13, partial.arguments),
                Bind::storage_image(14, partial.tiles),
                Bind::storage_buffer(15, open.arguments),
                Bind::storage_image(16, open.tiles),
                Bind::storage_buffer(17, pieces.arguments),
                Bind::storage_image(18, pieces.tiles),
                Bind::storage_buffer(19, plain.arguments),
                Bind::storage_buffer(20, others.arguments),
                Bind::storage_image(21, others.tiles),
            ];
            let pipeline = ComputePipelineDesc {
                constants: vec![(0, shape), (4, sizes.task_entries)],
                ..ComputePipelineDesc::new(&spirv::SHAFT_MASKS_CLASSES_COMP)
            };
            ctx.bind_compute(&pipeline, &bindings, &[])?;
            ctx.dispatch_indirect(tiles.arguments, OTHER_DISPATCH)
        });
        let lists = Lists {
            tiles: open,
            // Where there are several blocks of samples all are in pieces.
            sorted: (sizes.blocks == 1).then_some([plain, others]),
            lists,
            edges,
            triangles,
            further,
            tasks,
            partial,
            walk_rest,
            pieces,
        };
        let made = Made {
            visibility,
            estimates,
        };
        (lists, made)
    }
}
