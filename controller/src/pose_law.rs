//! The seam for a user's pose control: one call a cycle, from a demand to the requested pose.
//!
//! The sequence (enable, ease, run, hold, disable), kinematics, playback and every safety check stay with
//! [`MotionController`](crate::motion_controller::MotionController) for every law.

use std::{fmt, ops::Range};

use masseter_model::geometry::{AXES, Pose, Twist, Vec3};
use masseter_runtime::{
    control::NoBranch,
    messages::codes::{Cause, ControllerState},
    named::Declared,
};
use nalgebra::{Quaternion, Translation3, Unit};

/// What a pose law needs of a cycle. Poses are those of the platform in the base frame, m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Demand {
    /// Number of the cycle, from 1; skipped cycles leave a gap.
    pub cycle: u64,
    /// Time from one cycle to the next, s.
    pub period_s: f64,
    /// `Easing`, `Running` or `Holding`: other states do not call the law.
    pub state: ControllerState,
    /// How far the motion has come at the sample, s; negative before the motion begins.
    pub motion_time_s: f64,
    /// The desired pose at the sample.
    pub desired: Pose,
    /// The pose at the sample, by forward kinematics; none in a cycle without a fresh, complete reading.
    pub estimated: Option<Pose>,
    /// The desired pose at the instant at which the drives reach this cycle's command.
    pub ahead: Pose,
    /// The desired twist at the sample; none for a law that does not ask for it by [`PoseLaw::needs_twist`].
    pub desired_twist: Option<Twist>,
    /// What the drives measured at the sample; none without an estimate.
    pub measured: Option<Measured>,
    /// The external force at the sample; none unless the scenario has it estimated.
    pub external: Option<ExternalForce>,
    /// The bite force that the load cell showed last, N; none without a load cell.
    pub load_cell_n: Option<f64>,
}

/// What the drives measured, in the order d₁ d₂ d₃ l₁ l₂ l₃.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Measured {
    /// Positions of the encoders, m.
    pub position_m: [f64; AXES],
    /// Forces of the drives since the sample before, N.
    pub force_n: [f64; AXES],
}

/// The external force on the platform, in base axes.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct ExternalForce {
    /// Force, N.
    pub force_n: [f64; 3],
    /// Moment about the platform's origin, N m.
    pub moment_nm: [f64; 3],
    /// Uncertainty of the bite force, two standard deviations, N.
    pub uncertainty_n: f64,
}

impl ExternalForce {
    /// The bite force of the jaw, which pushes the platform downwards, N.
    pub fn bite_n(&self) -> f64 {
        -self.force_n[2]
    }
}

/// A law's intended deviation from the desired pose, in base axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Detour {
    /// Distance from the desired position at the sample of the coming cycle, m.
    pub at_sample_m: Vec3,
    /// Velocity beside the desired one until the last command is reached, m/s.
    pub ahead_m_s: Vec3,
}

impl Default for Detour {
    /// None.
    fn default() -> Self {
        Self { at_sample_m: Vec3::zeros(), ahead_m_s: Vec3::zeros() }
    }
}

/// An observation of a law, for an event without a reaction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Notice {
    /// The cause.
    pub cause: Cause,
    /// The value, in the cause's unit.
    pub value: f64,
    /// The value that it should have.
    pub limit: f64,
}

/// A law gave no pose. The law's program reports the reason; the event of the safe stop has the cause `law_failed`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("the pose law failed")]
pub struct LawFailed;

/// A law of pose control.
///
/// # Examples
/// A law that asks for the desired pose and corrects nothing:
///
/// ```
/// use masseter_controller::motion_controller::MotionController;
/// use masseter_controller::pose_law::{Demand, LawFailed, PoseLaw};
/// use masseter_controller::trajectory::Trajectory;
/// use masseter_scenario::Scenario;
/// use masseter_model::geometry::{Mechanism, Pose};
///
/// #[derive(Debug)]
/// struct FeedForward;
///
/// impl PoseLaw for FeedForward {
///     fn command(&mut self, demand: &Demand) -> Result<Pose, LawFailed> {
///         Ok(demand.ahead)
///     }
/// }
///
/// let scenario = Scenario::default();
/// let mechanism = Mechanism::new(&scenario.mechanism)?;
/// let motion = Trajectory::new(&scenario.motion, &scenario.jaw, &mechanism, scenario.duration_s)?;
/// let controller = MotionController::with_law(&scenario, mechanism, motion, Box::new(FeedForward));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[doc(alias("control law", "regulator"))]
pub trait PoseLaw: std::fmt::Debug {
    /// The requested pose, for the desired pose at the time of this cycle's command. The call must not block or
    /// allocate: in real time, the cycle waits for the call. A target beyond a stroke by less than the default trim's
    /// reach is clamped.
    ///
    /// # Errors
    /// Without such a pose: the controller then stops safely.
    fn command(&mut self, demand: &Demand) -> Result<Pose, LawFailed>;

    /// The law's detour from the desired pose. The supervision of the path and the published state count the detour as
    /// desired, so that the limits hold for the unintended deviation. The law itself must bound its detour.
    fn detour(&self) -> Detour {
        Detour::default()
    }

    /// Whether the law uses the desired twist, which costs two more desired poses a cycle. Called once, before the start.
    fn needs_twist(&self) -> bool {
        false
    }

    /// The signals and parameters of the law. Called once, before the start.
    fn declared(&self) -> Declared {
        Declared::default()
    }

    /// Takes a parameter's value, which is within its range.
    fn set_parameter(&mut self, _place: usize, _value: f64) {}

    /// Writes the declared signals, also in cycles without a call of the law.
    fn fill_signals(&self, _signals: &mut [f64]) {}

    /// What the law has observed since the last call, for the events of the run.
    fn take_notice(&mut self) -> Option<Notice> {
        None
    }

    /// A copy of the law with its whole state. Not part of a cycle.
    ///
    /// # Errors
    /// [`NoBranch`] for a law without copies.
    fn branch(&self) -> Result<Box<dyn PoseLaw>, NoBranch> {
        Err(NoBranch::of::<Self>())
    }
}

/// A law of one function, which also gets the desired twist. Its arguments are demand, parameters in force, and signals
/// to fill. The last two are in the order of their declaration. Signals keep their values until the next write.
pub struct FunctionLaw<F> {
    declared: Declared,
    parameters: Vec<f64>,
    signals: Vec<f64>,
    function: F,
}

impl<F: FnMut(&Demand, &[f64], &mut [f64]) -> Result<Pose, LawFailed>> FunctionLaw<F> {
    /// The law with these signals and parameters.
    pub fn new(declared: Declared, function: F) -> Self {
        let (parameters, signals) = (vec![0.0; declared.parameters.len()], vec![0.0; declared.signals.len()]);
        Self { declared, parameters, signals, function }
    }
}

impl<F> fmt::Debug for FunctionLaw<F> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("FunctionLaw").field("declared", &self.declared).finish_non_exhaustive()
    }
}

impl<F: FnMut(&Demand, &[f64], &mut [f64]) -> Result<Pose, LawFailed>> PoseLaw for FunctionLaw<F> {
    fn command(&mut self, demand: &Demand) -> Result<Pose, LawFailed> {
        (self.function)(demand, &self.parameters, &mut self.signals)
    }

    fn needs_twist(&self) -> bool {
        true
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

/// The requested pose of a foreign law. A quaternion whose length is rounded is brought to 1. Other values are not
/// checked: the controller refuses those that are no pose.
pub fn asked_pose(position_m: [f64; 3], [w, x, y, z]: [f64; 4]) -> Pose {
    let quaternion = Quaternion::new(w, x, y, z);
    let is_rounded = ROUNDED_NORM_ERROR.contains(&(quaternion.norm() - 1.0).abs());
    let rotation = if is_rounded { Unit::new_normalize(quaternion) } else { Unit::new_unchecked(quaternion) };
    Pose::from_parts(Translation3::from(position_m), rotation)
}

/// Errors of a length that 32-bit numbers or a few decimal digits make. Smaller ones stay as they are.
const ROUNDED_NORM_ERROR: Range<f64> = 1e-9..1e-3;
