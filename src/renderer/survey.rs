//! What of a scene a camera sees and what of it each light needs: found on the host, once a frame.

use super::{NamedLight, SceneBuffers, visible_hulls};
use crate::scene::SceneCamera;
use crate::shadow::auto::{Case, Choice, Table, choose};
use crate::shadow::{Technique, TechniqueError, casters};
use glam::DVec3;
use std::rc::Rc;

/// Why shadows of a frame cannot be declared.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ShadowError {
    /// A technique reads edges, and nobody has found those of the scene.
    #[error(
        "light `{light}`: technique `{technique}` reads the scene's edges, and there are none yet; \
         call SceneBuffers::add_edges once before the frame"
    )]
    NoEdges {
        /// The light's name.
        light: String,
        /// The technique.
        technique: &'static str,
    },
    /// The technique cannot do a light.
    #[error("light `{light}`: {source}")]
    Technique {
        /// The light's name.
        light: String,
        /// Why.
        source: TechniqueError,
    },
}

/// What [`add_frame_of`](super::add_frame_of) goes by: what is in view, what of the scene can block each
/// light there, and each light's technique. It holds for one scene, camera, picture size and list of lights.
#[derive(Clone, Debug)]
pub struct Survey {
    pub(super) receivers: Rc<[Vec<DVec3>]>,
    /// Of each light, and each of the scene's draws.
    pub(super) casters: Vec<Rc<[bool]>>,
    choices: Vec<Choice>,
    /// Of each light: whether its technique reads edges.
    reads_edges: Vec<bool>,
}

impl Survey {
    /// Looks at a scene from a camera with a picture of `size` pixels.
    ///
    /// # Errors
    /// [`ShadowError::Technique`] if the technique cannot do one of the lights.
    pub fn new(
        scene: &SceneBuffers,
        camera: &SceneCamera,
        size: [u32; 2],
        lights: &[NamedLight],
        technique: Technique,
    ) -> Result<Self, ShadowError> {
        for named in lights {
            let checked = technique.check(&named.light);
            checked.map_err(|source| ShadowError::Technique {
                light: named.name.clone(),
                source,
            })?;
        }
        let receivers = receivers(scene, camera, size);
        let casters = all_casters(scene, &receivers, lights);
        let choices = match technique {
            Technique::Auto(options) => {
                let both = lights.iter().zip(&casters);
                let cases =
                    both.map(|(named, casters)| Case::new(&named.light, casters, scene, size));
                choose(Table::reference(), &cases.collect::<Vec<_>>(), &options)
            }
            technique => vec![Choice::asked(technique); lights.len()],
        };
        let has_masks = scene.has_masks();
        let reads = |(choice, named): (&Choice, &NamedLight)| {
            let shape = named.light.shape.kind();
            choice.technique.reads_edges_of(shape, has_masks)
        };
        let reads_edges = choices.iter().zip(lights).map(reads).collect();
        Ok(Self {
            receivers,
            casters,
            choices,
            reads_edges,
        })
    }

    /// Each light's technique, and why: the one that was asked for, or what [`Technique::Auto`] chooses.
    pub fn choices(&self) -> &[Choice] {
        &self.choices
    }

    /// Whether the frame reads the scene's edges ([`SceneBuffers::add_edges`]). Those of
    /// [`Technique::Auto`] depend on its choices.
    pub fn reads_edges(&self) -> bool {
        self.reads_edges.contains(&true)
    }

    /// Refuses techniques that read edges of a scene without.
    pub(super) fn check_edges(
        &self,
        scene: &SceneBuffers,
        lights: &[NamedLight],
    ) -> Result<(), ShadowError> {
        let both = self.choices.iter().zip(lights);
        let mut reading = both.zip(&self.reads_edges).filter(|(_, reads)| **reads);
        match reading.next() {
            Some(((choice, named), _)) if !scene.has_edges() => Err(ShadowError::NoEdges {
                light: named.name.clone(),
                technique: choice.technique.name(),
            }),
            _ => Ok(()),
        }
    }
}

/// What [`Technique::Auto`] goes by, for each light.
#[must_use]
pub fn cases(
    scene: &SceneBuffers,
    camera: &SceneCamera,
    size: [u32; 2],
    lights: &[NamedLight],
) -> Vec<Case> {
    let casters = all_casters(scene, &receivers(scene, camera, size), lights);
    let both = lights.iter().zip(&casters);
    both.map(|(named, casters)| Case::new(&named.light, casters, scene, size))
        .collect()
}

/// Convex hulls of what is in view.
pub(super) fn receivers(
    scene: &SceneBuffers,
    camera: &SceneCamera,
    size: [u32; 2],
) -> Rc<[Vec<DVec3>]> {
    // Boxes that turn with the triangles grow less around what is turned.
    let boxes = scene.draws().iter().map(|draw| draw.corners);
    visible_hulls(camera, size, boxes, scene.covers()).into()
}

fn all_casters(
    scene: &SceneBuffers,
    receivers: &[Vec<DVec3>],
    lights: &[NamedLight],
) -> Vec<Rc<[bool]>> {
    let of = |named: &NamedLight| casters(&named.light, receivers, scene);
    lights.iter().map(of).collect()
}
