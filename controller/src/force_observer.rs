//! Observer of the external wrench on the platform: generalised momentum in task space (De Luca and Mattone 2005).
//!
//! With the momentum p = M V, the forces τ of the drives, and friction, the residual
//!
//! r = 1/T ∫ (ṗ − Ṁ V − Jᵀ(τ − friction) + h − r) dt
//!
//! is the external wrench behind a low-pass of the time constant T. No acceleration is needed. Between two samples the twist is
//! the difference of the poses, and the force of a drive is the mean of that time.
//!
//! The bite force is the vertical component. Its uncertainty is a bound. The friction of a moving axis is known except for a
//! share, that of an axis near rest only by its largest size. The drives round their forces: twice the standard deviation of
//! this rounding counts.

use masseter_model::dynamics::{Equations, Motion};
use masseter_model::geometry::{AXES, Pose, Twist};
use masseter_runtime::named::Signal;
use masseter_scenario::{ForceEstimateConfig, Scenario};
use nalgebra::Vector6;

use crate::model::{Braking, Model, twist_between};
use crate::pose_law::ExternalForce;

/// Drives report forces in thousandths of the rated force.
const STEPS: f64 = 1000.0;
/// Variance of a value within a step of 1: 1/12.
const ROUNDING_VARIANCE: f64 = 1.0 / 12.0;

/// What was measured between the last two samples.
#[derive(Debug, Clone, Copy)]
struct Interval {
    cycle: u64,
    pose: Pose,
    /// None before the second sample.
    driven: Option<Driven>,
}

/// Mean motion between two samples.
#[derive(Debug, Clone, Copy)]
struct Driven {
    twist: Twist,
    /// Jᵀ(τ − friction): N, N m.
    wrench: Vector6<f64>,
}

/// The observer with its memory.
#[derive(Debug, Clone)]
pub(crate) struct ForceObserver {
    model: Model,
    config: ForceEstimateConfig,
    period_s: f64,
    /// A step of the reported force, N.
    step_n: Vector6<f64>,
    last: Option<Interval>,
    /// r: force (N) and moment (N m) on the platform, base axes.
    residual: Vector6<f64>,
    uncertainty_n: f64,
}

impl ForceObserver {
    /// How many signals the observer has.
    pub(crate) const SIGNALS: usize = 5;

    /// The signals that the controller publishes of the observer.
    pub(crate) fn declared() -> [Signal; Self::SIGNALS] {
        [
            ("external_force_x_n", "External force on the platform along x of the base."),
            ("external_force_y_n", "External force on the platform along y of the base."),
            ("external_force_z_n", "External force on the platform along z of the base."),
            ("bite_force_n", "Estimated bite force: what pushes the platform downwards."),
            ("bite_force_uncertainty_n", "Bound of the error of the estimated bite force."),
        ]
        .map(|(name, about)| Signal {
            name: name.to_owned(),
            unit: "N".to_owned(),
            about: about.to_owned(),
        })
    }

    /// Writes these signals; no numbers before there is an estimate.
    pub(crate) fn fill_signals(&self, signals: &mut [f64]) {
        let values = self.external().map(|external| {
            let [x, y, z] = external.force_n;
            [x, y, z, external.bite_n(), external.uncertainty_n]
        });
        signals.copy_from_slice(&values.unwrap_or([f64::NAN; Self::SIGNALS]));
    }

    pub(crate) fn new(scenario: &Scenario, model: Model) -> Self {
        Self {
            model,
            config: scenario.force_estimate.unwrap_or_default(),
            period_s: scenario.period_s(),
            step_n: Vector6::from_fn(|axis, _| scenario.drives.of_axis(axis).rated_force_n / STEPS),
            last: None,
            residual: Vector6::zeros(),
            uncertainty_n: f64::INFINITY,
        }
    }

    /// Forgets everything: the drives' forces say nothing while brakes hold the axes.
    pub(crate) fn reset(&mut self) {
        (self.last, self.residual, self.uncertainty_n) = (None, Vector6::zeros(), f64::INFINITY);
    }

    /// The estimate; none before two intervals have been seen.
    pub(crate) fn external(&self) -> Option<ExternalForce> {
        let [x, y, z, moment_x, moment_y, moment_z] = self.residual.into();
        let is_known = self.uncertainty_n.is_finite();
        is_known.then_some(ExternalForce {
            force_n: [x, y, z],
            moment_nm: [moment_x, moment_y, moment_z],
            uncertainty_n: self.uncertainty_n,
        })
    }

    /// Takes the sample of a cycle: the pose, and the drives' mean forces (N) since the sample before. A gap between the cycles
    /// begins a new interval.
    pub(crate) fn take(&mut self, cycle: u64, pose: &Pose, force_n: &[f64; AXES]) {
        let last = self.last.replace(Interval { cycle, pose: *pose, driven: None });
        let Some(last) = last.filter(|last| last.cycle + 1 == cycle) else { return };
        let twist = twist_between(&last.pose, pose, self.period_s);
        let Some(motion) = self.model.motion(pose, &twist) else { return };
        let force_n = Vector6::from(*force_n);
        let braking = self.model.braking(&motion, &force_n);
        let wrench = motion.jacobian.actuators.tr_mul(&(force_n - braking.axes_n)) + braking.joints;
        let driven = Driven { twist, wrench };
        self.last = Some(Interval { cycle, pose: *pose, driven: Some(driven) });
        if let Some(before) = last.driven {
            self.observe(&motion, &before, &driven);
            self.uncertainty_n = self.bite_uncertainty_n(&motion, &braking);
        }
    }

    /// Between the middles of two intervals the momentum gains M ΔV.
    fn observe(&mut self, motion: &Motion, before: &Driven, driven: &Driven) {
        let Equations { mass, bias, .. } = Equations::new(&self.model.bodies, motion);
        let gained = mass * (driven.twist - before.twist) / self.period_s;
        let acting = (before.wrench + driven.wrench) / 2.0 - bias;
        let share = self.period_s / (self.period_s + self.config.observer_time_s);
        self.residual += (gained - acting - self.residual) * share;
    }

    fn bite_uncertainty_n(&self, motion: &Motion, braking: &Braking) -> f64 {
        let Self { config, step_n, .. } = self;
        let vertical = motion.jacobian.actuators.column(2);
        let (mut friction, mut variance) = (0.0, 0.0);
        for axis in 0..AXES {
            let is_at_rest = motion.rates_m_s[axis].abs() < config.rest_speed_m_s;
            let moving_n = config.friction_uncertainty * braking.axes_n[axis].abs();
            let doubt_n = if is_at_rest { braking.coulomb_n[axis] } else { moving_n };
            friction += vertical[axis].abs() * doubt_n;
            variance += (vertical[axis] * step_n[axis]).powi(2) * ROUNDING_VARIANCE;
        }
        friction + 2.0 * variance.sqrt()
    }
}

#[cfg(test)]
mod tests {
    use masseter_model::geometry::{LEGS, Mechanism, MechanismConfig, Vec3};
    use nalgebra::UnitQuaternion;

    use super::*;

    const PERIOD_S: f64 = 1e-3;

    fn model(scenario: &Scenario) -> Model {
        Model::new(scenario, Mechanism::new(&MechanismConfig::default()).unwrap())
    }

    /// A platform that swings, 5 mm and 2° at 1.5 Hz.
    fn pose(time_s: f64) -> Pose {
        let phase = std::f64::consts::TAU * 1.5 * time_s;
        Pose::from_parts(
            Vec3::new(0.001 * phase.cos(), 0.0, 0.27 + 0.005 * phase.sin()).into(),
            UnitQuaternion::from_scaled_axis(Vec3::new(0.0, 0.035 * phase.sin(), 0.0)),
        )
    }

    /// The mean force of the drives in the period before `time_s`, against a wrench on the platform.
    fn force_n(model: &Model, time_s: f64, wrench: &Vector6<f64>) -> [f64; AXES] {
        let here_s = time_s - PERIOD_S / 2.0;
        let twist = |at_s: f64| twist_between(&pose(at_s - 1e-4), &pose(at_s + 1e-4), 2e-4);
        let acceleration = (twist(here_s + 1e-4) - twist(here_s - 1e-4)) / 2e-4;
        let motion = model.motion(&pose(here_s), &twist(here_s)).unwrap();
        model.force_n(&motion, &acceleration, wrench).unwrap().into()
    }

    /// Runs from 0 on; returns the estimate of each cycle.
    fn observe(scenario: &Scenario, wrench: impl Fn(f64) -> Vector6<f64>, cycles: u64) -> Vec<Vector6<f64>> {
        let truth = model(&Scenario::default());
        let mut observer = ForceObserver::new(scenario, model(scenario));
        let after = (1..=cycles).map(|cycle| {
            let time_s = cycle as f64 * PERIOD_S;
            observer.take(cycle, &pose(time_s), &force_n(&truth, time_s, &wrench(time_s)));
            observer.residual
        });
        after.collect()
    }

    #[test]
    fn a_constant_wrench_is_found_in_motion_whatever_its_direction() {
        let wrench = Vector6::new(5.0, -8.0, -40.0, 0.3, -0.6, 0.1);
        let found = observe(&Scenario::default(), |_| wrench, 1000);
        let worst = found[100..].iter().map(|found| (found - wrench).abs()).reduce(|a, b| a.sup(&b)).unwrap();
        assert!(worst.fixed_rows::<3>(0).amax() < 0.1 && worst.fixed_rows::<3>(3).amax() < 0.01, "{worst}");
    }

    #[test]
    fn a_step_is_seen_behind_a_low_pass_of_the_observers_time() {
        let step = |time_s: f64| if time_s > 0.5 { Vector6::z() * -40.0 } else { Vector6::zeros() };
        let found = observe(&Scenario::default(), step, 600);
        // After 3 ms of low-pass and half a period of the mean: 1 − 1/e.
        let share = found[502][2] / -40.0;
        assert!((0.45..0.75).contains(&share), "{share}");
        assert!((found[520][2] + 40.0).abs() < 0.5, "{}", found[520][2]);
    }

    #[test]
    fn masses_that_are_wrong_by_a_fifth_shift_the_bite_force_by_a_fifth_of_the_weight() {
        let mut scenario = Scenario::default();
        let right = scenario.dynamics;
        scenario.controller.model = Some(masseter_scenario::DynamicsConfig {
            platform_mass_kg: 1.2 * right.platform_mass_kg,
            rod_mass_kg: 1.2 * right.rod_mass_kg,
            ..right
        });
        let found = observe(&scenario, |_| Vector6::zeros(), 300);
        let mean_n = found[100..].iter().map(|found| found[2]).sum::<f64>() / 200.0;
        assert!((mean_n - 0.2 * 1.7 * 9.81).abs() < 0.4, "{mean_n}");
    }

    #[test]
    fn near_rest_the_uncertainty_has_the_whole_coulomb_friction_of_the_legs() {
        let scenario = Scenario::default();
        let mut observer = ForceObserver::new(&scenario, model(&scenario));
        let uncertainty_n =
            |observer: &ForceObserver| observer.external().map(|external| external.uncertainty_n);
        for cycle in 1..=3 {
            assert_eq!(uncertainty_n(&observer), None, "cycle {cycle}");
            observer.take(cycle, &Pose::translation(0.0, 0.0, 0.27), &[0.0; AXES]);
        }
        let at_rest_n = uncertainty_n(&observer).unwrap();
        // 1.25 N a leg, and two standard deviations of three forces in steps of 0.5 N.
        assert!((at_rest_n - LEGS as f64 * 1.25 - 0.5).abs() < 0.1, "{at_rest_n}");
        for cycle in 4..=6 {
            observer.take(cycle, &Pose::translation(0.0, 0.0, 0.27 + 5e-5 * cycle as f64), &[0.0; AXES]);
        }
        let moving_n = uncertainty_n(&observer).unwrap();
        // 1.25 N, 20 N s/m at 50 mm/s, and a ninth of that in the screw.
        assert!((moving_n - 0.1 * LEGS as f64 * 2.5 - 0.5).abs() < 0.05, "{moving_n}");
    }

    #[test]
    fn a_gap_in_the_readings_begins_anew_without_a_jump() {
        let scenario = Scenario::default();
        let truth = model(&scenario);
        let mut observer = ForceObserver::new(&scenario, model(&scenario));
        for cycle in (1..=200).chain(205..=400) {
            let time_s = cycle as f64 * PERIOD_S;
            observer.take(cycle, &pose(time_s), &force_n(&truth, time_s, &Vector6::zeros()));
            assert!(observer.residual[2].abs() < 1.0 || cycle < 5, "cycle {cycle}: {}", observer.residual[2]);
        }
    }
}
