//! Cutting the scene into slices: a bit for each slice and texel, and which slices to join.

use super::options::{Combine, OcclusionOptions};
use super::views::{OcclusionView, SlicedView};
use super::{NAME, ShadowInputs};
use crate::geometry::{Draw, SceneBuffers, SceneIds, frustum_sees, read_for_draw};
use crate::gpu::{Blend, ComputePipelineDesc, GpuError, GraphicsPipelineDesc, SamplerDesc, spirv};
use crate::graph::{
    Access, Bind, BufferDesc, BufferId, Graph, ImageDesc, ImageId, ImagePart, Load, PassContext,
    PassKind, Stage,
};
use ash::vk;
use bytemuck::{Pod, Zeroable};
use glam::Mat4;

/// Slices that one pass marks: four in each of eight attachments.
const SLICES_A_PASS: u32 = 32;
/// Attachments of a pass.
const ATTACHMENTS: u32 = 8;
/// Most fine slices, and most groups of them.
pub(super) const MOST_SLICES: u64 = 128;
/// Texels of the bits across one of the pyramid's first level.
const ANY_BASE: u32 = 4;

/// A view's slices.
#[derive(Clone, Copy, Debug)]
pub(super) struct Slices {
    /// `OcclusionView`: a uniform buffer.
    pub params: BufferId,
    /// R32_UINT, a layer for each word: the slices that block at a texel.
    pub bits: ImageId,
    /// RGBA32_UINT with mip levels: slices that block anywhere in a texel of 4x4, 8x8, ..
    pub any: ImageId,
    /// `SliceGroups`: a uniform buffer.
    pub groups: BufferId,
    /// Depths of the planes between fine slices: a uniform buffer.
    pub planes: BufferId,
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
}

pub(super) fn add_slices<'f>(
    graph: &mut Graph<'f>,
    inputs: &ShadowInputs<'f>,
    options: &OcclusionOptions,
    view: &SlicedView,
    index: usize,
) -> Slices {
    let name = format!("{}.{index}", inputs.light_name);
    let (params, planes) = add_params(graph, &name, view);
    let side = options.resolution;
    let fine = options.fine_slices();
    let words = options.words();
    let bits = ImageDesc::new(vk::Format::R32_UINT, side, side).layers(words);
    let mut bits = graph.create_image(format!("{NAME}.bits {name}"), bits);
    for word in 0..words {
        let marks = ImageDesc::new(vk::Format::R8G8B8A8_UNORM, side, side).layers(ATTACHMENTS);
        let mut marks = graph.create_image(format!("{NAME}.marks {name}.{word}"), marks);
        let mut pass = graph.pass(format!("{NAME}.slices {name}.{word}"), PassKind::Graphics);
        read_for_draw(&mut pass, inputs.scene, &inputs.ids);
        for layer in 0..ATTACHMENTS {
            marks = pass.color_part(marks, ImagePart::layer(layer), Load::Clear([0.0; 4]));
        }
        let push = SlicesPush {
            clip_from_scene: view.clip_from_scene.to_cols_array_2d(),
            depth: view.depth,
            range: [
                view.params.range[0],
                view.params.range[1],
                view.params.range[2],
                fine as f32,
            ],
            first_slice: word * SLICES_A_PASS,
            material: 0,
        };
        let (scene, ids, matrix) = (inputs.scene, inputs.ids, view.clip_from_scene);
        pass.record(move |ctx| draw_slices(ctx, scene, &ids, &matrix, push));

        let mut pass = graph.pass(format!("{NAME}.pack {name}.{word}"), PassKind::Compute);
        pass.read(marks, Access::Sampled(Stage::Compute));
        let part = ImagePart::layer(word);
        bits = pass.overwrite_part(bits, part, Access::StorageWrite(Stage::Compute));
        pass.record(move |ctx| {
            let shader = &spirv::OCCLUSION_TEXTURES_PACK_COMP;
            let bindings = [
                Bind::sampled(0, marks, SamplerDesc::nearest()).array(),
                Bind::storage_image(1, bits).part(part),
            ];
            ctx.bind_compute(&ComputePipelineDesc::new(shader), &bindings, &[])?;
            ctx.dispatch(shader.groups([side, side, 1]));
            Ok(())
        });
    }
    let any = add_pyramid(graph, &name, bits, side, words);
    let groups = add_groups(graph, &name, options, view, any, planes);
    Slices {
        params,
        bits,
        any,
        groups,
        planes,
        most_kernel: view.most_kernel,
    }
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

fn draw_slices(
    ctx: &mut PassContext<'_>,
    scene: &SceneBuffers,
    ids: &SceneIds,
    clip_from_scene: &Mat4,
    push: SlicesPush,
) -> Result<(), GpuError> {
    let draws = scene.draws();
    let seen = draws
        .iter()
        .filter(|draw| frustum_sees(clip_from_scene, &draw.bounds));
    let (masked, solid): (Vec<&Draw>, Vec<&Draw>) = seen.partition(|draw| draw.mask.is_some());
    let pipeline = |vertex, fragment| GraphicsPipelineDesc {
        blend: Blend::Max,
        ..GraphicsPipelineDesc::new(vertex, Some(fragment))
    };
    if !solid.is_empty() {
        let vertex = &spirv::OCCLUSION_TEXTURES_SLICES_VERT;
        let mut pipeline = pipeline(vertex, &spirv::OCCLUSION_TEXTURES_SLICES_FRAG);
        pipeline.vertex_layout = vec![scene.position_stream()];
        ctx.bind_graphics(pipeline, &[], bytemuck::bytes_of(&push))?;
        ctx.bind_vertices(&[(ids.vertices, 0)])?;
        ctx.bind_indices(ids.indices, 0)?;
        // Neighbouring chunks are one draw.
        let mut runs: Vec<(u32, u32)> = Vec::new();
        for draw in solid {
            match runs.last_mut() {
                Some((first, count)) if *first + *count == draw.first_index => {
                    *count += draw.index_count;
                }
                _ => runs.push((draw.first_index, draw.index_count)),
            }
        }
        for (first, count) in runs {
            ctx.draw_indexed(first, count, 0);
        }
    }
    for draw in masked {
        let vertex = &spirv::OCCLUSION_TEXTURES_SLICES_MASKED_VERT;
        let mut pipeline = pipeline(vertex, &spirv::OCCLUSION_TEXTURES_SLICES_MASKED_FRAG);
        pipeline.vertex_layout = vec![scene.position_stream(), scene.mask_stream()];
        let push = SlicesPush {
            material: draw.mask.unwrap_or_default(),
            ..push
        };
        let nearest = SamplerDesc::nearest();
        let bindings = [
            Bind::sampled(0, ids.materials, nearest),
            Bind::sampled(1, ids.texels, nearest),
        ];
        ctx.bind_graphics(pipeline, &bindings, bytemuck::bytes_of(&push))?;
        ctx.bind_vertices(&[(ids.vertices, 0), (ids.mask_uvs, 0)])?;
        ctx.bind_indices(ids.indices, 0)?;
        ctx.draw_indexed(draw.first_index, draw.index_count, 0);
    }
    Ok(())
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
            Bind::sampled(0, bits, SamplerDesc::nearest()).array(),
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
    view: &SlicedView,
    any: ImageId,
    planes: BufferId,
) -> BufferId {
    let size = 16 + 3 * 16 * MOST_SLICES;
    let groups = graph.create_buffer(format!("{NAME}.groups {name}"), BufferDesc { size });
    // Groups, occupied and empty fine slices, fine slices that a group may span: for those who ask
    // for the image.
    let counts = ImageDesc::new(vk::Format::R32_UINT, 4, 1);
    let counts = graph.create_image(format!("{NAME}.counts {name}"), counts);
    let side = (options.resolution / ANY_BASE).max(1);
    let last = ImagePart::mip(ImageDesc::new(vk::Format::R32_UINT, side, side).max_mips() - 1);
    let mut pass = graph.pass(format!("{NAME}.groups {name}"), PassKind::Compute);
    pass.read_part(any, last, Access::Sampled(Stage::Compute));
    pass.read(planes, Access::Uniform(Stage::Compute));
    let groups = pass.overwrite(groups, Access::StorageWrite(Stage::Compute));
    let counts = pass.overwrite(counts, Access::StorageWrite(Stage::Compute));
    let push = GroupsPush {
        fine: options.fine_slices(),
        most: options.slices,
        behind: view.params.forward[3],
        perspective: view.params.scale[2],
    };
    let thin = u32::from(options.combine == Combine::Thin);
    let middle = u32::from(options.middle);
    pass.record(move |ctx| {
        let bindings = [
            Bind::sampled(0, any, SamplerDesc::nearest()).part(last),
            Bind::uniform(1, planes),
            Bind::storage_buffer(2, groups),
            Bind::storage_image(3, counts),
        ];
        let pipeline = ComputePipelineDesc {
            constants: vec![(0, thin), (1, middle)],
            ..ComputePipelineDesc::new(&spirv::OCCLUSION_TEXTURES_GROUPS_COMP)
        };
        ctx.bind_compute(&pipeline, &bindings, bytemuck::bytes_of(&push))?;
        ctx.dispatch([1, 1, 1]);
        Ok(())
    });
    groups
}
