//! What both sides of the rig agree on: geometry, equations of motion, messages, transport, schedule, the real-time loop,
//! scenarios and the trait `Controller`.
//!
//! Forward kinematics belongs to the controller, and the integration of the motion to the plant. This crate is the same in
//! every process.

pub mod clock;
pub mod config;
pub mod control;
pub mod conversation;
pub mod dynamics;
pub mod geometry;
pub mod injection;
pub mod input;
pub mod lifecycle;
pub mod lockstep;
pub mod messages;
pub mod named;
pub mod realtime;
pub mod rows;
pub mod schedule;
pub mod transport;
pub mod wording;
