//! `masseter doctor`: is this machine fit for real-time runs, and what would make it fitter?
//!
//! Each family of checks has a file; [`Finding`] is a line of the report. Nothing is changed on the
//! machine. The form of the JSON report is written down in `docs/doctor.md`.

mod boot_options;
mod can;
mod container;
mod cores;
mod distribution;
mod finding;
mod kernel;
mod leftovers;
mod memory;
mod privileges;
mod processors;
mod realtime_kernel;
mod timing;

use std::fmt::Write;

use serde::Serialize;

pub use finding::{Finding, Level};

use crate::machine::SystemRoot;
use masseter_terminal::Exit;
use masseter_terminal::Format;
use masseter_terminal::result;

/// Version of the report's form.
const FORM: u32 = 1;

/// The doctor's report.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
struct Report {
    form: u32,
    masseter: &'static str,
    /// The worst of the findings.
    level: Level,
    findings: Vec<Finding>,
}

/// Examines the machine; [`Exit::Invalid`] when something is bad.
pub(crate) fn examine(format: Format) -> anyhow::Result<Exit> {
    let report = Report::of(findings(&SystemRoot::of_this_machine()));
    result(&match format {
        Format::Human => report.in_words(),
        Format::Json => serde_json::to_string_pretty(&report)? + "\n",
    })?;
    Ok(if report.level == Level::Bad { Exit::Invalid } else { Exit::Passed })
}

fn findings(root: &SystemRoot) -> Vec<Finding> {
    [
        privileges::examine(root),
        processors::examine(root),
        kernel::examine(root),
        timing::examine(root),
        memory::examine(root),
        can::examine(root),
        leftovers::examine(),
    ]
    .concat()
}

impl Report {
    fn of(findings: Vec<Finding>) -> Self {
        let level = findings.iter().map(|finding| finding.level).max().unwrap_or(Level::Ok);
        Self { form: FORM, masseter: env!("CARGO_PKG_VERSION"), level, findings }
    }

    fn in_words(&self) -> String {
        let mut text = String::new();
        for finding in &self.findings {
            let mark = match finding.level {
                Level::Ok => "ok",
                Level::Warn => "warn",
                Level::Bad => "BAD",
            };
            let _ = writeln!(text, "{mark:<4} {:<21} {}", finding.check, finding.found);
            for (label, said) in [("costs:", &finding.cost), ("mend: ", &finding.mend)] {
                if let Some(said) = said {
                    let _ = writeln!(text, "     {:<21} {label} {said}", "");
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
    use super::*;

    #[test]
    fn the_worst_finding_decides() {
        let fine = || Finding::ok("a", "as it should be");
        let warned = || Finding::warn("b", "odd", "some").mended_by("do this");
        let bad = || Finding::bad("c", "gone", "all");
        let cases = [
            (vec![fine()], Level::Ok),
            (vec![warned(), fine()], Level::Warn),
            (vec![bad(), warned()], Level::Bad),
        ];
        for (findings, level) in cases {
            assert_eq!(Report::of(findings).level, level);
        }
    }

    #[test]
    fn the_form_is_as_documented() {
        let report = Report::of(vec![Finding::warn("b", "odd", "some").mended_by("do this")]);
        assert_eq!(
            serde_json::to_value(&report).unwrap(),
            serde_json::json!({
                "form": 1,
                "masseter": env!("CARGO_PKG_VERSION"),
                "level": "warn",
                "findings": [
                    { "check": "b", "level": "warn", "found": "odd", "cost": "some", "mend": "do this" }
                ]
            })
        );
    }

    #[test]
    fn an_empty_root_is_no_reason_to_fail() {
        let empty = tempfile::tempdir().unwrap();
        assert!(findings(&SystemRoot::at(empty.path())).len() > 10);
    }
}
