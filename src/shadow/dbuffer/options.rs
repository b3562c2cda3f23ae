//! Options of `dbuffer`.

use crate::shadow::TechniqueOption;

/// Options of `dbuffer`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DbufferOptions {
    /// Places on the light at which layers are counted: 32 or 64.
    pub samples: u32,
    /// Edges a tile that lists have room for on average, 0 to 4096. What finds no room is looked for
    /// in the whole list of silhouettes, which costs time.
    pub room: u32,
}

impl DbufferOptions {
    /// What the technique does without options.
    pub const DEFAULT: Self = Self {
        samples: 32,
        room: 256,
    };

    /// What can be set.
    pub(in crate::shadow) const ALL: &[TechniqueOption] = &[
        TechniqueOption {
            name: "samples",
            default: "32",
            values: "32 or 64",
            what: "places on the light at which overlapping blockers are told apart",
        },
        TechniqueOption {
            name: "room",
            default: "256",
            values: "0 to 4096",
            what: "edges a tile that lists have room for; the rest is looked for among all",
        },
    ];

    /// The values, in the order of [`ALL`](Self::ALL).
    pub(in crate::shadow) fn values(&self) -> Vec<String> {
        vec![self.samples.to_string(), self.room.to_string()]
    }

    /// Sets one; `None` for a value that it does not take.
    pub(in crate::shadow) fn set(&mut self, option: &str, value: &str) -> Option<()> {
        let number = value.parse::<u32>().ok();
        match option {
            "samples" => self.samples = number.filter(|n| matches!(n, 32 | 64))?,
            "room" => self.room = number.filter(|n| *n <= 4096)?,
            _ => return None,
        }
        Some(())
    }
}
