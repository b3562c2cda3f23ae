//! Which triangle each pixel sees, and the surface there.

use super::camera::PixelCamera;
use super::draw::{DrawTarget, draw_scene, read_for_draw};
use super::scene_buffers::{SceneBuffers, SceneIds};
use crate::gpu::{GraphicsPipelineDesc, SamplerDesc, spirv};
use crate::graph::{Access, Bind, Graph, ImageDesc, ImageId, Load, PassKind, Stage};
use crate::scene::SceneCamera;
use ash::vk;

/// The surface at each pixel centre.
#[derive(Clone, Copy, Debug)]
pub struct GBuffer {
    /// R32_UINT: one more than the number of the triangle; 0 where nothing was hit.
    pub ids: ImageId,
    /// R32F: distance in metres along the view direction; 0 where nothing was hit.
    pub view_depth: ImageId,
    /// R32_UINT: geometric normal, octahedral, turned to the camera.
    pub geometric_normal: ImageId,
    /// R32_UINT: interpolated normal, octahedral, on the side of the geometric one.
    pub shading_normal: ImageId,
}

/// Declares the pass that finds the triangle at each pixel: [`GBuffer::ids`]. A host with a G-buffer
/// of its own needs it too; it is left out where the technique does not ask for triangles.
pub fn add_triangle_ids<'f>(
    graph: &mut Graph<'f>,
    scene: &'f SceneBuffers,
    ids: &SceneIds,
    camera: &SceneCamera,
    size: [u32; 2],
) -> ImageId {
    let [width, height] = size;
    let image = |format| ImageDesc::new(format, width, height);
    let aspect = width as f32 / height as f32;
    let matrix = camera.view_projection_reversed(aspect);
    let triangle_ids = graph.create_image("gbuffer.ids", image(vk::Format::R32_UINT));
    let depth = graph.create_image("gbuffer.depth", image(vk::Format::D32_SFLOAT));
    let mut pass = graph.pass("gbuffer.ids", PassKind::Graphics);
    read_for_draw(&mut pass, scene, ids);
    let triangle_ids = pass.color(triangle_ids, Load::Clear([0.0; 4]));
    // Nobody reads the depth afterwards: the surface pass finds it more exactly.
    let _ = pass.depth(depth, Load::Clear([0.0; 4]));
    let scene_ids = *ids;
    pass.record(move |ctx| draw_scene(ctx, scene, &scene_ids, &matrix, DrawTarget::Ids));
    triangle_ids
}

/// Declares the passes that make the G-buffer.
pub fn add_gbuffer<'f>(
    graph: &mut Graph<'f>,
    scene: &'f SceneBuffers,
    ids: &SceneIds,
    camera: &SceneCamera,
    size: [u32; 2],
) -> GBuffer {
    let [width, height] = size;
    let image = |format| ImageDesc::new(format, width, height);
    let pixels = PixelCamera::new(camera, size);
    let triangle_ids = add_triangle_ids(graph, scene, ids, camera, size);
    let view_depth = graph.create_image("gbuffer.view_depth", image(vk::Format::R32_SFLOAT));
    let geometric = graph.create_image("gbuffer.geometric_normal", image(vk::Format::R32_UINT));
    let shading = graph.create_image("gbuffer.shading_normal", image(vk::Format::R32_UINT));
    let mut pass = graph.pass("gbuffer.surface", PassKind::Graphics);
    pass.read(triangle_ids, Access::Sampled(Stage::Fragment));
    pass.read(ids.triangles, Access::Sampled(Stage::Fragment));
    let view_depth = pass.color(view_depth, Load::Discard);
    let geometric_normal = pass.color(geometric, Load::Discard);
    let shading_normal = pass.color(shading, Load::Discard);
    let triangles = ids.triangles;
    pass.record(move |ctx| {
        let fragment = Some(&spirv::GBUFFER_SURFACE_FRAG);
        let pipeline = GraphicsPipelineDesc::new(&spirv::SCREEN_FULLSCREEN_VERT, fragment);
        let bindings = [
            Bind::sampled(0, triangle_ids, SamplerDesc::nearest()),
            Bind::sampled(1, triangles, SamplerDesc::nearest()),
        ];
        ctx.bind_graphics(pipeline, &bindings, bytemuck::bytes_of(&pixels))?;
        ctx.draw(0, 3, 1);
        Ok(())
    });
    GBuffer {
        ids: triangle_ids,
        view_depth,
        geometric_normal,
        shading_normal,
    }
}
