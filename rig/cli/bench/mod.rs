//! `masseter bench`: the cost of the rig's parts, each beside a baseline in the same run.
//!
//! Candidates take turns, round by round, because a machine changes its speed from second to second; the ratio within a
//! round counts (`comparison`). No bench judges the rig; the machine is judged by `disturbance`.

pub(crate) mod args;
mod candidate;
mod circumstances;
mod comparison;
mod disturbance;
mod durations;
mod played_run;
mod rate;
mod simulated;
mod table;
mod virtual_time;
mod wake;

use std::fs;
use std::path::Path;

use anyhow::Context;
use masseter_scenario::wording::counted;
use serde::Serialize;

use crate::BUILD;
use crate::run::request::name_of;
use args::{BenchArgs, Kind};
use circumstances::Circumstances;
use comparison::Comparison;
use masseter_terminal::{Exit, Failure, Format, OrFailure, result, status};

/// Version of the form of `results.json`.
const FORM: u32 = 2;

#[derive(Debug, Serialize)]
struct Results {
    form: u32,
    masseter: &'static str,
    circumstances: Circumstances,
    comparisons: Vec<Comparison>,
}

/// Makes the benches one after the other; results so far are kept when a later bench fails.
pub(crate) fn run(args: &BenchArgs) -> Result<Exit, Failure> {
    circumstances::check_cores(&args.kinds, args.cores).usage()?;
    if let Some(folder) = &args.out {
        fs::create_dir_all(folder).with_context(|| format!("cannot create {}", folder.display())).usage()?;
    }
    let mut results = Results {
        form: FORM,
        masseter: BUILD,
        circumstances: Circumstances::on(args.cores),
        comparisons: Vec::new(),
    };
    let measured = measure_each(args, &mut results);
    if args.format == Format::Json {
        results.to_json().and_then(|json| result(&json)).usage()?;
    }
    measured.map_err(|error| {
        let exit = if error.is::<played_run::Interrupted>() { Exit::Interrupted } else { Exit::Usage };
        Failure::with(exit, error)
    })?;
    let disturbed = results.comparisons.iter().any(|comparison| comparison.disturbance.disturbed);
    Ok(if disturbed { Exit::Invalid } else { Exit::Passed })
}

fn measure_each(args: &BenchArgs, results: &mut Results) -> anyhow::Result<()> {
    for kind in &args.kinds {
        let name = name_of(kind);
        status!("bench {name}: {} …", counted(args.rounds.into(), "round"));
        let comparison = match kind {
            Kind::Loop => wake::measure(args.rounds, args.cores[0]),
            Kind::Rate => rate::measure(args.rounds, args.cores),
            Kind::Simulated => simulated::measure(args.rounds, args.cores),
            Kind::Virtual => virtual_time::measure(args.rounds, args.cores[0]),
        };
        results.comparisons.push(comparison.with_context(|| format!("bench {name}"))?);
        if let Some(folder) = &args.out {
            results.write(folder).with_context(|| format!("cannot write to {}", folder.display()))?;
        }
        if args.format == Format::Human {
            results.comparisons.last().map_or(Ok(()), |last| result(&table::text(last)))?;
        }
    }
    Ok(())
}

impl Results {
    fn to_json(&self) -> anyhow::Result<String> {
        Ok(serde_json::to_string_pretty(self).context("cannot write the results")? + "\n")
    }

    /// `results.json`, and a HdrHistogram V2 interval log for each candidate, with one line per round.
    fn write(&self, folder: &Path) -> anyhow::Result<()> {
        fs::write(folder.join("results.json"), self.to_json()?)?;
        for Comparison { bench, candidates, .. } in &self.comparisons {
            candidates.iter().try_for_each(|candidate| candidate.write_log(bench, folder))?;
        }
        Ok(())
    }
}
