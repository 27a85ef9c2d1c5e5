//! The report of a run: table, `summary.json`, `junit.xml`, `report.html`, `events.jsonl`, histogram logs and candump
//! logs; and two runs side by side.
//!
//! All of it is computed from the manifest and the recording, so `masseter report` can repeat it. The figures come from
//! the crate `masseter-analysis`; this crate judges them, and each of its modules writes one form of the result.

mod candump_logs;
mod check;
mod checks;
pub mod compare;
pub mod divergence;
mod event_log;
mod full_speed;
pub mod histogram_log;
mod judgement;
mod junit;
mod motion_checks;
mod outcome;
mod page;
mod run_report;
mod shortfall;
mod summary;
mod table;
mod text;
mod timing;
mod verdict;
mod write_error;

pub use candump_logs::CandumpLogs;
pub use check::{Check, CheckFigures, CheckResult};
pub use judgement::Judgement;
pub use junit::{JunitRun, junit_of_suite};
pub use page::so_far as page_so_far;
pub use run_report::{judge_run, report_past_run, report_run};
pub use table::Detail;
pub use timing::{Timing, TimingWord};
pub use verdict::Verdict;
pub use write_error::WriteError;
