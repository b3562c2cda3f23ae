//! What frames are asked for and what comes back.

use super::dump::CapturedImage;
use super::kept::KeptMasks;
use super::kept_edges::KeptSilhouettes;
use crate::gpu::GpuError;
use crate::graph::{FakeMemory, FrameReport, Graph, GraphError, Plan};
use crate::renderer::{
    Frame, NamedLight, SceneBuffers, ShadowError, Survey, UploadError, add_frame, add_frame_of,
    add_frame_with_masks,
};
use crate::scene::{Scene, SceneCamera};
use crate::shadow::auto::Choice;
use crate::shadow::{Technique, TechniqueError};
use ash::vk;
use std::collections::BTreeMap;

/// What to render.
#[derive(Clone, Debug)]
pub struct FrameRequest {
    /// The camera.
    pub camera: SceneCamera,
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Lights, as indices into [`Scene::lights`]: all are shaded, and each one's visibility made.
    pub lights: Vec<usize>,
    /// How shadows are made.
    pub technique: Technique,
}

/// A rendered frame.
#[derive(Clone, Debug)]
pub struct CapturedFrame {
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Linear radiance, row by row from the top; alpha 1 on surfaces, 0 elsewhere.
    pub color: Vec<[f32; 4]>,
    /// The lights asked for, in that order.
    pub lights: Vec<CapturedLight>,
    /// What was planned.
    pub plan: Plan,
    /// What was recorded.
    pub report: FrameReport,
    /// Milliseconds on the device of each pass, in order; empty where the queue has no timestamps.
    pub passes: Vec<(String, f64)>,
    /// Milliseconds from the start of the host's work on the frame until the device was done,
    /// without copies back to the host.
    pub frame_ms: f64,
    /// Counts of things, by name.
    pub counters: BTreeMap<String, u64>,
    /// The images asked for by name, in that order.
    pub images: Vec<CapturedImage>,
}

/// One light of a [`CapturedFrame`].
#[derive(Clone, Debug)]
pub struct CapturedLight {
    /// Index into [`Scene::lights`].
    pub light: usize,
    /// Part of the light that is seen, 0 to 1, row by row from the top.
    pub visibility: Vec<f32>,
    /// Passes that made it.
    pub passes: Vec<String>,
    /// What the technique counts of its work, by name; of [`FrameRenderer::render_counted`](super::FrameRenderer::render_counted),
    /// and of frames of a technique [with a limit](Technique::has_limit).
    pub counters: BTreeMap<String, u64>,
    /// The technique, and why.
    pub choice: Choice,
}

/// Why a frame could not be had.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CaptureError {
    /// The size is 0 or above the device's limit.
    #[error("a picture of {width}x{height} pixels; each side must be 1 to {most}")]
    Size {
        /// Width in pixels.
        width: u32,
        /// Height in pixels.
        height: u32,
        /// Largest side.
        most: u32,
    },
    /// An index beyond the scene's lights.
    #[error("light {light} asked for, but the scene has {count}")]
    NoSuchLight {
        /// The index.
        light: usize,
        /// Number of lights.
        count: usize,
    },
    /// The technique cannot do a light.
    #[error("light `{light}`: {source}")]
    Technique {
        /// The light's name.
        light: String,
        /// Why.
        source: TechniqueError,
    },
    /// No image of the frame has that name.
    #[error("no image `{name}` in the frame; there is {}", have.join(", "))]
    NoSuchImage {
        /// The name asked for.
        name: String,
        /// All names.
        have: Vec<String>,
    },
    /// The image has fewer layers or mip levels.
    #[error("no image `{name}`: the image has {layers} layer(s) and {mips} mip level(s), from 0")]
    NoSuchPart {
        /// The name asked for.
        name: String,
        /// Its array layers.
        layers: u32,
        /// Its mip levels.
        mips: u32,
    },
    /// The image's texels are of a kind that is not read.
    #[error("image `{name}` cannot be dumped: its format {format:?} is not read")]
    DumpFormat {
        /// The name asked for.
        name: String,
        /// Its format.
        format: vk::Format,
    },
    /// The scene cannot be uploaded.
    #[error("scene: {0}")]
    Upload(#[from] UploadError),
    /// The shadows cannot be declared.
    #[error(transparent)]
    Shadow(#[from] ShadowError),
    /// The frame's graph is wrong.
    #[error("frame: {0}")]
    Graph(#[from] GraphError),
    /// The device refused.
    #[error(transparent)]
    Gpu(#[from] GpuError),
}

/// Plans a frame without a device.
pub fn plan_frame(scene: &Scene, request: &FrameRequest) -> Result<Plan, CaptureError> {
    // The largest image that every Vulkan device of this engine's minimum can make.
    let lights = check(scene, request, 16384)?;
    let buffers = SceneBuffers::plan_only(scene, request.technique.reads_edges());
    let mut graph = Graph::new();
    let (camera, size, technique) = (&request.camera, request.size, request.technique);
    let frame = add_frame(&mut graph, &buffers, camera, size, &lights, technique)?;
    graph.keep(frame.radiance);
    for visibility in frame.visibility {
        graph.keep(visibility);
    }
    Ok(graph.compile(&FakeMemory)?.plan().clone())
}

/// Exposure that brings a picture's 98th percentile of luminance on surfaces to 0.8; 1 where
/// nothing is lit. Depends on nothing but the picture.
pub fn exposure(color: &[[f32; 4]]) -> f32 {
    let mut lit: Vec<f32> = color
        .iter()
        .filter(|texel| texel[3] > 0.0)
        .map(|[r, g, b, _]| 0.2126 * r + 0.7152 * g + 0.0722 * b)
        .filter(|luminance| luminance.is_finite() && *luminance > 0.0)
        .collect();
    if lit.is_empty() {
        return 1.0;
    }
    let rank = (lit.len() * 98 / 100).min(lit.len() - 1);
    let (_, luminance, _) = lit.select_nth_unstable_by(rank, f32::total_cmp);
    0.8 / *luminance
}

/// The lights of a request that can be rendered.
pub(super) fn check(
    scene: &Scene,
    request: &FrameRequest,
    most: u32,
) -> Result<Vec<NamedLight>, CaptureError> {
    let [width, height] = request.size;
    if width == 0 || height == 0 || width > most || height > most {
        return Err(CaptureError::Size {
            width,
            height,
            most,
        });
    }
    let lights = request.lights.iter().map(|index| {
        let Some(found) = scene.lights.get(*index) else {
            return Err(CaptureError::NoSuchLight {
                light: *index,
                count: scene.lights.len(),
            });
        };
        let checked = request.technique.check(&found.light);
        checked.map_err(|source| CaptureError::Technique {
            light: found.name.clone(),
            source,
        })?;
        Ok(NamedLight {
            // Names need not be unique; pass names should be.
            name: format!("{index}:{}", found.name),
            light: found.light,
        })
    });
    lights.collect()
}

/// What a frame's shadows come from.
pub(super) enum Shadows<'k> {
    /// Masks of an earlier frame that fit.
    Kept(&'k KeptMasks),
    /// Techniques, with silhouettes of an earlier frame that fit.
    Made(Survey, Option<&'k KeptSilhouettes>),
}

/// Declares the frame.
pub(super) fn declare<'f>(
    graph: &mut Graph<'f>,
    buffers: &'f SceneBuffers,
    request: &FrameRequest,
    lights: &[NamedLight],
    shadows: &Shadows<'_>,
) -> Result<Frame, ShadowError> {
    let (camera, size) = (&request.camera, request.size);
    match shadows {
        Shadows::Kept(kept) => {
            for (named, choice) in lights.iter().zip(kept.choices()) {
                let name = format!("{} {}", choice.technique.name(), named.name);
                graph.skip(name, "nothing has moved since its mask was made");
            }
            let masks = kept.import(graph);
            let frame = add_frame_with_masks(graph, buffers, camera, size, lights, masks);
            Ok(Frame {
                choices: kept.choices().to_vec(),
                ..frame
            })
        }
        Shadows::Made(survey, kept) => {
            let kept = kept.map(|kept| kept.import(graph)).unwrap_or_default();
            add_frame_of(graph, buffers, camera, size, lights, survey, &kept)
        }
    }
}
