//! The report of a capture: timings, memory and counters as JSON, schema 1.
//!
//! Times are milliseconds, memory bytes. `frame_ms` is host wall clock, `gpu_ms` and
//! `visibility_ms` come from the device's timestamps and are `null` on a device without them.
//! `visibility_ms` adds up the passes that make one light's visibility, frame by frame. A pass that
//! was left out has `gpu_ms` 0 and the reason in `skipped`. `setup_ms.load` is reading the scene
//! and uploading it; `setup_ms.pipelines` is `null`, because pipelines are made while the first
//! frame is recorded and count in `setup_ms.first_frame`. `frame_ms_static` is `frame_ms` of frames
//! that use again what the technique made in an earlier one.

use std::collections::BTreeMap;

use serde::Serialize;
use serde_json::Value;

use crate::capture::CapturedFrame;

/// A whole report.
#[derive(Debug, Serialize)]
pub(super) struct Report {
    schema: u32,
    images: Vec<ImageEntry>,
}

/// One frame and light.
#[derive(Clone, Debug, Serialize)]
pub(super) struct ImageEntry {
    /// The scene file as named on the command line.
    pub(super) scene: String,
    /// Number of the frame of an animation.
    pub(super) frame: u64,
    /// Name of the light.
    pub(super) light: String,
    pub(super) technique: &'static str,
    pub(super) options: BTreeMap<String, Value>,
    /// With a technique that chooses: `technique` and `options` are what was chosen.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) chosen: Option<ChosenEntry>,
    /// Device and driver.
    pub(super) driver: String,
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) frame_ms: Option<Spread>,
    pub(super) frame_ms_static: Option<Spread>,
    pub(super) visibility_ms: Option<Spread>,
    pub(super) passes: Vec<PassEntry>,
    pub(super) setup_ms: SetupTimes,
    pub(super) peak_bytes: PeakBytes,
    pub(super) counters: BTreeMap<String, u64>,
    /// What the counters say about how far the result is to be trusted.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) remark: Option<String>,
    /// With `--visibility-bound`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) bound: Option<BoundEntry>,
}

/// Why a light has the technique that it has.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct ChosenEntry {
    /// The technique that was asked for.
    pub(super) by: &'static str,
    /// What `--technique` takes to do the same again.
    pub(super) spec: String,
    pub(super) reason: String,
    /// By the table of measured times and errors.
    #[serde(serialize_with = "rounded_option")]
    pub(super) expected_rmse: Option<f64>,
    #[serde(serialize_with = "rounded_option")]
    pub(super) expected_ms: Option<f64>,
}

/// The proven bound on the error of the visibility, over all pixels.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(super) struct BoundEntry {
    pub(super) max: f32,
    /// What 99 of 100 pixels are not above.
    pub(super) p99: f32,
}

impl BoundEntry {
    /// `None` of no pixels.
    pub(super) fn of(bounds: &[f32]) -> Option<Self> {
        let mut sorted = bounds.to_vec();
        sorted.sort_by(f32::total_cmp);
        let p99 = *sorted.get((sorted.len() * 99).div_ceil(100).saturating_sub(1))?;
        let max = *sorted.last()?;
        Some(Self { max, p99 })
    }
}

/// Median and extremes of repeated measurements.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(super) struct Spread {
    #[serde(serialize_with = "rounded")]
    pub(super) median: f64,
    #[serde(serialize_with = "rounded")]
    pub(super) min: f64,
    #[serde(serialize_with = "rounded")]
    pub(super) max: f64,
}

/// One pass of the frame.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct PassEntry {
    pub(super) name: String,
    #[serde(serialize_with = "rounded_option")]
    pub(super) gpu_ms: Option<f64>,
    pub(super) skipped: Option<String>,
}

/// What happens before the first measured frame.
#[derive(Clone, Copy, Debug, Serialize)]
pub(super) struct SetupTimes {
    #[serde(serialize_with = "rounded")]
    pub(super) load: f64,
    #[serde(serialize_with = "rounded_option")]
    pub(super) pipelines: Option<f64>,
    #[serde(serialize_with = "rounded")]
    pub(super) first_frame: f64,
}

/// The most memory in use at any time.
#[derive(Clone, Copy, Debug, Serialize)]
pub(super) struct PeakBytes {
    pub(super) device: u64,
    pub(super) host: u64,
}

impl Report {
    pub(super) fn new(images: Vec<ImageEntry>) -> Self {
        Self { schema: 1, images }
    }

    pub(super) fn to_json(&self) -> Result<Vec<u8>, serde_json::Error> {
        let mut bytes = serde_json::to_vec_pretty(self)?;
        bytes.push(b'\n');
        Ok(bytes)
    }
}

/// To a tenth of a microsecond: below that clocks and timestamps say nothing.
fn rounded<S: serde::Serializer>(ms: &f64, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_f64((ms * 1e4).round() / 1e4)
}

fn rounded_option<S: serde::Serializer>(
    ms: &Option<f64>,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    match ms {
        Some(ms) => rounded(ms, serializer),
        None => serializer.serialize_none(),
    }
}

impl Spread {
    /// `None` without any finite sample.
    pub(super) fn of(samples: impl IntoIterator<Item = f64>) -> Option<Self> {
        let mut sorted: Vec<f64> = samples.into_iter().filter(|s| s.is_finite()).collect();
        sorted.sort_by(f64::total_cmp);
        let middle = sorted.len() / 2;
        let upper = *sorted.get(middle)?;
        let median = if sorted.len() % 2 == 1 {
            upper
        } else {
            0.5 * (sorted[middle - 1] + upper)
        };
        let (min, max) = (*sorted.first()?, *sorted.last()?);
        Some(Self { median, min, max })
    }
}

/// The timings of the measured frames.
#[derive(Debug, Default)]
pub(super) struct Measurements {
    frame_ms: Vec<f64>,
    /// For each frame: each pass and its time on the device.
    passes: Vec<Vec<(String, f64)>>,
}

impl Measurements {
    pub(super) fn add(&mut self, frame: &CapturedFrame) {
        self.frame_ms.push(frame.frame_ms);
        self.passes.push(frame.passes.clone());
    }

    pub(super) fn frame(&self) -> Option<Spread> {
        Spread::of(self.frame_ms.iter().copied())
    }

    /// The passes of `names` together, frame by frame.
    pub(super) fn sum_of(&self, names: &[String]) -> Option<Spread> {
        let mut sums = Vec::new();
        for frame in &self.passes {
            let mut timed = frame.iter().filter(|(name, _)| names.contains(name));
            if let Some((_, first)) = timed.next() {
                sums.push(timed.fold(*first, |sum, (_, ms)| sum + ms));
            }
        }
        Spread::of(sums)
    }

    /// All passes of the frame in order, then those that were left out.
    pub(super) fn passes(&self, frame: &CapturedFrame) -> Vec<PassEntry> {
        let timed: Vec<String> = frame.passes.iter().map(|(name, _)| name.clone()).collect();
        // Without timestamps only what was recorded is known.
        let names = if timed.is_empty() {
            &frame.report.passes
        } else {
            &timed
        };
        let ran = names.iter().enumerate().map(|(at, name)| {
            // Passes may share a name; then their order tells them apart.
            let earlier = names[..at].iter().filter(|other| *other == name).count();
            let times = self.passes.iter().filter_map(|frame| {
                let mut same = frame.iter().filter(|(other, _)| other == name);
                same.nth(earlier).map(|(_, ms)| *ms)
            });
            PassEntry {
                name: name.clone(),
                gpu_ms: Spread::of(times).map(|spread| spread.median),
                skipped: None,
            }
        });
        let skipped = frame.plan.culled.iter().map(|pass| PassEntry {
            name: pass.name.to_string(),
            gpu_ms: Some(0.0),
            skipped: Some(pass.reason.clone()),
        });
        ran.chain(skipped).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spreads() {
        let spread = |samples: &[f64]| Spread::of(samples.iter().copied());
        let of = |median, min, max| Some(Spread { median, min, max });
        assert_eq!(spread(&[]), None);
        assert_eq!(spread(&[f64::NAN]), None);
        assert_eq!(spread(&[3.0]), of(3.0, 3.0, 3.0));
        assert_eq!(spread(&[9.0, 1.0, 2.0]), of(2.0, 1.0, 9.0));
        assert_eq!(spread(&[4.0, 1.0, 2.0, 9.0]), of(3.0, 1.0, 9.0));
    }

    #[test]
    fn a_lights_passes_add_up_frame_by_frame() {
        let frame = |a: f64, b: f64| {
            let pass = |name: &str, ms| (name.to_string(), ms);
            vec![pass("a", a), pass("b", b), pass("other", 100.0)]
        };
        let measured = Measurements {
            frame_ms: vec![],
            passes: vec![frame(1.0, 5.0), frame(3.0, 1.0), frame(2.0, 3.0)],
        };
        let names = ["a", "b"].map(String::from);
        let wanted = Spread {
            median: 5.0,
            min: 4.0,
            max: 6.0,
        };
        assert_eq!(measured.sum_of(&names), Some(wanted));
        assert_eq!(measured.sum_of(&["none".to_string()]), None);
    }

    #[test]
    fn times_are_rounded_and_missing_ones_null() -> Result<(), serde_json::Error> {
        let pass = PassEntry {
            name: "p".into(),
            gpu_ms: Some(0.123_456),
            skipped: None,
        };
        let json = serde_json::to_string(&pass)?;
        assert_eq!(json, r#"{"name":"p","gpu_ms":0.1235,"skipped":null}"#);
        Ok(())
    }
}
