//! Options of `dbuffer`.

use crate::light::{AreaLight, LightShape};
use crate::shadow::TechniqueOption;

/// What a receiver takes the edges that matter to it from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Buffer {
    /// A list for each tile of the picture: all edges, and no buffer.
    Lists,
    /// The published D-buffer: distances along the ray from the light's centre.
    Distances,
    /// The same buffer with edges in it, whose images on the light are exact for each receiver.
    Edges,
}

/// Which of several surfaces a texel of the buffer keeps, and how those of several layers join.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Keep {
    /// The one farthest from the light, as published.
    Greatest,
    /// The nearest.
    Nearest,
    /// The nearest of each blocker, and of these the darkest, as far as layers go.
    Darkest,
}

/// Visibility from the part of the light's diameter that is seen, t.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Curve {
    /// The area of the disk.
    Exact,
    /// `3 t^2 - 2 t^3`, equation 4.
    Cubic,
    /// The square root of t, for blockers smaller than the light (section 6.2).
    Sqrt,
}

/// Options of `dbuffer`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DbufferOptions {
    /// Places on the light at which layers are counted: 32 or 64; for [`Buffer::Lists`].
    pub samples: u32,
    /// Edges a tile that lists have room for on average, 0 to 4096. Where tiles ask for more, those with the
    /// most edges go without: receivers look through the whole list of silhouettes, or send rays where that is
    /// longer than [`most_edges`](Self::most_edges). For [`Buffer::Lists`].
    pub room: u32,
    /// Most edges of a tile, 0 to 2048: receivers of tiles with more send rays to the samples, so that
    /// loops stay shorter than software drivers let them be. For [`Buffer::Lists`].
    pub most_edges: u32,
    /// Where edges come from.
    pub buffer: Buffer,
    /// Which surface a texel of the buffer keeps.
    pub keep: Keep,
    /// Surfaces of a kind that a texel of the buffer keeps, 1 to 4.
    pub layers: u32,
    /// Visibility from the part of the diameter that is seen; for buffers.
    pub curve: Curve,
    /// Texels across and down each image of the buffer, 64 to 4096.
    pub resolution: u32,
    /// A rectangle counts as the disk of equal area: always in buffers.
    pub as_disk: bool,
}

const BUFFERS: [(&str, Buffer); 3] = [
    ("lists", Buffer::Lists),
    ("distances", Buffer::Distances),
    ("edges", Buffer::Edges),
];

const KEEPS: [(&str, Keep); 3] = [
    ("greatest", Keep::Greatest),
    ("nearest", Keep::Nearest),
    ("darkest", Keep::Darkest),
];

const CURVES: [(&str, Curve); 3] = [
    ("exact", Curve::Exact),
    ("cubic", Curve::Cubic),
    ("sqrt", Curve::Sqrt),
];

fn named<T: Copy>(names: &[(&str, T)], name: &str) -> Option<T> {
    names.iter().find(|(n, _)| *n == name).map(|(_, v)| *v)
}

fn name_of<T: PartialEq>(names: &[(&'static str, T)], value: T) -> String {
    let found = names.iter().find(|(_, v)| *v == value);
    found.map_or("", |(n, _)| *n).to_string()
}

impl DbufferOptions {
    /// What the technique does without options.
    pub const DEFAULT: Self = Self {
        samples: 32,
        room: 256,
        most_edges: 2048,
        buffer: Buffer::Lists,
        keep: Keep::Nearest,
        layers: 1,
        curve: Curve::Exact,
        resolution: 1024,
        as_disk: false,
    };

    /// What can be set.
    pub(in crate::shadow) const ALL: &[TechniqueOption] = &[
        TechniqueOption::new(
            "samples",
            "32",
            "32 or 64",
            "places on the light at which overlapping blockers are told apart; for buffer=lists",
        ),
        TechniqueOption::new(
            "room",
            "256",
            "0 to 4096",
            "edges a tile that lists have room for on average; if that is too few, tiles with the most go without",
        ),
        TechniqueOption::new(
            "most-edges",
            "2048",
            "0 to 2048",
            "edges of a tile; where there are more, rays are sent to the samples instead",
        ),
        TechniqueOption::new(
            "buffer",
            "lists",
            "lists (all edges of a tile), distances (the D-buffer as published) or edges (edges in the D-buffer)",
            "where the edges come from; the options below are for the last two",
        ),
        TechniqueOption::new(
            "keep",
            "nearest",
            "greatest (as published), nearest or darkest (nearest of each blocker)",
            "which surface of a volume counts where several are on one ray",
        ),
        TechniqueOption::new(
            "layers",
            "1",
            "1 to 4",
            "surfaces of a kind that a texel keeps",
        ),
        TechniqueOption::new(
            "curve",
            "exact",
            "exact, cubic (3 t^2 - 2 t^3, as published) or sqrt (as published for small blockers)",
            "visibility from the part of the light's diameter that is seen",
        ),
        TechniqueOption::new(
            "resolution",
            "1024",
            "64 to 4096",
            "texels across and down each image of the buffer",
        ),
        TechniqueOption::new(
            "light",
            "own",
            "own or disk (a rectangle as the disk of equal area, always so in a D-buffer)",
            "shape of rectangles",
        ),
    ];

    /// The values, in the order of [`ALL`](Self::ALL).
    pub(in crate::shadow) fn values(&self) -> Vec<String> {
        vec![
            self.samples.to_string(),
            self.room.to_string(),
            self.most_edges.to_string(),
            name_of(&BUFFERS, self.buffer),
            name_of(&KEEPS, self.keep),
            self.layers.to_string(),
            name_of(&CURVES, self.curve),
            self.resolution.to_string(),
            if self.as_disk { "disk" } else { "own" }.to_string(),
        ]
    }

    /// Sets one; `None` for a value that it does not take.
    /// What a light counts as where nothing blocks it; `None` where that takes the technique's passes.
    pub(in crate::shadow) fn unblocked_shape(&self, light: &AreaLight) -> Option<LightShape> {
        (self.buffer == Buffer::Lists && !self.as_disk).then_some(light.shape)
    }

    pub(in crate::shadow) fn set(&mut self, option: &str, value: &str) -> Option<()> {
        let number = value.parse::<u32>().ok();
        match option {
            "samples" => self.samples = number.filter(|n| matches!(n, 32 | 64))?,
            "room" => self.room = number.filter(|n| *n <= 4096)?,
            "most-edges" => self.most_edges = number.filter(|n| *n <= 2048)?,
            "buffer" => self.buffer = named(&BUFFERS, value)?,
            "keep" => self.keep = named(&KEEPS, value)?,
            "layers" => self.layers = number.filter(|n| (1..=4).contains(n))?,
            "curve" => self.curve = named(&CURVES, value)?,
            "resolution" => self.resolution = number.filter(|n| (64..=4096).contains(n))?,
            "light" => self.as_disk = named(&[("own", false), ("disk", true)], value)?,
            _ => return None,
        }
        Some(())
    }
}
