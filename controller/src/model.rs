//! What the controller believes of the mechanism: inverse dynamics with friction.
//!
//! τ = J⁻ᵀ (M V̇ + h − w) + friction, with the [equations](masseter_shared::dynamics) of the rigid bodies.

use masseter_shared::config::Scenario;
use masseter_shared::dynamics::{Bodies, Equations, Friction, Loads, Motion, Reactions};
use masseter_shared::geometry::{Mechanism, Pose, Twist};
use nalgebra::Vector6;

/// Friction depends on loads, and loads on what friction leaves of the drives' forces: passes until both agree within 1 %.
const LOAD_PASSES: usize = 3;

/// Masses and friction of a mechanism.
#[derive(Debug, Clone)]
pub(crate) struct Model {
    mechanism: Mechanism,
    pub(crate) bodies: Bodies,
    friction: Friction,
}

/// Friction in a motion.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Braking {
    /// What the drives overcome on the axes, N.
    pub(crate) axes_n: Vector6<f64>,
    /// The largest friction of an axis at rest but for its breakaway, N.
    pub(crate) coulomb_n: Vector6<f64>,
    /// Wrench of hinges and ball joints on the platform, N and N m.
    pub(crate) joints: Vector6<f64>,
}

impl Model {
    /// The model in which the controller of a scenario believes.
    pub(crate) fn new(scenario: &Scenario, mechanism: Mechanism) -> Self {
        let config = scenario.model();
        Self { mechanism, bodies: Bodies::from(&config), friction: Friction::new(&config) }
    }

    /// The motion of a pose and a twist (m/s, rad/s); none for a pose without joint coordinates.
    pub(crate) fn motion(&self, pose: &Pose, twist: &Twist) -> Option<Motion> {
        Motion::new(&self.mechanism, pose, twist).ok()
    }

    /// Forces of the axes d₁ d₂ d₃ l₁ l₂ l₃ (N) that give a motion the acceleration V̇ (m/s², rad/s²) against an external
    /// wrench on the platform (N, N m); none in a singular pose.
    pub(crate) fn force_n(
        &self,
        motion: &Motion,
        acceleration: &Twist,
        wrench: &Vector6<f64>,
    ) -> Option<Vector6<f64>> {
        let equations = Equations::new(&self.bodies, motion);
        let moved_n = equations.inverse(acceleration, wrench)?;
        let loads = Reactions::new(&self.bodies, motion, acceleration, &moved_n).loads(&moved_n);
        let in_joints = self.friction.joint_damping(&loads, motion) * motion.twist;
        let moved_n = equations.inverse(acceleration, &(wrench - in_joints))?;
        Some(moved_n + self.drag_n(&loads, motion))
    }

    /// Friction in a motion in which the drives have these forces, N. The loads leave out that the motion accelerates.
    pub(crate) fn braking(&self, motion: &Motion, driven_n: &Vector6<f64>) -> Braking {
        let (mut axes_n, mut loads) = (Vector6::zeros(), Loads::default());
        for _ in 0..LOAD_PASSES {
            let moved_n = driven_n - axes_n;
            loads = Reactions::new(&self.bodies, motion, &Twist::zeros(), &moved_n).loads(&moved_n);
            axes_n = self.drag_n(&loads, motion);
        }
        Braking {
            axes_n,
            coulomb_n: self.friction.coulomb_n(&loads).into(),
            joints: self.friction.joint_damping(&loads, motion) * -motion.twist,
        }
    }

    /// Forces that overcome the friction of the axes, N.
    fn drag_n(&self, loads: &Loads, motion: &Motion) -> Vector6<f64> {
        Vector6::from(self.friction.coulomb_n(loads)).zip_map(&motion.rates_m_s, |coulomb_n, speed_m_s| {
            self.friction.drag_n_s_per_m(coulomb_n, speed_m_s) * speed_m_s
        })
    }
}

/// The constant twist that leads from one pose to another in a time (s), base axes, m/s and rad/s.
pub(crate) fn twist_between(from: &Pose, to: &Pose, time_s: f64) -> Twist {
    let way = to.translation.vector - from.translation.vector;
    let turn = (to.rotation * from.rotation.inverse()).scaled_axis();
    Twist::new(way.x, way.y, way.z, turn.x, turn.y, turn.z) / time_s
}
