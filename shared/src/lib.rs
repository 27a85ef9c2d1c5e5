//! What both sides of the rig agree on: the mechanism's geometry, the messages, the CAN link, the
//! real-time loop and the configuration.
//!
//! Forward kinematics belongs to the controller and dynamics to the plant. This crate is the same in every process.

pub mod clock;
pub mod config;
pub mod control;
pub mod geometry;
pub mod input;
pub mod lifecycle;
pub mod messages;
pub mod realtime;
pub mod schedule;
pub mod transport;
