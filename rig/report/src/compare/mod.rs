//! Two runs side by side: their verdicts, their different circumstances, and the change of every figure. Their messages are
//! compared by [`divergence`](crate::divergence).
//!
//! The weight of a change is only an estimate: runs of the same scenario differ by more than their own seconds do.

mod changes;
mod compared_run;

use std::fmt::Write;
use std::path::Path;

use anyhow::Context;
use masseter_terminal::{Exit, Format, result};
use serde::Serialize;

use crate::text::or_dash;
use changes::{Change, ChangeJudgement, changes};
use compared_run::{ComparedRun, Difference, differences};

/// Version of the comparison's form.
const FORM: u32 = 1;

/// The text above the changes.
const LEGEND: &str = "\
beyond spread: by more than three standard errors, estimated from the seconds of each run.
Runs differ by more than their seconds do: repeat both in turn to be certain.
'masseter diff A B' finds the first message in which two runs differ.
";

/// As JSON it is what `report A B --format json` writes.
#[derive(Debug, Serialize)]
struct Comparison {
    form: u32,
    a: ComparedRun,
    b: ComparedRun,
    differs: Vec<Difference>,
    changes: Vec<Change>,
}

/// `masseter report A B`.
///
/// ```no_run
/// use masseter_report::compare;
/// use masseter_terminal::Format;
///
/// compare::runs("runs/before".as_ref(), "runs/after".as_ref(), Format::Human)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn runs(a: &Path, b: &Path, format: Format) -> anyhow::Result<Exit> {
    let (a, b) = (ComparedRun::read(a)?, ComparedRun::read(b)?);
    let differs = differences(&a.circumstances, &b.circumstances);
    let changes = changes(&a.figures, &b.figures);
    let comparison = Comparison { form: FORM, a, b, differs, changes };
    result(&match format {
        Format::Human => comparison.in_words()?,
        Format::Json => {
            serde_json::to_string_pretty(&comparison).context("cannot write the comparison")? + "\n"
        }
    })?;
    Ok(Exit::Passed)
}

impl Comparison {
    fn in_words(&self) -> Result<String, std::fmt::Error> {
        let mut text = String::new();
        for (name, side) in [("A", &self.a), ("B", &self.b)] {
            writeln!(text, "{name}: {}\n   {}: {}", side.path, side.verdict.word, side.verdict.reason)?;
        }
        if !self.differs.is_empty() {
            writeln!(text, "\nwarning: these were not runs of the same\n{:<50} {:<24} B", "", "A")?;
        }
        for Difference { key, a, b } in &self.differs {
            let [a, b] = [a, b].map(|value| or_dash(value.as_deref(), str::to_owned));
            writeln!(text, "{key:<50} {a:<24} {b}")?;
        }
        write!(text, "\n{LEGEND}\n{:<50} {:>14} {:>14} {:>9}\n", "figure", "A", "B", "change")?;
        let of = |judgement| self.changes.iter().filter(move |change| change.judgement == judgement);
        let changed = ChangeJudgement::CHANGED.into_iter().flat_map(of);
        changed.into_iter().try_for_each(|change| row(&mut text, change))?;
        writeln!(text, "{} figures are the same", of(ChangeJudgement::Same).count())?;
        Ok(text)
    }
}

fn row(text: &mut String, change: &Change) -> std::fmt::Result {
    let Change { figure, a, b, judgement, .. } = change;
    let share = a.zip(*b).filter(|(a, _)| *a != 0.0).map(|(a, b)| b / a - 1.0);
    let share = or_dash(share, |share| format!("{:+.1} %", share * 100.0));
    let [a, b] = [a, b].map(|value| or_dash(*value, number));
    writeln!(text, "{figure:<50} {a:>14} {b:>14} {share:>9}  {}", judgement.in_words())
}

fn number(value: f64) -> String {
    if value.fract() == 0.0 { format!("{value}") } else { format!("{value:.5}") }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn side(path: &str, p50_ns: f64, seed: u64) -> ComparedRun {
        let figures = json!({
            "cycles": 5,
            "intervals": [{"name": "control", "p50_ns": p50_ns, "p50_noise_ns": 1.0, "max_ns": p50_ns}],
        });
        let summary = json!({
            "form": crate::summary::FORM, "verdict": {"word": "PASS", "reason": "every check passed"}, "figures": figures,
        });
        ComparedRun::new(path, &summary, &json!({"clock": "rt", "scenario": {"seed": seed}})).unwrap()
    }

    fn comparison() -> Comparison {
        let (a, b) = (side("A", 5000.0, 1), side("B", 6000.0, 2));
        let differs = differences(&a.circumstances, &b.circumstances);
        let changes = changes(&a.figures, &b.figures);
        Comparison { form: FORM, a, b, differs, changes }
    }

    #[test]
    fn verdicts_come_first_then_what_differs_then_what_changed_most_surely() {
        let text = comparison().in_words().unwrap();
        let places = [
            "A: A\n   PASS: every check passed\nB: B\n",
            "warning: these were not runs of the same",
            "scenario.seed                                      1                        2",
            "intervals.control.p50_ns                                     5000           6000   +20.0 %  beyond spread",
            "intervals.control.max_ns ",
            "1 figures are the same",
        ]
        .map(|part| text.find(part).unwrap_or_else(|| panic!("{part} is missing in {text}")));
        assert!(places.is_sorted(), "{text}");
    }

    #[test]
    fn json_has_every_figure_and_the_verdicts() {
        let json = serde_json::to_value(comparison()).unwrap();
        assert_eq!(
            json["a"],
            json!({"path": "A", "verdict": {"word": "PASS", "reason": "every check passed"}})
        );
        assert_eq!(json["differs"], json!([{"key": "scenario.seed", "a": "1", "b": "2"}]));
        assert_eq!(json["changes"].as_array().unwrap().len(), 3);
        assert_eq!(json["changes"][0]["judgement"], "same");
    }
}
