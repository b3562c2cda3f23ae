//! The results of a benchmark's shards as one.

use std::fs;
use std::path::{Path, PathBuf};

use serde::Deserialize;

use super::results::{FailureKind, Results, ResultsError};
use super::session::difference;

/// A shard's folder: its `list.json` says what all shards are to measure.
#[derive(Debug)]
pub struct ShardFolder {
    path: PathBuf,
    contents: Contents,
}

#[derive(Debug, Deserialize)]
struct Contents {
    kind: String,
    groups: Vec<Group>,
}

#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
struct Group {
    scene: String,
    light_index: usize,
}

/// Why the shards are no benchmark.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)]
pub enum GatherError {
    #[error("{}: results of another benchmark than {}: {what}", other.display(), one.display())]
    Differ {
        one: PathBuf,
        other: PathBuf,
        what: String,
    },
    /// Missing and failed ones, each as a line of text.
    #[error("{} cells or scenes are missing or failed, the first: {}", faults.len(), faults[0])]
    Faults { faults: Vec<String> },
    #[error(transparent)]
    Results(#[from] ResultsError),
}

/// The shards in a folder: itself, or the folders `shard-..` in it. Empty if it has none.
pub fn shards_in(folder: &Path) -> Vec<ShardFolder> {
    let open = |path: &Path| {
        let bytes = fs::read(path.join("list.json")).ok()?;
        let contents: Contents = serde_json::from_slice(&bytes).ok()?;
        let path = path.to_path_buf();
        (contents.kind == "bench").then_some(ShardFolder { path, contents })
    };
    if let Some(itself) = open(folder) {
        return vec![itself];
    }
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let mut paths: Vec<PathBuf> = entries
        .filter(|entry| entry.file_name().to_string_lossy().starts_with("shard-"))
        .map(|entry| entry.path())
        .collect();
    paths.sort();
    paths.iter().filter_map(|path| open(path)).collect()
}

/// One of all shards, in the order of the benchmark.
///
/// # Errors
/// [`GatherError`]: results that cannot be read or do not go together, cells that are missing or
/// failed. What a technique cannot do is no failure.
pub fn gather(shards: &[ShardFolder]) -> Result<Results, GatherError> {
    let mut all: Option<(Results, &ShardFolder)> = None;
    for shard in shards {
        let path = shard.path.join("results.json");
        if !path.exists() {
            continue;
        }
        let mut part = Results::read(&path)?;
        let Some((all, first)) = &mut all else {
            all = Some((part, shard));
            continue;
        };
        let what = if shard.contents.groups != first.contents.groups {
            Some("other scenes or lights".into())
        } else if all.driver.is_some() && part.driver.is_some() && all.driver != part.driver {
            Some(format!("driver {:?}, not {:?}", part.driver, all.driver))
        } else if all.program != part.program {
            Some(format!("program {}, not {}", part.program, all.program))
        } else {
            difference(&part.settings, &all.settings)
        };
        if let Some(what) = what {
            let (one, other) = (first.path.clone(), shard.path.clone());
            return Err(GatherError::Differ { one, other, what });
        }
        if all.machine.cpu != part.machine.cpu {
            all.machine.cpu = None;
        }
        all.driver = all.driver.take().or(part.driver);
        all.references.append(&mut part.references);
        all.images.append(&mut part.images);
        all.failures.append(&mut part.failures);
    }
    let groups = shards
        .first()
        .map(|shard| &shard.contents.groups[..])
        .unwrap_or_default();
    let Some((mut all, _)) = all else {
        let faults = groups.iter().map(missing).collect();
        return Err(GatherError::Faults { faults });
    };
    let faults = faults(&all, groups);
    if !faults.is_empty() {
        return Err(GatherError::Faults { faults });
    }
    let place = |scene: &str, light: usize| {
        groups
            .iter()
            .position(|group| group.light_index == light && group.scene == scene)
    };
    // Stable: the techniques of a scene and light keep their order.
    all.references
        .sort_by_key(|entry| place(&entry.scene, entry.light_index));
    all.images
        .sort_by_key(|entry| place(&entry.scene, entry.light_index));
    all.failures
        .sort_by_key(|entry| place(&entry.scene, entry.light_index));
    Ok(all)
}

fn missing(group: &Group) -> String {
    format!("{}, light {}: missing", group.scene, group.light_index)
}

fn faults(all: &Results, groups: &[Group]) -> Vec<String> {
    let mut faults = Vec::new();
    for group in groups {
        let is_of = |scene: &str, light: usize| light == group.light_index && scene == group.scene;
        let entries: Vec<_> = (all.images.iter())
            .filter(|entry| is_of(&entry.scene, entry.light_index))
            .collect();
        if entries.is_empty() {
            faults.push(missing(group));
            continue;
        }
        for label in &all.settings.techniques {
            let entry = entries.iter().find(|entry| entry.label == *label);
            let reason = match entry.map(|entry| &entry.failure) {
                None => Some("missing".to_string()),
                Some(Some(failure)) if failure.kind != FailureKind::Unsupported => {
                    Some(format!("failed: {}", failure.reason))
                }
                Some(_) => None,
            };
            if let Some(reason) = reason {
                let (scene, light) = (&group.scene, group.light_index);
                faults.push(format!("{scene}, light {light}, {label}: {reason}"));
            }
        }
    }
    faults
}
