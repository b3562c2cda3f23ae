//! Options of `mdi`.

use crate::shadow::TechniqueOption;
use crate::shadow::technique::{CLASSES, switch, switched};

/// How buckets lie in the casters' depth range.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Buckets {
    /// Evenly: as published.
    Uniform,
    /// Evenly in 1 / depth; of a sun as [`Buckets::Uniform`].
    Reciprocal,
}

/// Where a pixel's rays begin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Footprint {
    /// All at its centre's surface, as the ray-traced truth has it.
    Point,
    /// Over the part of the surface that it shows, each place mapped to one of the light: as
    /// published, antialiased.
    Pixel,
}

/// Options of `mdi`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MdiOptions {
    /// Texels across and down each view's image, 64 to 2048, a power of two; `None` follows the
    /// picture.
    pub resolution: Option<u32>,
    /// Depth buckets: 32, 64 or 128.
    pub buckets: u32,
    /// How they lie.
    pub spacing: Buckets,
    /// A surface blocks rays at the boundary nearest to it, not at both ends of its bucket.
    pub nearest: bool,
    /// Rays a pixel, 4 to 256.
    pub rays: u32,
    /// Places on the light are random, other ones for each pixel, rather than the same fan.
    pub random: bool,
    /// Where rays begin.
    pub footprint: Footprint,
    /// Rays look up texels up to half a texel aside, each otherwise: the steps of slanted edges
    /// average out.
    pub dithered: bool,
    /// Depths that the lists have room for, per texel of all views on average, 1 to 64.
    pub depths: u32,
    /// A ray is tested at a boundary in the texels half a bucket before and behind it too: the sides of
    /// the buckets, without which it may slip between a surface's marks.
    pub sides: bool,
    /// What no ray of a pixel is blocked at is found for all of them at once, before any is traced:
    /// the picture is the same without.
    pub early: bool,
    /// Tiles of the picture that see all of the light or nothing of it are told from the triangles
    /// between them and the light, and no ray of theirs is traced.
    pub classes: bool,
}

/// Texels across a usual penumbra below which finer ones are worth their time.
const FEW_TEXELS: f64 = 6.0;

impl MdiOptions {
    /// What the technique does without options.
    pub const DEFAULT: Self = Self {
        resolution: None,
        buckets: 64,
        spacing: Buckets::Reciprocal,
        nearest: true,
        rays: 64,
        random: false,
        footprint: Footprint::Point,
        dithered: true,
        depths: 4,
        sides: false,
        early: true,
        classes: false,
    };

    /// What can be set.
    pub(in crate::shadow) const ALL: &[TechniqueOption] = &[
        TechniqueOption::new(
            "resolution",
            "auto",
            "64 to 2048, a power of two, or auto (4 times the picture's longer side, 512 to 1024, twice that for a narrow light in one view)",
            "texels across and down each view's image",
        ),
        TechniqueOption::new("buckets", "64", "32, 64 or 128", "depth buckets"),
        TechniqueOption::new(
            "spacing",
            "reciprocal",
            "uniform or reciprocal (uniform in 1 / depth, but not thinner than a part of the thickest)",
            "how buckets lie in the casters' depth range",
        ),
        TechniqueOption::new(
            "marks",
            "nearest",
            "nearest or both",
            "ends of a bucket where its surfaces block rays",
        ),
        TechniqueOption::new("rays", "64", "4 to 256", "rays a pixel"),
        TechniqueOption::new(
            "pattern",
            "fan",
            "fan or random (other places for each pixel)",
            "places on the light that rays go to",
        ),
        TechniqueOption::new(
            "footprint",
            "point",
            "point or pixel (over what the pixel shows, antialiased)",
            "places of the surface that rays begin at",
        ),
        TechniqueOption::new(
            "lookup",
            "dithered",
            "dithered (up to half a texel aside, other for each ray) or nearest",
            "texels that rays look up",
        ),
        TechniqueOption::new(
            "depths",
            "4",
            "1 to 64",
            "depths that lists have room for, per texel on average",
        ),
        TechniqueOption::new(
            "sides",
            "off",
            "off or on (half a bucket before and behind each boundary too, against leaks)",
            "whether rays are tested at the sides of buckets",
        ),
        TechniqueOption::new(
            "early",
            "on",
            "on or off",
            "whether boundaries that block no ray of a pixel are ruled out before any is traced",
        ),
        CLASSES,
    ];

    /// The values, in the order of [`ALL`](Self::ALL).
    pub(in crate::shadow) fn values(&self) -> Vec<String> {
        let spacing = match self.spacing {
            Buckets::Uniform => "uniform",
            Buckets::Reciprocal => "reciprocal",
        };
        vec![
            self.resolution
                .map_or("auto".to_string(), |texels| texels.to_string()),
            self.buckets.to_string(),
            spacing.to_string(),
            if self.nearest { "nearest" } else { "both" }.to_string(),
            self.rays.to_string(),
            if self.random { "random" } else { "fan" }.to_string(),
            match self.footprint {
                Footprint::Point => "point",
                Footprint::Pixel => "pixel",
            }
            .to_string(),
            if self.dithered { "dithered" } else { "nearest" }.to_string(),
            self.depths.to_string(),
            switched(self.sides),
            switched(self.early),
            switched(self.classes),
        ]
    }

    /// Sets one; `None` for a value that it does not take.
    pub(in crate::shadow) fn set(&mut self, option: &str, value: &str) -> Option<()> {
        let number = |range: std::ops::RangeInclusive<u32>| {
            value.parse::<u32>().ok().filter(|n| range.contains(n))
        };
        match option {
            "resolution" if value == "auto" => self.resolution = None,
            "resolution" => {
                self.resolution = Some(number(64..=2048).filter(|n| n.is_power_of_two())?);
            }
            "buckets" => self.buckets = number(32..=128).filter(|n| n.is_power_of_two())?,
            "spacing" => {
                self.spacing = match value {
                    "uniform" => Buckets::Uniform,
                    "reciprocal" => Buckets::Reciprocal,
                    _ => return None,
                }
            }
            "marks" => {
                self.nearest = match value {
                    "nearest" => true,
                    "both" => false,
                    _ => return None,
                }
            }
            "rays" => self.rays = number(4..=256)?,
            "pattern" => {
                self.random = match value {
                    "fan" => false,
                    "random" => true,
                    _ => return None,
                }
            }
            "lookup" => {
                self.dithered = match value {
                    "dithered" => true,
                    "nearest" => false,
                    _ => return None,
                }
            }
            "footprint" => {
                self.footprint = match value {
                    "point" => Footprint::Point,
                    "pixel" => Footprint::Pixel,
                    _ => return None,
                }
            }
            "depths" => self.depths = number(1..=64)?,
            "sides" => self.sides = switch(value)?,
            "early" => self.early = switch(value)?,
            "classes" => self.classes = switch(value)?,
            _ => return None,
        }
        Some(())
    }

    /// Texels across and down the image of each of some views, for a picture of a size. `across`: the
    /// width of a usual penumbra as a part of the view's.
    pub(super) fn side(&self, [width, height]: [u32; 2], views: u32, across: f64) -> u32 {
        let picture = width.max(height).saturating_mul(4).next_power_of_two();
        let side = picture.clamp(512, 1024);
        let fitted = match views {
            0 | 1 if across * f64::from(side) < FEW_TEXELS => 2 * side,
            _ => side,
        };
        self.resolution.unwrap_or(fitted)
    }

    /// Words of a texel's mask.
    pub(super) fn words(&self) -> u32 {
        self.buckets / 32
    }
}
