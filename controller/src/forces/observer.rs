//! The observer of external forces, with the uncertainty of the bite force.

use masseter_model::dynamics::{Equations, FrictionModel, Loads, Motion};
use masseter_model::geometry::{AXES, Pose, Twist};
use masseter_scenario::{ForceEstimateConfig, ForceFusion, Scenario};
use nalgebra::{SVector, Vector6};

use super::calibration::Calibration;
use super::cell::{COVERAGE, Cell, Known};
use super::model::{Braking, Model, twist_between};
use crate::pose_law::ExternalForce;

/// Drives report forces in thousandths of the rated force.
const STEPS: f64 = 1000.0;
/// Variance of a value within a step of 1: 1/12.
const ROUNDING_VARIANCE: f64 = 1.0 / 12.0;
/// Uncertainty of a value that is anywhere within a bound of 1: its standard deviation is 1/√3.
const OF_BOUND: f64 = COVERAGE * 0.577_350_269_189_625_8;

/// The measurement between the last two samples.
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

/// Observer of the external wrench on the platform: generalised momentum in task space (De Luca and Mattone 2005).
///
/// With the momentum p = M V, the forces τ of the drives, and friction, the residual
///
/// r = 1/T ∫ (ṗ − Ṁ V − Jᵀ(τ − friction) + h − r) dt
///
/// is the external wrench behind a low-pass of the time constant T. No acceleration is needed. Between two samples the
/// twist is the difference of the poses, and the force of a drive is the mean of that time.
///
/// The bite force is the vertical component. Its uncertainty has terms for the level and the law of friction, screws, masses,
/// delay and rounding. The uncertainty is no bound: docs/dynamics-control.md has the terms and the share of cycles that it covers.
#[derive(Debug, Clone)]
pub(super) struct ForceObserver {
    model: Model,
    config: ForceEstimateConfig,
    period_s: f64,
    /// A step of the reported force, N.
    step_n: Vector6<f64>,
    last: Option<Interval>,
    calibration: Calibration,
    /// None without fusion with the load cell.
    cell: Option<Cell>,
    /// `lugre`: deflections of the axes' bristles, m.
    bristles_m: Vector6<f64>,
    /// r: force (N) and moment (N m) on the platform, base axes.
    residual: Vector6<f64>,
    /// The vertical force behind another low-pass, N: as late behind the estimate as the estimate behind the force.
    late_n: f64,
    uncertainty_n: f64,
}

impl ForceObserver {
    /// The signals that the controller publishes of the observer, with their meanings.
    pub(super) const SIGNALS: [(&str, &str); 5] = [
        ("external_force_x_n", "External force on the platform along x of the base."),
        ("external_force_y_n", "External force on the platform along y of the base."),
        ("external_force_z_n", "External force on the platform along z of the base."),
        ("bite_force_n", "Estimated bite force: what pushes the platform downwards."),
        ("bite_force_uncertainty_n", "Uncertainty of the estimated bite force, two standard deviations."),
    ];

    /// Writes these signals; NaN before the first estimate.
    pub(super) fn fill_signals(&self, signals: &mut [f64]) {
        let values = self.external().map(|external| {
            let [x, y, z] = external.force_n;
            [x, y, z, external.bite_n(), external.uncertainty_n]
        });
        signals.copy_from_slice(&values.unwrap_or([f64::NAN; Self::SIGNALS.len()]));
    }

    pub(super) fn new(scenario: &Scenario, model: Model) -> Self {
        let (config, period_s) = (scenario.force_estimate.unwrap_or_default(), scenario.period_s());
        let samples = (config.calibration_s / period_s).round() as u64;
        let cell = scenario.load_cell.filter(|_| config.fusion == ForceFusion::LoadCell);
        Self {
            model,
            config,
            period_s,
            calibration: Calibration::new(samples, config.rest_speed_m_s),
            cell: cell.map(|cell| Cell::new(cell, period_s)),
            step_n: Vector6::from_fn(|axis, _| scenario.drives.of_axis(axis).rated_force_n / STEPS),
            last: None,
            bristles_m: Vector6::zeros(),
            residual: Vector6::zeros(),
            late_n: 0.0,
            uncertainty_n: f64::INFINITY,
        }
    }

    /// Clears the observer: the drives' forces have no meaning while brakes hold the axes.
    pub(super) fn reset(&mut self) {
        (self.last, self.residual, self.late_n) = (None, Vector6::zeros(), 0.0);
        (self.bristles_m, self.uncertainty_n) = (Vector6::zeros(), f64::INFINITY);
    }

    /// The estimate; none before two intervals, or before the calibration is complete.
    pub(super) fn external(&self) -> Option<ExternalForce> {
        let [x, y, z, moment_x, moment_y, moment_z] = self.residual.into();
        let is_known = self.uncertainty_n.is_finite() && self.calibration.is_complete();
        let observed = Known { bite_n: -z, uncertainty_n: self.uncertainty_n };
        let known = self.cell.as_ref().map_or(observed, |cell| cell.fused(observed));
        is_known.then_some(ExternalForce {
            force_n: [x, y, -known.bite_n],
            moment_nm: [moment_x, moment_y, moment_z],
            uncertainty_n: known.uncertainty_n,
        })
    }

    /// The bite force by the drives alone, N, also from a calibration that is not complete; none before two intervals.
    pub(super) fn rough_bite_n(&self) -> Option<f64> {
        (self.uncertainty_n != f64::INFINITY).then_some(-self.residual[2])
    }

    /// Takes what the load cell shows in a cycle, N.
    pub(super) fn take_cell(&mut self, shown_n: f64) {
        if let Some(cell) = &mut self.cell {
            cell.take_sample(shown_n, self.calibration.is_complete());
        }
    }

    /// Takes the sample of a cycle: the pose, and the drives' mean forces (N) since the sample before. A gap between
    /// the cycles begins a new interval.
    pub(super) fn take_sample(&mut self, cycle: u64, pose: &Pose, force_n: &[f64; AXES]) {
        let last = self.last.replace(Interval { cycle, pose: *pose, driven: None });
        let Some(last) = last.filter(|last| last.cycle + 1 == cycle) else { return };
        let twist = twist_between(&last.pose, pose, self.period_s);
        let Some(motion) = self.model.motion(pose, &twist) else { return };
        let force_n = Vector6::from(*force_n);
        let bristles = self.bristles(&motion);
        let braking = self.model.braking(&motion, &force_n, bristles.as_ref());
        let braked_n = braking.axes_n + self.calibration.beside_model_n(&motion.rates_m_s);
        let wrench = motion.jacobian.actuators.tr_mul(&(force_n - braked_n)) + braking.joints;
        let driven = Driven { twist, wrench };
        self.last = Some(Interval { cycle, pose: *pose, driven: Some(driven) });
        if let Some(before) = last.driven {
            let weight_n = self.observe(&motion, &before, &driven);
            self.calibration.take_sample(&self.residual, &braking.loaded(&motion));
            // A doubt stays in the estimate as long as a force does.
            let now_n = self.bite_uncertainty_n(&motion, &braking, weight_n);
            let before_n = if self.uncertainty_n.is_finite() { self.uncertainty_n } else { now_n };
            self.uncertainty_n = before_n + (now_n - before_n) * self.share();
        }
    }

    /// Shares of Coulomb friction that the axes' bristles carry; none with another law of friction.
    fn bristles(&mut self, motion: &Motion) -> Option<Vector6<f64>> {
        let (friction, period_s) = (&self.model.friction, self.period_s);
        (self.model.law == FrictionModel::Lugre).then(|| {
            self.bristles_m.zip_apply(&motion.rates_m_s, |bristles_m, speed_m_s| {
                *bristles_m = (*bristles_m + period_s * speed_m_s) / friction.slip(speed_m_s, period_s);
            });
            self.bristles_m / friction.config.bristle_deflection_m
        })
    }

    /// Share of what is new that the low-pass takes in a period.
    fn share(&self) -> f64 {
        self.period_s / (self.period_s + self.config.observer_time_s)
    }

    /// Between the middles of two intervals the momentum gains M ΔV. Returns the vertical part of weight and inertia, N.
    fn observe(&mut self, motion: &Motion, before: &Driven, driven: &Driven) -> f64 {
        let Equations { mass, bias, .. } = Equations::new(&self.model.bodies, motion);
        let gained = mass * (driven.twist - before.twist) / self.period_s;
        let acting = (before.wrench + driven.wrench) / 2.0 - bias;
        let share = self.share();
        self.residual += (gained - acting - self.residual) * share;
        // The estimate is late by the low-pass and a period.
        let late_s = self.config.observer_time_s + self.period_s;
        self.late_n += (self.residual[2] - self.late_n) * self.period_s / (self.period_s + late_s);
        bias[2]
    }

    /// The terms are independent of each other, so their squares add. A term has the same cause on all axes, whose doubts
    /// therefore add in size.
    fn bite_uncertainty_n(&self, motion: &Motion, braking: &Braking, weight_n: f64) -> f64 {
        let Self { config, model: Model { friction, .. }, step_n, .. } = self;
        let vertical = motion.jacobian.actuators.column(2).abs();
        let losses = Vector6::from_fn(|axis, _| friction.screw_doubt(axis, config.screw_uncertainty));
        let breakaway = friction.config.breakaway_ratio + config.breakaway_uncertainty;
        let calibrated = self.calibration.doubts_n(&braking.loaded(motion), &losses, breakaway);
        let (left_n, bounds_n) = if let Some([left_n, lost_n]) = calibrated {
            (left_n, lost_n)
        } else {
            let speeds_m_s = motion.rates_m_s.abs();
            let unloaded_n = Vector6::from(friction.coulomb_n(&Loads::default())).component_mul(&vertical);
            let coulomb_n = braking.coulomb_n.component_mul(&vertical);
            let share = config.friction_uncertainty;
            let bounds_n = [
                self.held_doubt_n(&speeds_m_s, &coulomb_n, &unloaded_n),
                (breakaway - 1.0) * coulomb_n.dot(&speeds_m_s.map(|speed_m_s| self.breaking(speed_m_s))),
                vertical.dot(&braking.screw_n.component_mul(&losses)),
                share * unloaded_n.sum(),
                share * friction.viscous_n_s_per_m * vertical.dot(&speeds_m_s),
                share * braking.joints[2],
                config.mass_uncertainty * weight_n,
            ];
            (0.0, SVector::from(bounds_n).norm())
        };
        let rounding_n = vertical.component_mul(step_n).norm() * ROUNDING_VARIANCE.sqrt();
        let late_n = self.residual[2] - self.late_n;
        (OF_BOUND * bounds_n).hypot(left_n).hypot(late_n).hypot(COVERAGE * rounding_n)
    }

    /// By how much the friction of axes at rest may differ where another law holds, which holds them in either direction, N.
    /// What friction has without load holds each axis by its own history, so squares add; the load is the same for all.
    fn held_doubt_n(
        &self,
        speeds_m_s: &Vector6<f64>,
        coulomb_n: &Vector6<f64>,
        unloaded_n: &Vector6<f64>,
    ) -> f64 {
        let rests = speeds_m_s.map(|speed_m_s| self.calibration.rest(speed_m_s));
        rests.component_mul(unloaded_n).norm() + rests.dot(&(coulomb_n - unloaded_n))
    }

    /// How much an axis of this speed may have breakaway friction, whose speed may be twice the model's, 0 to 1.
    fn breaking(&self, speed_m_s: f64) -> f64 {
        (-(speed_m_s / (2.0 * self.model.friction.config.breakaway_speed_m_s)).powi(2)).exp()
    }
}

#[cfg(test)]
mod tests;
