//! The matrix: every case played under virtual time on all cores, then written as a table and a picture.

use std::collections::BTreeMap;
use std::fs;

use anyhow::Context;
use masseter_plan::{RunPlan, read_scenario};
use masseter_recording::output::new_folder;
use masseter_report::Verdict;
use masseter_scenario::Scenario;
use masseter_terminal::{Exit, Failure, OrFailure, result, status};
use rayon::prelude::*;

use super::args::MatrixArgs;
use super::case::{Case, cases, scenario_of};
use super::phases::phases;
use super::picture;
use super::table::{Coverage, HEADER, Row};
use crate::arguments::ControllerKind;
use crate::interrupts::Interrupts;
use crate::run::figures_unrecorded;

/// Plays the matrix; fails if a fault leads the jaw beyond the limits before somebody detects it.
pub(super) fn play(args: &MatrixArgs) -> Result<Exit, Failure> {
    let scenario = read_scenario(args.scenario.as_deref()).usage()?;
    let plan = RunPlan::of_file(scenario, args.scenario.as_deref()).usage()?;
    let cases = cases(&plan.scenario, &phases(&plan), args.filter.as_deref());
    if cases.is_empty() {
        return Err(anyhow::anyhow!("no kind has this text in its name; see masseter faults list")).usage();
    }
    new_folder(&args.out).usage()?;
    let interrupts = Interrupts::listen().context("cannot listen for signals").died()?;
    status!("{} runs", cases.len());
    let rows: Vec<_> =
        cases.into_par_iter().map(|case| row(&plan.scenario, case, &interrupts)).collect::<Result<_, _>>()?;
    interrupts.restore_default_actions();
    if interrupts.is_stop_requested() {
        // Empty as it is, it would only be in the way of the next matrix.
        let _ = fs::remove_dir(&args.out);
        status!("masseter: interrupted: no table is written");
        return Ok(Exit::Interrupted);
    }
    write(args, &rows).incomplete()?;
    let is_bad = |row: &Row| matches!(row.coverage, Coverage::Undetected | Coverage::Late);
    result(&summary(args, &rows)).incomplete()?;
    Ok(if rows.iter().any(is_bad) { Exit::Failed } else { Exit::Passed })
}

fn row(base: &Scenario, case: Case, interrupts: &Interrupts) -> Result<Row, Failure> {
    let scenario = scenario_of(base, &case);
    let (manifest, figures) = figures_unrecorded(&scenario, ControllerKind::default(), interrupts)?;
    let verdict = Verdict::new(&manifest, &figures);
    Ok(Row::new(case, &figures, &verdict, &scenario.checks))
}

fn write(args: &MatrixArgs, rows: &[Row]) -> anyhow::Result<()> {
    let table = HEADER.to_owned() + &rows.iter().map(Row::line).collect::<String>();
    for (name, text) in [("matrix.csv", table), ("matrix.svg", picture::svg(rows))] {
        let path = args.out.join(name);
        fs::write(&path, text).with_context(|| format!("cannot write {}", path.display()))?;
    }
    Ok(())
}

/// How many cases came to what, and each that left the limits.
fn summary(args: &MatrixArgs, rows: &[Row]) -> String {
    let mut counts: BTreeMap<Coverage, usize> = BTreeMap::new();
    for row in rows {
        *counts.entry(row.coverage).or_default() += 1;
    }
    let counts = counts.iter().map(|(coverage, count)| format!("{count:>5}  {}\n", coverage.word()));
    let bad = rows.iter().filter(|row| matches!(row.coverage, Coverage::Undetected | Coverage::Late));
    let bad = bad.map(|row| {
        let detection = row.detection.as_ref().map_or_else(
            || "nobody detected it".to_owned(),
            |(source, cause)| format!("detected by {source} as {cause}"),
        );
        format!(
            "  {} {} {}: {:.3} mm, {:.3}°, {detection}\n",
            row.case.fault,
            row.axis(),
            row.case.phase,
            row.deviation_mm,
            row.deviation_deg
        )
    });
    format!("{}{}\n{}\n", counts.collect::<String>(), bad.collect::<String>(), args.out.display())
}
