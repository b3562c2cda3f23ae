//! Visibility from occluding edges of the mesh, listed for each tile.

use super::{LineParams, NAME};
use crate::geometry::image_place;
use crate::gpu::{ComputePipelineDesc, SamplerDesc, spirv};
use crate::graph::{Access, Bind, Graph, ImageDesc, ImageId, PassKind, Stage};
use crate::shadow::dbuffer::{self, DbufferOptions, Found, Lists};
use crate::shadow::silhouettes::Silhouettes;
use crate::shadow::uniform::add_uniform;
use crate::shadow::{ShadowInputs, ShadowMask, hard};
use ash::vk;

/// Most edges of a tile: receivers of tiles with more send rays to the cells of the line. As many cost less than
/// these rays, and all loops together stay below the turns after which software drivers end them.
const MOST_EDGES: u32 = 6144;

/// Edges a tile that lists have room for on average: of more, the tiles with the most go without.
const ROOM: u32 = 512;

/// Texels of a chunk in the image of spans, and spans of a texel: `oess/turns.glsl`.
const SPAN_TEXELS: usize = 8;
const SPANS: usize = 4;

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
        room: ROOM,
        ..DbufferOptions::DEFAULT
    };
    let (tools, found, visibility) = dbuffer::add_edge_lists(graph, inputs, NAME, &options, hard);
    let Some(silhouettes) = tools.silhouettes else {
        unreachable!("scenes without edges take maps");
    };
    let (turns, spans) = add_turns(graph, inputs, &tools, &silhouettes, found.ends);
    let spans = add_spans(graph, inputs, &tools, &found, spans);
    let varies = line.axis[3] > 0.0;
    let line = add_uniform(graph, format!("{NAME}.line {name}"), line);
    let (view_params, part) = inputs.view_params;
    let (params, tiles) = (tools.params, found.tiles);
    let mut pass = graph.pass(format!("{NAME}.visibility {name}"), PassKind::Compute);
    pass.read_part(view_params, part, Access::Uniform(Stage::Compute));
    for buffer in [params, line, found.through] {
        pass.read(buffer, Access::Uniform(Stage::Compute));
    }
    let sampled = tools.sampled(inputs);
    let stored = [found.ends, found.pool, spans];
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
        let pipeline = ComputePipelineDesc {
            constants: vec![(3, u32::from(varies))],
            ..ComputePipelineDesc::new(&spirv::OESS_SILHOUETTES_COMP)
        };
        ctx.bind_compute(&pipeline, &bindings, &[])?;
        tiles.dispatch(ctx)
    });
    ShadowMask {
        silhouettes: tools.silhouettes,
        ..ShadowMask::new(visibility)
    }
}

/// Where both ends of each silhouette lie around the line, RGBA32F, and which turn each takes up, RGBA32_UINT, after
/// room for those of the lists: `oess/turns.glsl`.
fn add_turns(
    graph: &mut Graph<'_>,
    inputs: &ShadowInputs<'_>,
    tools: &Lists,
    silhouettes: &Silhouettes,
    ends: ImageId,
) -> (ImageId, ImageId) {
    let name = format!("{NAME}.turns {}", inputs.light_name);
    let edges = inputs.scene.edge_count();
    let mut image = |name: String, format, texels| {
        let [width, height] = image_place(texels);
        graph.create_image(name, ImageDesc::new(format, width, height))
    };
    let turns = image(name.clone(), vk::Format::R32G32B32A32_SFLOAT, edges);
    let listed = tools.sizes.chunks as usize * SPAN_TEXELS;
    let texels = listed + edges.div_ceil(SPANS);
    let spans = format!("{NAME}.spans {}", inputs.light_name);
    let spans = image(spans, vk::Format::R32G32B32A32_UINT, texels);
    let params = tools.params;
    let (view_params, part) = inputs.view_params;
    let silhouettes = *silhouettes;
    let mut pass = graph.pass(name, PassKind::Compute);
    pass.read_part(view_params, part, Access::Uniform(Stage::Compute));
    pass.read(params, Access::Uniform(Stage::Compute));
    pass.read(silhouettes.arguments, Access::Indirect);
    pass.read(silhouettes.arguments, Access::Uniform(Stage::Compute));
    pass.read(ends, Access::Sampled(Stage::Compute));
    let turns = pass.overwrite(turns, Access::StorageWrite(Stage::Compute));
    let spans = pass.overwrite(spans, Access::StorageWrite(Stage::Compute));
    pass.record(move |ctx| {
        let bindings = [
            Bind::uniform(0, view_params).part(part),
            Bind::uniform(1, silhouettes.arguments),
            Bind::sampled(2, ends, SamplerDesc::nearest()),
            Bind::storage_image(3, turns),
            Bind::storage_image(4, spans),
            Bind::uniform(5, params),
        ];
        ctx.bind_compute(
            &ComputePipelineDesc::new(&spirv::OESS_TURNS_COMP),
            &bindings,
            &[],
        )?;
        silhouettes.dispatch(ctx)
    });
    (turns, spans)
}

/// Copies the turns of silhouettes to where the found tiles' lists have them.
fn add_spans(
    graph: &mut Graph<'_>,
    inputs: &ShadowInputs<'_>,
    tools: &Lists,
    found: &Found,
    spans: ImageId,
) -> ImageId {
    let Found {
        pool, lists, tiles, ..
    } = *found;
    let params = tools.params;
    let name = format!("{NAME}.spans {}", inputs.light_name);
    let mut pass = graph.pass(name, PassKind::Compute);
    pass.read(params, Access::Uniform(Stage::Compute));
    for image in [pool, lists] {
        pass.read(image, Access::Sampled(Stage::Compute));
    }
    tiles.read(&mut pass);
    let spans = pass.write(spans, Access::StorageReadWrite(Stage::Compute));
    pass.record(move |ctx| {
        let nearest = SamplerDesc::nearest();
        let bindings = [
            Bind::uniform(0, params),
            Bind::uniform(1, tiles.arguments),
            Bind::sampled(2, tiles.tiles, nearest),
            Bind::sampled(3, pool, nearest),
            Bind::sampled(4, lists, nearest),
            Bind::storage_image(5, spans),
        ];
        let pipeline = ComputePipelineDesc::new(&spirv::OESS_SPANS_COMP);
        ctx.bind_compute(&pipeline, &bindings, &[])?;
        tiles.dispatch(ctx)
    });
    spans
}
