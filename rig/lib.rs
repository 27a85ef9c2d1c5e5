//! The `masseter` command: one module per verb, and what the verbs share.
//!
//! `run` starts controller, plant and logger as processes of this same executable
//! ([`run::supervisor`]), or steps their cores in one thread under virtual time
//! ([`run::virtual_time`]). Whatever a run tells of itself comes from its recording
//! and manifest ([`analysis`]), so it can be told again.

// What fails to be said must not end a run: see `say`.
#![warn(clippy::print_stdout, clippy::print_stderr)]

#[macro_use]
mod say;

pub mod analysis;
pub mod bench;
pub mod can;
pub mod clean;
pub mod cli;
pub mod csv_kinematics;
pub mod doctor;
pub mod exit;
mod hlog;
pub mod live;
pub mod log;
pub mod logger;
pub mod machine;
mod output;
mod palette;
pub mod plant;
pub mod recording;
pub mod report;
pub mod run;
mod scenario;
pub mod study;
pub mod uniqueness;
