//! The controller's own model of the mechanism: inverse dynamics with friction.

use masseter_model::dynamics::{Bodies, Equations, Friction, FrictionModel, Loads, Motion, Reactions};
use masseter_model::geometry::{Mechanism, Pose, Twist};
use masseter_scenario::Scenario;
use nalgebra::Vector6;

use super::calibration::Loaded;

/// Passes until friction and loads agree: friction depends on loads, and loads on the drives' forces less friction. The
/// first pass is exact for the screws of sliding axes; the others are for guides, and for axes near rest.
const LOAD_PASSES: usize = 5;

/// Inverse dynamics with friction, by the controller's assumed masses and friction.
///
/// τ = J⁻ᵀ (M V̇ + h − w) + friction, with the [equations](masseter_model::dynamics) of the rigid bodies.
#[derive(Debug, Clone)]
pub(crate) struct Model {
    pub(crate) mechanism: Mechanism,
    pub(super) bodies: Bodies,
    pub(super) friction: Friction,
    pub(super) law: FrictionModel,
}

/// Friction in a motion.
#[derive(Debug, Clone, Copy)]
pub(super) struct Braking {
    /// Friction of the axes that the drives overcome, N.
    pub axes_n: Vector6<f64>,
    /// The largest friction of an axis at rest, without its breakaway, N.
    pub coulomb_n: Vector6<f64>,
    /// Force that the screw of an axis transmits, N.
    pub screw_n: Vector6<f64>,
    /// Wrench of hinges and ball joints on the platform, N and N m.
    pub joints: Vector6<f64>,
}

impl Braking {
    pub(super) fn loaded<'a>(&'a self, motion: &'a Motion) -> Loaded<'a> {
        Loaded {
            jacobian: &motion.jacobian.actuators,
            speeds_m_s: &motion.rates_m_s,
            coulomb_n: &self.coulomb_n,
            screw_n: &self.screw_n,
        }
    }
}

impl Model {
    /// The model that the controller of a scenario assumes.
    pub(crate) fn new(scenario: &Scenario, mechanism: Mechanism) -> Self {
        let config = scenario.model();
        Self {
            mechanism,
            bodies: Bodies::from(&config),
            friction: Friction::new(&config),
            law: config.friction.model,
        }
    }

    /// The motion of a pose and a twist (m/s, rad/s); none for a pose without joint coordinates.
    pub(super) fn motion(&self, pose: &Pose, twist: &Twist) -> Option<Motion> {
        Motion::new(&self.mechanism, pose, twist).ok()
    }

    /// Forces of the axes d₁ d₂ d₃ l₁ l₂ l₃ (N) that give a motion the acceleration V̇ (m/s², rad/s²). They act
    /// against an external wrench on the platform (N, N m). None in a singular pose.
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
        Some(moved_n + self.drag_n(&loads, motion, None))
    }

    /// Friction in a motion with these forces of the drives, N. The loads ignore the acceleration of the motion. Bristles
    /// carry these shares of Coulomb friction; without bristles friction follows the speed.
    pub(super) fn braking(
        &self,
        motion: &Motion,
        driven_n: &Vector6<f64>,
        bristles: Option<&Vector6<f64>>,
    ) -> Braking {
        let (mut axes_n, mut loads) = (Vector6::zeros(), Loads::default());
        for _ in 0..LOAD_PASSES {
            let moved_n = driven_n - axes_n;
            loads = Reactions::new(&self.bodies, motion, &Twist::zeros(), &moved_n).loads(&moved_n);
            // A screw takes a share of the rest: the whole step would overshoot by this share.
            let missing_n = self.drag_n(&loads, motion, bristles) - axes_n;
            axes_n += Vector6::from_fn(|axis, _| missing_n[axis] / (1.0 + self.friction.screw_loss(axis)));
        }
        Braking {
            axes_n,
            coulomb_n: self.friction.coulomb_n(&loads).into(),
            screw_n: loads.screw_n.into(),
            joints: self.friction.joint_damping(&loads, motion) * -motion.twist,
        }
    }

    /// Forces that overcome the friction of the axes, N.
    fn drag_n(&self, loads: &Loads, motion: &Motion, bristles: Option<&Vector6<f64>>) -> Vector6<f64> {
        let coulomb_n = Vector6::from(self.friction.coulomb_n(loads));
        match bristles {
            Some(shares) => {
                coulomb_n.component_mul(shares) + motion.rates_m_s * self.friction.viscous_n_s_per_m
            }
            None => coulomb_n.zip_map(&motion.rates_m_s, |coulomb_n, speed_m_s| {
                self.friction.drag_n_s_per_m(coulomb_n, speed_m_s) * speed_m_s
            }),
        }
    }
}

/// The constant twist that leads from one pose to another in a time (s), base axes, m/s and rad/s.
pub(crate) fn twist_between(from: &Pose, to: &Pose, time_s: f64) -> Twist {
    let way = to.translation.vector - from.translation.vector;
    let turn = (to.rotation * from.rotation.inverse()).scaled_axis();
    Twist::new(way.x, way.y, way.z, turn.x, turn.y, turn.z) / time_s
}

/// Twist and acceleration at the middle of three poses, one period (s) apart.
pub(crate) fn derivatives([before, here, after]: [Pose; 3], period_s: f64) -> (Twist, Twist) {
    let to = twist_between(&before, &here, period_s);
    let from = twist_between(&here, &after, period_s);
    ((to + from) / 2.0, (from - to) / period_s)
}

#[cfg(test)]
mod tests {
    use masseter_model::geometry::MechanismConfig;

    use super::*;

    #[test]
    fn friction_is_found_in_the_forces_of_the_drives_whatever_the_screws_lose() {
        let wrench = Vector6::z() * -40.0;
        // A self-locking screw hides a driving load.
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
                let braking = model.braking(&motion, &driven_n, None);
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
