//! Friction of axes and joints under load. Friction at rest is a part of the plant.
//!
//! Guides, screws and seals brake the axes; hinges and ball joints brake the legs' turns. Friction here depends on
//! speed and load alone.

use nalgebra::Matrix6;

use super::bodies::Motion;
use super::parameters::{DynamicsConfig, FrictionConfig, FrictionModel};
use crate::geometry::{AXES, LEGS};

/// Friction of a leg without load, as a share of a slide's.
const LEG_SHARE: f64 = 0.25;
/// Below about this speed the friction of a hinge or a ball fades towards zero, rad/s.
const TURN_RAD_S: f64 = 0.01;

/// Forces and moments in the joints, none of them negative.
#[derive(Debug, Clone, Copy, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Loads {
    /// Normal force on the guide of each slide, N.
    pub guide_n: [f64; LEGS],
    /// Moment on the guide of each slide, N m.
    pub guide_nm: [f64; LEGS],
    /// Force that the screw of each axis transmits, N.
    pub screw_n: [f64; AXES],
    /// Force on each hinge, N.
    pub hinge_n: [f64; LEGS],
    /// Force on each ball joint, N.
    pub ball_n: [f64; LEGS],
}

impl Loads {
    /// Loads at a share of the way from these to others.
    #[must_use]
    pub fn towards(&self, others: &Self, share: f64) -> Self {
        fn mix<const N: usize>(from: [f64; N], to: [f64; N], share: f64) -> [f64; N] {
            std::array::from_fn(|i| from[i] + share * (to[i] - from[i]))
        }
        Self {
            guide_n: mix(self.guide_n, others.guide_n, share),
            guide_nm: mix(self.guide_nm, others.guide_nm, share),
            screw_n: mix(self.screw_n, others.screw_n, share),
            hinge_n: mix(self.hinge_n, others.hinge_n, share),
            ball_n: mix(self.ball_n, others.ball_n, share),
        }
    }
}

/// The friction of a mechanism.
///
/// ```
/// use masseter_model::dynamics::DynamicsConfig;
/// use masseter_model::dynamics::{Friction, Loads};
///
/// let friction = Friction::new(&DynamicsConfig::default());
/// let coulomb_n = friction.coulomb_n(&Loads { guide_n: [1000.0; 3], ..Loads::default() });
/// // 5 N of the seals and 0.5 % of the load.
/// assert!((coulomb_n[0] - 10.0).abs() < 1e-12);
/// // At 50 mm/s: Coulomb friction and 20 N s/m.
/// let at_n = friction.drag_n_s_per_m(coulomb_n[0], 0.05) * 0.05;
/// assert!((at_n - 11.0).abs() < 1e-3);
/// ```
#[derive(Debug, Clone, Copy, serde::Serialize, serde::Deserialize)]
pub struct Friction {
    /// The table of the scenario; without friction, guides and joints have none, and screws have no loss.
    pub config: FrictionConfig,
    /// Viscous friction of an axis, N per m/s.
    pub viscous_n_s_per_m: f64,
    unloaded_n: [f64; AXES],
}

impl Friction {
    /// The friction of a scenario.
    pub fn new(dynamics: &DynamicsConfig) -> Self {
        let mut config = dynamics.friction;
        if config.model == FrictionModel::None {
            (config.guide_coefficient, config.joint_coefficient) = (0.0, 0.0);
            (config.slide_screw_efficiency, config.leg_screw_efficiency) = (1.0, 1.0);
            return Self { config, unloaded_n: [0.0; AXES], viscous_n_s_per_m: 0.0 };
        }
        let share = |axis: usize| if axis < LEGS { 1.0 } else { LEG_SHARE };
        let unloaded_n = std::array::from_fn(|axis| dynamics.slide_friction_n * share(axis));
        Self { config, unloaded_n, viscous_n_s_per_m: dynamics.viscous_friction_n_s_per_m }
    }

    /// Coulomb friction of the axes d₁ d₂ d₃ l₁ l₂ l₃, N, of seals, screws, and the slides' guides: F_seal + |f|(1/η −
    /// 1) + μ(N + k M/L).
    pub fn coulomb_n(&self, loads: &Loads) -> [f64; AXES] {
        std::array::from_fn(|axis| {
            let guided_n =
                if axis < LEGS { self.guide_n(loads.guide_n[axis], loads.guide_nm[axis]) } else { 0.0 };
            self.unloaded_n[axis] + loads.screw_n[axis] * self.screw_loss(axis) + guided_n
        })
    }

    /// Friction of a guide under a normal force (N) and a moment (N m), N.
    fn guide_n(&self, normal_n: f64, moment_nm: f64) -> f64 {
        let FrictionConfig { guide_coefficient, block_factor, block_spacing_m, .. } = self.config;
        guide_coefficient * (normal_n + block_factor * moment_nm / block_spacing_m)
    }

    /// Force that the screw of an axis loses, as a share of its transmitted force. The share is the same when the load
    /// drives.
    pub fn screw_loss(&self, axis: usize) -> f64 {
        let FrictionConfig { slide_screw_efficiency, leg_screw_efficiency, .. } = self.config;
        let efficiency = if axis < LEGS { slide_screw_efficiency } else { leg_screw_efficiency };
        1.0 / efficiency - 1.0
    }

    /// By how much this share grows where the efficiency is smaller by `doubt`, at least a tenth.
    pub fn screw_doubt(&self, axis: usize, doubt: f64) -> f64 {
        let inverse = 1.0 + self.screw_loss(axis);
        1.0 / (1.0 / inverse - doubt).max(0.1) - inverse
    }

    /// Friction divided by speed, N per m/s: Stribeck curve and viscous friction,
    /// F = √(2e)(F_s − F_c) exp(−(v/v_S)²) v/v_S + F_c tanh(v/v_C) + f v with v_S = √2 v_b and v_C = v_b/10 (MathWorks,
    /// Translational Friction).
    pub fn drag_n_s_per_m(&self, coulomb_n: f64, speed_m_s: f64) -> f64 {
        let breakaway_m_s = self.config.breakaway_speed_m_s;
        let (stribeck_m_s, coulomb_m_s) = (breakaway_m_s * 2f64.sqrt(), breakaway_m_s / 10.0);
        let excess_n = coulomb_n * (self.config.breakaway_ratio - 1.0);
        let stribeck = (2.0 * std::f64::consts::E).sqrt() * excess_n / stribeck_m_s
            * (-(speed_m_s / stribeck_m_s).powi(2)).exp();
        let ratio = (speed_m_s / coulomb_m_s).abs();
        // tanh x / x, which is 1 at rest.
        let coulomb = coulomb_n / coulomb_m_s * if ratio > 1e-6 { ratio.tanh() / ratio } else { 1.0 };
        stribeck + coulomb + self.viscous_n_s_per_m
    }

    /// `lugre`: how much the bristles slip in a step (s) at a speed (m/s). Their deflection z after a step h is (z + h v) /
    /// slip: ż = v − |v| z/z_max, implicit in z.
    pub fn slip(&self, speed_m_s: f64, step_s: f64) -> f64 {
        let FrictionConfig { bristle_deflection_m, breakaway_ratio, breakaway_speed_m_s, .. } = self.config;
        let excess = (breakaway_ratio - 1.0) * (-(speed_m_s / breakaway_speed_m_s).powi(2)).exp();
        1.0 + step_s * speed_m_s.abs() / (bristle_deflection_m * (1.0 + excess))
    }

    /// Damping D of hinges and ball joints, N s/m to N m s/rad: their friction is the wrench −D V for the platform's
    /// twist V. The torque is μ r f, and fades towards zero at rest.
    ///
    /// Each leg adds c_h h hᵀ for its hinge and c_b (I_ω − u hᵀ − h uᵀ + h hᵀ) for its ball:
    /// - c is the torque divided by the speed of the turn.
    /// - The hinge turns at θ̇ = hᵀV about the slide's direction û, and u = (0, û).
    /// - The ball turns at ω − θ̇ û, with the platform in a socket that turns with the leg.
    /// - I_ω is the identity of the angular part.
    pub fn joint_damping(&self, loads: &Loads, motion: &Motion) -> Matrix6<f64> {
        let FrictionConfig { joint_coefficient, hinge_radius_m, ball_radius_m, .. } = self.config;
        let mut damping = Matrix6::zeros();
        for leg in 0..LEGS {
            let (hinge, swing_rad_s) =
                (motion.jacobian.hinges.row(leg).transpose(), motion.swings_rad_s[leg]);
            let along_slide = motion.jacobian.actuators.fixed_view::<1, 3>(leg, 0).transpose();
            let turn_rad_s = motion.omega() - along_slide * swing_rad_s;
            let of_hinge =
                joint_coefficient * hinge_radius_m * loads.hinge_n[leg] / faded(swing_rad_s.powi(2));
            let of_ball =
                joint_coefficient * ball_radius_m * loads.ball_n[leg] / faded(turn_rad_s.norm_squared());
            let mut half = hinge * (0.5 * (of_hinge + of_ball));
            half.fixed_rows_mut::<3>(3).axpy(-of_ball, &along_slide, 1.0);
            damping.ger(1.0, &hinge, &half, 1.0);
            damping.ger(1.0, &half, &hinge, 1.0);
            (3..6).for_each(|row| damping[(row, row)] += of_ball);
        }
        damping
    }

    /// Friction of a guide per force across the slide at a lever of h (m): μ k h/L. From 1 on the guide locks itself.
    pub fn self_locking(&self, lever_m: f64) -> f64 {
        let FrictionConfig { guide_coefficient, block_factor, block_spacing_m, .. } = self.config;
        guide_coefficient * block_factor * lever_m / block_spacing_m
    }
}

/// The divisor of a turn's torque, which stays above zero at rest, rad/s.
fn faded(square_rad2_s2: f64) -> f64 {
    (square_rad2_s2 + TURN_RAD_S * TURN_RAD_S).sqrt()
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix3, Matrix3x6};
    use proptest::prelude::*;

    use super::*;
    use crate::geometry::{Mechanism, MechanismConfig, Pose, Twist, Vec3};

    fn friction(change: impl Fn(&mut DynamicsConfig)) -> Friction {
        let mut config = DynamicsConfig { slide_friction_n: 0.0, ..DynamicsConfig::default() };
        change(&mut config);
        Friction::new(&config)
    }

    #[test]
    fn a_bite_with_shear_loads_a_ball_rail_little_and_a_bush_more_than_the_slide_can_push() {
        let loads = Loads { guide_n: [400.0; 3], guide_nm: [33.5; 3], ..Loads::default() };
        for (guide_coefficient, expected_n) in [(0.005, 6.2), (0.1, 124.0)] {
            let friction = friction(|config| config.friction.guide_coefficient = guide_coefficient);
            let [found_n, ..] = friction.coulomb_n(&loads);
            assert!((found_n / expected_n - 1.0).abs() < 0.01, "{found_n} N");
        }
    }

    #[test]
    fn a_trapezoidal_screw_of_a_leg_loses_more_than_the_bite() {
        let loads = Loads { screw_n: [400.0; 6], ..Loads::default() };
        for (leg_screw_efficiency, expected_n) in [(0.9, 44.4), (0.4, 600.0), (1.0, 0.0)] {
            let friction = friction(|config| config.friction.leg_screw_efficiency = leg_screw_efficiency);
            let found_n = friction.coulomb_n(&loads)[3];
            assert!((found_n - expected_n).abs() < 0.1, "{found_n} N");
        }
    }

    #[test]
    fn the_curve_peaks_at_the_breakaway_speed_and_falls_to_coulomb_friction() {
        let friction = friction(|config| config.viscous_friction_n_s_per_m = 0.0);
        let at_n = |speed_m_s: f64| friction.drag_n_s_per_m(10.0, speed_m_s) * speed_m_s;
        assert!((at_n(0.01) - 12.0).abs() < 1e-6 && (at_n(0.1) - 10.0).abs() < 1e-6, "{} N", at_n(0.01));
        assert!(at_n(0.009) < at_n(0.01) && at_n(0.011) < at_n(0.01));
        assert!((at_n(-0.01) + at_n(0.01)).abs() < 1e-12);
        assert!(at_n(0.0).abs() < 1e-12);
    }

    #[test]
    fn hinges_and_balls_take_the_power_of_their_torques() {
        let mechanism = Mechanism::new(&MechanismConfig::default()).unwrap();
        let twist = Twist::new(0.05, -0.02, 0.08, 2.0, -1.0, 3.0);
        let motion = Motion::new(&mechanism, &Pose::translation(0.0, 0.0, 0.268), &twist).unwrap();
        let loads = Loads { hinge_n: [100.0; 3], ball_n: [200.0; 3], ..Loads::default() };
        let damping = friction(|_| ()).joint_damping(&loads, &motion);
        let expected_w: f64 = (0..LEGS)
            .map(|leg| {
                let swing = mechanism.slide_direction(leg) * motion.swings_rad_s[leg];
                // 0.1 · 5 mm · 100 N in a hinge, 0.1 · 10 mm · 200 N in a ball.
                0.05 * swing.norm() + 0.2 * (Vec3::new(2.0, -1.0, 3.0) - swing).norm()
            })
            .sum();
        let power_w = twist.dot(&(damping * twist));
        assert!((power_w / expected_w - 1.0).abs() < 1e-3, "{power_w} W, expected {expected_w} W");
    }

    /// Speed of a ball in its socket at the platform's twist.
    fn ball_turns(motion: &Motion, leg: usize) -> Matrix3x6<f64> {
        let along_slide = motion.jacobian.actuators.fixed_view::<1, 3>(leg, 0).transpose();
        let mut turns = -along_slide * motion.jacobian.hinges.row(leg);
        let mut of_platform = turns.fixed_view_mut::<3, 3>(0, 3);
        of_platform += Matrix3::identity();
        turns
    }

    proptest! {
        #[test]
        fn joint_damping_is_the_sum_over_all_turns(
            place_m in [-0.02..0.02f64, -0.02..0.02f64, 0.25..0.29f64],
            turn_rad in [-0.3..0.3f64, -0.3..0.3f64, -0.3..0.3f64],
            twist in [-0.2..0.2f64, -0.2..0.2f64, -0.2..0.2f64, -3.0..3.0f64, -3.0..3.0f64, -3.0..3.0f64],
            hinge_n in [0.0..300.0f64, 0.0..300.0f64, 0.0..300.0f64],
            ball_n in [0.0..300.0f64, 0.0..300.0f64, 0.0..300.0f64],
        ) {
            let mechanism = Mechanism::new(&MechanismConfig::default()).unwrap();
            let pose = Pose::new(Vec3::from(place_m), Vec3::from(turn_rad));
            let motion = Motion::new(&mechanism, &pose, &Twist::from(twist)).unwrap();
            let mut expected = Matrix6::zeros();
            for leg in 0..LEGS {
                let hinge = motion.jacobian.hinges.row(leg);
                let turns = ball_turns(&motion, leg);
                let torques_nm = [0.1 * 0.005 * hinge_n[leg], 0.1 * 0.01 * ball_n[leg]];
                expected += hinge.transpose() * hinge * (torques_nm[0] / faded(motion.swings_rad_s[leg].powi(2)));
                expected += turns.transpose() * turns * (torques_nm[1] / faded((turns * motion.twist).norm_squared()));
            }
            let loads = Loads { hinge_n, ball_n, ..Loads::default() };
            let found = friction(|_| ()).joint_damping(&loads, &motion);
            prop_assert!((found - expected).amax() <= 1e-12 * (1.0 + expected.amax()), "{found} {expected}");
        }
    }

    #[test]
    fn a_bush_on_a_short_carriage_locks_itself_where_the_lever_is_long() {
        // Spacing 60 mm, lever 0.27 m: from a coefficient of 0.11 on.
        for (guide_coefficient, locks) in [(0.10, false), (0.12, true)] {
            let friction = friction(|config| {
                config.friction.guide_coefficient = guide_coefficient;
                config.friction.block_spacing_m = 0.06;
            });
            assert_eq!(friction.self_locking(0.27) >= 1.0, locks, "{guide_coefficient}");
        }
    }
}
