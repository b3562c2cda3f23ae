//! What has become of each cell of scenes by techniques: nothing stays unexplained.

use std::fmt::Write as _;

use super::analysis::Metric;
use super::format::{error, escape};
use super::scene_name;
use super::summary::cell;
use crate::bench::results::{Entry, FailureKind, ReferenceEntry, Results};

/// Up to this root mean square error a picture counts as right.
pub(super) const RIGHT: f64 = 0.02;

/// Of one technique on one scene and light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Outcome<'r> {
    /// Within [`RIGHT`] of the truth.
    Right(f64),
    /// Farther from it.
    Degraded(f64),
    /// The technique says that it cannot do this.
    Refused(&'r str),
    /// An error, or numbers that are none.
    Failed(&'r str),
    /// The process ended.
    Crashed(&'r str),
    /// Nobody has measured it.
    Unexplained,
}

impl<'r> Outcome<'r> {
    /// By the error of the penumbra, where the truth has one, else by that of all valid pixels.
    pub(super) fn of(reference: &ReferenceEntry, entry: Option<&'r Entry>) -> Self {
        let Some(entry) = entry else {
            return Self::Unexplained;
        };
        if let Some(failure) = &entry.failure {
            return match failure.kind {
                FailureKind::Unsupported => Self::Refused(&failure.reason),
                FailureKind::Failed => Self::Failed(&failure.reason),
                FailureKind::Crashed => Self::Crashed(&failure.reason),
            };
        }
        match Metric::of(reference).rmse(entry) {
            Some(rmse) if rmse <= RIGHT => Self::Right(rmse),
            Some(rmse) if rmse.is_finite() => Self::Degraded(rmse),
            Some(_) => Self::Failed("its error is no number"),
            None => Self::Unexplained,
        }
    }

    fn word(self) -> &'static str {
        match self {
            Self::Right(_) => "right",
            Self::Degraded(_) => "degraded",
            Self::Refused(_) => "refused",
            Self::Failed(_) => "failed",
            Self::Crashed(_) => "crashed",
            Self::Unexplained => "unexplained",
        }
    }

    /// A cell of the matrix.
    pub(super) fn html(self) -> String {
        let word = self.word();
        match self {
            Self::Right(rmse) | Self::Degraded(rmse) => {
                // From 0.001 to 0.5, by its logarithm.
                let part = (rmse.max(1e-6).log10() + 3.0) / (0.5f64.log10() + 3.0);
                let tint = (70.0 * part.clamp(0.0, 1.0)).round();
                format!(
                    "<td class=\"n tint\" data-outcome=\"{word}\" style=\"--part:{tint}%\">{}</td>",
                    error(rmse)
                )
            }
            Self::Refused(reason) | Self::Failed(reason) | Self::Crashed(reason) => format!(
                "<td class=\"n bad\" data-outcome=\"{word}\" title=\"{}\">{word}</td>",
                escape(reason)
            ),
            Self::Unexplained => {
                format!("<td class=\"n bad\" data-outcome=\"{word}\">{word}</td>")
            }
        }
    }
}

/// The matrix in Markdown: a row for each scene and light, a column for each technique, and below it why cells
/// have no error. What is farther than [`RIGHT`] from the truth is in italics.
pub(super) fn markdown(results: &Results) -> String {
    let labels = &results.settings.techniques;
    let mut page = format!(
        "| | {} |\n|---|{}\n",
        labels.join(" | "),
        "--:|".repeat(labels.len())
    );
    let mut reasons: Vec<String> = Vec::new();
    for reference in &results.references {
        let _ = write!(page, "| {}", scene_name(&reference.scene));
        let lights = results.references.iter();
        if lights
            .filter(|other| other.scene == reference.scene)
            .count()
            > 1
        {
            let _ = write!(page, ", {}", reference.light);
        }
        page.push_str(" |");
        let entries = results.group(reference);
        for label in labels {
            let entry = entries.iter().find(|entry| entry.label == *label);
            let outcome = Outcome::of(reference, entry.copied());
            let cell = match outcome {
                Outcome::Right(rmse) => error(rmse),
                Outcome::Degraded(rmse) => format!("*{}*", error(rmse)),
                Outcome::Refused(reason) | Outcome::Failed(reason) | Outcome::Crashed(reason) => {
                    let known = reasons.iter().position(|other| other == reason);
                    let number = known.unwrap_or_else(|| {
                        reasons.push(reason.to_string());
                        reasons.len() - 1
                    });
                    format!("{} ({})", outcome.word(), number + 1)
                }
                Outcome::Unexplained => outcome.word().to_string(),
            };
            let _ = write!(page, " {cell} |");
        }
        page.push('\n');
    }
    for (word, counts) in counted(results) {
        let cells = counts.iter().map(|count| format!(" {count} |"));
        let _ = writeln!(page, "| **{word}** |{}", cells.collect::<String>());
    }
    for (at, reason) in reasons.iter().enumerate() {
        let separator = if at == 0 { "\n" } else { "" };
        let _ = writeln!(page, "{separator}{}. {reason}", at + 1);
    }
    page
}

/// How many cells of each technique have become what, without what none has become.
fn counted(results: &Results) -> Vec<(&'static str, Vec<usize>)> {
    let columns = results.settings.techniques.iter().map(|label| {
        let outcomes = results.references.iter().map(|reference| {
            let entries = results.group(reference);
            let entry = entries.into_iter().find(|entry| entry.label == *label);
            Outcome::of(reference, entry).word()
        });
        outcomes.collect::<Vec<_>>()
    });
    let columns: Vec<Vec<&str>> = columns.collect();
    let words = [
        "right",
        "degraded",
        "refused",
        "failed",
        "crashed",
        "unexplained",
    ];
    let rows = words.into_iter().map(|word| {
        let count = |column: &Vec<&str>| column.iter().filter(|other| **other == word).count();
        (word, columns.iter().map(count).collect::<Vec<_>>())
    });
    rows.filter(|(_, counts)| counts.iter().any(|count| *count > 0))
        .collect()
}

/// Rows below the matrix: how many cells of each technique have become what.
pub(super) fn counts(page: &mut String, results: &Results) {
    page.push_str("<tfoot>\n");
    for (word, counts) in counted(results) {
        let _ = write!(page, "<tr><th scope=\"row\">{word}</th>");
        for count in counts {
            page.push_str(&cell(Some(count.to_string())));
        }
        page.push_str("</tr>\n");
    }
    page.push_str("</tfoot>\n");
}

#[cfg(test)]
mod tests {
    use super::super::tests::results;
    use super::*;

    #[test]
    fn each_cell_is_explained() {
        let mut results = results();
        let reference = results.references[0].clone();
        let of =
            |results: &Results, at: usize| Outcome::of(&reference, results.images.get(at)).html();
        assert!(of(&results, 0).contains("data-outcome=\"degraded\""));
        assert!(of(&results, 0).contains("0.250"));
        let crashed = of(&results, 1);
        assert!(
            crashed.contains("data-outcome=\"crashed\"") && crashed.contains("signal &lt;11&gt;")
        );
        assert!(of(&results, 2).contains("unexplained"));
        let mut page = String::new();
        counts(&mut page, &results);
        assert!(
            page.contains(">degraded</th><td class=\"n\">1</td><td class=\"n\">0</td>"),
            "{page}"
        );
        assert!(
            page.contains(">crashed</th>") && !page.contains("unexplained"),
            "{page}"
        );
        let text = markdown(&results);
        let lines: Vec<&str> = text.lines().collect();
        assert!(
            lines[0].starts_with("| | ") && lines[1].starts_with("|---|--:|"),
            "{text}"
        );
        assert!(lines[2].contains("| *0.250* | crashed (1) |"), "{text}");
        assert!(text.contains("| **degraded** | 1 | 0 |"), "{text}");
        assert!(
            lines
                .last()
                .is_some_and(|line| line.starts_with("1. ") && line.contains("signal"))
        );
        for (rmse, word) in [(0.02, "right"), (f64::NAN, "failed")] {
            if let Some(error) = &mut results.images[0].error {
                error.penumbra.rmse = rmse;
            }
            assert_eq!(Outcome::of(&reference, results.images.first()).word(), word);
        }
        results.images[0].error = None;
        assert_eq!(
            Outcome::of(&reference, results.images.first()),
            Outcome::Unexplained
        );
    }
}
