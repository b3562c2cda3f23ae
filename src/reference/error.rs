//! What can be wrong with what is asked for.

use std::path::PathBuf;

use glam::DVec2;

use super::MAX_SAMPLES;
use crate::light::{LightError, ShapeKind};

/// Why there is no reference.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReferenceError {
    /// The scene has more triangles than the hierarchy can number.
    #[error("the scene has {count} triangles; a reference can be cast for fewer than 2^30")]
    TooManyTriangles {
        /// Triangles.
        count: usize,
    },
    /// The size is 0 or too large.
    #[error("a reference of {width}x{height} pixels; give 1 or more a side and at most 2^32")]
    Size {
        /// Width in pixels.
        width: u32,
        /// Height in pixels.
        height: u32,
    },
    /// The light is invalid.
    #[error(transparent)]
    Light(#[from] LightError),
    /// A number of samples out of range.
    #[error("{samples} light samples; give {least} to {MAX_SAMPLES}")]
    Samples {
        /// What was given.
        samples: u32,
        /// Least number.
        least: u32,
    },
    /// A limit that is no number above 0.
    #[error("standard error {limit}; give a number above 0")]
    StandardError {
        /// What was given.
        limit: f64,
    },
    /// A pattern's text is wrong.
    #[error("{origin}:{line}: {reason}")]
    Pattern {
        /// The file.
        origin: String,
        /// Line, from 1.
        line: usize,
        /// What is wrong.
        reason: String,
    },
    /// A pattern's sample that is not on the light.
    #[error(
        "pattern sample {} {} lies outside the unit disk, which is all of a {shape} light",
        at.x, at.y
    )]
    PatternOutside {
        /// The sample.
        at: DVec2,
        /// The light's shape.
        shape: ShapeKind,
    },
    /// A pattern's file cannot be read.
    #[error("{}: cannot read the pattern: {source}", path.display())]
    ReadPattern {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
}
