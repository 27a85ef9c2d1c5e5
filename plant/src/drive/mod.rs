//! An emulated servo drive: a CANopen node (CiA 301) with the profile of servo drives (CiA 402) and an encoder.
//!
//! [`node`] implements CiA 301, [`axis`] is the profile behind it, and the object [`dictionary`] lies between them: the node
//! counts in increments, the axis works in SI units. The drive has no bus and no mechanism; its caller delivers
//! frames and positions.

mod axis;
pub(crate) mod dictionary;
mod memory;
mod node;
mod quirks;
mod settings;
#[cfg(test)]
mod tests;

pub(crate) use axis::{Encoder, Shaft};
pub(crate) use memory::DriveMemory;
pub(crate) use node::DriveNode;
pub(crate) use settings::DriveSettings;
