//! Plots of error against time, both logarithmic, as SVG.

use std::fmt::Write as _;

use super::analysis::{Point, curves, pareto};
use super::format::{error, escape, ms};

/// From values above 0 to places.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct LogScale {
    /// Logarithms of the ends.
    low: f64,
    high: f64,
    /// Places of the ends.
    from: f64,
    to: f64,
}

/// Least value that is shown; what is below, 0 too, is shown there.
const LEAST: f64 = 1e-6;

impl LogScale {
    /// With all values some way from the ends, and at least a factor of 4 in all.
    pub(super) fn new(values: impl Iterator<Item = f64>, from: f64, to: f64) -> Self {
        let logs = values
            .filter(|v| v.is_finite())
            .map(|v| v.max(LEAST).log10());
        let (mut low, mut high) = logs.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| {
            (l.min(v), h.max(v))
        });
        if low > high {
            (low, high) = (-1.0, 1.0);
        }
        let room = (0.08 * (high - low))
            .max(0.12)
            .max(0.3 - 0.5 * (high - low));
        Self {
            low: low - room,
            high: high + room,
            from,
            to,
        }
    }

    pub(super) fn at(&self, value: f64) -> f64 {
        let part = (value.max(LEAST).log10() - self.low) / (self.high - self.low);
        self.from + part.clamp(0.0, 1.0) * (self.to - self.from)
    }

    /// Values to write at the axis: 1, or 1 and 3, or 1, 2 and 5 times powers of ten, whatever gives
    /// enough and not too many.
    pub(super) fn ticks(&self, most: usize) -> Vec<f64> {
        let steps: [&[f64]; 3] = [&[1.0, 2.0, 5.0], &[1.0, 3.0], &[1.0]];
        let mut ticks = Vec::new();
        for steps in steps {
            ticks.clear();
            for decade in self.low.floor() as i32..=self.high.ceil() as i32 {
                let values = steps.iter().map(|step| step * 10f64.powi(decade));
                ticks.extend(values.filter(|v| (self.low..=self.high).contains(&v.log10())));
            }
            if ticks.len() <= most {
                break;
            }
        }
        ticks
    }
}

/// Which of a few colours and marks a family has.
#[derive(Clone, Copy, Debug)]
pub(super) struct Families<'a>(pub(super) &'a [String]);

impl Families<'_> {
    pub(super) const COLORS: usize = 8;

    pub(super) fn index(&self, family: &str) -> usize {
        let at = self.0.iter().position(|other| other == family);
        at.unwrap_or(0) % Self::COLORS
    }
}

/// What a plot shows.
pub(super) struct Plot<'a> {
    pub(super) title: &'a str,
    pub(super) x: &'a str,
    pub(super) y: &'a str,
    pub(super) points: &'a [Point],
    pub(super) families: Families<'a>,
    /// Errors below this say nothing.
    pub(super) noise: Option<f64>,
}

/// A place for text.
#[derive(Clone, Copy)]
struct Frame {
    left: f64,
    top: f64,
    right: f64,
    bottom: f64,
}

impl Frame {
    fn overlaps(&self, other: &Self) -> bool {
        self.left < other.right
            && other.left < self.right
            && self.top < other.bottom
            && other.top < self.bottom
    }

    fn is_within(&self, other: &Self) -> bool {
        self.left >= other.left
            && self.right <= other.right
            && self.top >= other.top
            && self.bottom <= other.bottom
    }
}

/// What a plot that stands alone needs of the page's style, on a card of its own.
const ALONE: &str = "\
:root { --card: #ffffff; --ink: #16181d; --dim: #5b616e; --grid: #e7e9ee; --front: #16181d;
  --c0: #0a8573; --c1: #c26a00; --c2: #c2255c; --c3: #1d6fd1; --c4: #7a3fd0; --c5: #6f7d00; --c6: #0086a8; --c7: #8a5a2b; }
@media (prefers-color-scheme: dark) {
  :root { --card: #181b21; --ink: #e8eaee; --dim: #a0a7b4; --grid: #262a33; --front: #e8eaee;
    --c0: #48d1bb; --c1: #ffab4a; --c2: #ff7aa8; --c3: #6cb0ff; --c4: #bd9bff; --c5: #c9d64a; --c6: #4fd0ee; --c7: #d9a877; }
}
svg { background: var(--card); font-family: system-ui, -apple-system, \"Segoe UI\", Roboto, \"DejaVu Sans\", sans-serif; }
.f0 { --c: var(--c0); } .f1 { --c: var(--c1); } .f2 { --c: var(--c2); } .f3 { --c: var(--c3); }
.f4 { --c: var(--c4); } .f5 { --c: var(--c5); } .f6 { --c: var(--c6); } .f7 { --c: var(--c7); }
";

impl Plot<'_> {
    /// As a file of its own, in light and dark.
    pub(super) fn alone(&self) -> String {
        let mut text = String::new();
        self.svg(&mut text, "wide", [720.0, 430.0], 13.0);
        // The part of the page's style sheet that is about plots; what is for narrow pages hides nothing here.
        let page = super::STYLE.lines().filter(|line| {
            let of_plots = [
                ".plot text",
                ".plot .",
                ".grid",
                ".noise",
                ".front",
                ".curve",
                ".range",
                ".leader",
                ".dot",
            ];
            of_plots.iter().any(|start| line.starts_with(start))
        });
        let style: Vec<&str> = page.collect();
        let style = format!("<style>\n{ALONE}{}\n</style>\n", style.join("\n"));
        let text = text.replacen("<svg ", "<svg xmlns=\"http://www.w3.org/2000/svg\" ", 1);
        text.replacen(">\n", &format!(">\n{style}"), 1)
    }

    /// For wide pages and for narrow ones; the style sheet shows one of them.
    pub(super) fn svgs(&self) -> String {
        let mut text = String::new();
        self.svg(&mut text, "wide", [720.0, 430.0], 13.0);
        self.svg(&mut text, "narrow", [330.0, 380.0], 11.0);
        text
    }

    fn svg(&self, text: &mut String, class: &str, [width, height]: [f64; 2], font: f64) {
        let frame = Frame {
            left: 4.4 * font,
            top: 1.2 * font,
            right: width - 0.8 * font,
            bottom: height - 3.6 * font,
        };
        let times = self
            .points
            .iter()
            .flat_map(|p| [p.ms, p.range.0, p.range.1]);
        let x = LogScale::new(times, frame.left, frame.right);
        let errors = self.points.iter().map(|p| p.error);
        // The truth's own error is shown where it matters.
        let least = errors.clone().fold(f64::INFINITY, f64::min);
        let noise = self
            .noise
            .filter(|noise| *noise > 0.0 && *noise > 0.2 * least);
        let y = LogScale::new(errors.chain(noise), frame.bottom, frame.top);

        // Writing to a String cannot fail.
        let mut put = |part: String| {
            let _ = writeln!(text, "{part}");
        };
        put(format!(
            "<svg class=\"plot {class}\" viewBox=\"0 0 {width} {height}\" role=\"img\" \
             aria-label=\"{}\" font-size=\"{font}\">",
            escape(&self.description())
        ));
        self.axes(&mut put, &x, &y, frame, font, width < 400.0);
        if let Some(noise) = noise {
            let at = y.at(noise);
            put(format!(
                "<path class=\"noise\" d=\"M{:.1} {at:.1}H{:.1}\"/><text class=\"hint\" x=\"{:.1}\" \
                 y=\"{:.1}\" text-anchor=\"end\">the truth\u{2019}s own error</text>",
                frame.left,
                frame.right,
                frame.right - 4.0,
                at - 4.0
            ));
        }
        self.lines(&mut put, &x, &y, frame);
        self.marks(&mut put, &x, &y, frame, font);
        put("</svg>".into());
    }

    /// In words, for those who do not see it.
    fn description(&self) -> String {
        let mut text = format!(
            "{}. {} against {}, both logarithmic.",
            self.title, self.y, self.x
        );
        for point in self.points {
            let _ = write!(
                text,
                " {}: {}, {}.",
                point.label,
                ms(point.ms),
                error(point.error)
            );
        }
        text
    }

    fn axes(
        &self,
        put: &mut impl FnMut(String),
        x: &LogScale,
        y: &LogScale,
        frame: Frame,
        font: f64,
        is_narrow: bool,
    ) {
        for tick in x.ticks(if is_narrow { 6 } else { 11 }) {
            let at = x.at(tick);
            put(format!(
                "<path class=\"grid\" d=\"M{at:.1} {:.1}V{:.1}\"/><text x=\"{at:.1}\" y=\"{:.1}\" \
                 text-anchor=\"middle\">{}</text>",
                frame.top,
                frame.bottom,
                frame.bottom + 1.4 * font,
                tick_text(tick)
            ));
        }
        for tick in y.ticks(9) {
            let at = y.at(tick);
            put(format!(
                "<path class=\"grid\" d=\"M{:.1} {at:.1}H{:.1}\"/><text x=\"{:.1}\" y=\"{:.1}\" \
                 text-anchor=\"end\">{}</text>",
                frame.left,
                frame.right,
                frame.left - 6.0,
                at + 0.35 * font,
                tick_text(tick)
            ));
        }
        let middle = 0.5 * (frame.top + frame.bottom);
        put(format!(
            "<text class=\"axis\" x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text>\
             <text class=\"axis\" transform=\"translate({:.1} {middle:.1}) rotate(-90)\" \
             text-anchor=\"middle\">{}</text>",
            0.5 * (frame.left + frame.right),
            frame.bottom + 2.9 * font,
            escape(self.x),
            0.95 * font,
            escape(self.y)
        ));
    }

    /// The front as stairs, and the rays of each rival.
    fn lines(&self, put: &mut impl FnMut(String), x: &LogScale, y: &LogScale, frame: Frame) {
        let front = pareto(self.points);
        let place = |i: usize| (x.at(self.points[i].ms), y.at(self.points[i].error));
        if let (Some(&first), Some(_)) = (front.first(), front.last()) {
            let (left, _) = place(first);
            let mut path = format!("M{left:.1} {:.1}", frame.top);
            for (step, &i) in front.iter().enumerate() {
                let (_, down) = place(i);
                let right = front
                    .get(step + 1)
                    .map_or(frame.right, |&next| place(next).0);
                let _ = write!(path, "V{down:.1}H{right:.1}");
            }
            put(format!(
                "<path class=\"front\" d=\"{path}\"><title>Pareto front: nobody is both faster and closer to the truth</title></path>"
            ));
        }
        for curve in curves(self.points) {
            let family = self.families.index(&curve[0].family);
            let mut path = String::new();
            for (at, point) in curve.iter().enumerate() {
                let letter = if at == 0 { 'M' } else { 'L' };
                let _ = write!(
                    path,
                    "{letter}{:.1} {:.1}",
                    x.at(point.ms),
                    y.at(point.error)
                );
            }
            put(format!("<path class=\"curve f{family}\" d=\"{path}\"/>"));
        }
    }

    fn marks(
        &self,
        put: &mut impl FnMut(String),
        x: &LogScale,
        y: &LogScale,
        frame: Frame,
        font: f64,
    ) {
        let front = pareto(self.points);
        let size = 0.42 * font;
        let places: Vec<(f64, f64)> = (self.points.iter())
            .map(|point| (x.at(point.ms), y.at(point.error)))
            .collect();
        let mut taken: Vec<Frame> = Vec::new();
        for (&(cx, cy), point) in places.iter().zip(self.points) {
            let around = |left: f64, right: f64, size: f64| Frame {
                left: left - size,
                top: cy - size,
                right: right + size,
                bottom: cy + size,
            };
            taken.push(around(cx, cx, size));
            taken.push(around(x.at(point.range.0), x.at(point.range.1), 1.0));
        }
        for (i, point) in self.points.iter().enumerate() {
            let (cx, cy) = places[i];
            let family = self.families.index(&point.family);
            let is_front = if front.contains(&i) { " on-front" } else { "" };
            let (label, spot) = (
                escape(&point.label),
                label_place(&point.label, (cx, cy), frame, font, &taken),
            );
            taken.push(spot);
            let baseline = spot.bottom - 0.28 * font;
            let far = (spot.left - cx)
                .max(cx - spot.right)
                .max(spot.top - cy)
                .max(cy - spot.bottom);
            let leader = if far > 1.2 * font {
                let tx = cx.clamp(spot.left, spot.right);
                let ty = if cy < spot.top { spot.top } else { spot.bottom };
                format!("<path class=\"leader\" d=\"M{cx:.1} {cy:.1}L{tx:.1} {ty:.1}\"/>")
            } else {
                String::new()
            };
            // Text is as wide as its font makes it; it starts or ends next to its mark.
            let (text_x, anchor) = if spot.right <= cx {
                (spot.right, "end")
            } else {
                (spot.left, "start")
            };
            put(format!(
                "<g class=\"mark f{family}{is_front}\" data-technique=\"{label}\">\
                 <title>{label}: {} ms ({} to {}), {} {}</title>{leader}\
                 <path class=\"range\" d=\"M{:.1} {cy:.1}H{:.1}\"/>{}\
                 <text x=\"{text_x:.1}\" y=\"{baseline:.1}\" text-anchor=\"{anchor}\">{label}</text></g>",
                ms(point.ms),
                ms(point.range.0),
                ms(point.range.1),
                escape(self.y),
                error(point.error),
                x.at(point.range.0),
                x.at(point.range.1),
                shape(family, cx, cy, size),
            ));
        }
    }
}

/// A tick's value, without digits that it does not need.
fn tick_text(value: f64) -> String {
    if value < 0.000_95 {
        return format!("{value:.0e}");
    }
    let text = format!("{value:.4}");
    text.trim_end_matches('0').trim_end_matches('.').into()
}

/// Beside, above or below the mark where there is room, else further up or down.
fn label_place(
    label: &str,
    (cx, cy): (f64, f64),
    frame: Frame,
    font: f64,
    taken: &[Frame],
) -> Frame {
    let (width, height) = (
        0.63 * font * label.chars().count() as f64 + 2.0,
        1.15 * font,
    );
    let at = |left: f64, top: f64| Frame {
        left,
        top,
        right: left + width,
        bottom: top + height,
    };
    let gap = 0.65 * font;
    // The front leaves a mark to the right and upwards.
    let mut spots = vec![
        at(cx + 0.5 * gap, cy - 0.75 * gap - height),
        at(cx - gap - width, cy - 0.5 * height),
        at(cx - 0.5 * gap - width, cy + 0.75 * gap),
        at(cx - 0.5 * width, cy + gap),
        at(cx + 0.5 * gap, cy + 0.75 * gap),
        at(cx + gap, cy - 0.5 * height),
        at(cx - 0.5 * width, cy - gap - height),
        at(cx - 0.5 * gap - width, cy - 0.75 * gap - height),
    ];
    for step in 1..14 {
        let away = gap + 0.8 * f64::from(step) * height;
        for left in [cx + gap, cx - gap - width, cx - 0.5 * width] {
            spots.push(at(left, cy - away - 0.5 * height));
            spots.push(at(left, cy + away - 0.5 * height));
        }
    }
    let is_free =
        |spot: &&Frame| spot.is_within(&frame) && taken.iter().all(|other| !other.overlaps(spot));
    let inside = |left: f64| left.clamp(frame.left, (frame.right - width).max(frame.left));
    let last = at(inside(cx - 0.5 * width), cy + gap);
    spots.iter().find(is_free).copied().unwrap_or(last)
}

/// A mark that differs from family to family.
pub(super) fn shape(family: usize, x: f64, y: f64, r: f64) -> String {
    let path = |points: &[(f64, f64)]| {
        let at: Vec<String> = (points.iter())
            .map(|(dx, dy)| format!("{:.1} {:.1}", x + r * dx, y + r * dy))
            .collect();
        format!("<path class=\"dot\" d=\"M{}Z\"/>", at.join("L"))
    };
    match family % 6 {
        0 => format!("<circle class=\"dot\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{r:.1}\"/>"),
        1 => path(&[(-0.9, -0.9), (0.9, -0.9), (0.9, 0.9), (-0.9, 0.9)]),
        2 => path(&[(0.0, -1.2), (1.15, 0.9), (-1.15, 0.9)]),
        3 => path(&[(0.0, -1.3), (1.3, 0.0), (0.0, 1.3), (-1.3, 0.0)]),
        4 => path(&[(0.0, 1.2), (1.15, -0.9), (-1.15, -0.9)]),
        _ => path(&[
            (-0.4, -1.2),
            (0.4, -1.2),
            (0.4, -0.4),
            (1.2, -0.4),
            (1.2, 0.4),
            (0.4, 0.4),
            (0.4, 1.2),
            (-0.4, 1.2),
            (-0.4, 0.4),
            (-1.2, 0.4),
            (-1.2, -0.4),
            (-0.4, -0.4),
        ]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scales_are_logarithmic() {
        let scale = LogScale::new([1.0, 100.0].into_iter(), 0.0, 116.0);
        let place = |value| scale.at(value);
        assert!((place(10.0) - 58.0).abs() < 1e-9);
        assert!((place(100.0) - place(10.0) - (place(10.0) - place(1.0))).abs() < 1e-9);
        assert_eq!(scale.ticks(9), [1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0]);
        assert_eq!(scale.ticks(3), [1.0, 10.0, 100.0]);
        // 0 and what is no number do no harm.
        let odd = LogScale::new([0.0, f64::NAN, 0.1].into_iter(), 10.0, 0.0);
        assert!(odd.at(0.0).is_finite() && odd.at(0.1) < odd.at(0.0));
        let none = LogScale::new([].into_iter(), 0.0, 1.0);
        assert!(none.at(1.0).is_finite());
        let same = LogScale::new([5.0, 5.0].into_iter(), 0.0, 1.0);
        assert!((same.at(5.0) - 0.5).abs() < 1e-9 && !same.ticks(9).is_empty());
    }

    #[test]
    fn ticks_are_short() {
        let texts = [0.000_5, 0.001, 0.3, 1.0, 200.0].map(tick_text);
        assert_eq!(texts, ["5e-4", "0.001", "0.3", "1", "200"]);
    }

    #[test]
    fn every_point_is_marked_and_labelled_once_a_plot() {
        let point = |label: &str, ms: f64, error: f64| Point {
            label: label.into(),
            family: label.into(),
            rays: None,
            ms,
            range: (ms, ms),
            error,
        };
        // All in one place.
        let points: Vec<Point> = (0..9)
            .map(|i| point(&format!("<t{i}>"), 1.0, 0.0))
            .collect();
        let names: Vec<String> = points.iter().map(|p| p.label.clone()).collect();
        let plot = Plot {
            title: "t",
            x: "x",
            y: "y",
            points: &points,
            families: Families(&names),
            noise: Some(0.001),
        };
        let text = plot.svgs();
        for name in &names {
            let attribute = format!("data-technique=\"{}\"", escape(name));
            assert_eq!(text.matches(&attribute).count(), 2, "{name}");
        }
        assert!(!text.contains("<t0>") && !text.contains("NaN") && !text.contains("inf"));
    }

    #[test]
    fn labels_avoid_each_other_while_there_is_room() {
        let frame = Frame {
            left: 0.0,
            top: 0.0,
            right: 400.0,
            bottom: 400.0,
        };
        let mut taken: Vec<Frame> = Vec::new();
        for _ in 0..12 {
            let spot = label_place("some-label", (200.0, 200.0), frame, 12.0, &taken);
            assert!(spot.is_within(&frame));
            assert!(taken.iter().all(|other| !other.overlaps(&spot)));
            taken.push(spot);
        }
    }
}
