//! The passes that find what is between tiles and the light.

use super::groups::Groups;
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

/// What a pass lists candidates of.
#[derive(Clone, Copy)]
enum Walk {
    /// Groups, which it takes apart where they have many.
    Groups,
    /// The tiles of groups that were taken apart, a group each.
    Singles,
    /// All of them again, with the same room for each, by these arguments.
    Again(BufferId),
}

/// What the passes that list candidates write, and the pass after them completes.
#[derive(Clone, Copy)]
struct Listed {
    groups: Groups,
    used: BufferId,
    pool: ImageId,
    /// RGBA32_UINT, [`LIST_TEXELS`] texels a group, at the place of the part that leads it.
    lists: ImageId,
}

/// Edges and triangles of groups.
struct GroupEntries {
    edges: ImageId,
    triangles: ImageId,
}

/// What the pass that settles tiles by their entries fills; nothing is in it yet.
struct Kinds {
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
        let (mut listed, kinds) = self.add_candidates(graph, inputs, made);
        let entries = self.add_entries(graph, inputs, &mut listed);
        self.add_classes(graph, inputs, (rest, listed, entries), kinds, made)
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

    /// Declares the passes that group the tiles that are left and list candidates of groups.
    fn add_candidates(
        &self,
        graph: &mut Graph<'_>,
        inputs: &ShadowInputs<'_>,
        made: Made,
    ) -> (Listed, Kinds) {
        let name = &inputs.light_name;
        let size = inputs.camera.size();
        let [across, down] = tile_counts(size);
        let sizes = self.sizes;
        let mut groups = Groups::create(graph, inputs);
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
        groups.clear(&mut pass);
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
        let cleared = groups;
        pass.record(move |ctx| {
            cleared.record_clear(ctx)?;
            for (buffer, offset, values) in arguments {
                ctx.update_buffer(buffer, offset, bytemuck::cast_slice(&values))?;
            }
            Ok(())
        });

        groups.add(graph, inputs, self.params, self.shafts, made.estimates);
        let format = vk::Format::R32G32B32A32_UINT;
        let pool = texels(format, sizes.chunks() * CHUNK_TEXELS);
        let pool = graph.create_image(format!("{NAME}.pool {name}"), pool);
        let desc = ImageDesc::new(format, across * LIST_TEXELS, down * PARTS);
        let lists = graph.create_image(format!("{NAME}.group_lists {name}"), desc);
        let mut listed = Listed {
            groups,
            used,
            pool,
            lists,
        };
        self.add_lists(graph, inputs, &mut listed, Walk::Groups);
        self.add_lists(graph, inputs, &mut listed, Walk::Singles);
        let again = self.add_overflow(graph, inputs, &mut listed);
        self.add_lists(graph, inputs, &mut listed, Walk::Again(again));
        let kinds = Kinds {
            further,
            partial,
            walk_rest,
            pieces,
            open,
            sorted: [plain, sorted],
        };
        (listed, kinds)
    }

    /// Declares a pass that lists candidates.
    fn add_lists(
        &self,
        graph: &mut Graph<'_>,
        inputs: &ShadowInputs<'_>,
        made: &mut Listed,
        walk: Walk,
    ) {
        let name = &inputs.light_name;
        let (params, part_shafts) = (self.params, self.shafts);
        let (hierarchy, triangles) = (inputs.ids.hierarchy, inputs.ids.triangles);
        let (view_params, part) = inputs.view_params;
        let shape = shape_number(&inputs.light.shape);
        let suffix = match walk {
            Walk::Groups => "",
            Walk::Singles => ".singles",
            Walk::Again(_) => ".again",
        };
        let mut pass = graph.pass(format!("{NAME}.lists{suffix} {name}"), PassKind::Compute);
        pass.read_part(view_params, part, Access::Uniform(Stage::Compute));
        pass.read(params, Access::Uniform(Stage::Compute));
        for image in [hierarchy, triangles, part_shafts] {
            pass.read(image, Access::StorageRead(Stage::Compute));
        }
        let groups = &mut made.groups;
        let written = Access::StorageWrite(Stage::Compute);
        // The shader may write to all lists but its own, for all that is known of it: where it does not, one that is no
        // longer needed is bound.
        let (tiles, listed, singles) = match walk {
            Walk::Groups => (groups.leading, &mut groups.listed, &mut groups.singles),
            Walk::Singles => (groups.singles, &mut groups.listed, &mut groups.leading),
            Walk::Again(_) => (groups.listed, &mut groups.leading, &mut groups.singles),
        };
        let arguments = match walk {
            Walk::Groups | Walk::Singles => tiles.arguments,
            Walk::Again(again) => {
                pass.read(again, Access::Indirect);
                again
            }
        };
        tiles.read(&mut pass);
        if matches!(walk, Walk::Groups) {
            listed.fill(&mut pass);
            singles.fill(&mut pass);
            made.pool = pass.overwrite(made.pool, written);
            made.lists = pass.overwrite(made.lists, written);
        } else {
            listed.extend(&mut pass);
            singles.extend(&mut pass);
            made.pool = pass.write(made.pool, written);
            made.lists = pass.write(made.lists, written);
        }
        let (listed, singles) = (*listed, *singles);
        groups.leaders = pass.write(groups.leaders, written);
        groups.shafts = pass.write(groups.shafts, Access::StorageReadWrite(Stage::Compute));
        made.used = pass.write(made.used, Access::StorageReadWrite(Stage::Compute));
        let made = *made;
        pass.record(move |ctx| {
            let nearest = SamplerDesc::nearest();
            let bindings = [
                Bind::uniform(0, view_params).part(part),
                Bind::uniform(1, params),
                Bind::storage_image(2, hierarchy),
                Bind::uniform(3, tiles.arguments),
                Bind::sampled(4, tiles.tiles, nearest),
                Bind::storage_image(5, made.groups.shafts),
                Bind::storage_image(6, triangles),
                Bind::storage_buffer(7, listed.arguments),
                Bind::storage_image(8, listed.tiles),
                Bind::storage_buffer(9, made.used),
                Bind::storage_image(10, made.pool),
                Bind::storage_image(11, made.lists),
                Bind::storage_buffer(12, singles.arguments),
                Bind::storage_image(13, singles.tiles),
                Bind::storage_image(14, made.groups.leaders),
                Bind::storage_image(15, part_shafts),
            ];
            let constants = vec![
                (0, shape),
                (1, u32::from(matches!(walk, Walk::Again(_)))),
                (2, u32::from(matches!(walk, Walk::Groups))),
            ];
            let pipeline = ComputePipelineDesc {
                constants,
                ..ComputePipelineDesc::new(&spirv::SHAFT_MASKS_LISTS_COMP)
            };
            ctx.bind_compute(&pipeline, &bindings, &[])?;
            ctx.dispatch_indirect(arguments, 0)
        });
    }

    /// Declares the pass that finds out whether lists have to be made again; returns arguments of that dispatch.
    fn add_overflow(
        &self,
        graph: &mut Graph<'_>,
        inputs: &ShadowInputs<'_>,
        made: &mut Listed,
    ) -> BufferId {
        let name = &inputs.light_name;
        let params = self.params;
        let groups = made.groups.listed.arguments;
        let again = BufferDesc { size: 16 };
        let again = graph.create_buffer(format!("{NAME}.overflow {name}"), again);
        let mut pass = graph.pass(format!("{NAME}.overflow {name}"), PassKind::Compute);
        for buffer in [params, groups] {
            pass.read(buffer, Access::Uniform(Stage::Compute));
        }
        made.used = pass.write(made.used, Access::StorageReadWrite(Stage::Compute));
        let again = pass.overwrite(again, Access::StorageWrite(Stage::Compute));
        let used = made.used;
        pass.record(move |ctx| {
            let bindings = [
                Bind::uniform(0, params),
                Bind::uniform(1, groups),
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

    /// Declares the pass that makes entries of groups from their candidates.
    fn add_entries(
        &self,
        graph: &mut Graph<'_>,
        inputs: &ShadowInputs<'_>,
        listed: &mut Listed,
    ) -> GroupEntries {
        let name = &inputs.light_name;
        let (sizes, params) = (self.sizes, self.params);
        let Listed {
            groups:
                Groups {
                    listed: tiles,
                    shafts,
                    ..
                },
            pool,
            ..
        } = *listed;
        let (edges, triangles) = create_entries(graph, "group_", name, &sizes);
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
        let lists = pass.write(listed.lists, Access::StorageReadWrite(Stage::Compute));
        let used = pass.write(listed.used, Access::StorageReadWrite(Stage::Compute));
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
        (listed.lists, listed.used) = (lists, used);
        GroupEntries { edges, triangles }
    }

    /// Declares the pass that settles tiles by their entries, and lists the others.
    fn add_classes(
        &self,
        graph: &mut Graph<'_>,
        inputs: &ShadowInputs<'_>,
        (tiles, listed, group_entries): (TileList, Listed, GroupEntries),
        kinds: Kinds,
        made: Made,
    ) -> (Lists, Made) {
        let name = &inputs.light_name;
        let (sizes, params, shafts) = (self.sizes, self.params, self.shafts);
        let Kinds {
            further,
            mut partial,
            walk_rest,
            mut pieces,
            mut open,
            sorted: [plain, mut others],
        } = kinds;
        let (edges, triangles) = create_entries(graph, "", name, &sizes);
        let [across, down] = tile_counts(inputs.camera.size());
        let format = vk::Format::R32G32B32A32_UINT;
        let lists = ImageDesc::new(format, across * LIST_TEXELS, down * PARTS);
        let lists = graph.create_image(format!("{NAME}.lists {name}"), lists);
        let (leaders, groups) = (listed.groups.leaders, listed.groups.listed.arguments);
        let of_groups = [listed.lists, group_entries.edges, group_entries.triangles];
        let tasks = sizes.pool_rows * POOL_WIDTH / sizes.task_entries;
        let tasks = texels(vk::Format::R32G32B32A32_UINT, tasks);
        let tasks = graph.create_image(format!("{NAME}.tasks {name}"), tasks);
        let (scene_triangles, view_depth) = (inputs.ids.triangles, inputs.gbuffer.view_depth);
        let (view_params, part) = inputs.view_params;
        let shape = shape_number(&inputs.light.shape);
        let mut pass = graph.pass(format!("{NAME}.classes {name}"), PassKind::Compute);
        pass.read_part(view_params, part, Access::Uniform(Stage::Compute));
        pass.read(params, Access::Uniform(Stage::Compute));
        pass.read(groups, Access::Uniform(Stage::Compute));
        for image in [scene_triangles, shafts, view_depth] {
            pass.read(image, Access::StorageRead(Stage::Compute));
        }
        for image in of_groups {
            pass.read(image, Access::StorageRead(Stage::Compute));
        }
        pass.read(leaders, Access::Sampled(Stage::Compute));
        tiles.read(&mut pass);
        partial.fill(&mut pass);
        pieces.fill(&mut pass);
        open.fill(&mut pass);
        others.fill(&mut pass);
        let plain = TileList {
            arguments: pass.write(plain.arguments, Access::StorageReadWrite(Stage::Compute)),
            tiles: others.tiles,
        };
        let lists = pass.overwrite(lists, Access::StorageWrite(Stage::Compute));
        let edges = pass.overwrite(edges, Access::StorageWrite(Stage::Compute));
        let triangles = pass.overwrite(triangles, Access::StorageWrite(Stage::Compute));
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
                Bind::storage_image(22, triangles),
                Bind::sampled(23, leaders, nearest),
                Bind::uniform(24, groups),
                Bind::storage_image(25, of_groups[0]),
                Bind::storage_image(26, of_groups[1]),
                Bind::storage_image(27, of_groups[2]),
            ];
            let pipeline = ComputePipelineDesc {
                constants: vec![(0, shape), (4, sizes.task_entries)],
                ..ComputePipelineDesc::new(&spirv::SHAFT_MASKS_CLASSES_COMP)
            };
            ctx.bind_compute(&pipeline, &bindings, &[])?;
            tiles.dispatch(ctx)
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

/// Images of edges and of triangles, both R32_UINT.
fn create_entries(
    graph: &mut Graph<'_>,
    of: &str,
    name: &str,
    sizes: &Sizes,
) -> (ImageId, ImageId) {
    let edges = texels(vk::Format::R32_UINT, sizes.edge_rows * POOL_WIDTH);
    let triangles = texels(vk::Format::R32_UINT, sizes.pool_rows * POOL_WIDTH);
    (
        graph.create_image(format!("{NAME}.{of}edges {name}"), edges),
        graph.create_image(format!("{NAME}.{of}triangles {name}"), triangles),
    )
}
