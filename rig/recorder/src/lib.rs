//! The recorder process: writes every message of a run into the recording, and shows the run's progress.
//!
//! It runs at ordinary priority and off the loops' cores. Where only two cores are left it shares the controller's,
//! because the plant has less time to spare. It judges nothing, and computes figures for the live page
//! only: those of the run come from the recording.

// `println!` panics on a closed terminal, which would end a run: see `masseter_terminal`.
#![warn(clippy::print_stdout, clippy::print_stderr)]

pub mod live;
mod lockstep;
mod machine_topic;
mod progress;
mod recorder;
mod refusals;
mod sinks;
mod stderr_writer;
mod subscribers;

pub use recorder::{RecorderArgs, record};
pub use refusals::Refusals;
pub use stderr_writer::StderrWriter;
