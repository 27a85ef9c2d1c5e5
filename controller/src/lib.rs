//! The rig's controller: forward kinematics, jaw trajectories, pose control and safety.
//!
//! [`motion_controller`] and [`hold_position`] are pure step functions; [`process`] runs one of them. The crate does
//! not depend on the plant, and uses only the messages that both share.

mod force_control;
mod forces;
pub mod hold_position;
pub mod kinematics;
pub mod motion_controller;
mod path_supervision;
pub mod playback;
mod pose_control;
pub mod pose_law;
pub mod process;
pub mod robot_model;
mod safety;
mod sequencer;
mod targets;
pub mod trajectory;

pub use safety::Fault;
