//! The tables of a study as Markdown.

use std::fmt::Write as _;
use std::path::Path;

use super::column::{Column, Kind, Sources};
use super::{Measured, Part, Study, Table, is_hard};
use crate::bench::contender::Contender;
use crate::bench::results::{Entry, FailureKind, ReferenceEntry, Results};

/// Of a cell without this value.
const NOTHING: &str = "\u{2013}";

/// All tables, each with its parts as far as they were measured. No dates, no paths of folders:
/// the same results give the same page.
pub fn page(study: &Study, measured: &[Vec<Measured>]) -> String {
    let mut text = format!("# {}\n", study.title);
    // Writing to a String cannot fail.
    let mut say = |paragraph: &str| {
        let _ = write!(text, "\n{paragraph}\n");
    };
    if let Some(about) = &study.text {
        say(about.trim());
    }
    let first = measured.iter().flatten().next();
    if let Some(Measured { results, .. }) = first {
        say(&conditions(results));
    }
    for (table, parts) in study.tables.iter().zip(measured) {
        say(&format!("## {}", table.title));
        if let Some(reproduces) = &table.reproduces {
            say(&format!(
                "Reproduces: {}.",
                reproduces.trim_end_matches('.')
            ));
        }
        for paragraph in body(table, parts) {
            say(&paragraph);
        }
    }
    text
}

fn conditions(results: &Results) -> String {
    let machine = &results.machine;
    let (threads, os) = (machine.threads, &machine.os);
    let cpu = machine.cpu.as_deref().unwrap_or("unknown processor");
    let driver = results.driver.as_deref();
    let rounds = results.settings.repeat;
    let plural = if rounds == 1 { "" } else { "s" };
    let line = format!(
        "Measured by {} on {cpu}, {threads} threads, {os}; {}. Times are medians of {rounds} round{plural}, \
         fewer for slow cells, all techniques in turn; errors are those of visibility, 0 to 1, against \
         ray tracing.",
        results.program,
        driver.unwrap_or("no Vulkan device"),
    );
    line.replace(char::is_control, "?")
}

/// A row before it is text.
struct Row {
    part: Part,
    scene: String,
    light: String,
    label: String,
    values: Result<Vec<Option<f64>>, String>,
}

/// A scene and light of a part.
struct Group<'a> {
    part: Part,
    reference: &'a ReferenceEntry,
    entries: Vec<&'a Entry>,
}

impl<'a> Group<'a> {
    fn all(measured: &'a Measured) -> impl Iterator<Item = Self> {
        let references = measured.results.references.iter();
        references.map(|reference| Self {
            part: measured.part,
            reference,
            entries: measured.results.group(reference),
        })
    }

    fn entry(&self, contender: &Contender) -> Option<&'a Entry> {
        let mut entries = self.entries.iter().copied();
        entries.find(|entry| entry.label == contender.label)
    }

    fn values(&self, columns: &[&Column], entry: &Entry) -> Vec<Option<f64>> {
        let mut entries = self.entries.iter().copied();
        let is_hard = |entry: &&Entry| entry.label.parse().is_ok_and(|c| is_hard(&c));
        let from = Sources {
            entry,
            reference: self.reference,
            hard: entries.find(is_hard),
            all: &self.entries,
        };
        columns.iter().map(|column| column.value(from)).collect()
    }
}

fn body(table: &Table, parts: &[Measured]) -> Vec<String> {
    let groups: Vec<Group<'_>> = parts.iter().flat_map(Group::all).collect();
    let columns: Vec<&Column> = table.columns.iter().map(|column| &column.value).collect();
    let mut notes = Vec::new();
    let rows = match table.mean {
        true => mean_rows(table, parts, &columns, &mut notes),
        false => rows(table, &groups, &columns, &mut notes),
    };
    for measured in parts {
        let failed = measured.results.failures.iter();
        let failed = failed.filter(|cell| cell.failure.kind != FailureKind::Unsupported);
        notes.extend(failed.map(|cell| {
            let (scene, light) = (stem(&cell.scene), &cell.light);
            let text = format!(
                "Failed: {scene}, {light}, {}, `{}`: {}",
                measured.part.folder(),
                cell.label,
                cell.failure.reason
            );
            text.replace(char::is_control, "?")
        }));
    }
    let missing = table.missing_rivals();
    if !missing.is_empty() {
        notes.push(format!("Not in this build: {}.", missing.join(", ")));
    }
    let mut paragraphs = Vec::new();
    if let Some(first) = rows.first() {
        let (common, lines) = lines(table.mean, &rows, first, &columns);
        let samples = parts.first().map(|first| first.results.settings.samples);
        paragraphs.push(format!(
            "{common}{} light samples a pixel in the truth.",
            samples.unwrap_or(table.samples)
        ));
        paragraphs.push(lines.join("\n"));
    } else {
        paragraphs.push("Nothing was measured.".into());
    }
    paragraphs.extend(notes);
    paragraphs
}

/// One row a scene, light, part and contender.
fn rows(
    table: &Table,
    groups: &[Group<'_>],
    columns: &[&Column],
    notes: &mut Vec<String>,
) -> Vec<Row> {
    let (mut rows, mut unsupported) = (Vec::new(), 0);
    for group in groups {
        for contender in table.rows() {
            let Some(entry) = group.entry(&contender) else {
                continue;
            };
            let values = match &entry.failure {
                Some(failure) if failure.kind == FailureKind::Unsupported => {
                    unsupported += 1;
                    continue;
                }
                Some(_) => Err("failed".into()),
                None => Ok(group.values(columns, entry)),
            };
            rows.push(Row {
                part: group.part,
                scene: stem(&group.reference.scene),
                light: group.reference.light.clone(),
                label: contender.label,
                values,
            });
        }
    }
    if unsupported > 0 {
        notes.push(format!(
            "{unsupported} rows are left out: the technique does not take that light."
        ));
    }
    rows
}

/// One row a part and contender, over the scenes and lights that all contenders have results of.
fn mean_rows(
    table: &Table,
    parts: &[Measured],
    columns: &[&Column],
    notes: &mut Vec<String>,
) -> Vec<Row> {
    let contenders = table.rows();
    let mut rows = Vec::new();
    for measured in parts {
        let (whole, partial): (Vec<_>, Vec<_>) = Group::all(measured).partition(|group| {
            let has_result = |contender| {
                let entry = group.entry(contender);
                entry.is_some_and(|entry| entry.failure.is_none())
            };
            contenders.iter().all(has_result)
        });
        let mut note = format!(
            "{}: means over {} lights.",
            measured.part.folder(),
            whole.len()
        );
        if !partial.is_empty() {
            let names = partial
                .iter()
                .map(|group| format!("{} {}", stem(&group.reference.scene), group.reference.light));
            let names: Vec<String> = names.collect();
            let _ = write!(
                note,
                " Left out, for not all techniques have a result: {}.",
                names.join(", ")
            );
        }
        notes.push(note.replace(char::is_control, "?"));
        for contender in &contenders {
            let entries = whole.iter().filter_map(|group| {
                let entry = group.entry(contender)?;
                Some(group.values(columns, entry))
            });
            let all: Vec<Vec<Option<f64>>> = entries.collect();
            let column = |(at, column): (usize, &&Column)| {
                let values: Option<Vec<f64>> = all.iter().map(|values| values[at]).collect();
                mean(&values?, column.kind())
            };
            rows.push(Row {
                part: measured.part,
                scene: String::new(),
                light: String::new(),
                label: contender.label.clone(),
                values: Ok(columns.iter().enumerate().map(column).collect()),
            });
        }
    }
    rows
}

/// The geometric mean of ratios, of all else the arithmetic one.
fn mean(values: &[f64], kind: Kind) -> Option<f64> {
    let count = values.len() as f64;
    let sum = |value: fn(f64) -> f64| values.iter().copied().map(value).sum::<f64>();
    let mean = match kind {
        Kind::Ratio => (sum(f64::ln) / count).exp(),
        _ => sum(|value| value) / count,
    };
    mean.is_finite().then_some(mean)
}

/// What is the same in all rows, and the table without it.
fn lines(is_mean: bool, rows: &[Row], first: &Row, columns: &[&Column]) -> (String, Vec<String>) {
    type Cell = fn(&Row) -> String;
    let size: Cell = |row| format!("{}x{}", row.part.size[0], row.part.size[1]);
    let scale: Cell = |row| row.part.light_scale.to_string();
    let mut keys: Vec<(&str, Cell)> = vec![
        ("scene", |row| row.scene.clone()),
        ("light", |row| row.light.clone()),
        ("size", size),
        ("light \u{d7}", scale),
    ];
    if is_mean {
        keys.drain(..2);
    }
    let mut common = String::new();
    keys.retain(|(name, cell)| {
        let value = cell(first);
        let varies = rows.iter().any(|row| cell(row) != value);
        let is_plain = *name == "light \u{d7}" && value == "1";
        if !varies && !is_plain {
            let _ = write!(common, "{name} {}; ", escaped(&value));
        }
        varies
    });
    let mut capital = common.chars();
    let common = match capital.next() {
        Some(first) => first.to_uppercase().to_string() + capital.as_str(),
        None => common,
    };

    let mut heads: Vec<String> = keys.iter().map(|(name, _)| (*name).into()).collect();
    heads.push("technique".into());
    heads.extend(columns.iter().map(|column| escaped(&column.heading)));
    let texts = keys.len() + 1;
    let rule = (0..heads.len()).map(|at| if at < texts { "---" } else { "---:" });
    let rule: Vec<String> = rule.map(String::from).collect();
    let row = |row: &Row| {
        let mut cells: Vec<String> = keys.iter().map(|(_, cell)| escaped(&cell(row))).collect();
        cells.push(format!("`{}`", escaped(&row.label)));
        match &row.values {
            Ok(values) => {
                let numbers = values.iter().zip(columns);
                cells.extend(numbers.map(|(value, column)| written(*value, column.kind())));
            }
            Err(reason) => {
                cells.push(reason.clone());
                cells.extend(columns.iter().skip(1).map(|_| NOTHING.to_string()));
            }
        }
        cells
    };
    let all = [heads, rule].into_iter().chain(rows.iter().map(row));
    let lines = all.map(|cells| format!("| {} |", cells.join(" | ")));
    (common, lines.collect())
}

fn written(value: Option<f64>, kind: Kind) -> String {
    match (value, kind) {
        (None, _) => NOTHING.into(),
        (Some(value), Kind::Error) => format!("{value:.4}"),
        (Some(value), Kind::Ratio) => format!("{value:.2}"),
        (Some(value), Kind::Count) if value.fract() == 0.0 => format!("{value}"),
        (Some(value), _) => number(value),
    }
}

/// With three figures or so.
fn number(value: f64) -> String {
    match value.abs() {
        v if v >= 99.95 => format!("{value:.0}"),
        v if v >= 9.995 => format!("{value:.1}"),
        v if v >= 0.9995 => format!("{value:.2}"),
        _ => format!("{value:.3}"),
    }
}

fn stem(scene: &str) -> String {
    let stem = Path::new(scene).file_stem().unwrap_or_default();
    stem.to_string_lossy().into_owned()
}

/// Text for a cell of a table.
fn escaped(text: &str) -> String {
    text.replace(char::is_control, "?").replace('|', "\\|")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::report::tests::results;

    fn study(table: &str) -> Study {
        let text = format!(
            "title = \"T\"\ntext = \"About.\"\n[[table]]\nname = \"a\"\ntitle = \"A\"\n\
             reproduces = \"Table 1\"\nscenes = [\"x\"]\ntechniques = [\"hard\", \"rays:4\"]\n{table}"
        );
        toml::from_str(&text).unwrap_or_else(|error| panic!("{error}"))
    }

    /// The same at a second light scale, where the rival has a result.
    fn measured() -> Vec<Measured> {
        let part = |light_scale| Part {
            size: [4, 4],
            light_scale,
        };
        let of = |light_scale, results| Measured {
            part: part(light_scale),
            results,
        };
        let mut second = results();
        second.failures.clear();
        second.images[1].failure = None;
        second.images[1].error = second.images[0].error;
        second.images[1].visibility_ms = second.images[0].visibility_ms;
        vec![of(1.0, results()), of(2.0, second)]
    }

    #[test]
    fn a_table_has_what_differs_and_notes_what_failed() {
        let study = study(
            "columns = [\"rmse as a|b\", \"passes:map* - 1 / 2\", \"visibility_ratio\", \"2 * times:rays:4\"]\n",
        );
        let page = page(&study, &[measured()]);
        for part in [
            "# T\n\nAbout.\n",
            "\n## A\n\nReproduces: Table 1.\n",
            "\nScene <b>&; light \"lamp\"; size 4x4; 16 light samples",
            "\n| light \u{d7} | technique | a\\|b | passes:map* - 1 / 2 | visibility_ratio | 2 * times:rays:4 |\n\
             | --- | --- | ---: | ---: | ---: | ---: |\n\
             | 1 | `hard` | 0.2500 | 0.500 | 1.00 | \u{2013} |\n\
             | 1 | `rays:4` | failed | \u{2013} | \u{2013} | \u{2013} |\n\
             | 2 | `hard` | 0.2500 | 0.500 | 1.00 | 2.00 |\n\
             | 2 | `rays:4` | 0.2500 | \u{2013} | 1.00 | 2.00 |\n",
            "\nFailed: <b>&, \"lamp\", 4x4, `rays:4`: signal <11>\n",
        ] {
            assert!(page.contains(part), "{part:?} in {page}");
        }
    }

    #[test]
    fn means_are_of_lights_that_all_have_results_of() {
        let study = study("mean = true\ncolumns = [\"rmse\", \"penumbra_pixels\"]\n");
        let mut parts = measured();
        let second = &mut parts[1].results;
        let mut more = second.images.clone();
        for entry in &mut more {
            entry.light_index = 1;
            entry.error = entry.error.map(|mut error| {
                error.penumbra.rmse = 0.5;
                error
            });
        }
        second.images.extend(more);
        let mut reference = second.references[0].clone();
        (reference.light_index, reference.penumbra_pixels) = (1, 4);
        second.references.push(reference);
        let page = page(&study, &[parts]);
        for part in [
            "| 2 | `hard` | 0.3750 | 3.50 |\n| 2 | `rays:4` | 0.3750 | 3.50 |",
            "| 1 | `hard` | \u{2013} | \u{2013} |",
            "4x4: means over 0 lights. Left out, for not all techniques have a result: <b>& \"lamp\".",
            "4x4-light-2: means over 2 lights.\n",
        ] {
            assert!(page.contains(part), "{part:?} in {page}");
        }
        assert_eq!(mean(&[1.0, 4.0], Kind::Ratio), Some(2.0));
        assert_eq!(mean(&[1.0, 4.0], Kind::Other), Some(2.5));
        assert_eq!(mean(&[], Kind::Ratio), None);
    }
}
