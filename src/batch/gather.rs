//! The records of all shards as one `results.json`.
//!
//! | field | what |
//! |---|---|
//! | `schema` | 1; raised whenever a field changes its meaning or goes |
//! | `kind` | `batch` |
//! | `program`, `driver` | of all items |
//! | `items` | their number |
//! | `images` | one entry an item and light, in the order of the list: the fields of `capture`'s report, `item` (its name) and `files` (`path`, `bytes`, `sha256`) |
//! | `failures` | items that the technique cannot do: `item`, `kind` (`unsupported`), `reason` |

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use rayon::prelude::*;
use serde::Deserialize;
use serde_json::{Map, Value, json};

use super::record::Record;
use crate::bench::FailureKind;

/// What depends on the run and not on the item: times and memory, and the pipelines that happened
/// to be made in it.
const OF_THE_RUN: [&str; 10] = [
    "frame_ms",
    "frame_ms_static",
    "visibility_ms",
    "gpu_ms",
    "setup_ms",
    "peak_bytes",
    "cast_ms",
    "pipelines_created",
    "transient_bytes",
    "transient_bytes_unaliased",
];

/// All items, in order.
#[derive(Debug)]
pub struct Gathered {
    /// One each.
    pub items: Vec<Found>,
}

/// An item and its record.
#[derive(Debug)]
pub struct Found {
    /// Its name.
    pub id: String,
    /// Place of its folder among those given.
    pub folder: usize,
    /// What is known of it.
    pub record: Record,
}

/// Why there is no result.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)]
pub enum GatherError {
    #[error("{}: no list of items there: {reason}; name the --out of `antumbra batch` or `bench`", path.display())]
    List { path: PathBuf, reason: String },
    #[error("{} and {}: results of different jobs", one.display(), other.display())]
    Differ { one: PathBuf, other: PathBuf },
    /// Missing and failed ones, each as a line of text.
    #[error("{} of {all} are missing or failed, the first: {}", faults.len(), faults[0])]
    Faults { all: usize, faults: Vec<String> },
    #[error(
        "{what} `{one}` made some and `{other}` others, such as {item}; run the batch again with one of them"
    )]
    Mixed {
        what: &'static str,
        one: String,
        other: String,
        item: String,
    },
}

/// `list.json` of a batch.
#[derive(Deserialize)]
struct Contents {
    kind: String,
    sequences: Vec<SequenceEntry>,
}

#[derive(Deserialize)]
struct SequenceEntry {
    name: String,
    frames: [u32; 2],
}

impl Gathered {
    /// Finds the record of every item in one of the folders, and checks that its files are what the
    /// record says.
    ///
    /// # Errors
    /// [`GatherError`]: the folders are of different jobs, items are missing or failed, or were not
    /// made from the same.
    pub fn new(folders: &[PathBuf]) -> Result<Self, GatherError> {
        let ids = ids(folders)?;
        let all = ids.len();
        let found: Vec<Result<Found, String>> =
            ids.into_par_iter().map(|id| find(folders, id)).collect();
        let faults: Vec<String> = found
            .iter()
            .filter_map(|f| f.as_ref().err().cloned())
            .collect();
        if !faults.is_empty() {
            return Err(GatherError::Faults { all, faults });
        }
        let gathered = Self {
            items: found.into_iter().flatten().collect(),
        };
        gathered.check_origin()?;
        Ok(gathered)
    }

    /// One program, one driver, and of each scene one content.
    fn check_origin(&self) -> Result<(), GatherError> {
        let mut scenes: BTreeMap<&str, &str> = BTreeMap::new();
        let (mut program, mut driver) = (None, None);
        for Found { id, record, .. } in &self.items {
            let scene = record
                .images
                .first()
                .and_then(|entry| entry["scene"].as_str());
            let same_scene =
                scene.map(|scene| *scenes.entry(scene).or_insert(&record.scene_sha256));
            let known_driver = record.driver.as_deref();
            let first_driver = match (driver, known_driver) {
                (None, _) => known_driver,
                (kept, _) => kept,
            };
            driver = first_driver;
            let pairs = [
                (
                    "program",
                    Some(*program.get_or_insert(&*record.program)),
                    Some(&*record.program),
                ),
                ("driver", first_driver, known_driver.or(first_driver)),
                (
                    "scene content",
                    same_scene,
                    same_scene.and(Some(&*record.scene_sha256)),
                ),
            ];
            if let Some((what, one, other)) = pairs.into_iter().find(|(_, one, other)| one != other)
            {
                let text = |text: Option<&str>| text.unwrap_or_default().to_string();
                let (one, other, item) = (text(one), text(other), id.clone());
                return Err(GatherError::Mixed {
                    what,
                    one,
                    other,
                    item,
                });
            }
        }
        Ok(())
    }

    /// `results.json`.
    pub fn results(&self) -> Value {
        let first = |of: &dyn Fn(&Record) -> Option<String>| {
            self.items.iter().find_map(|found| of(&found.record))
        };
        let images = self.items.iter().flat_map(|Found { id, record, .. }| {
            record.images.iter().map(move |entry| {
                let mut entry = entry.as_object().cloned().unwrap_or_else(Map::new);
                entry.insert("item".into(), json!(id));
                entry.insert("files".into(), json!(record.files));
                Value::Object(entry)
            })
        });
        let failures = self.items.iter().filter_map(|Found { id, record, .. }| {
            let failure = record.failure.as_ref()?;
            Some(json!({ "item": id, "kind": failure.kind, "reason": failure.reason }))
        });
        json!({
            "schema": 1,
            "kind": "batch",
            "program": first(&|record| Some(record.program.clone())),
            "driver": first(&|record| record.driver.clone()),
            "items": self.items.len(),
            "images": images.collect::<Vec<_>>(),
            "failures": failures.collect::<Vec<_>>(),
        })
    }
}

/// Leaves out times, memory and what else depends on the run, wherever it is.
pub fn without_timings(value: &mut Value) {
    match value {
        Value::Object(map) => {
            map.retain(|key, _| !OF_THE_RUN.contains(&key.as_str()));
            map.values_mut().for_each(without_timings);
        }
        Value::Array(list) => list.iter_mut().for_each(without_timings),
        _ => {}
    }
}

/// The names of all items; the folders have to agree.
fn ids(folders: &[PathBuf]) -> Result<Vec<String>, GatherError> {
    let mut first: Option<(&Path, Vec<u8>)> = None;
    for folder in folders {
        let fault = |reason: String| GatherError::List {
            path: folder.clone(),
            reason,
        };
        let bytes = fs::read(folder.join("list.json")).map_err(|error| fault(error.to_string()))?;
        match &first {
            None => first = Some((folder, bytes)),
            Some((one, kept)) if *kept != bytes => {
                let (one, other) = (one.to_path_buf(), folder.clone());
                return Err(GatherError::Differ { one, other });
            }
            Some(_) => {}
        }
    }
    let Some((folder, bytes)) = first else {
        return Ok(Vec::new());
    };
    let fault = |reason: String| GatherError::List {
        path: folder.into(),
        reason,
    };
    let contents: Contents =
        serde_json::from_slice(&bytes).map_err(|error| fault(error.to_string()))?;
    if contents.kind != "batch" {
        return Err(fault(format!("it is of kind `{}`", contents.kind)));
    }
    let ids = contents.sequences.iter().flat_map(|sequence| {
        let [first, end] = sequence.frames;
        (first..end).map(|frame| format!("{}/{frame:04}", sequence.name))
    });
    Ok(ids.collect())
}

/// The item in the first folder that has it whole, else what is wrong with it.
fn find(folders: &[PathBuf], id: String) -> Result<Found, String> {
    let mut fault = None;
    for (at, folder) in folders.iter().enumerate() {
        let Some(record) = Record::read(folder, &id) else {
            continue;
        };
        let failure =
            (record.failure.as_ref()).filter(|failure| failure.kind != FailureKind::Unsupported);
        if let Some(failure) = failure {
            fault = Some(format!("{id}: failed: {}", failure.reason));
            continue;
        }
        match record.files.iter().find(|file| !file.is_right(folder)) {
            Some(file) => fault = Some(format!("{id}: {} is missing or broken", file.path)),
            None => {
                return Ok(Found {
                    id,
                    folder: at,
                    record,
                });
            }
        }
    }
    Err(fault.unwrap_or_else(|| format!("{id}: missing")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_depends_on_the_run_is_left_out() {
        let mut value = json!({
            "images": [{ "frame_ms": { "median": 1.0 }, "frame": 3, "passes": [{ "gpu_ms": 1, "name": "p" }],
                "counters": { "barriers": 4, "pipelines_created": 2, "transient_bytes": 5 } }],
            "references": [{ "cast_ms": 3, "rays": 7 }],
        });
        without_timings(&mut value);
        let wanted = json!({
            "images": [{ "frame": 3, "passes": [{ "name": "p" }], "counters": { "barriers": 4 } }],
            "references": [{ "rays": 7 }],
        });
        assert_eq!(value, wanted);
    }
}
