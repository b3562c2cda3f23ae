//! Studies: what is measured for a comparison, from a file, and its tables.
//!
//! A [`Study`] is a TOML file of tables. Each [`Table`] is measured as a benchmark of its own for
//! every [`Part`]: one picture size and one factor on the lights' sizes. [`page`] makes Markdown
//! of the results.
//!
//! ```toml
//! title = "Filters"
//! text = "A line or two for people."     # may be left out
//!
//! [[table]]
//! name = "resolution"                    # the folder of its results
//! title = "Time and error by resolution"
//! reproduces = "Figure 9 of the paper"   # may be left out, as all below but scenes, techniques, columns
//! scenes = ["../../assets/comb.gltf"]    # files and folders of them, from the folder of the file
//! light = "disk"                         # by name, which each scene has to have; else all lights
//! light-scales = [1, 2, 4]               # factors on the lights' sizes
//! sizes = ["256x256"]                    # pictures, pixels
//! techniques = ["hard", "pcss:taps=16"]  # one row each
//! rivals = ["embree:64"]                 # the same, but left out by a build that does not have them
//! samples = 1024                         # of the truth
//! mean = true                            # one row for all scenes and lights together
//! columns = ["rmse", "ratio", "passes:*.map * as map ms", "visibility_ms / triangles"]
//! ```
//!
//! Columns are described at [`Column`].

mod column;
mod page;

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Deserializer};

use super::contender::{Contender, Method};
use super::results::Results;
use crate::batch::jobs::{Pixels, Text};
use crate::reference::MAX_SAMPLES;
use crate::shadow::Technique;

pub use column::{Column, ColumnError};
pub use page::page;

/// Rivals that some builds lack.
const OPTIONAL_RIVALS: [&str; 1] = ["embree"];
const DEFAULT_SAMPLES: u32 = 1024;

/// The whole file.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Study {
    /// Heading of the page.
    pub title: String,
    /// Below it.
    pub text: Option<String>,
    /// One `[[table]]` each.
    #[serde(rename = "table")]
    pub tables: Vec<Table>,
}

/// One `[[table]]`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Table {
    /// The folder of its results.
    pub name: String,
    /// Heading.
    pub title: String,
    /// Which figure or table of which paper.
    pub reproduces: Option<String>,
    /// glTF files and folders of them, from the folder of the file.
    pub scenes: Vec<String>,
    /// The light's name; `None` for all lights of each scene.
    pub light: Option<String>,
    /// Factors on the lights' sizes.
    #[serde(default = "one")]
    pub light_scales: Vec<f32>,
    /// Pixels.
    #[serde(default = "small")]
    pub sizes: Vec<Text<Pixels>>,
    /// What is compared.
    #[serde(deserialize_with = "contenders")]
    pub techniques: Vec<Contender>,
    /// Labels of what is compared too, if this build has it.
    #[serde(default)]
    pub rivals: Vec<String>,
    /// Of the truth at each pixel.
    #[serde(default = "samples")]
    pub samples: u32,
    /// One row for all scenes and lights together.
    #[serde(default)]
    pub mean: bool,
    /// What is shown of each row.
    pub columns: Vec<Text<Column>>,
}

fn one() -> Vec<f32> {
    vec![1.0]
}

fn small() -> Vec<Text<Pixels>> {
    "256x256".parse().into_iter().collect()
}

fn samples() -> u32 {
    DEFAULT_SAMPLES
}

fn contenders<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<Contender>, D::Error> {
    let labels = Vec::<String>::deserialize(deserializer)?;
    let parse = |label: &String| label.parse().map_err(serde::de::Error::custom);
    labels.iter().map(parse).collect()
}

/// One picture size and one factor: a benchmark of its own.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Part {
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// On the lights' sizes.
    pub light_scale: f32,
}

impl Part {
    /// The folder of its results in that of the table: `256x256`, `256x256-light-2`.
    pub fn folder(&self) -> String {
        let [width, height] = self.size;
        match self.light_scale {
            1.0 => format!("{width}x{height}"),
            factor => format!("{width}x{height}-light-{factor}"),
        }
    }
}

/// A part and what was measured.
#[derive(Clone, Debug)]
pub struct Measured {
    /// The part.
    pub part: Part,
    /// Its benchmark.
    pub results: Results,
}

/// A study that cannot be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)]
pub enum StudyError {
    #[error("{}: cannot be read: {source}", path.display())]
    Read { path: PathBuf, source: io::Error },
    /// No TOML, or an entry that is not known or of the wrong form.
    #[error("{}: {reason}", path.display())]
    Form { path: PathBuf, reason: String },
    /// Values that do not go together.
    #[error("{}: table `{table}`: {reason}", path.display())]
    Table {
        path: PathBuf,
        table: String,
        reason: String,
    },
}

impl Study {
    /// Reads and checks the file; scenes are not opened.
    ///
    /// # Errors
    /// [`StudyError`], with file, line or table and what is wrong.
    pub fn read(path: &Path) -> Result<Self, StudyError> {
        let text = fs::read_to_string(path).map_err(|source| StudyError::Read {
            path: path.into(),
            source,
        })?;
        let study = Self::parse(&text).map_err(|reason| StudyError::Form {
            path: path.into(),
            reason,
        })?;
        for (at, table) in study.tables.iter().enumerate() {
            if let Some(reason) = table.fault(&study.tables[..at]) {
                return Err(StudyError::Table {
                    path: path.into(),
                    table: table.name.clone(),
                    reason,
                });
            }
        }
        Ok(study)
    }

    fn parse(text: &str) -> Result<Self, String> {
        toml::from_str(text).map_err(|error| {
            let at = error.span().map_or(0, |span| span.start);
            let before = text.get(..at);
            let line = before.map_or(1, |before| before.matches('\n').count() + 1);
            format!("line {line}: {}", error.message())
        })
    }
}

impl Table {
    fn fault(&self, before: &[Self]) -> Option<String> {
        let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_".contains(c);
        let is_scale = |factor: &f32| (1e-6..=1e6).contains(factor);
        let empty = |what: &str| Some(format!("`{what}` is empty"));
        if self.name.is_empty() || !self.name.chars().all(is_plain) {
            return Some("a name is of letters, digits, - and _: it becomes a folder".into());
        }
        if before.iter().any(|other| other.name == self.name) {
            return Some("two tables have this name".into());
        }
        for (what, is_empty) in [
            ("scenes", self.scenes.is_empty()),
            ("light-scales", self.light_scales.is_empty()),
            ("sizes", self.sizes.is_empty()),
            ("techniques", self.techniques.is_empty()),
            ("columns", self.columns.is_empty()),
        ] {
            if is_empty {
                return empty(what);
            }
        }
        if !self.light_scales.iter().all(is_scale) {
            return Some("`light-scales` are factors from 1e-6 to 1e6".into());
        }
        if !(16..=MAX_SAMPLES).contains(&self.samples) {
            return Some(format!("`samples` has to be 16 to {MAX_SAMPLES}"));
        }
        let rivals = match self.built_rivals() {
            Ok(rivals) => rivals,
            Err(reason) => return Some(reason),
        };
        let all: Vec<&Contender> = self.techniques.iter().chain(&rivals).collect();
        let twice = all.iter().enumerate().find(|(at, contender)| {
            let mut earlier = all[..*at].iter();
            earlier.any(|other| other.method == contender.method)
        });
        if let Some((_, contender)) = twice {
            return Some(format!("`{}` is measured twice", contender.label));
        }
        let measured = all.iter().map(|contender| contender.label.as_str());
        let known: Vec<&str> = measured.chain(self.missing_rivals()).collect();
        let mut compared = self.columns.iter().flat_map(|column| column.value.labels());
        let unknown = compared.find(|label| !known.contains(label))?;
        Some(format!("`times:{unknown}`: the table has no `{unknown}`"))
    }

    /// Those of `rivals` that this build has.
    fn built_rivals(&self) -> Result<Vec<Contender>, String> {
        let mut rivals = Vec::new();
        for label in &self.rivals {
            match label.parse::<Contender>() {
                Ok(contender) => rivals.push(contender),
                Err(_) if is_optional(label) && !has_engine(label) => {}
                Err(error) => return Err(error.to_string()),
            }
        }
        Ok(rivals)
    }

    /// Those of [`rivals`](Self::rivals) that this build lacks.
    pub fn missing_rivals(&self) -> Vec<&str> {
        let labels = self.rivals.iter().map(String::as_str);
        let missing = |label: &&str| label.parse::<Contender>().is_err();
        labels.filter(missing).collect()
    }

    /// What has a row, in order.
    pub fn rows(&self) -> Vec<Contender> {
        let rivals = self.built_rivals().unwrap_or_default();
        self.techniques.iter().cloned().chain(rivals).collect()
    }

    /// What is measured: the [rows](Self::rows), and `hard` if a column compares with it.
    pub fn contenders(&self) -> Vec<Contender> {
        let mut contenders = self.rows();
        let needs_hard = self.columns.iter().any(|column| column.value.needs_hard());
        if needs_hard && !contenders.iter().any(is_hard) {
            contenders.extend("hard".parse::<Contender>());
        }
        contenders
    }

    /// Every size with every factor.
    pub fn parts(&self) -> Vec<Part> {
        let part = |size: &Text<Pixels>, light_scale| Part {
            size: size.value.0,
            light_scale,
        };
        let parts = self.sizes.iter().flat_map(|size| {
            let scales = self.light_scales.iter();
            scales.map(move |&scale| part(size, scale))
        });
        parts.collect()
    }
}

/// The technique that ratios are to, with default options.
fn is_hard(contender: &Contender) -> bool {
    matches!(contender.method, Method::Technique(Technique::Hard))
}

fn is_optional(label: &str) -> bool {
    let name = label.split(':').next().unwrap_or_default();
    OPTIONAL_RIVALS.contains(&name)
}

/// Whether this build has the rival, whatever its options.
fn has_engine(label: &str) -> bool {
    let name = label.split(':').next().unwrap_or_default();
    format!("{name}:1").parse::<Contender>().is_ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    const TABLE: &str = "[[table]]\nname = \"a\"\ntitle = \"A\"\nscenes = [\"x.glb\"]\n";

    fn read(table: &str) -> Result<Study, String> {
        let folder = tempfile::tempdir().map_err(|error| error.to_string())?;
        let path = folder.path().join("study.toml");
        fs::write(&path, format!("title = \"T\"\n{table}")).map_err(|error| error.to_string())?;
        Study::read(&path).map_err(|error| error.to_string())
    }

    #[test]
    fn a_table_has_defaults_parts_and_hard_to_compare_with() -> Result<(), String> {
        let study = read(&format!(
            "{TABLE}techniques = [\"pcss\", \"pcss:taps=8\"]\ncolumns = [\"rmse\"]\n\
             [[table]]\nname = \"b\"\ntitle = \"B\"\nscenes = [\"x.glb\"]\nlight = \"lamp\"\n\
             light-scales = [1, 0.5]\nsizes = [\"32x16\", \"64x64\"]\ntechniques = [\"pcss\"]\n\
             rivals = [\"rays:4\", \"embree:64\"]\nsamples = 16\nmean = true\n\
             columns = [\"ratio as to hard\"]\n"
        ))?;
        let [a, b] = &study.tables[..] else {
            return Err("two tables".into());
        };
        assert_eq!((a.samples, a.mean, a.light.is_none()), (1024, false, true));
        let part = |size, light_scale| Part { size, light_scale };
        assert_eq!(a.parts(), [part([256, 256], 1.0)]);
        assert_eq!(a.contenders(), a.rows());
        assert_eq!(b.parts().len(), 4);
        assert_eq!(b.parts()[1], part([32, 16], 0.5));
        assert_eq!(b.parts()[1].folder(), "32x16-light-0.5");
        assert_eq!(b.parts()[2].folder(), "64x64");
        let labels = |list: Vec<Contender>| list.into_iter().map(|c| c.label).collect::<Vec<_>>();
        let embree = cfg!(feature = "embree");
        assert_eq!(b.missing_rivals().is_empty(), embree);
        let (rows, all) = (labels(b.rows()), labels(b.contenders()));
        assert_eq!(rows[..2], ["pcss", "rays:4"]);
        assert_eq!(rows.len(), 2 + usize::from(embree));
        // Only measured, without a row.
        assert_eq!(all.last().map(String::as_str), Some("hard"));
        assert_eq!(all.len(), rows.len() + 1);
        Ok(())
    }

    #[test]
    fn what_is_wrong_is_named() {
        let good = "techniques = [\"pcss\"]\ncolumns = [\"rmse\"]\n";
        for (table, part) in [
            (String::new(), "missing field `table`"),
            (format!("{TABLE}{good}sise = 1\n"), "unknown field `sise`"),
            (
                format!("{TABLE}{good}sizes = [\"4\"]\n"),
                "line 8: `4`: give WxH",
            ),
            (
                format!("{TABLE}{good}sizes = []\n"),
                "table `a`: `sizes` is empty",
            ),
            (
                format!("{TABLE}{good}samples = 3\n"),
                "`samples` has to be 16",
            ),
            (format!("{TABLE}{good}light-scales = [0]\n"), "factors from"),
            (format!("{TABLE}{good}rivals = [\"embree:x\"]\n"), "embree"),
            (
                format!("{TABLE}{good}rivals = [\"pcss\"]\n"),
                "`pcss` is measured twice",
            ),
            (
                format!("{TABLE}{good}{TABLE}{good}"),
                "two tables have this name",
            ),
            (
                format!("{TABLE}techniques = [\"pcss\"]\ncolumns = [\"times:hard\"]\n"),
                "the table has no `hard`",
            ),
            (
                format!("{TABLE}techniques = [\"soft\"]\ncolumns = [\"rmse\"]\n"),
                "line 6: unknown technique `soft`",
            ),
            (
                format!("{TABLE}techniques = [\"pcss:taps=0\"]\ncolumns = [\"rmse\"]\n"),
                "it takes 1 to 256",
            ),
            (
                format!("{TABLE}techniques = [\"pcss\"]\ncolumns = [\"speed\"]\n"),
                "line 7: `speed`: no column `speed`",
            ),
        ] {
            let error = read(&table).err().unwrap_or_default();
            let is_line = error.lines().count() == 1;
            // Without the feature the build cannot know what options it would have.
            let is_excused = part == "embree" && !cfg!(feature = "embree");
            assert!(
                is_excused || (error.contains(part) && is_line),
                "{table}: {error:?}"
            );
        }
        let error = Study::read(Path::new("none.toml"))
            .err()
            .map(|error| error.to_string());
        assert!(error.is_some_and(|error| error.starts_with("none.toml: cannot be read")));
    }

    #[test]
    fn the_studies_here_are_right() -> Result<(), Box<dyn std::error::Error>> {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/studies");
        let mut count = 0;
        for entry in fs::read_dir(folder)? {
            let study = Study::read(&entry?.path())?;
            assert!(!study.tables.is_empty());
            count += 1;
        }
        assert!(count > 0);
        Ok(())
    }
}
