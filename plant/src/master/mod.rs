//! The CAN master: boots the drives and verifies them, exchanges process data with them every cycle,
//! watches them, and stops them when commands stop.
//!
//! Written against the bus trait alone ([`Buses`](crate::link::Buses)), so that simulated and real wires are the
//! same to it. A drive is configured by SDO before it exchanges process data, never while it does.

mod boot;
mod booting;
mod cycle;
mod node;
mod plan;
mod receive;
mod sdo;
mod supervision;

#[cfg(test)]
mod tests;

pub(crate) use cycle::{DriveSettings, Master, MasterSettings, Scale};
pub(crate) use plan::{Setup, exchanges};
