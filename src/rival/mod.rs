//! What techniques are up against on a machine without a GPU: visibility by casting rays on the
//! CPU, as fast as that goes.
//!
//! With the cargo feature `embree` rays are cast by Embree 3, in packets of 8, on all cores. The
//! surface points of the picture are found beforehand by [`Reference::surface`] and are no part of
//! the time, since a renderer that traces nothing but shadows has them in its G-buffer; nor are the
//! hierarchy and the tables of light samples, which are the same for all pixels. Without the
//! feature the tracer of [`crate::reference`] takes Embree's place; it finds the points itself, and
//! they are part of the time.
//!
//! What V is, and what is left open there, is as in [`crate::reference`]. Unlike there, arithmetic
//! on rays is `f32`, and rays start a little above the surface. The same input gives the same
//! bytes, whatever the number of threads.

#[cfg(feature = "embree")]
mod cast;
#[cfg(feature = "embree")]
mod embree;
#[cfg(feature = "embree")]
mod light;
#[cfg(feature = "embree")]
mod patterns;
#[cfg(feature = "embree")]
mod points;
#[cfg(not(feature = "embree"))]
mod reference;

use crate::light::{AreaLight, LightError};
use crate::reference::{MAX_SAMPLES, Reference, ReferenceError};
use crate::scene::{Scene, SceneCamera};

#[cfg(feature = "embree")]
use embree::Tracer;
#[cfg(feature = "embree")]
use points::Points;
#[cfg(not(feature = "embree"))]
use reference::{Points, Tracer};

/// Most samples a pixel of [`Rival::cast`].
pub const MAX_RAYS: u32 = 4096;
// Tables of light samples are held in memory; the other tracer must take them as well.
const _: () = assert!(MAX_RAYS <= MAX_SAMPLES);

/// How many rays are cast from a pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RivalSampling {
    /// As many everywhere, 1 to [`MAX_RAYS`].
    Plain(u32),
    /// `first` everywhere, and `more` where the pixels of a 3x3 neighbourhood are not all lit or
    /// all dark; each 1 or more, together at most [`MAX_RAYS`].
    Adaptive {
        /// Rays of every pixel.
        first: u32,
        /// Rays added.
        more: u32,
    },
}

/// What came of [`Rival::cast`].
#[derive(Clone, Debug, PartialEq)]
pub struct Casting {
    /// Part of the light that is seen, 0 to 1, rows from the top; 1 where nothing is hit.
    pub visibility: Vec<f32>,
    /// Wall clock from the prepared points to `visibility`, milliseconds.
    pub ms: f64,
    /// Rays cast towards the light. Samples below a point's tangent plane need none.
    pub rays: u64,
}

/// Why nothing was cast.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RivalError {
    /// The surface points cannot be found, or the reference's tracer has refused.
    #[error(transparent)]
    Reference(#[from] ReferenceError),
    /// The light is invalid.
    #[error(transparent)]
    Light(#[from] LightError),
    /// The size is 0 or too large.
    #[error("a picture of {width}x{height} pixels; give 1 or more a side and at most 2^28")]
    Size {
        /// Width in pixels.
        width: u32,
        /// Height in pixels.
        height: u32,
    },
    /// A number of rays out of range.
    #[error("{rays} rays a pixel; give 1 to {MAX_RAYS}")]
    Rays {
        /// What was given.
        rays: u64,
    },
    /// [`Rival::cast`] before [`Rival::prepare`].
    #[error("no view is prepared to cast rays from; prepare one first")]
    NotPrepared,
    /// More vertices than Embree can number.
    #[error("the scene has {count} vertices; Embree can take fewer than 2^32")]
    TooManyVertices {
        /// Vertices.
        count: u64,
    },
    /// Embree has failed.
    #[error("Embree cannot {what}: {reason}")]
    Embree {
        /// What it was to do.
        what: &'static str,
        /// Its words.
        reason: String,
    },
}

/// A scene ready to be cast shadow rays into.
pub struct Rival<'a> {
    scene: &'a Scene,
    reference: Reference<'a>,
    tracer: Tracer,
    points: Option<Points>,
}

impl std::fmt::Debug for Rival<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Rival").finish_non_exhaustive()
    }
}

impl<'a> Rival<'a> {
    /// Builds the hierarchy. Triangles without area or with coordinates that are no numbers block
    /// nothing.
    ///
    /// # Errors
    /// A scene that is too large, or what Embree has to say.
    pub fn new(scene: &'a Scene) -> Result<Self, RivalError> {
        Ok(Self {
            scene,
            reference: Reference::new(scene)?,
            tracer: Tracer::new(scene)?,
            points: None,
        })
    }

    /// The tracer, with its version.
    pub fn name(&self) -> &str {
        self.tracer.name()
    }

    /// Finds the surface points at the pixels' centres of a picture of `size` (width and height).
    /// They take the place of those of an earlier view.
    ///
    /// # Errors
    /// [`RivalError::Size`].
    pub fn prepare(&mut self, camera: &SceneCamera, size: [u32; 2]) -> Result<(), RivalError> {
        let [width, height] = size;
        if width == 0 || height == 0 || u64::from(width) * u64::from(height) > 1 << 28 {
            return Err(RivalError::Size { width, height });
        }
        self.points = Some(Points::new(self.scene, &self.reference, camera, size));
        Ok(())
    }

    /// Casts the rays of one light from the prepared points, on all cores.
    ///
    /// # Errors
    /// [`RivalError::NotPrepared`], [`RivalError::Rays`] or [`RivalError::Light`].
    pub fn cast(
        &mut self,
        light: &AreaLight,
        sampling: RivalSampling,
    ) -> Result<Casting, RivalError> {
        light.validate()?;
        let (least, all) = match sampling {
            RivalSampling::Plain(rays) => (rays, u64::from(rays)),
            RivalSampling::Adaptive { first, more } => {
                (first.min(more), u64::from(first) + u64::from(more))
            }
        };
        if least == 0 || all > u64::from(MAX_RAYS) {
            let rays = if least == 0 { 0 } else { all };
            return Err(RivalError::Rays { rays });
        }
        let points = self.points.as_ref().ok_or(RivalError::NotPrepared)?;
        self.tracer.cast(&self.reference, points, light, sampling)
    }
}
