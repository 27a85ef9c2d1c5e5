//! The mechanism that the drives move: its dynamics, friction, teeth and food, faults, and the pose in which it
//! starts.
//!
//! This module never solves the forward kinematics. Drives and buses are not part of it.

mod axes;
mod contact;
mod coupling;
mod dynamics;
mod element;
mod friction;
mod load;
mod resting;
mod seizure;
mod stops;

pub use contact::ContactError;
pub(crate) use contact::{Food, Occlusion};
pub use dynamics::DynamicsError;
pub(crate) use dynamics::{Dynamics, MechanismState};
pub(crate) use resting::{closed_mouth, level};
