//! The table that the technique `auto` chooses by, from results.

use std::fmt::Write as _;

use super::results::{Entry, Results};
use crate::light::ShapeKind;
use crate::shadow::Technique;
use crate::shadow::auto::{AutoOptions, Case, HeldOut, Row, Table, held_out};

/// The rows that results give: every technique, but not one that chooses, in every scene with a penumbra.
pub fn rows(results: &Results) -> Vec<Row> {
    let rows = results
        .images
        .iter()
        .filter_map(|entry| row(results, entry));
    rows.collect()
}

fn row(results: &Results, entry: &Entry) -> Option<Row> {
    let technique: Technique = entry.label.parse().ok()?;
    if matches!(technique, Technique::Auto(_)) || entry.failure.is_some() {
        return None;
    }
    let mut references = results.references.iter();
    let reference = references.find(|r| {
        r.scene == entry.scene && r.light_index == entry.light_index && r.penumbra_pixels > 0
    })?;
    let case = reference.case?;
    let mut shapes = ShapeKind::ALL.into_iter();
    let path = std::path::Path::new(&entry.scene);
    Some(Row {
        technique,
        scene: path.file_stem()?.to_string_lossy().into_owned(),
        light: entry.light.replace(['\t', '\n'], " "),
        case: Case {
            shape: shapes.find(|shape| shape.name() == entry.light_shape)?,
            angle: case.angle,
            cone: case.cone,
            triangles: case.triangles,
            holes: case.holes,
            pixels: f64::from(entry.width) * f64::from(entry.height),
            is_uneven: false,
        },
        rmse: entry.error.as_ref()?.penumbra.rmse,
        ms: entry.visibility_ms?.median,
    })
}

/// What choices by the table are worth on scenes that it does not know: a Markdown table, one row for each target.
pub fn verdict(table: &Table) -> String {
    let mut text = String::from(
        "| target error | lights | within it | possible | over the fastest no worse, mean | at most 1.3 | largest \
         | over the fastest good enough, mean | at most 1.3 | largest |\n\
         | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |\n",
    );
    for target_error in [0.1, 0.05, 0.02, 0.015, 0.01] {
        let options = AutoOptions {
            target_error,
            budget_ms: None,
        };
        let all = held_out(table, &options);
        let count = |is: &dyn Fn(&HeldOut) -> bool| all.iter().filter(|one| is(one)).count();
        let no_worse = all.iter().map(|one| one.ms / one.best_ms);
        // A choice that misses the target is not held against one that does not.
        let good = |one: &HeldOut| one.target_ms.filter(|_| one.rmse <= target_error);
        let good_enough = all
            .iter()
            .map(|one| one.ms / good(one).unwrap_or(one.best_ms));
        // Writing to a String cannot fail.
        let _ = writeln!(
            text,
            "| {target_error} | {} | {} | {} | {} | {} |",
            all.len(),
            count(&|one| one.rmse <= target_error),
            count(&|one| one.target_ms.is_some()),
            ratios(no_worse.collect()),
            ratios(good_enough.collect()),
        );
    }
    text
}

/// Geometric mean, number of those that are at most 1.3, and the largest.
fn ratios(all: Vec<f64>) -> String {
    let mean = (all.iter().map(|r| r.ln()).sum::<f64>() / all.len().max(1) as f64).exp();
    let near = all.iter().filter(|r| **r <= 1.3).count();
    let largest = all.iter().copied().fold(1.0, f64::max);
    format!("{mean:.2} | {near} | {largest:.1}")
}
