//! The eight states of a drive.

use std::fmt;

/// State of a drive's power (CiA 402).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[repr(u32)]
pub enum DriveState {
    /// Initialising.
    NotReadyToSwitchOn = 1,
    /// No voltage allowed.
    SwitchOnDisabled,
    /// Voltage may be applied.
    ReadyToSwitchOn,
    /// Voltage applied, no force.
    SwitchedOn,
    /// Following targets.
    OperationEnabled,
    /// Braking along the quick-stop ramp.
    QuickStopActive,
    /// Reacting to a fault.
    FaultReactionActive,
    /// In fault, free of force.
    Fault,
}

impl DriveState {
    /// Every state.
    pub const ALL: [Self; 8] = [
        Self::NotReadyToSwitchOn,
        Self::SwitchOnDisabled,
        Self::ReadyToSwitchOn,
        Self::SwitchedOn,
        Self::OperationEnabled,
        Self::QuickStopActive,
        Self::FaultReactionActive,
        Self::Fault,
    ];

    /// The number in messages, from 1; 0 is left for a drive of unknown state.
    pub const fn code(self) -> u32 {
        self as u32
    }

    /// The state with that number.
    pub fn from_code(code: u32) -> Option<Self> {
        Self::ALL.into_iter().find(|state| state.code() == code)
    }

    /// Whether voltage is applied: the drive gives force, or does so at the next command.
    pub const fn is_powered(self) -> bool {
        match self {
            Self::NotReadyToSwitchOn | Self::SwitchOnDisabled | Self::ReadyToSwitchOn | Self::Fault => false,
            Self::SwitchedOn | Self::OperationEnabled | Self::QuickStopActive | Self::FaultReactionActive => {
                true
            }
        }
    }

    /// The name in files and reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::NotReadyToSwitchOn => "not_ready_to_switch_on",
            Self::SwitchOnDisabled => "switch_on_disabled",
            Self::ReadyToSwitchOn => "ready_to_switch_on",
            Self::SwitchedOn => "switched_on",
            Self::OperationEnabled => "operation_enabled",
            Self::QuickStopActive => "quick_stop_active",
            Self::FaultReactionActive => "fault_reaction_active",
            Self::Fault => "fault",
        }
    }
}

impl fmt::Display for DriveState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
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
