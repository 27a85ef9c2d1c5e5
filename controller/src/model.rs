//! What the controller believes of the mechanism: inverse dynamics with friction.
//!
//! τ = J⁻ᵀ (M V̇ + h − w) + friction, with the [equations](masseter_model::dynamics) of the rigid bodies.

use masseter_model::dynamics::{Bodies, Equations, Friction, Loads, Motion, Reactions};
use masseter_model::geometry::{Mechanism, Pose, Twist};
use masseter_scenario::Scenario;
use nalgebra::Vector6;

/// Friction depends on loads, and loads on what friction leaves of the drives' forces: passes until both agree. The first one
/// is exact for the screws of sliding axes; the others are for guides, and for axes near rest.
const LOAD_PASSES: usize = 5;

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
            // A screw takes a share of what is left: the whole step would overshoot by it.
            let missing_n = self.drag_n(&loads, motion) - axes_n;
            axes_n += Vector6::from_fn(|axis, _| missing_n[axis] / (1.0 + self.friction.screw_loss(axis)));
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

#[cfg(test)]
mod tests {
    use masseter_model::geometry::MechanismConfig;

    use super::*;

    #[test]
    fn friction_is_found_in_the_forces_of_the_drives_whatever_the_screws_lose() {
        let wrench = Vector6::z() * -40.0;
        // A load that drives is hidden by a screw that locks itself.
        for (leg_screw_efficiency, speeds_m_s) in
            [(0.9, [0.05, -0.05]), (0.8, [0.05, -0.05]), (0.3, [0.05, 0.02])]
        {
            let mut scenario = Scenario::default();
            scenario.dynamics.friction.leg_screw_efficiency = leg_screw_efficiency;
            let model = Model::new(&scenario, Mechanism::new(&MechanismConfig::default()).unwrap());
            for speed_m_s in speeds_m_s {
                let twist = Vector6::z() * speed_m_s;
                let motion = model.motion(&Pose::translation(0.0, 0.0, 0.268), &twist).unwrap();
                let driven_n = model.force_n(&motion, &Twist::zeros(), &wrench).unwrap();
                let braking = model.braking(&motion, &driven_n);
                let found = motion.jacobian.actuators.tr_mul(&(driven_n - braking.axes_n)) + braking.joints;
                let needed = Equations::new(&model.bodies, &motion).bias - wrench;
                assert!(
                    (found - needed).amax() < 0.5,
                    "{leg_screw_efficiency} at {speed_m_s} m/s: {found} {needed}"
                );
            }
        }
    }
}
