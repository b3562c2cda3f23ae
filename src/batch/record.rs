//! What stands beside the files of an item: what they are, and what they were made from.
//!
//! The files are written first and the record last, each of them whole or not at all. So an item
//! with a record is finished, whenever the process that made it was ended, and two processes at
//! work on the same item replace each other's files by the same bytes.

use std::fs;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use sha2::{Digest as _, Sha256};

use super::jobs::Kind;
use super::list::Item;
use super::scene_file::hex;
use crate::bench::FailureKind;

/// Of the file; raised whenever a field changes its meaning or goes.
pub const SCHEMA: u32 = 1;

/// A finished item, or one that failed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Record {
    /// [`SCHEMA`].
    pub schema: u32,
    /// Its name, [`Item::id`].
    pub item: String,
    /// Of everything that it was made from; see [`content_hash`].
    pub hash: String,
    /// The program's name and version, and the digest of its executable file.
    pub program: String,
    /// SHA-256 of the scene.
    pub scene_sha256: String,
    /// Device and driver.
    pub driver: Option<String>,
    /// What was written; nothing if it failed.
    pub files: Vec<FileEntry>,
    /// One entry a light, as in the report of `capture`.
    pub images: Vec<Value>,
    /// Why there are no files.
    pub failure: Option<ItemFailure>,
}

/// One file of an item.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct FileEntry {
    /// From the folder of the results.
    pub path: String,
    /// Its size.
    pub bytes: u64,
    /// Of its content.
    pub sha256: String,
}

/// Why an item has no files.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ItemFailure {
    /// What kind of failure.
    pub kind: FailureKind,
    /// In one line.
    pub reason: String,
}

impl FileEntry {
    /// Of a file with that content.
    pub fn new(path: String, content: &[u8]) -> Self {
        Self {
            path,
            bytes: content.len() as u64,
            sha256: hex(&Sha256::digest(content)),
        }
    }

    /// Whether the file below `root` is of the right size. A node that lost its power may have left
    /// a name without the content.
    pub fn is_there(&self, root: &Path) -> bool {
        let file = fs::metadata(root.join(&self.path));
        file.is_ok_and(|file| file.is_file() && file.len() == self.bytes)
    }

    /// Whether the file below `root` has the right content.
    pub fn is_right(&self, root: &Path) -> bool {
        let content = fs::read(root.join(&self.path));
        content.is_ok_and(|content| Self::new(self.path.clone(), &content) == *self)
    }
}

impl Record {
    /// Where the record of an item is, below the folder of the results.
    pub fn path(root: &Path, id: &str) -> PathBuf {
        root.join(format!("{id}.json"))
    }

    /// The record of an item; `None` if there is none, or one that cannot be read or is of another
    /// schema: then the item is to be made anew.
    pub fn read(root: &Path, id: &str) -> Option<Self> {
        let bytes = fs::read(Self::path(root, id)).ok()?;
        let record: Self = serde_json::from_slice(&bytes).ok()?;
        (record.schema == SCHEMA && record.item == id).then_some(record)
    }

    /// Whether the item needs no more work: made from the same, without a fault, and with all its
    /// files. What a technique cannot do it will not do the next time either.
    pub fn is_finished(&self, hash: &str, root: &Path) -> bool {
        let is_settled =
            (self.failure.as_ref()).is_none_or(|failure| failure.kind == FailureKind::Unsupported);
        self.hash == hash && is_settled && self.files.iter().all(|file| file.is_there(root))
    }
}

/// The digest of everything that an item's files depend on but the driver: the program, the scene's
/// content, and what is asked for. `device` is the Vulkan device asked for.
pub fn content_hash(
    item: &Item<'_>,
    program: &str,
    scene_sha256: &str,
    device: Option<&str>,
) -> String {
    let sequence = item.sequence;
    let overrides = &sequence.overrides;
    let kind = |kind: Kind| kind.ending();
    // Numbers by their bits: texts of two numbers may be the same.
    let all = json!([
        SCHEMA,
        program,
        scene_sha256,
        item.id(),
        sequence.scene,
        sequence.camera,
        sequence.light,
        format!("{overrides:?}"),
        sequence.technique.name(),
        sequence.technique.option_values(),
        sequence.size,
        item.frame,
        sequence.time(item.frame).to_bits(),
        kind(sequence.picture),
        kind(sequence.visibility),
        sequence.allow_uniform,
        sequence.repeat,
        device,
    ]);
    hex(&Sha256::digest(all.to_string().as_bytes()))
}

/// Name and version of this program and the digest of its executable: two builds differ even if
/// their version does not.
///
/// # Errors
/// The executable cannot be read.
pub fn program() -> std::io::Result<String> {
    let bytes = fs::read(std::env::current_exe()?)?;
    let digest = hex(&Sha256::digest(&bytes));
    let (name, version) = (env!("CARGO_PKG_NAME"), env!("CARGO_PKG_VERSION"));
    Ok(format!("{name} {version} {}", &digest[..16]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_item_is_finished_with_its_files_and_hash() -> Result<(), Box<dyn std::error::Error>> {
        let folder = tempfile::tempdir()?;
        let root = folder.path();
        fs::create_dir(root.join("a"))?;
        let mut record = Record {
            schema: SCHEMA,
            item: "a/0001".into(),
            hash: "abc".into(),
            program: "antumbra".into(),
            scene_sha256: String::new(),
            driver: None,
            files: vec![FileEntry::new("a/0001.png".into(), b"content")],
            images: Vec::new(),
            failure: None,
        };
        let write = |record: &Record| -> Result<(), Box<dyn std::error::Error>> {
            Ok(fs::write(
                Record::path(root, "a/0001"),
                serde_json::to_vec(record)?,
            )?)
        };
        let is_finished = |hash: &str| {
            Record::read(root, "a/0001").is_some_and(|record| record.is_finished(hash, root))
        };
        assert!(!is_finished("abc"));
        write(&record)?;
        assert!(!is_finished("abc"), "the file is missing");
        fs::write(root.join("a/0001.png"), b"contenT")?;
        assert!(is_finished("abc") && !is_finished("abd"));
        assert!(!record.files[0].is_right(root), "the content is another");
        fs::write(root.join("a/0001.png"), b"")?;
        assert!(!is_finished("abc"), "the file is empty");
        record.files.clear();
        for (kind, settled) in [
            (FailureKind::Failed, false),
            (FailureKind::Unsupported, true),
        ] {
            let reason = "why".into();
            record.failure = Some(ItemFailure { kind, reason });
            write(&record)?;
            assert_eq!(is_finished("abc"), settled);
        }
        record.schema = SCHEMA + 1;
        write(&record)?;
        assert!(Record::read(root, "a/0001").is_none());
        fs::write(Record::path(root, "a/0001"), b"{\"schema\": 1,")?;
        assert!(Record::read(root, "a/0001").is_none());
        Ok(())
    }
}
