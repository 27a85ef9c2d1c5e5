//! A CANopen servo drive for tests (CiA 301, CiA 402). It serves the object dictionary of a device configuration file.
//!
//! It is written from the standards and shares no drive code with the product: an error of the master and the same error of
//! the emulated drives cannot cancel out. It takes only [frames](Frame) and the reader of [descriptions](Dcf) from
//! `masseter-can`.
//!
//! [`Node`] is a pure step function: frames and time come in as arguments, frames go out. The program `canopen-node` binds
//! one to SocketCAN.
//!
//! | file | idea |
//! | --- | --- |
//! | `dictionary` | values, access, lengths and limits |
//! | `sdo` | the messages of the SDO server |
//! | `rules` | writes that depend on other objects: PDOs, storage, modes |
//! | `pdo` | process data by the mapping found in the dictionary |
//! | `network` | boot-up, heartbeats of this node and of the master |
//! | `storage` | values that survive a reset |
//! | `state`, `drive`, `axis`, `homing` | state machine, modes, motion |
//! | `node` | the order in which these act |
//!
//! Not simulated: block transfer, segmented download, remote requests, the SYNC counter, profile velocity and the modes of
//! torque. A change of set-points in profile position takes effect at once.

mod abort;
mod axis;
mod dictionary;
mod drive;
mod homing;
mod network;
mod node;
mod pdo;
mod rules;
mod sdo;
mod settings;
mod state;
mod storage;

pub use masseter_can::Frame;
pub use masseter_can::canopen::NodeId;
pub use masseter_can::canopen::dcf::Dcf;
pub use node::Node;
pub use settings::{Quirks, Settings};
pub use storage::StoreError;
