//! The master's side of the state machine: which controlword leads a drive to a requested state.

use super::{Controlword, DriveState};

codes! {
    /// The request of a master to a drive.
    DriveRequest as u32 {
        /// No voltage: the drive is free.
        Off = 0 "off",
        /// Operation enabled, following the targets.
        Enable = 1 "enable",
        /// Stop along the quick-stop ramp, then switch on disabled.
        QuickStop = 2 "quick_stop",
    }
}

/// The next controlword (6040h) on the way from `state` to the requested state. `previous` is the last controlword
/// sent to the drive.
///
/// - [`DriveRequest::Enable`] climbs one transition a call, resets a fault by an edge of bit 7 and lets a
///   running quick stop end. It restarts a drive in fault: a caller that must not restart drives requests something else.
/// - [`DriveRequest::QuickStop`] brakes a drive that moves and switches off one that does not.
/// - [`DriveRequest::Off`] takes the voltage away at once; a moving drive coasts.
///
/// The function does not wait: without an answer of the drive it repeats the word, and the edge of a fault reset.
///
/// # Examples
/// From "switch on disabled" to "operation enabled":
///
/// ```
/// use masseter_can::cia402::{Controlword, DriveRequest, DriveState, next_controlword};
///
/// let (mut state, mut word) = (DriveState::SwitchOnDisabled, Controlword::DISABLE_VOLTAGE);
/// let mut words = Vec::new();
/// while state != DriveState::OperationEnabled {
///     let next = next_controlword(state, DriveRequest::Enable, word);
///     state = state.after(next.command(word, state));
///     word = next;
///     words.push(word.0);
/// }
/// assert_eq!(words, [0x06, 0x07, 0x0F], "shutdown, switch on, enable operation");
/// ```
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
    fn journey(start: DriveState, request: DriveRequest, mut previous: Controlword) -> Vec<DriveState> {
        let mut state = start;
        let mut states = vec![start];
        for _ in 0..STEPS {
            let word = next_controlword(state, request, previous);
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
        for request in [DriveRequest::Off, DriveRequest::QuickStop] {
            for state in DriveState::ALL {
                let end = journey(state, request, Controlword::FAULT_RESET).pop();
                let faulted = state.after_completion() == DriveState::Fault;
                let expected = if faulted { DriveState::Fault } else { DriveState::SwitchOnDisabled };
                assert_eq!(end, Some(expected), "{request} from {state}");
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
