//! The tiles of a picture where a light's visibility is not plain from the surfaces alone.

use super::ShadowInputs;
use crate::geometry::{TileList, tile_counts};
use crate::gpu::{ComputePipelineDesc, SamplerDesc, spirv};
use crate::graph::{Access, Bind, Graph, ImageDesc, ImageId, PassKind, Stage};
use ash::vk;
use bytemuck::{Pod, Zeroable};

/// Tiles that a technique works on, and the visibility image that the other tiles are settled in.
#[derive(Clone, Copy, Debug)]
pub(super) struct Receivers {
    /// Tiles with surfaces that some of the light is above.
    pub list: TileList,
    /// R32F: done outside of the listed tiles, 1 in them.
    pub visibility: ImageId,
}

/// Push constants of `shadow/tiles.comp`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct TilesPush {
    size: [u32; 2],
    reach_m: f32,
}

/// Declares the passes that sort the tiles: 1 where nothing was hit, 0 where all surfaces have the
/// whole light below their planes, listed otherwise. `reach_m` is the distance from the light's
/// centre to its farthest point, of a sun at distance 1; 0 for a technique that knows the centre
/// only.
pub(super) fn add_receivers(
    graph: &mut Graph<'_>,
    inputs: &ShadowInputs<'_>,
    technique: &str,
    reach_m: f32,
) -> Receivers {
    let image = format!("visibility {}", inputs.light_name);
    add_receivers_in(graph, inputs, technique, reach_m, image)
}

/// As [`add_receivers`], with the name of the image.
pub(super) fn add_receivers_in(
    graph: &mut Graph<'_>,
    inputs: &ShadowInputs<'_>,
    technique: &str,
    reach_m: f32,
    image: String,
) -> Receivers {
    let name = &inputs.light_name;
    let size = inputs.camera.size();
    let [width, height] = size;
    let mut list = TileList::create(graph, &format!("{technique}.tiles {name}"), size);
    let desc = ImageDesc::new(vk::Format::R32_SFLOAT, width, height);
    let visibility = graph.create_image(image, desc);
    let mut pass = graph.pass(format!("{technique}.start {name}"), PassKind::Transfer);
    list.clear(&mut pass);
    let visibility = pass.overwrite(visibility, Access::Clear);
    let cleared = list;
    pass.record(move |ctx| {
        cleared.record_clear(ctx)?;
        ctx.clear_image(visibility, [1.0; 4])
    });
    let tile_bounds = inputs.tile_bounds;
    let (params, part) = inputs.view_params;
    let mut pass = graph.pass(format!("{technique}.tiles {name}"), PassKind::Compute);
    pass.read_part(params, part, Access::Uniform(Stage::Compute));
    pass.read(tile_bounds, Access::Sampled(Stage::Compute));
    list.fill(&mut pass);
    let visibility = pass.write(visibility, Access::StorageWrite(Stage::Compute));
    pass.record(move |ctx| {
        let shader = &spirv::SHADOW_TILES_COMP;
        let bindings = [
            Bind::uniform(0, params).part(part),
            Bind::sampled(1, tile_bounds, SamplerDesc::nearest()),
            Bind::storage_buffer(2, list.arguments),
            Bind::storage_image(3, list.tiles),
            Bind::storage_image(4, visibility),
        ];
        let push = TilesPush { size, reach_m };
        let pipeline = ComputePipelineDesc::new(shader);
        ctx.bind_compute(&pipeline, &bindings, bytemuck::bytes_of(&push))?;
        let [across, down] = tile_counts(size);
        ctx.dispatch(shader.groups([across * down, 1, 1]));
        Ok(())
    });
    Receivers { list, visibility }
}
