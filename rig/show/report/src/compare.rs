//! Two runs side by side: their verdicts, their different circumstances, and the change of every figure. Their messages are
//! compared by [`divergence`](crate::divergence).
//!
//! The weight of a change is only an estimate: runs of the same scenario differ by more than their own seconds do. The spread
//! is known where each second of a run has a value of the figure: its standard error is in the summary. The spread of extremes
//! and counts is unknown, and nothing is claimed of them.

use std::collections::{BTreeMap, BTreeSet};
use std::{fmt::Write, path::Path};

use anyhow::{Context, bail, ensure};
use masseter_recording::RunFolder;
use masseter_scenario::input::{MOST_KEPT_BYTES, read_text};
use masseter_terminal::{Exit, Format, result};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::{run_report::SUMMARY_FORM, text::or_dash};

/// Version of the comparison's form.
const FORM: u32 = 1;

/// The text above the changes.
const LEGEND: &str = "\
beyond spread: by more than three standard errors, estimated from the seconds of each run.
Runs differ by more than their seconds do: repeat both in turn to be certain.
'masseter diff A B' finds the first message in which two runs differ, 'masseter compare A B' compares the jaw's motion.
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
            let StoredVerdict { word, reason, warnings } = &side.verdict;
            writeln!(text, "{name}: {}\n   {word}: {reason}", side.path)?;
            warnings.iter().try_for_each(|warning| writeln!(text, "   warning: {warning}"))?;
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
        for (judgement, word) in CHANGED {
            of(judgement).try_for_each(|change| row(&mut text, change, word))?;
        }
        writeln!(text, "{} figures are the same", of(ChangeJudgement::Same).count())?;
        Ok(text)
    }
}

fn row(text: &mut String, Change { figure, a, b, .. }: &Change, word: &str) -> std::fmt::Result {
    let share = a.zip(*b).filter(|(a, _)| *a != 0.0).map(|(a, b)| b / a - 1.0);
    let share = or_dash(share, |share| format!("{:+.1} %", share * 100.0));
    let [a, b] = [a, b].map(|value| or_dash(*value, number));
    writeln!(text, "{figure:<50} {a:>14} {b:>14} {share:>9}  {word}")
}

fn number(value: f64) -> String {
    if value.fract() == 0.0 { format!("{value}") } else { format!("{value:.5}") }
}

/// Keys of the manifest that must agree for two runs to be comparable.
const CIRCUMSTANCES: [&str; 4] = ["scenario", "clock", "machine", "masseter"];

/// One run.
#[derive(Debug, Serialize)]
struct ComparedRun {
    pub path: String,
    pub verdict: StoredVerdict,
    #[serde(skip)]
    pub figures: BTreeMap<String, f64>,
    #[serde(skip)]
    pub circumstances: BTreeMap<String, String>,
}

/// The verdict in a summary.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
struct StoredVerdict {
    pub word: String,
    pub reason: String,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub warnings: Vec<String>,
}

/// A circumstance in which two runs differ; none where one has no such key.
#[derive(Debug, PartialEq, Serialize)]
struct Difference {
    pub key: String,
    pub a: Option<String>,
    pub b: Option<String>,
}

impl ComparedRun {
    fn read(path: &Path) -> anyhow::Result<Self> {
        let folder = RunFolder::open(path)?;
        let summary = folder.summary();
        let help = || format!("{}; 'masseter report {}' writes it", summary.display(), path.display());
        let found = json(&summary).with_context(help)?;
        let manifest = folder.manifest();
        let circumstances = json(&manifest).with_context(|| manifest.display().to_string())?;
        Self::new(&path.display().to_string(), &found, &circumstances).with_context(help)
    }

    fn new(path: &str, summary: &Value, manifest: &Value) -> anyhow::Result<Self> {
        let form = &summary["form"];
        ensure!(*form == SUMMARY_FORM, "it has form {form}, this program compares form {SUMMARY_FORM}");
        let Value::Object(_) = &summary["figures"] else { bail!("it has no figures") };
        let verdict = StoredVerdict::deserialize(&summary["verdict"]).context("it has no verdict")?;
        let of_manifest = CIRCUMSTANCES.map(|key| (key.to_owned(), manifest[key].clone()));
        let circumstances = leaves(&Value::Object(of_manifest.into_iter().collect()));
        let in_words = |value: Value| value.as_str().map_or_else(|| value.to_string(), str::to_owned);
        Ok(Self {
            path: path.to_owned(),
            verdict,
            figures: flatten(&summary["figures"]),
            circumstances: circumstances.into_iter().map(|(key, value)| (key, in_words(value))).collect(),
        })
    }
}

fn json(path: &Path) -> anyhow::Result<Value> {
    Ok(serde_json::from_str(&read_text(path, MOST_KEPT_BYTES)?)?)
}

fn differences(a: &BTreeMap<String, String>, b: &BTreeMap<String, String>) -> Vec<Difference> {
    let keys: BTreeSet<&String> = a.keys().chain(b.keys()).collect();
    let differing = keys.into_iter().filter(|key| a.get(*key) != b.get(*key));
    let difference =
        |key: &String| Difference { key: key.clone(), a: a.get(key).cloned(), b: b.get(key).cloned() };
    differing.map(difference).collect()
}

/// A change beyond this many standard errors of the difference exceeds the spread.
const BEYOND: f64 = 3.0;
/// Parts of names of figures that are no results: times, places, errors of others. Jaw cycles are those of a person, which
/// `masseter compare` compares.
const NO_RESULTS: [&str; 7] = ["_noise_", "_at_ns", "events", "worst_cycles", "damage", ".bus", "jaw_cycles"];

/// The weight of a change.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
enum ChangeJudgement {
    BeyondSpread,
    WithinSpread,
    SpreadUnknown,
    OnlyInA,
    OnlyInB,
    Same,
}

/// Judgements of changes in words, the surest first.
const CHANGED: [(ChangeJudgement, &str); 5] = [
    (ChangeJudgement::BeyondSpread, "beyond spread"),
    (ChangeJudgement::OnlyInA, "only in A"),
    (ChangeJudgement::OnlyInB, "only in B"),
    (ChangeJudgement::SpreadUnknown, "spread unknown"),
    (ChangeJudgement::WithinSpread, "within spread"),
];

/// One figure of two runs.
#[derive(Debug, Clone, PartialEq, Serialize)]
struct Change {
    pub figure: String,
    /// None where the run has no such figure.
    pub a: Option<f64>,
    pub b: Option<f64>,
    /// Standard error of the difference by the seconds of both runs, where it is known.
    pub noise: Option<f64>,
    pub judgement: ChangeJudgement,
}

/// Every number by its path.
fn flatten(value: &Value) -> BTreeMap<String, f64> {
    let numbers = leaves(value).into_iter().filter(|(_, value)| value.is_number());
    numbers.map(|(path, value)| (path, value.as_f64().unwrap_or(f64::NAN))).collect()
}

/// Everything that is neither a list nor an object by its path.
fn leaves(value: &Value) -> BTreeMap<String, Value> {
    let mut found = BTreeMap::new();
    gather(String::new(), value, &mut found);
    found
}

fn gather(path: String, value: &Value, found: &mut BTreeMap<String, Value>) {
    let below = |name: &str| if path.is_empty() { name.to_owned() } else { format!("{path}.{name}") };
    match value {
        Value::Object(fields) => fields.iter().for_each(|(name, value)| gather(below(name), value, found)),
        Value::Array(items) => {
            for (index, item) in items.iter().enumerate() {
                gather(below(&name_of(item).unwrap_or_else(|| index.to_string())), item, found);
            }
        }
        leaf => {
            found.insert(path, leaf.clone());
        }
    }
}

/// The name of an item of a list, whose order may differ between runs.
fn name_of(item: &Value) -> Option<String> {
    let text = |key: &str| item[key].as_str().map(str::to_owned);
    let message = || Some(format!("can{} {}", item["bus"].as_u64()?, text("message")?));
    text("name").or_else(|| text("topic")).or_else(message)
}

fn changes(a: &BTreeMap<String, f64>, b: &BTreeMap<String, f64>) -> Vec<Change> {
    let names: BTreeSet<&String> = a.keys().chain(b.keys()).collect();
    let results = names.into_iter().filter(|name| !NO_RESULTS.iter().any(|part| name.contains(part)));
    results
        .map(|name| {
            let (in_a, in_b) = (a.get(name).copied(), b.get(name).copied());
            let error = |run: &BTreeMap<String, f64>| {
                Some(run.get(&noise_of(name)?)?.max(resolution(name, *run.get(name)?)))
            };
            let noise = error(a).zip(error(b)).map(|(a, b)| a.hypot(b));
            Change {
                figure: name.clone(),
                a: in_a,
                b: in_b,
                noise,
                judgement: judge_change(in_a, in_b, noise),
            }
        })
        .collect()
}

/// The key of a figure's standard error: `p50_noise_ns` beside `p50_ns`.
fn noise_of(figure: &str) -> Option<String> {
    let (name, unit) = figure.rsplit_once('_')?;
    Some(format!("{name}_noise_{unit}"))
}

/// The least error of a figure: the resolution of its histogram, even where all seconds agree.
fn resolution(figure: &str, value: f64) -> f64 {
    if figure.starts_with("intervals.") { masseter_judge::resolution_ns(value as u64) as f64 } else { 0.0 }
}

fn judge_change(a: Option<f64>, b: Option<f64>, noise: Option<f64>) -> ChangeJudgement {
    let (Some(a), Some(b)) = (a, b) else {
        return if a.is_some() { ChangeJudgement::OnlyInA } else { ChangeJudgement::OnlyInB };
    };
    let difference = b - a;
    match noise {
        _ if difference == 0.0 => ChangeJudgement::Same,
        Some(noise) if difference.abs() > BEYOND * noise => ChangeJudgement::BeyondSpread,
        Some(_) => ChangeJudgement::WithinSpread,
        None => ChangeJudgement::SpreadUnknown,
    }
}

#[cfg(test)]
mod tests;
