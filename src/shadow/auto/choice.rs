//! The choice itself.

use super::table::spec;
use super::{AutoOptions, Case, Expected, Table};
use crate::light::ShapeKind;
use crate::shadow::Technique;
use crate::shadow::mdi::MdiOptions;

/// What is done for a light, and why.
#[derive(Clone, Debug, PartialEq)]
pub struct Choice {
    /// Never [`Technique::Auto`].
    pub technique: Technique,
    /// What the table lets expect of it; `None` where it was not asked.
    pub expected: Option<Expected>,
    /// For people, one line.
    pub reason: String,
}

impl Choice {
    /// The technique that was asked for by name.
    #[must_use]
    pub fn asked(technique: Technique) -> Self {
        Self {
            technique,
            expected: None,
            reason: "asked for".into(),
        }
    }

    /// As [`Technique::from_str`](std::str::FromStr) reads it: gives the same picture again.
    #[must_use]
    pub fn spec(&self) -> String {
        spec(self.technique)
    }
}

/// A candidate for a light.
#[derive(Clone, Copy)]
struct Candidate {
    technique: Technique,
    expected: Expected,
}

/// A technique for each light. Without a budget each light gets the cheapest that is expected to be within the target
/// error, or the one nearest to it. With a budget all begin with the cheapest, and what brings the sum of squared errors
/// down most for its time is taken, as long as the sum of times allows and the target error is not yet reached.
#[must_use]
pub fn choose(table: &Table, cases: &[Case], options: &AutoOptions) -> Vec<Choice> {
    let mut choices: Vec<Option<Choice>> = cases.iter().map(without_table).collect();
    let open: Vec<usize> = (0..cases.len())
        .filter(|at| choices[*at].is_none())
        .collect();
    let candidates: Vec<Vec<Candidate>> = open
        .iter()
        .map(|at| candidates(table, &cases[*at]))
        .collect();
    let picked: Vec<Option<usize>> = match options.budget_ms {
        None => candidates
            .iter()
            .map(|all| cheapest_within(all, options.target_error))
            .collect(),
        Some(budget) => within_budget(&candidates, options.target_error, budget),
    };
    let all_ms: f64 = (candidates.iter().zip(&picked))
        .filter_map(|(all, picked)| Some(all.get((*picked)?)?.expected.ms))
        .sum();
    for ((at, all), picked) in open.into_iter().zip(&candidates).zip(picked) {
        choices[at] = Some(match picked.and_then(|index| all.get(index)) {
            Some(candidate) => Choice {
                technique: candidate.technique,
                expected: Some(candidate.expected),
                reason: reason(candidate, all.len(), all_ms, options),
            },
            None => Choice {
                technique: UNKNOWN,
                expected: None,
                reason: "nothing is known of such a light; a technique that does all".into(),
            },
        });
    }
    choices.into_iter().flatten().collect()
}

/// Does every shape and uneven lights.
const UNKNOWN: Technique = Technique::Mdi(MdiOptions::DEFAULT);

/// Where there is nothing to weigh.
fn without_table(case: &Case) -> Option<Choice> {
    let choice = |technique, reason: &str| {
        Some(Choice {
            technique,
            expected: None,
            reason: reason.into(),
        })
    };
    if case.triangles == 0.0 {
        return choice(
            UNKNOWN,
            "nothing can block this light; only surfaces' horizons are asked",
        );
    }
    if case.shape == ShapeKind::Point {
        return choice(Technique::Hard, "a light without size has hard shadows");
    }
    None
}

/// What can do the light, the cheapest first; what is neither faster nor better than another is left out.
fn candidates(table: &Table, case: &Case) -> Vec<Candidate> {
    let able = table.candidates().iter().filter(|technique| {
        technique.shapes().contains(&case.shape)
            && (!case.is_uneven || technique.does_uneven(case.shape))
    });
    let expected = able.filter_map(|&technique| {
        let expected = table.estimate(technique, case)?;
        Some(Candidate {
            technique,
            expected,
        })
    });
    let mut all: Vec<Candidate> = expected.collect();
    all.sort_by(|a, b| a.expected.ms.total_cmp(&b.expected.ms));
    let mut best = f64::INFINITY;
    all.retain(|candidate| {
        let is_better = candidate.expected.likely_rmse < best;
        best = best.min(candidate.expected.likely_rmse);
        is_better
    });
    all
}

/// Each candidate is better than the one before, so the last is the best.
fn cheapest_within(all: &[Candidate], target: f64) -> Option<usize> {
    let good = all
        .iter()
        .position(|candidate| candidate.expected.likely_rmse <= target);
    good.or_else(|| all.len().checked_sub(1))
}

fn within_budget(lights: &[Vec<Candidate>], target: f64, budget: f64) -> Vec<Option<usize>> {
    let mut picked: Vec<Option<usize>> = lights
        .iter()
        .map(|all| (!all.is_empty()).then_some(0))
        .collect();
    let at = |light: usize, index: usize| lights[light][index].expected;
    loop {
        let spent: f64 = (picked.iter().enumerate())
            .filter_map(|(light, index)| index.map(|index| at(light, index).ms))
            .sum();
        let mut best: Option<(f64, usize, usize)> = None;
        for (light, index) in picked.iter().enumerate() {
            let Some(index) = *index else { continue };
            let now = at(light, index);
            if now.likely_rmse <= target {
                continue;
            }
            for next in index + 1..lights[light].len() {
                let then = at(light, next);
                let more = then.ms - now.ms;
                if spent + more > budget {
                    break;
                }
                let square = |expected: Expected| expected.likely_rmse * expected.likely_rmse;
                let gain = (square(now) - square(then)) / more.max(1e-9);
                if best.is_none_or(|(most, ..)| gain > most) {
                    best = Some((gain, light, next));
                }
                if then.likely_rmse <= target {
                    break;
                }
            }
        }
        let Some((_, light, next)) = best else {
            return picked;
        };
        picked[light] = Some(next);
    }
}

/// `of` is the number of candidates, `all_ms` what is expected of all lights together.
fn reason(candidate: &Candidate, of: usize, all_ms: f64, options: &AutoOptions) -> String {
    let Expected {
        rmse,
        likely_rmse: likely,
        ms,
    } = candidate.expected;
    let target = options.target_error;
    let verdict = match options.budget_ms {
        None if likely <= target => format!("the cheapest expected within {target}"),
        None => format!("none is expected within {target}, and this is the best"),
        // Steps are added up in another order than they were taken in.
        Some(budget) if all_ms > budget * (1.0 + 1e-9) => {
            format!("the cheapest, though {budget} ms are too few: {all_ms:.1} ms for all lights")
        }
        Some(budget) if likely <= target => format!("within {target} and its part of {budget} ms"),
        Some(budget) => format!("the best of its part of {budget} ms"),
    };
    format!(
        "{verdict} of {of} worth considering: error {rmse:.3}, hardly above {likely:.3}, and {ms:.1} ms expected"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn case(shape: ShapeKind) -> Case {
        Case {
            shape,
            angle: 0.15,
            cone: 0.5,
            triangles: 3000.0,
            holes: 0.0,
            pixels: 65536.0,
            is_uneven: false,
        }
    }

    fn options(target_error: f64, budget_ms: Option<f64>) -> AutoOptions {
        AutoOptions {
            target_error,
            budget_ms,
        }
    }

    #[test]
    fn every_light_gets_what_can_do_it() {
        for shape in ShapeKind::ALL {
            for is_uneven in [false, true] {
                for (target, budget) in [
                    (0.02, None),
                    (1e-6, None),
                    (1.0, None),
                    (0.01, Some(1e-3)),
                    (0.01, Some(1e6)),
                ] {
                    let case = Case {
                        is_uneven,
                        ..case(shape)
                    };
                    let choices = choose(Table::reference(), &[case], &options(target, budget));
                    let [choice] = &choices[..] else {
                        panic!("{choices:?}");
                    };
                    assert!(choice.technique.shapes().contains(&shape), "{choice:?}");
                    assert!(
                        !is_uneven || choice.technique.does_uneven(shape),
                        "{choice:?}"
                    );
                    assert_eq!(choice.spec().parse(), Ok(choice.technique));
                    assert_eq!(
                        choices,
                        choose(Table::reference(), &[case], &options(target, budget))
                    );
                }
            }
        }
    }

    #[test]
    fn a_smaller_target_is_never_cheaper_nor_worse() {
        for shape in ShapeKind::ALL {
            let mut last: Option<Expected> = None;
            for target in [0.5, 0.1, 0.05, 0.02, 0.015, 0.01, 0.005, 0.001] {
                let choice =
                    choose(Table::reference(), &[case(shape)], &options(target, None)).remove(0);
                if let (Some(last), Some(now)) = (last, choice.expected) {
                    assert!(
                        now.ms >= last.ms && now.likely_rmse <= last.likely_rmse,
                        "{shape:?} {target}: {choice:?}"
                    );
                }
                last = choice.expected;
            }
        }
    }

    #[test]
    fn lights_share_a_budget() {
        let cases = [ShapeKind::Disk, ShapeKind::Rect, ShapeKind::Line].map(case);
        let total = |budget| -> (f64, f64) {
            let choices = choose(Table::reference(), &cases, &options(1e-3, Some(budget)));
            let expected = choices.iter().filter_map(|choice| choice.expected);
            expected.fold((0.0, 0.0), |(ms, error), e| {
                (ms + e.ms, error + e.likely_rmse * e.likely_rmse)
            })
        };
        let (least, worst) = total(1e-3);
        for choice in choose(Table::reference(), &cases, &options(0.5, Some(0.5 * least))) {
            assert!(choice.reason.contains("are too few"), "{}", choice.reason);
        }
        let mut last = worst;
        for budget in [1.0, 2.0, 4.0, 16.0].map(|factor| factor * least) {
            let (ms, error) = total(budget);
            assert!(ms <= budget * (1.0 + 1e-9), "{ms} of {budget}");
            assert!(error <= last, "{error} after {last}");
            last = error;
        }
        assert!(last < worst);
    }

    #[test]
    fn points_and_what_nothing_blocks_need_no_table() {
        let none = Table::default();
        let auto = AutoOptions::DEFAULT;
        let one = |case| choose(&none, &[case], &auto).remove(0);
        assert_eq!(one(case(ShapeKind::Point)).technique, Technique::Hard);
        let free = Case {
            triangles: 0.0,
            ..case(ShapeKind::Sun)
        };
        assert!(one(free).reason.contains("nothing can block"));
        assert!(
            one(case(ShapeKind::Rect))
                .reason
                .contains("nothing is known")
        );
    }
}
