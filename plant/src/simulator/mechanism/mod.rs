//! The mechanism that the drives move: its dynamics, friction, teeth and food, and its initial pose.
//!
//! This module never solves the forward kinematics. Drives, buses and the times of faults are not part of
//! the module. Its values come as plain structs, as those of the shared equations, or as the scenario's teeth and food.

pub(crate) mod axes;
pub(crate) mod contact;
mod coupling;
pub(crate) mod dynamics;
mod friction;
pub(crate) mod ledger;
mod stops;
