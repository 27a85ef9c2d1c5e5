//! The rig's controller: forward kinematics, jaw trajectories, pose control and safety.
//!
//! [`motion_controller`] and [`hold_position`] are pure step functions; [`process`] runs one of them. It never
//! sees the plant, only its messages.

mod delivery;
pub mod hold_position;
pub mod kinematics;
pub mod motion_controller;
mod playback;
mod pose_control;
pub mod process;
mod safety;
pub mod sequence;
pub mod trajectory;

pub use safety::Fault;
