//! What a table shows of a cell.

use std::str::FromStr;

use super::super::results::{Entry, Pass, ReferenceEntry};

/// A value of one cell: terms with `*`, `/`, `+` and `-` between them, each with spaces around it,
/// worked out from left to right without precedence, and a heading after ` as `, such as
/// `visibility_ms / counter:triangles as ms each`.
///
/// | term | value |
/// |---|---|
/// | `rmse`, `bias`, `mae`, `p99`, `worst` | error over the penumbra, of visibility 0 to 1 |
/// | `valid_rmse`, `valid_worst` | error over all valid pixels |
/// | `umbra_called_lit`, `lit_called_umbra` | parts of the valid pixels, 0 to 1 |
/// | `mean` | mean visibility over the penumbra |
/// | `frame_ms`, `visibility_ms` | medians, milliseconds |
/// | `ratio`, `visibility_ratio` | these two over those of `hard`, measured in turn in the same run |
/// | `times:LABEL` | `visibility_ms` over that of another technique or rival of the table |
/// | `load_ms`, `first_frame_ms` | before the measured rounds, milliseconds |
/// | `passes:PATTERN` | time on the device of all passes with such names, milliseconds; `*` stands for any text, but never between two spaces |
/// | `count:PATTERN` | number of those passes, without the left-out ones |
/// | `counter:NAME` | a counter, see `antumbra capture --report` |
/// | `triangles` | of the scene |
/// | `penumbra_pixels`, `valid_pixels` | of the truth |
/// | `memory_mib` | the most device memory in use, MiB |
/// | a number | itself |
///
/// A cell without one of the terms has no value: rivals have no passes.
#[derive(Clone, Debug, PartialEq)]
pub struct Column {
    /// Heading.
    pub heading: String,
    first: Term,
    rest: Vec<(Operator, Term)>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Operator {
    Times,
    Over,
    Plus,
    Minus,
}

#[derive(Clone, Debug, PartialEq)]
enum Term {
    Number(f64),
    Named(Name),
    Passes(String),
    Count(String),
    Counter(String),
    /// Time over that of the entry of this label.
    Times(String),
}

macro_rules! names {
    ($($variant:ident $text:literal,)*) => {
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        enum Name {
            $($variant,)*
        }

        impl Name {
            const ALL: &[(&'static str, Self)] = &[$(($text, Self::$variant),)*];
        }
    };
}

names! {
    Rmse "rmse",
    Bias "bias",
    Mae "mae",
    P99 "p99",
    Worst "worst",
    ValidRmse "valid_rmse",
    ValidWorst "valid_worst",
    UmbraCalledLit "umbra_called_lit",
    LitCalledUmbra "lit_called_umbra",
    Mean "mean",
    FrameMs "frame_ms",
    VisibilityMs "visibility_ms",
    Ratio "ratio",
    VisibilityRatio "visibility_ratio",
    LoadMs "load_ms",
    FirstFrameMs "first_frame_ms",
    Triangles "triangles",
    PenumbraPixels "penumbra_pixels",
    ValidPixels "valid_pixels",
    MemoryMib "memory_mib",
}

/// Why a text is no column.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)]
pub enum ColumnError {
    #[error(
        "no column `{name}`; there is {}, passes:PATTERN, count:PATTERN, counter:NAME, times:LABEL, and numbers",
        known()
    )]
    Unknown { name: String },
    #[error("give terms with *, /, + or - between them")]
    Form,
}

fn known() -> String {
    let names: Vec<&str> = Name::ALL.iter().map(|(text, _)| *text).collect();
    names.join(", ")
}

impl FromStr for Column {
    type Err = ColumnError;

    fn from_str(text: &str) -> Result<Self, ColumnError> {
        let padded = format!("{text} ");
        let (terms, heading) = padded.rsplit_once(" as ").unwrap_or((text, text));
        // Patterns have spaces and stars too: an operator stands by itself.
        let mut parts: Vec<(Option<Operator>, Vec<&str>)> = vec![(None, Vec::new())];
        for word in terms.split_whitespace() {
            let operator = match word {
                "*" => Some(Operator::Times),
                "/" => Some(Operator::Over),
                "+" => Some(Operator::Plus),
                "-" => Some(Operator::Minus),
                _ => None,
            };
            match (operator, parts.last_mut()) {
                (Some(operator), _) => parts.push((Some(operator), Vec::new())),
                (None, Some((_, words))) => words.push(word),
                (None, None) => {}
            }
        }
        let mut terms = Vec::new();
        for (operator, words) in parts {
            terms.push((operator, parse_term(&words.join(" "))?));
        }
        let mut terms = terms.into_iter();
        let (_, first) = terms.next().ok_or(ColumnError::Form)?;
        let rest = terms.filter_map(|(operator, term)| Some((operator?, term)));
        let heading = heading.trim();
        if heading.is_empty() {
            return Err(ColumnError::Form);
        }
        Ok(Self {
            heading: heading.into(),
            first,
            rest: rest.collect(),
        })
    }
}

fn parse_term(text: &str) -> Result<Term, ColumnError> {
    if text.is_empty() {
        return Err(ColumnError::Form);
    }
    if let Some(number) = text.parse().ok().filter(|number: &f64| number.is_finite()) {
        return Ok(Term::Number(number));
    }
    if let Some((kind, of)) = text.split_once(':').filter(|(_, of)| !of.is_empty()) {
        match kind {
            "passes" => return Ok(Term::Passes(of.into())),
            "count" => return Ok(Term::Count(of.into())),
            "counter" => return Ok(Term::Counter(of.into())),
            "times" => return Ok(Term::Times(of.into())),
            _ => {}
        }
    }
    let found = Name::ALL.iter().find(|(name, _)| *name == text);
    let unknown = || ColumnError::Unknown { name: text.into() };
    found
        .map(|(_, name)| Term::Named(*name))
        .ok_or_else(unknown)
}

/// What a column's value is taken from.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sources<'a> {
    pub(super) entry: &'a Entry,
    pub(super) reference: &'a ReferenceEntry,
    /// The same scene and light with `hard`.
    pub(super) hard: Option<&'a Entry>,
    /// All of the same scene and light.
    pub(super) all: &'a [&'a Entry],
}

/// How numbers of a column are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Error,
    Ratio,
    Count,
    Other,
}

impl Column {
    pub(super) fn needs_hard(&self) -> bool {
        let is_ratio =
            |term: &Term| matches!(term, Term::Named(Name::Ratio | Name::VisibilityRatio));
        is_ratio(&self.first) || self.rest.iter().any(|(_, term)| is_ratio(term))
    }

    /// Labels that values are over.
    pub(super) fn labels(&self) -> impl Iterator<Item = &str> {
        let rest = self.rest.iter().map(|(_, term)| term);
        std::iter::once(&self.first)
            .chain(rest)
            .filter_map(|term| match term {
                Term::Times(label) => Some(label.as_str()),
                _ => None,
            })
    }

    pub(super) fn kind(&self) -> Kind {
        if !self.rest.is_empty() {
            return Kind::Other;
        }
        match &self.first {
            Term::Counter(_) | Term::Count(_) => Kind::Count,
            Term::Number(_) | Term::Passes(_) => Kind::Other,
            Term::Times(_) => Kind::Ratio,
            Term::Named(name) => match name {
                Name::Rmse
                | Name::Bias
                | Name::Mae
                | Name::P99
                | Name::Worst
                | Name::ValidRmse
                | Name::ValidWorst
                | Name::UmbraCalledLit
                | Name::LitCalledUmbra
                | Name::Mean => Kind::Error,
                Name::Ratio | Name::VisibilityRatio => Kind::Ratio,
                Name::Triangles | Name::PenumbraPixels | Name::ValidPixels => Kind::Count,
                Name::FrameMs
                | Name::VisibilityMs
                | Name::LoadMs
                | Name::FirstFrameMs
                | Name::MemoryMib => Kind::Other,
            },
        }
    }

    /// `None` if the cell lacks a term, or the value is not finite.
    pub(super) fn value(&self, from: Sources<'_>) -> Option<f64> {
        let mut value = self.first.value(from)?;
        for (operator, term) in &self.rest {
            let term = term.value(from)?;
            match operator {
                Operator::Times => value *= term,
                Operator::Over => value /= term,
                Operator::Plus => value += term,
                Operator::Minus => value -= term,
            }
        }
        value.is_finite().then_some(value)
    }
}

impl Term {
    fn value(&self, from: Sources<'_>) -> Option<f64> {
        let counter = |name: &str| from.entry.counters.get(name).map(|count| *count as f64);
        match self {
            Self::Number(number) => Some(*number),
            Self::Named(Name::Triangles) => counter("triangles"),
            Self::Named(name) => name.value(from),
            Self::Counter(name) => counter(name),
            Self::Times(label) => {
                let other = from.all.iter().find(|entry| entry.label == *label)?;
                Some(visibility_ms(from.entry)? / visibility_ms(other)?)
            }
            Self::Passes(pattern) => {
                let passes = matching(pattern, &from.entry.passes);
                let times: Option<Vec<f64>> = passes.iter().map(|pass| pass.gpu_ms).collect();
                let times = times.filter(|times| !times.is_empty())?;
                Some(times.iter().sum())
            }
            Self::Count(pattern) => {
                let passes = &from.entry.passes;
                let ran = |pass: &&&Pass| pass.skipped.is_none();
                let count = matching(pattern, passes).iter().filter(ran).count();
                (!passes.is_empty()).then_some(count as f64)
            }
        }
    }
}

impl Name {
    fn value(self, from: Sources<'_>) -> Option<f64> {
        let Sources {
            entry,
            reference,
            hard,
            ..
        } = from;
        let error = entry.error;
        let penumbra = error.map(|error| error.penumbra);
        let frame = |entry: &Entry| entry.frame_ms.map(|spread| spread.median);
        match self {
            Self::Rmse => Some(penumbra?.rmse),
            Self::Bias => Some(penumbra?.bias),
            Self::Mae => Some(penumbra?.mae),
            Self::P99 => Some(penumbra?.p99),
            Self::Worst => Some(penumbra?.max),
            Self::ValidRmse => Some(error?.valid.rmse),
            Self::ValidWorst => Some(error?.valid.max),
            Self::UmbraCalledLit => Some(error?.umbra_called_lit),
            Self::LitCalledUmbra => Some(error?.lit_called_umbra),
            Self::Mean => entry.penumbra_mean,
            Self::FrameMs => frame(entry),
            Self::VisibilityMs => visibility_ms(entry),
            Self::Ratio => Some(frame(entry)? / frame(hard?)?),
            Self::VisibilityRatio => Some(visibility_ms(entry)? / visibility_ms(hard?)?),
            Self::LoadMs => Some(entry.setup_ms?.load),
            Self::FirstFrameMs => entry.setup_ms?.first_frame,
            // Taken from the counters before.
            Self::Triangles => None,
            Self::PenumbraPixels => Some(reference.penumbra_pixels as f64),
            Self::ValidPixels => Some(reference.valid_pixels as f64),
            Self::MemoryMib => Some(entry.peak_bytes?.device as f64 / f64::from(1 << 20)),
        }
    }
}

fn visibility_ms(entry: &Entry) -> Option<f64> {
    entry.visibility_ms.map(|spread| spread.median)
}

fn matching<'a>(pattern: &str, passes: &'a [Pass]) -> Vec<&'a Pass> {
    let passes = passes.iter();
    passes.filter(|pass| matches(pattern, &pass.name)).collect()
}

/// Whether the whole text fits the pattern, in which each `*` stands for any text.
fn matches(pattern: &str, text: &str) -> bool {
    let Some((start, rest)) = pattern.split_once('*') else {
        return pattern == text;
    };
    let Some(text) = text.strip_prefix(start) else {
        return false;
    };
    let mut ends = text.char_indices().map(|(at, _)| at).chain([text.len()]);
    ends.any(|at| matches(rest, &text[at..]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_terms_with_a_heading() -> Result<(), ColumnError> {
        let column: Column =
            "passes:hard.map 0* * 1000 / triangles - frame_ms as us each".parse()?;
        assert_eq!(column.heading, "us each");
        assert_eq!(column.first, Term::Passes("hard.map 0*".into()));
        let rest = [
            (Operator::Times, Term::Number(1000.0)),
            (Operator::Over, Term::Named(Name::Triangles)),
            (Operator::Minus, Term::Named(Name::FrameMs)),
        ];
        assert_eq!(column.rest, rest);
        assert_eq!(column.kind(), Kind::Other);
        let ratio: Column = "2 * ratio".parse()?;
        assert!(ratio.needs_hard() && !column.needs_hard());
        assert_eq!("rmse".parse::<Column>()?.heading, "rmse");
        for bad in ["", "rmse *", "* rmse", "rmse / / p99", "rmse as ", " as x"] {
            assert_eq!(bad.parse::<Column>(), Err(ColumnError::Form), "{bad}");
        }
        for bad in ["speed", "passes:", "pass:x", "rmse p99", "nan"] {
            let name = bad.into();
            assert_eq!(bad.parse::<Column>(), Err(ColumnError::Unknown { name }));
        }
        Ok(())
    }

    #[test]
    fn patterns_match_whole_names() {
        for (pattern, name, wanted) in [
            ("hard.map 0", "hard.map 0", true),
            ("hard.map", "hard.map 0", false),
            ("hard.map*", "hard.map 0", true),
            ("*.map *.1", "hard.map 0:lamp.1", true),
            ("*.map *.2", "hard.map 0:lamp.1", false),
            ("*map*0*", "hard.map 0:lämp.1", true),
            ("*", "", true),
        ] {
            assert_eq!(matches(pattern, name), wanted, "{pattern} {name}");
        }
    }
}
