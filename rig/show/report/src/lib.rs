//! The report of a run: table, `summary.json`, `junit.xml`, `report.html`, `events.jsonl`, histogram logs and candump
//! logs; two runs side by side; a study of several persons and sessions; a suite of runs; and until when a failed run could pass.
//!
//! All of it is computed from the manifest and the recording, so `masseter report` can repeat it. Figures and verdict come
//! from the crate `masseter-judge`; each module of this crate writes one form of them.

pub mod compare;
pub mod divergence;
mod jaw_table;
mod junit;
mod logs;
mod page;
mod run_report;
pub mod study;
pub mod suite;
mod suite_page;
mod table;
mod text;
pub mod why;

pub use jaw_table::jaw_cycle_table;
pub use junit::junit_of_suite;
pub use logs::{CandumpLogs, WriteError};
pub use page::so_far as page_so_far;
pub use run_report::{explain, report_past_run, report_run};
pub use suite_page::html_of_suite;
pub use table::Detail;
