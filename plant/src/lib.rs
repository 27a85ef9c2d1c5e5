//! The rig's plant: CAN master, emulated CiA 402 drives and the mechanism they move.
//!
//! | module | holds | depends on |
//! | --- | --- | --- |
//! | `injection` | times and events of faults and stimuli, faults of commands | |
//! | `mechanism` | dynamics, friction, food, disturbances, poses at rest | `injection` |
//! | `link` | traits between master and wires, real interfaces, layout of the buses | `mechanism` (its errors), `injection` |
//! | `drive` | an emulated drive: node (CiA 301), axis (CiA 402), object dictionary | `link` (layout) |
//! | [`wanted`] | the objects of a drive as the rig needs them | |
//! | `master` | boot, exchange, supervision of the drives | `link`, [`wanted`] |
//! | [`emulation`] | drives and mechanism on simulated wires or real interfaces | `drive`, `mechanism`, `link` |
//! | [`bringup`] | a client of single drives that inspects, configures and moves them | `link`, [`emulation`], [`wanted`] |
//! | [`description`] | EDS and DBC of the emulated drives | `drive` |
//! | [`core`] | master and link as one pure step function | `master`, `emulation`, `link` |
//! | [`process`] | the core bound to iceoryx2 and to real time | [`core`] |
//!
//! Between master and drives there are frames on a bus and nothing else. The plant does not depend on the controller
//! and does not solve the forward kinematics: its truth is the integrated mechanism.

pub mod bringup;
mod checks;
pub mod core;
pub mod cycle;
pub mod description;
mod drive;
pub mod emulation;
mod error;
mod held_mean;
mod injection;
mod journal;
mod link;
mod master;
mod mechanism;
pub mod process;
pub mod wanted;

pub use error::PlantError;
pub use mechanism::DynamicsError;
