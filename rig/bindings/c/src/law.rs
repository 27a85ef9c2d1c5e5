//! A pose law that is a function of C.

use std::ffi::{c_int, c_void};

use masseter_controller::pose_law::{Demand, LawFailed, PoseLaw};
use masseter_model::geometry::Pose;
use masseter_runtime::messages::pose_fields;
use masseter_runtime::named::Declared;
use nalgebra::{Quaternion, Translation3, Unit};

/// A pose: position in the base frame, m, and unit quaternion.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct MasseterPose {
    position_m: [f64; 3],
    quaternion_wxyz: [f64; 4],
}

/// A [`Demand`].
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
}

// As masseter.h asserts.
const _: () = assert!(size_of::<MasseterPose>() == 56 && size_of::<MasseterDemand>() == 216);

/// The law: 0 if it has written a pose.
pub(crate) type LawFunction =
    unsafe extern "C" fn(*const MasseterDemand, *mut MasseterPose, *mut c_void) -> c_int;

#[derive(Debug)]
pub(crate) struct CLaw {
    function: LawFunction,
    user: *mut c_void,
    declared: Declared,
    parameters: Vec<f64>,
    signals: Vec<f64>,
}

impl CLaw {
    pub(crate) fn new(function: LawFunction, user: *mut c_void, declared: Declared) -> Self {
        let (parameters, signals) = (vec![0.0; declared.parameters.len()], vec![0.0; declared.signals.len()]);
        Self { function, user, declared, parameters, signals }
    }
}

impl PoseLaw for CLaw {
    fn command(&mut self, demand: &Demand) -> Result<Pose, LawFailed> {
        let mut asked = MasseterPose::from(&demand.ahead);
        let demand = MasseterDemand {
            cycle: demand.cycle,
            period_s: demand.period_s,
            motion_time_s: demand.motion_time_s,
            controller_state: demand.state.code(),
            has_estimate: demand.estimated.is_some().into(),
            desired: (&demand.desired).into(),
            estimated: demand.estimated.as_ref().map(MasseterPose::from).unwrap_or_default(),
            ahead: asked,
            parameters: self.parameters.as_ptr(),
            signals: self.signals.as_mut_ptr(),
        };
        // SAFETY: the caller of masseter_run passes a function and its argument that are valid until it returns.
        let failed = unsafe { (self.function)(&raw const demand, &raw mut asked, self.user) };
        if failed == 0 { Ok(asked.into()) } else { Err(LawFailed) }
    }

    fn declared(&self) -> Declared {
        self.declared.clone()
    }

    fn set_parameter(&mut self, place: usize, value: f64) {
        self.parameters[place] = value;
    }

    fn fill_signals(&self, signals: &mut [f64]) {
        signals.copy_from_slice(&self.signals);
    }
}

impl From<&Pose> for MasseterPose {
    fn from(pose: &Pose) -> Self {
        let (position_m, quaternion_wxyz) = pose_fields(pose);
        Self { position_m, quaternion_wxyz }
    }
}

impl From<MasseterPose> for Pose {
    /// As it is: the controller refuses what is no pose.
    fn from(MasseterPose { position_m, quaternion_wxyz: [w, x, y, z] }: MasseterPose) -> Self {
        Pose::from_parts(Translation3::from(position_m), Unit::new_unchecked(Quaternion::new(w, x, y, z)))
    }
}
