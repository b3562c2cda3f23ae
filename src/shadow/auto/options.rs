//! Options of `auto`.

use crate::shadow::TechniqueOption;

/// Options of `auto`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AutoOptions {
    /// Root mean square error of the penumbra's pixels that is good enough, above 0 and at most 1.
    pub target_error: f64,
    /// Milliseconds of the device for the visibility of all lights together; `None` for as many as it takes.
    pub budget_ms: Option<f64>,
}

impl AutoOptions {
    /// What the technique does without options.
    pub const DEFAULT: Self = Self {
        target_error: 0.02,
        budget_ms: None,
    };

    /// What can be set.
    pub(in crate::shadow) const ALL: &[TechniqueOption] = &[
        TechniqueOption::new(
            "target-error",
            "0.02",
            "above 0 to 1",
            "expected root mean square error of the penumbra that is good enough",
        ),
        TechniqueOption::new(
            "budget-ms",
            "none",
            "none, or above 0 to 1e6",
            "expected time of the device for the visibility of all lights together",
        ),
    ];

    /// In the order of [`ALL`](Self::ALL).
    pub(in crate::shadow) fn values(&self) -> Vec<String> {
        vec![
            self.target_error.to_string(),
            self.budget_ms.map_or("none".into(), |ms| ms.to_string()),
        ]
    }

    /// `None` for a value that the option does not take.
    pub(in crate::shadow) fn set(&mut self, option: &str, value: &str) -> Option<()> {
        let number = |most: f64| value.parse().ok().filter(|v: &f64| *v > 0.0 && *v <= most);
        match (option, value) {
            ("target-error", _) => self.target_error = number(1.0)?,
            ("budget-ms", "none") => self.budget_ms = None,
            ("budget-ms", _) => self.budget_ms = Some(number(1e6)?),
            _ => return None,
        }
        Some(())
    }
}
