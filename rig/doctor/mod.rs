//! `masseter doctor`: whether this machine is fit for real-time runs, and which commands would improve it.
//!
//! A [`Finding`] is a line of the report. The doctor changes nothing on the machine.
//! `docs/doctor.md` describes the JSON report.

mod finding;
mod kernel;
mod processors;
mod resources;

use std::{fmt::Write, fs::OpenOptions};

use masseter_machine::{SystemRoot, dma_latency};
use masseter_runtime::realtime::scheduling::{SchedulingRequest, usable_cores};
use masseter_terminal::{Exit, Format, Tone, result, result_with_tones};

use crate::BUILD;
use finding::{Finding, Level};
use kernel::{clock_source, isolation, preemption, throttling};
use processors::{fifo, governor, hypervisor, idle, locked_memory, number, try_out};
use resources::{SHARED_MEMORY, count_rigs, huge_pages, interfaces, other_rigs, room, unsupported};

/// The arguments of `doctor`.
#[derive(Debug, Clone, clap::Args)]
#[command(after_help = "Example:\n  masseter doctor")]
pub(crate) struct DoctorArgs {
    /// Format of standard output
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

/// The marks of the levels.
const TONES: [(&str, Tone); 3] = [("ok", Tone::Good), ("warn", Tone::Doubtful), ("BAD", Tone::Bad)];
/// Version of the report's form.
const FORM: u32 = 1;

/// The doctor's report.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
struct Report {
    form: u32,
    masseter: &'static str,
    /// The worst of the findings.
    level: Level,
    findings: Vec<Finding>,
}

/// Examines the machine and prints the report; [`Exit::Invalid`] if a finding is bad.
pub(crate) fn examine(args: &DoctorArgs) -> anyhow::Result<Exit> {
    let report = Report::new(findings(&SystemRoot::of_this_machine()));
    match args.format {
        Format::Human => result_with_tones(&report.to_text(), &TONES),
        Format::Json => result(&(serde_json::to_string_pretty(&report)? + "\n")),
    }?;
    Ok(if report.level == Level::Bad { Exit::Invalid } else { Exit::Passed })
}

/// The command that grants SCHED_FIFO on this machine.
pub(crate) fn grant_command() -> String {
    processors::grant_command(&SystemRoot::of_this_machine())
}

/// The command against what disturbs real-time runs most on this machine; none if the doctor knows none.
pub(crate) fn mending_command() -> Option<String> {
    let findings = of_machine(&SystemRoot::of_this_machine());
    let with_command = findings.into_iter().rev().filter(|finding| finding.remedy.is_some());
    // The first of the worst.
    with_command.max_by_key(|finding| finding.level)?.remedy
}

/// Everything: what the kernel grants, the machine, and what a run shares with others.
fn findings(root: &SystemRoot) -> Vec<Finding> {
    let nothing = SchedulingRequest { core: None, fifo_priority: None, locked_memory: false };
    let priority = masseter_scenario::RealtimeConfig::default().priority;
    let fifo_tried = try_out(SchedulingRequest { fifo_priority: Some(priority), ..nothing });
    let memory_tried = try_out(SchedulingRequest { locked_memory: true, ..nothing });
    let shared = rustix::fs::statvfs(SHARED_MEMORY).map(|of| (of.f_blocks, of.f_bavail * of.f_frsize));
    let granted = [
        fifo(root, priority, &fifo_tried).named("SCHED_FIFO"),
        locked_memory(root, &memory_tried).named("locked memory"),
    ];
    let memory = [huge_pages(root).named("huge pages"), room(root, shared.ok()).named("shared memory")];
    let can = match masseter_can::is_supported() {
        Ok(()) => vec![
            Finding::ok("supported by the kernel").named("SocketCAN"),
            interfaces(root).named("CAN interfaces"),
        ],
        Err(error) => vec![unsupported(root, &error).named("SocketCAN")],
    };
    let rigs = other_rigs(&count_rigs()).named("other rigs");
    granted.into_iter().chain(of_machine(root)).chain(memory).chain(can).chain([rigs]).collect()
}

/// The cores and the kernel.
fn of_machine(root: &SystemRoot) -> Vec<Finding> {
    // Whether runs may disable idle states.
    let may_hold = OpenOptions::new().write(true).open(dma_latency::DEVICE).is_ok();
    vec![
        number(root, usable_cores().len(), &root.online_cores()).named("cores"),
        governor(root).named("frequency governor"),
        idle(root, may_hold).named("idle states"),
        hypervisor(root).named("virtual machine"),
        preemption(root).named("preemption model"),
        throttling(root).named("real-time throttling"),
        isolation(root).named("isolated cores"),
        clock_source(root).named("clock source"),
    ]
}

impl Report {
    fn new(findings: Vec<Finding>) -> Self {
        let level = findings.iter().map(|finding| finding.level).max().unwrap_or(Level::Ok);
        Self { form: FORM, masseter: BUILD, level, findings }
    }

    fn to_text(&self) -> String {
        let mut text = format!("masseter {}\n\n", self.masseter);
        for finding in &self.findings {
            let mark = match finding.level {
                Level::Ok => "ok",
                Level::Warn => "warn",
                Level::Bad => "BAD",
            };
            let _ = writeln!(text, "{mark:<4} {:<21} {}", finding.check, finding.found);
            for (label, entry) in [("costs: ", &finding.cost), ("remedy:", &finding.remedy)] {
                if let Some(entry) = entry {
                    let _ = writeln!(text, "     {:<21} {label} {entry}", "");
                }
            }
        }
        let conclusion = match self.level {
            Level::Ok => "fit for real-time runs",
            Level::Warn => "real-time runs work; the warnings above cost precision",
            Level::Bad => "not fit for real-time runs (exit 3)",
        };
        text + "\n" + conclusion + "\n"
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn the_worst_finding_decides() {
        let fine = || Finding::ok("as it should be");
        let warned = || Finding::warn("odd", "some").with_remedy("do this");
        let bad = || Finding::bad("gone", "all");
        let cases = [
            (vec![fine()], Level::Ok),
            (vec![warned(), fine()], Level::Warn),
            (vec![bad(), warned()], Level::Bad),
        ];
        for (findings, level) in cases {
            assert_eq!(Report::new(findings).level, level);
        }
    }

    #[test]
    fn the_form_is_as_documented() {
        let report = Report::new(vec![Finding::warn("odd", "some").with_remedy("do this").named("b")]);
        assert_eq!(
            serde_json::to_value(&report).unwrap(),
            serde_json::json!({
                "form": 1,
                "masseter": BUILD,
                "level": "warn",
                "findings": [
                    { "check": "b", "level": "warn", "found": "odd", "cost": "some", "remedy": "do this" }
                ]
            })
        );
    }

    #[test]
    fn an_empty_root_is_no_reason_to_fail() {
        let empty = tempfile::tempdir().unwrap();
        let findings = findings(&SystemRoot::at(empty.path()));
        assert!(findings.len() > 10);
        let names: BTreeSet<_> = findings.iter().map(|finding| finding.check).collect();
        assert_eq!(names.len(), findings.len(), "every check has a name of its own");
        assert!(!names.contains(""));
    }
}
