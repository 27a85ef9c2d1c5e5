//! An emulated servo drive: a CANopen node with the CiA 402 profile, its servo loops and its encoder.

mod demand;
mod node;
mod servo;

pub(crate) use node::{DriveNode, DriveSettings};
