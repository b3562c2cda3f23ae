//! Visibility from occluding edges of the mesh, listed for each tile.

use super::{LineParams, NAME};
use crate::geometry::image_place;
use crate::gpu::{ComputePipelineDesc, SamplerDesc, spirv};
use crate::graph::{Access, Bind, Graph, ImageDesc, ImageId, PassKind, Stage};
use crate::shadow::dbuffer::{self, DbufferOptions};
use crate::shadow::silhouettes::Silhouettes;
use crate::shadow::uniform::add_uniform;
use crate::shadow::{ShadowInputs, ShadowMask, hard};
use ash::vk;

/// Most edges of a tile: receivers of tiles with more send rays to the cells of the line. As many cost less than
/// these rays, and all loops together stay below the turns after which software drivers end them.
const MOST_EDGES: u32 = 6144;

/// Declares the passes. `texels`: across and down the map of what sees the line's centre.
pub(super) fn add_passes<'f>(
    graph: &mut Graph<'f>,
    inputs: &ShadowInputs<'f>,
    line: LineParams,
    texels: u32,
) -> ShadowMask {
    let name = &inputs.light_name;
    let base = format!("{NAME}.hard");
    let hard = hard::add_hard_at(graph, inputs, &base, format!("{base} {name}"), texels);
    let options = DbufferOptions {
        most_edges: MOST_EDGES,
        ..DbufferOptions::DEFAULT
    };
    let (tools, found, visibility) = dbuffer::add_edge_lists(graph, inputs, NAME, &options, hard);
    let Some(silhouettes) = tools.silhouettes else {
        unreachable!("only beside triangles with holes may no edges be listed");
    };
    let turns = add_turns(graph, inputs, &silhouettes, found.ends);
    let line = add_uniform(graph, format!("{NAME}.line {name}"), line);
    let (view_params, part) = inputs.view_params;
    let (params, tiles) = (tools.params, found.tiles);
    let mut pass = graph.pass(format!("{NAME}.visibility {name}"), PassKind::Compute);
    pass.read_part(view_params, part, Access::Uniform(Stage::Compute));
    for buffer in [params, line, found.through] {
        pass.read(buffer, Access::Uniform(Stage::Compute));
    }
    let sampled = tools.sampled(inputs);
    let stored = [found.ends, found.pool, found.chunk_boxes];
    let settled = [found.lists, hard];
    for image in sampled.into_iter().chain(settled) {
        pass.read(image, Access::Sampled(Stage::Compute));
    }
    for image in stored.into_iter().chain([turns]) {
        pass.read(image, Access::StorageRead(Stage::Compute));
    }
    tiles.read(&mut pass);
    let visibility = pass.write(visibility, Access::StorageWrite(Stage::Compute));
    pass.record(move |ctx| {
        let nearest = SamplerDesc::nearest();
        let mut bindings = vec![
            Bind::uniform(0, view_params).part(part),
            Bind::uniform(1, params),
            Bind::uniform(2, line),
        ];
        let sampled = (3..).zip(sampled).chain((13..).zip(settled));
        bindings.extend(sampled.map(|(binding, image)| Bind::sampled(binding, image, nearest)));
        let stored = (10..).zip(stored).chain([(19, turns)]);
        bindings.extend(stored.map(|(binding, image)| Bind::storage_image(binding, image)));
        bindings.extend([
            Bind::storage_image(15, visibility),
            Bind::uniform(16, tiles.arguments),
            Bind::sampled(17, tiles.tiles, nearest),
            Bind::uniform(18, found.through),
        ]);
        let pipeline = ComputePipelineDesc::new(&spirv::OESS_SILHOUETTES_COMP);
        ctx.bind_compute(&pipeline, &bindings, &[])?;
        tiles.dispatch(ctx)
    });
    ShadowMask {
        silhouettes: tools.silhouettes,
        ..ShadowMask::new(visibility)
    }
}

/// Where both ends of each silhouette lie around the line, RGBA32F: `oess/turns.glsl`.
fn add_turns(
    graph: &mut Graph<'_>,
    inputs: &ShadowInputs<'_>,
    silhouettes: &Silhouettes,
    ends: ImageId,
) -> ImageId {
    let name = format!("{NAME}.turns {}", inputs.light_name);
    let [width, height] = image_place(inputs.scene.edge_count());
    let desc = ImageDesc::new(vk::Format::R32G32B32A32_SFLOAT, width, height);
    let turns = graph.create_image(name.clone(), desc);
    let (view_params, part) = inputs.view_params;
    let silhouettes = *silhouettes;
    let mut pass = graph.pass(name, PassKind::Compute);
    pass.read_part(view_params, part, Access::Uniform(Stage::Compute));
    pass.read(silhouettes.arguments, Access::Indirect);
    pass.read(silhouettes.arguments, Access::Uniform(Stage::Compute));
    pass.read(ends, Access::Sampled(Stage::Compute));
    let turns = pass.overwrite(turns, Access::StorageWrite(Stage::Compute));
    pass.record(move |ctx| {
        let bindings = [
            Bind::uniform(0, view_params).part(part),
            Bind::uniform(1, silhouettes.arguments),
            Bind::sampled(2, ends, SamplerDesc::nearest()),
            Bind::storage_image(3, turns),
        ];
        ctx.bind_compute(
            &ComputePipelineDesc::new(&spirv::OESS_TURNS_COMP),
            &bindings,
            &[],
        )?;
        silhouettes.dispatch(ctx)
    });
    turns
}
