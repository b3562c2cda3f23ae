//! Visibility from occluding edges of the mesh, listed for each tile.

use super::{LineParams, NAME};
use crate::gpu::{ComputePipelineDesc, SamplerDesc, spirv};
use crate::graph::{Access, Bind, Graph, PassKind, Stage};
use crate::shadow::dbuffer::{self, DbufferOptions};
use crate::shadow::uniform::add_uniform;
use crate::shadow::{ShadowInputs, ShadowMask, hard};

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
    let options = DbufferOptions::DEFAULT;
    let (tools, found, visibility) = dbuffer::add_edge_lists(graph, inputs, NAME, &options, hard);
    let line = add_uniform(graph, format!("{NAME}.line {name}"), line);
    let (gbuffer, ids) = (inputs.gbuffer, inputs.ids);
    let (view_params, part) = inputs.view_params;
    let (params, numbers, tiles) = (tools.params, tools.silhouettes.list, found.tiles);
    let mut pass = graph.pass(format!("{NAME}.visibility {name}"), PassKind::Compute);
    pass.read_part(view_params, part, Access::Uniform(Stage::Compute));
    for buffer in [params, line, found.through] {
        pass.read(buffer, Access::Uniform(Stage::Compute));
    }
    let sampled = [
        gbuffer.view_depth,
        gbuffer.ids,
        ids.triangles,
        ids.hierarchy,
        ids.edges,
        ids.points,
        numbers,
    ];
    let stored = [found.ends, found.pool, found.chunk_boxes];
    let settled = [found.lists, hard];
    for image in sampled.into_iter().chain(settled) {
        pass.read(image, Access::Sampled(Stage::Compute));
    }
    for image in stored {
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
        let stored = (10..).zip(stored);
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
        silhouettes: Some(tools.silhouettes),
        ..ShadowMask::new(visibility)
    }
}
