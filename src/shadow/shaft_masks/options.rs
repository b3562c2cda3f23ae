//! Options of `shaft-masks`.

use crate::shadow::TechniqueOption;

/// Options of `shaft-masks`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ShaftOptions {
    /// Rows and columns of light samples: 8, 16 or 32.
    pub side: u32,
    /// Triangles a tile that lists have room for on average, 0 to 4096. What finds no room is found
    /// again where it is needed, which costs time.
    pub room: u32,
}

impl ShaftOptions {
    /// What the technique does without options.
    pub const DEFAULT: Self = Self {
        side: 16,
        room: 1024,
    };

    /// What can be set.
    pub(in crate::shadow) const ALL: &[TechniqueOption] = &[
        TechniqueOption {
            name: "samples",
            default: "256",
            values: "64, 256 or 1024",
            what: "samples of the light",
        },
        TechniqueOption {
            name: "room",
            default: "1024",
            values: "0 to 4096",
            what: "triangles a tile that lists have room for; the rest is found again for each tile",
        },
    ];

    /// The values, in the order of [`ALL`](Self::ALL).
    pub(in crate::shadow) fn values(&self) -> Vec<String> {
        vec![(self.side * self.side).to_string(), self.room.to_string()]
    }

    /// Sets one; `None` for a value that it does not take.
    pub(in crate::shadow) fn set(&mut self, option: &str, value: &str) -> Option<()> {
        match option {
            "samples" => {
                self.side = match value {
                    "64" => 8,
                    "256" => 16,
                    "1024" => 32,
                    _ => return None,
                }
            }
            "room" => self.room = value.parse().ok().filter(|n| *n <= 4096)?,
            _ => return None,
        }
        Some(())
    }
}
