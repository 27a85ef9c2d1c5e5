//! Faults and stimuli that the plant carries out: when each acts, and the events of its beginning and its end.
//!
//! [`Injector`] follows the times for the core and acts on commands itself. Wires and emulation get the time of what they
//! carry out from it, and report each [`Occurrence`] and each [`Mishap`]. [`Acting`] is what is
//! wrong with one part at an instant.

mod acting;
mod commands;
mod injector;
mod mishap;
mod occurrence;
mod times;

pub(crate) use acting::Acting;
pub(crate) use injector::Injector;
pub(crate) use mishap::{FoodBreak, Mishap};
pub(crate) use occurrence::Occurrence;
pub(crate) use times::{acting_ns, known_windows};
