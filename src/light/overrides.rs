//! What the command line changes about lights, and how it is written there.

use std::fmt;
use std::str::FromStr;

use super::{
    AreaLight, IntensityUnit, LightError, LightProfile, LightShape, LightWeights, ShapeKind,
    check_length,
};

/// `--light-size`: `R` for a disk's or sphere's radius, `L` for a line's length, `WxH` for a
/// rectangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LightSize {
    /// A radius or a length, in metres.
    Single(f32),
    /// Width and height, in metres.
    Rect {
        /// Metres along the light's `axis_x`.
        width: f32,
        /// Metres along the light's `axis_y`.
        height: f32,
    },
}

impl FromStr for LightSize {
    type Err = LightError;

    fn from_str(text: &str) -> Result<Self, LightError> {
        let metres = |what, part: &str| {
            let value = parse_number(part).ok_or_else(|| LightError::Size {
                what,
                text: part.into(),
            })?;
            check_length(what, value).map(|()| value)
        };
        match text.split_once(['x', 'X']) {
            Some((width, height)) => Ok(Self::Rect {
                width: metres("width", width)?,
                height: metres("height", height)?,
            }),
            None => Ok(Self::Single(metres("size", text)?)),
        }
    }
}

impl fmt::Display for LightSize {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Single(size) => write!(f, "{size}"),
            Self::Rect { width, height } => write!(f, "{width}x{height}"),
        }
    }
}

/// `--light-scale`: a factor on the light's size, above 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightScale(pub f32);

impl FromStr for LightScale {
    type Err = LightError;

    fn from_str(text: &str) -> Result<Self, LightError> {
        match parse_number(text) {
            Some(factor) if (1.0e-6..=1.0e6).contains(&factor) => Ok(Self(factor)),
            _ => Err(LightError::Scale { text: text.into() }),
        }
    }
}

/// `--sun-angle`: the angular diameter of a sun, held in radians and written in degrees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SunAngle(pub f32);

impl FromStr for SunAngle {
    type Err = LightError;

    fn from_str(text: &str) -> Result<Self, LightError> {
        match text.parse::<f64>() {
            Ok(degrees) if (0.0..180.0).contains(&degrees) => Ok(Self(degrees.to_radians() as f32)),
            _ => Err(LightError::SunAngle { text: text.into() }),
        }
    }
}

/// A finite decimal number; `f32::from_str` alone would also take `nan` and `inf`.
fn parse_number(text: &str) -> Option<f32> {
    text.parse().ok().filter(|value: &f32| value.is_finite())
}

/// What the command line says about lights; it wins over the file.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LightOverrides {
    /// Replaces the shape of lights that are no sun.
    pub shape: Option<ShapeKind>,
    /// Replaces the size of lights that are no sun.
    pub size: Option<LightSize>,
    /// Multiplies the size, be it the file's or `size`; for a sun, its angle.
    pub scale: Option<LightScale>,
    /// Replaces the angle of suns.
    pub sun_angle: Option<SunAngle>,
    /// Replaces the profile of lines.
    pub profile: Option<LightProfile>,
    /// Replaces the weights of rectangles.
    pub weights: Option<LightWeights>,
}

impl LightOverrides {
    /// True if nothing is overridden.
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }

    /// The part of these overrides that concerns the kind of light that `shape` is: sun or no sun.
    #[must_use]
    pub fn for_kind_of(&self, shape: &LightShape) -> Self {
        if shape.is_sun() {
            Self {
                shape: None,
                size: None,
                profile: None,
                weights: None,
                ..*self
            }
        } else {
            Self {
                sun_angle: None,
                ..*self
            }
        }
    }

    /// `light` with these overrides. Where the shape changes, brightness is kept by way of its
    /// candela value, so a light given in nits does not vanish with its area.
    ///
    /// # Errors
    /// An override that does not fit the light: a shape that needs a size and has none, a size of
    /// the wrong form, a sun's angle for a light that is none, a size out of range.
    pub fn apply(&self, light: &AreaLight) -> Result<AreaLight, LightError> {
        let shape = self.apply_to_shape(&light.shape)?;
        shape.validate()?;
        let mut changed = AreaLight { shape, ..*light };
        if let Some(profile) = self.profile {
            if shape.kind() != ShapeKind::Line {
                return Err(LightError::ProfileShape { kind: shape.kind() });
            }
            changed.profile = profile;
        }
        if let Some(weights) = self.weights {
            if shape.kind() != ShapeKind::Rect {
                return Err(LightError::WeightsShape { kind: shape.kind() });
            }
            changed.weights = weights;
        }
        if shape.kind() != light.shape.kind() && light.unit == IntensityUnit::Nits {
            changed.intensity = light.candela();
            changed.unit = IntensityUnit::Candela;
        }
        Ok(changed)
    }

    fn apply_to_shape(&self, from: &LightShape) -> Result<LightShape, LightError> {
        let factor = self.scale.map_or(1.0, |scale| scale.0);
        if let LightShape::Sun { angular_diameter } = *from {
            if self.shape.is_some() || self.size.is_some() {
                return Err(LightError::SunHasNoShape);
            }
            let angular_diameter = self.sun_angle.map_or(angular_diameter, |angle| angle.0);
            return Ok(LightShape::Sun { angular_diameter }.scaled(factor));
        }
        if self.sun_angle.is_some() {
            return Err(LightError::NotASun { kind: from.kind() });
        }
        let kind = self.shape.unwrap_or(from.kind());
        let shape = match (kind, self.size) {
            (ShapeKind::Point, None) => LightShape::Point,
            (ShapeKind::Point, Some(_)) => return Err(LightError::PointHasNoSize),
            (ShapeKind::Disk, Some(LightSize::Single(radius))) => LightShape::Disk { radius },
            (ShapeKind::Sphere, Some(LightSize::Single(radius))) => LightShape::Sphere { radius },
            (ShapeKind::Line, Some(LightSize::Single(length))) => LightShape::Line { length },
            (ShapeKind::Rect, Some(LightSize::Rect { width, height })) => {
                LightShape::Rect { width, height }
            }
            (ShapeKind::Sun, _) => return Err(LightError::SunHasNoShape),
            (kind, Some(size)) => {
                return Err(LightError::SizeForm {
                    kind,
                    size,
                    form: size_form(kind),
                });
            }
            (kind, None) if kind == from.kind() => *from,
            (kind, None) => match (kind, *from) {
                (ShapeKind::Disk, LightShape::Sphere { radius }) => LightShape::Disk { radius },
                (ShapeKind::Sphere, LightShape::Disk { radius }) => LightShape::Sphere { radius },
                _ => {
                    return Err(LightError::NoSize {
                        kind,
                        from: from.kind(),
                        form: size_form(kind),
                    });
                }
            },
        };
        Ok(shape.scaled(factor))
    }
}

/// How `--light-size` is written for a shape.
fn size_form(kind: ShapeKind) -> &'static str {
    match kind {
        ShapeKind::Rect => "WxH (width and height in metres)",
        ShapeKind::Line => "L (length in metres)",
        _ => "R (radius in metres)",
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::light::DEFAULT_SUN_ANGLE;

    fn light(shape: LightShape) -> AreaLight {
        AreaLight::new(shape, Vec3::ZERO, Vec3::NEG_Y, Vec3::X)
    }

    #[test]
    fn parsers_take_good_and_name_bad_values() {
        assert_eq!("0.5".parse(), Ok(LightSize::Single(0.5)));
        assert_eq!(
            "2x0.5".parse(),
            Ok(LightSize::Rect {
                width: 2.0,
                height: 0.5
            })
        );
        for bad in [
            "", "x", "0", "-1", "nan", "inf", "1e10", "1e-10", "2x", "x2", "2x0", "1x2x3", "2x-1",
            "1m",
        ] {
            let error = bad.parse::<LightSize>().expect_err(bad).to_string();
            assert!(error.contains("out of range"), "{bad}: {error}");
            assert!(!error.contains('\n'));
        }
        assert_eq!("2".parse(), Ok(LightScale(2.0)));
        for bad in ["0", "-2", "nan", "1e7", "two"] {
            assert!(bad.parse::<LightScale>().is_err(), "{bad}");
        }
        assert_eq!("180".parse::<SunAngle>().ok(), None);
        assert_eq!("0".parse(), Ok(SunAngle(0.0)));
        assert_eq!("0.53".parse(), Ok(SunAngle(DEFAULT_SUN_ANGLE)));
        assert_eq!("disk".parse(), Ok(ShapeKind::Disk));
        assert!("sun".parse::<ShapeKind>().is_err());
        assert!("Disk".parse::<ShapeKind>().is_err());
    }

    #[test]
    fn overrides_win_over_the_file() -> Result<(), LightError> {
        let disk = light(LightShape::Disk { radius: 0.5 });
        let overrides = LightOverrides {
            size: Some("2".parse()?),
            scale: Some("1.5".parse()?),
            ..Default::default()
        };
        assert_eq!(
            overrides.apply(&disk)?.shape,
            LightShape::Disk { radius: 3.0 }
        );
        let as_sphere = LightOverrides {
            shape: Some(ShapeKind::Sphere),
            ..Default::default()
        };
        assert_eq!(
            as_sphere.apply(&disk)?.shape,
            LightShape::Sphere { radius: 0.5 }
        );
        let as_rect = LightOverrides {
            shape: Some(ShapeKind::Rect),
            ..Default::default()
        };
        assert!(matches!(
            as_rect.apply(&disk),
            Err(LightError::NoSize { .. })
        ));
        let as_rect = LightOverrides {
            size: Some("2x3".parse()?),
            ..as_rect
        };
        assert_eq!(
            as_rect.apply(&disk)?.shape,
            LightShape::Rect {
                width: 2.0,
                height: 3.0
            }
        );
        Ok(())
    }

    #[test]
    fn overrides_of_the_wrong_kind_are_refused() -> Result<(), LightError> {
        let sun = light(LightShape::Sun {
            angular_diameter: DEFAULT_SUN_ANGLE,
        });
        let point = light(LightShape::Point);
        let sun_angle = LightOverrides {
            sun_angle: Some("5".parse()?),
            ..Default::default()
        };
        assert!(matches!(
            sun_angle.apply(&point),
            Err(LightError::NotASun { .. })
        ));
        assert_eq!(sun_angle.for_kind_of(&point.shape).apply(&point)?, point);
        let widened = sun_angle.apply(&sun)?.shape;
        assert_eq!(
            widened,
            LightShape::Sun {
                angular_diameter: 5f32.to_radians()
            }
        );
        let size = LightOverrides {
            size: Some("5".parse()?),
            ..Default::default()
        };
        assert_eq!(size.apply(&sun), Err(LightError::SunHasNoShape));
        assert_eq!(size.apply(&point), Err(LightError::PointHasNoSize));
        let scale = LightOverrides {
            scale: Some("1e6".parse()?),
            ..Default::default()
        };
        assert!(matches!(
            scale.apply(&sun),
            Err(LightError::SunAngle { .. })
        ));
        Ok(())
    }

    #[test]
    fn brightness_survives_a_change_of_shape() -> Result<(), LightError> {
        let mut rect = light(LightShape::Rect {
            width: 2.0,
            height: 3.0,
        });
        rect.intensity = 100.0;
        rect.unit = IntensityUnit::Nits;
        let point = LightOverrides {
            shape: Some(ShapeKind::Point),
            ..Default::default()
        }
        .apply(&rect)?;
        assert_eq!(point.candela(), 600.0);
        assert_eq!(point.unit, IntensityUnit::Candela);
        Ok(())
    }
}
