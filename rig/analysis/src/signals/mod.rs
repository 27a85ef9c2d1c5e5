//! Named signals of a run, and their values cycle by cycle in the order of time.
//!
//! A [`Registry`] holds every signal that a run of a scenario has. A [`Timeline`] joins the messages of a cycle. The module
//! judges nothing: see [`requirements`](crate::requirements).

mod catalogue;
mod cpu_share;
mod cycle;
mod derived;
mod list;
mod registry;
mod signal;
mod timeline;
mod values;

pub use cycle::CycleMessages;
pub use registry::{Registry, UnknownSignal};
pub use signal::NamedSignal;
pub use timeline::{Sample, Timeline};
pub use values::Values;
