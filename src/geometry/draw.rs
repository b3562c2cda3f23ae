//! Drawing the scene as cameras and lights see it.

use super::camera::frustum_sees;
use super::scene_buffers::{Draw, SceneBuffers, SceneIds};
use crate::gpu::{DepthState, GpuError, GraphicsPipelineDesc, SamplerDesc, spirv};
use crate::graph::{Access, Bind, PassBuilder, PassContext, Stage};
use ash::vk;
use bytemuck::{Pod, Zeroable};
use glam::Mat4;

/// Push constants of `raster/ids_masked.vert` and `.frag`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct MaskedPush {
    clip_from_scene: [[f32; 4]; 4],
    material: u32,
}

/// Declares what [`draw_scene`] reads.
pub fn read_for_draw(pass: &mut PassBuilder<'_, '_>, scene: &SceneBuffers, ids: &SceneIds) {
    pass.read(ids.vertices, Access::Vertex);
    pass.read(ids.indices, Access::Index);
    if scene.has_masks() {
        pass.read(ids.mask_uvs, Access::Vertex);
        pass.read(ids.materials, Access::Sampled(Stage::Fragment));
        pass.read(ids.footprints, Access::Sampled(Stage::Fragment));
    }
}

/// What a drawing of the scene leaves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DrawTarget {
    /// Depth and, in an R32_UINT colour attachment, one more than the number of the triangle.
    Ids,
    /// Depth alone.
    Depth,
}

/// Draws all triangles that a view may see into the pass's attachments. Depth is reversed: cleared
/// to 0, greater is nearer. The pass has declared [`read_for_draw`].
pub fn draw_scene(
    ctx: &mut PassContext<'_>,
    scene: &SceneBuffers,
    ids: &SceneIds,
    clip_from_scene: &Mat4,
    target: DrawTarget,
) -> Result<(), GpuError> {
    draw_part(ctx, scene, ids, clip_from_scene, target, |_| true)
}

/// As [`draw_scene`], of those of [`SceneBuffers::draws`] that `keep` names by their index.
pub fn draw_part(
    ctx: &mut PassContext<'_>,
    scene: &SceneBuffers,
    ids: &SceneIds,
    clip_from_scene: &Mat4,
    target: DrawTarget,
    keep: impl Fn(usize) -> bool,
) -> Result<(), GpuError> {
    let depth = Some(DepthState {
        compare: vk::CompareOp::GREATER,
        write: true,
    });
    let (solid, masked_fragment) = match target {
        DrawTarget::Ids => {
            let fragment = Some(&spirv::RASTER_IDS_FRAG);
            let solid = GraphicsPipelineDesc {
                vertex_layout: vec![scene.id_stream()],
                ..GraphicsPipelineDesc::new(&spirv::RASTER_IDS_VERT, fragment)
            };
            (solid, &spirv::RASTER_IDS_MASKED_FRAG)
        }
        DrawTarget::Depth => {
            let solid = GraphicsPipelineDesc {
                vertex_layout: vec![scene.position_stream()],
                ..GraphicsPipelineDesc::new(&spirv::RASTER_DEPTH_VERT, None)
            };
            (solid, &spirv::RASTER_DEPTH_MASKED_FRAG)
        }
    };
    let masked = GraphicsPipelineDesc {
        vertex_layout: vec![scene.id_stream(), scene.mask_stream()],
        depth,
        ..GraphicsPipelineDesc::new(&spirv::RASTER_IDS_MASKED_VERT, Some(masked_fragment))
    };
    let shaders = SceneShaders {
        solid: GraphicsPipelineDesc { depth, ..solid },
        masked,
    };
    let clip_from_scene = *clip_from_scene;
    draw_part_with(
        ctx,
        scene,
        ids,
        &clip_from_scene,
        shaders,
        keep,
        |material| {
            let Some(material) = material else {
                return bytemuck::bytes_of(&clip_from_scene).to_vec();
            };
            let push = MaskedPush {
                clip_from_scene: clip_from_scene.to_cols_array_2d(),
                material,
            };
            bytemuck::bytes_of(&push).to_vec()
        },
    )
}

/// What [`draw_part_with`] draws with.
#[derive(Clone, Debug)]
pub struct SceneShaders {
    /// For solid triangles; its first vertex stream is of [`SceneIds::vertices`].
    pub solid: GraphicsPipelineDesc,
    /// For triangles with holes cut by alpha; as well, and the second is of [`SceneIds::mask_uvs`].
    /// Bindings 0 and 1 are [`SceneIds::materials`] and [`SceneIds::footprints`].
    pub masked: GraphicsPipelineDesc,
}

/// Draws all triangles that a view may see, of those of [`SceneBuffers::draws`] that `keep` names by
/// their index, into the pass's attachments. `push` makes the push constants, for masked triangles
/// those of a material. The pass has declared [`read_for_draw`].
pub fn draw_part_with(
    ctx: &mut PassContext<'_>,
    scene: &SceneBuffers,
    ids: &SceneIds,
    clip_from_scene: &Mat4,
    shaders: SceneShaders,
    keep: impl Fn(usize) -> bool,
    push: impl Fn(Option<u32>) -> Vec<u8>,
) -> Result<(), GpuError> {
    let draws = scene.draws().iter().enumerate();
    let seen: Vec<&Draw> = draws
        .filter(|(index, draw)| keep(*index) && frustum_sees(clip_from_scene, &draw.bounds))
        .map(|(_, draw)| draw)
        .collect();
    let runs = runs(&seen);
    let (masked, solid): (Vec<&Run>, Vec<&Run>) = runs.iter().partition(|run| run.mask.is_some());
    if !solid.is_empty() {
        ctx.bind_graphics(shaders.solid, &[], &push(None))?;
        ctx.bind_vertices(&[(ids.vertices, 0)])?;
        ctx.bind_indices(ids.indices, 0)?;
        for run in solid {
            ctx.draw_indexed(run.first_index, run.index_count, 0);
        }
    }
    for run in masked {
        let nearest = SamplerDesc::nearest();
        let bindings = [
            Bind::sampled(0, ids.materials, nearest),
            Bind::sampled(1, ids.footprints, nearest),
        ];
        ctx.bind_graphics(shaders.masked.clone(), &bindings, &push(run.mask))?;
        ctx.bind_vertices(&[(ids.vertices, 0), (ids.mask_uvs, 0)])?;
        ctx.bind_indices(ids.indices, 0)?;
        ctx.draw_indexed(run.first_index, run.index_count, 0);
    }
    Ok(())
}

/// Chunks that one draw covers.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Run {
    first_index: u32,
    index_count: u32,
    mask: Option<u32>,
}

/// Joins chunks that follow each other.
fn runs(draws: &[&Draw]) -> Vec<Run> {
    let mut runs: Vec<Run> = Vec::new();
    for draw in draws {
        match runs.last_mut() {
            Some(run)
                if run.first_index + run.index_count == draw.first_index
                    && run.mask == draw.mask =>
            {
                run.index_count += draw.index_count;
            }
            _ => runs.push(Run {
                first_index: draw.first_index,
                index_count: draw.index_count,
                mask: draw.mask,
            }),
        }
    }
    runs
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Aabb;

    #[test]
    fn chunks_that_follow_each_other_are_one_draw() {
        let draw = |first_index, index_count, mask| Draw {
            first_index,
            index_count,
            bounds: Aabb::EMPTY,
            corners: [glam::Vec3::ZERO; 8],
            mask,
        };
        let run = |first_index, index_count, mask| Run {
            first_index,
            index_count,
            mask,
        };
        let draws = [
            draw(0, 6, Some(1)),
            draw(6, 3, Some(1)),
            draw(9, 3, Some(2)),
            draw(12, 9, None),
            draw(24, 3, None),
            draw(27, 3, None),
        ];
        let expected = [
            run(0, 9, Some(1)),
            run(9, 3, Some(2)),
            run(12, 9, None),
            run(24, 6, None),
        ];
        assert_eq!(runs(&draws.iter().collect::<Vec<_>>()), expected);
    }
}
