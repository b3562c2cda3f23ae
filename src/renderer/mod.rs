//! What every frame has around its shadows: scene buffers, G-buffer, shading.
//!
//! [`add_frame`] declares a whole picture in a graph:
//!
//! | pass | reads | writes |
//! |---|---|---|
//! | `gbuffer.ids` | vertices, indices | triangle ids, depth |
//! | `gbuffer.surface` | ids, triangles | view depth, geometric and shading normal |
//! | the technique's, for each light | the above | visibility |
//! | `shade.base` | ids, materials | radiance |
//! | `shade.light`, for each light | all of the above | radiance, added |

mod camera;
mod draw;
mod gbuffer;
mod scene_buffers;
mod scene_layout;
mod shade;
mod visible;

pub use camera::{PixelCamera, frustum_sees};
pub use draw::draw_ids;
pub use gbuffer::{GBuffer, add_gbuffer};
pub use scene_buffers::{Draw, SceneBuffers, SceneIds, UploadError};
pub use shade::{Ambient, LightPush, add_shading};
pub use visible::visible_hulls;

use crate::graph::{Graph, ImageId};
use crate::light::AreaLight;
use crate::scene::SceneCamera;
use crate::shadow::{ShadowInputs, ShadowMask, Technique};
use std::ops::Range;

/// A light with the name that its passes and files get.
#[derive(Clone, Debug)]
pub struct NamedLight {
    /// Name.
    pub name: String,
    /// The light, in scene space.
    pub light: AreaLight,
}

/// Images of a declared frame, all of the picture's size.
#[derive(Clone, Debug)]
pub struct Frame {
    /// The surface at each pixel.
    pub gbuffer: GBuffer,
    /// R32F visibility of each light.
    pub visibility: Vec<ImageId>,
    /// Passes that make each light's visibility, by place in the order of declaration.
    pub visibility_passes: Vec<Range<usize>>,
    /// RGBA32F, linear radiance; alpha 1 on surfaces, 0 elsewhere.
    pub radiance: ImageId,
}

/// Declares a picture of `size` pixels: G-buffer, visibility of every light, shading.
pub fn add_frame<'f>(
    graph: &mut Graph<'f>,
    scene: &'f SceneBuffers,
    camera: &SceneCamera,
    size: [u32; 2],
    lights: &[NamedLight],
    technique: Technique,
) -> Frame {
    let ids = scene.import(graph);
    let pixels = PixelCamera::new(camera, size);
    let gbuffer = add_gbuffer(graph, scene, &ids, camera, size);
    let boxes = scene.draws().iter().map(|draw| draw.bounds);
    let receivers = visible_hulls(camera, size, boxes);
    let mut visibility = Vec::with_capacity(lights.len());
    let mut visibility_passes = Vec::with_capacity(lights.len());
    for light in lights {
        let first = graph.pass_count();
        let ShadowMask { visibility: mask } = technique.add_passes(
            graph,
            &ShadowInputs {
                light_name: light.name.clone(),
                light: light.light,
                camera: pixels,
                ids: gbuffer.ids,
                view_depth: gbuffer.view_depth,
                geometric_normal: gbuffer.geometric_normal,
                receivers: receivers.clone(),
                scene,
                triangles: ids.triangles,
                vertices: ids.vertices,
                indices: ids.indices,
            },
        );
        visibility.push(mask);
        visibility_passes.push(first..graph.pass_count());
    }
    let ambient = Ambient::of(lights, scene.bounds());
    let radiance = add_shading(graph, &ids, &gbuffer, pixels, lights, &visibility, ambient);
    Frame {
        gbuffer,
        visibility,
        visibility_passes,
        radiance,
    }
}
