//! Hard scenes, made by rule: small, the same every time, each with one thing that breaks shadows.
//!
//! [`cases`] are the scenes, one difficulty each. A [`Case`] can be put into other guises that must
//! look the same (scaled, turned, moved, mirrored, read back from a file far away from the origin) or
//! whose difference is known (a light of another size, one more blocker, a small move).
//! [`suite`] is the list for benchmarks: all of them and the large ones.

mod cases;
mod file;
mod guises;
mod mesh;
mod shapes;

pub use cases::{cases, large, steps_of_blockers};
pub use file::{AnimatedFile, broken_frame};
pub use guises::{LIGHT_FACTORS, SCALES, Similarity};

use crate::light::AreaLight;
use crate::scene::{Scene, SceneCamera};

/// One hard scene with its camera and its light.
#[derive(Clone, Debug, PartialEq)]
pub struct Case {
    /// Unique among [`cases`]; words joined by hyphens.
    pub name: String,
    /// What is hard about it.
    pub what: &'static str,
    /// The scene; it holds the camera and the light as well.
    pub scene: Scene,
    /// Where it is seen from.
    pub camera: SceneCamera,
    /// Index into [`Scene::lights`].
    pub light: usize,
    /// Visibility at every valid pixel, where one value is right for all of them.
    pub expected: Option<f32>,
    /// Whether shadows, or gaps between them, are narrower than a texel of a shadow map or a pixel:
    /// what a map does not hold no technique that reads it can find.
    pub fine: bool,
}

impl Case {
    /// The light.
    pub fn area_light(&self) -> &AreaLight {
        &self.scene.lights[self.light].light
    }
}

/// Everything that a benchmark of hard scenes runs: [`cases`], one of them under lights of many
/// sizes and at several scales, and [`large`] with 1.5 million triangles.
pub fn suite() -> Vec<Case> {
    let mut suite = cases();
    let named = |name: &str| suite.iter().find(|case| case.name == name).cloned();
    let touching = named("touching");
    for case in touching.iter() {
        suite.extend(LIGHT_FACTORS.map(|factor| case.light_scaled(factor)));
        suite.extend(SCALES.map(|scale| case.seen_as(&Similarity::scaled(scale))));
    }
    suite.push(large(1_500_000));
    suite
}
