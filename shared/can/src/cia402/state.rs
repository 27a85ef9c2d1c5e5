//! The eight states of a drive.

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

impl DriveState {
    /// Whether the power stage has voltage: the drive gives force, or does so at the next command.
    pub const fn is_powered(self) -> bool {
        matches!(
            self,
            Self::SwitchedOn | Self::OperationEnabled | Self::QuickStopActive | Self::FaultReactionActive
        )
    }
}

#[cfg(test)]
mod tests {
    use super::DriveState::{self, FaultReactionActive, OperationEnabled, QuickStopActive, SwitchedOn};

    #[test]
    fn a_drive_has_voltage_from_switched_on_to_the_end_of_a_fault_reaction() {
        let powered = DriveState::ALL.into_iter().filter(|state| state.is_powered());
        assert!(powered.eq([SwitchedOn, OperationEnabled, QuickStopActive, FaultReactionActive]));
    }
}
