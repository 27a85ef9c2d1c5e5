//! The robot of a scenario for Python.

use masseter_controller::robot_model::{self, JacobianRows};
use masseter_model::geometry::{self, AXES};
use masseter_scenario::Scenario;
use pyo3::prelude::*;

use crate::{failed, law::Pose};

/// Six numbers: of the axes d1 d2 d3 l1 l2 l3, or of a twist or wrench.
type Six = [f64; AXES];

/// The robot of a scenario: times, motion, kinematics, inverse dynamics.
#[pyclass(module = "masseter")]
pub(crate) struct RobotModel(robot_model::RobotModel);

/// The motion at a time.
#[pyclass(frozen, get_all, module = "masseter", name = "Motion")]
pub(crate) struct MotionPoint {
    pose: Pose,
    twist: Six,
    acceleration: Six,
    motion_time_s: f64,
}

/// The times of a scenario, s.
#[pyclass(frozen, get_all, module = "masseter")]
#[expect(clippy::struct_field_names, reason = "the unit of each is in its name")]
pub(crate) struct Times {
    period_s: f64,
    lead_s: f64,
    ease_s: f64,
    duration_s: f64,
    stop_ramp_s: f64,
    hold_s: f64,
    silence_s: f64,
}

impl From<robot_model::MotionPoint> for MotionPoint {
    fn from(point: robot_model::MotionPoint) -> Self {
        let robot_model::MotionPoint { pose, twist, acceleration, motion_time_s } = point;
        Self { pose: (&pose).into(), twist: twist.into(), acceleration: acceleration.into(), motion_time_s }
    }
}

impl RobotModel {
    pub(crate) fn of(scenario: &Scenario) -> PyResult<Self> {
        robot_model::RobotModel::new(scenario).map(Self).map_err(failed)
    }
}

#[pymethods]
impl RobotModel {
    #[new]
    #[pyo3(signature = (scenario=None))]
    fn new(scenario: Option<std::path::PathBuf>) -> PyResult<Self> {
        Self::of(
            &scenario
                .map_or_else(|| Ok(Scenario::default()), |path| Scenario::read(&path))
                .map_err(failed)?,
        )
    }

    #[getter]
    fn times(&self) -> Times {
        let robot_model::Times { period_s, lead_s, ease_s, duration_s, stop_ramp_s, hold_s, silence_s } =
            *self.0.times();
        Times { period_s, lead_s, ease_s, duration_s, stop_ramp_s, hold_s, silence_s }
    }

    fn motion(&self, time_s: f64) -> PyResult<MotionPoint> {
        Ok(self.0.motion(time_s).map_err(failed)?.into())
    }

    fn easing(&self, from_: Pose, time_s: f64) -> PyResult<MotionPoint> {
        Ok(self.0.easing(&checked(from_)?, time_s).map_err(failed)?.into())
    }

    fn forward_kinematics(&mut self, position_m: Six) -> PyResult<Pose> {
        Ok((&self.0.forward(position_m).map_err(failed)?).into())
    }

    fn inverse_kinematics(&self, pose: Pose) -> PyResult<Six> {
        self.0.inverse(&checked(pose)?).map_err(failed)
    }

    fn jacobian(&self, pose: Pose) -> PyResult<JacobianRows> {
        self.0.jacobian(&checked(pose)?).map_err(failed)
    }

    #[pyo3(signature = (pose, twist, acceleration, wrench=[0.0; AXES]))]
    fn inverse_dynamics(&self, pose: Pose, twist: Six, acceleration: Six, wrench: Six) -> PyResult<Six> {
        let pose = checked(pose)?;
        self.0.inverse_dynamics(&pose, &twist.into(), &acceleration.into(), &wrench.into()).map_err(failed)
    }
}

fn checked(pose: Pose) -> PyResult<geometry::Pose> {
    let (position_m, quaternion_wxyz) = pose.fields();
    robot_model::RobotModel::pose(position_m, quaternion_wxyz).map_err(failed)
}
