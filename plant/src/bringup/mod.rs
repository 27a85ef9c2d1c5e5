//! Bring-up of a robot, one careful step at a time: a client of all drives that reads, configures and moves single drives.
//!
//! Unlike the [master](crate::master), the client waits for every answer and exchanges no process data. The steps are
//! sequences of questions to a [`Line`]; time comes from the line, simulated or real. Files, arguments and the
//! forward kinematics are not part of it.

mod deviation;
mod heard;
mod line;
mod power;
mod settings;
mod store;
mod survey;
mod wires;
mod wording;
mod write;

pub use deviation::{Deviation, Outcome, deviations};
pub use heard::{Heard, Strangers};
pub use line::{Line, LineError, SdoReason};
pub use power::{PowerError, prove_no_power, take_over};
pub use settings::{Difference, PdoLayout, PdoSetting, Setting, Settings};
pub use store::{StoreError, reset, store};
pub use survey::Survey;
pub use wording::{object_name, value_text};
pub use write::{Change, WriteError, Writer};
