//! Tiles of 8x8 pixels: what their surfaces are bounded by, and lists of those that need work.

use super::gbuffer::GBuffer;
use crate::gpu::{ComputePipelineDesc, GpuError, SamplerDesc, spirv};
use crate::graph::{
    Access, Bind, BufferDesc, BufferId, Graph, ImageDesc, ImageId, PassBuilder, PassContext,
    PassKind, Stage,
};
use ash::vk;

/// Width and height of a tile in pixels: `TILE_SIZE` in `common/tiles.glsl`.
pub const TILE_SIZE: u32 = 8;

/// Texels of a tile in the image of bounds: `TILE_TEXELS` in `common/tiles.glsl`.
const TILE_TEXELS: u32 = 3;

/// Number of tiles across and down a picture of `size` pixels.
pub fn tile_counts(size: [u32; 2]) -> [u32; 2] {
    size.map(|pixels| pixels.div_ceil(TILE_SIZE))
}

/// Declares the pass that bounds the surfaces of each tile; returns an RGBA32F image of three
/// texels a tile, side by side: nearest and farthest view depth in metres (farthest 0 where nothing
/// was hit) and whether all pixels hit something; lowest coordinates of the geometric normals, and whether
/// all pixels show one triangle; highest coordinates of the normals.
pub fn add_tile_bounds(graph: &mut Graph<'_>, gbuffer: &GBuffer, size: [u32; 2]) -> ImageId {
    let [across, down] = tile_counts(size);
    let format = vk::Format::R32G32B32A32_SFLOAT;
    let desc = ImageDesc::new(format, across * TILE_TEXELS, down);
    let bounds = graph.create_image("gbuffer.tile_bounds", desc);
    let mut pass = graph.pass("gbuffer.tiles", PassKind::Compute);
    let (depth, normal, ids) = (gbuffer.view_depth, gbuffer.geometric_normal, gbuffer.ids);
    for image in [depth, normal, ids] {
        pass.read(image, Access::Sampled(Stage::Compute));
    }
    let bounds = pass.overwrite(bounds, Access::StorageWrite(Stage::Compute));
    pass.record(move |ctx| {
        let shader = &spirv::GBUFFER_TILES_COMP;
        let nearest = SamplerDesc::nearest();
        let bindings = [
            Bind::sampled(0, depth, nearest),
            Bind::sampled(1, normal, nearest),
            Bind::storage_image(2, bounds),
            Bind::sampled(3, ids, nearest),
        ];
        ctx.bind_compute(&ComputePipelineDesc::new(shader), &bindings, &[])?;
        ctx.dispatch(shader.groups([across * down, 1, 1]));
        Ok(())
    });
    bounds
}

/// Tiles that need work, found on the device, and the arguments of a dispatch over them.
///
/// Three passes use it: one clears the arguments ([`TileList::clear`]), one that looks at each tile
/// adds it or not, and one is dispatched over the list. The order of the list is not defined, so
/// work on a tile must not depend on other tiles.
#[derive(Clone, Copy, Debug)]
pub struct TileList {
    /// `TileArguments` in `common/tiles.glsl`.
    pub arguments: BufferId,
    /// R32_UINT, a texel for each tile of the picture: y * tiles across + x of each listed one.
    pub tiles: ImageId,
}

impl TileList {
    /// A list for a picture of `size` pixels; nothing is in it yet.
    pub fn create(graph: &mut Graph<'_>, name: &str, size: [u32; 2]) -> Self {
        let [across, down] = tile_counts(size);
        let desc = ImageDesc::new(vk::Format::R32_UINT, across, down);
        Self {
            arguments: graph.create_buffer(format!("{name}.arguments"), BufferDesc { size: 16 }),
            tiles: graph.create_image(format!("{name}.list"), desc),
        }
    }

    /// Declares that a transfer pass clears the arguments; [`TileList::record_clear`] does it.
    pub fn clear(&mut self, pass: &mut PassBuilder<'_, '_>) {
        self.arguments = pass.overwrite(self.arguments, Access::Clear);
    }

    /// Clears the arguments to those of no work.
    pub fn record_clear(&self, ctx: &mut PassContext<'_>) -> Result<(), GpuError> {
        let empty = [0u32, 1, 1, 0];
        ctx.update_buffer(self.arguments, 0, bytemuck::cast_slice(&empty))
    }

    /// Declares that a compute pass adds tiles.
    pub fn fill(&mut self, pass: &mut PassBuilder<'_, '_>) {
        self.arguments = pass.write(self.arguments, Access::StorageReadWrite(Stage::Compute));
        self.tiles = pass.overwrite(self.tiles, Access::StorageWrite(Stage::Compute));
    }

    /// Declares that another compute pass adds tiles after one that fills the list.
    pub fn extend(&mut self, pass: &mut PassBuilder<'_, '_>) {
        self.arguments = pass.write(self.arguments, Access::StorageReadWrite(Stage::Compute));
        self.tiles = pass.write(self.tiles, Access::StorageWrite(Stage::Compute));
    }

    /// Declares that a compute pass is dispatched over the list.
    pub fn read(&self, pass: &mut PassBuilder<'_, '_>) {
        pass.read(self.arguments, Access::Indirect);
        pass.read(self.arguments, Access::Uniform(Stage::Compute));
        pass.read(self.tiles, Access::Sampled(Stage::Compute));
    }

    /// Dispatches the bound pipeline with as many workgroups as those who added tiles asked for: one for each tile, or
    /// for some.
    pub fn dispatch(&self, ctx: &mut PassContext<'_>) -> Result<(), GpuError> {
        ctx.dispatch_indirect(self.arguments, 0)
    }
}
