//! The techniques by name, with their options.
//!
//! A new technique adds its module, one variant here with its arms, and its folder of shaders.

use super::auto::{self, AutoOptions, Case, Table};
use super::dbuffer::{self, DbufferOptions};
use super::mdi::{self, MdiOptions};
use super::occlusion_textures::{self, OcclusionOptions};
use super::oess::{self, OessOptions, Outreach};
use super::pcss::PcssOptions;
use super::shaft_masks::{self, ShaftOptions};
use super::ssoc::{self, SsocOptions};
use super::unblocked::{add_unblocked, why_unblocked};
use super::{ShadowInputs, ShadowMask, hard, pcss};
use crate::graph::Graph;
use crate::light::{AreaLight, LightShape, ShapeKind};
use std::collections::BTreeMap;

/// How visibility is found.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Technique {
    /// One shadow map from the light's centre: no penumbra.
    Hard,
    /// A filter of fixed size over a shadow map.
    Pcf(PcssOptions),
    /// A filter over a shadow map as wide as the light looks through the blockers' mean depth.
    Pcss(PcssOptions),
    /// Slices of the scene as textures, averaged over what the light covers of them.
    OcclusionTextures(OcclusionOptions),
    /// Rays through a multi-layer depth image.
    Mdi(MdiOptions),
    /// Edges that divide a line light into a part that is seen and one that is not.
    Oess(OessOptions),
    /// Silhouette edges near a surface's place in the light's image, which hide a part of the light.
    Ssoc(SsocOptions),
    /// Silhouette edges of the whole light, each hiding what is beyond it.
    Dbuffer(DbufferOptions),
    /// Masks of light samples, from lists of the triangles between each tile and the light.
    ShaftMasks(ShaftOptions),
    /// One of the others for each light, by measured times and errors.
    Auto(AutoOptions),
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

impl TechniqueOption {
    pub(super) const fn new(
        name: &'static str,
        default: &'static str,
        values: &'static str,
        what: &'static str,
    ) -> Self {
        Self {
            name,
            default,
            values,
            what,
        }
    }
}

/// The value of an option that is on or off; `None` for another text.
pub(super) fn switch(value: &str) -> Option<bool> {
    match value {
        "on" => Some(true),
        "off" => Some(false),
        _ => None,
    }
}

/// As [`switch`] reads it.
pub(super) fn switched(value: bool) -> String {
    if value { "on" } else { "off" }.to_string()
}

/// The option that leaves tiles out which are told to see all of the light or nothing of it.
pub(super) const CLASSES: TechniqueOption = TechniqueOption::new(
    "classes",
    "off",
    "off or on (by the triangles between a tile and the light, as `shaft-masks` does)",
    "whether tiles that see all of the light or nothing of it are left out",
);

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
    /// A value that the option does not take.
    #[error("technique `{technique}`: option `{option}` is `{value}`; it takes {values}")]
    Value {
        /// The technique.
        technique: &'static str,
        /// The option.
        option: &'static str,
        /// The value given.
        value: String,
        /// Values it takes.
        values: &'static str,
    },
    /// The technique takes all parts of a line for equally bright.
    #[error(
        "technique `{technique}` cannot do a light profile; `oess` and `mdi` do, and `hard` needs none"
    )]
    Profile {
        /// The technique.
        technique: &'static str,
    },
    /// The technique takes all parts of a rectangle for equally bright.
    #[error("technique `{technique}` cannot do light weights; `mdi` does, and `hard` needs none")]
    Weights {
        /// The technique.
        technique: &'static str,
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

const TAPS: TechniqueOption = TechniqueOption {
    name: "taps",
    default: "32",
    values: "1 to 256",
    what: "texels of the map that a pixel's filter looks at",
};
const SEARCH: TechniqueOption = TechniqueOption {
    name: "search",
    default: "16",
    values: "1 to 256",
    what: "texels of the map that the search for blockers looks at",
};
const RADIUS: TechniqueOption = TechniqueOption {
    name: "radius",
    default: "2.5",
    values: "0 to 64",
    what: "radius of the filter in texels",
};
const PATTERN: TechniqueOption = TechniqueOption {
    name: "pattern",
    default: "noise",
    values: "noise (turned from pixel to pixel by interleaved gradient noise) or fixed",
    what: "how taps lie from pixel to pixel",
};

impl Technique {
    /// All techniques, with default options.
    pub const ALL: &[Self] = &[
        Self::Hard,
        Self::Pcf(PcssOptions {
            search: 0,
            ..PcssOptions::DEFAULT
        }),
        Self::Pcss(PcssOptions::DEFAULT),
        Self::OcclusionTextures(OcclusionOptions::DEFAULT),
        Self::Mdi(MdiOptions::DEFAULT),
        Self::Oess(OessOptions::DEFAULT),
        Self::Ssoc(SsocOptions::DEFAULT),
        Self::Dbuffer(DbufferOptions::DEFAULT),
        Self::ShaftMasks(ShaftOptions::DEFAULT),
        Self::Auto(AutoOptions::DEFAULT),
    ];

    /// The name on the command line and in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Hard => "hard",
            Self::Pcf(_) => "pcf",
            Self::Pcss(_) => "pcss",
            Self::OcclusionTextures(_) => occlusion_textures::NAME,
            Self::Mdi(_) => mdi::NAME,
            Self::Oess(_) => oess::NAME,
            Self::Ssoc(_) => ssoc::NAME,
            Self::Dbuffer(_) => dbuffer::NAME,
            Self::ShaftMasks(_) => shaft_masks::NAME,
            Self::Auto(_) => auto::NAME,
        }
    }

    /// One line on what it does.
    pub fn summary(self) -> &'static str {
        match self {
            Self::Hard => "a shadow map from the light's centre, decided by the triangles it saw",
            Self::Pcf(_) => "a shadow map, filtered over an area of fixed size",
            Self::Pcss(_) => {
                "a shadow map, filtered over what the light covers at the blockers' mean distance"
            }
            Self::OcclusionTextures(_) => {
                "slices of the scene, each averaged over what the light covers of it"
            }
            Self::Mdi(_) => {
                "all surfaces at each texel of a view, in depth buckets, crossed by rays"
            }
            Self::Ssoc(_) => {
                "silhouette edges near a surface's place in the light's image, each hiding a part of it"
            }
            Self::Oess(_) => {
                "edges seen from both ends of a line light, which hide a part of it from each surface"
            }
            Self::Dbuffer(_) => {
                "silhouette edges of the whole light, each hiding what is beyond it from each surface"
            }
            Self::ShaftMasks(_) => {
                "light samples that the triangles between each tile and the light hide, exactly"
            }
            Self::Auto(_) => {
                "for each light the technique that is expected to be fastest within an error"
            }
        }
    }

    /// Where it was published.
    pub fn paper(self) -> Option<&'static str> {
        Some(match self {
            Self::Hard => "L. Williams: Casting Curved Shadows on Curved Surfaces. SIGGRAPH 1978",
            Self::Pcf(_) => {
                "W. Reeves, D. Salesin, R. Cook: Rendering Antialiased Shadows with Depth Maps. \
                 SIGGRAPH 1987"
            }
            Self::Pcss(_) => "R. Fernando: Percentage-Closer Soft Shadows. SIGGRAPH 2005 Sketches",
            Self::OcclusionTextures(_) => {
                "E. Eisemann, X. Decoret: Plausible Image Based Soft Shadows Using Occlusion \
                 Textures. SIBGRAPI 2006"
            }
            Self::Mdi(_) => {
                "B. Keating, N. Max: Shadow Penumbras for Complex Objects by Depth-Dependent \
                 Filtering of Multi-Layer Depth Images. Eurographics Workshop on Rendering 1999"
            }
            Self::Ssoc(_) => {
                "Q. Mo, V. Popescu, C. Wyman: The Soft Shadow Occlusion Camera. Pacific Graphics 2007"
            }
            Self::Oess(_) => "C. L. Reimann, B. Dreier: Occluding Edges Soft Shadows",
            Self::Dbuffer(_) => {
                "B. Jakobsen, N. J. Christensen, B. D. Larsen, K. S. Petersen: Boundary Correct \
                 Real-Time Soft Shadows. Computer Graphics International 2004"
            }
            Self::ShaftMasks(_) | Self::Auto(_) => return None,
        })
    }

    /// Light shapes that it can do.
    pub fn shapes(self) -> &'static [ShapeKind] {
        match self {
            Self::Hard
            | Self::Pcf(_)
            | Self::Pcss(_)
            | Self::Mdi(_)
            | Self::ShaftMasks(_)
            | Self::Auto(_) => &ShapeKind::ALL,
            Self::OcclusionTextures(_) => occlusion_textures::SHAPES,
            Self::Oess(_) => oess::SHAPES,
            Self::Ssoc(_) => ssoc::SHAPES,
            Self::Dbuffer(_) => dbuffer::SHAPES,
        }
    }

    /// Its options.
    pub fn options(self) -> &'static [TechniqueOption] {
        match self {
            Self::Hard => &[],
            Self::Pcf(_) => &[TAPS, RADIUS, PATTERN],
            Self::Pcss(_) => &[TAPS, SEARCH, PATTERN],
            Self::OcclusionTextures(_) => OcclusionOptions::ALL,
            Self::Mdi(_) => MdiOptions::ALL,
            Self::Oess(_) => OessOptions::ALL,
            Self::Ssoc(_) => SsocOptions::ALL,
            Self::Dbuffer(_) => DbufferOptions::ALL,
            Self::ShaftMasks(_) => ShaftOptions::ALL,
            Self::Auto(_) => AutoOptions::ALL,
        }
    }

    /// The values of its options, in the order of [`options`](Self::options).
    pub fn option_values(self) -> Vec<(&'static str, String)> {
        let pattern = |o: &PcssOptions| if o.rotated { "noise" } else { "fixed" }.to_string();
        let values = match &self {
            Self::Hard => Vec::new(),
            Self::Pcf(o) => vec![o.taps.to_string(), o.radius.to_string(), pattern(o)],
            Self::Pcss(o) => vec![o.taps.to_string(), o.search.to_string(), pattern(o)],
            Self::OcclusionTextures(o) => o.values(),
            Self::Mdi(o) => o.values(),
            Self::Oess(o) => o.values(),
            Self::Ssoc(o) => o.values(),
            Self::Dbuffer(o) => o.values(),
            Self::ShaftMasks(o) => o.values(),
            Self::Auto(o) => o.values(),
        };
        let names = self.options().iter().map(|option| option.name);
        names.zip(values).collect()
    }

    /// The same with an option set.
    ///
    /// # Errors
    /// [`TechniqueError::UnknownOption`], which names those that it has, or [`TechniqueError::Value`].
    pub fn with_option(mut self, option: &str, value: &str) -> Result<Self, TechniqueError> {
        let known = self.options();
        let Some(known_option) = known.iter().find(|known| known.name == option) else {
            let names: Vec<&str> = known.iter().map(|option| option.name).collect();
            return Err(TechniqueError::UnknownOption {
                technique: self.name(),
                option: option.to_string(),
                known: if names.is_empty() {
                    "it has none".to_string()
                } else {
                    format!("it has {}", names.join(", "))
                },
            });
        };
        if self.set(option, value).is_none() {
            return Err(TechniqueError::Value {
                technique: self.name(),
                option: known_option.name,
                value: value.to_string(),
                values: known_option.values,
            });
        }
        Ok(self)
    }

    /// Sets an option that it has; `None` for a value that the option does not take.
    fn set(&mut self, option: &str, value: &str) -> Option<()> {
        let count = || value.parse::<u32>().ok().filter(|n| (1..=256).contains(n));
        match (self, option) {
            (Self::OcclusionTextures(o), _) => o.set(option, value)?,
            (Self::Mdi(o), _) => o.set(option, value)?,
            (Self::Oess(o), _) => o.set(option, value)?,
            (Self::Ssoc(o), _) => o.set(option, value)?,
            (Self::Dbuffer(o), _) => o.set(option, value)?,
            (Self::ShaftMasks(o), _) => o.set(option, value)?,
            (Self::Auto(o), _) => o.set(option, value)?,
            (Self::Pcf(o) | Self::Pcss(o), "taps") => o.taps = count()?,
            (Self::Pcss(o), "search") => o.search = count()?,
            (Self::Pcf(o), "radius") => {
                let radius = value.parse::<f32>().ok();
                o.radius = radius.filter(|r| (0.0..=64.0).contains(r))?;
            }
            (Self::Pcf(o) | Self::Pcss(o), "pattern") => {
                o.rotated = match value {
                    "noise" => true,
                    "fixed" => false,
                    _ => return None,
                }
            }
            _ => return None,
        }
        Some(())
    }

    /// Whether it does lights of that shape with bright and dark parts.
    pub(super) fn does_uneven(self, shape: ShapeKind) -> bool {
        match self {
            Self::Hard | Self::Mdi(_) | Self::Auto(_) => true,
            Self::Oess(_) => shape == ShapeKind::Line,
            _ => false,
        }
    }

    /// Refuses a light that the technique cannot do.
    ///
    /// # Errors
    /// [`TechniqueError::Shape`], which names the shapes that it can do,
    /// [`TechniqueError::Profile`] or [`TechniqueError::Weights`].
    pub fn check(self, light: &AreaLight) -> Result<(), TechniqueError> {
        let shape = light.shape.kind();
        let technique = self.name();
        if light.is_uneven() && !self.does_uneven(shape) {
            return Err(match shape {
                ShapeKind::Line => TechniqueError::Profile { technique },
                _ => TechniqueError::Weights { technique },
            });
        }
        if self.shapes().contains(&shape) {
            return Ok(());
        }
        let names: Vec<&str> = self.shapes().iter().map(|shape| shape.name()).collect();
        Err(TechniqueError::Shape {
            technique,
            shape,
            known: names.join(", "),
        })
    }

    /// Whether it reads, or may read, the scene's edges
    /// ([`SceneBuffers::add_edges`](crate::renderer::SceneBuffers::add_edges)).
    pub fn reads_edges(self) -> bool {
        match self {
            Self::Ssoc(_) | Self::Dbuffer(_) | Self::Auto(_) => true,
            Self::Oess(options) => options.outreach == Outreach::Silhouettes,
            _ => false,
        }
    }

    /// Whether it reads edges for lights of one shape, in a scene where triangles have holes or none has.
    pub(crate) fn reads_edges_of(self, shape: ShapeKind, has_masks: bool) -> bool {
        let needs = match self {
            // A point has no penumbra.
            Self::Ssoc(_) => shape != ShapeKind::Point,
            // Beside triangles with holes edges come from maps.
            Self::Oess(_) => !has_masks,
            _ => true,
        };
        needs && self.reads_edges()
    }

    /// What a light's counters ([`CapturedLight::counters`](crate::capture::CapturedLight::counters)) say
    /// about how far the result is to be trusted, if anything.
    pub fn remark(self, counters: &BTreeMap<String, u64>) -> Option<String> {
        match self {
            Self::Ssoc(_) => ssoc::remark(counters),
            _ => None,
        }
    }

    /// The shape that a light counts as where nothing can block it, if then the technique needs none of
    /// its passes: what is left is the receivers' own horizon.
    fn unblocked_shape(self, light: &AreaLight) -> Option<LightShape> {
        match self {
            Self::Hard => Some(LightShape::Point),
            Self::Pcf(_) | Self::Pcss(_) | Self::OcclusionTextures(_) => Some(light.shape),
            // What of an uneven light is above a horizon takes more than the pass of horizons knows.
            Self::Mdi(_) | Self::Oess(_) => (!light.is_uneven()).then_some(light.shape),
            Self::Ssoc(options) => (!options.falloff).then_some(light.shape),
            Self::Dbuffer(options) => options.unblocked_shape(light),
            // What a bound that is asked for comes to, its counters say.
            Self::ShaftMasks(options) => options.bound.is_none().then_some(light.shape),
            // The technique that is chosen says.
            Self::Auto(_) => None,
        }
    }

    /// Whether its options ask for a bound on the error that it may fail to reach.
    pub fn has_limit(self) -> bool {
        matches!(self, Self::ShaftMasks(options) if options.bound.is_some())
    }

    /// Of a technique [with a limit](Self::has_limit) what a light's counters
    /// ([`CapturedLight::counters`](crate::capture::CapturedLight::counters)) say about a bound that was not
    /// reached: the one asked for and the largest one of any pixel, 0 to 1.
    pub fn missed_bound(self, counters: &BTreeMap<String, u64>) -> Option<[f32; 2]> {
        let Self::ShaftMasks(options) = self else {
            return None;
        };
        shaft_masks::missed_bound(&options, counters)
    }

    /// Declares the passes that make one light's visibility.
    pub fn add_passes<'f>(self, graph: &mut Graph<'f>, inputs: &ShadowInputs<'f>) -> ShadowMask {
        if let Some(shape) = self.unblocked_shape(&inputs.light)
            && let Some(reason) = why_unblocked(inputs)
        {
            let mask = add_unblocked(graph, inputs, self.name(), shape, reason);
            // Where somebody reads a bound, that of the masks, which are off by more than the horizons.
            let error_bound = match self {
                Self::ShaftMasks(options) => {
                    let options = ShaftOptions {
                        target_error: None,
                        ..options
                    };
                    shaft_masks::add_passes(graph, inputs, options).error_bound
                }
                _ => None,
            };
            return ShadowMask {
                error_bound,
                ..mask
            };
        }
        match self {
            Self::Hard => hard::add_passes(graph, inputs),
            Self::OcclusionTextures(options) => {
                occlusion_textures::add_passes(graph, inputs, options)
            }
            Self::Mdi(options) => mdi::add_passes(graph, inputs, options),
            Self::Oess(options) => oess::add_passes(graph, inputs, options),
            Self::Ssoc(options) => ssoc::add_passes(graph, inputs, options),
            Self::Dbuffer(options) => dbuffer::add_passes(graph, inputs, options),
            Self::ShaftMasks(options) => shaft_masks::add_passes(graph, inputs, options),
            Self::Auto(options) => {
                let size = inputs.camera.size();
                let case = Case::new(&inputs.light, &inputs.casters, inputs.scene, size);
                let choice = auto::choose(Table::reference(), &[case], &options).remove(0);
                choice.technique.add_passes(graph, inputs)
            }
            Self::Pcf(options) | Self::Pcss(options) => {
                pcss::add_passes(graph, inputs, self.name(), options)
            }
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
        let options = options.split(',').filter(|option| !option.is_empty());
        options
            .map(|option| option.split_once('=').unwrap_or((option, "")))
            .try_fold(technique, |technique, (key, value)| {
                technique.with_option(key, value)
            })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_name_techniques_and_options() {
        let parsed = "pcss:taps=64,pattern=fixed".parse::<Technique>();
        let Ok(Technique::Pcss(options)) = parsed else {
            panic!("{parsed:?}");
        };
        assert_eq!(
            (options.taps, options.search, options.rotated),
            (64, 16, false)
        );
        for (text, wanted) in [
            ("soft", "unknown technique `soft`; there is hard, pcf, pcss"),
            ("hard:taps=1", "`hard` has no option `taps`; it has none"),
            ("pcf:search=1", "it has taps, radius, pattern"),
            ("pcss:taps=0", "option `taps` is `0`; it takes 1 to 256"),
            ("pcss:taps", "option `taps` is ``"),
            ("pcf:radius=nan", "it takes 0 to 64"),
        ] {
            match text.parse::<Technique>() {
                Ok(technique) => panic!("{text}: {technique:?}"),
                Err(error) => assert!(error.to_string().contains(wanted), "{error}"),
            }
        }
    }

    #[test]
    fn defaults_are_what_options_say() {
        for &technique in Technique::ALL {
            let values = technique.option_values();
            assert_eq!(values.len(), technique.options().len());
            for (option, (name, value)) in technique.options().iter().zip(values) {
                assert_eq!((option.name, option.default), (name, value.as_str()));
                let text = format!("{}:{name}={value}", technique.name());
                assert_eq!(text.parse(), Ok(technique));
            }
        }
    }
}
