//! The mechanism that the drives move: its dynamics, friction, teeth and food, and the pose in which it
//! starts.
//!
//! This module never solves the forward kinematics. Drives, buses and the times of faults are not part of it.

pub(crate) mod axes;
pub(crate) mod contact;
pub(crate) mod dynamics;
mod friction;
