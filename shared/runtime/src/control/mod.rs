//! The seam between the rig and a controller: the trait, the order of a cycle, and a controller's part in a run.
//!
//! A [`Controller`] is a pure step function. Only [`run_cycle`] orders a cycle. [`Session::run`] calls it in
//! real time and in lockstep; the runner of virtual time calls it in one thread. Kinematics, trajectories and safety of a
//! particular controller are not here.

mod cycle;
mod operator;
mod session;

use crate::messages::{Command, Event, Reading, State};
use crate::named::Declared;

pub use cycle::{ControllerPorts, Duties, run_cycle, set_parameters};
pub use operator::{Operator, OperatorError, is_seen_by_controller};
pub use session::{Session, SessionError, Waited};

/// A cycle's place in time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Tick {
    /// Number of the cycle, from 1; skipped cycles leave a gap.
    pub cycle: u64,
    /// The time of the decision, ns.
    pub now_ns: u64,
}

/// How a controller ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// The controller did what it was asked to, and the drives are off.
    Finished,
    /// A fault ended the motion.
    SafeStop,
}

/// A controller of the robot. Time and messages come in as arguments; no method may block, allocate or do I/O.
///
/// Each cycle calls, in this order: [`observe`](Self::observe), [`decide`](Self::decide),
/// [`fill_command`](Self::fill_command), [`fill_state`](Self::fill_state). The rig adds the time stamps.
///
/// # Examples
/// A controller that leaves the drives without voltage for ten cycles:
///
/// ```
/// use masseter_runtime::control::{Controller, Outcome, Tick};
/// use masseter_runtime::messages::codes::{ControllerState, DriveRequest};
/// use masseter_runtime::messages::{Command, Event, Reading, State};
///
/// #[derive(Default)]
/// struct Idle {
///     cycle: u64,
///     reading_cycle: u64,
/// }
///
/// impl Controller for Idle {
///     fn observe(&mut self, reading: Option<&Reading>) {
///         self.reading_cycle = reading.map_or(self.reading_cycle, |reading| reading.cycle);
///     }
///
///     fn decide(&mut self, tick: Tick) -> Option<Event> {
///         self.cycle = tick.cycle;
///         None
///     }
///
///     fn fill_command(&self, command: &mut Command) {
///         let (cycle, reading_cycle) = (self.cycle, self.reading_cycle);
///         *command = Command { cycle, reading_cycle, request: DriveRequest::Off.code(), ..Command::default() };
///     }
///
///     fn fill_state(&mut self, state: &mut State) {
///         let controller_state = ControllerState::Finished.code();
///         *state = State { cycle: self.cycle, controller_state, ..State::default() };
///     }
///
///     fn request_stop(&mut self) {}
///
///     fn outcome(&self) -> Option<Outcome> {
///         (self.cycle >= 10).then_some(Outcome::Finished)
///     }
/// }
/// ```
#[doc(alias("control law", "regulator"))]
pub trait Controller {
    /// Takes the newest reading; none where no reading arrived in time.
    fn observe(&mut self, reading: Option<&Reading>);

    /// Decides what the drives have to do, and reports a change of state.
    fn decide(&mut self, tick: Tick) -> Option<Event>;

    /// Writes this cycle's command: targets in m, and a request to all drives.
    fn fill_command(&self, command: &mut Command);

    /// Writes what this cycle made of the reading.
    fn fill_state(&mut self, state: &mut State);

    /// Asks for an orderly stop: the motion comes to rest, then the drives are switched off.
    fn request_stop(&mut self);

    /// How the controller ended; none while it still has something to do.
    fn outcome(&self) -> Option<Outcome>;

    /// The signals that the controller publishes, and the parameters that its user sets. Called once, before the start.
    fn declared(&self) -> Declared {
        Declared::default()
    }

    /// Takes a parameter's value, which is within its range: before the first cycle, and at the beginning of a cycle.
    fn set_parameter(&mut self, _place: usize, _value: f64) {}

    /// Writes the declared signals of this cycle.
    fn fill_signals(&self, _signals: &mut [f64]) {}

    /// Does work of the next cycle once in advance and without effect, so that its code and data are in the caches.
    fn warm_up(&self) {}
}
