//! Named signals of a run, and their values cycle by cycle in the order of time.
//!
//! A [`Registry`] holds every signal that a run of a scenario has. A [`Timeline`] joins the messages of a cycle. The module
//! judges nothing: see [`requirements`](crate::requirements).

mod cpu_share;
mod cycle;
mod derived;
mod registry;
mod timeline;

pub use cycle::CycleMessages;
pub use registry::{NamedSignal, Registry, Values};
pub use timeline::{Sample, Timeline};
