//! The mechanism: three slides, three telescopic legs and one platform.
//!
//! Frames, as reconstructed from the paper (Fig. 1 and its two conditions):
//! *base* has its origin at the centre of the base, x anterior, y left, z up;
//! *platform* has its origin at the centroid of A₁A₂A₃, x towards A₁, z along the
//! normal (A₂−A₁)×(A₃−A₁). A pose is the platform frame in the base frame.
//!
//! This module holds the geometry, the closed-form inverse kinematics and the Jacobian, which controller and plant
//! share. It does not hold forward kinematics: only the controller has it, so that the plant stays an independent oracle.

mod conditioning;
mod deviation;
mod jacobian;
mod joints;
mod mechanism;

pub use conditioning::Conditioning;
pub use deviation::Deviation;
pub use jacobian::{Jacobian, Twist};
pub use joints::{AXES, AXIS_NAMES, Actuators, Joints, LEGS, Legs, LimitViolation, StrokeLimits};
pub use mechanism::{GeometryError, InverseError, Mechanism, MechanismConfig, SlideConfig, frame_of_corners};

/// Platform frame in the base frame; metres.
#[doc(alias("transform", "rigid transformation"))]
pub type Pose = nalgebra::Isometry3<f64>;
/// A point or direction; metres or unitless.
pub type Vec3 = nalgebra::Vector3<f64>;
