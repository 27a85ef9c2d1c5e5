//! What may stand between a node and its port, whichever bus that is: counters, a log, injected faults.
//!
//! Each keeps its own memory and is laid over a port for as long as that is used, so that it works on ports that
//! are borrowed (of a simulated wire) as on those that are owned (sockets). What only a wire can do to a
//! frame, destroying it by an error frame, is not here but in [`VirtualWire`](super::VirtualWire).

mod candump_tap;
mod counts;
mod port_faults;
#[cfg(test)]
mod tests;

pub use candump_tap::{CandumpTap, Logged};
pub use counts::{Counted, Counts};
pub use port_faults::{Faulty, NotByPort, PortFaults};
