//! The `masseter` command. `cli` dispatches to the verbs.
//!
//! The verb `run` starts controller, plant and recorder as processes of this executable, or steps their cores in one
//! thread under virtual time (`masseter_virtual_time`). `vary` plays many runs. Figures of a recorded run are
//! computed from its recording and manifest only (crate `masseter_judge`), so `report` and `record` can repeat
//! them. This crate holds no control, physics, analysis or file formats.

// `println!` panics on a closed terminal, which would end a run: see `masseter_terminal`.
#![warn(clippy::print_stdout, clippy::print_stderr)]

mod cli;
mod doctor;
mod prelude;
mod record;
mod robot;
mod run;
mod vary;

/// The build as `masseter --version` says it: version, commit, and whether the sources differ from it.
const BUILD: &str = env!("MASSETER_BUILD");

// Only what other crates call is public: derived code that nobody calls is then not compiled.
pub use cli::main;
