//! The `masseter` command. `cli` dispatches to the modules of verbs.
//!
//! `run` starts controller, plant and `recorder` as processes of this executable (`run::supervisor`), or steps their
//! cores in one thread under virtual time (`masseter_virtual_time`). Figures of a recorded run are computed from its
//! recording and manifest only (crate `masseter_analysis`), so `report` can compute them again. This crate holds no control, physics,
//! analysis or file formats.

// `println!` panics on a closed terminal, which would end a run: see `masseter_terminal`.
#![warn(clippy::print_stdout, clippy::print_stderr)]

mod arguments;
mod bench;
mod campaigns;
mod can;
mod clean;
mod cli;
mod controller;
mod diff;
mod doctor;
mod faults;
mod guarded;
mod help;
mod init;
mod interface;
mod interrupts;
mod kinematics_cli;
mod manuals;
mod motion;
mod new;
mod param;
mod plant;
mod replay;
mod report_cli;
mod robot;
mod run;
mod shell;
mod signals_cli;
mod starter;
mod suite;

/// The build as `masseter --version` says it: version, commit, and whether the sources differ from it.
const BUILD: &str = env!("MASSETER_BUILD");

// Only what other crates call is public: derived code that nobody calls is then not compiled.
pub use cli::main;
