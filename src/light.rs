//! Physically sized lights: disk, rectangle, sphere, line, sun, and the point they shrink to.
//!
//! Lengths are metres, angles radians, positions in the space of the scene that holds the light
//! (right-handed, +Y up). A light is not geometry: it neither blocks light nor shows in the picture.

mod above;
mod irradiance;
mod overrides;
mod profile;
mod weights;

use std::f32::consts::PI;
use std::fmt;
use std::str::FromStr;

use glam::Vec3;

pub use overrides::{LightOverrides, LightScale, LightSize, SunAngle};
pub use profile::{LightProfile, MAX_PROFILE};
pub use weights::{LightWeights, MAX_WEIGHTS};

/// Angular diameter of a sun for which the file states none, in radians (0.53 degrees).
pub const DEFAULT_SUN_ANGLE: f32 = 0.009_250_245;

/// Largest accepted length of a light, in metres. Its square is still far from the end of `f32`.
pub const MAX_LIGHT_SIZE: f32 = 1.0e9;

/// Smallest accepted length of a light, in metres. A smaller light is asked for as a point.
pub const MIN_LIGHT_SIZE: f32 = 1.0e-9;

/// The emitting surface of a light.
///
/// Rectangle, disk and line lie in the frame of their [`AreaLight`], centred on it.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[cfg_attr(feature = "serde", serde(tag = "shape", rename_all = "lowercase"))]
pub enum LightShape {
    /// No extent: a hard shadow.
    Point,
    /// A disk in the plane of `axis_x` and `axis_y`; emits to the `direction` side only.
    Disk {
        /// Metres.
        radius: f32,
    },
    /// A rectangle, `width` along `axis_x` and `height` along `axis_y`; emits to the `direction`
    /// side only.
    Rect {
        /// Metres along `axis_x`.
        width: f32,
        /// Metres along `axis_y`.
        height: f32,
    },
    /// A sphere, seen from outside.
    Sphere {
        /// Metres.
        radius: f32,
    },
    /// A segment along `axis_x` that emits all round.
    Line {
        /// Metres along `axis_x`.
        length: f32,
    },
    /// A disk at infinite distance whose light travels along `direction`.
    Sun {
        /// Radians, 0 (a hard shadow) to below pi.
        angular_diameter: f32,
    },
}

/// The kind of a [`LightShape`], without its size. The names are those of the command line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum ShapeKind {
    /// `point`
    Point,
    /// `disk`
    Disk,
    /// `rect`
    Rect,
    /// `sphere`
    Sphere,
    /// `line`
    Line,
    /// `sun`
    Sun,
}

impl ShapeKind {
    /// Every kind, in the order of the documentation.
    pub const ALL: [Self; 6] = [
        Self::Point,
        Self::Disk,
        Self::Rect,
        Self::Sphere,
        Self::Line,
        Self::Sun,
    ];

    /// The name on the command line and in reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Point => "point",
            Self::Disk => "disk",
            Self::Rect => "rect",
            Self::Sphere => "sphere",
            Self::Line => "line",
            Self::Sun => "sun",
        }
    }
}

impl fmt::Display for ShapeKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for ShapeKind {
    type Err = LightError;

    /// Reads `point`, `disk`, `rect`, `sphere` or `line`: a sun is no shape that a light can be
    /// given, because it has no position.
    fn from_str(text: &str) -> Result<Self, LightError> {
        Self::ALL
            .into_iter()
            .find(|kind| *kind != Self::Sun && kind.name() == text)
            .ok_or_else(|| LightError::UnknownShape { text: text.into() })
    }
}

impl LightShape {
    /// The kind of this shape.
    pub const fn kind(&self) -> ShapeKind {
        match self {
            Self::Point => ShapeKind::Point,
            Self::Disk { .. } => ShapeKind::Disk,
            Self::Rect { .. } => ShapeKind::Rect,
            Self::Sphere { .. } => ShapeKind::Sphere,
            Self::Line { .. } => ShapeKind::Line,
            Self::Sun { .. } => ShapeKind::Sun,
        }
    }

    /// True for the shapes that emit to one side of their plane only: disk and rectangle.
    pub const fn is_one_sided(&self) -> bool {
        matches!(self, Self::Disk { .. } | Self::Rect { .. })
    }

    /// True for the light without a position.
    pub const fn is_sun(&self) -> bool {
        matches!(self, Self::Sun { .. })
    }

    /// Area seen from the front in square metres: of the disk, the rectangle, the outline of the
    /// sphere. 0 for shapes without area (point, line) and for a sun, which has no metres.
    pub fn projected_area(&self) -> f32 {
        match *self {
            Self::Disk { radius } | Self::Sphere { radius } => PI * radius * radius,
            Self::Rect { width, height } => width * height,
            Self::Point | Self::Line { .. } | Self::Sun { .. } => 0.0,
        }
    }

    /// Radius in metres of the smallest ball about the centre that holds the shape; 0 for a point
    /// and for a sun.
    pub fn bounding_radius(&self) -> f32 {
        match *self {
            Self::Disk { radius } | Self::Sphere { radius } => radius,
            Self::Rect { width, height } => 0.5 * width.hypot(height),
            Self::Line { length } => 0.5 * length,
            Self::Point | Self::Sun { .. } => 0.0,
        }
    }

    /// Distance from the centre to the farthest point, metres; of a sun at distance 1.
    pub fn reach(&self) -> f32 {
        match *self {
            Self::Sun { angular_diameter } => (0.5 * angular_diameter).tan(),
            _ => self.bounding_radius(),
        }
    }

    /// This shape with every length (or a sun's angle) multiplied by `factor`. Not validated.
    #[must_use]
    pub fn scaled(&self, factor: f32) -> Self {
        match *self {
            Self::Point => Self::Point,
            Self::Disk { radius } => Self::Disk {
                radius: radius * factor,
            },
            Self::Rect { width, height } => Self::Rect {
                width: width * factor,
                height: height * factor,
            },
            Self::Sphere { radius } => Self::Sphere {
                radius: radius * factor,
            },
            Self::Line { length } => Self::Line {
                length: length * factor,
            },
            Self::Sun { angular_diameter } => Self::Sun {
                angular_diameter: angular_diameter * factor,
            },
        }
    }

    /// Checks the sizes: lengths in [[`MIN_LIGHT_SIZE`], [`MAX_LIGHT_SIZE`]], a sun's angle in
    /// [0, pi).
    ///
    /// # Errors
    /// [`LightError::Size`] or [`LightError::SunAngle`], naming the value.
    pub fn validate(&self) -> Result<(), LightError> {
        match *self {
            Self::Point => Ok(()),
            Self::Disk { radius } | Self::Sphere { radius } => check_length("radius", radius),
            Self::Rect { width, height } => {
                check_length("width", width)?;
                check_length("height", height)
            }
            Self::Line { length } => check_length("length", length),
            Self::Sun { angular_diameter } => {
                if (0.0..PI).contains(&angular_diameter) {
                    Ok(())
                } else {
                    Err(LightError::SunAngle {
                        text: angular_diameter.to_degrees().to_string(),
                    })
                }
            }
        }
    }
}

impl fmt::Display for LightShape {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Point => f.write_str("point"),
            Self::Disk { radius } => write!(f, "disk, radius {radius} m"),
            Self::Rect { width, height } => write!(f, "rect, {width} x {height} m"),
            Self::Sphere { radius } => write!(f, "sphere, radius {radius} m"),
            Self::Line { length } => write!(f, "line, length {length} m"),
            Self::Sun { angular_diameter } => {
                write!(f, "sun, {} degrees across", angular_diameter.to_degrees())
            }
        }
    }
}

fn check_length(what: &'static str, metres: f32) -> Result<(), LightError> {
    if (MIN_LIGHT_SIZE..=MAX_LIGHT_SIZE).contains(&metres) {
        Ok(())
    } else {
        Err(LightError::Size {
            what,
            text: metres.to_string(),
        })
    }
}

/// What [`AreaLight::intensity`] measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "lowercase"))]
pub enum IntensityUnit {
    /// Luminous intensity of the whole light, lm/sr.
    Candela,
    /// Illuminance of a surface that faces a sun, lm/m2.
    Lux,
    /// Luminance of the emitting surface, cd/m2.
    Nits,
}

/// The cone of a spot light. It shapes the shaded picture only and never visibility.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct SpotCone {
    /// Angle from the axis up to which the light is full, in radians, 0 to `outer`.
    pub inner: f32,
    /// Angle from the axis at which the light has faded to nothing, in radians, up to pi / 2.
    pub outer: f32,
}

/// A light with its place, its frame and its brightness.
///
/// `axis_x`, `axis_y` and `-direction` form a right-handed orthonormal frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AreaLight {
    /// The emitting surface.
    pub shape: LightShape,
    /// Centre in scene space, metres. Without meaning for a sun.
    pub center: Vec3,
    /// Unit vector: the width of a rectangle and the course of a line.
    pub axis_x: Vec3,
    /// Unit vector: the height of a rectangle.
    pub axis_y: Vec3,
    /// Unit vector: where the light emits to; for a sun the way its light travels.
    pub direction: Vec3,
    /// Linear RGB, each 0 or more.
    pub color: Vec3,
    /// Brightness in `unit`, 0 or more.
    pub intensity: f32,
    /// Unit of `intensity`.
    pub unit: IntensityUnit,
    /// Distance in metres beyond which the light counts as dark in the shaded picture; `None` for
    /// no limit. Visibility ignores it.
    pub range: Option<f32>,
    /// The cone of a spot light.
    pub spot: Option<SpotCone>,
    /// How brightness goes along a line; other shapes are even. Visibility counts each part of a line by
    /// it.
    pub profile: LightProfile,
    /// How brightness goes over a rectangle; other shapes are even. Visibility counts each part of a
    /// rectangle by it.
    pub weights: LightWeights,
}

impl AreaLight {
    /// A white light of one candela (one lux for a sun) at `center`, emitting along `direction`.
    ///
    /// `axis_x` sets the roll: the part of it across `direction` becomes the light's own `axis_x`.
    /// A zero or parallel `axis_x` and a zero `direction` (taken as -Z) are replaced by some fixed
    /// choice, so the frame is orthonormal for any finite input.
    pub fn new(shape: LightShape, center: Vec3, direction: Vec3, axis_x: Vec3) -> Self {
        let z = unit_or(-direction, Vec3::Z);
        let axis_x = unit_or(axis_x, Vec3::ZERO);
        let across = axis_x - z * axis_x.dot(z);
        // What is left of a parallel axis is rounding error, not a direction.
        let x = if across.length() > 1.0e-5 {
            across.normalize()
        } else {
            z.any_orthonormal_vector()
        };
        let x = (x - z * x.dot(z)).normalize();
        Self {
            shape,
            center,
            axis_x: x,
            axis_y: z.cross(x).normalize(),
            direction: -z,
            color: Vec3::ONE,
            intensity: 1.0,
            unit: if shape.is_sun() {
                IntensityUnit::Lux
            } else {
                IntensityUnit::Candela
            },
            range: None,
            spot: None,
            profile: LightProfile::EVEN,
            weights: LightWeights::EVEN,
        }
    }

    /// True if not all parts of its shape are equally bright.
    pub fn is_uneven(&self) -> bool {
        match self.shape {
            LightShape::Line { .. } => !self.profile.is_even(),
            LightShape::Rect { .. } => !self.weights.is_even(),
            _ => false,
        }
    }

    /// Luminous intensity in candela along the light's axis: `intensity` itself, or luminance
    /// times the area seen from there. A sun, which has none, answers its `intensity` in lux.
    pub fn candela(&self) -> f32 {
        match self.unit {
            IntensityUnit::Candela | IntensityUnit::Lux => self.intensity,
            IntensityUnit::Nits => self.intensity * self.shape.projected_area(),
        }
    }

    /// Checks shape, frame and brightness, so that no later step can meet a NaN.
    ///
    /// # Errors
    /// A [`LightError`] that names the first bad value.
    pub fn validate(&self) -> Result<(), LightError> {
        self.shape.validate()?;
        let unit = |v: Vec3| (v.length_squared() - 1.0).abs() < 1.0e-3;
        let frame = [self.axis_x, self.axis_y, -self.direction];
        if !frame.into_iter().all(unit)
            || frame[0].cross(frame[1]).dot(frame[2]) < 0.999
            || !self.center.is_finite()
        {
            return Err(LightError::Frame);
        }
        if !(self.color.is_finite() && self.color.min_element() >= 0.0) {
            return Err(LightError::Brightness {
                what: "color",
                text: format!("{:?}", self.color.to_array()),
            });
        }
        if !(self.intensity.is_finite() && self.intensity >= 0.0) {
            return Err(LightError::Brightness {
                what: "intensity",
                text: self.intensity.to_string(),
            });
        }
        if let Some(range) = self.range
            && !(range.is_finite() && range > 0.0)
        {
            return Err(LightError::Range {
                text: range.to_string(),
            });
        }
        if let Some(SpotCone { inner, outer }) = self.spot
            && !(0.0 <= inner && inner <= outer && outer > 0.0 && outer <= PI / 2.0 + 1.0e-5)
        {
            return Err(LightError::Cone {
                text: format!("{inner} to {outer}"),
            });
        }
        Ok(())
    }
}

/// `v` normalised, or `fallback` where `v` has no direction. Scales first: the square of a short or
/// long vector leaves the range of `f32`.
fn unit_or(v: Vec3, fallback: Vec3) -> Vec3 {
    let largest = v.abs().max_element();
    if largest > 0.0 && largest.is_finite() {
        (v / largest).normalize()
    } else {
        fallback
    }
}

/// A light, or an override of one, that cannot be.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LightError {
    /// A shape that `--light-shape` does not know.
    #[error("`{text}` is no light shape; use point, disk, rect, sphere or line")]
    UnknownShape {
        /// What was given.
        text: String,
    },
    /// A length out of range, or no number.
    #[error(
        "light {what} `{text}` is out of range; give metres from 1e-9 to 1e9, or use the shape \
         `point` for a light without size"
    )]
    Size {
        /// Which length.
        what: &'static str,
        /// What was given.
        text: String,
    },
    /// A scale out of range, or no number.
    #[error("light scale `{text}` is out of range; give a factor from 1e-6 to 1e6")]
    Scale {
        /// What was given.
        text: String,
    },
    /// A sun's angle out of range, or no number.
    #[error("sun angle `{text}` is out of range; give degrees from 0 to below 180")]
    SunAngle {
        /// What was given.
        text: String,
    },
    /// A size of the wrong form for the shape.
    #[error("light size `{size}` does not fit the shape {kind}; it takes {form}")]
    SizeForm {
        /// The shape.
        kind: ShapeKind,
        /// What was given.
        size: LightSize,
        /// What the shape takes.
        form: &'static str,
    },
    /// A shape whose size neither the file nor the command line gives.
    #[error("a {from} light made a {kind} has no size; add --light-size {form}")]
    NoSize {
        /// The shape asked for.
        kind: ShapeKind,
        /// The shape in the file.
        from: ShapeKind,
        /// What to give.
        form: &'static str,
    },
    /// A size for a point.
    #[error("a point light has no size; add --light-shape disk, rect, sphere or line")]
    PointHasNoSize,
    /// A shape or a size for a sun.
    #[error("a sun takes neither --light-shape nor --light-size; use --sun-angle")]
    SunHasNoShape,
    /// A sun's angle for a light that is none.
    #[error("--sun-angle needs a directional light, and this one is a {kind}")]
    NotASun {
        /// The light's shape.
        kind: ShapeKind,
    },
    /// Colour or intensity negative or not finite.
    #[error("light {what} {text} is not finite and 0 or more")]
    Brightness {
        /// Which value.
        what: &'static str,
        /// The value.
        text: String,
    },
    /// A range that is not above 0.
    #[error("light range {text} is not a finite number above 0; leave it out for no limit")]
    Range {
        /// The value.
        text: String,
    },
    /// A spot cone whose angles are out of order.
    #[error("spot cone {text} is not 0 <= inner <= outer <= pi / 2 radians, with outer above 0")]
    Cone {
        /// The value.
        text: String,
    },
    /// A profile that is none.
    #[error(
        "light profile `{text}` is none; give 2 to 8 numbers of 0 or more, not all 0, from the line's \
         start (-x) to its end: `0.5,1`"
    )]
    Profile {
        /// What was given.
        text: String,
    },
    /// A profile for a light that is no line.
    #[error("--light-profile needs a line, and this light is a {kind}")]
    ProfileShape {
        /// The light's shape.
        kind: ShapeKind,
    },
    /// Weights for a light that is no rectangle.
    #[error("--light-weights needs a rect, and this light is a {kind}")]
    WeightsShape {
        /// The light's shape.
        kind: ShapeKind,
    },
    /// A frame that is not orthonormal or a centre that is not finite.
    #[error(
        "light frame is not finite, right-handed and orthonormal; build it with AreaLight::new"
    )]
    Frame,
}

#[cfg(test)]
mod tests;
