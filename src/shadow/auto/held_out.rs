//! How good choices are on scenes that the table does not know.

use super::{AutoOptions, Table, choose};
use crate::shadow::Technique;

/// One light whose scene was left out of the table when its technique was chosen.
#[derive(Clone, Debug, PartialEq)]
pub struct HeldOut {
    /// Name of the scene.
    pub scene: String,
    /// Name of the light.
    pub light: String,
    /// What was chosen.
    pub technique: Technique,
    /// Its measured error.
    pub rmse: f64,
    /// Its measured time, milliseconds.
    pub ms: f64,
    /// The time of the fastest that is no worse.
    pub best_ms: f64,
    /// The time of the fastest within the target error; `None` if there is none.
    pub target_ms: Option<f64>,
}

/// Chooses for each case of a table by its other scenes, and looks up what came of it.
#[must_use]
pub fn held_out(table: &Table, options: &AutoOptions) -> Vec<HeldOut> {
    let mut all: Vec<HeldOut> = Vec::new();
    let mut done: Vec<(&str, &str, u64, u64)> = Vec::new();
    for row in table.rows() {
        let key = (
            &*row.scene,
            &*row.light,
            row.case.angle.to_bits(),
            row.case.pixels.to_bits(),
        );
        if done.contains(&key) {
            continue;
        }
        done.push(key);
        let measured: Vec<_> = (table.rows().iter())
            .filter(|other| {
                (&*other.scene, &*other.light) == (&*row.scene, &*row.light)
                    && other.case == row.case
            })
            .collect();
        let rest = table.without(&row.scene);
        let choice = choose(&rest, &[row.case], options).remove(0);
        let Some(chosen) = measured
            .iter()
            .find(|row| row.technique == choice.technique)
        else {
            continue;
        };
        let fastest = |most: f64| {
            let good = measured.iter().filter(|row| row.rmse <= most);
            good.map(|row| row.ms).min_by(f64::total_cmp)
        };
        all.push(HeldOut {
            scene: row.scene.clone(),
            light: row.light.clone(),
            technique: choice.technique,
            rmse: chosen.rmse,
            ms: chosen.ms,
            best_ms: fastest(chosen.rmse).unwrap_or(chosen.ms),
            target_ms: fastest(options.target_error),
        });
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The table that comes with the library is good enough to choose by.
    #[test]
    fn choices_on_unknown_scenes_are_near_the_fastest() {
        let all = held_out(Table::reference(), &AutoOptions::DEFAULT);
        assert!(all.len() >= 20, "{}", all.len());
        let logs: f64 = all.iter().map(|one| (one.ms / one.best_ms).ln()).sum();
        let mean = (logs / all.len() as f64).exp();
        assert!(mean <= 1.3, "{mean}");
        let target = AutoOptions::DEFAULT.target_error;
        let far = all.iter().filter(|one| one.rmse > 1.5 * target).count();
        assert!(
            10 * far <= all.len(),
            "{far} of {} are far from the target",
            all.len()
        );
    }
}
