//! The mechanism that the drives move: its dynamics, friction, teeth and food, and its initial pose.
//!
//! This module never solves the forward kinematics. Drives, buses, scenarios and the times of faults are not part of
//! the module. Its values come as plain structs, or as those of the shared equations.

pub(crate) mod axes;
pub(crate) mod contact;
mod coupling;
pub(crate) mod dynamics;
mod friction;
pub(crate) mod ledger;
mod stops;
