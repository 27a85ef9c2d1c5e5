//! The rig's plant: CAN master, emulated CiA 402 drives (`masseter-drives`) and the mechanism they move.
//!
//! | module | holds | depends on |
//! | --- | --- | --- |
//! | `master` | boot, exchange, supervision of the drives; [`wanted`] objects; [`sdo`] client; link, layout of the buses | |
//! | `simulator::mechanism` | dynamics, axes with friction and stops, contact of teeth and food, poses at rest | |
//! | [`emulation`] | a scenario's drives and mechanism on simulated or real wires | mechanism, `masseter-drives`, `master` |
//! | `simulator::injection` | when faults and stimuli act, their events; faults of commands | `master` |
//! | [`Wires`] | the master's ports, for the commissioning in its place | `master`, [`emulation`] |
//! | [`core`] | master and link as one pure step function | `master`, `simulator` |
//! | [`process`] | the core bound to iceoryx2 and to real time | [`core`] |
//!
//! Between master and drives there are frames on a bus and nothing else. The plant does not depend on the controller
//! and does not solve the forward kinematics: its truth is the integrated mechanism.

pub mod core;
pub mod cycle;
mod error;
mod master;
pub mod process;
mod simulator;
mod wires;

pub use error::{ContactError, DynamicsError, PlantError};
pub use master::link::{Address, addresses, sender};
pub use master::sockets::judge_interfaces;
pub use master::{sdo, wanted};
pub use simulator::emulation;
pub use wires::Wires;
