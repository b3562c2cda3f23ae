//! Cutting the scene into slices: a bit for each slice and texel, and which slices to join.

use super::options::{Combine, OcclusionOptions};
use super::views::{OcclusionView, SlicedView};
use super::{NAME, ShadowInputs, prefilter};
use crate::geometry::{SceneBuffers, SceneIds, SceneShaders, draw_part_with, read_for_draw};
use crate::gpu::{
    Blend, ComputePipelineDesc, GpuError, GraphicsPipelineDesc, SamplerDesc, Shader, spirv,
};
use crate::graph::{
    Access, Bind, BufferDesc, BufferId, Graph, ImageDesc, ImageId, ImagePart, Load, PassContext,
    PassKind, Stage,
};
use ash::vk;
use bytemuck::{Pod, Zeroable};
use glam::Mat4;
use std::rc::Rc;

/// Slices that one pass marks: four in each of eight attachments.
const SLICES_A_PASS: u32 = 32;
/// Attachments of a pass.
const ATTACHMENTS: u32 = 8;
/// Most fine slices, and most groups of them.
pub(super) const MOST_SLICES: u64 = 128;
/// Words of 32 bits for [`MOST_SLICES`].
const MOST_WORDS: u32 = 4;
/// Numbers that are counted in a view.
const COUNTS: u32 = 5;
/// Texels of the bits across one of the pyramid's first level.
const ANY_BASE: u32 = 4;

/// A view's slices.
#[derive(Clone, Copy, Debug)]
pub(super) struct Slices {
    /// `OcclusionView`: a uniform buffer.
    pub params: BufferId,
    /// R32_UINT, R32G32_UINT or R32G32B32A32_UINT: the slices that block at a texel.
    pub bits: ImageId,
    /// RGBA32_UINT with mip levels: slices that block anywhere in a texel of 4x4, 8x8, ..
    pub any: ImageId,
    /// `SliceGroups`: a uniform buffer.
    pub groups: BufferId,
    /// Depths of the planes between fine slices: a uniform buffer.
    pub planes: BufferId,
    /// Of the passes over tables: two dispatches, [`Sums::CELLS`] and so on, of no more than groups need.
    pub sums: BufferId,
    /// Texels of the bits across.
    pub side: u32,
    /// The largest kernel's part of the image's area, 0 to 1.
    pub most_kernel: f64,
}

/// Push constants of `slices*.vert` and `.frag`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct SlicesPush {
    clip_from_scene: [[f32; 4]; 4],
    depth: [f32; 4],
    range: [f32; 4],
    first_slice: u32,
    material: u32,
}

/// Push constants of `groups.comp`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct GroupsPush {
    fine: u32,
    most: u32,
    behind: f32,
    perspective: f32,
    sums: Sums,
}

/// How the passes over tables are dispatched: workgroups for each layer, and groups that a layer holds.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub(super) struct Sums {
    /// Across and down the cells.
    pub cells: [u32; 2],
    /// Over the rows, and over the columns, of a table.
    pub lines: [u32; 2],
    /// Groups that an invocation of the cells counts.
    pub groups_a_batch: u32,
    /// Groups that a layer of a table holds.
    pub groups_a_layer: u32,
    /// Sets of tables.
    pub sets: u32,
}

impl Sums {
    /// Places of the dispatches in [`Slices::sums`].
    pub(super) const CELLS: u64 = 0;
    pub(super) const ROWS: u64 = 12;
    pub(super) const COLUMNS: u64 = 24;
    const BYTES: u64 = 36;
}

/// R32_UINT, 5x1, a layer for each view: groups, fine slices that hold something, those that do not, fine
/// slices that a group may span, and layers of tables that are summed.
pub(super) fn create_counts(graph: &mut Graph<'_>, light_name: &str, views: usize) -> ImageId {
    let counts = ImageDesc::new(vk::Format::R32_UINT, COUNTS, 1).layers(views as u32);
    graph.create_image(format!("{NAME}.counts {light_name}"), counts)
}

/// What is told of the counts.
pub(super) fn tell(counts: &[u32]) -> Vec<(&'static str, u64)> {
    let of = |at: usize| {
        let views = counts.chunks(COUNTS as usize);
        views
            .filter_map(|view| view.get(at))
            .map(|n| u64::from(*n))
            .sum()
    };
    vec![
        ("textures", of(0)),
        ("slices_filled", of(1)),
        ("slices_empty", of(2)),
        ("tables_summed", of(4)),
    ]
}

/// `counts` are those of [`create_counts`], which are returned with the view's written.
pub(super) fn add_slices<'f>(
    graph: &mut Graph<'f>,
    inputs: &ShadowInputs<'f>,
    options: &OcclusionOptions,
    view: &SlicedView,
    (index, counts): (usize, ImageId),
) -> (Slices, ImageId) {
    let name = format!("{}.{index}", inputs.light_name);
    let (params, planes) = add_params(graph, &name, view);
    let side = options.texels(inputs.camera.size(), view.most_kernel);
    let sums = prefilter::sums(options, side, view.most_kernel);
    let fine = options.fine_slices();
    let joined = inputs.scene.features().logic_op;
    let words = if joined { options.words() } else { MOST_WORDS };
    let bits = ImageDesc::new(bits_format(words), side, side);
    let bits = graph.create_image(format!("{NAME}.bits {name}"), bits);
    let drawing = Drawing {
        view,
        fine,
        words: options.words(),
        name: &name,
    };
    let bits = if joined {
        add_bits(graph, inputs, &drawing, bits)
    } else {
        add_packed_marks(graph, inputs, &drawing, bits)
    };
    let any = add_pyramid(graph, &name, bits, side, words);
    let part = ImagePart::layer(index as u32);
    let view_sums = (view, side, sums);
    let (groups, sums, counts) = add_groups(
        graph,
        &name,
        options,
        view_sums,
        (any, planes),
        (counts, part),
    );
    let slices = Slices {
        params,
        bits,
        any,
        groups,
        planes,
        sums,
        side,
        most_kernel: view.most_kernel,
    };
    (slices, counts)
}

fn add_params(graph: &mut Graph<'_>, name: &str, view: &SlicedView) -> (BufferId, BufferId) {
    let size = size_of::<OcclusionView>() as u64;
    let params = graph.create_buffer(format!("{NAME}.params {name}"), BufferDesc { size });
    let plane_bytes = (MOST_SLICES / 4 + 1) * 16;
    let planes = graph.create_buffer(
        format!("{NAME}.planes {name}"),
        BufferDesc { size: plane_bytes },
    );
    let mut pass = graph.pass(format!("{NAME}.params {name}"), PassKind::Transfer);
    let params = pass.overwrite(params, Access::Clear);
    let planes = pass.overwrite(planes, Access::Clear);
    let block = view.params;
    let mut depths = view.planes.clone();
    depths.resize(plane_bytes as usize / 4, 0.0);
    pass.record(move |ctx| {
        ctx.update_buffer(params, 0, bytemuck::bytes_of(&block))?;
        ctx.update_buffer(planes, 0, bytemuck::cast_slice(&depths))
    });
    (params, planes)
}

/// The narrowest format with these many words of 32 bits.
fn bits_format(words: u32) -> vk::Format {
    match words {
        1 => vk::Format::R32_UINT,
        2 => vk::Format::R32G32_UINT,
        _ => vk::Format::R32G32B32A32_UINT,
    }
}

/// What is drawn into the slices of one view.
#[derive(Clone, Copy)]
struct Drawing<'a> {
    view: &'a SlicedView,
    fine: u32,
    words: u32,
    name: &'a str,
}

impl Drawing<'_> {
    fn push(&self, first_slice: u32) -> SlicesPush {
        let range = self.view.params.range;
        SlicesPush {
            clip_from_scene: self.view.clip_from_scene.to_cols_array_2d(),
            depth: self.view.depth,
            range: [range[0], range[1], range[2], self.fine as f32],
            first_slice,
            material: 0,
        }
    }
}

/// All slices at once: their bits are joined by the attachment.
fn add_bits<'f>(
    graph: &mut Graph<'f>,
    inputs: &ShadowInputs<'f>,
    drawing: &Drawing<'_>,
    bits: ImageId,
) -> ImageId {
    let pass_name = format!("{NAME}.slices {}", drawing.name);
    let mut pass = graph.pass(pass_name, PassKind::Graphics);
    read_for_draw(&mut pass, inputs.scene, &inputs.ids);
    let bits = pass.color(bits, Load::Clear([0.0; 4]));
    let (scene, ids, push) = (inputs.scene, inputs.ids, drawing.push(0));
    let casters = Rc::clone(&drawing.view.casters);
    pass.record(move |ctx| {
        let solid = &spirv::OCCLUSION_TEXTURES_SLICES_FRAG;
        let masked = &spirv::OCCLUSION_TEXTURES_SLICES_MASKED_FRAG;
        draw_slices(
            ctx,
            (scene, &ids, &casters),
            push,
            (solid, masked),
            Blend::Or,
        )
    });
    bits
}

/// Where attachments cannot join bits: each slice is a channel, joined by maximum, and 32 of them
/// make a word.
fn add_packed_marks<'f>(
    graph: &mut Graph<'f>,
    inputs: &ShadowInputs<'f>,
    drawing: &Drawing<'_>,
    mut bits: ImageId,
) -> ImageId {
    let Some(ImageDesc { width: side, .. }) = graph.image_desc(bits) else {
        return bits;
    };
    for word in 0..drawing.words {
        let name = format!("{}.{word}", drawing.name);
        let marks = ImageDesc::new(vk::Format::R8G8B8A8_UNORM, side, side).layers(ATTACHMENTS);
        let mut marks = graph.create_image(format!("{NAME}.marks {name}"), marks);
        let mut pass = graph.pass(format!("{NAME}.slices {name}"), PassKind::Graphics);
        read_for_draw(&mut pass, inputs.scene, &inputs.ids);
        for layer in 0..ATTACHMENTS {
            marks = pass.color_part(marks, ImagePart::layer(layer), Load::Clear([0.0; 4]));
        }
        let push = drawing.push(word * SLICES_A_PASS);
        let (scene, ids) = (inputs.scene, inputs.ids);
        let casters = Rc::clone(&drawing.view.casters);
        pass.record(move |ctx| {
            let solid = &spirv::OCCLUSION_TEXTURES_MARKS_FRAG;
            let masked = &spirv::OCCLUSION_TEXTURES_MARKS_MASKED_FRAG;
            draw_slices(
                ctx,
                (scene, &ids, &casters),
                push,
                (solid, masked),
                Blend::Max,
            )
        });

        let mut pass = graph.pass(format!("{NAME}.pack {name}"), PassKind::Compute);
        pass.read(marks, Access::Sampled(Stage::Compute));
        bits = if word == 0 {
            pass.overwrite(bits, Access::StorageWrite(Stage::Compute))
        } else {
            pass.write(bits, Access::StorageReadWrite(Stage::Compute))
        };
        let written = bits;
        pass.record(move |ctx| {
            let shader = &spirv::OCCLUSION_TEXTURES_PACK_COMP;
            let bindings = [
                Bind::sampled(0, marks, SamplerDesc::nearest()).array(),
                Bind::storage_image(1, written),
            ];
            let pipeline = ComputePipelineDesc {
                constants: vec![(0, word)],
                ..ComputePipelineDesc::new(shader)
            };
            ctx.bind_compute(&pipeline, &bindings, &[])?;
            ctx.dispatch(shader.groups([side, side, 1]));
            Ok(())
        });
    }
    bits
}

fn draw_slices(
    ctx: &mut PassContext<'_>,
    (scene, ids, casters): (&SceneBuffers, &SceneIds, &[bool]),
    push: SlicesPush,
    (solid, masked): (&'static Shader, &'static Shader),
    blend: Blend,
) -> Result<(), GpuError> {
    let shaders = SceneShaders {
        solid: GraphicsPipelineDesc {
            vertex_layout: vec![scene.position_stream()],
            blend,
            ..GraphicsPipelineDesc::new(&spirv::OCCLUSION_TEXTURES_SLICES_VERT, Some(solid))
        },
        masked: GraphicsPipelineDesc {
            vertex_layout: vec![scene.position_stream(), scene.mask_stream()],
            blend,
            ..GraphicsPipelineDesc::new(&spirv::OCCLUSION_TEXTURES_SLICES_MASKED_VERT, Some(masked))
        },
    };
    let matrix = Mat4::from_cols_array_2d(&push.clip_from_scene);
    let keep = |index: usize| casters[index];
    draw_part_with(ctx, scene, ids, &matrix, shaders, keep, |material| {
        let material = material.unwrap_or_default();
        bytemuck::bytes_of(&SlicesPush { material, ..push }).to_vec()
    })
}

fn add_pyramid(graph: &mut Graph<'_>, name: &str, bits: ImageId, side: u32, words: u32) -> ImageId {
    let base = side / ANY_BASE;
    let desc = ImageDesc::new(vk::Format::R32G32B32A32_UINT, base, base);
    let levels = desc.max_mips();
    let any = graph.create_image(format!("{NAME}.any {name}"), desc.mips(levels));
    let mut pass = graph.pass(format!("{NAME}.any {name}.0"), PassKind::Compute);
    pass.read(bits, Access::Sampled(Stage::Compute));
    let part = ImagePart::mip(0);
    let mut any = pass.overwrite_part(any, part, Access::StorageWrite(Stage::Compute));
    let written = any;
    pass.record(move |ctx| {
        let shader = &spirv::OCCLUSION_TEXTURES_ANY_BASE_COMP;
        let bindings = [
            Bind::sampled(0, bits, SamplerDesc::nearest()),
            Bind::storage_image(1, written).part(part),
        ];
        let pipeline = ComputePipelineDesc {
            constants: vec![(0, words)],
            ..ComputePipelineDesc::new(shader)
        };
        ctx.bind_compute(&pipeline, &bindings, &[])?;
        ctx.dispatch(shader.groups([base, base, 1]));
        Ok(())
    });
    for level in 1..levels {
        let mut pass = graph.pass(format!("{NAME}.any {name}.{level}"), PassKind::Compute);
        let (finer, part) = (ImagePart::mip(level - 1), ImagePart::mip(level));
        pass.read_part(any, finer, Access::Sampled(Stage::Compute));
        any = pass.overwrite_part(any, part, Access::StorageWrite(Stage::Compute));
        let written = any;
        pass.record(move |ctx| {
            let shader = &spirv::OCCLUSION_TEXTURES_ANY_LEVEL_COMP;
            let bindings = [
                Bind::sampled(0, written, SamplerDesc::nearest()).part(finer),
                Bind::storage_image(1, written).part(part),
            ];
            ctx.bind_compute(&ComputePipelineDesc::new(shader), &bindings, &[])?;
            let size = (base >> level).max(1);
            ctx.dispatch(shader.groups([size, size, 1]));
            Ok(())
        });
    }
    any
}

fn add_groups(
    graph: &mut Graph<'_>,
    name: &str,
    options: &OcclusionOptions,
    (view, side, sums): (&SlicedView, u32, Sums),
    (any, planes): (ImageId, BufferId),
    (counts, part): (ImageId, ImagePart),
) -> (BufferId, BufferId, ImageId) {
    let size = 16 + 3 * 16 * MOST_SLICES;
    let groups = graph.create_buffer(format!("{NAME}.groups {name}"), BufferDesc { size });
    let size = Sums::BYTES;
    let dispatches = graph.create_buffer(format!("{NAME}.sums {name}"), BufferDesc { size });
    let side = (side / ANY_BASE).max(1);
    let last = ImagePart::mip(ImageDesc::new(vk::Format::R32_UINT, side, side).max_mips() - 1);
    let mut pass = graph.pass(format!("{NAME}.groups {name}"), PassKind::Compute);
    pass.read_part(any, last, Access::Sampled(Stage::Compute));
    pass.read(planes, Access::Uniform(Stage::Compute));
    let groups = pass.overwrite(groups, Access::StorageWrite(Stage::Compute));
    let counts = pass.overwrite_part(counts, part, Access::StorageWrite(Stage::Compute));
    let dispatches = pass.overwrite(dispatches, Access::StorageWrite(Stage::Compute));
    let push = GroupsPush {
        fine: options.fine_slices(),
        most: options.slices,
        behind: view.params.forward[3],
        perspective: view.params.scale[2],
        sums,
    };
    let thin = u32::from(options.combine == Combine::Thin);
    let middle = u32::from(options.middle);
    pass.record(move |ctx| {
        let bindings = [
            Bind::sampled(0, any, SamplerDesc::nearest()).part(last),
            Bind::uniform(1, planes),
            Bind::storage_buffer(2, groups),
            Bind::storage_image(3, counts).part(part),
            Bind::storage_buffer(4, dispatches),
        ];
        let pipeline = ComputePipelineDesc {
            constants: vec![(0, thin), (1, middle)],
            ..ComputePipelineDesc::new(&spirv::OCCLUSION_TEXTURES_GROUPS_COMP)
        };
        ctx.bind_compute(&pipeline, &bindings, bytemuck::bytes_of(&push))?;
        ctx.dispatch([1, 1, 1]);
        Ok(())
    });
    (groups, dispatches, counts)
}
