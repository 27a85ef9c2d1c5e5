//! `masseter test`: the scenarios of a folder as a suite, each with its own verdict.
//!
//! Under virtual time they run on all cores, without a recording; a scenario that fails is run again with one. Runs with
//! processes come one after the other, since all of them use the same cores.

pub(crate) mod args;
mod case;
mod outcome;
mod print;
mod trial;

use std::fs;
use std::path::PathBuf;
use std::time::UNIX_EPOCH;

use anyhow::{Context, ensure};
use masseter_report::{JunitRun, junit_of_suite};
use masseter_runtime::clock;
use masseter_terminal::{Exit, Failure, OrFailure, status};
use rayon::prelude::*;

use crate::BUILD;
use crate::interrupts::Interrupts;
use crate::run::args::ClockKind;
use crate::run::needs_processes;
use args::{TestArgs, TestClock};
use case::{Case, Cases};
use outcome::Tested;
use print::Others;
use trial::Trials;

/// Runs the suite; [`Exit::Passed`] only if every scenario passed.
pub(crate) fn test(args: &TestArgs) -> Result<Exit, Failure> {
    let began_ns = clock::now_ns();
    args.check_controller().usage()?;
    let Cases { chosen, filtered_out } = Cases::find(&args.paths, args.filter.as_deref()).usage()?;
    let out = out_folder(args).usage()?;
    let interrupts = Interrupts::listen().context("cannot listen for signals").died()?;
    print::begin(chosen.len()).incomplete()?;
    let all = run_all(&chosen, &Trials { args, out: &out, interrupts: &interrupts }).incomplete()?;
    let took_s = (clock::now_ns() - began_ns) as f64 / 1e9;
    let is_over = |case: &&Case| all.iter().any(|tested| tested.case == **case);
    let unrun: Vec<_> = chosen.iter().filter(|case| !is_over(case)).collect();
    let others = Others { filtered_out, unrun: unrun.len() };
    print::end(&all, others, args.allow_untested, took_s).incomplete()?;
    if let Some(path) = &args.junit {
        let runs = all.iter().map(|tested| tested.junit(args.allow_untested));
        // As errors, since most CI systems show a suite with skipped cases as passed.
        let unrun = unrun.iter().map(|case| {
            JunitRun::new(&case.name, Err("interrupted before its end"), true, 0.0)
                .with(vec![("masseter", BUILD.to_owned())])
        });
        let runs: Vec<_> = runs.chain(unrun).collect();
        let xml = junit_of_suite(&runs, took_s).context("cannot make the JUnit document").incomplete()?;
        fs::write(path, xml).with_context(|| format!("cannot write {}", path.display())).incomplete()?;
    }
    if interrupts.is_stop_requested() {
        status!("masseter: interrupted after {} of {} tests", all.len(), chosen.len());
        return Ok(Exit::Interrupted);
    }
    let has_failed = all.iter().any(|tested| tested.outcome.is_short(args.allow_untested));
    Ok(if has_failed { Exit::Failed } else { Exit::Passed })
}

/// Runs the scenarios, those with processes last; returns the results in the order of the scenarios.
fn run_all(cases: &[Case], trials: &Trials<'_>) -> anyhow::Result<Vec<Tested>> {
    let clocks: Vec<_> = cases.iter().map(|case| clock_of(trials.args, case)).collect();
    let numbered = cases.iter().zip(&clocks).enumerate();
    let (alone, together): (Vec<_>, Vec<_>) =
        numbered.partition(|(_, (_, clock))| **clock != ClockKind::Virtual);
    if trials.args.clock == TestClock::Virtual && !alone.is_empty() {
        let names: Vec<_> = alone.iter().map(|(_, (case, _))| case.name.as_str()).collect();
        status!("in lockstep, one after the other, because they need processes: {}", names.join(", "));
    }
    let run = |(number, (case, clock)): (usize, (&Case, &ClockKind))| {
        let tested = trials.test(case, *clock)?;
        Some(print::line(&tested).map(|()| (number, tested)))
    };
    let mut all: Vec<_> = together.into_par_iter().filter_map(run).collect::<Result<_, _>>()?;
    for case in alone {
        all.extend(run(case).transpose()?);
    }
    // Nothing is in it if every run with processes passed.
    let _ = fs::remove_dir(trials.out);
    all.sort_by_key(|(number, _)| *number);
    Ok(all.into_iter().map(|(_, tested)| tested).collect())
}

/// The clock of a scenario: virtual time has no processes that could be killed, and none for a program of the user.
fn clock_of(args: &TestArgs, case: &Case) -> ClockKind {
    let is_program = args.controller.builder().is_none();
    // A scenario that cannot be read fails under any clock.
    let needs = || masseter_plan::read_scenario(Some(&case.path)).is_ok_and(|found| needs_processes(&found));
    match ClockKind::from(args.clock) {
        ClockKind::Virtual if is_program || needs() => ClockKind::Lockstep,
        clock => clock,
    }
}

/// The folder for the runs that failed, which nothing makes before.
fn out_folder(args: &TestArgs) -> anyhow::Result<PathBuf> {
    let time = humantime::format_rfc3339_millis(UNIX_EPOCH + clock::wall_time()).to_string();
    let by_time = || format!("runs/test-{}", time.replace([':', '-'], "")).into();
    let out = args.out.clone().unwrap_or_else(by_time);
    ensure!(!out.exists(), "{} exists and is not overwritten; choose another --out", out.display());
    Ok(out)
}
