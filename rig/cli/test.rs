//! `masseter test`: the scenarios of folders as a suite, listed in the form of `cargo test`.

use std::fs;
use std::path::PathBuf;

use anyhow::{Context, ensure};
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::{Args, ValueEnum};
use masseter_recording::time_in_names;
use masseter_report::{JunitRun, junit_of_suite};
use masseter_runtime::clock;
use masseter_scenario::wording::counted;
use masseter_terminal::{Exit, Failure, OrFailure, result, result_line, status};

use super::arguments::parse_controller;
use crate::BUILD;
use crate::run::interrupts::Interrupts;
use crate::run::request::{ClockKind, ControllerChoice};
use crate::run::runner::Runner;
use crate::vary::suite::{Case, Cases, Outcome, Suite, Tested};

/// The arguments of `test`.
#[derive(Debug, Clone, Args)]
#[command(
    after_help = "Examples:\n  masseter test scenarios\n  masseter test scenarios --filter encoder --junit junit.xml"
)]
pub(super) struct TestArgs {
    /// Folders with scenarios (*.toml), and scenarios
    #[arg(required = true, value_name = "DIR|FILE")]
    paths: Vec<PathBuf>,
    /// Clock of the runs
    #[arg(long, default_value = "virtual", value_parser = test_clocks())]
    clock: ClockKind,
    /// Who controls the robot: motion, hold, or the path of your own program
    #[arg(
        long,
        value_name = "motion|hold|PATH",
        value_parser = parse_controller,
        default_value = "motion",
        hide_default_value = true
    )]
    controller: ControllerChoice,
    /// Run only the scenarios with this text in their names
    #[arg(long, value_name = "TEXT")]
    filter: Option<String>,
    /// Run a failed scenario up to this many times again, in lockstep and in real time
    #[arg(long, value_name = "N", default_value_t, hide_default_value = true)]
    retries: u32,
    /// Exit with 0 in spite of scenarios that left something untested
    #[arg(long)]
    allow_untested: bool,
    /// Write every scenario and its checks into this file, as CI systems read them
    #[arg(long, value_name = "FILE")]
    junit: Option<PathBuf>,
    /// Folder for the runs that failed; must not exist [default: runs/test-UTC_TIME]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

/// The clocks of a suite: all that a run can have, but for the choice by the machine.
fn test_clocks() -> impl TypedValueParser<Value = ClockKind> {
    PossibleValuesParser::new([
        PossibleValue::new("virtual")
            .help("Virtual time, on all cores; what needs processes runs in lockstep"),
        PossibleValue::new("lockstep")
            .help("Simulated time in three processes, one scenario after the other"),
        PossibleValue::new("rt").help("Real time, one scenario after the other"),
    ])
    .map(|name| ClockKind::from_str(&name, false).expect("each is the name of a clock"))
}

/// Runs the suite; [`Exit::Passed`] only if every scenario passed.
pub(super) fn test(args: &TestArgs) -> Result<Exit, Failure> {
    let began_ns = clock::now_ns();
    check_controller(&args.controller).usage()?;
    let Cases { chosen, filtered_out } = Cases::find(&args.paths, args.filter.as_deref()).usage()?;
    let out = out_folder(args).usage()?;
    let interrupts = Interrupts::of_verb()?;
    result_line!("\nrunning {}", counted(chosen.len() as u64, "test")).incomplete()?;
    let suite = Suite {
        runner: Runner { controller: &args.controller, interrupts: &interrupts },
        clock: args.clock,
        retries: args.retries,
        allow_untested: args.allow_untested,
        out: &out,
    };
    let all = suite.run_all(&chosen, print_tested).incomplete()?;
    let took_s = (clock::now_ns() - began_ns) as f64 / 1e9;
    let is_over = |case: &&Case| all.iter().any(|tested| tested.case == **case);
    let unrun: Vec<_> = chosen.iter().filter(|case| !is_over(case)).collect();
    let others = Others { filtered_out, unrun: unrun.len() };
    result(&summary(&all, others, args.allow_untested, took_s)).incomplete()?;
    if let Some(path) = &args.junit {
        let runs = all.iter().map(|tested| junit_run(tested, args.allow_untested));
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
    let has_failed = all.iter().any(|tested| tested.outcome().is_short(args.allow_untested));
    Ok(if has_failed { Exit::Failed } else { Exit::Passed })
}

/// Refuses a controller that somebody else would have to start, and a suite without one.
fn check_controller(controller: &ControllerChoice) -> anyhow::Result<()> {
    let is_started = !matches!(controller, ControllerChoice::External | ControllerChoice::None);
    ensure!(is_started, "a suite starts its controllers itself: use --controller motion, hold, or a path");
    Ok(())
}

fn out_folder(args: &TestArgs) -> anyhow::Result<PathBuf> {
    let out = args.out.clone().unwrap_or_else(|| format!("runs/test-{}", time_in_names()).into());
    ensure!(!out.exists(), "{} exists and is not overwritten; choose another --out", out.display());
    Ok(out)
}

/// A scenario as a test suite of a JUnit document.
fn junit_run(tested: &Tested, allow_untested: bool) -> JunitRun<'_> {
    let verdict = tested.verdict.as_ref().map_err(String::as_str);
    let properties = vec![
        ("masseter", BUILD.to_owned()),
        ("outcome", tested.outcome().word().to_owned()),
        ("retries", tested.retries.to_string()),
    ];
    let is_short = tested.outcome().is_short(allow_untested);
    JunitRun::new(&tested.case.name, verdict, is_short, tested.took_s).with(properties)
}

/// Prints the line of a test that is over.
fn print_tested(tested: &Tested) -> anyhow::Result<()> {
    let times =
        if tested.retries == 1 { "1 retry".to_owned() } else { format!("{} retries", tested.retries) };
    let retried = match (tested.outcome(), tested.retries) {
        (_, 0) => String::new(),
        (Outcome::Passed, _) => format!(" (only after {times})"),
        _ => format!(" (also after {times})"),
    };
    result_line!("test {} ... {}{retried}", tested.case.name, tested.outcome().word())
}

/// The numbers of scenarios without a result.
#[derive(Debug, Clone, Copy)]
struct Others {
    filtered_out: usize,
    /// Because the user interrupted.
    unrun: usize,
}

/// What failed and why, then the result of the suite.
fn summary(all: &[Tested], others: Others, allow_untested: bool, took_s: f64) -> String {
    let short: Vec<_> = all.iter().filter(|tested| tested.outcome().is_short(allow_untested)).collect();
    let mut text = String::from("\n");
    if !short.is_empty() {
        let details: Vec<_> = short.iter().map(|tested| details(tested)).collect();
        let names: Vec<_> = short.iter().map(|tested| format!("    {}\n", tested.case.name)).collect();
        text = format!("\nfailures:\n\n{}\nfailures:\n{}\n", details.join("\n"), names.concat());
    }
    let count = |outcome| all.iter().filter(|tested| tested.outcome() == outcome).count();
    let word = match (short.is_empty(), others.unrun) {
        (false, _) => "FAILED",
        (true, 0) => "ok",
        (true, _) => "INTERRUPTED",
    };
    let left_out = |count, why| if count > 0 { format!("; {count} {why}") } else { String::new() };
    let others = left_out(others.unrun, "not run") + &left_out(others.filtered_out, "filtered out");
    text + &format!(
        "test result: {word}. {} passed; {} failed; {} untested{others}; finished in {took_s:.2}s\n",
        count(Outcome::Passed),
        count(Outcome::Failed),
        count(Outcome::Untested),
    )
}

fn details(tested: &Tested) -> String {
    let report = tested
        .folder
        .as_ref()
        .map_or_else(String::new, |folder| format!("report: {}\n", folder.join("report.html").display()));
    let reason = match &tested.verdict {
        Ok(verdict) => &format!("{}: {}", verdict.word, verdict.reason),
        Err(reason) => reason,
    };
    format!("---- {} ----\n{reason}\nagain: {}\n{report}", tested.case.name, tested.command)
}
