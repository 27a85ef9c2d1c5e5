//! Recordings of several persons and sessions side by side: `masseter compare`. Each recording is analysed again, its jaw cycles
//! give its means, and each person's means give the differences between conditions. Nothing of the rig is compared here:
//! [`compare`](crate::compare) does that of two runs.

mod figures;
mod output;
mod page;
#[cfg(test)]
mod tests;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use anyhow::{Context, bail, ensure};
use masseter_judge::{
    CycleQuantity, JawCycleFigures, Statistic, TrackingSample, Verdict, closed_incisal_m, incisal_m,
    missing_part,
};
use masseter_recording::{RunFolder, manifest_of};
use masseter_scenario::Scenario;
use serde_json::Value;

use crate::run_report::{analyse, choose_cycles};

pub use output::write;

/// A recording of a study.
#[derive(Debug, Clone, Default)]
pub struct Recorded {
    /// The pseudonym; the name of the run's folder where it has none.
    pub person: String,
    /// The session, or what else differs within a person.
    pub condition: String,
    /// The verdict of its run in a word.
    pub verdict: String,
    /// Whether the jaw's pose is the true one, or the estimated one.
    pub is_true: bool,
    /// Its cycles.
    pub jaw: JawCycleFigures,
    /// The incisal point from its closed place: anterior, left, up, mm.
    pub path_mm: Vec<[f64; 3]>,
}

impl Recorded {
    /// Pseudonyms of person and condition.
    fn names(&self) -> [&str; 2] {
        [&self.person, &self.condition]
    }
}

/// What distinguishes recordings: the key that names the person, and the one that differs within a person.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct By {
    /// Key of a scenario, or `patient`.
    pub person: String,
    /// Key of a scenario, or `session`.
    pub condition: String,
}

impl By {
    /// Of `patient,session`.
    ///
    /// # Errors
    /// When there are not two keys.
    pub fn parse(text: &str) -> Result<Self, String> {
        let (person, condition) =
            text.split_once(',').ok_or("write two keys: that of the person, that of the condition")?;
        Ok(Self { person: person.trim().to_owned(), condition: condition.trim().to_owned() })
    }
}

/// Several recordings.
#[derive(Debug, Clone)]
pub struct Study {
    /// In the order of the command line.
    pub recordings: Vec<Recorded>,
    /// What distinguishes the recordings.
    pub by: By,
}

/// A quantity of a kind of cycles.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct Measure {
    /// Kind and side.
    pub group: String,
    /// The quantity.
    pub of: CycleQuantity,
}

/// The change of a quantity within persons, from one condition to another.
#[derive(Debug, Clone, PartialEq)]
pub struct Difference {
    /// What changes.
    pub measure: Measure,
    /// The condition before.
    pub from: String,
    /// The condition after.
    pub to: String,
    /// Of the persons' differences.
    pub statistic: Statistic,
    /// Hedges' *g* of paired values: mean by standard deviation of the differences, corrected for few pairs. None for fewer than
    /// three pairs, and without spread.
    pub effect: Option<f64>,
}

impl Study {
    /// Reads and analyses the runs, each with these assignments of `[study]`.
    ///
    /// # Errors
    /// For a folder without a readable run, for a key that a scenario lacks, for fewer than two runs, and for a run that is
    /// named twice.
    pub fn read(runs: &[PathBuf], by: By, set: &[String]) -> anyhow::Result<Self> {
        ensure!(runs.len() > 1, "name at least two runs");
        let folders = different_folders(runs)?;
        let mut recordings =
            runs.iter().map(|run| recorded(run, &by, set)).collect::<Result<Vec<Recorded>, _>>()?;
        name_persons(&mut recordings, &folders);
        Ok(Self { recordings, by })
    }

    /// In the order of their first recordings.
    pub fn conditions(&self) -> Vec<&str> {
        let mut seen = BTreeSet::new();
        let conditions = self.recordings.iter().map(|recorded| recorded.condition.as_str());
        conditions.filter(|condition| seen.insert(*condition)).collect()
    }

    /// What the cycles of the recordings have, by kind and side, in the order of first appearance.
    pub fn measures(&self) -> Vec<Measure> {
        let mut seen = BTreeSet::new();
        let measures = self.recordings.iter().flat_map(means).map(|(measure, _)| measure);
        measures.filter(|measure| seen.insert(measure.clone())).collect()
    }

    /// The differences of each later condition from the first one, where at least one person has both.
    pub fn differences(&self) -> Vec<Difference> {
        let conditions = self.conditions();
        let [from, others @ ..] = &conditions[..] else { return Vec::new() };
        let measures = self.measures();
        let all = others.iter().flat_map(|to| measures.iter().map(move |measure| (measure, to)));
        all.filter_map(|(measure, to)| self.difference(measure, from, to)).collect()
    }

    fn difference(&self, measure: &Measure, from: &str, to: &str) -> Option<Difference> {
        let [before, after] = [from, to].map(|condition| self.persons(measure, condition));
        let pairs = before.iter().filter_map(|(person, before)| Some(after.get(person)? - before));
        let statistic = Statistic::of(&pairs.collect::<Vec<_>>());
        statistic.mean?;
        let (from, to) = (from.to_owned(), to.to_owned());
        Some(Difference { measure: measure.clone(), from, to, effect: effect(&statistic), statistic })
    }

    /// The mean of each person in a condition, over the person's recordings.
    fn persons(&self, measure: &Measure, condition: &str) -> BTreeMap<&str, f64> {
        let mut values: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
        for recorded in self.recordings.iter().filter(|recorded| recorded.condition == condition) {
            let mean = means(recorded).find(|(other, _)| other == measure).and_then(|(_, of)| of.mean);
            values.entry(&recorded.person).or_default().extend(mean);
        }
        let means = values.into_iter().map(|(person, values)| (person, Statistic::of(&values).mean));
        means.filter_map(|(person, mean)| Some((person, mean?))).collect()
    }
}

/// The statistics of a recording's cycles.
fn means(recorded: &Recorded) -> impl Iterator<Item = (Measure, Statistic)> {
    recorded.jaw.groups.iter().flat_map(|group| {
        let measure = |of| Measure { group: group.name.clone(), of };
        group.quantities.iter().map(move |quantity| (measure(quantity.of), quantity.statistic))
    })
}

fn effect(of: &Statistic) -> Option<f64> {
    let freedom = of.count as f64 - 1.0;
    let sd = of.sd.filter(|sd| *sd > 0.0 && freedom >= 2.0)?;
    Some(of.mean? / sd * (1.0 - 3.0 / (4.0 * freedom - 1.0)))
}

/// The names of the folders in which the recordings lie, behind links such as `runs/latest`.
fn different_folders(runs: &[PathBuf]) -> anyhow::Result<Vec<String>> {
    let mut seen = BTreeMap::new();
    let mut folder = |run: &PathBuf| -> anyhow::Result<String> {
        let recording = RunFolder::open(run)?.recording().canonicalize()?;
        let name = recording.parent().and_then(Path::file_name);
        let name = name.map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        if let Some(same) = seen.insert(recording, run.clone()) {
            bail!("it is the same run as {}: name each run once", same.display());
        }
        Ok(name)
    };
    runs.iter().map(|run| folder(run).with_context(|| run.display().to_string())).collect()
}

/// Names persons without a pseudonym by their folders. Each is a person of its own, also where folders have one name.
fn name_persons(recordings: &mut [Recorded], folders: &[String]) {
    let mut taken: BTreeSet<_> = recordings.iter().map(|recorded| recorded.person.clone()).collect();
    for (number, (recorded, folder)) in (1..).zip(recordings.iter_mut().zip(folders)) {
        if recorded.person.is_empty() {
            let is_taken = taken.contains(folder);
            recorded.person = if is_taken { format!("{folder} ({number})") } else { folder.clone() };
            taken.insert(recorded.person.clone());
        }
    }
}

fn recorded(path: &Path, by: &By, set: &[String]) -> anyhow::Result<Recorded> {
    let read = || -> anyhow::Result<Recorded> {
        let folder = RunFolder::open(path)?;
        let mut manifest = manifest_of(&folder)?;
        choose_cycles(&mut manifest.scenario, set)?;
        let (figures, _) = analyse(&folder, &manifest, None)?;
        if let Some(reason) = missing_part(&figures) {
            bail!("{reason}: 'masseter recording verify' says where; leave the run out, or record it again");
        }
        let scenario = &manifest.scenario;
        let closed_m = closed_incisal_m(scenario).context("the scenario has no closed pose")?;
        let place = |sample: &TrackingSample| {
            ((incisal_m(&sample.actual, scenario.jaw.reference_point_m) - closed_m) * 1e3).into()
        };
        // Before the motion the rig brings the jaw to its first pose.
        let has_begun = |sample: &&TrackingSample| {
            figures.over_time.motion_began_ns.is_some_and(|began_ns| sample.sampled_ns >= began_ns)
        };
        Ok(Recorded {
            person: value_of(scenario, &by.person)?.unwrap_or_default(),
            condition: value_of(scenario, &by.condition)?.unwrap_or_else(|| "all".to_owned()),
            verdict: Verdict::new(&manifest, &figures).word.to_owned(),
            is_true: figures.tracking.actual_source.is_truth(),
            path_mm: figures.track.iter().filter(has_begun).map(place).collect(),
            jaw: figures.jaw_cycles,
        })
    };
    read().with_context(|| path.display().to_string())
}

/// The value of a key; none of a key without a value, such as a pseudonym that is not given.
fn value_of(scenario: &Scenario, key: &str) -> anyhow::Result<Option<String>> {
    let is_of_study = key == "patient" || key == "session";
    let pointer = if is_of_study { format!("/study/{key}") } else { format!("/{}", key.replace('.', "/")) };
    let values = serde_json::to_value(scenario)?;
    let value = values.pointer(&pointer);
    ensure!(value.is_some() || is_of_study, "its scenario has no key '{key}'");
    let text = |value: &Value| value.as_str().map_or_else(|| value.to_string(), str::to_owned);
    Ok(value.filter(|value| !value.is_null()).map(text).filter(|text| !text.is_empty()))
}
