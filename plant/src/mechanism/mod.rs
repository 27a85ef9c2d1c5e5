//! The mechanism that the drives move: its dynamics, friction, food between the teeth, and the pose in which it starts.
//!
//! This module never solves the forward kinematics. Drives and buses are not part of it.

mod dynamics;
mod food;
mod friction;
mod resting;

pub use dynamics::DynamicsError;
pub(crate) use dynamics::{Dynamics, State};
pub(crate) use food::Food;
pub(crate) use resting::{closed_mouth, level};
