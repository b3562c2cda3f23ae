//! The results as data and as JSON.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::capture::output::{Output, OutputError};
use crate::measure::Measures;

/// Of the file; raised whenever a field changes its meaning or goes.
pub const SCHEMA: u32 = 1;

/// All of `results.json`; the fields are described in the [module above](super).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[allow(missing_docs)]
pub struct Results {
    pub schema: u32,
    pub program: String,
    pub machine: Machine,
    pub driver: Option<String>,
    pub settings: Settings,
    pub references: Vec<ReferenceEntry>,
    pub images: Vec<Entry>,
    pub failures: Vec<FailedCell>,
}

/// Where it was measured.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Machine {
    /// Model of the processor, where the system tells.
    pub cpu: Option<String>,
    /// Threads that run at a time.
    pub threads: usize,
    /// Operating system and architecture.
    pub os: String,
}

/// What was measured.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Settings {
    /// Labels of the contenders, in order.
    pub techniques: Vec<String>,
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
    /// Measured rounds.
    pub repeat: u32,
    /// Light samples of the truth at each pixel.
    pub samples: u32,
    /// A cell is not measured again once its rounds took this long together, seconds.
    pub cell_seconds: f64,
    /// The Vulkan device asked for.
    pub device: Option<String>,
    /// Factor on the lights' sizes.
    #[serde(default = "one")]
    pub light_scale: f32,
}

fn one() -> f32 {
    1.0
}

/// The truth for one scene and light.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[allow(missing_docs)]
pub struct ReferenceEntry {
    pub scene: String,
    pub light: String,
    pub light_index: usize,
    /// Shape and size, for people.
    pub light_shape: String,
    pub width: u32,
    pub height: u32,
    pub samples: u32,
    pub standard_error: Option<StandardError>,
    pub valid_pixels: u64,
    pub penumbra_pixels: u64,
    pub rays: u64,
    /// `None` if it was kept from an earlier run.
    pub cast_ms: Option<f64>,
    /// File beside `results.json`.
    pub image: String,
    /// File beside `results.json`: white where a pixel is valid.
    pub valid_image: String,
    /// What the technique `auto` goes by.
    #[serde(default)]
    pub case: Option<CaseEntry>,
}

/// What says how hard a light's shadows are to find: [`Case`](crate::shadow::auto::Case).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[allow(missing_docs)]
pub struct CaseEntry {
    pub angle: f64,
    pub cone: f64,
    pub triangles: f64,
    pub holes: f64,
}

/// Of the truth, over its partly lit pixels.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct StandardError {
    /// Root of the mean variance.
    pub rms: f64,
    /// The largest.
    pub max: f64,
}

/// One cell: one contender on one scene and light.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Entry {
    /// The scene file as named on the command line.
    pub scene: String,
    /// Number of the frame of an animation: always 0.
    pub frame: u64,
    /// The light's name.
    pub light: String,
    /// Its index; names need not be unique.
    pub light_index: usize,
    /// `point`, `disk`, ..
    pub light_shape: String,
    /// Name of the technique or rival.
    pub technique: String,
    /// As asked for on the command line: tells apart what differs in options.
    pub label: String,
    /// Every option with its value.
    pub options: BTreeMap<String, Value>,
    /// What a technique that chooses has chosen, as `--technique` takes it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub chosen: Option<String>,
    /// Device and driver; of a rival `None`.
    pub driver: Option<String>,
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
    /// Rounds that were measured: fewer than asked for if the cell is slow.
    pub repeats: u32,
    /// Wall clock of a whole frame.
    pub frame_ms: Option<Spread>,
    /// Always `None`: no frame reuses anything of an earlier one.
    pub frame_ms_static: Option<Spread>,
    /// The light's visibility alone.
    pub visibility_ms: Option<Spread>,
    /// Passes of the frame, in order, then those left out.
    pub passes: Vec<Pass>,
    /// Before the measured rounds.
    pub setup_ms: Option<Setup>,
    /// The most memory in use; of a rival `None`.
    pub peak_bytes: Option<Peak>,
    /// Counts of things, by name.
    pub counters: BTreeMap<String, u64>,
    /// Whether all rounds gave the same visibility to the last bit.
    pub identical: Option<bool>,
    /// Light samples of the truth.
    pub samples: u32,
    /// Against the truth.
    pub error: Option<Measures>,
    /// Mean visibility over the valid penumbra pixels of the truth; `None` if there are none.
    #[serde(default)]
    pub penumbra_mean: Option<f64>,
    /// Why the cell has no result.
    pub failure: Option<Failure>,
    /// Visibility as a file beside `results.json`.
    pub image: Option<String>,
}

/// One pass of the frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Pass {
    /// Its name.
    pub name: String,
    /// Median time on the device; `None` on one without timestamps.
    pub gpu_ms: Option<f64>,
    /// Why it was left out.
    pub skipped: Option<String>,
    /// Whether it belongs to the light's visibility.
    pub visibility: bool,
}

/// What happens before the measured rounds, milliseconds.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Setup {
    /// Uploading the scene; a rival's hierarchy.
    pub load: f64,
    /// Always `None`: pipelines are made while the first frame is recorded.
    pub pipelines: Option<f64>,
    /// The first frame; a rival has none.
    pub first_frame: Option<f64>,
}

/// The most memory in use at any time.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Peak {
    /// On the device.
    pub device: u64,
    /// For exchange with the host.
    pub host: u64,
}

/// What kind of failure it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum FailureKind {
    /// The technique cannot do the light: no fault.
    Unsupported,
    /// An error, a lost device or a panic.
    Failed,
    /// It took the process with it.
    Crashed,
}

/// Why a cell has no result.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Failure {
    /// Kind.
    pub kind: FailureKind,
    /// One line.
    pub reason: String,
}

/// A cell without a result.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[allow(missing_docs)]
pub struct FailedCell {
    pub scene: String,
    pub light: String,
    pub light_index: usize,
    pub label: String,
    #[serde(flatten)]
    pub failure: Failure,
}

/// Repeated measurements: median, extremes and quartiles.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Spread {
    /// The middle, or the mean of the two in the middle.
    pub median: f64,
    /// Least.
    pub min: f64,
    /// Most.
    pub max: f64,
    /// A quarter of the measurements are below, by linear interpolation.
    pub q1: f64,
    /// A quarter are above.
    pub q3: f64,
}

impl Spread {
    /// To a tenth of a microsecond, below which clocks say nothing. `None` without any finite
    /// sample.
    pub fn of(samples: impl IntoIterator<Item = f64>) -> Option<Self> {
        let mut sorted: Vec<f64> = samples.into_iter().filter(|s| s.is_finite()).collect();
        sorted.sort_by(f64::total_cmp);
        let last = sorted.len().checked_sub(1)?;
        let quantile = |part: f64| {
            let place = part * last as f64;
            let (low, high) = (place.floor() as usize, place.ceil() as usize);
            let value = sorted[low] + (sorted[high] - sorted[low]) * (place - low as f64);
            rounded(value)
        };
        Some(Self {
            median: quantile(0.5),
            min: quantile(0.0),
            max: quantile(1.0),
            q1: quantile(0.25),
            q3: quantile(0.75),
        })
    }
}

/// Milliseconds to a tenth of a microsecond.
pub(super) fn rounded(ms: f64) -> f64 {
    (ms * 1e4).round() / 1e4
}

impl Machine {
    /// This one.
    pub fn this() -> Self {
        let text = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
        let model = text.lines().find_map(|line| {
            let (key, value) = line.split_once(':')?;
            (key.trim() == "model name").then(|| value.trim().to_string())
        });
        Self {
            cpu: model,
            threads: std::thread::available_parallelism().map_or(1, usize::from),
            os: format!("{} {}", std::env::consts::OS, std::env::consts::ARCH),
        }
    }
}

/// Results that cannot be read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ResultsError {
    /// The file cannot be read.
    #[error("{}: cannot read the results: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The file is no results file.
    #[error("{}: no results of this program: {source}; without --resume it is replaced", path.display())]
    Parse {
        /// The file.
        path: PathBuf,
        /// Why.
        source: serde_json::Error,
    },
    /// It is of another schema.
    #[error("{}: schema {found}, and this program goes on with {SCHEMA} only", path.display())]
    Schema {
        /// The file.
        path: PathBuf,
        /// Its schema.
        found: u64,
    },
    /// It was measured with other settings.
    #[error("{}: measured with other settings ({what}); give the same, or leave out --resume", path.display())]
    Settings {
        /// The file.
        path: PathBuf,
        /// What differs.
        what: String,
    },
    /// It cannot be turned into JSON.
    #[error("cannot encode the results: {0}")]
    Encode(serde_json::Error),
    /// It cannot be written.
    #[error(transparent)]
    Write(#[from] OutputError),
}

impl Results {
    /// Nothing measured so far.
    pub fn new(settings: Settings) -> Self {
        Self {
            schema: SCHEMA,
            program: concat!("antumbra ", env!("CARGO_PKG_VERSION")).into(),
            machine: Machine::this(),
            driver: None,
            settings,
            references: Vec::new(),
            images: Vec::new(),
            failures: Vec::new(),
        }
    }

    /// Reads a file.
    ///
    /// # Errors
    /// [`ResultsError::Read`], [`ResultsError::Parse`] or [`ResultsError::Schema`].
    pub fn read(path: &Path) -> Result<Self, ResultsError> {
        let bytes = std::fs::read(path).map_err(|source| ResultsError::Read {
            path: path.into(),
            source,
        })?;
        let fault = |source| ResultsError::Parse {
            path: path.into(),
            source,
        };
        let value: Value = serde_json::from_slice(&bytes).map_err(fault)?;
        match value["schema"].as_u64() {
            Some(found) if found != u64::from(SCHEMA) => Err(ResultsError::Schema {
                path: path.into(),
                found,
            }),
            _ => serde_json::from_value(value).map_err(fault),
        }
    }

    /// Writes it; the file appears whole or not at all.
    ///
    /// # Errors
    /// [`ResultsError::Encode`] or [`ResultsError::Write`].
    pub fn write(&self, path: &Path) -> Result<(), ResultsError> {
        let mut bytes = serde_json::to_vec_pretty(self).map_err(ResultsError::Encode)?;
        bytes.push(b'\n');
        Ok(Output::File(path.into()).write(&bytes)?)
    }

    /// The entries of one scene and light, in the order of the contenders.
    pub fn group(&self, reference: &ReferenceEntry) -> Vec<&Entry> {
        let same = |entry: &&Entry| {
            entry.scene == reference.scene && entry.light_index == reference.light_index
        };
        self.images.iter().filter(same).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spreads_have_quartiles() {
        assert_eq!(Spread::of([]), None);
        assert_eq!(Spread::of([f64::NAN]), None);
        let of = |samples: &[f64]| {
            let s = Spread::of(samples.iter().copied());
            s.map(|s| [s.min, s.q1, s.median, s.q3, s.max])
        };
        assert_eq!(of(&[3.0]), Some([3.0; 5]));
        assert_eq!(
            of(&[9.0, 1.0, 2.0, 4.0, 3.0]),
            Some([1.0, 2.0, 3.0, 4.0, 9.0])
        );
        assert_eq!(of(&[4.0, 1.0]), Some([1.0, 1.75, 2.5, 3.25, 4.0]));
        assert_eq!(of(&[0.123_456]), Some([0.1235; 5]));
    }
}
