//! The eight states of a drive.

use std::fmt;

use crate::messages::codes::{DriveCondition, UnknownCode};

/// State of a drive's power (CiA 402).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[repr(u32)]
pub enum DriveState {
    /// Initialising.
    NotReadyToSwitchOn = 1,
    /// No voltage allowed.
    SwitchOnDisabled = 2,
    /// Voltage may be applied.
    ReadyToSwitchOn = 3,
    /// Voltage applied, no force.
    SwitchedOn = 4,
    /// Following targets.
    OperationEnabled = 5,
    /// Braking along the quick-stop ramp.
    QuickStopActive = 6,
    /// Reacting to a fault.
    FaultReactionActive = 7,
    /// In fault, free of force.
    Fault = 8,
}

impl DriveState {
    /// Every state, in the order of the codes.
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

    /// The number that messages carry, the same as the [`DriveCondition`]'s.
    pub const fn code(self) -> u32 {
        self as u32
    }
}

impl TryFrom<u32> for DriveState {
    type Error = UnknownCode;

    fn try_from(code: u32) -> Result<Self, UnknownCode> {
        let unknown = UnknownCode { enumeration: "DriveState", code };
        Self::ALL.into_iter().find(|state| state.code() == code).ok_or(unknown)
    }
}

impl From<DriveState> for DriveCondition {
    fn from(state: DriveState) -> Self {
        match state {
            DriveState::NotReadyToSwitchOn => Self::NotReady,
            DriveState::SwitchOnDisabled => Self::SwitchOnDisabled,
            DriveState::ReadyToSwitchOn => Self::ReadyToSwitchOn,
            DriveState::SwitchedOn => Self::SwitchedOn,
            DriveState::OperationEnabled => Self::OperationEnabled,
            DriveState::QuickStopActive => Self::QuickStopActive,
            DriveState::FaultReactionActive => Self::FaultReaction,
            DriveState::Fault => Self::Fault,
        }
    }
}

impl fmt::Display for DriveState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        DriveCondition::from(*self).fmt(f)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_are_those_of_the_messages() {
        for state in DriveState::ALL {
            assert_eq!(DriveState::try_from(state.code()), Ok(state));
            assert_eq!(DriveCondition::from(state).code(), state.code());
        }
        for code in [DriveCondition::Unknown.code(), 9] {
            assert_eq!(DriveState::try_from(code), Err(UnknownCode { enumeration: "DriveState", code }));
        }
    }
}
