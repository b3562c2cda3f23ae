//! Who is fast and who is right: fronts, equal times, equal errors, means over scenes.

use crate::bench::results::{Entry, ReferenceEntry, Results};

/// A contender in the plane of time and error.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Point {
    pub(super) label: String,
    /// Technique or rival.
    pub(super) family: String,
    /// Rays a pixel of a rival that casts as many everywhere.
    pub(super) rays: Option<u64>,
    /// Milliseconds: median, least, most.
    pub(super) ms: f64,
    pub(super) range: (f64, f64),
    pub(super) error: f64,
}

/// The error that a scene is judged by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Metric {
    Penumbra,
    /// Where the truth has no penumbra.
    Valid,
}

impl Metric {
    pub(super) fn of(reference: &ReferenceEntry) -> Self {
        match reference.penumbra_pixels {
            0 => Self::Valid,
            _ => Self::Penumbra,
        }
    }

    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Penumbra => "penumbra RMSE",
            Self::Valid => "RMSE",
        }
    }

    pub(super) fn rmse(self, entry: &Entry) -> Option<f64> {
        let error = entry.error?;
        Some(match self {
            Self::Penumbra => error.penumbra.rmse,
            Self::Valid => error.valid.rmse,
        })
    }
}

/// Those entries that have both time and error.
pub(super) fn points(entries: &[&Entry], metric: Metric) -> Vec<Point> {
    let points = entries.iter().filter_map(|entry| {
        let time = entry.visibility_ms.filter(|_| entry.failure.is_none())?;
        let plain = entry.driver.is_none() && !entry.options.contains_key("more_rays");
        let rays = entry.options.get("rays").filter(|_| plain);
        Some(Point {
            label: entry.label.clone(),
            family: entry.technique.clone(),
            rays: rays.and_then(|rays| rays.as_u64()),
            ms: time.median,
            range: (time.min, time.max),
            error: metric.rmse(entry)?,
        })
    });
    points.collect()
}

/// Indices of the points that none beats in both, fastest first.
pub(super) fn pareto(points: &[Point]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..points.len()).collect();
    let key = |&i: &usize| (points[i].ms, points[i].error);
    order.sort_by(|a, b| {
        let (a, b) = (key(a), key(b));
        a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1))
    });
    let mut best = f64::INFINITY;
    order.retain(|&i| {
        let is_better = points[i].error < best;
        best = best.min(points[i].error);
        is_better
    });
    order
}

/// A value on a measured curve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Estimate {
    /// Between two measurements.
    Value(f64),
    /// Before the first: more than this.
    Above(f64),
    /// After the last: less than this.
    Below(f64),
}

/// The rays of each rival, as curves from few to many.
pub(super) fn curves(points: &[Point]) -> Vec<Vec<&Point>> {
    let mut curves: Vec<Vec<&Point>> = Vec::new();
    for point in points.iter().filter(|point| point.rays.is_some()) {
        match curves
            .iter_mut()
            .find(|curve| curve[0].family == point.family)
        {
            Some(curve) => curve.push(point),
            None => curves.push(vec![point]),
        }
    }
    for curve in &mut curves {
        curve.sort_by_key(|point| point.rays);
    }
    curves
}

/// The least error that any curve reaches in that time; `None` if all take longer.
pub(super) fn error_in(curves: &[Vec<&Point>], ms: f64) -> Option<Estimate> {
    let of = |curve: &Vec<&Point>| {
        let (first, last) = (curve.first()?, curve.last()?);
        if ms < first.ms {
            None
        } else if ms >= last.ms {
            let exact = ms == last.ms;
            Some(if exact {
                Estimate::Value(last.error)
            } else {
                Estimate::Below(last.error)
            })
        } else {
            let pairs = curve
                .windows(2)
                .find(|pair| (pair[0].ms..pair[1].ms).contains(&ms))?;
            let value = between(
                ms,
                [pairs[0].ms, pairs[1].ms],
                [pairs[0].error, pairs[1].error],
            );
            Some(Estimate::Value(value))
        }
    };
    least(curves.iter().filter_map(of))
}

/// The least time in which any curve reaches that error.
pub(super) fn ms_for(curves: &[Vec<&Point>], error: f64) -> Option<Estimate> {
    let of = |curve: &Vec<&Point>| {
        let (first, last) = (curve.first()?, curve.last()?);
        if error >= first.error {
            let exact = error == first.error;
            return Some(if exact {
                Estimate::Value(first.ms)
            } else {
                Estimate::Below(first.ms)
            });
        }
        let reached = curve.windows(2).find(|pair| pair[1].error <= error);
        Some(match reached {
            None => Estimate::Above(last.ms),
            Some(pair) => {
                let errors = [pair[0].error, pair[1].error];
                Estimate::Value(between(error, errors, [pair[0].ms, pair[1].ms]))
            }
        })
    };
    least(curves.iter().filter_map(of))
}

/// The least value; a bound from above only if there is nothing else.
fn least(estimates: impl Iterator<Item = Estimate>) -> Option<Estimate> {
    estimates.min_by(|a, b| {
        let key = |estimate: &Estimate| match *estimate {
            Estimate::Value(value) | Estimate::Below(value) => (0, value),
            Estimate::Above(value) => (1, value),
        };
        let (a, b) = (key(a), key(b));
        a.0.cmp(&b.0).then(a.1.total_cmp(&b.1))
    })
}

/// Linear in the logarithms of both.
fn between(x: f64, xs: [f64; 2], ys: [f64; 2]) -> f64 {
    // What was measured is not rounded.
    if let Some(end) = xs.iter().position(|end| *end == x) {
        return ys[end];
    }
    let log = |v: f64| v.max(1e-9).ln();
    let part = (log(x) - log(xs[0])) / (log(xs[1]) - log(xs[0]));
    let y = log(ys[0]) + part.clamp(0.0, 1.0) * (log(ys[1]) - log(ys[0]));
    y.exp()
}

/// Of the others that take no longer, the one with the least error.
pub(super) fn best_in_time<'p>(points: &'p [Point], point: &Point) -> Option<&'p Point> {
    let others = points
        .iter()
        .filter(|p| p.label != point.label && p.ms <= point.ms);
    others.min_by(|a, b| a.error.total_cmp(&b.error))
}

/// Of the others with no more error, the fastest.
pub(super) fn fastest_as_good<'p>(points: &'p [Point], point: &Point) -> Option<&'p Point> {
    let others = points
        .iter()
        .filter(|p| p.label != point.label && p.error <= point.error);
    others.min_by(|a, b| a.ms.total_cmp(&b.ms))
}

/// A contender over all scenes and lights.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Overall {
    pub(super) label: String,
    pub(super) family: String,
    pub(super) rays: Option<u64>,
    /// Geometric mean of its time over that of the base, where both have one.
    pub(super) time_ratio: Option<f64>,
    /// Geometric mean of its times, milliseconds.
    pub(super) ms: Option<f64>,
    /// Mean over scenes with penumbra.
    pub(super) rmse: Option<f64>,
    pub(super) bias: Option<f64>,
    pub(super) p99: Option<f64>,
    /// The largest penumbra RMSE and where.
    pub(super) worst: Option<(f64, usize)>,
    pub(super) measured: usize,
    pub(super) failed: usize,
    pub(super) unsupported: usize,
}

/// The contender that times are related to: `hard`, else the first.
pub(super) fn base(results: &Results) -> &str {
    let labels = &results.settings.techniques;
    let hard = labels.iter().find(|label| *label == "hard");
    hard.or(labels.first())
        .map(String::as_str)
        .unwrap_or_default()
}

/// All contenders over all scenes, in order. Worst cases name a place in `references`.
pub(super) fn overall(results: &Results) -> Vec<Overall> {
    let base = base(results);
    let labels = results.settings.techniques.iter();
    let of = |label: &String| {
        let mut all = Overall {
            label: label.clone(),
            ..Default::default()
        };
        let (mut ratios, mut times, mut rmse, mut bias, mut p99) =
            (vec![], vec![], vec![], vec![], vec![]);
        for entry in results.images.iter().filter(|entry| entry.label == *label) {
            all.family.clone_from(&entry.technique);
            if let Some(failure) = &entry.failure {
                match failure.kind {
                    crate::bench::FailureKind::Unsupported => all.unsupported += 1,
                    _ => all.failed += 1,
                }
                continue;
            }
            all.measured += 1;
            let of_group = |other: &&Entry| {
                other.scene == entry.scene && other.light_index == entry.light_index
            };
            let group: Vec<&Entry> = results.images.iter().filter(of_group).collect();
            if let Some(point) = points(&[entry], Metric::Penumbra).pop() {
                all.rays = point.rays;
                times.push(point.ms);
                let base = group.iter().find(|other| other.label == base);
                let base_ms = base.and_then(|base| base.visibility_ms).map(|ms| ms.median);
                ratios.extend(base_ms.map(|base_ms| point.ms / base_ms));
            }
            let Some(error) = entry.error.filter(|error| error.penumbra.pixels > 0) else {
                continue;
            };
            rmse.push(error.penumbra.rmse);
            bias.push(error.penumbra.bias);
            p99.push(error.penumbra.p99);
            let at = results.references.iter().position(|reference| {
                reference.scene == entry.scene && reference.light_index == entry.light_index
            });
            if let Some(at) = at
                && all
                    .worst
                    .is_none_or(|(worst, _)| error.penumbra.rmse > worst)
            {
                all.worst = Some((error.penumbra.rmse, at));
            }
        }
        all.time_ratio = geometric_mean(&ratios);
        all.ms = geometric_mean(&times);
        (all.rmse, all.bias, all.p99) = (mean(&rmse), mean(&bias), mean(&p99));
        all
    };
    labels.map(of).collect()
}

fn mean(values: &[f64]) -> Option<f64> {
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

/// Of values above 0; others are left out.
fn geometric_mean(values: &[f64]) -> Option<f64> {
    let logs: Vec<f64> = (values.iter())
        .filter(|value| **value > 0.0 && value.is_finite())
        .map(|value| value.ln())
        .collect();
    mean(&logs).map(f64::exp)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(label: &str, ms: f64, error: f64) -> Point {
        let (family, rays) = label.split_once(':').unwrap_or((label, ""));
        Point {
            label: label.into(),
            family: family.into(),
            rays: rays.parse().ok(),
            ms,
            range: (ms, ms),
            error,
        }
    }

    fn some() -> Vec<Point> {
        vec![
            point("hard", 1.0, 0.4),
            point("pcss", 4.0, 0.1),
            point("pcf", 3.0, 0.5),
            point("rays:16", 40.0, 0.05),
            point("rays:1", 10.0, 0.2),
            point("rays:4", 20.0, 0.1),
        ]
    }

    #[test]
    fn nobody_beats_the_front() {
        let points = some();
        let labels: Vec<&str> = (pareto(&points).into_iter())
            .map(|i| points[i].label.as_str())
            .collect();
        assert_eq!(labels, ["hard", "pcss", "rays:16"]);
        // Of equals the first one alone.
        let equal = [
            point("a", 1.0, 0.5),
            point("b", 1.0, 0.5),
            point("c", 1.0, 0.4),
        ];
        assert_eq!(pareto(&equal), [2]);
        assert!(pareto(&[]).is_empty());
    }

    #[test]
    fn curves_tell_errors_and_times() {
        let points = some();
        let curves = curves(&points);
        assert_eq!(curves.len(), 1);
        let rays: Vec<_> = curves[0].iter().map(|p| p.rays).collect();
        assert_eq!(rays, [Some(1), Some(4), Some(16)]);
        let close = |found: Option<Estimate>, wanted: f64| match found {
            Some(Estimate::Value(value)) => assert!((value - wanted).abs() < 1e-9, "{value}"),
            other => panic!("{other:?}"),
        };
        assert_eq!(error_in(&curves, 9.0), None);
        assert_eq!(error_in(&curves, 50.0), Some(Estimate::Below(0.05)));
        close(error_in(&curves, 20.0), 0.1);
        close(error_in(&curves, 40.0), 0.05);
        close(error_in(&curves, 200f64.sqrt()), 0.02f64.sqrt());
        assert_eq!(ms_for(&curves, 0.4), Some(Estimate::Below(10.0)));
        assert_eq!(ms_for(&curves, 0.01), Some(Estimate::Above(40.0)));
        close(ms_for(&curves, 0.1), 20.0);
        close(ms_for(&curves, 0.005f64.sqrt()), 800f64.sqrt());
        assert_eq!(ms_for(&[], 0.1), None);
    }

    #[test]
    fn the_faster_of_two_tracers_counts() {
        let mut points = some();
        points.extend([point("embree:1", 5.0, 0.2), point("embree:4", 10.0, 0.1)]);
        let curves = curves(&points);
        assert_eq!(ms_for(&curves, 0.1), Some(Estimate::Value(10.0)));
        assert_eq!(ms_for(&curves, 0.05), Some(Estimate::Value(40.0)));
        assert_eq!(error_in(&curves, 10.0), Some(Estimate::Value(0.1)));
    }

    #[test]
    fn equal_time_and_equal_error() {
        let points = some();
        let find = |label: &str| points.iter().find(|p| p.label == label);
        let label = |point: Option<&Point>| point.map(|p| p.label.clone()).unwrap_or_default();
        let of = |name: &str| {
            let point = find(name).unwrap_or(&points[0]);
            let best = label(best_in_time(&points, point));
            (best, label(fastest_as_good(&points, point)))
        };
        assert_eq!(of("pcf"), ("hard".into(), "hard".into()));
        assert_eq!(of("hard"), (String::new(), "pcss".into()));
        assert_eq!(of("pcss"), ("hard".into(), "rays:4".into()));
        assert_eq!(of("rays:4"), ("pcss".into(), "pcss".into()));
    }

    #[test]
    fn means() {
        assert_eq!(geometric_mean(&[]), None);
        assert!(geometric_mean(&[1.0, 4.0, 0.0]).is_some_and(|m| (m - 2.0).abs() < 1e-12));
        assert_eq!(mean(&[1.0, 4.0]), Some(2.5));
    }
}
