//! The controller's sequence as a table: the state that follows a trigger.
//!
//! The sequencer finds the trigger of a cycle. This module only holds the resulting state and request.

use masseter_runtime::messages::codes::{ControllerState as State, DriveRequest};

/// What changes a state. In one cycle only the most urgent trigger counts: the last in this order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Trigger {
    /// The condition that ends the state holds.
    Done,
    /// A stop is requested.
    StopRequested,
    /// A fault.
    Fault,
}

use State::{Disabling, Easing, Enabling, Finished, Holding, Running, SafeStop, WaitReadings};

/// The state that follows `state` when `trigger` happens; the same state where nothing changes.
pub(crate) fn next(state: State, trigger: Trigger) -> State {
    let [done, stop_requested] = match state {
        WaitReadings => [Enabling, Finished],
        Enabling => [Easing, Disabling],
        Easing => [Running, Holding],
        Running => [Holding, Holding],
        Holding => [Disabling, Holding],
        Disabling => [Finished, Disabling],
        Finished | SafeStop => return state,
    };
    match trigger {
        Trigger::Done => done,
        Trigger::StopRequested => stop_requested,
        Trigger::Fault => SafeStop,
    }
}

/// The request to all drives in that state.
pub(crate) fn request(state: State) -> DriveRequest {
    match state {
        WaitReadings | Disabling | Finished => DriveRequest::Off,
        Enabling | Easing | Running | Holding => DriveRequest::Enable,
        SafeStop => DriveRequest::QuickStop,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TRIGGERS: [Trigger; 3] = [Trigger::Done, Trigger::StopRequested, Trigger::Fault];

    /// Every pair that changes the state; all others must leave it.
    const MOVES: [(State, Trigger, State); 16] = [
        (WaitReadings, Trigger::Done, Enabling),
        (WaitReadings, Trigger::StopRequested, Finished),
        (WaitReadings, Trigger::Fault, SafeStop),
        (Enabling, Trigger::Done, Easing),
        (Enabling, Trigger::StopRequested, Disabling),
        (Enabling, Trigger::Fault, SafeStop),
        (Easing, Trigger::Done, Running),
        (Easing, Trigger::StopRequested, Holding),
        (Easing, Trigger::Fault, SafeStop),
        (Running, Trigger::Done, Holding),
        (Running, Trigger::StopRequested, Holding),
        (Running, Trigger::Fault, SafeStop),
        (Holding, Trigger::Done, Disabling),
        (Holding, Trigger::Fault, SafeStop),
        (Disabling, Trigger::Done, Finished),
        (Disabling, Trigger::Fault, SafeStop),
    ];

    #[test]
    fn every_pair_moves_as_specified_and_no_other_moves() {
        for state in State::ALL {
            for trigger in TRIGGERS {
                let specified = MOVES.iter().find(|(from, when, _)| (*from, *when) == (state, trigger));
                let expected = specified.map_or(state, |(_, _, to)| *to);
                assert_eq!(next(state, trigger), expected, "{state} on {trigger:?}");
            }
        }
    }

    #[test]
    fn a_safe_stop_is_never_left_and_every_moving_state_reaches_it() {
        for trigger in TRIGGERS {
            assert_eq!(next(SafeStop, trigger), SafeStop);
        }
        for state in [WaitReadings, Enabling, Easing, Running, Holding, Disabling] {
            assert_eq!(next(state, Trigger::Fault), SafeStop);
        }
    }
}
