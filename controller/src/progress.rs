//! The waits of a controller's sequence: what takes too long, and when the controller is done.

use masseter_shared::config::ControllerConfig;
use masseter_shared::control::Outcome;
use masseter_shared::geometry::AXES;
use masseter_shared::messages::codes::{Cause, ControllerState, drive_state};

use crate::safety::Fault;

/// Cycles for which the last command is repeated, so that the drives receive it.
pub(crate) const REPEATED_CYCLES: u64 = 5;
/// Longest wait of a safe stop for drives without voltage, s.
pub(crate) const SAFE_STOP_S: f64 = 0.3;

/// How long a controller has been in its state, and what the drives report.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Progress {
    pub(crate) state: ControllerState,
    pub(crate) cycles_in_state: u64,
    /// Cycles since the last complete reading.
    pub(crate) silent_cycles: u64,
    /// Codes of the drives' states.
    pub(crate) drive_state: [u32; AXES],
    pub(crate) period_s: f64,
}

impl Progress {
    /// Whether every drive reports that it is without voltage. A lost drive reports nothing, and may have voltage.
    pub(crate) fn drives_are_off(&self) -> bool {
        let is_off = |&code: &u32| matches!(drive_state(code), Ok(Some(state)) if !state.is_powered());
        self.drive_state.iter().all(is_off)
    }

    /// The fault of a wait that took too long.
    pub(crate) fn overdue(&self, config: &ControllerConfig) -> Option<Fault> {
        let over = |cause, cycles: u64, limit: f64| {
            (cycles as f64 > limit).then(|| Fault::new(cause, cycles as f64, limit))
        };
        let timeout_cycles = config.start_timeout_s / self.period_s;
        let silence = || over(Cause::StaleReading, self.silent_cycles, config.stale_cycles.into());
        match self.state {
            ControllerState::WaitReadings => over(Cause::StaleReading, self.cycles_in_state, timeout_cycles),
            ControllerState::Enabling | ControllerState::Disabling => {
                over(Cause::EnableTimeout, self.cycles_in_state, timeout_cycles).or_else(silence)
            }
            ControllerState::Finished | ControllerState::SafeStop => None,
            ControllerState::Easing | ControllerState::Running | ControllerState::Holding => silence(),
        }
    }

    /// How the controller ended; none while it has something to do. A safe stop waits for the drives to be off.
    pub(crate) fn outcome(&self) -> Option<Outcome> {
        let is_repeated = self.cycles_in_state >= REPEATED_CYCLES;
        match self.state {
            ControllerState::Finished => is_repeated.then_some(Outcome::Finished),
            ControllerState::SafeStop => {
                let waited_s = self.cycles_in_state as f64 * self.period_s;
                let is_over = (is_repeated && self.drives_are_off()) || waited_s >= SAFE_STOP_S;
                is_over.then_some(Outcome::SafeStop)
            }
            _ => None,
        }
    }
}
