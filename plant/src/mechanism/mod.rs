//! The mechanism that the drives move: its dynamics, friction, food between the teeth, faults, and the pose in which it
//! starts.
//!
//! This module never solves the forward kinematics. Drives and buses are not part of it.

mod axes;
mod coupling;
mod dynamics;
mod element;
mod food;
mod friction;
mod load;
mod resting;
mod seizure;
mod stops;

pub use dynamics::DynamicsError;
pub(crate) use dynamics::{Dynamics, MechanismState};
pub(crate) use food::Food;
pub(crate) use resting::{closed_mouth, level};
