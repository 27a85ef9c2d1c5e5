//! `masseter test`: the scenarios of folders as a suite, listed in the form of `cargo test`.

use clap::ValueEnum;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use masseter_recording::time_in_names;
use masseter_report::suite::{Baseline, Outcome, SuiteReport, TestedScenario};
use masseter_report::{html_of_suite, junit_of_suite};

use crate::prelude::*;
use crate::run::request::{ClockKind, ControllerChoice};
use crate::vary::suite::cases::{Case, Cases, Selection};
use crate::{BUILD, run::runner::Runner, vary::suite::Suite};

/// The arguments of `test`.
#[derive(Debug, Clone, Args)]
#[command(
    after_help = "Examples:\n  masseter test scenarios\n  masseter test scenarios -k encoder --junit junit.xml"
)]
pub(super) struct TestArgs {
    /// Folders with scenarios (*.toml), and scenarios
    #[arg(required = true, value_name = "DIR|FILE")]
    paths: Vec<PathBuf>,
    /// Clock of the runs
    #[arg(long, default_value = "virtual", value_parser = test_clocks())]
    clock: ClockKind,
    /// Who controls the robot: motion, hold, or the path of your own program
    #[arg(long, value_name = "motion|hold|PATH", default_value = "motion", hide_default_value = true)]
    controller: ControllerChoice,
    #[command(flatten)]
    selection: Selection,
    /// Run a scenario up to this many times again: in real time one that is INVALID, in lockstep one that failed, which
    /// must fail again the same
    #[arg(long, value_name = "N", default_value_t, hide_default_value = true)]
    retries: usize,
    /// Exit with 0 in spite of scenarios that left something untested, but not where a fault or stimulus did not act
    #[arg(long)]
    allow_untested: bool,
    /// Format of the result
    #[arg(long, value_enum, default_value_t, hide_default_value = true)]
    format: Format,
    /// Write every scenario and its checks into this file, as CI systems read them
    #[arg(long, value_name = "FILE")]
    junit: Option<PathBuf>,
    /// Write a page with the scenarios, and with the margins of all requirements
    #[arg(long, value_name = "FILE")]
    html: Option<PathBuf>,
    /// Compare the margins with an earlier run, of which --format json made this file
    #[arg(long, value_name = "FILE")]
    baseline: Option<PathBuf>,
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
    let Cases { chosen, filtered_out, left_out } = Cases::find(&args.paths, &args.selection).usage()?;
    check_reports(args, &chosen).usage()?;
    let baseline = args.baseline.as_deref().map(Baseline::read).transpose().usage()?;
    let out = out_folder(args).usage()?;
    let runner = Runner::of_verb(args.controller.clone())?;
    if !left_out.is_empty() {
        status!("left out: {}", left_out.join(", "));
    }
    let is_human = args.format == Format::Human;
    if is_human {
        result_line!("\nrunning {}", counted(chosen.len() as u64, "test")).incomplete()?;
    }
    let suite = Suite {
        runner,
        clock: args.clock,
        retries: args.retries,
        allows_untested: args.allow_untested,
        out: &out,
    };
    let tell = |tested: &TestedScenario| if is_human { print_tested(tested) } else { Ok(()) };
    let tested = suite.run_all(&chosen, tell).incomplete()?;
    let took_s = (clock::now_ns() - began_ns) as f64 / 1e9;
    let is_over = |name: &String| tested.iter().any(|tested| tested.name == *name);
    let names = chosen.into_iter().map(|case| case.name);
    let unrun: Vec<_> = names.filter(|name| !is_over(name)).collect();
    let report = SuiteReport { masseter: BUILD, tested, unrun, filtered_out, left_out, took_s, baseline };
    result(&match args.format {
        Format::Human => summary(&report),
        Format::Json => report.to_json().context("cannot write the result").incomplete()? + "\n",
    })
    .incomplete()?;
    if let Some(path) = &args.junit {
        let xml = junit_of_suite(&report).context("cannot make the JUnit document").incomplete()?;
        write_document(path, &xml).incomplete()?;
    }
    if let Some(path) = &args.html {
        write_document(path, &html_of_suite(&report, path).incomplete()?).incomplete()?;
    }
    if suite.runner.is_interrupted() {
        let over = report.tested.len();
        status!("masseter: interrupted after {over} of {} tests", over + report.unrun.len());
        return Ok(Exit::Interrupted);
    }
    Ok(report.exit())
}

fn write_document(path: &Path, text: &str) -> anyhow::Result<()> {
    fs::write(path, text).with_context(|| format!("cannot write {}", path.display()))
}

/// Refuses a controller that somebody else would have to start, and a suite without one.
fn check_controller(controller: &ControllerChoice) -> anyhow::Result<()> {
    let is_started = !matches!(controller, ControllerChoice::External | ControllerChoice::None);
    ensure!(is_started, "a suite starts its controllers itself: use --controller motion, hold, or a path");
    Ok(())
}

/// Refuses a report in the place of a scenario.
fn check_reports(args: &TestArgs, chosen: &[Case]) -> anyhow::Result<()> {
    for report in args.junit.iter().chain(&args.html).filter_map(|path| path.canonicalize().ok()) {
        let is_scenario = chosen.iter().any(|case| case.path.canonicalize().is_ok_and(|path| path == report));
        ensure!(!is_scenario, "{} is a scenario of the suite; name another file to write", report.display());
    }
    Ok(())
}

fn out_folder(args: &TestArgs) -> anyhow::Result<PathBuf> {
    let out = args.out.clone().unwrap_or_else(|| format!("runs/test-{}", time_in_names()).into());
    ensure!(!out.exists(), "{} exists and is not overwritten; choose another --out", out.display());
    Ok(out)
}

/// Prints the line of a test that is over.
fn print_tested(tested: &TestedScenario) -> anyhow::Result<()> {
    let times = match tested.retries() {
        1 => "1 retry".to_owned(),
        times => format!("{times} retries"),
    };
    let retried = match (tested.outcome(), tested.retries()) {
        (_, 0) => String::new(),
        (Outcome::Passed, _) => format!(" (only after {times})"),
        _ => format!(" (also after {times})"),
    };
    result_line!("test {} ... {}{retried}", tested.name, tested.outcome().word())
}

/// What failed and why, then the result of the suite.
fn summary(report: &SuiteReport) -> String {
    let short: Vec<_> = report.tested.iter().filter(|tested| tested.is_short()).collect();
    let mut text = String::from("\n");
    if !short.is_empty() {
        let details: Vec<_> = short.iter().map(|tested| details(tested)).collect();
        let names: Vec<_> = short.iter().map(|tested| format!("    {}\n", tested.name)).collect();
        text = format!("\nfailures:\n\n{}\nfailures:\n{}\n", details.join("\n"), names.concat());
    }
    let left_out = |count, why| if count > 0 { format!("; {count} {why}") } else { String::new() };
    let others = left_out(report.unrun.len(), "not run") + &left_out(report.filtered_out, "filtered out");
    let trend = report.trend_in_words().map_or_else(String::new, |trend| trend + "\n");
    text + &trend
        + &format!(
            "test result: {}. {} passed; {} failed; {} untested{others}; finished in {:.2}s\n",
            report.word(),
            report.count(Outcome::Passed),
            report.count(Outcome::Failed),
            report.count(Outcome::Untested),
            report.took_s,
        )
}

fn details(tested: &TestedScenario) -> String {
    let folders = tested.attempts.iter().filter_map(|attempt| attempt.folder.as_ref());
    let reports: Vec<_> =
        folders.map(|folder| format!("report: {}\n", folder.join("report.html").display())).collect();
    format!("---- {} ----\n{}\nagain: {}\n{}", tested.name, tested.reason(), tested.command, reports.concat())
}
