//! The drive profile (CiA 402, IEC 61800-7-201): states, statusword, controlword and the state machine
//! between them.
//!
//! Pure values and tables, for both ends: a drive uses [`DriveState::after`], a master uses [`next_controlword`].
//! Modes of operation, targets, ramps and the policy of restarting after a fault are not here.

mod controlword;
mod interpolation;
mod machine;
mod next_controlword;
mod state;
mod statusword;

pub use controlword::{Command, Controlword};
pub use interpolation::interpolation_period;
pub use next_controlword::{DriveRequest, next_controlword};
pub use state::DriveState;
pub use statusword::{StatusBit, Statusword, StatuswordError};
