//! Drawing the scene's triangle numbers, as cameras and lights see them.

use super::camera::frustum_sees;
use super::scene_buffers::SceneBuffers;
use crate::gpu::{DepthState, GpuError, GraphicsPipelineDesc, spirv};
use crate::graph::{BufferId, PassContext};
use ash::vk;
use glam::Mat4;

/// Draws all triangles that a view may see into the pass's R32_UINT colour attachment (triangle
/// number plus one) and its depth attachment (reversed: cleared to 0, greater is nearer).
pub fn draw_ids(
    ctx: &mut PassContext<'_>,
    scene: &SceneBuffers,
    vertices: BufferId,
    indices: BufferId,
    clip_from_scene: &Mat4,
) -> Result<(), GpuError> {
    let fragment = Some(&spirv::RASTER_IDS_FRAG);
    let mut pipeline = GraphicsPipelineDesc::new(&spirv::RASTER_IDS_VERT, fragment);
    pipeline.vertex_layout = vec![scene.id_stream()];
    pipeline.depth = Some(DepthState {
        compare: vk::CompareOp::GREATER,
        write: true,
    });
    ctx.bind_graphics(pipeline, &[], bytemuck::bytes_of(clip_from_scene))?;
    ctx.bind_vertices(&[(vertices, 0)])?;
    ctx.bind_indices(indices, 0)?;
    for draw in scene.draws() {
        if frustum_sees(clip_from_scene, &draw.bounds) {
            ctx.draw_indexed(draw.first_index, draw.index_count, 0);
        }
    }
    Ok(())
}
