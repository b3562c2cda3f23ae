//! Options of `oess`.

use crate::shadow::TechniqueOption;

/// Most segments of a line.
pub const MOST_SEGMENTS: u32 = 8;

/// How the occluding edges that hide light from a texel are found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outreach {
    /// By the tile: silhouettes of the mesh that are between its surfaces and the line. Scenes whose triangles
    /// have holes take `Hull`.
    Silhouettes,
    /// By tangents to the hull of the texel's row: the edge itself, whatever its place.
    Hull,
    /// By a scan for two candidates among the edges that [`Find`] finds.
    Scan,
    /// As `Scan`, but by looking at all of the row from each texel: to check the scan by.
    Search,
    /// As published: each edge is written to all texels of its penumbra.
    Scatter,
}

/// Which texels are occluding edges; used by none of the first two [`Outreach`]es.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Find {
    /// Those whose corresponding pixel lies before that of the texel before.
    Fold,
    /// Strategy 2 of the paper: the least corresponding pixel of three.
    Location,
    /// Strategy 1 of the paper: facing the other end, after one that does not.
    Tilt,
    /// Both strategies.
    Both,
}

const OUTREACHES: [(&str, Outreach); 5] = [
    ("silhouettes", Outreach::Silhouettes),
    ("hull", Outreach::Hull),
    ("scan", Outreach::Scan),
    ("search", Outreach::Search),
    ("scatter", Outreach::Scatter),
];

const FINDS: [(&str, Find); 4] = [
    ("fold", Find::Fold),
    ("location", Find::Location),
    ("tilt", Find::Tilt),
    ("both", Find::Both),
];

fn named<T: Copy>(list: &[(&str, T)], name: &str) -> Option<T> {
    list.iter().find(|(n, _)| *n == name).map(|(_, v)| *v)
}

fn name_of<T: Copy + PartialEq>(list: &[(&'static str, T)], value: T) -> &'static str {
    list.iter()
        .find(|(_, v)| *v == value)
        .map_or("", |(n, _)| n)
}

/// Options of `oess`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OessOptions {
    /// Texels across and down a map, 64 to 4096. None: 2048 of that of the line's centre, 1024 of those of its
    /// ends.
    pub resolution: Option<u32>,
    /// Segments that the line is cut into, 1 to [`MOST_SEGMENTS`]; they share the maps of their ends.
    /// None: as many as what hides between the line's ends may need, where it does.
    pub segments: Option<u32>,
    /// Edges lie where triangles end in the receiver's plane, not between texels.
    pub exact: bool,
    /// Light may come between the blockers nearest to both ends, where both ends are seen.
    pub gaps: bool,
    /// Steps from the stored surface's edge towards the receiver's own, 0 to 16.
    pub walk: u32,
    /// How occluding edges reach the texels of their penumbrae.
    pub outreach: Outreach,
    /// Which texels are occluding edges.
    pub find: Find,
    /// With candidates: a receiver that a map does not show is in its penumbra by its place alone,
    /// as published.
    pub by_place: bool,
}

impl OessOptions {
    /// What the technique does without options.
    pub const DEFAULT: Self = Self {
        resolution: None,
        segments: None,
        exact: true,
        gaps: true,
        walk: 2,
        outreach: Outreach::Silhouettes,
        find: Find::Both,
        by_place: false,
    };

    /// What can be set.
    pub(in crate::shadow) const ALL: &[TechniqueOption] = &[
        TechniqueOption::new(
            "resolution",
            "auto",
            "auto (2048 of the centre's, 1024 of an end's) or 64 to 4096",
            "texels across and down a map",
        ),
        TechniqueOption::new(
            "segments",
            "auto",
            "auto (where blockers may hide between the line's ends) or 1 to 8",
            "segments of the line, which share the maps of their ends",
        ),
        TechniqueOption::new(
            "edges",
            "exact",
            "exact (of triangles, in the receiver's plane) or texels",
            "where occluding edges lie",
        ),
        TechniqueOption::new(
            "gaps",
            "1",
            "0 or 1",
            "whether light comes between the blockers nearest to two ends that are seen",
        ),
        TechniqueOption::new(
            "walk",
            "2",
            "0 to 16",
            "steps from the stored surface's occluding edge to the receiver's",
        ),
        TechniqueOption::new(
            "outreach",
            "silhouettes",
            "silhouettes (of the mesh, listed for each tile) or, in maps of the line's ends, hull, scan (two of the \
             edges found), search (slow check of scan) or scatter (published)",
            "how occluding edges reach the receivers of their penumbrae; the other options are for maps",
        ),
        TechniqueOption::new(
            "find",
            "both",
            "fold, location (strategy 2), tilt (strategy 1) or both (strategies)",
            "which texels are occluding edges, for outreach=scan, search and scatter",
        ),
        TechniqueOption::new(
            "penumbra",
            "depth",
            "depth or place (published: also receivers behind what the map shows)",
            "which receivers an end's penumbra holds, for outreach=scan, search and scatter",
        ),
    ];

    /// The values, in the order of [`ALL`](Self::ALL).
    pub(in crate::shadow) fn values(&self) -> Vec<String> {
        vec![
            self.resolution
                .map_or("auto".to_string(), |texels| texels.to_string()),
            self.segments
                .map_or("auto".to_string(), |segments| segments.to_string()),
            if self.exact { "exact" } else { "texels" }.to_string(),
            u32::from(self.gaps).to_string(),
            self.walk.to_string(),
            name_of(&OUTREACHES, self.outreach).to_string(),
            name_of(&FINDS, self.find).to_string(),
            if self.by_place { "place" } else { "depth" }.to_string(),
        ]
    }

    /// Sets one; `None` for a value that it does not take.
    pub(in crate::shadow) fn set(&mut self, option: &str, value: &str) -> Option<()> {
        let number = |range: std::ops::RangeInclusive<u32>| {
            value.parse::<u32>().ok().filter(|n| range.contains(n))
        };
        match option {
            "resolution" if value == "auto" => self.resolution = None,
            "resolution" => self.resolution = Some(number(64..=4096)?),
            "segments" if value == "auto" => self.segments = None,
            "segments" => self.segments = Some(number(1..=MOST_SEGMENTS)?),
            "edges" => {
                self.exact = match value {
                    "exact" => true,
                    "texels" => false,
                    _ => return None,
                }
            }
            "gaps" => self.gaps = number(0..=1)? == 1,
            "walk" => self.walk = number(0..=16)?,
            "outreach" => self.outreach = named(&OUTREACHES, value)?,
            "find" => self.find = named(&FINDS, value)?,
            "penumbra" => {
                self.by_place = match value {
                    "depth" => false,
                    "place" => true,
                    _ => return None,
                }
            }
            _ => return None,
        }
        Some(())
    }
}
