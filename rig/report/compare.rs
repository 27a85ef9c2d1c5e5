//! Two runs side by side: the change of every figure, and whether it is more than noise.
//!
//! Noise is known of figures that each second of a run has a value of: their standard error stands in the
//! summary beside them. Of extremes and counts it is not, and nothing is claimed.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::fs;
use std::path::Path;

use anyhow::Context;
use serde::Serialize;
use serde_json::Value;

use crate::cli::Format;
use crate::exit::{Exit, Failure};
use crate::run::folder::RunFolder;
use crate::say::show;

/// A change beyond this many standard errors of the difference is none of chance's.
const BEYOND: f64 = 3.0;
/// Figures that say when something was or what was known of it, and are no results.
const NO_RESULTS: [&str; 3] = ["_noise_", "_at_ns", "events"];

/// One figure of both runs.
#[derive(Debug, Clone, PartialEq, Serialize)]
struct Change {
    figure: String,
    a: f64,
    b: f64,
    /// Standard error of the difference, where it is known.
    noise: Option<f64>,
    judgement: &'static str,
}

/// `masseter report A B`.
pub(crate) fn runs(a: &Path, b: &Path, format: Format) -> Result<Exit, Failure> {
    let changes = changes(&figures(a)?, &figures(b)?);
    show(&match format {
        Format::Human => table(a, b, &changes),
        Format::Json => serde_json::to_string_pretty(&changes).context("cannot write the changes")? + "\n",
    });
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
                let name = item["name"].as_str().or(item["topic"].as_str());
                flatten(below(&name.map_or_else(|| index.to_string(), str::to_owned)), item, figures);
            }
        }
        _ => {}
    }
}

fn changes(a: &BTreeMap<String, f64>, b: &BTreeMap<String, f64>) -> Vec<Change> {
    let results = a.iter().filter(|(name, _)| !NO_RESULTS.iter().any(|part| name.contains(part)));
    let both = results.filter_map(|(name, in_a)| Some((name, *in_a, *b.get(name)?)));
    both.map(|(name, in_a, in_b)| {
        let noise = noise_of(name).and_then(|noise| Some(a.get(&noise)?.hypot(*b.get(&noise)?)));
        let judgement = judge(in_b - in_a, noise);
        Change { figure: name.clone(), a: in_a, b: in_b, noise, judgement }
    })
    .collect()
}

/// Where the noise of a figure stands: `p50_noise_ns` beside `p50_ns`.
fn noise_of(figure: &str) -> Option<String> {
    let (name, unit) = figure.rsplit_once('_')?;
    Some(format!("{name}_noise_{unit}"))
}

fn judge(difference: f64, noise: Option<f64>) -> &'static str {
    match noise {
        _ if difference == 0.0 => "same",
        Some(noise) if difference.abs() > BEYOND * noise => "beyond noise",
        Some(_) => "within noise",
        None => "noise unknown",
    }
}

fn table(a: &Path, b: &Path, changes: &[Change]) -> String {
    let mut text = format!("A: {}\nB: {}\n\n", a.display(), b.display());
    writeln!(text, "{:<44} {:>14} {:>14} {:>9}", "figure", "A", "B", "change")
        .expect("a string takes any text");
    for Change { figure, a, b, judgement, .. } in changes {
        let change = if *a == 0.0 { "–".to_owned() } else { format!("{:+.1} %", (b / a - 1.0) * 100.0) };
        writeln!(text, "{figure:<44} {:>14} {:>14} {change:>9}  {judgement}", number(*a), number(*b))
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
        assert_eq!(judge(-20.0, Some(4.0)), "beyond noise");
        assert_eq!(judge(0.0, None), "same");
    }
}
