//! The truth: visibility by ray tracing on the CPU.
//!
//! Shares nothing with the techniques that it judges but the [scene](crate::scene) and the
//! [light](crate::light). For each pixel the ray through its centre finds a point, and segments
//! from there to points all over the light are tested against every triangle; V is the part that
//! meets none. Arithmetic on rays is `f64` over the scene's `f32` vertices; no line slips through
//! between triangles that share an edge or a vertex, and nothing is offset by a bias.
//!
//! Light samples are Owen-scrambled Sobol' points, a scramble for each pixel. The standard error
//! follows from the spread between the four quarters of a pixel's samples. It is on the safe side:
//! quarters count as independent, while they fill each other's gaps; the error found is about 0.7
//! of it. The same input gives the same bytes, whatever the number of threads.
//!
//! What the conventions leave open:
//! - Beyond a flat light's plane V is the part of its area in sight all the same.
//! - A sun is uniform over solid angle.
//! - A point inside a sphere light sees its inside: V is uniform over the sphere's area.
//! - A triangle that holds the start or the end of a segment does not block it; ends count as known
//!   to single precision, as lights are.
//! - Primary hits nearer than the camera's near plane do not count.

mod beam;
mod cache;
mod error;
mod pattern;
mod render;
mod samples;
mod surface;
mod triangles;

use glam::UVec2;

pub use cache::Cache;
pub use error::ReferenceError;
pub use pattern::{MAX_PATTERN, Pattern};
pub use surface::Surface;

use crate::light::AreaLight;
use crate::scene::{Scene, SceneCamera};
use triangles::Triangles;

/// How many samples of the light are cast from a pixel.
#[derive(Clone, Debug, PartialEq)]
pub enum Sampling {
    /// For truth: with an estimate of the error. 16 samples or more, rounded up to a multiple of 4;
    /// powers of two are spread best.
    Estimated {
        /// Samples a pixel.
        samples: u32,
        /// Samples of partly lit pixels are doubled until their standard error is below this, or
        /// would be more than `most`.
        standard_error: Option<f64>,
        /// Most samples a pixel.
        most: u32,
    },
    /// As many samples everywhere, without an estimate. 1 or more.
    Plain {
        /// Samples a pixel.
        samples: u32,
    },
    /// `first` samples everywhere, and `more` where the pixels of a 3x3 neighbourhood are not all
    /// lit or all dark.
    Adaptive {
        /// Samples of every pixel, 1 or more.
        first: u32,
        /// Samples added.
        more: u32,
    },
    /// These samples at every pixel.
    Pattern(Pattern),
}

/// Most samples a pixel.
pub const MAX_SAMPLES: u32 = 1 << 20;

impl Sampling {
    /// [`Sampling::Estimated`] with that many samples everywhere.
    pub fn samples(samples: u32) -> Self {
        Self::Estimated {
            samples,
            standard_error: None,
            most: samples,
        }
    }
}

/// What is to be cast.
#[derive(Clone, Copy, Debug)]
pub struct Settings<'a> {
    /// The camera.
    pub camera: &'a SceneCamera,
    /// Width and height in pixels, each at least 1.
    pub size: [u32; 2],
    /// The light.
    pub light: &'a AreaLight,
    /// Its samples.
    pub sampling: &'a Sampling,
}

/// Visibility at each pixel, rows from the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Truth {
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Part of the light that is seen, 0 to 1; 1 where nothing is hit.
    pub visibility: Vec<f32>,
    /// Whether a technique can be held against it there: hit, no edge, and neither the tangent
    /// plane nor the light's own cuts or turns away the light.
    pub valid: Vec<bool>,
    /// Standard error of `visibility`, where the sampling has an estimate.
    pub standard_error: Option<StandardError>,
    /// Segments to the light that were decided, one by one or, where all of the light is seen or
    /// hidden alike, together; primary rays are not counted.
    pub rays: u64,
    /// With [`Sampling::Pattern`], which samples are seen.
    pub masks: Option<Masks>,
}

/// Estimated standard deviation of a pixel's visibility, over the partly lit pixels.
///
/// Of one pixel it comes from four numbers only and is coarse, so each pixel's variance is the mean
/// of those of the partly lit pixels in its 3x3 neighbourhood.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StandardError {
    /// Root of the mean variance.
    pub rms: f64,
    /// The largest.
    pub max: f64,
    /// Partly lit pixels.
    pub pixels: u64,
    /// Those that were left above the limit asked for.
    pub above: u64,
}

/// Which samples of a pattern each pixel sees.
#[derive(Clone, Debug, PartialEq)]
pub struct Masks {
    /// Number of samples.
    pub samples: usize,
    /// Bit `i % 64` of word `i / 64` of a pixel is 1 if it sees sample `i`;
    /// `samples.div_ceil(64)` words a pixel, rows from the top. All 1 where nothing is hit.
    pub words: Vec<u64>,
}

impl Masks {
    /// The words of the pixel with that number.
    pub fn pixel(&self, number: usize) -> &[u64] {
        let words = self.samples.div_ceil(64);
        &self.words[number * words..(number + 1) * words]
    }
}

/// A scene ready to be cast rays into.
#[derive(Debug)]
pub struct Reference<'a> {
    scene: &'a Scene,
    triangles: Triangles,
}

impl<'a> Reference<'a> {
    /// Builds the hierarchy. Triangles without area or with coordinates that are no numbers block
    /// nothing.
    ///
    /// # Errors
    /// [`ReferenceError::TooManyTriangles`].
    pub fn new(scene: &'a Scene) -> Result<Self, ReferenceError> {
        let count = scene.triangle_count();
        if count >= 1 << 30 {
            return Err(ReferenceError::TooManyTriangles { count });
        }
        Ok(Self {
            scene,
            triangles: Triangles::new(scene),
        })
    }

    /// Casts. `progress` is called from any thread with numbers of pixels that add up to all.
    ///
    /// # Errors
    /// What is wrong with the settings.
    pub fn render(
        &self,
        settings: &Settings<'_>,
        progress: &(dyn Fn(u64) + Sync),
    ) -> Result<Truth, ReferenceError> {
        settings.check()?;
        Ok(render::render(self, settings, progress))
    }

    /// What is seen at a pixel's centre.
    pub fn surface(&self, camera: &SceneCamera, size: [u32; 2], pixel: UVec2) -> Option<Surface> {
        let stack = &mut Vec::new();
        surface::surface(self.scene, &self.triangles, camera, size, pixel, stack)
    }

    /// Visibility of the light's centre, exactly 0 or 1, rows from the top; 1 where nothing is hit.
    ///
    /// # Errors
    /// What is wrong with size or light.
    pub fn center_visibility(
        &self,
        camera: &SceneCamera,
        size: [u32; 2],
        light: &AreaLight,
    ) -> Result<Vec<f32>, ReferenceError> {
        let settings = Settings {
            camera,
            size,
            light,
            sampling: &Sampling::Plain { samples: 1 },
        };
        settings.check()?;
        Ok(render::center_visibility(self, &settings))
    }
}

impl Settings<'_> {
    fn check(&self) -> Result<(), ReferenceError> {
        let [width, height] = self.size;
        if width == 0 || height == 0 || u64::from(width) * u64::from(height) > 1 << 32 {
            return Err(ReferenceError::Size { width, height });
        }
        self.light.validate()?;
        let samples = |samples: u32, least: u32| {
            let is_fine = (least..=MAX_SAMPLES).contains(&samples);
            (is_fine.then_some(())).ok_or(ReferenceError::Samples { samples, least })
        };
        match self.sampling {
            Sampling::Estimated {
                samples: count,
                standard_error,
                most,
            } => {
                samples(*count, 16)?;
                samples(*most, *count)?;
                match standard_error {
                    Some(limit) if !(limit.is_finite() && *limit > 0.0) => {
                        Err(ReferenceError::StandardError { limit: *limit })
                    }
                    _ => Ok(()),
                }
            }
            Sampling::Plain { samples: count } => samples(*count, 1),
            Sampling::Adaptive { first, more } => {
                samples(*first, 1)?;
                samples(*more, 1)
            }
            Sampling::Pattern(pattern) => pattern.check(self.light.shape.kind()),
        }
    }
}
