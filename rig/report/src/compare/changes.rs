//! The change of every figure, and whether it exceeds the spread of the runs' own seconds.
//!
//! The spread is known where each second of a run has a value of the figure: its standard error is in the summary. The
//! spread of extremes and counts is unknown, and nothing is claimed of them.

use std::collections::{BTreeMap, BTreeSet};

use serde::Serialize;
use serde_json::Value;

/// A change beyond this many standard errors of the difference exceeds the spread.
const BEYOND: f64 = 3.0;
/// Parts of names of figures that are no results: times, places, errors of others.
const NO_RESULTS: [&str; 6] = ["_noise_", "_at_ns", "events", "worst_cycles", "damage", ".bus"];

/// The weight of a change.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum ChangeJudgement {
    BeyondSpread,
    WithinSpread,
    SpreadUnknown,
    OnlyInA,
    OnlyInB,
    Same,
}

impl ChangeJudgement {
    /// Those of changes, the surest first.
    pub(super) const CHANGED: [Self; 5] =
        [Self::BeyondSpread, Self::OnlyInA, Self::OnlyInB, Self::SpreadUnknown, Self::WithinSpread];

    pub(super) fn in_words(self) -> &'static str {
        match self {
            Self::BeyondSpread => "beyond spread",
            Self::WithinSpread => "within spread",
            Self::SpreadUnknown => "spread unknown",
            Self::OnlyInA => "only in A",
            Self::OnlyInB => "only in B",
            Self::Same => "same",
        }
    }
}

/// One figure of two runs.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Change {
    pub figure: String,
    /// None where the run has no such figure.
    pub a: Option<f64>,
    pub b: Option<f64>,
    /// Standard error of the difference by the seconds of both runs, where it is known.
    pub noise: Option<f64>,
    pub judgement: ChangeJudgement,
}

/// Every number by its path.
pub(super) fn flatten(value: &Value) -> BTreeMap<String, f64> {
    let numbers = leaves(value).into_iter().filter(|(_, value)| value.is_number());
    numbers.map(|(path, value)| (path, value.as_f64().unwrap_or(f64::NAN))).collect()
}

/// Everything that is neither a list nor an object by its path.
pub(super) fn leaves(value: &Value) -> BTreeMap<String, Value> {
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

pub(super) fn changes(a: &BTreeMap<String, f64>, b: &BTreeMap<String, f64>) -> Vec<Change> {
    let names: BTreeSet<&String> = a.keys().chain(b.keys()).collect();
    let results = names.into_iter().filter(|name| !NO_RESULTS.iter().any(|part| name.contains(part)));
    results
        .map(|name| {
            let (in_a, in_b) = (a.get(name).copied(), b.get(name).copied());
            let error = |run: &BTreeMap<String, f64>| {
                Some(run.get(&noise_of(name)?)?.max(resolution(name, *run.get(name)?)))
            };
            let noise = error(a).zip(error(b)).map(|(a, b)| a.hypot(b));
            Change { figure: name.clone(), a: in_a, b: in_b, noise, judgement: judge(in_a, in_b, noise) }
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
    if figure.starts_with("intervals.") { masseter_analysis::resolution_ns(value as u64) as f64 } else { 0.0 }
}

fn judge(a: Option<f64>, b: Option<f64>, noise: Option<f64>) -> ChangeJudgement {
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
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn changes_are_held_against_the_spread_of_both_runs() {
        let run = |p50: f64, max: f64, rms: f64| {
            flatten(&json!({
                "tracking": {"rms_mm": rms, "rms_noise_mm": 0.01},
                "intervals": [{"name": "control", "p50_ns": p50, "p50_noise_ns": 3.0, "max_ns": max, "max_at_ns": 7}],
            }))
        };
        let changes = changes(&run(100.0, 900.0, 0.5), &run(110.0, 800.0, 0.52));
        let judged: Vec<_> =
            changes.iter().map(|change| (change.figure.as_str(), change.judgement)).collect();
        assert_eq!(
            judged,
            [
                ("intervals.control.max_ns", ChangeJudgement::SpreadUnknown),
                ("intervals.control.p50_ns", ChangeJudgement::WithinSpread),
                ("tracking.rms_mm", ChangeJudgement::WithinSpread),
            ]
        );
        assert_eq!(judge(Some(30.0), Some(10.0), Some(4.0)), ChangeJudgement::BeyondSpread);
        assert_eq!(judge(Some(10.0), Some(10.0), None), ChangeJudgement::Same);
    }

    #[test]
    fn messages_are_compared_by_bus_and_name_and_missing_ones_are_listed() {
        let message =
            |bus: u64, message: &str, max_ns: u64| json!({"bus": bus, "message": message, "max_ns": max_ns});
        let run = |messages: [Value; 3], cycle: u64| {
            let longest = json!({"cycle": cycle});
            flatten(&json!({"bus_response": {"messages": messages}, "worst_cycles": [longest]}))
        };
        let a = run([message(0, "SYNC", 48), message(0, "TPDO1 1", 190), message(1, "SYNC", 50)], 7);
        let b = run([message(0, "SYNC", 49), message(1, "SYNC", 50), message(1, "TPDO1 4", 200)], 9);
        let changes = changes(&a, &b);
        let told: Vec<_> = changes
            .iter()
            .map(|change| {
                let message = change.figure.strip_prefix("bus_response.messages.").unwrap();
                (message, change.a, change.b, change.judgement)
            })
            .collect();
        assert_eq!(
            told,
            [
                ("can0 SYNC.max_ns", Some(48.0), Some(49.0), ChangeJudgement::SpreadUnknown),
                ("can0 TPDO1 1.max_ns", Some(190.0), None, ChangeJudgement::OnlyInA),
                ("can1 SYNC.max_ns", Some(50.0), Some(50.0), ChangeJudgement::Same),
                ("can1 TPDO1 4.max_ns", None, Some(200.0), ChangeJudgement::OnlyInB),
            ]
        );
    }

    #[test]
    fn a_nanosecond_is_no_change_however_well_the_seconds_agree() {
        let run = |p50: f64| {
            flatten(&json!({"intervals": [{"name": "control", "p50_ns": p50, "p50_noise_ns": 0.0}]}))
        };
        let judged = |a, b| changes(&run(a), &run(b))[0].judgement;
        assert_eq!(judged(16.0, 17.0), ChangeJudgement::WithinSpread);
        assert_eq!(judged(16.0, 24.0), ChangeJudgement::BeyondSpread);
        assert_eq!(judged(400_000.0, 400_400.0), ChangeJudgement::WithinSpread);
    }
}
