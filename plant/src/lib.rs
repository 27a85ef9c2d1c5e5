//! The rig's plant: CAN master, emulated CiA 402 drives and the mechanism they move.
//!
//! [`core`] is a pure step function; [`process`] binds it to iceoryx2 and to real time; [`emulator`] puts the
//! drives on real wires. It never sees
//! the controller, and never solves the forward kinematics: its truth is the integrated mechanism.

mod build;
mod checks;
mod claim;
pub mod core;
pub mod description;
mod drive;
mod dynamics;
mod emulation;
pub mod emulator;
mod encoder;
mod error;
mod expectation;
mod faults;
mod food;
mod friction;
mod journal;
mod layout;
mod link;
mod master;
pub mod open_link;
pub mod process;
mod resting;
mod socket_link;
mod wire_events;

pub use dynamics::DynamicsError;
pub use error::PlantError;
