//! The common runtime of both sides of the rig: messages and their transport, the schedule of the bus, and the
//! real-time loop. Also the life of a process, and the trait `Controller` with its session.
//!
//! Geometry and dynamics are in `masseter-model`, scenarios in `masseter-scenario`, messages in `masseter-messages`,
//! names and files of a run in `masseter-domain`. This crate is the same in every process.

pub mod clock;
pub mod control;
pub mod conversation;
pub mod injection;
pub mod lifecycle;
pub mod lockstep;
pub mod named;
pub mod realtime;
pub mod schedule;
pub mod transport;

pub use masseter_messages as messages;
