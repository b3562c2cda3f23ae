//! Frames: surfaces, each light's visibility, shading.
//!
//! [`add_frame`] declares a whole picture in a graph:
//!
//! | pass | reads | writes |
//! |---|---|---|
//! | `frame.params` | | camera and lights for all passes |
//! | `gbuffer.*` | scene | the surface at each pixel ([`crate::geometry`]) |
//! | the technique's, for each light | the above | visibility |
//! | `shade.base` | ids, materials, textures | albedo, finish, radiance without any light |
//! | `shade.light`, for each light | all of the above | radiance, added |

mod shade;
mod survey;
mod unlit;

pub use crate::geometry::{
    Draw, GBuffer, PixelCamera, SceneBuffers, SceneIds, UploadError, add_triangle_ids,
    frustum_sees, visible_hulls,
};
pub use shade::{Ambient, Shading, ShadingInputs, add_shading};
pub use survey::{ShadowError, Survey, cases};
pub use unlit::unlit;

use crate::geometry::{add_gbuffer, add_tile_bounds};
use crate::graph::{Access, BufferDesc, BufferId, BufferPart, Graph, ImageId, PassKind};
use crate::light::AreaLight;
use crate::scene::SceneCamera;
use crate::shadow::auto::Choice;
use crate::shadow::silhouettes::Silhouettes;
use crate::shadow::{LightParams, ShadowInputs, ShadowMask, Technique, ViewParams, is_above_all};
use glam::{DVec3, Vec3};
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
    /// Everything that the technique made for each light.
    pub masks: Vec<ShadowMask>,
    /// Passes that make each light's visibility, by place in the order of declaration.
    pub visibility_passes: Vec<Range<usize>>,
    /// Each light's technique, and why; none where masks of an earlier frame are used.
    pub choices: Vec<Choice>,
    /// RGBA8 sRGB base colour of each pixel's surface.
    pub albedo: ImageId,
    /// RGBA32F, linear radiance; alpha 1 on surfaces, 0 elsewhere.
    pub radiance: ImageId,
}

/// What [`add_visibility`] declares.
#[derive(Clone, Debug)]
pub struct Visibilities {
    /// Everything that the technique makes for each light, in their order.
    pub masks: Vec<ShadowMask>,
    /// Passes that make each light's visibility, by place in the order of declaration.
    pub passes: Vec<Range<usize>>,
    /// Each light's technique, and why; none where masks of an earlier frame are used.
    pub choices: Vec<Choice>,
    /// A uniform buffer with [`ViewParams`] of each light.
    pub params: BufferId,
    /// Where in it each light's are.
    pub parts: Vec<BufferPart>,
}

/// Declares every light's visibility at the surfaces of a G-buffer of `size` pixels: that of
/// [`add_gbuffer`], or a host's own with the same meaning. `ids` is what
/// [`SceneBuffers::import`] returned for this graph.
///
/// # Errors
/// [`ShadowError::Technique`] if the technique cannot do a light, [`ShadowError::NoEdges`] if it reads
/// edges and the scene has none yet ([`SceneBuffers::add_edges`]). Nothing is declared then.
pub fn add_visibility<'f>(
    graph: &mut Graph<'f>,
    (scene, ids): (&'f SceneBuffers, SceneIds),
    gbuffer: GBuffer,
    camera: &SceneCamera,
    size: [u32; 2],
    lights: &[NamedLight],
    technique: Technique,
) -> Result<Visibilities, ShadowError> {
    let survey = Survey::new(scene, camera, size, lights, technique)?;
    survey.check_edges(scene, lights)?;
    let surfaces = (gbuffer, PixelCamera::new(camera, size));
    Ok(visibilities(
        graph,
        (scene, ids),
        surfaces,
        lights,
        &survey,
        &[],
    ))
}

fn visibilities<'f>(
    graph: &mut Graph<'f>,
    (scene, ids): (&'f SceneBuffers, SceneIds),
    (gbuffer, pixels): (GBuffer, PixelCamera),
    lights: &[NamedLight],
    survey: &Survey,
    silhouettes: &[Option<Silhouettes>],
) -> Visibilities {
    let (params, parts) = add_params(graph, pixels, lights);
    let tile_bounds = add_tile_bounds(graph, &gbuffer, pixels.size());
    let choices = survey.choices();
    let mut masks = Vec::with_capacity(lights.len());
    let mut passes = Vec::with_capacity(lights.len());
    for (at, (light, part)) in lights.iter().zip(&parts).enumerate() {
        if at > 0 {
            // A light's maps and lists lie where those of the light before were.
            graph.begin_part();
        }
        note_casters(graph, &light.name, &survey.casters[at]);
        let first = graph.pass_count();
        masks.push(choices[at].technique.add_passes(
            graph,
            &ShadowInputs {
                light_name: light.name.clone(),
                light: light.light,
                camera: pixels,
                gbuffer,
                tile_bounds,
                view_params: (params, *part),
                receivers: survey.receivers.clone(),
                casters: survey.casters[at].clone(),
                scene,
                ids,
                silhouettes: silhouettes.get(at).copied().flatten(),
            },
        ));
        passes.push(first..graph.pass_count());
    }
    Visibilities {
        masks,
        passes,
        choices: choices.to_vec(),
        params,
        parts,
    }
}

/// Notes which of the scene's draws are left out of what a light's technique draws; where all are, the technique
/// says so.
fn note_casters(graph: &mut Graph<'_>, light: &str, casters: &[bool]) {
    let idle = casters.iter().filter(|can| !**can).count();
    if (1..casters.len()).contains(&idle) {
        let all = casters.len();
        let reason = format!("{idle} of {all} draws cannot shadow anything that is in view");
        graph.skip(format!("casters {light}"), reason);
    }
}

/// Declares a picture of `size` pixels: surfaces, visibility of every light, shading.
///
/// # Errors
/// As [`add_visibility`].
pub fn add_frame<'f>(
    graph: &mut Graph<'f>,
    scene: &'f SceneBuffers,
    camera: &SceneCamera,
    size: [u32; 2],
    lights: &[NamedLight],
    technique: Technique,
) -> Result<Frame, ShadowError> {
    let survey = Survey::new(scene, camera, size, lights, technique)?;
    add_frame_of(graph, scene, camera, size, lights, &survey, &[])
}

/// As [`add_frame`], of a survey of the same scene, camera, size and lights. For the lights that
/// `silhouettes` has lists for, of an earlier frame ([`ShadowMask::silhouettes`]) in which lights, scene
/// and technique were the same, none are searched for; they are of this graph.
///
/// # Errors
/// [`ShadowError::NoEdges`].
pub fn add_frame_of<'f>(
    graph: &mut Graph<'f>,
    scene: &'f SceneBuffers,
    camera: &SceneCamera,
    size: [u32; 2],
    lights: &[NamedLight],
    survey: &Survey,
    silhouettes: &[Option<Silhouettes>],
) -> Result<Frame, ShadowError> {
    survey.check_edges(scene, lights)?;
    let ids = scene.import(graph);
    let gbuffer = add_gbuffer(graph, scene, &ids, camera, size);
    let pixels = PixelCamera::new(camera, size);
    let surfaces = (gbuffer, pixels);
    let found = visibilities(graph, (scene, ids), surfaces, lights, survey, silhouettes);
    let in_view = &survey.receivers;
    Ok(shaded(
        graph,
        (scene, &ids),
        surfaces,
        (lights, in_view),
        found,
    ))
}

/// As [`add_frame`], with what a technique made of the lights in an earlier frame, in which camera,
/// lights and scene were the same: no pass of a technique is declared. `masks` are images of this
/// graph, one for each light; lights beyond the list have no shadows.
pub fn add_frame_with_masks<'f>(
    graph: &mut Graph<'f>,
    scene: &'f SceneBuffers,
    camera: &SceneCamera,
    size: [u32; 2],
    lights: &[NamedLight],
    masks: Vec<ShadowMask>,
) -> Frame {
    let ids = scene.import(graph);
    let gbuffer = add_gbuffer(graph, scene, &ids, camera, size);
    let pixels = PixelCamera::new(camera, size);
    let (params, parts) = add_params(graph, pixels, lights);
    let none = graph.pass_count();
    let found = Visibilities {
        passes: vec![none..none; masks.len()],
        masks,
        choices: Vec::new(),
        params,
        parts,
    };
    let in_view = survey::receivers(scene, camera, size);
    let surfaces = (gbuffer, pixels);
    shaded(graph, (scene, &ids), surfaces, (lights, &in_view), found)
}

/// As [`add_frame`] with lights that nothing hides, which is what a frame costs without shadows: there are no
/// masks and no visibility.
pub fn add_frame_without_shadows<'f>(
    graph: &mut Graph<'f>,
    scene: &'f SceneBuffers,
    camera: &SceneCamera,
    size: [u32; 2],
    lights: &[NamedLight],
) -> Frame {
    add_frame_with_masks(graph, scene, camera, size, lights, Vec::new())
}

/// `in_view` are convex hulls of what the picture can show.
fn shaded<'f>(
    graph: &mut Graph<'f>,
    (scene, ids): (&'f SceneBuffers, &SceneIds),
    (gbuffer, camera): (GBuffer, PixelCamera),
    (lights, in_view): (&[NamedLight], &[Vec<DVec3>]),
    found: Visibilities,
) -> Frame {
    let unlit = lights.iter().map(|named| unlit(&named.light, in_view));
    let unlit: Vec<_> = unlit.collect();
    let eye = Vec3::from_slice(&camera.eye[..3]).as_dvec3();
    let above = lights
        .iter()
        .map(|named| is_above_all(&named.light, in_view, eye));
    let above: Vec<bool> = above.collect();
    let shading = add_shading(
        graph,
        &ShadingInputs {
            scene,
            ids,
            gbuffer: &gbuffer,
            camera,
            lights,
            masks: &found.masks,
            params: found.params,
            parts: &found.parts,
            ambient: Ambient::of(lights, scene.bounds()),
            unlit: &unlit,
            above: &above,
        },
    );
    Frame {
        gbuffer,
        visibility: found.masks.iter().map(|mask| mask.visibility).collect(),
        masks: found.masks,
        visibility_passes: found.passes,
        choices: found.choices,
        albedo: shading.albedo,
        radiance: shading.radiance,
    }
}

/// Space of a light's block in the buffer: the largest alignment that a device may ask for.
const BLOCK: u64 = 256;

/// Declares the pass that writes [`ViewParams`] for each light.
fn add_params(
    graph: &mut Graph<'_>,
    camera: PixelCamera,
    lights: &[NamedLight],
) -> (BufferId, Vec<BufferPart>) {
    let size = BLOCK * lights.len().max(1) as u64;
    let buffer = graph.create_buffer("frame.params", BufferDesc { size });
    let mut pass = graph.pass("frame.params", PassKind::Transfer);
    let buffer = pass.overwrite(buffer, Access::Clear);
    let blocks: Vec<ViewParams> = lights
        .iter()
        .map(|named| ViewParams {
            camera,
            light: LightParams::new(&named.light),
        })
        .collect();
    let parts = (0..blocks.len() as u64).map(|index| BufferPart {
        offset: index * BLOCK,
        size: size_of::<ViewParams>() as u64,
    });
    let parts: Vec<BufferPart> = parts.collect();
    let written = parts.clone();
    pass.record(move |ctx| {
        for (block, part) in blocks.iter().zip(written) {
            ctx.update_buffer(buffer, part.offset, bytemuck::bytes_of(block))?;
        }
        Ok(())
    });
    (buffer, parts)
}
