//! Faults of the controller's commands, between their receipt and the master.
//!
//! The master judges what comes out, as it would judge a bad controller: nothing here detects anything.

use std::ops::Range;

use masseter_runtime::injection::Injected;
use masseter_runtime::messages::Command;
use masseter_scenario::{FaultConfig, FaultKindConfig, FaultLayer};

use super::occurrence::Occurrence;
use super::times::acting_ns;

/// How far ahead of this controller another one counts its cycles: further than any run takes.
const FOREIGN_CYCLES: u64 = 1 << 40;

/// The faults of the commands.
#[derive(Debug)]
pub(super) struct CommandFaults {
    faults: Vec<CommandFault>,
}

#[derive(Debug)]
struct CommandFault {
    injected: Injected,
    config: FaultConfig,
    window_ns: Range<u64>,
    has_begun: bool,
    is_over: bool,
}

impl CommandFaults {
    /// Those of a scenario's list, none of which acts before its window is set.
    pub(super) fn new(list: &[FaultConfig]) -> Self {
        let of_commands =
            list.iter().enumerate().filter(|(_, config)| config.kind.layer() == FaultLayer::Command);
        let fault = |(place, config): (usize, &FaultConfig)| CommandFault {
            injected: Injected::Fault(place),
            config: config.clone(),
            window_ns: u64::MAX..u64::MAX,
            has_begun: false,
            is_over: false,
        };
        Self { faults: of_commands.map(fault).collect() }
    }

    /// Sets when a fault acts.
    pub(super) fn set_window(&mut self, injected: Injected, window_ns: &Range<u64>) {
        for fault in self.faults.iter_mut().filter(|fault| fault.injected == injected) {
            fault.window_ns = acting_ns(&fault.config, window_ns.clone());
        }
    }

    /// The command that reaches the master in the cycle that sampled at `sampled_ns`, in place of the one received at
    /// `now_ns`. Tells `report` what began or ended.
    pub(super) fn alter(
        &mut self,
        [sampled_ns, now_ns]: [u64; 2],
        mut command: Option<Command>,
        mut report: impl FnMut(Occurrence),
    ) -> Option<Command> {
        for fault in &mut self.faults {
            let axis = fault.config.axis();
            let mut tell =
                |has_ended| report(Occurrence { injected: fault.injected, time_ns: now_ns, axis, has_ended });
            if fault.window_ns.contains(&sampled_ns) {
                if let Some(given) = command.take() {
                    if !std::mem::replace(&mut fault.has_begun, true) {
                        tell(false);
                    }
                    command = altered(given, &fault.config);
                }
            } else if fault.has_begun && !std::mem::replace(&mut fault.is_over, true) {
                tell(true);
            }
        }
        command
    }
}

/// What a fault makes of a command.
fn altered(mut command: Command, fault: &FaultConfig) -> Option<Command> {
    match fault.kind {
        FaultKindConfig::ControllerStall => return None,
        FaultKindConfig::CommandNan => command.target_m.fill(f64::NAN),
        FaultKindConfig::CommandJump => {
            command.target_m[fault.axis().unwrap_or_default()] += fault.size_si();
        }
        FaultKindConfig::CommandVersion => command.version += 1,
        FaultKindConfig::CommandForeign => command.cycle += FOREIGN_CYCLES,
        // The other kinds act elsewhere.
        _ => {}
    }
    Some(command)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn alter(kind: FaultKindConfig, size: Option<&str>) -> Option<Command> {
        let size = size.map(|size| size.parse().unwrap());
        let axis = (kind == FaultKindConfig::CommandJump).then(|| "l2".to_owned());
        let mut faults = CommandFaults::new(&[FaultConfig { size, axis, ..FaultConfig::new(kind) }]);
        faults.set_window(Injected::Fault(0), &(0..u64::MAX));
        let command = Command { cycle: 3, target_m: [0.1; 6], version: 10, ..Command::default() };
        faults.alter([5, 6], Some(command), |_| {})
    }

    #[test]
    fn each_kind_changes_what_its_name_says_and_nothing_else() {
        use FaultKindConfig::{CommandForeign, CommandJump, CommandNan, CommandVersion, ControllerStall};
        assert_eq!(alter(ControllerStall, Some("1 s")), None);
        assert!(alter(CommandNan, None).unwrap().target_m.iter().all(|target_m| target_m.is_nan()));
        let jump = alter(CommandJump, Some("1 mm")).unwrap();
        assert_eq!((jump.target_m, jump.cycle), ([0.1, 0.1, 0.1, 0.1, 0.101, 0.1], 3));
        assert_eq!(alter(CommandVersion, None).unwrap().version, 11);
        let foreign = alter(CommandForeign, None).unwrap();
        assert_eq!((foreign.cycle > 1_000_000, foreign.target_m), (true, [0.1; 6]));
    }

    #[test]
    fn a_stall_begins_with_the_first_command_that_is_withheld_and_ends_after_its_size() {
        let size = Some("2 ms".parse().unwrap());
        let mut faults =
            CommandFaults::new(&[FaultConfig { size, ..FaultConfig::new(FaultKindConfig::ControllerStall) }]);
        faults.set_window(Injected::Fault(0), &(2_000_000..u64::MAX));
        let mut told = Vec::new();
        let arrived: Vec<_> = (1..7)
            .map(|cycle| {
                let command = (cycle != 2).then(Command::default);
                let times_ns = [cycle * 1_000_000, cycle * 1_000_000 + 5];
                faults.alter(times_ns, command, |occurrence| told.push(occurrence)).is_some()
            })
            .collect();
        assert_eq!(arrived, [true, false, false, true, true, true]);
        let told: Vec<_> = told.iter().map(|told| (told.time_ns, told.has_ended)).collect();
        assert_eq!(told, [(3_000_005, false), (4_000_005, true)], "nothing came in the second cycle");
    }
}
