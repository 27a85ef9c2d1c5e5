//! Rigid-body dynamics of the mechanism in closed form: forward, inverse, and the reactions in its joints.
//!
//! Each leg has three [bodies](Bodies). The carriage moves on the slide, the cylinder turns with the hinge, and the rod
//! slides in the cylinder and ends in the ball. The platform with the lower jaw is one more body. The equations of
//! motion are
//!
//! M V̇ + h = Jᵀ τ + w.
//!
//! V is the platform's twist, w a wrench on the platform, and J the actuators' Jacobian. τ are the forces of the axes
//! d₁ d₂ d₃ l₁ l₂ l₃. A wrench is a force (N), then a moment (N m) about the platform's origin, in base axes.
//! [Friction] is no part of these equations: τ are the forces that reach the bodies. Equations and their validation:
//! `docs/dynamics.md`.
//!
//! The order of the calls for a motion:
//!
//! ```
//! use masseter_model::dynamics::DynamicsConfig;
//! use masseter_model::dynamics::{Bodies, Equations, Motion, Reactions};
//! use masseter_model::geometry::{Mechanism, MechanismConfig, Pose, Twist};
//! use nalgebra::Vector6;
//!
//! let mechanism = Mechanism::new(&MechanismConfig::default())?;
//! let bodies = Bodies::from(&DynamicsConfig::default());
//!
//! // The platform passes its neutral pose at 50 mm/s and gains 2 m/s², upwards, against 30 N of food.
//! let pose = Pose::translation(0.0, 0.0, 0.268_452_355);
//! let motion = Motion::new(&mechanism, &pose, &Twist::new(0.0, 0.0, 0.05, 0.0, 0.0, 0.0))?;
//! let acceleration = Twist::new(0.0, 0.0, 2.0, 0.0, 0.0, 0.0);
//! let food = Vector6::new(0.0, 0.0, -30.0, 0.0, 0.0, 0.0);
//!
//! let equations = Equations::new(&bodies, &motion);
//! let force_n = equations.inverse(&acceleration, &food).ok_or("the pose is singular")?;
//! assert!((force_n[3] - 16.79).abs() < 0.01, "each leg pushes with {force_n}");
//!
//! let found = equations.forward(&force_n, &food).ok_or("no number")?;
//! assert!((found - acceleration).amax() < 1e-9);
//!
//! // What the guide of slide 1 carries across its way.
//! let reactions = Reactions::new(&bodies, &motion, &acceleration, &force_n);
//! let guide = reactions.legs[0].guide;
//! assert!((guide.force_n.z - 28.46).abs() < 0.01, "the base pushes the carriage upwards: {guide:?}");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod bodies;
mod energy;
mod equations;
mod friction;
mod parameters;

pub use bodies::{Bodies, JointAccelerations, Link, Motion, Platform};
pub use energy::Energy;
pub use equations::{Equations, JointWrench, LegReactions, Reactions};
pub use friction::{Friction, Loads};
pub use parameters::{AxesConfig, DynamicsConfig, FrictionConfig, FrictionModel};

#[cfg(test)]
mod tests;
