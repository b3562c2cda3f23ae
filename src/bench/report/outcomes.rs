//! What has become of each cell of scenes by techniques: nothing stays unexplained.

use std::fmt::Write as _;

use super::analysis::Metric;
use super::format::{error, escape};
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

/// Rows below the matrix: how many cells of each technique have become what.
pub(super) fn counts(page: &mut String, results: &Results) {
    let columns = results.settings.techniques.iter().map(|label| {
        let outcomes = results.references.iter().map(|reference| {
            let entries = results.group(reference);
            let entry = entries.into_iter().find(|entry| entry.label == *label);
            Outcome::of(reference, entry).word()
        });
        outcomes.collect::<Vec<_>>()
    });
    let columns: Vec<Vec<&str>> = columns.collect();
    page.push_str("<tfoot>\n");
    let words = [
        "right",
        "degraded",
        "refused",
        "failed",
        "crashed",
        "unexplained",
    ];
    for word in words {
        let count = |column: &Vec<&str>| column.iter().filter(|other| **other == word).count();
        if columns.iter().all(|column| count(column) == 0) {
            continue;
        }
        let _ = write!(page, "<tr><th scope=\"row\">{word}</th>");
        for column in &columns {
            page.push_str(&cell(Some(count(column).to_string())));
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
