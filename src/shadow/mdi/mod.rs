//! Technique `mdi`: depth-dependent filtering of multi-layer depth images (B. Keating, N. Max,
//! Eurographics Workshop on Rendering 1999).
//!
//! A view from the light's centre keeps, of what can stand between light and picture, all surfaces at
//! each texel: a mask of the depth buckets that hold any, and a sorted list of their depths. From each pixel's surface a fan of rays goes to the
//! light; where a ray crosses the boundary between two buckets, their bits at that texel say whether
//! it is blocked. Where the receiver's own plane passes through these buckets, the depths in the
//! list are compared with it instead.
//!
//! Boundaries that no ray of a pixel's fan is blocked at are ruled out first, for all rays at once. A
//! ray then goes through the pyramid's cells from boundary to boundary: one fetch tests the 32 of a
//! word that it crosses within a cell.
//!
//! Of a light with several views a ray may leave the receiver's before it comes to the light. What of
//! it lies in the others is then looked at there, where anything is marked so near to the light.
//!
//! | pass | makes |
//! |---|---|
//! | `params` | views, buckets, rays |
//! | `clear`, `count` | lengths of lists, masks of the boundaries that are blocked |
//! | `rows`, `heads` | where each list begins: a prefix sum |
//! | `fill`, `sort` | the lists |
//! | `boundaries` | a pyramid of the boundaries that are blocked in any of its texels |
//! | `start`, `tiles` | the picture's tiles that need work |
//! | `visibility` | visibility |

mod coverage;
mod layers;
mod options;
mod rays;
mod views;

pub use options::{Buckets, Footprint, MdiOptions};

use super::receivers::add_receivers;
use super::shaft_masks::add_classes;
use super::{ShadowInputs, ShadowMask, Tally, shape_number};
use crate::gpu::{ComputePipelineDesc, SamplerDesc, spirv};
use crate::graph::{Access, Bind, Graph, PassKind, Stage};
use coverage::Runs;
use layers::Layers;

/// The technique's name.
pub(super) const NAME: &str = "mdi";

/// Declares the passes.
pub(super) fn add_passes<'f>(
    graph: &mut Graph<'f>,
    inputs: &ShadowInputs<'f>,
    options: MdiOptions,
) -> ShadowMask {
    let draws = inputs.scene.draws();
    let light = &inputs.light;
    let none = !inputs.casters.contains(&true);
    // What of an uneven light is above a horizon takes rays, and rays a view.
    let mut blocks: Vec<_> = inputs
        .casters
        .iter()
        .map(|blocks| *blocks || none)
        .collect();
    let runs = Runs::new(draws, &mut blocks);
    // Boxes that turn with the triangles grow less around what is turned.
    let boxes: Vec<_> = draws.iter().map(|draw| draw.corners).collect();
    let size = inputs.camera.size();
    let casters = (boxes.as_slice(), blocks.as_slice());
    let views = views::mdi_views(light, &inputs.receivers, casters, (&options, size));
    let layers = layers::add_layers(graph, inputs, &options, (&views, &runs));
    add_visibility(graph, inputs, &layers, options.classes)
}

fn add_visibility<'f>(
    graph: &mut Graph<'f>,
    inputs: &ShadowInputs<'f>,
    layers: &Layers,
    classes: bool,
) -> ShadowMask {
    let name = &inputs.light_name;
    let light = inputs.light;
    let receivers = add_receivers(graph, inputs, NAME, light.shape.reach());
    let (receivers, settled) = add_classes(graph, inputs, NAME, receivers, classes);
    let list = receivers.list;
    let gbuffer = inputs.gbuffer;
    let layers = *layers;
    let (view_params, part) = inputs.view_params;
    let mut pass = graph.pass(format!("{NAME}.visibility {name}"), PassKind::Compute);
    pass.read_part(view_params, part, Access::Uniform(Stage::Compute));
    pass.read(layers.params, Access::Uniform(Stage::Compute));
    pass.read(layers.rays, Access::Uniform(Stage::Compute));
    for image in [
        gbuffer.view_depth,
        gbuffer.geometric_normal,
        layers.boundaries,
        layers.heads,
        layers.lists,
    ] {
        pass.read(image, Access::Sampled(Stage::Compute));
    }
    list.read(&mut pass);
    let visibility = pass.write(receivers.visibility, Access::StorageWrite(Stage::Compute));
    let tally = pass.write(layers.tally, Access::StorageReadWrite(Stage::Compute));
    let constants = vec![(0, shape_number(&light.shape))];
    pass.record(move |ctx| {
        let nearest = SamplerDesc::nearest();
        let bindings = [
            Bind::uniform(0, view_params).part(part),
            Bind::uniform(1, layers.params),
            Bind::sampled(2, gbuffer.view_depth, nearest),
            Bind::sampled(3, gbuffer.geometric_normal, nearest),
            Bind::sampled(4, layers.boundaries, nearest).array(),
            Bind::sampled(5, layers.heads, nearest).array(),
            Bind::sampled(6, layers.lists, nearest),
            Bind::storage_image(7, visibility),
            Bind::uniform(8, list.arguments),
            Bind::sampled(9, list.tiles, nearest),
            Bind::uniform(10, layers.rays),
            Bind::storage_image(11, tally),
        ];
        let pipeline = ComputePipelineDesc {
            constants,
            ..ComputePipelineDesc::new(&spirv::MDI_VISIBILITY_COMP)
        };
        ctx.bind_compute(&pipeline, &bindings, &[])?;
        list.dispatch(ctx)
    });
    ShadowMask {
        tally: Some(Tally {
            image: tally,
            count,
        }),
        settled,
        ..ShadowMask::new(visibility)
    }
}

/// Pixels that rays were traced from; depths that are in the way of light, and that lists had room for.
fn count(texels: &[u32]) -> Vec<(&'static str, u64)> {
    let counts: Vec<u64> = texels.iter().copied().map(u64::from).collect();
    vec![
        ("pixels_traced", counts[2..].iter().sum()),
        ("depths_listed", counts[0]),
        ("depths", counts[1]),
    ]
}
