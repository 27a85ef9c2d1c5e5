//! The `masseter` command: one module per verb, and what the verbs share.
//!
//! `run` starts controller, plant and logger as processes of this same executable
//! ([`run::supervisor`]), or steps their cores in one thread under virtual time
//! ([`run::virtual_time`]). Whatever a run tells of itself comes from its recording
//! and manifest (`masseter-analysis`), so it can be told again.

// A closed terminal must not end a run: see `masseter_terminal`.
#![warn(clippy::print_stdout, clippy::print_stderr)]

mod arguments;
pub mod bench;
pub mod can;
pub mod clean;
pub mod cli;
pub mod csv_kinematics;
pub mod doctor;
pub mod live;
pub mod log;
pub mod logger;
pub mod machine;
pub mod plant;
pub mod run;
