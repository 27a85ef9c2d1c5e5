//! The supervision of enabled drives: none may leave operation by itself.
//!
//! The supervision only judges; the master stops the drives.

use masseter_shared::messages::codes::{Cause, DriveState, drive_state_code};

use super::interlock::Failure;

/// Memory of the supervision.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Supervision {
    /// Whether all drives have been enabled since they were to be.
    were_enabled: bool,
}

impl Supervision {
    /// Judges a drive in a cycle in which the drives are to be enabled, or not.
    pub(super) fn judge(self, state: Option<DriveState>, is_enable: bool) -> Option<Failure> {
        let has_left = is_enable && self.were_enabled && state != Some(DriveState::OperationEnabled);
        has_left.then(|| Failure::with(Cause::DriveFault, [f64::from(drive_state_code(state)), 0.0]))
    }

    /// Ends the judgement of a cycle.
    pub(super) fn end_cycle(&mut self, is_enable: bool, all_are_enabled: bool) {
        self.were_enabled = is_enable && (self.were_enabled || all_are_enabled);
    }
}
