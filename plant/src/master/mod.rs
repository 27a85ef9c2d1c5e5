//! The CAN master: boots the drives, exchanges process data with them every cycle, watches them, and
//! stops them when commands stop.
//!
//! Written against the bus trait alone ([`Buses`](crate::link::Buses)), so that simulated and real wires are the
//! same to it. There is no SDO yet: the drives' configuration is taken as given.

mod cycle;
mod journal;
mod node;
mod supervision;

pub(crate) use cycle::{Master, MasterSettings, Scale};
