//! The supervision of the drives: whether they come, stay, and remain enabled.
//!
//! The supervision only judges; the master stops the drives.

use masseter_shared::messages::codes::{BootPhase, Cause, DriveState, drive_state_code};

use super::boot::BootFault;
use super::drive::RemoteDrive;
use super::events::Subject;
use super::interlock::Failure;

/// A judgement that needs a reaction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Finding {
    /// The drive never came.
    Absent(BootFault),
    /// The drive was lost.
    Lost(Failure),
}

/// Limits and memory of the supervision.
#[derive(Debug, Clone, Copy)]
pub(super) struct Supervision {
    heartbeat_timeout_ns: u64,
    boot_timeout_ns: u64,
    were_enabled: bool,
}

impl Supervision {
    /// Supervision with these limits.
    pub(super) fn new(heartbeat_timeout_ns: u64, boot_timeout_ns: u64) -> Self {
        Self { heartbeat_timeout_ns, boot_timeout_ns, were_enabled: false }
    }

    /// Judges the cycle of one drive; `is_fresh` says whether it has answered SYNC. A verified drive must be received,
    /// and an operational one must answer every SYNC once.
    pub(super) fn judge(
        &self,
        now_ns: u64,
        axis: usize,
        drive: &mut RemoteDrive,
        is_fresh: bool,
    ) -> Option<Finding> {
        match drive.boot_phase() {
            BootPhase::Waiting => drive.absence(now_ns, self.boot_timeout_ns).map(Finding::Absent),
            BootPhase::Configured | BootPhase::Ready => {
                let (cause, [value, limit]) = drive.loss(now_ns, is_fresh, self.heartbeat_timeout_ns)?;
                Some(Finding::Lost(Failure { cause, subject: Subject::Axis(axis), value, limit }))
            }
            _ => None,
        }
    }

    /// Judges whether a drive has left operation by itself while all are to be enabled.
    pub(super) fn judge_power(
        &self,
        axis: usize,
        state: Option<DriveState>,
        shall_be_enabled: bool,
    ) -> Option<Failure> {
        let has_left = shall_be_enabled && self.were_enabled && state != Some(DriveState::OperationEnabled);
        let value = f64::from(drive_state_code(state));
        has_left.then(|| Failure { value, ..Failure::new(Cause::DriveFault, Subject::Axis(axis)) })
    }

    /// Ends the judgement of a cycle.
    pub(super) fn end_cycle(&mut self, shall_be_enabled: bool, all_are_enabled: bool) {
        self.were_enabled = shall_be_enabled && (self.were_enabled || all_are_enabled);
    }

    /// The drives are to be enabled anew.
    pub(super) fn restart(&mut self) {
        self.were_enabled = false;
    }
}
