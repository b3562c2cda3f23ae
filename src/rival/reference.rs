//! The reference's tracer as the rival where Embree is not built in.

use std::time::Instant;

use super::{Casting, RivalError, RivalSampling};
use crate::light::AreaLight;
use crate::reference::{Reference, Sampling, Settings};
use crate::scene::{Scene, SceneCamera};

/// Which points; the tracer finds them by itself.
pub(super) struct Points {
    camera: SceneCamera,
    size: [u32; 2],
}

impl Points {
    pub(super) fn new(_: &Scene, _: &Reference<'_>, camera: &SceneCamera, size: [u32; 2]) -> Self {
        Self {
            camera: camera.clone(),
            size,
        }
    }
}

pub(super) struct Tracer;

impl Tracer {
    pub(super) fn new(_: &Scene) -> Result<Self, RivalError> {
        Ok(Self)
    }

    pub(super) fn name(&self) -> &str {
        "reference (obvhs)"
    }

    pub(super) fn cast(
        &self,
        reference: &Reference<'_>,
        points: &Points,
        light: &AreaLight,
        sampling: RivalSampling,
    ) -> Result<Casting, RivalError> {
        let sampling = match sampling {
            RivalSampling::Plain(samples) => Sampling::Plain { samples },
            RivalSampling::Adaptive { first, more } => Sampling::Adaptive { first, more },
        };
        let settings = Settings {
            camera: &points.camera,
            size: points.size,
            light,
            sampling: &sampling,
        };
        let start = Instant::now();
        let truth = reference.render(&settings, &|_| {})?;
        Ok(Casting {
            ms: start.elapsed().as_secs_f64() * 1.0e3,
            visibility: truth.visibility,
            rays: truth.rays,
        })
    }
}
