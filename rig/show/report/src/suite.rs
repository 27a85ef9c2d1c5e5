//! A suite that was run: its scenarios with all their attempts, and the table of requirements against scenarios; as
//! JSON, as a page, and against the JSON of an earlier run.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};
use masseter_judge::{Check, Verdict};
use masseter_scenario::input::{MOST_KEPT_BYTES, read_text};
use masseter_terminal::Exit;
use serde::{Deserialize, Serialize};

use crate::text::significant;

/// Version of the form of the JSON.
const FORM: u32 = 1;
/// The word of a verdict on a run that left something untested.
const UNTESTED: &str = "UNTESTED";
/// The word for a scenario that could not run.
pub(crate) const NOT_RUN: &str = "NOT RUN";

/// How a scenario counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// It passed.
    Passed,
    /// It did not, or could not run.
    Failed,
    /// Nothing failed, and something was not tested.
    Untested,
}

impl Outcome {
    /// The word in the list of tests.
    pub fn word(self) -> &'static str {
        match self {
            Self::Passed => "ok",
            Self::Failed => "FAILED",
            Self::Untested => UNTESTED,
        }
    }
}

/// A run of a scenario.
#[derive(Debug, Clone, PartialEq)]
pub struct Attempt {
    /// Its verdict, or why it could not run.
    pub verdict: Result<Verdict, String>,
    /// The folder of the run, if it was kept.
    pub folder: Option<PathBuf>,
}

impl Attempt {
    /// The verdict, or why there is none.
    pub fn verdict(&self) -> Result<&Verdict, &str> {
        self.verdict.as_ref().map_err(String::as_str)
    }

    /// How the attempt counts.
    pub fn outcome(&self) -> Outcome {
        match self.verdict() {
            Ok(verdict) if verdict.exit_code == Exit::Passed => Outcome::Passed,
            Ok(verdict) if verdict.word == UNTESTED => Outcome::Untested,
            _ => Outcome::Failed,
        }
    }

    /// Whether a suite with it does not pass. What is untested is never allowed where a fault or stimulus did not act.
    pub fn is_short(&self, allows_untested: bool) -> bool {
        let is_idle = self.verdict().is_ok_and(Verdict::has_idle_entry);
        match self.outcome() {
            Outcome::Passed => false,
            Outcome::Failed => true,
            Outcome::Untested => is_idle || !allows_untested,
        }
    }

    /// Whether the machine spoiled the run.
    pub fn is_invalid(&self) -> bool {
        self.verdict().is_ok_and(|verdict| verdict.exit_code == Exit::Invalid)
    }

    /// Whether the rig did the same in both, with the same verdict.
    pub fn is_same(&self, other: &Self) -> bool {
        let [one, other] =
            [self, other].map(|of| of.verdict().map(|verdict| (verdict.word, &verdict.digest)));
        one == other
    }

    /// The verdict in a word, and its reason.
    pub(crate) fn word_and_reason(&self) -> [&str; 2] {
        match self.verdict() {
            Ok(verdict) => [verdict.word, &verdict.reason],
            Err(why) => [NOT_RUN, why],
        }
    }

    /// The verdict in a line, or why there is none.
    fn in_words(&self) -> String {
        let [word, reason] = self.word_and_reason();
        if word == NOT_RUN { reason.to_owned() } else { format!("{word}: {reason}") }
    }
}

/// A scenario that was run.
#[derive(Debug, Clone, PartialEq)]
pub struct TestedScenario {
    /// Its name in the suite.
    pub name: String,
    /// Its file.
    pub file: PathBuf,
    /// Its tags.
    pub tags: Vec<String>,
    /// From the first to the last, which counts; at least one.
    pub attempts: Vec<Attempt>,
    /// Whether its time was simulated, so that every attempt must come to the same.
    pub is_simulated: bool,
    /// Whether the suite passes in spite of what is untested.
    pub allows_untested: bool,
    /// The command that shows the run again.
    pub command: String,
    /// The time that all attempts took, s.
    pub took_s: f64,
}

impl TestedScenario {
    /// The attempt that counts.
    pub fn last(&self) -> &Attempt {
        self.attempts.last().expect("every tested scenario has an attempt")
    }

    /// Whether attempts came to different results where none can.
    pub fn differs(&self) -> bool {
        self.is_simulated && self.attempts.windows(2).any(|pair| !pair[0].is_same(&pair[1]))
    }

    /// How it counts.
    pub fn outcome(&self) -> Outcome {
        if self.differs() { Outcome::Failed } else { self.last().outcome() }
    }

    /// Whether the suite does not pass because of it.
    pub fn is_short(&self) -> bool {
        self.differs() || self.last().is_short(self.allows_untested)
    }

    /// How often it was run again.
    pub fn retries(&self) -> usize {
        self.attempts.len() - 1
    }

    /// What it came to, in words.
    pub fn reason(&self) -> String {
        if !self.differs() {
            return self.last().in_words();
        }
        let all: Vec<_> = self.attempts.iter().map(Attempt::in_words).collect();
        format!("runs of the same scenario and seed differ in simulated time: {}", all.join("; then "))
    }

    /// What the plan of its run warns of.
    pub(crate) fn warnings(&self) -> &[String] {
        self.last().verdict().map_or(&[], |verdict| &verdict.warnings)
    }

    fn checks(&self) -> &[Check] {
        self.last().verdict().map_or(&[], |verdict| &verdict.checks)
    }
}

/// A suite that was run.
#[derive(Debug)]
pub struct SuiteReport {
    /// The build of the rig.
    pub masseter: &'static str,
    /// In their order.
    pub tested: Vec<TestedScenario>,
    /// The names of those that an interrupt left.
    pub unrun: Vec<String>,
    /// The number of those that were not chosen.
    pub filtered_out: usize,
    /// What looks like a scenario and is none, each with the reason.
    pub left_out: Vec<String>,
    /// The time that all took, s.
    pub took_s: f64,
    /// An earlier run.
    pub baseline: Option<Baseline>,
}

/// What `test --format json` writes.
#[derive(Debug, Serialize)]
struct Written<'a> {
    form: u32,
    masseter: &'a str,
    result: &'a str,
    took_s: f64,
    passed: usize,
    failed: usize,
    untested: usize,
    filtered_out: usize,
    unrun: &'a [String],
    left_out: &'a [String],
    scenarios: Vec<ScenarioRow<'a>>,
    requirements: Vec<RequirementRow<'a>>,
}

#[derive(Debug, Serialize)]
struct ScenarioRow<'a> {
    name: &'a str,
    file: &'a Path,
    tags: &'a [String],
    outcome: Outcome,
    reason: String,
    took_s: f64,
    command: &'a str,
    attempts: Vec<AttemptRow<'a>>,
    warnings: &'a [String],
    checks: &'a [Check],
}

#[derive(Debug, Serialize)]
struct AttemptRow<'a> {
    word: &'a str,
    reason: &'a str,
    folder: Option<&'a Path>,
}

impl<'a> ScenarioRow<'a> {
    fn of(tested: &'a TestedScenario) -> Self {
        Self {
            name: &tested.name,
            file: &tested.file,
            tags: &tested.tags,
            outcome: tested.outcome(),
            reason: tested.reason(),
            took_s: tested.took_s,
            command: &tested.command,
            attempts: tested.attempts.iter().map(AttemptRow::of).collect(),
            warnings: tested.warnings(),
            checks: tested.checks(),
        }
    }
}

impl<'a> AttemptRow<'a> {
    fn of(attempt: &'a Attempt) -> Self {
        let [word, reason] = attempt.word_and_reason();
        Self { word, reason, folder: attempt.folder.as_deref() }
    }
}

/// A requirement in a scenario, and what it came to in the baseline.
#[derive(Debug, Serialize)]
pub(crate) struct RequirementRow<'a> {
    pub(crate) scenario: &'a str,
    #[serde(flatten)]
    pub(crate) check: &'a Check,
    pub(crate) before: Option<&'a StoredRow>,
}

impl<'a> RequirementRow<'a> {
    fn all_of(tested: &'a TestedScenario, baseline: Option<&'a Baseline>) -> Vec<Self> {
        let row = |check: &'a Check| {
            let key = (tested.name.clone(), check.name.to_string());
            let before = baseline.and_then(|Baseline(rows)| rows.get(&key));
            Self { scenario: &tested.name, check, before }
        };
        tested.checks().iter().filter(|check| check.is_requirement()).map(row).collect()
    }

    pub(crate) fn margin(&self) -> Option<f64> {
        self.check.figures.as_ref()?.margin
    }

    pub(crate) fn relative_margin(&self) -> Option<f64> {
        self.check.figures.as_ref()?.relative_margin
    }

    /// The margin before and now, where both have one in the same unit.
    fn margins(&self) -> Option<[f64; 2]> {
        let (figures, before) = (self.check.figures.as_ref()?, self.before?);
        (before.margin_unit == figures.margin_unit).then_some([before.margin?, figures.margin?])
    }

    /// The change of the margin as a share of what it was.
    pub(crate) fn relative_change(&self) -> Option<f64> {
        let [before, now] = self.margins()?;
        let change = now - before;
        Some(if change == 0.0 { 0.0 } else { change / before.abs() })
    }

    pub(crate) fn unit(&self) -> &'static str {
        self.check.figures.as_ref().map_or("", |figures| figures.margin_unit)
    }
}

/// The requirements of an earlier run of a suite, by scenario and name.
#[derive(Debug)]
pub struct Baseline(BTreeMap<(String, String), StoredRow>);

/// A requirement as `test --format json` wrote it.
#[derive(Debug, Serialize, Deserialize)]
pub(crate) struct StoredRow {
    #[serde(skip_serializing)]
    scenario: String,
    #[serde(skip_serializing)]
    name: String,
    pub(crate) result: String,
    pub(crate) margin: Option<f64>,
    margin_unit: String,
}

#[derive(Debug, Deserialize)]
struct Stored {
    form: u32,
    requirements: Vec<StoredRow>,
}

impl Baseline {
    /// Reads what `test --format json` wrote.
    ///
    /// # Errors
    /// When the file cannot be read, or has another form.
    pub fn read(path: &Path) -> anyhow::Result<Self> {
        let what = || format!("{} is no result of masseter test --format json", path.display());
        let text =
            read_text(path, MOST_KEPT_BYTES).with_context(|| format!("cannot read {}", path.display()))?;
        let Stored { form, requirements } = serde_json::from_str(&text).with_context(what)?;
        ensure!(form == FORM, "{}: its form is {form}, not {FORM}", what());
        let rows = requirements.into_iter().map(|row| ((row.scenario.clone(), row.name.clone()), row));
        Ok(Self(rows.collect()))
    }
}

impl SuiteReport {
    /// The number of scenarios with this outcome.
    pub fn count(&self, outcome: Outcome) -> usize {
        self.tested.iter().filter(|tested| tested.outcome() == outcome).count()
    }

    /// The result of all in a word.
    pub fn word(&self) -> &'static str {
        match self.exit() {
            Exit::Passed if self.unrun.is_empty() => "ok",
            Exit::Passed => "INTERRUPTED",
            Exit::Invalid => "INVALID",
            _ => "FAILED",
        }
    }

    /// The exit code of the suite. Invalid: the machine spoiled the last run of every scenario that did not pass.
    pub fn exit(&self) -> Exit {
        let short: Vec<_> = self.tested.iter().filter(|tested| tested.is_short()).collect();
        if short.is_empty() {
            Exit::Passed
        } else if short.iter().all(|tested| !tested.differs() && tested.last().is_invalid()) {
            Exit::Invalid
        } else {
            Exit::Failed
        }
    }

    /// The result as JSON, which a later run takes as its baseline.
    ///
    /// # Errors
    /// When the text cannot be written.
    pub fn to_json(&self) -> serde_json::Result<String> {
        let written = Written {
            form: FORM,
            masseter: self.masseter,
            result: self.word(),
            took_s: self.took_s,
            passed: self.count(Outcome::Passed),
            failed: self.count(Outcome::Failed),
            untested: self.count(Outcome::Untested),
            filtered_out: self.filtered_out,
            unrun: &self.unrun,
            left_out: &self.left_out,
            scenarios: self.tested.iter().map(ScenarioRow::of).collect(),
            requirements: self.requirements(),
        };
        serde_json::to_string_pretty(&written)
    }

    /// How the margins have changed since the baseline, in a line; none without a baseline.
    pub fn trend_in_words(&self) -> Option<String> {
        self.baseline.as_ref()?;
        let rows = self.requirements();
        let changes: Vec<_> = rows.iter().filter_map(|row| Some((row, row.relative_change()?))).collect();
        let count = |is_so: fn(f64) -> bool| changes.iter().filter(|(_, change)| is_so(*change)).count();
        let [smaller, larger, equal] = [count(|c| c < 0.0), count(|c| c > 0.0), count(|c| c == 0.0)];
        let worst =
            changes.iter().filter(|(_, change)| *change < 0.0).min_by(|(_, a), (_, b)| a.total_cmp(b));
        let worst = worst.and_then(|(row, _)| Some((row, row.margins()?.map(significant))));
        let worst = worst.map_or_else(String::new, |(row, [before, now])| {
            let (scenario, name, unit) = (row.scenario, &row.check.name, row.unit());
            format!("; most of all {scenario}: {name}, {before} → {now} {unit}").trim_end().to_owned()
        });
        let others = match rows.len() - changes.len() {
            0 => String::new(),
            others => format!(", {others} not compared"),
        };
        let gone = self.gone();
        let gone = match gone.first() {
            None => String::new(),
            Some(first) => format!("; {} of the baseline gone, such as {first}", gone.len()),
        };
        let counts = format!("{smaller} smaller, {larger} larger, {equal} equal{others}");
        Some(format!("margins since the baseline: {counts}{worst}{gone}"))
    }

    /// The requirements of the baseline that the scenarios which ran have no more.
    fn gone(&self) -> Vec<String> {
        let known = self.baseline.iter().flat_map(|Baseline(rows)| rows.keys());
        let is_gone = |(scenario, name): &&(String, String)| {
            let mut ran = self.tested.iter().filter(|tested| tested.name == *scenario);
            ran.any(|tested| !RequirementRow::all_of(tested, None).iter().any(|row| row.check.name == *name))
        };
        known.filter(is_gone).map(|(scenario, name)| format!("{scenario}: {name}")).collect()
    }

    /// Every requirement of every scenario, by its id, then by its name.
    pub(crate) fn requirements(&self) -> Vec<RequirementRow<'_>> {
        let of = |tested| RequirementRow::all_of(tested, self.baseline.as_ref());
        let mut rows: Vec<_> = self.tested.iter().flat_map(of).collect();
        rows.sort_by_key(|row| (row.check.id.is_none(), &row.check.id, &row.check.name));
        rows
    }
}

#[cfg(test)]
mod tests;
