//! The pass that finds groups of tiles for which what is between them and the light is found once.

use super::{NAME, PARTS, SHAFT_TEXELS, part_list};
use crate::geometry::{TileList, tile_counts};
use crate::gpu::{ComputePipelineDesc, GpuError, spirv};
use crate::graph::{
    Access, Bind, BufferId, Graph, ImageDesc, ImageId, PassBuilder, PassContext, PassKind, Stage,
};
use crate::shadow::{ShadowInputs, shape_number};
use ash::vk;

/// Groups of tiles beside each other, or of parts of tiles: each led by one of them.
#[derive(Clone, Copy)]
pub(super) struct Groups {
    /// The parts that lead one, an invocation each.
    pub leading: TileList,
    /// Those of groups that were taken apart, an invocation each.
    pub singles: TileList,
    /// The parts that lead a group in the end, a workgroup each.
    pub listed: TileList,
    /// R32_UINT, a texel a part: which leads its group.
    pub leaders: ImageId,
    /// As the parts' own shafts, at the places of those that lead.
    pub shafts: ImageId,
}

impl Groups {
    /// Groups of which none is known yet.
    pub(super) fn create(graph: &mut Graph<'_>, inputs: &ShadowInputs<'_>) -> Self {
        let name = &inputs.light_name;
        let [across, down] = tile_counts(inputs.camera.size());
        let down = down * PARTS;
        let leaders = ImageDesc::new(vk::Format::R32_UINT, across, down);
        let format = vk::Format::R32G32B32A32_SFLOAT;
        let shafts = ImageDesc::new(format, across * SHAFT_TEXELS, down);
        Self {
            leading: part_list(graph, inputs, "groups"),
            singles: part_list(graph, inputs, "singles"),
            listed: part_list(graph, inputs, "listed"),
            leaders: graph.create_image(format!("{NAME}.leaders {name}"), leaders),
            shafts: graph.create_image(format!("{NAME}.group_shafts {name}"), shafts),
        }
    }

    /// Declares that a transfer pass clears the lists; [`Groups::record_clear`] does it.
    pub(super) fn clear(&mut self, pass: &mut PassBuilder<'_, '_>) {
        for list in [&mut self.leading, &mut self.singles, &mut self.listed] {
            list.clear(pass);
        }
    }

    /// Clears the arguments of the lists to those of no work.
    pub(super) fn record_clear(&self, ctx: &mut PassContext<'_>) -> Result<(), GpuError> {
        [self.leading, self.singles, self.listed]
            .iter()
            .try_for_each(|list| list.record_clear(ctx))
    }

    /// Declares the pass that groups the parts that the estimates say are open.
    pub(super) fn add(
        &mut self,
        graph: &mut Graph<'_>,
        inputs: &ShadowInputs<'_>,
        params: BufferId,
        shafts: ImageId,
        estimates: ImageId,
    ) {
        let name = &inputs.light_name;
        let [across, down] = tile_counts(inputs.camera.size());
        let (view_params, part) = inputs.view_params;
        let shape = shape_number(&inputs.light.shape);
        let mut pass = graph.pass(format!("{NAME}.groups {name}"), PassKind::Compute);
        pass.read_part(view_params, part, Access::Uniform(Stage::Compute));
        pass.read(params, Access::Uniform(Stage::Compute));
        for image in [shafts, estimates] {
            pass.read(image, Access::StorageRead(Stage::Compute));
        }
        self.leading.fill(&mut pass);
        let written = Access::StorageWrite(Stage::Compute);
        self.leaders = pass.overwrite(self.leaders, written);
        self.shafts = pass.overwrite(self.shafts, written);
        let made = *self;
        pass.record(move |ctx| {
            let bindings = [
                Bind::uniform(0, view_params).part(part),
                Bind::uniform(1, params),
                Bind::storage_image(2, shafts),
                Bind::storage_image(3, estimates),
                Bind::storage_image(4, made.shafts),
                Bind::storage_image(5, made.leaders),
                Bind::storage_buffer(6, made.leading.arguments),
                Bind::storage_image(7, made.leading.tiles),
            ];
            let shader = &spirv::SHAFT_MASKS_GROUPS_COMP;
            let pipeline = ComputePipelineDesc {
                constants: vec![(0, shape), (2, PARTS)],
                ..ComputePipelineDesc::new(shader)
            };
            ctx.bind_compute(&pipeline, &bindings, &[])?;
            let cells = across.div_ceil(CELL) * down.div_ceil(CELL);
            ctx.dispatch(shader.groups([cells * PARTS, 1, 1]));
            Ok(())
        });
    }
}

/// Tiles of a cell across and down: `CELL` in `shaft_masks/lists.glsl`.
const CELL: u32 = 2;
