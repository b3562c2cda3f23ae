//! Filtering occlusion textures ahead of the pixels.

use super::options::{Combine, Filter, OcclusionOptions};
use super::slices::{Slices, Sums};
use super::{NAME, ShadowInputs};
use crate::gpu::{ComputePipelineDesc, SamplerDesc, spirv};
use crate::graph::{Access, Bind, Graph, ImageDesc, ImageId, ImagePart, PassKind, Stage};
use ash::vk;
use bytemuck::{Pod, Zeroable};

/// A view's filtered textures.
#[derive(Clone, Copy, Debug)]
pub(super) struct Filtered {
    /// Tables: R32G32B32A32_UINT, one texel larger than a texture. Other filters: averages.
    pub image: ImageId,
    /// Whether a component of a table holds two sums of 16 bits.
    pub packed: bool,
    /// Layers of a set of tables, or levels of averages.
    pub levels: u32,
}

/// Groups that a texel of the cells counts: `GROUPS_A_CELL` in `tables.glsl`.
const GROUPS_A_CELL: u32 = 16;
/// Groups that an invocation of `cells.comp` counts.
const GROUPS_A_BATCH: u32 = 32;
/// Groups of a table's texel.
const GROUPS_A_TEXEL: u32 = 4;
/// The same with two sums in a component.
const GROUPS_A_PACKED_TEXEL: u32 = 8;

pub(super) fn add_prefilter<'f>(
    graph: &mut Graph<'f>,
    inputs: &ShadowInputs<'f>,
    options: &OcclusionOptions,
    slices: &Slices,
    index: usize,
) -> Filtered {
    let name = format!("{}.{index}", inputs.light_name);
    match options.filter {
        Filter::SummedAreas => add_tables(graph, &name, options, slices),
        _ => add_averages(graph, &name, options, slices),
    }
}

/// What is counted of each group: one set of tables for each.
fn counted(combine: Combine) -> &'static [Counted] {
    match combine {
        // What a group adds is a difference of running sums.
        Combine::Cumulative => &[Counted::Nearer],
        Combine::Bounded => &[Counted::Own, Counted::Nearer],
        _ => &[Counted::Own],
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Counted {
    /// What the group itself blocks.
    Own,
    /// What it and all groups nearer to the light block.
    Nearer,
}

/// Whether a component of a table holds two sums, for a view whose bits are `side` texels across and whose
/// largest kernel is that part of their area.
fn is_packed(options: &OcclusionOptions, side: u32, most_kernel: f64) -> bool {
    // Boxes count texels of the bits; half a texel more on each side is for their borders.
    let detail = f64::from(options.texels_filtered(most_kernel));
    let most = (most_kernel.sqrt() * f64::from(side) + 4.0 * detail).powi(2);
    most < 65_536.0
}

fn groups_a_layer(packed: bool) -> u32 {
    if packed {
        GROUPS_A_PACKED_TEXEL
    } else {
        GROUPS_A_TEXEL
    }
}

/// How the passes over such a view's tables are dispatched.
pub(super) fn sums(options: &OcclusionOptions, side: u32, most_kernel: f64) -> Sums {
    if options.filter != Filter::SummedAreas {
        return Sums::default();
    }
    let packed = is_packed(options, side, most_kernel);
    let side = side / options.texels_filtered(most_kernel);
    let [across, down, _] = spirv::OCCLUSION_TEXTURES_CELLS_COMP.groups([side, side, 1]);
    let [rows, ..] = spirv::OCCLUSION_TEXTURES_SAT_ROWS_COMP.groups([side, 1, 1]);
    let [columns, ..] = spirv::OCCLUSION_TEXTURES_SAT_COLUMNS_COMP.groups([side + 1, 1, 1]);
    Sums {
        cells: [across, down],
        lines: [rows, columns],
        groups_a_batch: GROUPS_A_BATCH,
        groups_a_layer: groups_a_layer(packed),
        sets: counted(options.combine).len() as u32,
    }
}

fn add_tables(
    graph: &mut Graph<'_>,
    name: &str,
    options: &OcclusionOptions,
    slices: &Slices,
) -> Filtered {
    let detail = options.texels_filtered(slices.most_kernel);
    let side = slices.side / detail;
    let packed = is_packed(options, slices.side, slices.most_kernel);
    let each = groups_a_layer(packed);
    let sets = counted(options.combine);
    let sums = slices.sums;
    let cell_layers = options.slices.next_multiple_of(GROUPS_A_BATCH) / GROUPS_A_CELL;
    let cells = add_cells(graph, name, options, slices, cell_layers);

    let layers = options.slices.div_ceil(each);
    let all_layers = layers * sets.len() as u32;
    let desc = ImageDesc::new(vk::Format::R32G32B32A32_UINT, side + 1, side + 1);
    let tables = graph.create_image(format!("{NAME}.tables {name}"), desc.layers(all_layers));
    let mut pass = graph.pass(format!("{NAME}.rows {name}"), PassKind::Compute);
    pass.read(cells, Access::Sampled(Stage::Compute));
    pass.read(sums, Access::Indirect);
    let tables = pass.overwrite(tables, Access::StorageWrite(Stage::Compute));
    pass.record(move |ctx| {
        let shader = &spirv::OCCLUSION_TEXTURES_SAT_ROWS_COMP;
        let bindings = [
            Bind::sampled(0, cells, SamplerDesc::nearest()).array(),
            Bind::storage_image(1, tables).array(),
        ];
        let pipeline = ComputePipelineDesc {
            constants: vec![(0, u32::from(packed)), (1, layers), (2, cell_layers)],
            ..ComputePipelineDesc::new(shader)
        };
        ctx.bind_compute(&pipeline, &bindings, &[])?;
        ctx.dispatch_indirect(sums, Sums::ROWS)
    });
    let mut pass = graph.pass(format!("{NAME}.columns {name}"), PassKind::Compute);
    pass.read(sums, Access::Indirect);
    let tables = pass.write(tables, Access::StorageReadWrite(Stage::Compute));
    pass.record(move |ctx| {
        let shader = &spirv::OCCLUSION_TEXTURES_SAT_COLUMNS_COMP;
        let bindings = [Bind::storage_image(0, tables).array()];
        let pipeline = ComputePipelineDesc {
            constants: vec![(0, layers)],
            ..ComputePipelineDesc::new(shader)
        };
        ctx.bind_compute(&pipeline, &bindings, &[])?;
        ctx.dispatch_indirect(sums, Sums::COLUMNS)
    });
    Filtered {
        image: tables,
        packed,
        levels: layers,
    }
}

/// Declares the passes that count bits in squares of texels.
fn add_cells(
    graph: &mut Graph<'_>,
    name: &str,
    options: &OcclusionOptions,
    slices: &Slices,
    layers: u32,
) -> ImageId {
    let detail = options.texels_filtered(slices.most_kernel);
    let side = slices.side / detail;
    let sets = counted(options.combine);
    let desc = ImageDesc::new(vk::Format::R32G32B32A32_UINT, side, side);
    let desc = desc.layers(layers * sets.len() as u32);
    let mut cells = graph.create_image(format!("{NAME}.cells {name}"), desc);
    let (bits, groups, sums) = (slices.bits, slices.groups, slices.sums);
    let words = options.words();
    for (first_layer, set) in (0..).step_by(layers as usize).zip(sets) {
        let mut pass = graph.pass(format!("{NAME}.cells {name}"), PassKind::Compute);
        pass.read(bits, Access::Sampled(Stage::Compute));
        pass.read(groups, Access::Uniform(Stage::Compute));
        pass.read(sums, Access::Indirect);
        let part = ImagePart {
            base_mip: 0,
            mips: 1,
            base_layer: first_layer,
            layers,
        };
        cells = pass.overwrite_part(cells, part, Access::StorageWrite(Stage::Compute));
        let written = cells;
        let nearer = u32::from(*set == Counted::Nearer);
        pass.record(move |ctx| {
            let shader = &spirv::OCCLUSION_TEXTURES_CELLS_COMP;
            let bindings = [
                Bind::sampled(0, bits, SamplerDesc::nearest()),
                Bind::uniform(1, groups),
                Bind::storage_image(2, written).part(part).array(),
            ];
            let pipeline = ComputePipelineDesc {
                constants: vec![(0, words), (1, detail), (2, nearer)],
                ..ComputePipelineDesc::new(shader)
            };
            ctx.bind_compute(&pipeline, &bindings, &[])?;
            ctx.dispatch_indirect(sums, Sums::CELLS)
        });
    }
    cells
}

/// Push constants of `average_level.comp`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct LevelPush {
    apart: i32,
}

/// Averages of squares: N-buffers have the levels in layers, mipmaps in mip levels.
fn add_averages(
    graph: &mut Graph<'_>,
    name: &str,
    options: &OcclusionOptions,
    slices: &Slices,
) -> Filtered {
    let detail = options.texels_filtered(slices.most_kernel);
    let side = slices.side / detail;
    let mipmaps = options.filter == Filter::Mipmaps;
    let layers = options.slices;
    let desc = ImageDesc::new(vk::Format::R16G16B16A16_SFLOAT, side, side);
    let levels = desc.max_mips();
    let desc = if mipmaps {
        desc.layers(layers).mips(levels)
    } else {
        desc.layers(layers * levels)
    };
    let level_part = move |level: u32| ImagePart {
        base_mip: if mipmaps { level } else { 0 },
        mips: 1,
        base_layer: if mipmaps { 0 } else { level * layers },
        layers,
    };
    let averages = graph.create_image(format!("{NAME}.averages {name}"), desc);
    let (bits, groups) = (slices.bits, slices.groups);
    let constants = vec![
        (1, detail),
        (3, u32::from(options.combine == Combine::Cumulative)),
    ];
    let mut pass = graph.pass(format!("{NAME}.averages {name}.0"), PassKind::Compute);
    pass.read(bits, Access::Sampled(Stage::Compute));
    pass.read(groups, Access::Uniform(Stage::Compute));
    let part = level_part(0);
    let mut averages = pass.overwrite_part(averages, part, Access::StorageWrite(Stage::Compute));
    let written = averages;
    pass.record(move |ctx| {
        let shader = &spirv::OCCLUSION_TEXTURES_AVERAGE_BASE_COMP;
        let bindings = [
            Bind::sampled(0, bits, SamplerDesc::nearest()),
            Bind::uniform(1, groups),
            Bind::storage_image(2, written).part(part).array(),
        ];
        let pipeline = ComputePipelineDesc {
            constants,
            ..ComputePipelineDesc::new(shader)
        };
        ctx.bind_compute(&pipeline, &bindings, &[])?;
        ctx.dispatch(shader.groups([side, side, layers]));
        Ok(())
    });
    for level in 1..levels {
        let mut pass = graph.pass(format!("{NAME}.averages {name}.{level}"), PassKind::Compute);
        let (finer, part) = (level_part(level - 1), level_part(level));
        pass.read_part(averages, finer, Access::Sampled(Stage::Compute));
        pass.read(groups, Access::Uniform(Stage::Compute));
        averages = pass.overwrite_part(averages, part, Access::StorageWrite(Stage::Compute));
        let written = averages;
        pass.record(move |ctx| {
            let shader = &spirv::OCCLUSION_TEXTURES_AVERAGE_LEVEL_COMP;
            let bindings = [
                Bind::sampled(0, written, SamplerDesc::nearest())
                    .part(finer)
                    .array(),
                Bind::uniform(1, groups),
                Bind::storage_image(2, written).part(part).array(),
            ];
            let pipeline = ComputePipelineDesc {
                constants: vec![(0, u32::from(mipmaps))],
                ..ComputePipelineDesc::new(shader)
            };
            let push = LevelPush {
                apart: 1 << (level - 1),
            };
            ctx.bind_compute(&pipeline, &bindings, bytemuck::bytes_of(&push))?;
            let size = if mipmaps {
                (side >> level).max(1)
            } else {
                side
            };
            ctx.dispatch(shader.groups([size, size, layers]));
            Ok(())
        });
    }
    Filtered {
        image: averages,
        packed: false,
        levels,
    }
}
