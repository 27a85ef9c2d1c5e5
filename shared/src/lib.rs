//! What both sides of the rig agree on: the mechanism's geometry, the messages, the CAN link, the
//! real-time loop and the configuration.
//!
//! Neither the controller's forward kinematics nor the plant's dynamics are here, and nothing here
//! knows which process it runs in.

pub mod clock;
pub mod config;
pub mod control;
pub mod geometry;
pub mod lifecycle;
pub mod messages;
pub mod realtime;
pub mod schedule;
pub mod transport;
