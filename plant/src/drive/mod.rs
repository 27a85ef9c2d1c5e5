//! An emulated servo drive: a CANopen node with the CiA 402 profile, its servo loops and its encoder.
//!
//! [`node`], [`nmt`] and [`exchange`] speak CiA 301, [`axis`] is the profile behind it, and the object dictionary lies between
//! them. What an increment is worth is known to the axis alone: its loops work in SI units.

mod axis;
mod clamped;
mod cyclic;
mod demand;
pub(crate) mod dictionary;
mod errors;
mod exchange;
mod heartbeats;
mod homing;
mod mode;
mod motion;
mod nmt;
mod node;
mod outbox;
mod parameters;
pub(crate) mod pdo;
mod positioning;
mod profile;
mod rules;
mod sdo;
mod service;
mod servo;
#[cfg(test)]
mod tests;

pub(crate) use node::{DriveNode, DriveSettings};
