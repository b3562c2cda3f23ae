//! Options of `shaft-masks`.

use crate::shadow::TechniqueOption;

/// Options of `shaft-masks`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShaftOptions {
    /// Rows and columns of light samples that every tile begins with: 8, 16 or 32.
    pub side: u32,
    /// Triangles a tile that lists have room for on average, 0 to 4096. What finds no room is found
    /// again where it is needed, which costs time.
    pub room: u32,
    /// Estimated root mean square error of the penumbra's pixels, 0 to 1: tiles get more samples,
    /// up to 1024, the worst first, until it is reached. `None`: none do on its account.
    pub target_error: Option<f32>,
    /// Proven bound on the error of every pixel, 0 to 1: tiles with a pixel above it get more
    /// samples, up to 1024. What is above it then stays so.
    pub bound: Option<f32>,
    /// Milliseconds of the device after which no more tiles get more samples, from the first pass of
    /// the technique on. It is looked at between rounds of a part of the tiles, so that a picture
    /// may take somewhat longer.
    pub budget_ms: Option<f32>,
    /// The most that may be done for more samples: entries of the tiles' lists, once for each 64
    /// samples. The same picture on every run, unless there was no `room` for all lists.
    pub budget_work: Option<u32>,
}

impl ShaftOptions {
    /// What the technique does without options.
    pub const DEFAULT: Self = Self {
        side: 8,
        room: 1024,
        target_error: Some(0.015),
        bound: None,
        budget_ms: None,
        budget_work: None,
    };

    /// What can be set.
    pub(in crate::shadow) const ALL: &[TechniqueOption] = &[
        TechniqueOption::new(
            "samples",
            "64",
            "64, 256 or 1024",
            "samples of the light that every tile begins with",
        ),
        TechniqueOption::new(
            "room",
            "1024",
            "0 to 4096",
            "triangles a tile that lists have room for; the rest is found again for each tile",
        ),
        TechniqueOption::new(
            "target-error",
            "0.015",
            "0 to 1, or none",
            "estimated penumbra RMSE down to which the worst tiles get more samples, up to 1024",
        ),
        TechniqueOption::new(
            "bound",
            "none",
            "0 to 1, or none",
            "proven bound on every pixel: tiles above it get more samples, up to 1024",
        ),
        TechniqueOption::new(
            "budget-ms",
            "none",
            "0 to 1000000, or none",
            "device milliseconds after which no more tiles get more samples",
        ),
        TechniqueOption::new(
            "budget-work",
            "none",
            "0 to 4294967295, or none",
            "edges and triangles looked at for more samples, each once a tile and 64 samples",
        ),
    ];

    /// The values, in the order of [`ALL`](Self::ALL).
    pub(in crate::shadow) fn values(&self) -> Vec<String> {
        fn text<T: ToString>(value: Option<T>) -> String {
            value.map_or_else(|| "none".into(), |value| value.to_string())
        }
        vec![
            (self.side * self.side).to_string(),
            self.room.to_string(),
            text(self.target_error),
            text(self.bound),
            text(self.budget_ms),
            text(self.budget_work),
        ]
    }

    /// Sets one; `None` for a value that it does not take.
    pub(in crate::shadow) fn set(&mut self, option: &str, value: &str) -> Option<()> {
        let up_to = |most: f32| {
            if value == "none" {
                return Some(None);
            }
            let number = value.parse().ok();
            number.filter(|n| (0.0..=most).contains(n)).map(Some)
        };
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
            "target-error" => self.target_error = up_to(1.0)?,
            "bound" => self.bound = up_to(1.0)?,
            "budget-ms" => self.budget_ms = up_to(1.0e6)?,
            "budget-work" if value == "none" => self.budget_work = None,
            "budget-work" => self.budget_work = Some(value.parse().ok()?),
            _ => return None,
        }
        Some(())
    }
}
