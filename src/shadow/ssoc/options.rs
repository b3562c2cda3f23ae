//! Options of `ssoc`.

use crate::shadow::TechniqueOption;
use crate::shadow::technique::{CLASSES, switch, switched};

/// How several edges join.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Combine {
    /// The light is cut into as many cells as there are lookups, and each is decided by the edge
    /// nearest to it.
    Cells,
    /// Light passes either of two edges where each lies on the other's inner side and their depths
    /// agree, as at a convex corner or a strip; else it must pass both.
    Rule,
    /// The product, as published.
    Product,
    /// The least.
    Min,
    /// It must pass both.
    And,
    /// It may pass either.
    Or,
}

const COMBINE: [(&str, Combine); 6] = [
    ("cells", Combine::Cells),
    ("rule", Combine::Rule),
    ("product", Combine::Product),
    ("min", Combine::Min),
    ("and", Combine::And),
    ("or", Combine::Or),
];

/// Options of `ssoc`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SsocOptions {
    /// Texels across and down the shadow map, 64 to 4096.
    pub resolution: u32,
    /// Texels across and down each distortion map, 64 to 4096.
    pub bands: u32,
    /// Edges that a texel of the distortion maps holds, 1 or 2; the second is read by
    /// [`Combine::Cells`] alone.
    pub layers: u32,
    /// Places of the distortion maps that a pixel looks at, 1 to 32; 6 at most but for
    /// [`Combine::Cells`].
    pub lookups: u32,
    /// How several edges join.
    pub combine: Combine,
    /// Brightness falls from the middle of the light to its rim as 1 - s^2, of a sphere as seen from
    /// the receiver, instead of being even; not with `cubic`.
    pub falloff: bool,
    /// `3 t^2 - 2 t^3` of the hidden part of the diameter, as published, instead of the light's area.
    pub cubic: bool,
    /// Tiles of the picture that see all of the light or nothing of it are told from the triangles
    /// between them and the light, and left out.
    pub classes: bool,
}

impl SsocOptions {
    /// What the technique does without options.
    pub const DEFAULT: Self = Self {
        resolution: 1024,
        bands: 1024,
        layers: 1,
        lookups: 13,
        combine: Combine::Cells,
        falloff: false,
        cubic: false,
        classes: false,
    };

    /// What can be set.
    pub(in crate::shadow) const ALL: &[TechniqueOption] = &[
        TechniqueOption::new(
            "resolution",
            "1024",
            "64 to 4096",
            "texels across and down the shadow map",
        ),
        TechniqueOption::new(
            "bands",
            "1024",
            "64 to 4096",
            "texels across and down each distortion map",
        ),
        TechniqueOption::new(
            "layers",
            "1",
            "1 or 2, which combine=cells reads",
            "edges that a texel of the distortion maps holds",
        ),
        TechniqueOption::new(
            "lookups",
            "13",
            "1 to 32, of which combine=cells uses all, else 6",
            "places of the distortion maps that a pixel looks at",
        ),
        TechniqueOption::new(
            "combine",
            "cells",
            "cells (each lookup decides a part of the light), rule (by how the edges lie), product (as published), min, and, or",
            "how several edges join",
        ),
        TechniqueOption::new(
            "area",
            "exact",
            "exact or cubic (3 t^2 - 2 t^3, as published)",
            "part of the light beyond an edge",
        ),
        TechniqueOption::new(
            "emission",
            "even",
            "even or falloff (1 - s^2 at a part s of the way from the light's middle to its rim; with area=exact)",
            "brightness of the light's parts",
        ),
        CLASSES,
    ];

    /// The values, in the order of [`ALL`](Self::ALL).
    pub(in crate::shadow) fn values(&self) -> Vec<String> {
        let combine = COMBINE.iter().find(|(_, combine)| *combine == self.combine);
        vec![
            self.resolution.to_string(),
            self.bands.to_string(),
            self.layers.to_string(),
            self.lookups.to_string(),
            combine.map_or("", |(name, _)| name).to_string(),
            if self.cubic { "cubic" } else { "exact" }.to_string(),
            if self.falloff { "falloff" } else { "even" }.to_string(),
            switched(self.classes),
        ]
    }

    /// Sets one; `None` for a value that it does not take.
    pub(in crate::shadow) fn set(&mut self, option: &str, value: &str) -> Option<()> {
        let number = |range: std::ops::RangeInclusive<u32>| {
            value.parse::<u32>().ok().filter(|n| range.contains(n))
        };
        match option {
            "resolution" => self.resolution = number(64..=4096)?,
            "bands" => self.bands = number(64..=4096)?,
            "layers" => self.layers = number(1..=2)?,
            "lookups" => self.lookups = number(1..=32)?,
            "combine" => self.combine = COMBINE.iter().find(|(name, _)| *name == value)?.1,
            "area" => {
                self.cubic = match value {
                    "exact" => false,
                    "cubic" => true,
                    _ => return None,
                }
            }
            "classes" => self.classes = switch(value)?,
            "emission" => {
                self.falloff = match value {
                    "even" => false,
                    "falloff" => true,
                    _ => return None,
                }
            }
            _ => return None,
        }
        Some(())
    }
}
