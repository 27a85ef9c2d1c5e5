//! Two runs side by side: the change of every figure, and whether it is more than noise.
//!
//! Noise is known of figures that each second of a run has a value of: their standard error stands in the
//! summary beside them. Of extremes and counts it is not, and nothing is claimed.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::fs;
use std::path::Path;

use anyhow::Context;
use serde::Serialize;
use serde_json::Value;

use super::table::or_dash;
use crate::cli::Format;
use crate::exit::Exit;
use crate::run::folder::RunFolder;
use crate::say::result;

/// A change beyond this many standard errors of the difference is none of chance's.
const BEYOND: f64 = 3.0;
/// Figures that say when or where something was or what was known of it, and are no results.
const NO_RESULTS: [&str; 6] = ["_noise_", "_at_ns", "events", "worst_cycles", "damage", ".bus"];

/// One figure of two runs.
#[derive(Debug, Clone, PartialEq, Serialize)]
struct Change {
    figure: String,
    /// None where the run has no such figure.
    a: Option<f64>,
    b: Option<f64>,
    /// Standard error of the difference, where it is known.
    noise: Option<f64>,
    judgement: &'static str,
}

/// `masseter report A B`.
pub(crate) fn runs(a: &Path, b: &Path, format: Format) -> anyhow::Result<Exit> {
    let changes = changes(&figures(a)?, &figures(b)?);
    result(&match format {
        Format::Human => table(a, b, &changes),
        Format::Json => serde_json::to_string_pretty(&changes).context("cannot write the changes")? + "\n",
    })?;
    Ok(Exit::Passed)
}

/// Every number of a run's summary by its path.
fn figures(folder: &Path) -> anyhow::Result<BTreeMap<String, f64>> {
    let path = RunFolder::open(folder)?.summary();
    let help = || format!("{}; `masseter report {}` writes it", path.display(), folder.display());
    let text = fs::read_to_string(&path).with_context(help)?;
    let summary: Value = serde_json::from_str(&text).with_context(help)?;
    let mut figures = BTreeMap::new();
    flatten(String::new(), &summary["figures"], &mut figures);
    Ok(figures)
}

fn flatten(path: String, value: &Value, figures: &mut BTreeMap<String, f64>) {
    let below = |name: &str| if path.is_empty() { name.to_owned() } else { format!("{path}.{name}") };
    match value {
        Value::Number(number) => {
            figures.insert(path, number.as_f64().unwrap_or(f64::NAN));
        }
        Value::Object(fields) => fields.iter().for_each(|(name, value)| flatten(below(name), value, figures)),
        Value::Array(items) => {
            for (index, item) in items.iter().enumerate() {
                flatten(below(&name_of(item).unwrap_or_else(|| index.to_string())), item, figures);
            }
        }
        _ => {}
    }
}

/// What tells an item of a list from the others, in whatever order they stand.
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
            let noise = noise_of(name).and_then(|noise| Some(a.get(&noise)?.hypot(*b.get(&noise)?)));
            Change { figure: name.clone(), a: in_a, b: in_b, noise, judgement: judge(in_a, in_b, noise) }
        })
        .collect()
}

/// Where the noise of a figure stands: `p50_noise_ns` beside `p50_ns`.
fn noise_of(figure: &str) -> Option<String> {
    let (name, unit) = figure.rsplit_once('_')?;
    Some(format!("{name}_noise_{unit}"))
}

fn judge(a: Option<f64>, b: Option<f64>, noise: Option<f64>) -> &'static str {
    let (Some(a), Some(b)) = (a, b) else { return if a.is_some() { "only in A" } else { "only in B" } };
    let difference = b - a;
    match noise {
        _ if difference == 0.0 => "same",
        Some(noise) if difference.abs() > BEYOND * noise => "beyond noise",
        Some(_) => "within noise",
        None => "noise unknown",
    }
}

fn table(a: &Path, b: &Path, changes: &[Change]) -> String {
    let mut text = format!("A: {}\nB: {}\n\n", a.display(), b.display());
    writeln!(text, "{:<50} {:>14} {:>14} {:>9}", "figure", "A", "B", "change")
        .expect("a string takes any text");
    for Change { figure, a, b, judgement, .. } in changes {
        let share = a.zip(*b).filter(|(a, _)| *a != 0.0).map(|(a, b)| b / a - 1.0);
        let change = or_dash(share, |share| format!("{:+.1} %", share * 100.0));
        let [a, b] = [a, b].map(|value| or_dash(*value, number));
        writeln!(text, "{figure:<50} {a:>14} {b:>14} {change:>9}  {judgement}")
            .expect("a string takes any text");
    }
    text
}

fn number(value: f64) -> String {
    if value.fract() == 0.0 { format!("{value}") } else { format!("{value:.5}") }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn flat(value: &Value) -> BTreeMap<String, f64> {
        let mut figures = BTreeMap::new();
        flatten(String::new(), value, &mut figures);
        figures
    }

    #[test]
    fn changes_are_held_against_their_noise() {
        let run = |p50: f64, max: f64, rms: f64| {
            flat(&json!({
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
                ("intervals.control.max_ns", "noise unknown"),
                ("intervals.control.p50_ns", "within noise"),
                ("tracking.rms_mm", "within noise"),
            ]
        );
        assert_eq!(judge(Some(30.0), Some(10.0), Some(4.0)), "beyond noise");
        assert_eq!(judge(Some(10.0), Some(10.0), None), "same");
    }

    #[test]
    fn messages_are_compared_by_bus_and_name_and_what_one_run_lacks_is_told() {
        let message =
            |bus: u64, message: &str, max_ns: u64| json!({"bus": bus, "message": message, "max_ns": max_ns});
        let run = |messages: [Value; 3], cycle: u64| {
            let longest = json!({"cycle": cycle});
            flat(&json!({"bus_response": {"messages": messages}, "worst_cycles": [longest]}))
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
                ("can0 SYNC.max_ns", Some(48.0), Some(49.0), "noise unknown"),
                ("can0 TPDO1 1.max_ns", Some(190.0), None, "only in A"),
                ("can1 SYNC.max_ns", Some(50.0), Some(50.0), "same"),
                ("can1 TPDO1 4.max_ns", None, Some(200.0), "only in B"),
            ]
        );
        let text = table(Path::new("A"), Path::new("B"), &changes);
        assert!(text.contains("190              –         –  only in A"), "{text}");
    }
}
