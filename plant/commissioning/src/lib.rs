//! Commissioning of a robot in steps: a client of all drives that reads, configures and moves single drives.
//!
//! Unlike the master, the client waits for every answer and exchanges no process data. The steps are
//! sequences of questions to a [`Line`]; time comes from the line, simulated or real. Files, arguments and the
//! forward kinematics are not part of it. [`description`] tells other tools about the drives.
//!
//! None of it is code of a cycle, so the profile `release` does not optimise it.

pub mod description;
mod deviation;
mod deviations;
mod home;
mod identity;
mod jog;
mod line;
mod line_error;
mod loan;
mod motion_error;
mod mover;
mod object_words;
mod settings;
mod steps;
#[cfg(test)]
mod tests;
mod traffic;
mod units;
mod watch;
mod watchdog;
mod write;

pub use deviation::{Deviation, Outcome};
pub use deviations::deviations;
pub use home::{HomeReport, home};
pub use identity::{
    Disturbance, Entry, Identity, Known, NOT_ASKED, OtherKind, check_present, check_undisturbed, gaps,
};
pub use jog::{JogOrder, JogReport, StepResponse, jog};
pub use line::{BootUps, Ledger, Line, OldValue};
pub use line_error::{LineError, MasterSign, OtherMaster, Restarted};
pub use loan::give_back;
pub use motion_error::{AxisError, MotionError, Silence, StopCause, Unproved};
pub use mover::{Operator, Wish};
pub use object_words::{object_name, reason_text, value_text};
pub use settings::{Difference, Settings, Survey};
pub use steps::{PowerError, Stand, StoreError, SyncAnswers, prove_no_power, reset, stand, store, take_over};
pub use traffic::{Heard, Strangers};
pub use watch::{Caution, Sample};
pub use watchdog::{LastFrame, Reaction, WatchdogReport, prove_watchdogs};
pub use write::{Change, WriteError, Writer};
