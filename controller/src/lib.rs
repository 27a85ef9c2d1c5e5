//! The rig's controller: forward kinematics, jaw trajectories, pose control and safety.
//!
//! [`core`] is a pure step function; [`process`] binds it to iceoryx2 and to real time. It never
//! sees the plant, only its messages.

pub mod core;
mod delivery;
pub mod kinematics;
mod playback;
mod pose_control;
pub mod process;
mod safety;
pub mod sequence;
pub mod trajectory;

pub use safety::Fault;
