//! Commissioning of a robot in steps: a client of all drives that reads, configures and moves single drives.
//!
//! Unlike the master, the client waits for every answer and exchanges no process data. The steps are
//! sequences of questions to a [`Line`]; time comes from the line, simulated or real. Files, arguments and the
//! forward kinematics are not part of it.

mod deviations;
mod errors;
mod home;
mod identity;
mod jog;
mod line;
mod mover;
mod settings;
mod steps;
#[cfg(test)]
mod tests;
mod traffic;
mod watch;
mod watchdog;
mod write;

pub use crate::master::link::Address;
pub use crate::master::sockets::judge_interfaces;
pub use deviations::{Deviation, Outcome, deviations};
pub use errors::{
    AxisError, LineError, MasterSign, MotionError, OtherMaster, Restarted, SdoReason, Silence, StopCause,
    Unproved, object_name, reason_text, value_text,
};
pub use home::{HomeReport, home};
pub use identity::{
    Disturbance, Entry, Identity, Known, NOT_ASKED, OtherKind, check_present, check_undisturbed, gaps,
};
pub use jog::{JogOrder, JogReport, StepResponse, jog};
pub use line::{BootUps, Ledger, Line, OldValue};
pub use mover::{Caution, Operator, Wish};
pub use settings::{Difference, Settings, Survey};
pub use steps::{PowerError, Stand, StoreError, SyncAnswers, prove_no_power, reset, stand, store, take_over};
pub use traffic::{Heard, Strangers};
pub use watch::Sample;
pub use watchdog::{LastFrame, Reaction, WatchdogReport, prove_watchdogs};
pub use write::{Change, WriteError, Writer, give_back};
