//! The controller's commands: the newest valid one, and the silence since the last.

use masseter_shared::geometry::AXES;
use masseter_shared::messages::codes::{Cause, DriveRequest};
use masseter_shared::messages::{Command, Reading};

use super::events::Subject;
use super::failure::Failure;

/// The received commands.
#[derive(Debug, Clone)]
pub(super) struct Commands {
    timeout_cycles: u32,
    newest: Option<Command>,
    received_ns: u64,
    silent_cycles: u32,
}

impl Commands {
    /// No command yet; silence beyond `timeout_cycles` is a failure.
    pub(super) fn new(timeout_cycles: u32) -> Self {
        Self { timeout_cycles, newest: None, received_ns: 0, silent_cycles: 0 }
    }

    /// Cycles since the last command.
    pub(super) fn silent_cycles(&self) -> u32 {
        self.silent_cycles
    }

    /// The request of the newest valid command.
    pub(super) fn request(&self) -> DriveRequest {
        let request = self.newest.and_then(|command| DriveRequest::try_from(command.request).ok());
        request.unwrap_or(DriveRequest::Off)
    }

    /// The targets of the newest valid command, m.
    pub(super) fn targets_m(&self) -> [f64; AXES] {
        self.newest.map_or([0.0; AXES], |command| command.target_m)
    }

    /// Whether a command of this cycle switches the drives off.
    pub(super) fn switch_off(&self) -> bool {
        self.silent_cycles == 0
            && self.newest.is_some_and(|command| command.request == DriveRequest::Off.code())
    }

    /// Takes the command of a cycle, if one came. Silence is a failure only where `needs_command`; a command is one if
    /// an axis cannot go to its target or the request is unknown.
    pub(super) fn take(
        &mut self,
        now_ns: u64,
        command: Option<&Command>,
        needs_command: bool,
        can_go_to: impl Fn(usize, f64) -> bool,
    ) -> Result<(), (Subject, Failure)> {
        let Some(command) = command else {
            self.silent_cycles = self.silent_cycles.saturating_add(1);
            if !needs_command || self.silent_cycles <= self.timeout_cycles {
                return Ok(());
            }
            let cycles = [self.silent_cycles, self.timeout_cycles].map(f64::from);
            return Err((Subject::Rig, Failure::with(Cause::CommandLost, cycles)));
        };
        self.silent_cycles = 0;
        let bad = |subject, value| (subject, Failure::with(Cause::BadMessage, [value, 0.0]));
        if let Some(axis) = (0..AXES).find(|&axis| !can_go_to(axis, command.target_m[axis])) {
            return Err(bad(Subject::Axis(axis), command.target_m[axis]));
        }
        if DriveRequest::try_from(command.request).is_err() {
            return Err(bad(Subject::Rig, f64::from(command.request)));
        }
        (self.newest, self.received_ns) = (Some(*command), now_ns);
        Ok(())
    }

    /// Writes the command that a reading answers.
    pub(super) fn fill_reading(&self, reading: &mut Reading) {
        reading.answers_cycle = self.newest.map_or(0, |command| command.cycle);
        reading.command_received_ns = self.received_ns;
    }
}
