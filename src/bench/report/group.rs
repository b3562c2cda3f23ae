//! One scene under one light.

use std::fmt::Write as _;
use std::path::Path;

use base64::Engine as _;
use base64::prelude::BASE64_STANDARD;

use super::analysis::{
    Estimate, Metric, Point, best_in_time, curves, error_in, fastest_as_good, ms_for, pareto,
    points,
};
use super::format::{breakable, error, escape, mebibytes, ms, percent, ratio, signed};
use super::plot::{Families, Plot};
use super::scene_name;
use super::summary::{cell, key};
use crate::bench::results::{Entry, Pass, ReferenceEntry, Results};

/// What the parts of a group have in common.
struct Group<'a> {
    at: usize,
    reference: &'a ReferenceEntry,
    entries: Vec<&'a Entry>,
    points: Vec<Point>,
    metric: Metric,
    families: Families<'a>,
    folder: &'a Path,
}

pub(super) fn write(
    page: &mut String,
    results: &Results,
    at: usize,
    reference: &ReferenceEntry,
    families: Families<'_>,
    folder: &Path,
) {
    let entries = results.group(reference);
    let metric = Metric::of(reference);
    let group = Group {
        at,
        reference,
        points: points(&entries, metric),
        entries,
        metric,
        families,
        folder,
    };
    let name = escape(&scene_name(&reference.scene));
    // Writing to a String cannot fail.
    let _ = write!(
        page,
        "<section id=\"g{at}\" class=\"group card\">\n<h2><a href=\"#g{at}\">{name}</a> \
         <small>{}</small></h2>\n",
        escape(&format!("{}: {}", reference.light, reference.light_shape))
    );
    group.notes(page);
    page.push_str("<div class=\"columns\">\n");
    group.plot(page);
    group.viewer(page);
    page.push_str("<div class=\"equals\">\n");
    group.equal_time(page);
    group.equal_error(page);
    page.push_str("</div>\n</div>\n");
    group.table(page);
    group.passes(page);
    group.gallery(page);
    page.push_str("</section>\n");
}

impl Group<'_> {
    fn notes(&self, page: &mut String) {
        let reference = self.reference;
        let mut text = format!(
            "{} valid pixels, {} of them penumbra",
            reference.valid_pixels, reference.penumbra_pixels
        );
        if let Some(error_of_truth) = reference.standard_error {
            let _ = write!(
                text,
                "; the truth\u{2019}s own standard error is {}",
                error(error_of_truth.rms)
            );
        }
        if self.metric == Metric::Valid {
            text.push_str(". No penumbra: errors are those of all valid pixels");
        }
        let _ = writeln!(page, "<p class=\"note\">{text}.</p>");
        for entry in &self.entries {
            if let Some(failure) = &entry.failure {
                let _ = writeln!(
                    page,
                    "<p class=\"note bad\" data-failed=\"{}\">{}: {}</p>",
                    escape(&entry.label),
                    escape(&entry.label),
                    escape(&failure.reason)
                );
            }
            if entry.identical == Some(false) {
                let _ = writeln!(
                    page,
                    "<p class=\"note bad\">{}: its rounds differ from each other</p>",
                    escape(&entry.label)
                );
            }
        }
    }

    fn plot(&self, page: &mut String) {
        let title = format!(
            "{}, {}",
            scene_name(&self.reference.scene),
            self.reference.light
        );
        let plot = Plot {
            title: &title,
            x: "visibility, ms",
            y: self.metric.name(),
            points: &self.points,
            families: self.families,
            noise: self.reference.standard_error.map(|error| error.rms),
        };
        let _ = write!(
            page,
            "<figure class=\"error-time\">\n{}<figcaption>Error against time; the thick line is the \
             Pareto front, thin bars are the fastest and the slowest round.</figcaption>\n</figure>\n",
            plot.svgs()
        );
    }

    /// The images that are there: id, name, label for the eye.
    fn choices(&self) -> Vec<(String, String)> {
        let mut choices = vec![(format!("g{}-truth", self.at), "truth".to_string())];
        for (number, entry) in self.entries.iter().enumerate() {
            if entry.image.is_some() {
                choices.push((format!("g{}-i{number}", self.at), entry.label.clone()));
            }
        }
        choices
    }

    fn options(&self, selected: usize) -> String {
        let choices = self.choices();
        let options = choices.iter().enumerate().map(|(at, (id, name))| {
            let is_selected = if at == selected.min(choices.len() - 1) {
                " selected"
            } else {
                ""
            };
            format!(
                "<option value=\"{id}\"{is_selected}>{}</option>",
                escape(name)
            )
        });
        options.collect()
    }

    /// Compares two images, and one with the truth; the script fills it.
    fn viewer(&self, page: &mut String) {
        let closest = self.points.iter().filter(|point| point.rays.is_none());
        let closest = closest.min_by(|a, b| a.error.total_cmp(&b.error));
        let place = closest.and_then(|point| {
            let choices = self.choices();
            choices.iter().position(|(_, name)| *name == point.label)
        });
        let shown = place.unwrap_or(1);
        let name = escape(&scene_name(&self.reference.scene));
        let _ = write!(
            page,
            "<div class=\"viewer\">\n\
             <div class=\"pickers\"><label>Left <select class=\"left\">{}</select></label>\
             <label>Right <select class=\"right\">{}</select></label>\
             <button type=\"button\" class=\"flicker\" aria-pressed=\"false\">Flicker</button></div>\n\
             <div class=\"stage\" style=\"--cut:50%\"><img class=\"under\" alt=\"right image\">\
             <img class=\"over\" alt=\"left image\"><span class=\"divider\" \
             aria-hidden=\"true\"></span><span class=\"tag tag-left\"></span><span class=\"tag \
             tag-right\"></span><input class=\"cut\" type=\"range\" min=\"0\" max=\"100\" \
             step=\"0.1\" value=\"50\" aria-label=\"{name}: where the left image ends and the right \
             one begins\"></div>\n\
             <div class=\"heat\">\n<div class=\"pickers\"><label>Error of <select class=\"of\">{}\
             </select></label><label>Scale <select class=\"scale\">",
            self.options(0),
            self.options(shown),
            self.options(shown)
        );
        for scale in ["0.02", "0.05", "0.1", "0.2", "0.5", "1"] {
            let selected = if scale == "0.2" { " selected" } else { "" };
            let _ = write!(
                page,
                "<option value=\"{scale}\"{selected}>\u{b1}{scale}</option>"
            );
        }
        page.push_str(
            "</select></label></div>\n<canvas role=\"img\" aria-label=\"Difference from the \
             truth\"></canvas>\n<div class=\"legend\" aria-hidden=\"true\"><span \
             class=\"low\"></span><i></i><span class=\"high\"></span></div>\n<p \
             class=\"note\">Grey: pixels that are not valid.</p>\n</div>\n</div>\n",
        );
    }

    fn table(&self, page: &mut String) {
        let front = pareto(&self.points);
        let is_front = |label: &str| front.iter().any(|&i| self.points[i].label == label);
        let _ = write!(
            page,
            "<div class=\"scroll\" tabindex=\"0\" role=\"region\" aria-label=\"Times and \
             errors\">\n<table>\n<thead><tr><th scope=\"col\">Technique</th><th \
             scope=\"col\">Visibility, ms</th><th scope=\"col\">quartiles</th><th \
             scope=\"col\">Frame, ms</th><th scope=\"col\">Penumbra RMSE</th><th \
             scope=\"col\">Bias</th><th scope=\"col\">MAE</th><th scope=\"col\">p99</th><th \
             scope=\"col\">Max</th><th scope=\"col\">Valid RMSE</th><th scope=\"col\">Umbra as lit, \
             %</th><th scope=\"col\">Lit as umbra, %</th><th scope=\"col\">Device, MiB</th><th \
             scope=\"col\">Rounds</th></tr></thead>\n<tbody>\n"
        );
        for entry in &self.entries {
            let penumbra = entry.error.map(|e| e.penumbra).filter(|e| e.pixels > 0);
            let time = entry.visibility_ms;
            let _ = writeln!(
                page,
                "<tr{}><th scope=\"row\">{}{}</th>{}{}{}{}{}{}{}{}{}{}{}{}{}</tr>",
                if is_front(&entry.label) {
                    " class=\"on-front\""
                } else {
                    ""
                },
                key(self.families, &entry.technique),
                breakable(&entry.label),
                cell(time.map(|t| ms(t.median))),
                cell(time.map(|t| format!("{}\u{2013}{}", ms(t.q1), ms(t.q3)))),
                cell(entry.frame_ms.map(|t| ms(t.median))),
                cell(penumbra.map(|e| error(e.rmse))),
                cell(penumbra.map(|e| signed(e.bias))),
                cell(penumbra.map(|e| error(e.mae))),
                cell(penumbra.map(|e| error(e.p99))),
                cell(penumbra.map(|e| error(e.max))),
                cell(entry.error.map(|e| error(e.valid.rmse))),
                cell(entry.error.map(|e| percent(e.umbra_called_lit))),
                cell(entry.error.map(|e| percent(e.lit_called_umbra))),
                cell(entry.peak_bytes.map(|p| mebibytes(p.device))),
                cell(Some(entry.repeats.to_string())),
            );
        }
        page.push_str("</tbody>\n</table>\n</div>\n");
    }

    fn name(&self, point: &Point) -> String {
        let key = key(self.families, &point.family);
        format!("{key}{}", breakable(&point.label))
    }

    fn equal_time(&self, page: &mut String) {
        let what = self.metric.name();
        let _ = write!(
            page,
            "<div class=\"scroll\" tabindex=\"0\" role=\"region\" aria-label=\"At equal time\">\n\
             <table class=\"equal\">\n<caption>At equal time: {what} in no more time</caption>\n\
             <thead><tr><th scope=\"col\">Technique</th><th scope=\"col\">ms</th><th \
             scope=\"col\">its own</th><th scope=\"col\">best of the others</th><th \
             scope=\"col\">ray tracing</th></tr></thead>\n<tbody>\n"
        );
        let curves = curves(&self.points);
        for point in &self.points {
            let best = best_in_time(&self.points, point);
            let rays = match error_in(&curves, point.ms) {
                _ if curves.is_empty() => None,
                None => Some("not so fast".into()),
                Some(estimate) => Some(estimated(estimate, error)),
            };
            let _ = writeln!(
                page,
                "<tr><th scope=\"row\">{}</th>{}{}{}{}</tr>",
                self.name(point),
                cell(Some(ms(point.ms))),
                cell(Some(error(point.error))),
                other_cell(best, |other| error(other.error)),
                cell(rays),
            );
        }
        page.push_str("</tbody>\n</table>\n</div>\n");
    }

    fn equal_error(&self, page: &mut String) {
        let what = self.metric.name();
        let _ = write!(
            page,
            "<div class=\"scroll\" tabindex=\"0\" role=\"region\" aria-label=\"At equal error\">\n\
             <table class=\"equal\">\n<caption>At equal error: time for no more {what}</caption>\n\
             <thead><tr><th scope=\"col\">Technique</th><th scope=\"col\">{what}</th><th \
             scope=\"col\">its own, ms</th><th scope=\"col\">fastest of the others, ms</th><th \
             scope=\"col\">ray tracing, ms</th><th scope=\"col\">rays / own</th></tr></thead>\n\
             <tbody>\n"
        );
        let curves = curves(&self.points);
        for point in &self.points {
            let fastest = fastest_as_good(&self.points, point);
            let rays = ms_for(&curves, point.error);
            let _ = writeln!(
                page,
                "<tr><th scope=\"row\">{}</th>{}{}{}{}{}</tr>",
                self.name(point),
                cell(Some(error(point.error))),
                cell(Some(ms(point.ms))),
                other_cell(fastest, |other| ms(other.ms)),
                cell(rays.map(|estimate| estimated(estimate, ms))),
                cell(rays.map(|estimate| estimated(estimate, |rays| ratio(rays / point.ms)))),
            );
        }
        page.push_str("</tbody>\n</table>\n</div>\n");
    }

    /// A bar a technique, of its passes; opened, their times.
    fn passes(&self, page: &mut String) {
        let timed: Vec<&&Entry> = (self.entries.iter())
            .filter(|entry| total(&entry.passes) > 0.0)
            .collect();
        let most = timed
            .iter()
            .map(|entry| total(&entry.passes))
            .fold(0.0, f64::max);
        if timed.is_empty() {
            return;
        }
        page.push_str(
            "<div class=\"passes\">\n<h3>Passes of the frame</h3>\n<p class=\"note\">Time on the \
             device. Coloured: this light\u{2019}s visibility. Grey: surfaces and shading. Open a bar \
             for its numbers.</p>\n",
        );
        for entry in timed {
            let all = total(&entry.passes);
            let _ = write!(
                page,
                "<details class=\"f{}\"><summary><span class=\"who\">{}</span><span \
                 class=\"bar\" aria-hidden=\"true\">",
                self.families.index(&entry.technique),
                escape(&entry.label)
            );
            for pass in &entry.passes {
                let part = 100.0 * pass.gpu_ms.unwrap_or(0.0) / most;
                if part > 0.05 {
                    let class = if pass.visibility { "own" } else { "rest" };
                    let _ = write!(
                        page,
                        "<i class=\"{class}\" style=\"width:{part:.2}%\" title=\"{} {} ms\"></i>",
                        escape(&pass.name),
                        ms(pass.gpu_ms.unwrap_or(0.0))
                    );
                }
            }
            let _ = write!(
                page,
                "</span><span class=\"sum\">{} ms</span></summary>\n<table class=\"small\">\n<tbody>\n",
                ms(all)
            );
            for pass in &entry.passes {
                let time = match (&pass.skipped, pass.gpu_ms) {
                    (Some(reason), _) => format!("skipped: {}", escape(reason)),
                    (None, Some(time)) => format!("{} ms", ms(time)),
                    (None, None) => "\u{2013}".into(),
                };
                let class = if pass.visibility { "own" } else { "rest" };
                let _ = writeln!(
                    page,
                    "<tr><th scope=\"row\" class=\"{class}\">{}</th><td class=\"n\">{time}</td></tr>",
                    escape(&pass.name)
                );
            }
            page.push_str("</tbody>\n</table>\n</details>\n");
        }
        page.push_str("</div>\n");
    }

    fn gallery(&self, page: &mut String) {
        page.push_str("<h3>Images</h3>\n<div class=\"gallery\">\n");
        let reference = self.reference;
        self.figure(page, "truth", &reference.image, "truth", "");
        for (number, entry) in self.entries.iter().enumerate() {
            if let Some(image) = &entry.image {
                let rmse = self.metric.rmse(entry).map(error).unwrap_or_default();
                let time = entry
                    .visibility_ms
                    .map(|time| format!(", {} ms", ms(time.median)));
                let numbers = format!("RMSE {rmse}{}", time.unwrap_or_default());
                self.figure(page, &format!("i{number}"), image, &entry.label, &numbers);
            }
        }
        let _ = writeln!(
            page,
            "</div>\n<img class=\"valid\" id=\"g{}-valid\" alt=\"valid pixels\" hidden src=\"{}\">",
            self.at,
            self.data(&reference.valid_image)
        );
    }

    fn figure(&self, page: &mut String, id: &str, image: &str, label: &str, numbers: &str) {
        let label = escape(label);
        let _ = writeln!(
            page,
            "<figure><button type=\"button\" class=\"pick\" data-image=\"g{at}-{id}\" \
             aria-label=\"Compare {label}\"><img id=\"g{at}-{id}\" alt=\"{label}: visibility\" \
             src=\"{}\"></button><figcaption><b>{label}</b> {numbers}</figcaption></figure>",
            self.data(image),
            at = self.at,
        );
    }

    /// The image as part of the page.
    fn data(&self, image: &str) -> String {
        match std::fs::read(self.folder.join(image)) {
            Ok(bytes) => format!("data:image/png;base64,{}", BASE64_STANDARD.encode(bytes)),
            Err(error) => {
                log::warn!("{image}: not in the report: {error}");
                "data:,".into()
            }
        }
    }
}

/// Another contender and its number, which may take two lines.
fn other_cell(other: Option<&Point>, number: impl Fn(&Point) -> String) -> String {
    let text = |other: &Point| {
        format!(
            "{}<br><small>{}</small>",
            number(other),
            escape(&other.label)
        )
    };
    cell(other.map(text))
}

fn total(passes: &[Pass]) -> f64 {
    passes.iter().filter_map(|pass| pass.gpu_ms).sum()
}

fn estimated(estimate: Estimate, text: impl Fn(f64) -> String) -> String {
    match estimate {
        Estimate::Value(value) => text(value),
        Estimate::Above(value) => format!("&gt; {}", text(value)),
        Estimate::Below(value) => format!("&lt; {}", text(value)),
    }
}
