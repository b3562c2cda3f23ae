//! Rivals: ray tracing on the CPU, on all cores.
//!
//! A new tracer adds one [`Engine`] and its [`Rival`].

use super::contender::Rays;
use crate::light::AreaLight;
use crate::reference::{Reference, Sampling, Settings};
use crate::scene::{Scene, SceneCamera};

/// Why a rival has no picture.
pub type RivalError = Box<dyn std::error::Error + Send + Sync>;

/// A ray tracer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Engine {
    /// The one that casts references ([`crate::reference`]).
    Rays,
    /// Embree ([`crate::rival`]).
    #[cfg(feature = "embree")]
    Embree,
}

impl Engine {
    /// All that this build has.
    pub const ALL: &[Self] = &[
        Self::Rays,
        #[cfg(feature = "embree")]
        Self::Embree,
    ];

    /// The name before the `:` on the command line.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Rays => "rays",
            #[cfg(feature = "embree")]
            Self::Embree => "embree",
        }
    }

    /// Builds what the tracer needs of a scene.
    ///
    /// # Errors
    /// What the tracer has to say.
    pub fn prepare(self, scene: &Scene) -> Result<Box<dyn Rival + '_>, RivalError> {
        match self {
            Self::Rays => Ok(Box::new(ReferenceRival(Reference::new(scene)?))),
            #[cfg(feature = "embree")]
            Self::Embree => Ok(Box::new(EmbreeRival {
                tracer: crate::rival::Rival::new(scene)?,
                prepared: None,
            })),
        }
    }
}

/// What a rival is to cast.
#[derive(Clone, Copy, Debug)]
pub struct View<'a> {
    /// The camera.
    pub camera: &'a SceneCamera,
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// The light.
    pub light: &'a AreaLight,
    /// Rays a pixel.
    pub rays: Rays,
}

/// What a rival has cast.
#[derive(Clone, Debug, PartialEq)]
pub struct Cast {
    /// Part of the light that is seen, 0 to 1, rows from the top; 1 where nothing is hit.
    pub visibility: Vec<f32>,
    /// Rays cast towards the light.
    pub rays: u64,
    /// Milliseconds that count; `None` for the whole of the call.
    pub ms: Option<f64>,
}

/// A tracer with its scene, ready to cast.
pub trait Rival {
    /// Casts one picture on all cores.
    ///
    /// # Errors
    /// What the tracer has to say.
    fn cast(&mut self, view: &View<'_>) -> Result<Cast, RivalError>;
}

struct ReferenceRival<'s>(Reference<'s>);

impl Rival for ReferenceRival<'_> {
    fn cast(&mut self, view: &View<'_>) -> Result<Cast, RivalError> {
        let sampling = match view.rays {
            Rays::Plain(samples) => Sampling::Plain { samples },
            Rays::Adaptive { first, more } => Sampling::Adaptive { first, more },
        };
        let settings = Settings {
            camera: view.camera,
            size: view.size,
            light: view.light,
            sampling: &sampling,
        };
        let truth = self.0.render(&settings, &|_| {})?;
        Ok(Cast {
            visibility: truth.visibility,
            rays: truth.rays,
            ms: None,
        })
    }
}

/// Its time begins at the surface points, which a renderer has in its G-buffer.
#[cfg(feature = "embree")]
struct EmbreeRival<'s> {
    tracer: crate::rival::Rival<'s>,
    prepared: Option<(SceneCamera, [u32; 2])>,
}

#[cfg(feature = "embree")]
impl Rival for EmbreeRival<'_> {
    fn cast(&mut self, view: &View<'_>) -> Result<Cast, RivalError> {
        let is_prepared =
            |(camera, size): &(SceneCamera, [u32; 2])| camera == view.camera && *size == view.size;
        if !self.prepared.as_ref().is_some_and(is_prepared) {
            self.tracer.prepare(view.camera, view.size)?;
            self.prepared = Some((view.camera.clone(), view.size));
        }
        let sampling = match view.rays {
            Rays::Plain(rays) => crate::rival::RivalSampling::Plain(rays),
            Rays::Adaptive { first, more } => crate::rival::RivalSampling::Adaptive { first, more },
        };
        let casting = self.tracer.cast(view.light, sampling)?;
        Ok(Cast {
            visibility: casting.visibility,
            rays: casting.rays,
            ms: Some(casting.ms),
        })
    }
}
