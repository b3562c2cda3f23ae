//! Options of `oess`.

use crate::shadow::TechniqueOption;

/// Options of `oess`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OessOptions {
    /// Texels across and down each end's map, 64 to 4096.
    pub resolution: u32,
    /// Segments that the line is cut into, 1 to 4; they share the maps of their ends.
    pub segments: u32,
    /// Edges lie where triangles end in the receiver's plane, not between texels.
    pub exact: bool,
    /// Light may come between the blockers nearest to both ends, where both ends are seen.
    pub gaps: bool,
    /// Steps from the stored surface's edge towards the receiver's own, 0 to 16.
    pub walk: u32,
}

impl OessOptions {
    /// What the technique does without options.
    pub const DEFAULT: Self = Self {
        resolution: 1024,
        segments: 1,
        exact: true,
        gaps: true,
        walk: 2,
    };

    /// What can be set.
    pub(in crate::shadow) const ALL: &[TechniqueOption] = &[
        option(
            "resolution",
            "1024",
            "64 to 4096",
            "texels across and down an end's map",
        ),
        option(
            "segments",
            "1",
            "1 to 4",
            "segments of the line, which share the maps of their ends",
        ),
        option(
            "edges",
            "exact",
            "exact (of triangles, in the receiver's plane) or texels",
            "where occluding edges lie",
        ),
        option(
            "gaps",
            "1",
            "0 or 1",
            "whether light comes between the blockers nearest to two ends that are seen",
        ),
        option(
            "walk",
            "2",
            "0 to 16",
            "steps from the stored surface's occluding edge to the receiver's",
        ),
    ];

    /// The values, in the order of [`ALL`](Self::ALL).
    pub(in crate::shadow) fn values(&self) -> Vec<String> {
        vec![
            self.resolution.to_string(),
            self.segments.to_string(),
            if self.exact { "exact" } else { "texels" }.to_string(),
            u32::from(self.gaps).to_string(),
            self.walk.to_string(),
        ]
    }

    /// Sets one; `None` for a value that it does not take.
    pub(in crate::shadow) fn set(&mut self, option: &str, value: &str) -> Option<()> {
        let number = |range: std::ops::RangeInclusive<u32>| {
            value.parse::<u32>().ok().filter(|n| range.contains(n))
        };
        match option {
            "resolution" => self.resolution = number(64..=4096)?,
            "segments" => self.segments = number(1..=4)?,
            "edges" => {
                self.exact = match value {
                    "exact" => true,
                    "texels" => false,
                    _ => return None,
                }
            }
            "gaps" => self.gaps = number(0..=1)? == 1,
            "walk" => self.walk = number(0..=16)?,
            _ => return None,
        }
        Some(())
    }
}

const fn option(
    name: &'static str,
    default: &'static str,
    values: &'static str,
    what: &'static str,
) -> TechniqueOption {
    TechniqueOption {
        name,
        default,
        values,
        what,
    }
}
