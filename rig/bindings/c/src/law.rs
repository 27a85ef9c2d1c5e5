//! A pose law that is a function of C.

use std::ffi::{c_int, c_void};

use masseter_controller::pose_law::{FunctionLaw, LawFailed, PoseLaw, asked_pose};
use masseter_controller::robot_model::{RobotModel, RobotModelError};
use masseter_model::geometry::{AXES, Pose};
use masseter_runtime::{messages::pose_fields, named::Declared};

/// A pose: position in the base frame, m, and unit quaternion.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct MasseterPose {
    position_m: [f64; 3],
    quaternion_wxyz: [f64; 4],
}

/// A [`Demand`](masseter_controller::pose_law::Demand).
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MasseterDemand {
    cycle: u64,
    period_s: f64,
    motion_time_s: f64,
    controller_state: u32,
    has_estimate: u32,
    desired: MasseterPose,
    estimated: MasseterPose,
    ahead: MasseterPose,
    parameters: *const f64,
    signals: *mut f64,
    desired_twist: [f64; AXES],
    position_m: [f64; AXES],
    force_n: [f64; AXES],
    has_load_cell: u32,
    has_external: u32,
    load_cell_n: f64,
    external_wrench: [f64; AXES],
    external_uncertainty_n: f64,
}

// As masseter.h asserts.
const _: () = assert!(size_of::<MasseterPose>() == 56 && size_of::<MasseterDemand>() == 432);

/// The law: 0 if it has written a pose.
pub(crate) type LawFunction =
    unsafe extern "C" fn(*const MasseterDemand, *mut MasseterPose, *mut c_void) -> c_int;

/// The law that calls a function of C.
pub(crate) fn law_of_c(function: LawFunction, user: *mut c_void, declared: Declared) -> impl PoseLaw {
    FunctionLaw::new(declared, move |demand, parameters, signals| {
        let mut asked = MasseterPose::from(&demand.ahead);
        let measured = demand.measured.unwrap_or_default();
        let external = demand.external.unwrap_or_default();
        let ([fx, fy, fz], [mx, my, mz]) = (external.force_n, external.moment_nm);
        let demand = MasseterDemand {
            cycle: demand.cycle,
            period_s: demand.period_s,
            motion_time_s: demand.motion_time_s,
            controller_state: demand.state.code(),
            has_estimate: demand.estimated.is_some().into(),
            desired: (&demand.desired).into(),
            estimated: demand.estimated.as_ref().map(MasseterPose::from).unwrap_or_default(),
            ahead: asked,
            parameters: parameters.as_ptr(),
            signals: signals.as_mut_ptr(),
            desired_twist: demand.desired_twist.unwrap_or_default().into(),
            position_m: measured.position_m,
            force_n: measured.force_n,
            has_load_cell: demand.load_cell_n.is_some().into(),
            has_external: demand.external.is_some().into(),
            load_cell_n: demand.load_cell_n.unwrap_or_default(),
            external_wrench: [fx, fy, fz, mx, my, mz],
            external_uncertainty_n: external.uncertainty_n,
        };
        // SAFETY: the caller of masseter_run passes a function and its argument that are valid until it returns.
        let failed = unsafe { function(&raw const demand, &raw mut asked, user) };
        if failed == 0 { Ok(asked_pose(asked.position_m, asked.quaternion_wxyz)) } else { Err(LawFailed) }
    })
}

impl From<&Pose> for MasseterPose {
    fn from(pose: &Pose) -> Self {
        let (position_m, quaternion_wxyz) = pose_fields(pose);
        Self { position_m, quaternion_wxyz }
    }
}

impl TryFrom<&MasseterPose> for Pose {
    type Error = RobotModelError;

    fn try_from(pose: &MasseterPose) -> Result<Self, RobotModelError> {
        RobotModel::pose(pose.position_m, pose.quaternion_wxyz)
    }
}
