//! Measured errors and times, and what they let expect.

use std::fmt;
use std::str::FromStr;
use std::sync::OnceLock;

use super::Case;
use crate::light::ShapeKind;
use crate::shadow::Technique;

/// Columns of a line of the file, in order.
const COLUMNS: &str =
    "technique\tscene\tlight\tshape\tangle\tcone\ttriangles\tholes\tpixels\trmse\tms";

/// Rows that an estimate is made of.
const NEAREST: usize = 4;
/// Distance, squared, below which a row counts hardly more.
const NEAR: f64 = 0.05;
/// Exponent of the number of pixels that time grows with: part of a technique's work does not depend on them.
const GROWTH: f64 = 0.75;
/// Standard deviations of logarithms above the mean error that an estimate allows for. Chosen with scenes left out of
/// the table: without it targets just above what a technique mostly reaches are missed in half of the scenes.
const CAUTION: f64 = 1.5;
/// An error below this is as good as none, and would weigh too much in a mean of logarithms.
const LEAST_ERROR: f64 = 1e-4;

/// One technique measured in one case.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// With its options.
    pub technique: Technique,
    /// Name of the scene, for leaving it out.
    pub scene: String,
    /// Name of the light.
    pub light: String,
    /// What it was measured in.
    pub case: Case,
    /// Root mean square error over the penumbra's pixels.
    pub rmse: f64,
    /// Device time for the light's visibility, milliseconds.
    pub ms: f64,
}

/// What an estimate says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Expected {
    /// Root mean square error over the penumbra's pixels.
    pub rmse: f64,
    /// What that is likely to stay below, judged by how unlike each other the errors of similar cases are: what is held
    /// against a target.
    pub likely_rmse: f64,
    /// Device time for the light's visibility on the machine that was measured, milliseconds.
    pub ms: f64,
}

/// Why a text is no table.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum TableError {
    /// The first line is another.
    #[error("no table of times and errors: its first line is not `{}`", COLUMNS.replace('\t', " "))]
    Header,
    /// A line that is not a row.
    #[error("line {line}: {what}; measure the table anew")]
    Line {
        /// Counted from 1.
        line: usize,
        /// What is wrong with it.
        what: String,
    },
}

/// Measured cases.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Table {
    rows: Vec<Row>,
    /// Each technique once, in the order of the rows.
    candidates: Vec<Technique>,
}

impl Table {
    /// The one that comes with the library: lavapipe on two cores.
    #[must_use]
    pub fn reference() -> &'static Self {
        static TABLE: OnceLock<Table> = OnceLock::new();
        // A test reads it; without rows everything is chosen as if nothing were known.
        TABLE.get_or_init(|| include_str!("reference.tsv").parse().unwrap_or_default())
    }

    /// Of rows.
    #[must_use]
    pub fn new(rows: Vec<Row>) -> Self {
        let mut candidates: Vec<Technique> = Vec::new();
        for row in &rows {
            if !candidates.contains(&row.technique) {
                candidates.push(row.technique);
            }
        }
        Self { rows, candidates }
    }

    /// All rows.
    #[must_use]
    pub fn rows(&self) -> &[Row] {
        &self.rows
    }

    /// Techniques with their options that it knows.
    #[must_use]
    pub fn candidates(&self) -> &[Technique] {
        &self.candidates
    }

    /// What to expect of a technique in a case: means of logarithms over the most similar rows, weighted by
    /// similarity. `None` without a row.
    #[must_use]
    pub fn estimate(&self, technique: Technique, case: &Case) -> Option<Expected> {
        let rows = self.rows.iter().filter(|row| row.technique == technique);
        let mut near: Vec<(f64, &Row)> = rows
            .map(|row| (row.case.distance_squared(case), row))
            .collect();
        // Stable: of equally similar rows the first ones.
        near.sort_by(|a, b| a.0.total_cmp(&b.0));
        let [mut sum, mut error, mut square, mut time] = [0.0; 4];
        for (distance, row) in near.into_iter().take(NEAREST) {
            let weight = 1.0 / (distance + NEAR);
            sum += weight;
            let log_error = row.rmse.max(LEAST_ERROR).ln();
            error += weight * log_error;
            square += weight * log_error * log_error;
            let grown = GROWTH * (case.pixels / row.case.pixels).ln();
            time += weight * (row.ms.max(1e-3).ln() + grown);
        }
        (sum > 0.0).then(|| {
            let mean = error / sum;
            // Rounding may leave less than nothing.
            let deviation = (square / sum - mean * mean).max(0.0).sqrt();
            Expected {
                rmse: mean.exp(),
                likely_rmse: (mean + CAUTION * deviation).exp(),
                ms: (time / sum).exp(),
            }
        })
    }

    /// Without the rows of a scene.
    #[must_use]
    pub fn without(&self, scene: &str) -> Self {
        let rows = self.rows.iter().filter(|row| row.scene != scene);
        Self {
            rows: rows.cloned().collect(),
            candidates: self.candidates.clone(),
        }
    }
}

/// The technique as [`Technique::from_str`] reads it: options that are not the default's.
pub(super) fn spec(technique: Technique) -> String {
    let changed = technique.options().iter().zip(technique.option_values());
    let changed: Vec<String> = changed
        .filter(|(option, (_, value))| option.default != value)
        .map(|(_, (name, value))| format!("{name}={value}"))
        .collect();
    if changed.is_empty() {
        return technique.name().into();
    }
    format!("{}:{}", technique.name(), changed.join(","))
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{COLUMNS}")?;
        for row in &self.rows {
            let case = &row.case;
            writeln!(
                f,
                "{}\t{}\t{}\t{}\t{:.5}\t{:.4}\t{:.0}\t{:.3}\t{:.0}\t{:.5}\t{:.3}",
                spec(row.technique),
                row.scene,
                row.light,
                case.shape.name(),
                case.angle,
                case.cone,
                case.triangles,
                case.holes,
                case.pixels,
                row.rmse,
                row.ms
            )?;
        }
        Ok(())
    }
}

impl FromStr for Table {
    type Err = TableError;

    fn from_str(text: &str) -> Result<Self, TableError> {
        let mut lines = text.lines();
        if lines.next() != Some(COLUMNS) {
            return Err(TableError::Header);
        }
        let rows = (2..)
            .zip(lines)
            .map(|(line, text)| row(text).map_err(|what| TableError::Line { line, what }));
        Ok(Self::new(rows.collect::<Result<_, _>>()?))
    }
}

fn row(text: &str) -> Result<Row, String> {
    let fields: Vec<&str> = text.split('\t').collect();
    let [technique, scene, light, shape, numbers @ ..] = fields.as_slice() else {
        return Err("too few columns".into());
    };
    let technique = technique
        .parse::<Technique>()
        .map_err(|error| error.to_string())?;
    let known = ShapeKind::ALL
        .into_iter()
        .find(|kind| kind.name() == *shape);
    let shape = known.ok_or_else(|| format!("`{shape}` is no light's shape"))?;
    let number = |text: &&str| {
        let value = text
            .parse()
            .ok()
            .filter(|v: &f64| v.is_finite() && *v >= 0.0);
        value.ok_or_else(|| format!("`{text}` is no number of 0 and above"))
    };
    let numbers: Vec<f64> = numbers.iter().map(number).collect::<Result<_, _>>()?;
    let [angle, cone, triangles, holes, pixels, rmse, ms] = numbers[..] else {
        return Err("not as many columns as the first line".into());
    };
    if pixels < 1.0 {
        return Err("a picture without pixels".into());
    }
    Ok(Row {
        technique,
        scene: (*scene).into(),
        light: (*light).into(),
        case: Case {
            shape,
            angle,
            cone,
            triangles,
            holes,
            pixels,
            is_uneven: false,
        },
        rmse,
        ms,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_are_read_as_they_are_written() {
        let table = Table::reference();
        assert!(table.rows().len() > 100, "{} rows", table.rows().len());
        assert_eq!(table.to_string().parse().as_ref(), Ok(table));
        for technique in table.candidates() {
            assert_eq!(spec(*technique).parse(), Ok(*technique));
        }
    }

    #[test]
    fn unlike_neighbours_make_an_estimate_cautious() {
        let rows = |errors: [f64; 2]| {
            let line =
                |rmse: f64| format!("pcss\tx\tlamp\tdisk\t0.1\t0.5\t100\t0\t65536\t{rmse}\t3.5");
            format!("{COLUMNS}\n{}\n{}\n", line(errors[0]), line(errors[1])).parse::<Table>()
        };
        let estimate = |errors| {
            let table = rows(errors).unwrap();
            let row = table.rows()[0].clone();
            table.estimate(row.technique, &row.case).unwrap()
        };
        let (alike, unlike) = (estimate([0.02, 0.02]), estimate([0.01, 0.04]));
        assert!((alike.rmse - 0.02).abs() < 1e-9 && (unlike.rmse - 0.02).abs() < 1e-9);
        assert!((alike.likely_rmse - 0.02).abs() < 1e-6, "{alike:?}");
        // The logarithms are ln 2 away from their mean.
        let wanted = 0.02 * 2.0_f64.powf(CAUTION);
        assert!((unlike.likely_rmse - wanted).abs() < 1e-6, "{unlike:?}");
    }

    #[test]
    fn wrong_lines_are_named() {
        let line = |line: &str| format!("{COLUMNS}\n{line}\n").parse::<Table>();
        let good = "pcss\tx.glb\tlamp\tdisk\t0.1\t0.5\t100\t0\t65536\t0.05\t3.5";
        assert!(line(good).is_ok());
        for (text, wanted) in [
            ("", "line 2: too few columns"),
            (&good.replace("pcss", "soft"), "unknown technique"),
            (&good.replace("disk", "cube"), "`cube` is no light's shape"),
            (&good.replace("0.05", "NaN"), "`NaN` is no number"),
            (&good.replace("65536", "0"), "without pixels"),
            (&good.replace("\t3.5", ""), "not as many columns"),
        ] {
            match line(text) {
                Ok(table) => panic!("{text}: {table:?}"),
                Err(error) => assert!(error.to_string().contains(wanted), "{error}"),
            }
        }
        assert_eq!("x".parse::<Table>(), Err(TableError::Header));
    }
}
