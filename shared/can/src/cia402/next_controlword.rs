//! The master's side of the state machine: which controlword leads a drive to a requested state.

use std::fmt;

use super::{Controlword, DriveState};

/// What a master asks of a drive.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[repr(u32)]
pub enum DriveRequest {
    /// No voltage: the drive is free.
    Off = 0,
    /// Operation enabled, following the targets.
    Enable,
    /// Stop along the quick-stop ramp, then switch on disabled.
    QuickStop,
}

impl DriveRequest {
    /// Every request.
    pub const ALL: [Self; 3] = [Self::Off, Self::Enable, Self::QuickStop];

    /// The number in messages.
    pub const fn code(self) -> u32 {
        self as u32
    }

    /// The request with that number.
    pub fn from_code(code: u32) -> Option<Self> {
        Self::ALL.into_iter().find(|request| request.code() == code)
    }

    /// The name in files and reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Off => "off",
            Self::Enable => "enable",
            Self::QuickStop => "quick_stop",
        }
    }
}

impl fmt::Display for DriveRequest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// The next controlword (6040h) on the way from `state` to what `request` asks for. `previous` is the last
/// controlword sent to the drive.
///
/// - [`DriveRequest::Enable`] climbs one transition a call, resets a fault by an edge of bit 7 and lets a
///   running quick stop end. It restarts a drive that failed: who must not do so stops asking for it.
/// - [`DriveRequest::QuickStop`] brakes a drive that moves and switches off one that does not.
/// - [`DriveRequest::Off`] takes the voltage away at once; a moving drive coasts.
///
/// The function does not wait: without an answer of the drive it repeats the word, and the edge of a fault reset.
pub const fn next_controlword(
    state: DriveState,
    request: DriveRequest,
    previous: Controlword,
) -> Controlword {
    match request {
        DriveRequest::Off => Controlword::DISABLE_VOLTAGE,
        DriveRequest::QuickStop => Controlword::QUICK_STOP,
        DriveRequest::Enable => match state {
            DriveState::SwitchOnDisabled => Controlword::SHUTDOWN,
            DriveState::ReadyToSwitchOn => Controlword::SWITCH_ON,
            DriveState::SwitchedOn | DriveState::OperationEnabled => Controlword::ENABLE_OPERATION,
            DriveState::QuickStopActive => Controlword::QUICK_STOP,
            DriveState::Fault if !previous.holds_fault_reset() => Controlword::FAULT_RESET,
            DriveState::NotReadyToSwitchOn | DriveState::FaultReactionActive | DriveState::Fault => {
                Controlword::DISABLE_VOLTAGE
            }
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// More than the longest way takes: fault reaction, fault, an edge prepared and made, four steps up.
    const STEPS: usize = 8;

    /// States of a drive that finishes its own doings at once and then obeys [`next_controlword`].
    fn journey(start: DriveState, wanted: DriveRequest, mut previous: Controlword) -> Vec<DriveState> {
        let mut state = start;
        let mut states = vec![start];
        for _ in 0..STEPS {
            let word = next_controlword(state, wanted, previous);
            state = state.after_completion();
            state = state.after(word.command(previous, state));
            previous = word;
            states.push(state);
        }
        states
    }

    #[test]
    fn enable_reaches_operation_enabled_from_everywhere_whatever_was_sent_before() {
        for state in DriveState::ALL {
            for previous in 0..=0xFF {
                let end = journey(state, DriveRequest::Enable, Controlword(previous)).pop();
                assert_eq!(end, Some(DriveState::OperationEnabled), "from {state} after {previous:02X}h");
            }
        }
    }

    #[test]
    fn off_and_quick_stop_end_without_force_and_leave_a_fault_alone() {
        for wanted in [DriveRequest::Off, DriveRequest::QuickStop] {
            for state in DriveState::ALL {
                let end = journey(state, wanted, Controlword::FAULT_RESET).pop();
                let faulted = state.after_completion() == DriveState::Fault;
                let expected = if faulted { DriveState::Fault } else { DriveState::SwitchOnDisabled };
                assert_eq!(end, Some(expected), "{wanted} from {state}");
            }
        }
    }

    #[test]
    fn a_moving_drive_brakes_before_it_is_switched_off() {
        let states =
            journey(DriveState::OperationEnabled, DriveRequest::QuickStop, Controlword::ENABLE_OPERATION);
        assert_eq!(states[1], DriveState::QuickStopActive);
    }

    #[test]
    fn an_unanswered_fault_reset_makes_a_new_edge_every_other_call() {
        let mut previous = Controlword::ENABLE_OPERATION;
        let words = [(); 4].map(|()| {
            previous = next_controlword(DriveState::Fault, DriveRequest::Enable, previous);
            previous
        });
        let (reset, low) = (Controlword::FAULT_RESET, Controlword::DISABLE_VOLTAGE);
        assert_eq!(words, [reset, low, reset, low]);
    }
}
