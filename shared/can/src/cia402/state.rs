//! The eight states of a drive and its state machine: transitions by commands, by faults, and by the drive's own progress.
//!
//! T-numbers are the transitions of CiA 402. T0 (power-on) creates the drive. T16 (operation enabled
//! again out of quick stop) exists only where the quick-stop option code 605A makes the drive stay
//! in quick stop: [`DriveState::after_in_held_quick_stop`].

codes! {
    /// State of a drive's power (CiA 402). Code 0 is left for a drive whose state is not known.
    DriveState as u32 {
        /// Initialising.
        NotReadyToSwitchOn = 1 "not_ready_to_switch_on",
        /// No voltage allowed.
        SwitchOnDisabled = 2 "switch_on_disabled",
        /// Voltage may be applied.
        ReadyToSwitchOn = 3 "ready_to_switch_on",
        /// Voltage applied, no force.
        SwitchedOn = 4 "switched_on",
        /// Following targets.
        OperationEnabled = 5 "operation_enabled",
        /// Braking along the quick-stop ramp.
        QuickStopActive = 6 "quick_stop_active",
        /// Reacting to a fault.
        FaultReactionActive = 7 "fault_reaction_active",
        /// In fault, free of force.
        Fault = 8 "fault",
    }
}

/// The command in a controlword.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StateCommand {
    /// To ready to switch on.
    Shutdown,
    /// To switched on. From operation enabled the same bits are "disable operation".
    SwitchOn,
    /// To operation enabled.
    EnableOperation,
    /// To switch on disabled at once, without braking.
    DisableVoltage,
    /// Brake along the quick-stop ramp.
    QuickStop,
    /// Leave fault.
    FaultReset,
}

impl DriveState {
    /// Whether the power stage has voltage: the drive gives force, or does so at the next command.
    pub const fn is_powered(self) -> bool {
        matches!(
            self,
            Self::SwitchedOn | Self::OperationEnabled | Self::QuickStopActive | Self::FaultReactionActive
        )
    }

    /// The state after a command; the same where the command has no effect.
    ///
    /// Enable operation in ready to switch on performs T3 and, by itself, T4 after it.
    #[must_use]
    #[expect(clippy::match_same_arms, reason = "one line a transition, as the standard numbers them")]
    pub const fn after(self, command: StateCommand) -> Self {
        use DriveState::{
            Fault, OperationEnabled, QuickStopActive, ReadyToSwitchOn, SwitchOnDisabled, SwitchedOn,
        };
        use StateCommand::{DisableVoltage, EnableOperation, FaultReset, QuickStop, Shutdown, SwitchOn};
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
    pub const fn after_in_held_quick_stop(self, command: StateCommand) -> Self {
        match (self, command) {
            (Self::QuickStopActive, StateCommand::EnableOperation) => Self::OperationEnabled,
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
    use super::DriveState::{
        Fault, FaultReactionActive, NotReadyToSwitchOn, OperationEnabled, QuickStopActive, ReadyToSwitchOn,
        SwitchOnDisabled, SwitchedOn,
    };
    use super::*;

    #[test]
    fn a_drive_has_voltage_from_switched_on_to_the_end_of_a_fault_reaction() {
        let powered = DriveState::ALL.into_iter().filter(|state| state.is_powered());
        assert!(powered.eq([SwitchedOn, OperationEnabled, QuickStopActive, FaultReactionActive]));
    }

    const COMMANDS: [StateCommand; 6] = [
        StateCommand::Shutdown,
        StateCommand::SwitchOn,
        StateCommand::EnableOperation,
        StateCommand::DisableVoltage,
        StateCommand::QuickStop,
        StateCommand::FaultReset,
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
                assert_eq!(differs, state == QuickStopActive && command == StateCommand::EnableOperation);
            }
        }
        assert_eq!(QuickStopActive.after_in_held_quick_stop(StateCommand::EnableOperation), OperationEnabled);
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
