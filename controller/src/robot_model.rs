//! The robot of a scenario as mathematics, for a controller of the drives in any language: kinematics, inverse dynamics
//! and the motion. Poses are those of the platform in the base frame. A twist is the velocity of the platform's origin
//! (m/s), then the angular velocity (rad/s), in base axes. Axes are in the order d₁ d₂ d₃ l₁ l₂ l₃.

use masseter_model::geometry::{
    AXES, Actuators, GeometryError, InverseError, Jacobian, Mechanism, Pose, Twist,
};
use masseter_scenario::{ControllerConfig, Scenario};
use nalgebra::Vector6;

use crate::forces::{Model, derivatives};
use crate::kinematics::{ForwardError, ForwardTracker};
use crate::trajectory::{Trajectory, TrajectoryError, interpolate, minimum_jerk};

/// Largest error of the length of a unit quaternion that a caller gives.
const MOST_NORM_ERROR: f64 = 1e-6;

/// The motion time of an instant before the motion.
const BEFORE_MOTION_S: f64 = -1.0;

/// Rows d₁ d₂ d₃ l₁ l₂ l₃, columns of a twist: m/s per m/s, then m/s per rad/s.
pub type JacobianRows = [[f64; AXES]; AXES];

/// Mechanism and motion of a scenario. The dynamics are those that the scenario's controller assumes.
///
/// ```
/// use masseter_controller::robot_model::RobotModel;
/// use masseter_scenario::Scenario;
///
/// let mut robot = RobotModel::new(&Scenario::default())?;
/// let first = robot.motion(0.0)?;
/// let position_m = robot.inverse(&first.pose)?;
/// assert!((robot.forward(position_m)?.translation.z - first.pose.translation.z).abs() < 1e-12);
/// # Ok::<(), masseter_controller::robot_model::RobotModelError>(())
/// ```
#[derive(Debug, Clone)]
pub struct RobotModel {
    model: Model,
    tracker: ForwardTracker,
    trajectory: Trajectory,
    times: Times,
}

/// The times of a scenario that a controller of the drives keeps to, s. Its layout is that of C.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Times {
    /// From one cycle to the next.
    pub period_s: f64,
    /// From a sample until the drives reach the targets that answer it.
    pub lead_s: f64,
    /// Of the way to the first pose.
    pub ease_s: f64,
    /// Of the motion.
    pub duration_s: f64,
    /// From full speed to rest, at a stop.
    pub stop_ramp_s: f64,
    /// At rest after the motion.
    pub hold_s: f64,
    /// Longest time without a complete reading.
    pub silence_s: f64,
}

/// The motion, or the way to it, at a time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MotionPoint {
    /// The desired pose.
    pub pose: Pose,
    /// Its twist: the mean of a period before and a period after.
    pub twist: Twist,
    /// The change of the twist between these periods, m/s² and rad/s².
    pub acceleration: Twist,
    /// How far the motion has come, s: the value of `state.motion_time_s`. It passes slowly at the start and the end,
    /// and is negative on the way to the motion.
    pub motion_time_s: f64,
}

/// A question without an answer.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum RobotModelError {
    /// The mechanism's dimensions.
    #[error(transparent)]
    Geometry(#[from] GeometryError),
    /// The motion of the scenario.
    #[error(transparent)]
    Trajectory(#[from] TrajectoryError),
    /// Positions without a pose.
    #[error(transparent)]
    Forward(#[from] ForwardError),
    /// A pose without positions.
    #[error(transparent)]
    Inverse(#[from] InverseError),
    /// No rotation.
    #[error("the quaternion has the length {0}, not 1")]
    NoRotation(f64),
    /// A time of the motion that is no number.
    #[error("the time {0} s is no finite number")]
    NoTime(f64),
    /// No forces for an acceleration.
    #[error("no forces give this motion: the pose is singular, or a value is no finite number")]
    NoForces,
}

impl RobotModel {
    /// The robot of a scenario.
    ///
    /// # Errors
    /// [`RobotModelError::Geometry`] and [`RobotModelError::Trajectory`].
    pub fn new(scenario: &Scenario) -> Result<Self, RobotModelError> {
        let mechanism = Mechanism::new(&scenario.mechanism)?;
        let trajectory = Trajectory::of_scenario(scenario, &mechanism)?;
        let ControllerConfig { lead_cycles, ease_s, stop_ramp_s, hold_s, stale_cycles, .. } =
            scenario.controller;
        let (period_s, duration_s) = (scenario.period_s(), trajectory.duration_s());
        let (lead_s, silence_s) = (lead_cycles * period_s, f64::from(stale_cycles) * period_s);
        Ok(Self {
            tracker: ForwardTracker::new(mechanism.clone()),
            model: Model::new(scenario, mechanism),
            trajectory,
            times: Times { period_s, lead_s, ease_s, duration_s, stop_ramp_s, hold_s, silence_s },
        })
    }

    /// The times of the scenario.
    pub fn times(&self) -> &Times {
        &self.times
    }

    /// A pose of numbers from another language.
    ///
    /// # Errors
    /// [`RobotModelError::NoRotation`] for a quaternion whose length is not 1.
    pub fn pose(position_m: [f64; 3], quaternion_wxyz: [f64; 4]) -> Result<Pose, RobotModelError> {
        let pose = crate::pose_law::asked_pose(position_m, quaternion_wxyz);
        let norm = pose.rotation.quaternion().norm();
        let is_rotation = (norm - 1.0).abs() < MOST_NORM_ERROR;
        if is_rotation { Ok(pose) } else { Err(RobotModelError::NoRotation(norm)) }
    }

    /// The pose of measured positions, m. The last pose saves time, and settles an ambiguous input.
    ///
    /// # Errors
    /// [`RobotModelError::Forward`].
    #[doc(alias("forward kinematics", "FK"))]
    pub fn forward(&mut self, position_m: [f64; AXES]) -> Result<Pose, RobotModelError> {
        Ok(self.tracker.update(&Actuators::from_axes(position_m))?.pose)
    }

    /// The positions at a pose, m, also beyond the strokes.
    ///
    /// # Errors
    /// [`RobotModelError::Inverse`].
    #[doc(alias("inverse kinematics", "IK"))]
    pub fn inverse(&self, pose: &Pose) -> Result<[f64; AXES], RobotModelError> {
        Ok(self.model.mechanism.inverse(pose)?.actuators.to_axes())
    }

    /// The rates of the axes by the twist, at a pose.
    ///
    /// # Errors
    /// [`RobotModelError::Inverse`].
    pub fn jacobian(&self, pose: &Pose) -> Result<JacobianRows, RobotModelError> {
        let legs = self.model.mechanism.legs(pose)?;
        Ok(Jacobian::of_legs(&self.model.mechanism, &legs).actuators.transpose().into())
    }

    /// The forces of the axes (N) that give the platform an acceleration (m/s², rad/s²) in a motion. The wrench acts on
    /// the platform (N, then N m about its origin, base axes). Friction of the assumed model is included.
    ///
    /// # Errors
    /// [`RobotModelError::Inverse`], and [`RobotModelError::NoForces`] in a singular pose.
    pub fn inverse_dynamics(
        &self,
        pose: &Pose,
        twist: &Twist,
        acceleration: &Twist,
        wrench: &Vector6<f64>,
    ) -> Result<[f64; AXES], RobotModelError> {
        let motion = masseter_model::dynamics::Motion::new(&self.model.mechanism, pose, twist)?;
        let force_n = self.model.force_n(&motion, acceleration, wrench);
        let is_finite = |force_n: &Vector6<f64>| force_n.iter().all(|force_n| force_n.is_finite());
        Ok(force_n.filter(is_finite).ok_or(RobotModelError::NoForces)?.into())
    }

    /// The motion a time after its beginning; at rest before 0 and after its duration.
    ///
    /// # Errors
    /// [`RobotModelError::NoTime`].
    pub fn motion(&self, time_s: f64) -> Result<MotionPoint, RobotModelError> {
        self.point(time_s, self.trajectory.motion_time_s(time_s), |time_s| self.trajectory.pose(time_s))
    }

    /// The way from a pose to the first pose of the motion, a time after its beginning: with the least jerk, from rest to
    /// rest in the time `ease_s`.
    ///
    /// # Errors
    /// [`RobotModelError::NoTime`].
    pub fn easing(&self, from: &Pose, time_s: f64) -> Result<MotionPoint, RobotModelError> {
        let share = |time_s: f64| minimum_jerk(time_s / self.times.ease_s);
        let first = self.trajectory.pose(0.0);
        self.point(time_s, BEFORE_MOTION_S, |time_s| interpolate(from, &first, share(time_s)))
    }

    fn point(
        &self,
        time_s: f64,
        motion_time_s: f64,
        pose_at: impl Fn(f64) -> Pose,
    ) -> Result<MotionPoint, RobotModelError> {
        if !time_s.is_finite() {
            return Err(RobotModelError::NoTime(time_s));
        }
        let period_s = self.times.period_s;
        let poses = [-period_s, 0.0, period_s].map(|later_s| pose_at(time_s + later_s));
        let (twist, acceleration) = derivatives(poses, period_s);
        Ok(MotionPoint { pose: poses[1], twist, acceleration, motion_time_s })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn robot() -> RobotModel {
        RobotModel::new(&Scenario::default()).unwrap()
    }

    #[test]
    fn every_answer_agrees_with_the_others_along_the_motion() {
        let mut robot = robot();
        let step_s = 1e-4;
        for step in 0..20 {
            let time_s = 0.05 + robot.times().duration_s * f64::from(step) / 20.0;
            let point = robot.motion(time_s).unwrap();
            let position_m = robot.inverse(&point.pose).unwrap();
            let found = robot.forward(position_m).unwrap();
            assert!((found.translation.vector - point.pose.translation.vector).norm() < 1e-10);
            assert!(found.rotation.angle_to(&point.pose.rotation) < 1e-8);
            let jacobian = robot.jacobian(&point.pose).unwrap();
            let later = robot.motion(time_s + step_s).unwrap();
            let later_m = robot.inverse(&later.pose).unwrap();
            for axis in 0..AXES {
                let rate_m_s: f64 =
                    (0..AXES).map(|column| jacobian[axis][column] * point.twist[column]).sum();
                let moved_m_s = (later_m[axis] - position_m[axis]) / step_s;
                assert!((rate_m_s - moved_m_s).abs() < 1e-3, "axis {axis} at {time_s} s");
            }
            let gained = (later.twist - point.twist) / step_s;
            assert!((gained - point.acceleration).norm() < 0.05 * (1.0 + point.acceleration.norm()));
        }
    }

    #[test]
    fn a_wrench_on_the_platform_costs_the_forces_that_the_jacobian_says() {
        let robot = robot();
        let pose = robot.motion(0.0).unwrap().pose;
        let (still, food) = (Twist::zeros(), Vector6::new(0.0, 0.0, -30.0, 0.0, 0.0, 0.0));
        let [free_n, loaded_n] =
            [still, food].map(|wrench| robot.inverse_dynamics(&pose, &still, &still, &wrench).unwrap());
        let jacobian = robot.jacobian(&pose).unwrap();
        for column in 0..AXES {
            let more: f64 =
                (0..AXES).map(|axis| jacobian[axis][column] * (loaded_n[axis] - free_n[axis])).sum();
            assert!((more + food[column]).abs() < 1e-9, "column {column}: {more}");
        }
    }

    #[test]
    fn the_way_to_the_motion_leads_from_rest_to_rest() {
        let robot = robot();
        let (from, first) = (Pose::translation(0.001, 0.0, 0.28), robot.motion(0.0).unwrap().pose);
        let ease_s = robot.times().ease_s;
        for (time_s, pose) in [(-1.0, from), (0.0, from), (ease_s, first), (ease_s + 1.0, first)] {
            let point = robot.easing(&from, time_s).unwrap();
            assert!((point.pose.translation.vector - pose.translation.vector).norm() < 1e-12, "{time_s}");
            assert!(point.pose.rotation.angle_to(&pose.rotation) < 1e-7, "{time_s}");
            assert!(point.twist.norm() < 1e-6 && point.motion_time_s < 0.0, "{point:?}");
        }
        let middle = robot.easing(&from, ease_s / 2.0).unwrap();
        assert!(middle.twist.norm() > 1e-3 && middle.acceleration.norm() < 1e-6, "{middle:?}");
    }

    #[test]
    fn what_is_no_number_is_refused_by_its_name() {
        let mut robot = robot();
        let pose = robot.motion(0.0).unwrap().pose;
        let (still, endless) = (Twist::zeros(), Twist::repeat(f64::INFINITY));
        assert!(matches!(robot.motion(f64::NAN), Err(RobotModelError::NoTime(_))));
        assert!(matches!(
            RobotModel::pose([0.0; 3], [0.5, 0.0, 0.0, 0.0]),
            Err(RobotModelError::NoRotation(_))
        ));
        assert!(matches!(RobotModel::pose([0.0; 3], [f64::NAN; 4]), Err(RobotModelError::NoRotation(_))));
        let nowhere = Pose::translation(f64::NAN, 0.0, 0.0);
        assert_eq!(robot.inverse(&nowhere), Err(RobotModelError::Inverse(InverseError::NotFinite)));
        assert_eq!(robot.jacobian(&nowhere), Err(RobotModelError::Inverse(InverseError::NotFinite)));
        assert_eq!(robot.forward([f64::NAN; AXES]), Err(RobotModelError::Forward(ForwardError::NotFinite)));
        let forces = robot.inverse_dynamics(&pose, &still, &endless, &still);
        assert_eq!(forces, Err(RobotModelError::NoForces));
    }
}
