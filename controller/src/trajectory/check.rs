//! Whether the mechanism can follow a trajectory, before anything moves.
//!
//! The whole trajectory is sampled at the controller's cycle: inverse kinematics, the conditions of
//! the true solution, strokes, velocities and accelerations by differences, and conditioning. It does
//! not look at forces, nor at how the rig gets to the first pose, nor at the trim: a target that the trim
//! carries beyond a stroke is held at its end.

use masseter_shared::config::TrajectoryLimitsConfig;
use masseter_shared::geometry::{AXES, AXIS_NAMES, InverseError, LimitViolation, Mechanism, StrokeLimits};

use crate::kinematics::{Assembly, Condition};

use super::{SourceLine, Trajectory};

/// What a trajectory asks of the axes, in the order d₁ d₂ d₃ l₁ l₂ l₃.
#[derive(Debug, Clone, PartialEq)]
pub struct TrajectoryReport {
    /// Samples taken.
    pub samples: usize,
    /// Lowest position, metres.
    pub lowest_m: [f64; AXES],
    /// Highest position, metres.
    pub highest_m: [f64; AXES],
    /// Largest speed, m/s.
    pub velocity_m_s: [f64; AXES],
    /// Largest acceleration, m/s².
    pub acceleration_m_s2: [f64; AXES],
    /// Largest condition number of the 6×6 Jacobian, angular velocities scaled by the platform's side A₁A₂.
    pub condition: f64,
}

impl TrajectoryReport {
    /// What is left of each stroke at its nearer end, metres.
    pub fn margin_m(&self, strokes: &StrokeLimits) -> [f64; AXES] {
        std::array::from_fn(|axis| {
            let [lowest_m, highest_m] = strokes.of_axis(axis);
            (self.lowest_m[axis] - lowest_m).min(highest_m - self.highest_m[axis])
        })
    }
}

/// A trajectory the mechanism cannot follow: when, where in the file, and why.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("the trajectory at {time_s:.3} s{}: {problem}", source_line.as_ref().map_or_else(String::new, |at| format!(" ({at})")))]
pub struct CheckError {
    /// Time of the trajectory, s.
    pub time_s: f64,
    /// The nearest line of the recording, if it is one.
    pub source_line: Option<SourceLine>,
    /// What is wrong there.
    pub problem: CheckProblem,
}

/// What the mechanism cannot do.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum CheckProblem {
    /// No joint coordinates hold the pose.
    #[error("{0}")]
    Inverse(InverseError),
    /// An axis leaves its stroke.
    #[error(
        "{0}; make the motion smaller, turn the axes of its file, or move the closed pose (jaw.closed_offset_m, jaw.closed_leg_m)"
    )]
    Stroke(LimitViolation),
    /// The mechanism would have to be folded over.
    #[error("{0}; make the motion smaller")]
    Assembly(Condition),
    /// An axis moves or accelerates too fast, or the pose is close to singular: the value, its limit and the remedy.
    #[error("{0}")]
    Limit(String),
}

/// Samples the whole trajectory every `period_s` (above 0) and judges it.
///
/// # Errors
/// The first sample that the mechanism or the limits do not allow.
pub fn check(
    trajectory: &Trajectory,
    mechanism: &Mechanism,
    limits: &TrajectoryLimitsConfig,
    period_s: f64,
) -> Result<TrajectoryReport, CheckError> {
    let samples = (trajectory.duration_s() / period_s).ceil() as usize + 1;
    let mut survey = Survey::new(mechanism, limits, period_s);
    for sample in 0..samples {
        let time_s = sample as f64 * period_s;
        survey.visit(trajectory, time_s).map_err(|problem| CheckError {
            time_s,
            source_line: trajectory.source_line(time_s),
            problem,
        })?;
    }
    Ok(survey.report)
}

/// The check under way: the last two samples, and the report so far.
struct Survey<'a> {
    mechanism: &'a Mechanism,
    limits: &'a TrajectoryLimitsConfig,
    period_s: f64,
    last_m: Option<[f64; AXES]>,
    last_velocity_m_s: Option<[f64; AXES]>,
    report: TrajectoryReport,
}

impl<'a> Survey<'a> {
    fn new(mechanism: &'a Mechanism, limits: &'a TrajectoryLimitsConfig, period_s: f64) -> Self {
        let report = TrajectoryReport {
            samples: 0,
            lowest_m: [f64::INFINITY; AXES],
            highest_m: [f64::NEG_INFINITY; AXES],
            velocity_m_s: [0.0; AXES],
            acceleration_m_s2: [0.0; AXES],
            condition: 0.0,
        };
        Self { mechanism, limits, period_s, last_m: None, last_velocity_m_s: None, report }
    }

    fn visit(&mut self, trajectory: &Trajectory, time_s: f64) -> Result<(), CheckProblem> {
        let axes_m = self.visit_pose(trajectory, time_s)?;
        self.report.samples += 1;
        let Some(last_m) = self.last_m.replace(axes_m) else { return Ok(()) };
        let velocity_m_s = std::array::from_fn(|axis| (axes_m[axis] - last_m[axis]) / self.period_s);
        let limit = |axis| self.limits.velocity_m_s(axis);
        if let Some((axis, value, limit)) = excess(&velocity_m_s, &mut self.report.velocity_m_s, limit) {
            return Err(CheckProblem::Limit(format!(
                "axis {axis} would move at {value:.3} m/s, limit {limit} m/s; slow the motion or lower the low-pass"
            )));
        }
        let Some(last) = self.last_velocity_m_s.replace(velocity_m_s) else { return Ok(()) };
        let change = std::array::from_fn(|axis| (velocity_m_s[axis] - last[axis]) / self.period_s);
        let limit = |axis| self.limits.acceleration_m_s2(axis);
        match excess(&change, &mut self.report.acceleration_m_s2, limit) {
            None => Ok(()),
            Some((axis, value, limit)) => Err(CheckProblem::Limit(format!(
                "axis {axis} would accelerate at {value:.2} m/s², limit {limit} m/s²; slow the motion or lower the \
                 low-pass"
            ))),
        }
    }

    fn visit_pose(&mut self, trajectory: &Trajectory, time_s: f64) -> Result<[f64; AXES], CheckProblem> {
        let pose = trajectory.pose(time_s);
        let joints = self.mechanism.inverse(&pose).map_err(CheckProblem::Inverse)?;
        let axes_m = joints.actuators.to_axes();
        for (axis, value_m) in axes_m.into_iter().enumerate() {
            self.report.lowest_m[axis] = self.report.lowest_m[axis].min(value_m);
            self.report.highest_m[axis] = self.report.highest_m[axis].max(value_m);
        }
        self.mechanism.strokes().check(&joints.actuators).map_err(CheckProblem::Stroke)?;
        if let Some(violated) = Assembly::new(self.mechanism, &joints.actuators, &joints.theta_rad).violated()
        {
            return Err(CheckProblem::Assembly(violated));
        }
        let condition = self.mechanism.condition(&pose, &joints);
        self.report.condition = self.report.condition.max(condition);
        let limit = self.limits.max_condition;
        if condition > limit {
            let remedy = "too close to a singularity; make the motion smaller";
            return Err(CheckProblem::Limit(format!(
                "condition number {condition:.1}, limit {limit}: {remedy}"
            )));
        }
        Ok(axes_m)
    }
}

/// Keeps the largest magnitude of each axis; returns the first axis beyond its limit, with value and limit.
fn excess(
    values: &[f64; AXES],
    largest: &mut [f64; AXES],
    limit: impl Fn(usize) -> f64,
) -> Option<(&'static str, f64, f64)> {
    for (axis, value) in values.iter().map(|value| value.abs()).enumerate() {
        largest[axis] = largest[axis].max(value);
        if value > limit(axis) {
            return Some((AXIS_NAMES[axis], value, limit(axis)));
        }
    }
    None
}
