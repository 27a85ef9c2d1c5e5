//! The eight states of a drive.

use std::fmt;

use crate::messages::codes::DriveCondition;

/// State of a drive's power (CiA 402).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum DriveState {
    /// Initialising.
    NotReadyToSwitchOn,
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
