//! The mechanism as mathematics: geometry, inverse kinematics and Jacobian, and the equations of its rigid bodies.
//!
//! There is no input and output here, and no file. Forward kinematics belongs to the controller, and the integration of the
//! motion to the plant.

#[macro_use]
pub mod section;

pub mod dynamics;
pub mod geometry;
