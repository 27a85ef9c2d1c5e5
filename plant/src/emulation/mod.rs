//! The emulated robot: six drives, the mechanism that they move, and the wires they are on.
//!
//! [`Emulation`] co-simulates drives and mechanism, without wires. Simulated wires step it with a master
//! (the plant's default link) or without one ([`OpenLink`]); [`Emulator`] steps it on real interfaces.

mod agenda;
mod co_simulation;
mod emulator;
mod encoder_faults;
mod load_cell;
mod memory;
mod open_link;
mod push;
mod virtual_link;
mod wrench_table;

pub use co_simulation::Emulation;
pub use emulator::{Emulator, EmulatorCounters};
pub use open_link::{NodePort, OpenLink};
pub use virtual_link::VirtualLink;
