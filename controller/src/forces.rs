//! Forces by the controller's own model of the mechanism: the model, the observer of external forces, and
//! feed-forward. Nothing here controls a force.

use masseter_model::dynamics::{Bodies, Equations, Friction, FrictionModel, Loads, Motion, Reactions};
use masseter_model::geometry::{AXES, Mechanism, Pose, Twist};
use masseter_runtime::messages::Reading;
use masseter_runtime::messages::codes::Cause;
use masseter_runtime::named::Signal;
use masseter_scenario::{ForceControlConfig, ForceEstimateConfig, ForceSource, Scenario};
use nalgebra::{SVector, Vector6};

use crate::forces::calibration::{Calibration, Loaded};
use crate::pose_law::{Detour, ExternalForce, PoseLaw};
use crate::{safety::Fault, sequencer::Sequencer};

mod calibration;

/// Passes until friction and loads agree: friction depends on loads, and loads on the drives' forces less friction. The
/// first pass is exact for the screws of sliding axes; the others are for guides, and for axes near rest.
const LOAD_PASSES: usize = 5;
/// Drives report forces in thousandths of the rated force.
const STEPS: f64 = 1000.0;
/// Variance of a value within a step of 1: 1/12.
const ROUNDING_VARIANCE: f64 = 1.0 / 12.0;
/// Uncertainties are this many standard deviations.
const COVERAGE: f64 = 2.0;
/// Uncertainty of a value that is anywhere within a bound of 1: its standard deviation is 1/√3.
const OF_BOUND: f64 = COVERAGE * 0.577_350_269_189_625_8;
/// Time from no offset to the whole offset, s: ten times that of a drive's loops.
const FADE_IN_S: f64 = 0.3;

/// The forces of the rig: estimated, measured, and fed forward.
#[derive(Debug, Clone)]
pub(crate) struct Forces {
    /// None without an estimate of the bite force in the scenario.
    observer: Option<ForceObserver>,
    has_load_cell: bool,
    /// Last value of the load cell, N.
    pub(crate) load_cell_n: Option<f64>,
    /// None without control of the bite force in the scenario.
    control: Option<ForceControlConfig>,
    /// None without feed-forward in the scenario.
    feed_forward: Option<FeedForward>,
    /// Offsets of this cycle, N.
    pub(crate) offset_n: [f64; AXES],
}

impl Forces {
    pub(crate) fn new(scenario: &Scenario, mechanism: &Mechanism) -> Self {
        let model = || Model::new(scenario, mechanism.clone());
        let feed_forward = || FeedForward::new(model(), scenario.period_s());
        Self {
            observer: scenario.is_force_estimated().then(|| ForceObserver::new(scenario, model())),
            has_load_cell: scenario.load_cell.is_some(),
            load_cell_n: None,
            control: scenario.force_control,
            feed_forward: scenario.controller.feed_forward_torque.then(feed_forward),
            offset_n: [0.0; AXES],
        }
    }

    /// Takes the values of a reading. The observer takes each fresh sample while the drives carry the jaw.
    pub(crate) fn observe(&mut self, reading: Option<&Reading>, sequencer: &Sequencer) {
        if let Some(observer) = &mut self.observer {
            match (reading, sequencer.fresh_estimate()) {
                _ if !sequencer.is_moving() => observer.reset(),
                (Some(reading), Some(estimate)) => {
                    observer.take_sample(reading.cycle, &estimate.solution.pose, &reading.force_n);
                }
                _ => {}
            }
        }
        if let Some(reading) = reading.filter(|_| self.has_load_cell) {
            self.load_cell_n = Some(reading.load_cell_n);
        }
    }

    /// The external force on the platform, once there is an estimate.
    pub(crate) fn external(&self) -> Option<ExternalForce> {
        self.observer.as_ref().and_then(ForceObserver::external)
    }

    /// Refuses a bite force above the limit of the force control, or one that is no number, whatever law controls the force.
    /// During a calibration the rough force counts: a limit has no time without a force.
    pub(crate) fn check_bite(&self) -> Result<(), Fault> {
        let Some(control) = &self.control else { return Ok(()) };
        let bite_n = match control.source {
            ForceSource::Estimate => self.observer.as_ref().and_then(ForceObserver::rough_bite_n),
            ForceSource::LoadCell => self.load_cell_n,
        };
        match bite_n {
            Some(bite_n) if bite_n.is_nan() || bite_n > control.limit_n() => {
                Err(Fault::new(Cause::ForceLimit, bite_n, control.limit_n()))
            }
            _ => Ok(()),
        }
    }

    /// The motion begins anew.
    pub(crate) fn begin_motion(&mut self) {
        self.feed_forward.iter_mut().for_each(FeedForward::begin);
    }

    /// The forces that the motion needs while the drives move to the targets of this cycle. The drives approach a
    /// target during the last period before its time. `before` gives the desired pose this many periods before that
    /// time.
    pub(crate) fn feed_forward(&mut self, law: &dyn PoseLaw, before: impl Fn(f64) -> Pose) {
        if let Some(feed_forward) = &mut self.feed_forward {
            self.offset_n = feed_forward.offset_n([1.5, 0.5, -0.5].map(before), &law.detour());
        }
    }

    /// The signals of the estimate.
    pub(crate) fn signals(&self) -> impl Iterator<Item = Signal> {
        self.observer.iter().flat_map(|_| ForceObserver::declared())
    }

    /// Writes these signals.
    pub(crate) fn fill_signals(&self, signals: &mut [f64]) {
        if let Some(observer) = &self.observer {
            observer.fill_signals(signals);
        }
    }
}

/// A signal with its unit and meaning.
pub(crate) fn signal(name: &str, unit: &str, about: &str) -> Signal {
    Signal { name: name.to_owned(), unit: unit.to_owned(), about: about.to_owned() }
}

/// Inverse dynamics with friction, by the controller's assumed masses and friction.
///
/// τ = J⁻ᵀ (M V̇ + h − w) + friction, with the [equations](masseter_model::dynamics) of the rigid bodies.
#[derive(Debug, Clone)]
pub(crate) struct Model {
    pub(crate) mechanism: Mechanism,
    bodies: Bodies,
    friction: Friction,
    law: FrictionModel,
}

/// Friction in a motion.
#[derive(Debug, Clone, Copy)]
struct Braking {
    /// Friction of the axes that the drives overcome, N.
    axes_n: Vector6<f64>,
    /// The largest friction of an axis at rest, without its breakaway, N.
    coulomb_n: Vector6<f64>,
    /// Force that the screw of an axis transmits, N.
    screw_n: Vector6<f64>,
    /// Wrench of hinges and ball joints on the platform, N and N m.
    joints: Vector6<f64>,
}

impl Braking {
    fn loaded<'a>(&'a self, motion: &'a Motion) -> Loaded<'a> {
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
    fn motion(&self, pose: &Pose, twist: &Twist) -> Option<Motion> {
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
    fn braking(&self, motion: &Motion, driven_n: &Vector6<f64>, bristles: Option<&Vector6<f64>>) -> Braking {
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
                coulomb_n.component_mul(shares) + motion.rates_m_s * self.friction.viscous_n_s_per_m()
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
struct ForceObserver {
    model: Model,
    config: ForceEstimateConfig,
    period_s: f64,
    /// A step of the reported force, N.
    step_n: Vector6<f64>,
    last: Option<Interval>,
    calibration: Calibration,
    /// `lugre`: deflections of the axes' bristles, m.
    bristles_m: Vector6<f64>,
    /// r: force (N) and moment (N m) on the platform, base axes.
    residual: Vector6<f64>,
    /// The vertical force behind another low-pass, N: as late behind the estimate as the estimate behind the force.
    late_n: f64,
    uncertainty_n: f64,
}

impl ForceObserver {
    /// Number of the observer's signals.
    const SIGNALS: usize = 5;

    /// The signals that the controller publishes of the observer.
    fn declared() -> [Signal; Self::SIGNALS] {
        [
            ("external_force_x_n", "External force on the platform along x of the base."),
            ("external_force_y_n", "External force on the platform along y of the base."),
            ("external_force_z_n", "External force on the platform along z of the base."),
            ("bite_force_n", "Estimated bite force: what pushes the platform downwards."),
            ("bite_force_uncertainty_n", "Bound of the error of the estimated bite force."),
        ]
        .map(|(name, about)| signal(name, "N", about))
    }

    /// Writes these signals; NaN before the first estimate.
    fn fill_signals(&self, signals: &mut [f64]) {
        let values = self.external().map(|external| {
            let [x, y, z] = external.force_n;
            [x, y, z, external.bite_n(), external.uncertainty_n]
        });
        signals.copy_from_slice(&values.unwrap_or([f64::NAN; Self::SIGNALS]));
    }

    fn new(scenario: &Scenario, model: Model) -> Self {
        let (config, period_s) = (scenario.force_estimate.unwrap_or_default(), scenario.period_s());
        let samples = (config.calibration_s / period_s).round() as u64;
        Self {
            model,
            config,
            period_s,
            calibration: Calibration::new(samples, config.rest_speed_m_s),
            step_n: Vector6::from_fn(|axis, _| scenario.drives.of_axis(axis).rated_force_n / STEPS),
            last: None,
            bristles_m: Vector6::zeros(),
            residual: Vector6::zeros(),
            late_n: 0.0,
            uncertainty_n: f64::INFINITY,
        }
    }

    /// Clears the observer: the drives' forces have no meaning while brakes hold the axes.
    fn reset(&mut self) {
        (self.last, self.residual, self.late_n) = (None, Vector6::zeros(), 0.0);
        (self.bristles_m, self.uncertainty_n) = (Vector6::zeros(), f64::INFINITY);
    }

    /// The estimate; none before two intervals, or before the calibration is complete.
    fn external(&self) -> Option<ExternalForce> {
        let [x, y, z, moment_x, moment_y, moment_z] = self.residual.into();
        let is_known = self.uncertainty_n.is_finite() && self.calibration.is_complete();
        is_known.then_some(ExternalForce {
            force_n: [x, y, z],
            moment_nm: [moment_x, moment_y, moment_z],
            uncertainty_n: self.uncertainty_n,
        })
    }

    /// The bite force, N, also from a calibration that is not complete; none before two intervals.
    fn rough_bite_n(&self) -> Option<f64> {
        (self.uncertainty_n != f64::INFINITY).then_some(-self.residual[2])
    }

    /// Takes the sample of a cycle: the pose, and the drives' mean forces (N) since the sample before. A gap between
    /// the cycles begins a new interval.
    fn take_sample(&mut self, cycle: u64, pose: &Pose, force_n: &[f64; AXES]) {
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
            self.bristles_m / friction.bristle_deflection_m()
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
        let breakaway = friction.breakaway_ratio() + config.breakaway_uncertainty;
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
                share * friction.viscous_n_s_per_m() * vertical.dot(&speeds_m_s),
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
        (-(speed_m_s / (2.0 * self.model.friction.breakaway_speed_m_s())).powi(2)).exp()
    }
}

/// Feed-forward of forces: the forces of the axes for the desired motion while the drives move to the targets of a
/// cycle.
///
/// A target acts from the next SYNC on and is reached one period later. The offset of this cycle is that of the middle
/// of this period. Velocity and acceleration are differences of three desired poses, one period apart. The offsets fade
/// in, because the drives' own loops carry the weight at the beginning of the motion.
#[derive(Debug, Clone)]
struct FeedForward {
    model: Model,
    period_s: f64,
    /// Share of the forces in the offsets.
    share: f64,
}

impl FeedForward {
    fn new(model: Model, period_s: f64) -> Self {
        Self { model, period_s, share: 0.0 }
    }

    /// The motion begins anew.
    fn begin(&mut self) {
        self.share = 0.0;
    }

    /// The forces for the middle of three desired poses, one period apart, N. A law's detour changes the velocity; its
    /// acceleration and its distance from the pose are ignored. Zeros in a singular pose.
    fn offset_n(&mut self, poses: [Pose; 3], detour: &Detour) -> [f64; AXES] {
        let (mut twist, acceleration) = derivatives(poses, self.period_s);
        twist.fixed_rows_mut::<3>(0).zip_apply(&detour.ahead_m_s, |mean, more| *mean += more);
        let motion = self.model.motion(&poses[1], &twist);
        let force_n = motion.and_then(|motion| self.model.force_n(&motion, &acceleration, &Twist::zeros()));
        self.share = (self.share + self.period_s / FADE_IN_S).min(1.0);
        force_n.map_or([0.0; AXES], |force_n| (force_n * self.share).into())
    }
}

#[cfg(test)]
mod tests;
