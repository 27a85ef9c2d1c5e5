//! The lines of a suite on standard output, in the form of `cargo test`.

use masseter_scenario::wording::counted;
use masseter_terminal::{result, result_line};

use super::outcome::{Outcome, Tested};

/// Announces the tests.
pub(super) fn begin(tests: usize) -> anyhow::Result<()> {
    result_line!("\nrunning {}", counted(tests as u64, "test"))
}

/// The line of a test that is over.
pub(super) fn line(tested: &Tested) -> anyhow::Result<()> {
    let retried = match (tested.outcome, tested.retries) {
        (_, 0) => String::new(),
        (Outcome::Passed, retries) => format!(" (only after {})", times(retries)),
        (_, retries) => format!(" (also after {})", times(retries)),
    };
    result_line!("test {} ... {}{retried}", tested.case.name, tested.outcome.word())
}

fn times(retries: u32) -> String {
    if retries == 1 { "1 retry".to_owned() } else { format!("{retries} retries") }
}

/// The numbers of scenarios without a result.
#[derive(Debug, Clone, Copy)]
pub(super) struct Others {
    pub(super) filtered_out: usize,
    /// Because the user interrupted.
    pub(super) unrun: usize,
}

/// What failed and why, then the result of the suite.
pub(super) fn end(all: &[Tested], others: Others, allow_untested: bool, took_s: f64) -> anyhow::Result<()> {
    result(&text(all, others, allow_untested, took_s))
}

fn text(all: &[Tested], others: Others, allow_untested: bool, took_s: f64) -> String {
    let short: Vec<_> = all.iter().filter(|tested| tested.outcome.is_short(allow_untested)).collect();
    let mut text = String::from("\n");
    if !short.is_empty() {
        let details: Vec<_> = short.iter().map(|tested| details(tested)).collect();
        let names: Vec<_> = short.iter().map(|tested| format!("    {}\n", tested.case.name)).collect();
        text = format!("\nfailures:\n\n{}\nfailures:\n{}\n", details.join("\n"), names.concat());
    }
    let count = |outcome| all.iter().filter(|tested| tested.outcome == outcome).count();
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
    format!("---- {} ----\n{}\nagain: {}\n{report}", tested.case.name, tested.reason, tested.command)
}
