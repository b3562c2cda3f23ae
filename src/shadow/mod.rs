//! Shadow techniques under one interface.

pub mod auto;
mod casters;
pub mod dbuffer;
pub mod hard;
mod light_params;
mod light_view;
mod map;
pub mod mdi;
pub mod occlusion_textures;
pub mod oess;
pub mod pcss;
mod receivers;
pub mod shaft_masks;
pub mod silhouettes;
pub mod ssoc;
mod technique;
mod unblocked;
mod uniform;

pub(crate) use casters::{casters, is_above_all, is_before};
pub use light_params::{LightParams, ViewParams, shape_number};
pub use light_view::{LightView, LightViews, light_views};
pub use map::MAP_SIZE;
pub use technique::{Technique, TechniqueError, TechniqueOption};

use crate::geometry::{GBuffer, PixelCamera, SceneBuffers, SceneIds};
use crate::graph::{BufferId, BufferPart, ImageId};
use crate::light::{AreaLight, LightShape};
use glam::DVec3;
use silhouettes::Silhouettes;
use std::rc::Rc;

/// What a technique is given for one light.
pub struct ShadowInputs<'f> {
    /// Name of the light, for the names of passes.
    pub light_name: String,
    /// The light, in scene space.
    pub light: AreaLight,
    /// Camera of the picture.
    pub camera: PixelCamera,
    /// The surface at each pixel.
    pub gbuffer: GBuffer,
    /// Bounds of the surfaces in each tile: [`crate::geometry::add_tile_bounds`].
    pub tile_bounds: ImageId,
    /// [`ViewParams`] of this light: a uniform buffer, and the part of it.
    pub view_params: (BufferId, BufferPart),
    /// Convex hulls of what the picture can show: all pixels' surfaces lie in one of them. Scene
    /// space, metres.
    pub receivers: Rc<[Vec<DVec3>]>,
    /// For each of the scene's draws, whether it can block any of the light from any receiver.
    pub casters: Rc<[bool]>,
    /// All triangles.
    pub scene: &'f SceneBuffers,
    /// The scene's resources in this graph.
    pub ids: SceneIds,
    /// The list of silhouettes of an earlier frame ([`ShadowMask::silhouettes`]) in which light, scene
    /// and technique were the same, to be used again.
    pub silhouettes: Option<Silhouettes>,
}

/// What a technique makes for one light. All images are of the picture's size.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct ShadowMask {
    /// R32F: the part of the light that is seen, 0 to 1; 1 where nothing was hit.
    pub visibility: ImageId,
    /// Where nothing can block the light: the shape of which `visibility` is what lies above each surface's
    /// own horizon. Who knows the surface can find that without the image.
    pub unblocked: Option<LightShape>,
    /// RG32F, of a line: how much of the light that its visible parts give comes from its two
    /// ends, for shading. `None` shades with the visibility alone.
    pub end_influences: Option<ImageId>,
    /// R32F: a bound on the error of `visibility`; `None` where the technique proves none.
    pub error_bound: Option<ImageId>,
    /// The list of silhouettes that it was made with, worth keeping while light and scene stay.
    pub silhouettes: Option<Silhouettes>,
    /// What can be counted of the work, if anything.
    pub tally: Option<Tally>,
    /// How many tiles were settled beforehand, where the technique left them out.
    pub settled: Option<Tally>,
}

/// Counts that are made on the host from an image.
#[derive(Clone, Copy, Debug)]
pub struct Tally {
    /// R32_UINT.
    pub image: ImageId,
    /// Counts by name, from all its texels.
    pub count: fn(&[u32]) -> Vec<(&'static str, u64)>,
}

impl ShadowMask {
    /// Visibility and nothing else.
    pub fn new(visibility: ImageId) -> Self {
        Self {
            visibility,
            unblocked: None,
            end_influences: None,
            error_bound: None,
            silhouettes: None,
            tally: None,
            settled: None,
        }
    }
}
