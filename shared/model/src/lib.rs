//! The mechanism as mathematics: geometry, inverse kinematics and Jacobian, and the equations of its rigid bodies.
//!
//! This crate has no input and output. Forward kinematics belongs to the controller, and the integration of the motion
//! to the plant.

#[macro_use]
pub mod section;

pub mod dynamics;
pub mod geometry;
