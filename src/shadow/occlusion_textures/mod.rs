//! Technique `occlusion-textures`: plausible image based soft shadows (E. Eisemann, X. Décoret,
//! SIBGRAPI 2006).
//!
//! The scene is cut into slices across the light's axis; what a slice blocks is a binary texture,
//! and the part of a light that it hides from a point is the texture's mean over the box that the
//! light covers of it, seen from there. Prefiltered textures give that mean at once, so neither the
//! light's size nor the width of a penumbra changes the cost of a pixel.
//!
//! Beside what was published: fine slices are cut first and joined where something is, so that none
//! is spent on empty space; boxes are averaged exactly, from summed-area tables of whole numbers;
//! and textures are combined by what each adds to those before it, which neither lets light leak
//! through a surface that slices cut, nor darkens blockers that lie behind each other twice.
//!
//! | pass | makes |
//! |---|---|
//! | `params` | views, planes |
//! | `slices` | a channel for each of 32 slices, by maximum |
//! | `pack` | bits of them |
//! | `any` | a pyramid of what slices hold anything in a square of texels |
//! | `groups` | the occlusion textures: runs of occupied slices |
//! | `cells` | how much of each square of texels they block |
//! | `rows`, `columns` | summed-area tables of that |
//! | `start`, `tiles` | the picture's tiles that need work |
//! | `visibility` | visibility |
//! | `unblocked` | visibility, instead of all others, where nothing can block the light |

mod between;
mod options;
mod prefilter;
mod slices;
mod views;
mod visibility;

use between::Casters;
pub use options::{Combine, Filter, Fit, OcclusionOptions, Planes, Projection};

use super::receivers::add_receivers;
use super::shaft_masks::add_classes;
use super::unblocked::add_unblocked;
use super::{ShadowInputs, ShadowMask, Tally};
use crate::graph::Graph;
use crate::light::ShapeKind;

/// The technique's name.
pub(super) const NAME: &str = "occlusion-textures";

/// Light shapes that have an area to cut boxes from.
pub(super) const SHAPES: &[ShapeKind] = &[
    ShapeKind::Rect,
    ShapeKind::Disk,
    ShapeKind::Sphere,
    ShapeKind::Sun,
];

/// Declares the passes.
pub(super) fn add_passes<'f>(
    graph: &mut Graph<'f>,
    inputs: &ShadowInputs<'f>,
    options: OcclusionOptions,
) -> ShadowMask {
    let boxes: Vec<_> = (inputs.scene.draws().iter().map(|draw| draw.corners)).collect();
    let casters = Casters {
        boxes: &boxes,
        blocks: &inputs.casters,
    };
    let views = views::sliced_views(&inputs.light, &inputs.receivers, &casters, &options);
    if views.is_empty() {
        let (shape, reason) = (inputs.light.shape, "no caster is in any slice");
        return add_unblocked(graph, inputs, NAME, shape, reason);
    }
    let mut counts = slices::create_counts(graph, &inputs.light_name, views.len());
    let mut sliced = Vec::with_capacity(views.len());
    for (index, view) in views.iter().enumerate() {
        let (slices, counted) = slices::add_slices(graph, inputs, &options, view, (index, counts));
        counts = counted;
        let filtered = prefilter::add_prefilter(graph, inputs, &options, &slices, index);
        sliced.push((slices, filtered));
    }
    let receivers = add_receivers(graph, inputs, NAME, inputs.light.shape.reach());
    let classes = options.classes && !options.count_fetches;
    let (receivers, settled) = add_classes(graph, inputs, NAME, receivers, classes);
    let mut mask = receivers.visibility;
    for (index, (slices, filtered)) in sliced.iter().enumerate() {
        mask = visibility::add_visibility(
            graph,
            inputs,
            &options,
            (slices, filtered),
            (receivers.list, mask),
            index,
        );
    }
    ShadowMask {
        tally: Some(Tally {
            image: counts,
            count: slices::tell,
        }),
        settled,
        ..ShadowMask::new(mask)
    }
}
