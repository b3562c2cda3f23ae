//! What is done where lists ask for more chunks than the pool has: `dbuffer/overflow.glsl`.

use super::lists::{Lists, Made};
use crate::geometry::{TileList, tile_counts};
use crate::gpu::{ComputePipelineDesc, GpuError, SamplerDesc, spirv};
use crate::graph::{
    Access, Bind, BufferDesc, BufferId, Graph, ImageDesc, PassContext, PassKind, Stage,
};
use crate::shadow::ShadowInputs;
use ash::vk;

/// The tiles whose lists are made again: none where the pool had room for all.
#[derive(Clone, Copy)]
pub(super) struct Fitting {
    /// Arguments are `Fitting` in `dbuffer/overflow.glsl`, beginning with those of a dispatch of 64 tiles a workgroup.
    pub tiles: TileList,
}

impl Fitting {
    /// Dispatches `dbuffer/lists.comp` over them.
    pub fn dispatch_lists(&self, ctx: &mut PassContext<'_>) -> Result<(), GpuError> {
        ctx.dispatch_indirect(self.tiles.arguments, 16)
    }
}

impl Lists {
    /// Declares the passes that empty all lists and choose tiles that fit, if the lists ask for more than there is.
    pub(super) fn add_overflow(
        &self,
        graph: &mut Graph<'_>,
        inputs: &ShadowInputs<'_>,
        mut made: Made,
    ) -> (Made, Fitting) {
        let (technique, name) = (self.technique, &inputs.light_name);
        let (params, tiles) = (self.params, self.receivers.list);
        let nearest = SamplerDesc::nearest();
        let (overflow, arguments) = self.add_check(graph, inputs, made.used);

        let [across, down] = tile_counts(inputs.camera.size());
        let desc = ImageDesc::new(vk::Format::R32_UINT, across, down);
        let demands = graph.create_image(format!("{technique}.demands {name}"), desc);
        let mut pass = graph.pass(format!("{technique}.demand {name}"), PassKind::Compute);
        pass.read(overflow, Access::Indirect);
        for buffer in [params, tiles.arguments] {
            pass.read(buffer, Access::Uniform(Stage::Compute));
        }
        pass.read(tiles.tiles, Access::Sampled(Stage::Compute));
        made.lists = pass.write(made.lists, Access::StorageReadWrite(Stage::Compute));
        let demands = pass.overwrite(demands, Access::StorageWrite(Stage::Compute));
        pass.record(move |ctx| {
            let bindings = [
                Bind::uniform(0, params),
                Bind::uniform(1, tiles.arguments),
                Bind::sampled(2, tiles.tiles, nearest),
                Bind::storage_image(3, made.lists),
                Bind::storage_image(4, demands),
            ];
            let shader = ComputePipelineDesc::new(&spirv::DBUFFER_DEMAND_COMP);
            ctx.bind_compute(&shader, &bindings, &[])?;
            ctx.dispatch_indirect(overflow, 0)
        });

        let list = graph.create_image(format!("{technique}.fitting.list {name}"), desc);
        let mut pass = graph.pass(format!("{technique}.fit {name}"), PassKind::Compute);
        pass.read(overflow, Access::Indirect);
        for buffer in [params, tiles.arguments] {
            pass.read(buffer, Access::Uniform(Stage::Compute));
        }
        for image in [tiles.tiles, demands] {
            pass.read(image, Access::Sampled(Stage::Compute));
        }
        made.used = pass.write(made.used, Access::StorageWrite(Stage::Compute));
        let fitting = TileList {
            arguments: pass.write(arguments, Access::StorageWrite(Stage::Compute)),
            tiles: pass.overwrite(list, Access::StorageWrite(Stage::Compute)),
        };
        pass.record(move |ctx| {
            let bindings = [
                Bind::uniform(0, params),
                Bind::uniform(1, tiles.arguments),
                Bind::sampled(2, tiles.tiles, nearest),
                Bind::sampled(3, demands, nearest),
                Bind::storage_buffer(4, made.used),
                Bind::storage_buffer(5, fitting.arguments),
                Bind::storage_image(6, fitting.tiles),
            ];
            let shader = ComputePipelineDesc::new(&spirv::DBUFFER_FIT_COMP);
            ctx.bind_compute(&shader, &bindings, &[])?;
            ctx.dispatch_indirect(overflow, 16)
        });
        (made, Fitting { tiles: fitting })
    }

    /// Whether there is anything to do: arguments of the two passes after it, and of those that make lists again.
    fn add_check(
        &self,
        graph: &mut Graph<'_>,
        inputs: &ShadowInputs<'_>,
        used: BufferId,
    ) -> (BufferId, BufferId) {
        let (technique, name) = (self.technique, &inputs.light_name);
        let desc = BufferDesc { size: 32 };
        let overflow = graph.create_buffer(format!("{technique}.overflow {name}"), desc);
        let fitting = graph.create_buffer(format!("{technique}.fitting.arguments {name}"), desc);
        let (params, tiles) = (self.params, self.receivers.list.arguments);
        let mut pass = graph.pass(format!("{technique}.overflow {name}"), PassKind::Compute);
        for buffer in [params, tiles] {
            pass.read(buffer, Access::Uniform(Stage::Compute));
        }
        pass.read(used, Access::StorageRead(Stage::Compute));
        let overflow = pass.overwrite(overflow, Access::StorageWrite(Stage::Compute));
        let fitting = pass.overwrite(fitting, Access::StorageWrite(Stage::Compute));
        pass.record(move |ctx| {
            let bindings = [
                Bind::uniform(0, params),
                Bind::uniform(1, tiles),
                Bind::storage_buffer(2, used),
                Bind::storage_buffer(3, overflow),
                Bind::storage_buffer(4, fitting),
            ];
            let shader = ComputePipelineDesc::new(&spirv::DBUFFER_OVERFLOW_COMP);
            ctx.bind_compute(&shader, &bindings, &[])?;
            ctx.dispatch([1, 1, 1]);
            Ok(())
        });
        (overflow, fitting)
    }
}
