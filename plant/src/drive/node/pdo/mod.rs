//! PDOs of the drive as its object dictionary configures them, compiled into copies of bytes whenever a parameter
//! changes.
//!
//! The [rules](super::rules) decide which changes are allowed. Remote requests are not answered.

mod mapping;
mod receive;
mod transmit;

pub(super) use receive::{ERRORS, Effects, Rpdo};
pub(super) use transmit::Tpdo;
