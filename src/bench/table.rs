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
        "| target error | lights | within it | possible | time of the fastest no worse, mean | at most 1.3 | largest |\n\
         | ---: | ---: | ---: | ---: | ---: | ---: | ---: |\n",
    );
    for target_error in [0.1, 0.05, 0.02, 0.015, 0.01] {
        let options = AutoOptions {
            target_error,
            budget_ms: None,
        };
        let all = held_out(table, &options);
        let count = |is: &dyn Fn(&HeldOut) -> bool| all.iter().filter(|one| is(one)).count();
        let ratios: Vec<f64> = all.iter().map(|one| one.ms / one.best_ms).collect();
        let mean = (ratios.iter().map(|r| r.ln()).sum::<f64>() / ratios.len().max(1) as f64).exp();
        // Writing to a String cannot fail.
        let _ = writeln!(
            text,
            "| {target_error} | {} | {} | {} | {mean:.2} | {} | {:.1} |",
            all.len(),
            count(&|one| one.rmse <= target_error),
            count(&|one| one.target_ms.is_some()),
            ratios.iter().filter(|r| **r <= 1.3).count(),
            ratios.iter().copied().fold(1.0, f64::max),
        );
    }
    text
}
