//! Bring-up of a robot, one careful step at a time: a client of all drives that reads, configures and moves single drives.
//!
//! Unlike the [master](crate::master), the client waits for every answer and exchanges no process data. The steps are
//! sequences of questions to a [`Line`]; time comes from the line, simulated or real. Files, arguments and the
//! forward kinematics are not part of it.

mod heard;
mod line;
mod wires;

pub use heard::{Heard, Strangers};
pub use line::{Line, LineError, SdoReason};
