//! The multi-layer depth image: for each texel a mask of buckets and a sorted list of depths.

use super::coverage::{Coverage, Runs};
use super::options::MdiOptions;
use super::views::MdiViews;
use super::{NAME, ShadowInputs};
use crate::geometry::tile_counts;
use crate::gpu::{ComputePipelineDesc, SamplerDesc, spirv};
use crate::graph::{
    Access, Bind, BufferDesc, BufferId, Graph, ImageDesc, ImageId, ImagePart, PassKind, Stage,
};
use ash::vk;

/// Width of the image of lists: `LIST_WIDTH` in `mdi/params.glsl`.
pub(super) const LIST_WIDTH: u32 = 4096;

/// The image of all views.
#[derive(Clone, Copy, Debug)]
pub(super) struct Layers {
    /// `MdiParams`: a uniform buffer.
    pub params: BufferId,
    /// `RayBlock`: a uniform buffer.
    pub rays: BufferId,
    /// R32_UINT with mip levels, `words` layers a view: boundaries that are blocked.
    pub boundaries: ImageId,
    /// RG32_UINT, a layer a view: where a texel's list begins, and its length.
    pub heads: ImageId,
    /// R32_UINT: depths, as bits of floats.
    pub lists: ImageId,
    /// R32_UINT: how many depths lists had room for, how many there are, and from the second row on, for
    /// each tile of the picture, pixels that rays were traced from, none yet.
    pub tally: ImageId,
}

/// Rows of the image of lists: devices allow no more.
const MOST_ROWS: u32 = 16_384;

/// Most depths that lists can have room for.
pub(super) const MOST_DEPTHS: u32 = MOST_ROWS * LIST_WIDTH;

pub(super) fn add_layers<'f>(
    graph: &mut Graph<'f>,
    inputs: &ShadowInputs<'f>,
    options: &MdiOptions,
    (views, runs): (&MdiViews, &Runs),
) -> Layers {
    let name = &inputs.light_name;
    let (params, rays) = add_params(graph, name, views);
    let count = views.count.max(1);
    let side = if views.count > 0 { views.side } else { 1 };
    let words = options.words();
    let image = |format, layers| ImageDesc::new(format, side, side).layers(layers);
    let counts = graph.create_image(
        format!("{NAME}.counts {name}"),
        image(vk::Format::R32_UINT, count),
    );
    let desc = image(vk::Format::R32_UINT, count * words);
    let mips = desc.max_mips();
    let boundaries = graph.create_image(format!("{NAME}.boundaries {name}"), desc.mips(mips));
    let level = move |level| ImagePart {
        base_mip: level,
        mips: 1,
        base_layer: 0,
        layers: count * words,
    };
    let [across, down] = tile_counts(inputs.camera.size());
    let desc = ImageDesc::new(vk::Format::R32_UINT, across.max(2), down + 1);
    let tally = graph.create_image(format!("{NAME}.tally {name}"), desc);
    let mut pass = graph.pass(format!("{NAME}.clear {name}"), PassKind::Transfer);
    let mut counts = pass.overwrite(counts, Access::Clear);
    let mut boundaries = pass.overwrite_part(boundaries, level(0), Access::Clear);
    let tally = pass.overwrite(tally, Access::Clear);
    pass.record(move |ctx| {
        ctx.clear_image(counts, [0.0; 4])?;
        ctx.clear_image(tally, [0.0; 4])?;
        ctx.clear_image(boundaries, [0.0; 4])
    });
    let mut coverage = Coverage::new(inputs, params, side, (runs, level(0)));
    for view in 0..views.count {
        [counts, boundaries] = coverage.add_count(graph, inputs, view, [counts, boundaries]);
    }
    let (heads, tally) = add_heads(graph, name, params, [counts, tally], [side, count]);
    let rows = (views.capacity.div_ceil(LIST_WIDTH)).max(1);
    let lists = graph.create_image(
        format!("{NAME}.lists {name}"),
        ImageDesc::new(vk::Format::R32_UINT, LIST_WIDTH, rows),
    );
    let mut pass = graph.pass(format!("{NAME}.empty {name}"), PassKind::Transfer);
    let mut lists = pass.overwrite(lists, Access::Clear);
    pass.record(move |ctx| ctx.clear_image(lists, [0.0; 4]));
    for view in 0..views.count {
        [counts, lists] = coverage.add_fill(graph, inputs, view, [counts, lists], heads);
    }
    let mut pass = graph.pass(format!("{NAME}.sort {name}"), PassKind::Compute);
    pass.read(heads, Access::Sampled(Stage::Compute));
    let lists = pass.write(lists, Access::StorageReadWrite(Stage::Compute));
    pass.record(move |ctx| {
        let shader = &spirv::MDI_SORT_COMP;
        let bindings = [
            Bind::sampled(0, heads, SamplerDesc::nearest()).array(),
            Bind::storage_image(1, lists),
        ];
        ctx.bind_compute(&ComputePipelineDesc::new(shader), &bindings, &[])?;
        ctx.dispatch(shader.groups([side, side, count]));
        Ok(())
    });
    let boundaries = add_pyramid(graph, name, boundaries, side, mips, level);
    Layers {
        params,
        rays,
        boundaries,
        heads,
        lists,
        tally,
    }
}

fn add_params(graph: &mut Graph<'_>, name: &str, views: &MdiViews) -> (BufferId, BufferId) {
    let (block, table) = (views.params, views.rays.clone());
    let size = size_of_val(&block) as u64;
    let params = graph.create_buffer(format!("{NAME}.params {name}"), BufferDesc { size });
    let size = size_of_val(table.as_slice()) as u64;
    let rays = graph.create_buffer(format!("{NAME}.rays {name}"), BufferDesc { size });
    let mut pass = graph.pass(format!("{NAME}.params {name}"), PassKind::Transfer);
    let params = pass.overwrite(params, Access::Clear);
    let rays = pass.overwrite(rays, Access::Clear);
    pass.record(move |ctx| {
        ctx.update_buffer(params, 0, bytemuck::bytes_of(&block))?;
        ctx.update_buffer(rays, 0, bytemuck::cast_slice(&table))
    });
    (params, rays)
}

fn add_heads(
    graph: &mut Graph<'_>,
    name: &str,
    params: BufferId,
    [counts, tally]: [ImageId; 2],
    [side, count]: [u32; 2],
) -> (ImageId, ImageId) {
    let desc = ImageDesc::new(vk::Format::R32_UINT, side, count);
    let sums = graph.create_image(format!("{NAME}.sums {name}"), desc);
    let mut pass = graph.pass(format!("{NAME}.rows {name}"), PassKind::Compute);
    pass.read(counts, Access::Sampled(Stage::Compute));
    let sums = pass.overwrite(sums, Access::StorageWrite(Stage::Compute));
    pass.record(move |ctx| {
        let shader = &spirv::MDI_ROWS_COMP;
        let bindings = [
            Bind::sampled(0, counts, SamplerDesc::nearest()).array(),
            Bind::storage_image(1, sums),
        ];
        ctx.bind_compute(&ComputePipelineDesc::new(shader), &bindings, &[])?;
        ctx.dispatch(shader.groups([side, count, 1]));
        Ok(())
    });
    let desc = ImageDesc::new(vk::Format::R32G32_UINT, side, side).layers(count);
    let heads = graph.create_image(format!("{NAME}.heads {name}"), desc);
    let mut pass = graph.pass(format!("{NAME}.heads {name}"), PassKind::Compute);
    pass.read(params, Access::Uniform(Stage::Compute));
    pass.read(counts, Access::Sampled(Stage::Compute));
    pass.read(sums, Access::Sampled(Stage::Compute));
    let heads = pass.overwrite(heads, Access::StorageWrite(Stage::Compute));
    let tally = pass.write(tally, Access::StorageReadWrite(Stage::Compute));
    pass.record(move |ctx| {
        let shader = &spirv::MDI_HEADS_COMP;
        let nearest = SamplerDesc::nearest();
        let bindings = [
            Bind::uniform(0, params),
            Bind::sampled(1, counts, nearest).array(),
            Bind::sampled(2, sums, nearest),
            Bind::storage_image(3, heads).array(),
            Bind::storage_image(4, tally),
        ];
        ctx.bind_compute(&ComputePipelineDesc::new(shader), &bindings, &[])?;
        ctx.dispatch(shader.groups([side, count, 1]));
        Ok(())
    });
    (heads, tally)
}

/// The coarser levels, each the OR of 2x2 texels of the one below. `part`: a level, all layers.
fn add_pyramid<'f>(
    graph: &mut Graph<'f>,
    name: &str,
    mut image: ImageId,
    side: u32,
    mips: u32,
    part: impl Fn(u32) -> ImagePart + Copy + 'f,
) -> ImageId {
    for level in 1..mips {
        let mut pass = graph.pass(
            format!("{NAME}.boundaries {name}.{level}"),
            PassKind::Compute,
        );
        pass.read_part(image, part(level - 1), Access::Sampled(Stage::Compute));
        image = pass.overwrite_part(image, part(level), Access::StorageWrite(Stage::Compute));
        let written = image;
        pass.record(move |ctx| {
            let shader = &spirv::MDI_LEVEL_COMP;
            let bindings = [
                Bind::sampled(0, written, SamplerDesc::nearest())
                    .part(part(level - 1))
                    .array(),
                Bind::storage_image(1, written).part(part(level)).array(),
            ];
            ctx.bind_compute(&ComputePipelineDesc::new(shader), &bindings, &[])?;
            let size = (side >> level).max(1);
            ctx.dispatch(shader.groups([size, size, part(level).layers]));
            Ok(())
        });
    }
    image
}
