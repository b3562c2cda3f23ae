//! Silhouette edges of the whole scene as a light sees them, found on the device.
//!
//! | pass | makes |
//! |---|---|
//! | `silhouettes.classify` | a bit for each edge |
//! | `silhouettes.offsets` | where each 32 edges' silhouettes stand in the list; the draw's arguments |
//! | `silhouettes.compact` | the list, in the order of edges |
//!
//! Nothing depends on the order in which invocations run. A consumer draws [`Silhouettes::draw`]
//! without vertex buffers: vertex `i` belongs to entry `i / vertices` of the list, and
//! `silhouettes/edges.glsl` reads the edge.

use super::{ShadowInputs, shape_number};
use crate::geometry::image_place;
use crate::gpu::{ComputePipelineDesc, GpuError, SamplerDesc, spirv};
use crate::graph::{
    Access, Bind, BufferDesc, BufferId, Graph, ImageDesc, ImageId, PassBuilder, PassContext,
    PassKind, Stage,
};
use ash::vk;

/// From where an edge must be seen as a silhouette: all its faces on one side of the plane through
/// the edge and that point. Open edges always are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum SilhouetteRule {
    /// From the light's centre.
    Center,
    /// From some point of the light: misses none, and with three or more faces at an edge may have
    /// one too many. It needs no face normals, unlike the test of Jakobsen et al. (Boundary Correct
    /// Real-Time Soft Shadows, section 3.1), which misses edges between two faces that both cut the
    /// light.
    WholeLight,
    /// From some point of the light more faces are on one side of that plane than on the other: there the
    /// number of surfaces before the light changes. Of at most two faces these are the edges of
    /// [`WholeLight`](Self::WholeLight); of more it has edges too that are no outlines.
    Layers,
}

/// A list of edges on the device.
#[derive(Clone, Copy, Debug)]
pub struct Silhouettes {
    /// R32_UINT, rows of 4096: numbers of edges, ascending.
    pub list: ImageId,
    /// `VkDrawIndirectCommand` of one instance (four `u32`), the number of edges in the list, then
    /// `VkDispatchIndirectCommand` of an invocation for each, 64 a workgroup in rows of 32768.
    pub arguments: BufferId,
}

impl Silhouettes {
    /// Declares that a pass draws the list, with the edges read in its vertex shader.
    pub fn read(&self, pass: &mut PassBuilder<'_, '_>, inputs: &ShadowInputs<'_>) {
        pass.read(self.arguments, Access::Indirect);
        for image in [self.list, inputs.ids.edges, inputs.ids.points] {
            pass.read(image, Access::Sampled(Stage::Vertex));
        }
    }

    /// Draws the bound pipeline's vertices for each edge.
    pub fn draw(&self, ctx: &mut PassContext<'_>) -> Result<(), GpuError> {
        ctx.draw_indirect(self.arguments, 0)
    }

    /// Dispatches the bound pipeline, of 64 invocations a workgroup, over the list. The pass reads
    /// [`arguments`](Self::arguments) as [`Access::Indirect`].
    pub fn dispatch(&self, ctx: &mut PassContext<'_>) -> Result<(), GpuError> {
        ctx.dispatch_indirect(self.arguments, 20)
    }
}

/// Size of [`Silhouettes::arguments`].
pub(crate) const ARGUMENTS_BYTES: u64 = 32;

/// Edges that one invocation classifies.
const RUN: u32 = 32;

/// Number of the scene's edges.
///
/// # Panics
/// If they have not been found: [`crate::geometry::SceneBuffers::add_edges`].
pub(super) fn edge_count(inputs: &ShadowInputs<'_>) -> u32 {
    assert!(
        inputs.scene.has_edges(),
        "the scene's edges are added before they are read"
    );
    inputs.scene.edge_count() as u32
}

/// Why nothing is made of edges: no outline is known where alpha cuts triangles out.
pub(super) const NO_EDGES: &str = "the scene has no edges";

/// Notes that a technique's passes over edges are not needed, and why.
pub(super) fn skip_edges(
    graph: &mut Graph<'_>,
    inputs: &ShadowInputs<'_>,
    technique: &str,
    passes: &[&str],
    reason: &str,
) {
    for pass in passes {
        graph.skip(format!("{technique}.{pass} {}", inputs.light_name), reason);
    }
}

/// Stands in for an image that edges would be drawn into: a texel of zeros for each layer.
pub(super) fn add_blank(
    graph: &mut Graph<'_>,
    name: String,
    format: vk::Format,
    layers: u32,
) -> ImageId {
    let desc = ImageDesc::new(format, 1, 1).layers(layers);
    let blank = graph.create_image(name.clone(), desc);
    let mut pass = graph.pass(name, PassKind::Transfer);
    let blank = pass.overwrite(blank, Access::Clear);
    pass.record(move |ctx| ctx.clear_image(blank, [0.0; 4]));
    blank
}

/// Declares the passes, or none if the inputs bring the list of an earlier frame. `vertices` is how
/// many the consumer draws for each edge.
///
/// # Panics
/// If the scene's edges have not been found: [`crate::geometry::SceneBuffers::add_edges`].
pub fn add_silhouettes(
    graph: &mut Graph<'_>,
    inputs: &ShadowInputs<'_>,
    technique: &str,
    rule: SilhouetteRule,
    vertices: u32,
) -> Silhouettes {
    let name = &inputs.light_name;
    if let Some(kept) = inputs.silhouettes {
        let reason = "neither light nor casters have moved since the list was made";
        graph.skip(format!("{technique}.silhouettes {name}"), reason);
        return kept;
    }
    let edge_count = edge_count(inputs);
    let runs = edge_count.div_ceil(RUN).max(1);
    let size = u64::from(runs) * 4;
    let mut buffer = |what: &str, size: u64| {
        let desc = BufferDesc { size };
        graph.create_buffer(format!("{technique}.silhouettes.{what} {name}"), desc)
    };
    let masks = buffer("masks", size);
    let offsets = buffer("offsets", size);
    let arguments = buffer("arguments", ARGUMENTS_BYTES);
    let [width, height] = image_place(edge_count as usize);
    let desc = ImageDesc::new(vk::Format::R32_UINT, width, height);
    let list = graph.create_image(format!("{technique}.silhouettes {name}"), desc);

    let (params, part) = inputs.view_params;
    let (edges, points) = (inputs.ids.edges, inputs.ids.points);
    let shape = shape_number(&inputs.light.shape);
    let pass_name = format!("{technique}.silhouettes.classify {name}");
    let mut pass = graph.pass(pass_name, PassKind::Compute);
    pass.read_part(params, part, Access::Uniform(Stage::Compute));
    pass.read(edges, Access::Sampled(Stage::Compute));
    pass.read(points, Access::Sampled(Stage::Compute));
    let masks = pass.overwrite(masks, Access::StorageWrite(Stage::Compute));
    pass.record(move |ctx| {
        let shader = &spirv::SILHOUETTES_CLASSIFY_COMP;
        let nearest = SamplerDesc::nearest();
        let bindings = [
            Bind::uniform(0, params).part(part),
            Bind::sampled(1, edges, nearest),
            Bind::sampled(2, points, nearest),
            Bind::storage_buffer(3, masks),
        ];
        let whole = u32::from(rule != SilhouetteRule::Center);
        let all_changes = u32::from(rule == SilhouetteRule::Layers);
        let pipeline = ComputePipelineDesc {
            constants: vec![(0, shape), (1, whole), (2, all_changes)],
            ..ComputePipelineDesc::new(shader)
        };
        ctx.bind_compute(&pipeline, &bindings, bytemuck::bytes_of(&edge_count))?;
        ctx.dispatch(shader.groups([runs, 1, 1]));
        Ok(())
    });

    let pass_name = format!("{technique}.silhouettes.offsets {name}");
    let mut pass = graph.pass(pass_name, PassKind::Compute);
    pass.read(masks, Access::StorageRead(Stage::Compute));
    let offsets = pass.overwrite(offsets, Access::StorageWrite(Stage::Compute));
    let arguments = pass.overwrite(arguments, Access::StorageWrite(Stage::Compute));
    pass.record(move |ctx| {
        let bindings = [
            Bind::storage_buffer(0, masks),
            Bind::storage_buffer(1, offsets),
            Bind::storage_buffer(2, arguments),
        ];
        let pipeline = ComputePipelineDesc::new(&spirv::SILHOUETTES_OFFSETS_COMP);
        ctx.bind_compute(&pipeline, &bindings, bytemuck::bytes_of(&[runs, vertices]))?;
        ctx.dispatch([1, 1, 1]);
        Ok(())
    });

    let pass_name = format!("{technique}.silhouettes.compact {name}");
    let mut pass = graph.pass(pass_name, PassKind::Compute);
    pass.read(masks, Access::StorageRead(Stage::Compute));
    pass.read(offsets, Access::StorageRead(Stage::Compute));
    let list = pass.overwrite(list, Access::StorageWrite(Stage::Compute));
    pass.record(move |ctx| {
        let shader = &spirv::SILHOUETTES_COMPACT_COMP;
        let bindings = [
            Bind::storage_buffer(0, masks),
            Bind::storage_buffer(1, offsets),
            Bind::storage_image(2, list),
        ];
        let pipeline = ComputePipelineDesc::new(shader);
        ctx.bind_compute(&pipeline, &bindings, bytemuck::bytes_of(&runs))?;
        ctx.dispatch(shader.groups([runs, 1, 1]));
        Ok(())
    });
    Silhouettes { list, arguments }
}
