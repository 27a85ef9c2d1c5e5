//! Bring-up of a robot, one careful step at a time: a client of all drives that reads, configures and moves single drives.
//!
//! Unlike the master, the client waits for every answer and exchanges no process data. The steps are
//! sequences of questions to a [`Line`]; time comes from the line, simulated or real. Files, arguments and the
//! forward kinematics are not part of it.

mod borrowed;
mod caution;
mod deviation;
mod deviations;
mod heard;
mod home;
mod jog;
mod ledger;
mod line;
mod line_error;
mod motion_error;
mod mover;
mod power;
mod restart;
mod settings;
mod stand;
mod step_response;
mod store;
mod survey;
mod switching;
mod sync_answer;
#[cfg(test)]
mod test_log;
#[cfg(test)]
mod tests;
mod traffic;
mod units;
mod watch;
mod wires;
mod wording;
mod write;

pub use borrowed::give_back;
pub use caution::{Caution, Operator, Wish};
pub use deviation::{Deviation, Outcome};
pub use deviations::deviations;
pub use heard::{Heard, OtherMaster, Strangers};
pub use home::{HomeReport, home};
pub use jog::{JogOrder, JogReport, jog};
pub use ledger::{Ledger, OldValue};
pub use line::Line;
pub use line_error::{LineError, SdoReason, reason_text};
pub use motion_error::{MotionError, StopCause};
pub use power::{PowerError, prove_no_power, take_over};
pub use restart::{BootUps, Restarted};
pub use settings::{Difference, PdoLayout, PdoSetting, Setting, Settings};
pub use stand::{Stand, stand};
pub use step_response::StepResponse;
pub use store::{StoreError, reset, store};
pub use survey::Survey;
pub use watch::Sample;
pub use wording::{object_name, value_text};
pub use write::{Change, WriteError, Writer};
