//! Shadow techniques under one interface.

pub mod hard;
mod light_params;
mod light_view;

pub use light_params::{LightParams, ViewParams, shape_number};
pub use light_view::{LightView, LightViews, light_views};

use crate::geometry::{GBuffer, PixelCamera, SceneBuffers, SceneIds};
use crate::graph::{BufferId, BufferPart, Graph, ImageId};
use crate::light::{AreaLight, ShapeKind};
use glam::DVec3;

/// How visibility is found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Technique {
    /// One shadow map from the light's centre: no penumbra.
    Hard,
}

/// One option of a technique.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TechniqueOption {
    /// The key in `NAME:key=value`.
    pub name: &'static str,
    /// Value without it.
    pub default: &'static str,
    /// Values it takes.
    pub values: &'static str,
    /// What it does.
    pub what: &'static str,
}

/// Why a text names no technique.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum TechniqueError {
    /// No technique of that name.
    #[error("unknown technique `{name}`; there is {known}")]
    Unknown {
        /// The name asked for.
        name: String,
        /// All names.
        known: String,
    },
    /// The technique has no such option.
    #[error("technique `{technique}` has no option `{option}`; {known}")]
    UnknownOption {
        /// The technique.
        technique: &'static str,
        /// The option asked for.
        option: String,
        /// What there is instead.
        known: String,
    },
    /// The technique cannot do this light.
    #[error("technique `{technique}` cannot do a {shape} light; it does {known}")]
    Shape {
        /// The technique.
        technique: &'static str,
        /// The light's shape.
        shape: ShapeKind,
        /// Shapes that it can do.
        known: String,
    },
}

impl Technique {
    /// All techniques.
    pub const ALL: &[Technique] = &[Technique::Hard];

    /// The name on the command line and in reports.
    pub fn name(self) -> &'static str {
        match self {
            Technique::Hard => "hard",
        }
    }

    /// One line on what it does.
    pub fn summary(self) -> &'static str {
        match self {
            Technique::Hard => {
                "one shadow map from the light's centre, compared in the receiver's plane"
            }
        }
    }

    /// Where it was published.
    pub fn paper(self) -> Option<&'static str> {
        match self {
            Technique::Hard => {
                Some("L. Williams: Casting Curved Shadows on Curved Surfaces. SIGGRAPH 1978")
            }
        }
    }

    /// Light shapes that it can do.
    pub fn shapes(self) -> &'static [ShapeKind] {
        match self {
            Technique::Hard => &ShapeKind::ALL,
        }
    }

    /// Its options.
    pub fn options(self) -> &'static [TechniqueOption] {
        match self {
            Technique::Hard => &[],
        }
    }

    /// Refuses a light that the technique cannot do.
    pub fn check(self, light: &AreaLight) -> Result<(), TechniqueError> {
        let shape = light.shape.kind();
        if self.shapes().contains(&shape) {
            return Ok(());
        }
        let names: Vec<&str> = self.shapes().iter().map(|shape| shape.name()).collect();
        Err(TechniqueError::Shape {
            technique: self.name(),
            shape,
            known: names.join(", "),
        })
    }

    /// Declares the passes that make one light's visibility.
    pub fn add_passes<'f>(self, graph: &mut Graph<'f>, inputs: &ShadowInputs<'f>) -> ShadowMask {
        match self {
            Technique::Hard => hard::add_passes(graph, inputs),
        }
    }
}

impl std::str::FromStr for Technique {
    type Err = TechniqueError;

    /// Reads `NAME[:key=value,..]`.
    fn from_str(text: &str) -> Result<Self, TechniqueError> {
        let (name, options) = text.split_once(':').unwrap_or((text, ""));
        let found = Self::ALL.iter().copied().find(|t| t.name() == name);
        let Some(technique) = found else {
            let names: Vec<&str> = Self::ALL.iter().map(|t| t.name()).collect();
            return Err(TechniqueError::Unknown {
                name: name.to_string(),
                known: names.join(", "),
            });
        };
        let known: Vec<&str> = technique.options().iter().map(|o| o.name).collect();
        for option in options.split(',').filter(|option| !option.is_empty()) {
            let key = option.split('=').next().unwrap_or(option);
            if !known.contains(&key) {
                return Err(TechniqueError::UnknownOption {
                    technique: technique.name(),
                    option: key.to_string(),
                    known: if known.is_empty() {
                        "it has none".to_string()
                    } else {
                        format!("it has {}", known.join(", "))
                    },
                });
            }
        }
        Ok(technique)
    }
}

/// What a technique is given for one light.
pub struct ShadowInputs<'f> {
    /// Name of the light, for the names of passes.
    pub light_name: String,
    /// The light, in scene space.
    pub light: AreaLight,
    /// Camera of the picture.
    pub camera: PixelCamera,
    /// The surface at each pixel.
    pub gbuffer: GBuffer,
    /// Bounds of the surfaces in each tile: [`crate::geometry::add_tile_bounds`].
    pub tile_bounds: ImageId,
    /// [`ViewParams`] of this light: a uniform buffer, and the part of it.
    pub view_params: (BufferId, BufferPart),
    /// Convex hulls of what the picture can show: all pixels' surfaces lie in one of them. Scene
    /// space, metres.
    pub receivers: Vec<Vec<DVec3>>,
    /// All triangles, which are also all casters.
    pub scene: &'f SceneBuffers,
    /// The scene's resources in this graph.
    pub ids: SceneIds,
}

/// What a technique makes for one light. All images are of the picture's size.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct ShadowMask {
    /// R32F: the part of the light that is seen, 0 to 1; 1 where nothing was hit.
    pub visibility: ImageId,
    /// RG32F, of a line: how much of the light that its visible parts give comes from its two
    /// ends, for shading. `None` shades with the visibility alone.
    pub end_influences: Option<ImageId>,
    /// R32F: a bound on the error of `visibility`; `None` where the technique proves none.
    pub error_bound: Option<ImageId>,
}

impl ShadowMask {
    /// Visibility and nothing else.
    pub fn new(visibility: ImageId) -> Self {
        Self {
            visibility,
            end_influences: None,
            error_bound: None,
        }
    }
}
