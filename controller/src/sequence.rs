//! The controller's sequence as a table: the state that follows a trigger.
//!
//! The controllers find the trigger of a cycle. This module only holds the resulting state and request.

use masseter_shared::messages::codes::{ControllerState as State, DriveRequest};

/// A trigger of the sequence. In one cycle only the most urgent trigger counts: the last in this order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Trigger {
    /// Enough complete readings in a row, and a pose found.
    Steady,
    /// All drives in operation enabled.
    Enabled,
    /// The first pose of the motion is reached.
    Eased,
    /// The motion has been played to its end.
    Played,
    /// The last pose has been held long enough.
    Rested,
    /// All drives are off.
    Released,
    /// A stop is requested.
    StopRequested,
    /// A fault.
    Fault,
}

impl Trigger {
    /// Every trigger, in order of urgency.
    pub const ALL: [Self; 8] = [
        Self::Steady,
        Self::Enabled,
        Self::Eased,
        Self::Played,
        Self::Rested,
        Self::Released,
        Self::StopRequested,
        Self::Fault,
    ];
}

use State::{Disabling, Easing, Enabling, Finished, Holding, Running, SafeStop, WaitReadings};

/// One row a state in the order of the codes, one column a trigger; a state in its own
/// row does not change.
#[rustfmt::skip]
const TABLE: [[State; 8]; 8] = [
    // Steady      Enabled       Eased         Played        Rested        Released      StopRequested Fault
    [Enabling,     WaitReadings, WaitReadings, WaitReadings, WaitReadings, WaitReadings, Finished,     SafeStop],
    [Enabling,     Easing,       Enabling,     Enabling,     Enabling,     Enabling,     Disabling,    SafeStop],
    [Easing,       Easing,       Running,      Easing,       Easing,       Easing,       Holding,      SafeStop],
    [Running,      Running,      Running,      Holding,      Running,      Running,      Holding,      SafeStop],
    [Holding,      Holding,      Holding,      Holding,      Disabling,    Holding,      Holding,      SafeStop],
    [Disabling,    Disabling,    Disabling,    Disabling,    Disabling,    Finished,     Disabling,    SafeStop],
    [Finished,     Finished,     Finished,     Finished,     Finished,     Finished,     Finished,     Finished],
    [SafeStop,     SafeStop,     SafeStop,     SafeStop,     SafeStop,     SafeStop,     SafeStop,     SafeStop],
];

/// The state that follows `state` when `trigger` happens.
pub fn next(state: State, trigger: Trigger) -> State {
    TABLE[state as usize][trigger as usize]
}

/// The request to all drives in that state.
pub fn request(state: State) -> DriveRequest {
    match state {
        WaitReadings | Disabling | Finished => DriveRequest::Off,
        Enabling | Easing | Running | Holding => DriveRequest::Enable,
        SafeStop => DriveRequest::QuickStop,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every pair that changes the state; all others must leave it.
    const MOVES: [(State, Trigger, State); 16] = [
        (WaitReadings, Trigger::Steady, Enabling),
        (WaitReadings, Trigger::StopRequested, Finished),
        (WaitReadings, Trigger::Fault, SafeStop),
        (Enabling, Trigger::Enabled, Easing),
        (Enabling, Trigger::StopRequested, Disabling),
        (Enabling, Trigger::Fault, SafeStop),
        (Easing, Trigger::Eased, Running),
        (Easing, Trigger::StopRequested, Holding),
        (Easing, Trigger::Fault, SafeStop),
        (Running, Trigger::Played, Holding),
        (Running, Trigger::StopRequested, Holding),
        (Running, Trigger::Fault, SafeStop),
        (Holding, Trigger::Rested, Disabling),
        (Holding, Trigger::Fault, SafeStop),
        (Disabling, Trigger::Released, Finished),
        (Disabling, Trigger::Fault, SafeStop),
    ];

    #[test]
    fn every_pair_moves_as_specified_and_no_other_moves() {
        for state in State::ALL {
            for trigger in Trigger::ALL {
                let specified = MOVES.iter().find(|(from, when, _)| (*from, *when) == (state, trigger));
                let expected = specified.map_or(state, |(_, _, to)| *to);
                assert_eq!(next(state, trigger), expected, "{state} on {trigger:?}");
            }
        }
    }

    #[test]
    fn a_safe_stop_is_never_left_and_every_moving_state_reaches_it() {
        for trigger in Trigger::ALL {
            assert_eq!(next(SafeStop, trigger), SafeStop);
        }
        for state in [WaitReadings, Enabling, Easing, Running, Holding, Disabling] {
            assert_eq!(next(state, Trigger::Fault), SafeStop);
        }
    }
}
