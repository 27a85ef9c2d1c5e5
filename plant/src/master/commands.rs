//! The controller's commands: the newest that passed the [gate](super::gate), and the silence since the last.

use masseter_model::geometry::AXES;
use masseter_runtime::messages::codes::{Cause, DriveRequest};
use masseter_runtime::messages::{Command, Reading};
use masseter_scenario::Scenario;

use super::events::Subject;
use super::failure::Failure;
use super::gate::{Gate, Target};

/// The received commands.
#[derive(Debug, Clone)]
pub(super) struct Commands {
    timeout_cycles: u32,
    gate: Gate,
    /// Request of the newest valid command.
    request: DriveRequest,
    /// Its cycle; none before the first.
    cycle: Option<u64>,
    received_ns: u64,
    silent_cycles: u32,
}

impl Commands {
    /// No command yet.
    pub(super) fn new(scenario: &Scenario) -> Self {
        Self {
            timeout_cycles: scenario.can.command_timeout_cycles,
            gate: Gate::new(scenario),
            request: DriveRequest::Off,
            cycle: None,
            received_ns: 0,
            silent_cycles: 0,
        }
    }

    /// Cycles since the last command.
    pub(super) fn silent_cycles(&self) -> u32 {
        self.silent_cycles
    }

    /// The request of the newest valid command.
    pub(super) fn request(&self) -> DriveRequest {
        self.request
    }

    /// The newest target for each drive; none before a target has passed the gate while the drive followed targets.
    pub(super) fn targets(&self) -> [Option<Target>; AXES] {
        self.gate.targets()
    }

    /// Whether a command of this cycle switches the drives off.
    pub(super) fn switch_off(&self) -> bool {
        self.silent_cycles == 0 && self.request == DriveRequest::Off
    }

    /// Takes the command of a cycle, if one came; a stale one is none. Silence is a failure only where `needs_command`; a
    /// command is one if the gate refuses it. `following_m` has the position of every drive that would follow its target.
    pub(super) fn take(
        &mut self,
        [cycle, now_ns]: [u64; 2],
        command: Option<&Command>,
        needs_command: bool,
        following_m: [Option<f64>; AXES],
    ) -> Result<(), (Subject, Failure)> {
        self.gate.begin_cycle(cycle, following_m);
        // A refused command is none.
        self.silent_cycles = self.silent_cycles.saturating_add(1);
        let Some(command) = command.filter(|command| !self.is_stale(command)) else {
            if !needs_command || self.silent_cycles <= self.timeout_cycles {
                return Ok(());
            }
            let cycles = [self.silent_cycles, self.timeout_cycles].map(f64::from);
            return Err((Subject::Rig, Failure::with(Cause::CommandLost, cycles)));
        };
        self.request = self.gate.pass(command, following_m)?;
        (self.cycle, self.received_ns, self.silent_cycles) = (Some(command.cycle), now_ns, 0);
        Ok(())
    }

    /// Whether a command demands motion for a cycle that had its command: nobody may control any more, and the same
    /// message is only sent again. A request to stop is never stale.
    fn is_stale(&self, command: &Command) -> bool {
        self.cycle == Some(command.cycle) && command.request == DriveRequest::Enable.code()
    }

    /// Writes the command that a reading answers.
    pub(super) fn fill_reading(&self, reading: &mut Reading) {
        reading.answers_cycle = self.cycle.unwrap_or(0);
        reading.command_received_ns = self.received_ns;
    }
}
