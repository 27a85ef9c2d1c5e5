//! The scenario of a session and its robot: times, motion, kinematics, inverse dynamics. Lengths of arrays are those of
//! masseter.h.

use std::ffi::{CString, c_char, c_int};

use masseter_controller::robot_model::{JacobianRows, MotionPoint, RobotModel, RobotModelError, Times};
use masseter_model::geometry::{AXES, Pose};

use crate::{Failure, MasseterSession, NULL, OK, guarded, law::MasseterPose};

/// A [`MotionPoint`].
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct MasseterMotion {
    pose: MasseterPose,
    twist: [f64; AXES],
    acceleration: [f64; AXES],
    motion_time_s: f64,
}

impl From<MotionPoint> for MasseterMotion {
    fn from(MotionPoint { pose, twist, acceleration, motion_time_s }: MotionPoint) -> Self {
        Self { pose: (&pose).into(), twist: twist.into(), acceleration: acceleration.into(), motion_time_s }
    }
}

// As masseter.h asserts.
const _: () = assert!(size_of::<Times>() == 56 && size_of::<MasseterMotion>() == 160);

/// Writes what `ask` finds, if it finds anything.
fn answered<T>(
    session: Option<&mut MasseterSession>,
    answer: Option<&mut T>,
    ask: impl FnOnce(&mut RobotModel) -> Result<T, RobotModelError>,
) -> Result<c_int, Failure> {
    let answer = answer.ok_or(NULL)?;
    *answer = ask(session.ok_or(NULL)?.robot()?)?;
    Ok(OK)
}

/// The scenario as TOML; null after an error.
#[unsafe(no_mangle)]
pub(crate) extern "C" fn masseter_scenario(session: Option<&mut MasseterSession>) -> *const c_char {
    let mut found = std::ptr::null();
    guarded(|| {
        let session = session.ok_or(NULL)?;
        let text = match session.text.take() {
            Some(text) => text,
            None => CString::new(session.scenario()?.to_toml())?,
        };
        found = session.text.insert(text).as_ptr();
        Ok(OK)
    });
    found
}

/// The times of the scenario.
#[unsafe(no_mangle)]
pub(crate) extern "C" fn masseter_times_of(
    session: Option<&mut MasseterSession>,
    times: Option<&mut Times>,
) -> c_int {
    guarded(|| answered(session, times, |robot| Ok(*robot.times())))
}

/// The motion at a time.
#[unsafe(no_mangle)]
pub(crate) extern "C" fn masseter_motion_at(
    session: Option<&mut MasseterSession>,
    time_s: f64,
    motion: Option<&mut MasseterMotion>,
) -> c_int {
    guarded(|| answered(session, motion, |robot| Ok(robot.motion(time_s)?.into())))
}

/// The way to the first pose at a time.
#[unsafe(no_mangle)]
pub(crate) extern "C" fn masseter_easing_at(
    session: Option<&mut MasseterSession>,
    from: Option<&MasseterPose>,
    time_s: f64,
    motion: Option<&mut MasseterMotion>,
) -> c_int {
    guarded(|| {
        let from = Pose::try_from(from.ok_or(NULL)?)?;
        answered(session, motion, |robot| Ok(robot.easing(&from, time_s)?.into()))
    })
}

/// The pose of six positions.
#[unsafe(no_mangle)]
pub(crate) extern "C" fn masseter_forward_kinematics(
    session: Option<&mut MasseterSession>,
    position_m: Option<&[f64; AXES]>,
    pose: Option<&mut MasseterPose>,
) -> c_int {
    guarded(|| {
        let position_m = *position_m.ok_or(NULL)?;
        answered(session, pose, |robot| Ok((&robot.forward(position_m)?).into()))
    })
}

/// The positions of a pose.
#[unsafe(no_mangle)]
pub(crate) extern "C" fn masseter_inverse_kinematics(
    session: Option<&mut MasseterSession>,
    pose: Option<&MasseterPose>,
    position_m: Option<&mut [f64; AXES]>,
) -> c_int {
    guarded(|| {
        let pose = Pose::try_from(pose.ok_or(NULL)?)?;
        answered(session, position_m, |robot| robot.inverse(&pose))
    })
}

/// The rates of the axes by the twist.
#[unsafe(no_mangle)]
pub(crate) extern "C" fn masseter_jacobian(
    session: Option<&mut MasseterSession>,
    pose: Option<&MasseterPose>,
    jacobian: Option<&mut JacobianRows>,
) -> c_int {
    guarded(|| {
        let pose = Pose::try_from(pose.ok_or(NULL)?)?;
        answered(session, jacobian, |robot| robot.jacobian(&pose))
    })
}

/// The forces of the axes for an acceleration.
#[unsafe(no_mangle)]
pub(crate) extern "C" fn masseter_inverse_dynamics(
    session: Option<&mut MasseterSession>,
    pose: Option<&MasseterPose>,
    twist: Option<&[f64; AXES]>,
    acceleration: Option<&[f64; AXES]>,
    wrench: Option<&[f64; AXES]>,
    force_n: Option<&mut [f64; AXES]>,
) -> c_int {
    guarded(|| {
        let pose = Pose::try_from(pose.ok_or(NULL)?)?;
        let (twist, acceleration) = (*twist.ok_or(NULL)?, *acceleration.ok_or(NULL)?);
        let wrench = wrench.copied().unwrap_or_default();
        answered(session, force_n, |robot| {
            robot.inverse_dynamics(&pose, &twist.into(), &acceleration.into(), &wrench.into())
        })
    })
}
