//! The check that the mechanism can follow a trajectory, before any motion.
//!
//! The check samples the whole trajectory at the controller's cycle. It covers inverse kinematics, the conditions of
//! the true solution, strokes, velocities and accelerations by differences, and conditioning. Forces, the way to the
//! first pose, and the trim are not part of the check. A target that the trim carries beyond a stroke is held at the
//! stroke's end.

use masseter_model::geometry::{
    AXES, AXIS_NAMES, Conditioning, Jacobian, LEGS, Mechanism, Pose, StrokeLimits,
};
use masseter_recorded_motion::TrajectoryError;
use masseter_scenario::TrajectoryLimitsConfig;

use super::motion::Trajectory;

/// The demands of a trajectory on the axes, in the order d₁ d₂ d₃ l₁ l₂ l₃.
#[derive(Debug, Clone, PartialEq)]
pub struct TrajectoryReport {
    /// Lowest position, metres.
    pub lowest_m: [f64; AXES],
    /// Highest position, metres.
    pub highest_m: [f64; AXES],
    /// Largest speed, m/s.
    pub velocity_m_s: [f64; AXES],
    /// Largest acceleration, m/s².
    pub acceleration_m_s2: [f64; AXES],
}

impl TrajectoryReport {
    /// Margin of each stroke at its nearer end, metres.
    pub fn margin_m(&self, strokes: &StrokeLimits) -> [f64; AXES] {
        std::array::from_fn(|axis| {
            let [lowest_m, highest_m] = strokes.of_axis(axis);
            (self.lowest_m[axis] - lowest_m).min(highest_m - self.highest_m[axis])
        })
    }
}

/// Samples the whole trajectory every `period_s` (above 0) and judges it.
///
/// ```
/// use masseter_controller::trajectory::{Trajectory, check};
/// use masseter_scenario::Scenario;
/// use masseter_model::geometry::Mechanism;
///
/// let scenario = Scenario::default();
/// let mechanism = Mechanism::new(&scenario.mechanism)?;
/// let motion = Trajectory::new(&scenario.motion, &scenario.jaw, &mechanism, scenario.duration_s)?;
/// let report = check(&motion, &mechanism, &scenario.limits, scenario.period_s())?;
/// assert!(report.margin_m(mechanism.strokes()).iter().all(|&margin_m| margin_m > 0.0));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// The first sample that the mechanism or the limits do not allow, with time, place in the file, and reason.
pub fn check(
    trajectory: &Trajectory,
    mechanism: &Mechanism,
    limits: &TrajectoryLimitsConfig,
    period_s: f64,
) -> Result<TrajectoryReport, TrajectoryError> {
    let samples = (trajectory.duration_s() / period_s).ceil() as usize + 1;
    let report = TrajectoryReport {
        lowest_m: [f64::INFINITY; AXES],
        highest_m: [f64::NEG_INFINITY; AXES],
        velocity_m_s: [0.0; AXES],
        acceleration_m_s2: [0.0; AXES],
    };
    let [last_m, last_m_s] = [None; 2];
    let mut survey = Survey { mechanism, limits, period_s, last_m, last_m_s, conditioning: None, report };
    for sample in 0..samples {
        let time_s = sample as f64 * period_s;
        survey.visit(&trajectory.pose(time_s)).map_err(|problem| {
            let line = trajectory.source_line(time_s).map_or_else(String::new, |line| format!(" ({line})"));
            TrajectoryError(format!("motion at {time_s:.3} s{line}: {problem}"))
        })?;
    }
    Ok(survey.report)
}

/// The running check: the last two samples, and the report so far.
struct Survey<'a> {
    mechanism: &'a Mechanism,
    limits: &'a TrajectoryLimitsConfig,
    period_s: f64,
    last_m: Option<[f64; AXES]>,
    last_m_s: Option<[f64; AXES]>,
    /// Conditioning of the last pose with its own computation.
    conditioning: Option<Conditioning>,
    report: TrajectoryReport,
}

impl Survey<'_> {
    fn visit(&mut self, pose: &Pose) -> Result<(), String> {
        let axes_m = self.visit_pose(pose)?;
        let Some(last_m) = self.last_m.replace(axes_m) else { return Ok(()) };
        let velocity_m_s = self.rates(&last_m, &axes_m);
        let limit = |axis| self.limits.velocity_m_s(axis);
        keep_largest(&velocity_m_s, &mut self.report.velocity_m_s, limit, ["move", "m/s", "velocity_m_s"])?;
        let Some(last_m_s) = self.last_m_s.replace(velocity_m_s) else { return Ok(()) };
        let acceleration_m_s2 = self.rates(&last_m_s, &velocity_m_s);
        let limit = |axis| self.limits.acceleration_m_s2(axis);
        let words = ["accelerate", "m/s²", "acceleration_m_s2"];
        keep_largest(&acceleration_m_s2, &mut self.report.acceleration_m_s2, limit, words)
    }

    fn visit_pose(&mut self, pose: &Pose) -> Result<[f64; AXES], String> {
        let legs = self.mechanism.legs(pose).map_err(|error| error.to_string())?;
        let axes_m = legs.actuators.to_axes();
        for (axis, value_m) in axes_m.into_iter().enumerate() {
            self.report.lowest_m[axis] = self.report.lowest_m[axis].min(value_m);
            self.report.highest_m[axis] = self.report.highest_m[axis].max(value_m);
        }
        self.mechanism.strokes().check(&legs.actuators).map_err(|violation| {
            format!(
                "{violation}; make the motion smaller, turn the axes of its file, or move the closed pose \
                 (jaw.closed_offset_m, jaw.closed_leg_m)"
            )
        })?;
        if let Some(violated) = crate::kinematics::Assembly::at_pose(self.mechanism, pose, &legs).violated() {
            return Err(format!("{violated}; make the motion smaller"));
        }
        self.check_condition(&Jacobian::of_legs(self.mechanism, &legs))?;
        Ok(axes_m)
    }

    fn check_condition(&mut self, jacobian: &Jacobian) -> Result<(), String> {
        let limit = self.limits.max_condition;
        if self.conditioning.is_some_and(|nearby| nearby.most(jacobian) <= limit) {
            return Ok(());
        }
        let condition = self.conditioning.insert(Conditioning::new(jacobian)).number();
        if condition <= limit {
            return Ok(());
        }
        let remedy = "too close to a singularity; make the motion smaller";
        Err(format!("condition number {condition:.1}, limit {limit:?} (limits.max_condition): {remedy}"))
    }

    fn rates(&self, before: &[f64; AXES], after: &[f64; AXES]) -> [f64; AXES] {
        std::array::from_fn(|axis| (after[axis] - before[axis]) / self.period_s)
    }
}

/// Keeps the largest magnitude of each axis; refuses the first axis beyond its limit.
fn keep_largest(
    values: &[f64; AXES],
    largest: &mut [f64; AXES],
    limit: impl Fn(usize) -> f64,
    [does, unit, quantity]: [&str; 3],
) -> Result<(), String> {
    for (axis, value) in values.iter().map(|value| value.abs()).enumerate() {
        largest[axis] = largest[axis].max(value);
        if value > limit(axis) {
            let (name, limit) = (AXIS_NAMES[axis], limit(axis));
            let drive = if axis < LEGS { "slide" } else { "leg" };
            return Err(format!(
                "axis {name} would {does} at {value:.3} {unit}, limit {limit:?} {unit} (the lower of \
                 limits.{drive}_{quantity} and drives.{drive}.max_{quantity}); slow the motion or lower the low-pass"
            ));
        }
    }
    Ok(())
}
