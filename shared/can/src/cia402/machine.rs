//! The drive's state machine: transitions by commands, by faults, and by the drive's own progress.
//!
//! T-numbers are the transitions of CiA 402. T0 (power-on) creates the drive. T16 (operation enabled
//! again out of quick stop) exists only where the quick-stop option code 605A makes the drive stay
//! in quick stop: [`DriveState::after_in_held_quick_stop`].

use super::{Command, DriveState};

impl DriveState {
    /// The state after a command; the same where the command has no effect.
    ///
    /// Enable operation in ready to switch on performs T3 and, by itself, T4 after it.
    #[must_use]
    #[expect(clippy::match_same_arms, reason = "one line a transition, as the standard numbers them")]
    pub const fn after(self, command: Command) -> Self {
        use Command::{DisableVoltage, EnableOperation, FaultReset, QuickStop, Shutdown, SwitchOn};
        use DriveState::{
            Fault, OperationEnabled, QuickStopActive, ReadyToSwitchOn, SwitchOnDisabled, SwitchedOn,
        };
        #[rustfmt::skip]
        let next = match (self, command) {
            (SwitchOnDisabled, Shutdown)                   => ReadyToSwitchOn,  // T2
            (ReadyToSwitchOn, SwitchOn)                    => SwitchedOn,       // T3
            (ReadyToSwitchOn, EnableOperation)             => OperationEnabled, // T3, T4
            (SwitchedOn, EnableOperation)                  => OperationEnabled, // T4
            (OperationEnabled, SwitchOn)                   => SwitchedOn,       // T5
            (SwitchedOn, Shutdown)                         => ReadyToSwitchOn,  // T6
            (ReadyToSwitchOn, DisableVoltage | QuickStop)  => SwitchOnDisabled, // T7
            (OperationEnabled, Shutdown)                   => ReadyToSwitchOn,  // T8
            (OperationEnabled, DisableVoltage)             => SwitchOnDisabled, // T9
            (SwitchedOn, DisableVoltage | QuickStop)       => SwitchOnDisabled, // T10
            (OperationEnabled, QuickStop)                  => QuickStopActive,  // T11
            (QuickStopActive, DisableVoltage)              => SwitchOnDisabled, // T12
            (Fault, FaultReset)                            => SwitchOnDisabled, // T15
            (unmoved, _)                                   => unmoved,
        };
        next
    }

    /// The state after a command to a drive that stays in quick stop until the next command (605A = 5 or 6): as
    /// [`after`](Self::after), and T16.
    #[must_use]
    pub const fn after_in_held_quick_stop(self, command: Command) -> Self {
        match (self, command) {
            (Self::QuickStopActive, Command::EnableOperation) => Self::OperationEnabled,
            _ => self.after(command),
        }
    }

    /// The state after the drive detected a fault (T13).
    #[must_use]
    pub const fn after_fault(self) -> Self {
        match self {
            Self::Fault => Self::Fault,
            _ => Self::FaultReactionActive,
        }
    }

    /// The state after the drive completed its own task in this state: initialising (T1), the
    /// quick-stop ramp (T12), the reaction to a fault (T14). Other states have no such task.
    #[must_use]
    pub const fn after_completion(self) -> Self {
        match self {
            Self::NotReadyToSwitchOn | Self::QuickStopActive => Self::SwitchOnDisabled,
            Self::FaultReactionActive => Self::Fault,
            unmoved => unmoved,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cia402::DriveState::{
        Fault, FaultReactionActive, NotReadyToSwitchOn, OperationEnabled, QuickStopActive, ReadyToSwitchOn,
        SwitchOnDisabled, SwitchedOn,
    };

    const COMMANDS: [Command; 6] = [
        Command::Shutdown,
        Command::SwitchOn,
        Command::EnableOperation,
        Command::DisableVoltage,
        Command::QuickStop,
        Command::FaultReset,
    ];

    /// Row: state. Column: the state after each of [`COMMANDS`].
    #[rustfmt::skip]
    const TABLE: [(DriveState, [DriveState; 6]); 8] = [
        (NotReadyToSwitchOn,  [NotReadyToSwitchOn; 6]),
        (SwitchOnDisabled,    [ReadyToSwitchOn, SwitchOnDisabled, SwitchOnDisabled, SwitchOnDisabled, SwitchOnDisabled, SwitchOnDisabled]),
        (ReadyToSwitchOn,     [ReadyToSwitchOn, SwitchedOn, OperationEnabled, SwitchOnDisabled, SwitchOnDisabled, ReadyToSwitchOn]),
        (SwitchedOn,          [ReadyToSwitchOn, SwitchedOn, OperationEnabled, SwitchOnDisabled, SwitchOnDisabled, SwitchedOn]),
        (OperationEnabled,    [ReadyToSwitchOn, SwitchedOn, OperationEnabled, SwitchOnDisabled, QuickStopActive, OperationEnabled]),
        (QuickStopActive,     [QuickStopActive, QuickStopActive, QuickStopActive, SwitchOnDisabled, QuickStopActive, QuickStopActive]),
        (FaultReactionActive, [FaultReactionActive; 6]),
        (Fault,               [Fault, Fault, Fault, Fault, Fault, SwitchOnDisabled]),
    ];

    #[test]
    fn every_command_in_every_state() {
        for (state, expected) in TABLE {
            assert_eq!(COMMANDS.map(|command| state.after(command)), expected, "from {state}");
        }
    }

    #[test]
    fn only_a_held_quick_stop_can_be_left_for_operation() {
        for state in DriveState::ALL {
            for command in COMMANDS {
                let differs = state.after_in_held_quick_stop(command) != state.after(command);
                assert_eq!(differs, state == QuickStopActive && command == Command::EnableOperation);
            }
        }
        assert_eq!(QuickStopActive.after_in_held_quick_stop(Command::EnableOperation), OperationEnabled);
    }

    #[test]
    fn a_fault_ends_in_fault_from_every_state() {
        for state in DriveState::ALL {
            assert_eq!(state.after_fault().after_completion(), Fault, "from {state}");
        }
    }

    #[test]
    fn a_drive_goes_on_by_itself_from_three_states_only() {
        let moved = DriveState::ALL.into_iter().filter(|state| state.after_completion() != *state);
        assert!(moved.eq([NotReadyToSwitchOn, QuickStopActive, FaultReactionActive]));
    }
}
