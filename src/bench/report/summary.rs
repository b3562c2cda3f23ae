//! Over all scenes and lights: means, and who does how well where.

use std::fmt::Write as _;

use super::analysis::{Overall, Point, base, overall};
use super::format::{breakable, error, escape, ms, ratio, signed};
use super::outcomes::{self, Outcome, RIGHT};
use super::plot::{Families, Plot};
use super::scene_name;
use crate::bench::results::Results;

pub(super) fn write(page: &mut String, results: &Results, families: Families<'_>) {
    let all = overall(results);
    let groups = results.references.len();
    // Writing to a String cannot fail.
    let _ = write!(
        page,
        "<section id=\"summary\" class=\"card\">\n<h2>All scenes <small>{groups} scene{} and \
         light{}</small></h2>\n<figure>\n{}<figcaption>Geometric mean of the time for one \
         light\u{2019}s visibility against mean penumbra RMSE. The thick line is the Pareto \
         front.</figcaption>\n</figure>\n",
        if groups == 1 { "" } else { "s" },
        if groups == 1 { "" } else { "s" },
        plot(&all, families)
    );
    table(page, results, &all, families);
    page.push_str("</section>\n");
    matrix(page, results, families);
}

fn plot(all: &[Overall], families: Families<'_>) -> String {
    with_plot(all, families, |plot| plot.svgs())
}

/// The page's plot over all scenes as an SVG file.
pub(super) fn plot_alone(results: &Results, families: Families<'_>) -> String {
    with_plot(&overall(results), families, |plot| plot.alone())
}

fn with_plot(
    all: &[Overall],
    families: Families<'_>,
    draw: impl FnOnce(&Plot<'_>) -> String,
) -> String {
    let points: Vec<Point> = (all.iter())
        .filter_map(|one| {
            let (ms, error) = (one.ms?, one.rmse?);
            Some(Point {
                label: one.label.clone(),
                family: one.family.clone(),
                rays: one.rays,
                ms,
                range: (ms, ms),
                error,
            })
        })
        .collect();
    let plot = Plot {
        title: "All scenes",
        x: "visibility, ms (geometric mean)",
        y: "penumbra RMSE (mean)",
        points: &points,
        families,
        noise: None,
    };
    draw(&plot)
}

/// A small mark in the colour of a family.
pub(super) fn key(families: Families<'_>, family: &str) -> String {
    let index = families.index(family);
    format!(
        "<svg class=\"key f{index}\" viewBox=\"0 0 14 14\" aria-hidden=\"true\">{}</svg>",
        super::plot::shape(index, 7.0, 7.0, 4.4)
    )
}

/// A number's cell; a dash for none.
pub(super) fn cell(value: Option<String>) -> String {
    match value {
        Some(value) => format!("<td class=\"n\">{value}</td>"),
        None => "<td class=\"n none\">\u{2013}</td>".into(),
    }
}

fn table(page: &mut String, results: &Results, all: &[Overall], families: Families<'_>) {
    let base = escape(base(results));
    let _ = write!(
        page,
        "<div class=\"scroll\" tabindex=\"0\" role=\"region\" aria-label=\"All techniques over all \
         scenes\">\n<table>\n<thead><tr><th scope=\"col\">Technique</th><th scope=\"col\">Time, \
         ms</th><th scope=\"col\">\u{d7} {base}</th><th scope=\"col\">Penumbra RMSE</th><th \
         scope=\"col\">Bias</th><th scope=\"col\">p99</th><th scope=\"col\">Worst RMSE</th><th \
         scope=\"col\">Cells</th></tr></thead>\n<tbody>\n"
    );
    for one in all {
        let worst = one.worst.and_then(|(rmse, at)| {
            let reference = results.references.get(at)?;
            let name = escape(&scene_name(&reference.scene));
            Some(format!("{} <a href=\"#g{at}\">{name}</a>", error(rmse)))
        });
        let mut cells = one.measured.to_string();
        for (count, what) in [(one.failed, "failed"), (one.unsupported, "cannot")] {
            if count > 0 {
                let _ = write!(cells, ", {count} {what}");
            }
        }
        let _ = writeln!(
            page,
            "<tr><th scope=\"row\">{}{}</th>{}{}{}{}{}{}{}</tr>",
            key(families, &one.family),
            breakable(&one.label),
            cell(one.ms.map(ms)),
            cell(one.time_ratio.map(ratio)),
            cell(one.rmse.map(error)),
            cell(one.bias.map(signed)),
            cell(one.p99.map(error)),
            cell(worst),
            cell(Some(cells)),
        );
    }
    page.push_str("</tbody>\n</table>\n</div>\n");
}

/// Scenes by techniques, each cell with its error, tinted by it.
fn matrix(page: &mut String, results: &Results, families: Families<'_>) {
    page.push_str(
        "<section id=\"matrix\" class=\"card\">\n<h2>Error by scene</h2>\n\
         <div class=\"scroll\" tabindex=\"0\" role=\"region\" aria-label=\"Error by scene \
         and technique\">\n<table class=\"matrix\">\n<thead><tr><th scope=\"col\">Scene, light</th>",
    );
    for label in &results.settings.techniques {
        let family = label.split(':').next().unwrap_or_default();
        let _ = write!(
            page,
            "<th scope=\"col\">{}{}</th>",
            key(families, family),
            breakable(label)
        );
    }
    page.push_str("</tr></thead>\n<tbody>\n");
    for (at, reference) in results.references.iter().enumerate() {
        let entries = results.group(reference);
        let _ = write!(
            page,
            "<tr><th scope=\"row\"><a href=\"#g{at}\">{}</a> <small>{}</small></th>",
            escape(&scene_name(&reference.scene)),
            escape(&reference.light)
        );
        for label in &results.settings.techniques {
            let entry = entries.iter().find(|entry| entry.label == *label);
            page.push_str(&Outcome::of(reference, entry.copied()).html());
        }
        page.push_str("</tr>\n");
    }
    page.push_str("</tbody>\n");
    outcomes::counts(page, results);
    let _ = writeln!(
        page,
        "</table>\n</div>\n<p class=\"note\">The stronger the colour, the more error; of all valid \
         pixels where the truth has no penumbra. Up to {RIGHT} counts as right, and more as degraded. \
         Why a technique refuses a light or has failed is said <a href=\"#failures\">below</a>.</p>\n\
         </section>"
    );
}

/// Cells without a result, with their reasons.
pub(super) fn failures(page: &mut String, results: &Results) {
    if results.failures.is_empty() {
        return;
    }
    page.push_str("<section id=\"failures\" class=\"card\">\n<h2>Without a result</h2>\n<ul>\n");
    for failed in &results.failures {
        let _ = writeln!(
            page,
            "<li data-failed=\"{}\"><b>{}</b> on {}, {}: {}</li>",
            escape(&failed.label),
            escape(&failed.label),
            escape(&scene_name(&failed.scene)),
            escape(&failed.light),
            escape(&failed.failure.reason)
        );
    }
    page.push_str("</ul>\n</section>\n");
}
