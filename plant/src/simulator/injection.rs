//! Faults and stimuli of the plant: the time of each, and the events of its beginning and its end.
//!
//! [`Injector`] follows the times for the core and acts on commands itself. The injector hands the windows to the
//! emulation, whose agenda has the effects on drives and mechanism. The emulation does not depend on the injector.
//!
//! A command is altered between its receipt and the master. The master judges the result like the command of a bad
//! controller. This module detects nothing.

use std::ops::Range;

use masseter_runtime::injection::{Injected, Injection, Withdrawn};
use masseter_runtime::messages::codes::ControllerState;
use masseter_runtime::messages::{Command, LAYOUT_VERSION};
use masseter_scenario::{CommandFault, FaultConfig, FaultKindConfig, Scenario};

use crate::{error::PlantError, master::events::Journal, master::link::Occurrence};

/// Follows the occurrences from which times count, hands out every window once, and alters commands.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub(crate) struct Injector {
    injection: Injection,
    /// Entries with a window not handed out yet, each with whether the controller or the supervisor carries it out. An
    /// entry of those two begins when its window begins.
    untold: Vec<(Injected, bool)>,
    /// Whether a window may have become known since the last look.
    has_news: bool,
    commands: CommandFaults,
    pub(crate) events: Journal,
}

impl Injector {
    /// The faults and stimuli of a scenario that is switched on at `now_ns`.
    pub(crate) fn new(scenario: &Scenario, now_ns: u64) -> Result<Self, PlantError> {
        Ok(Self {
            injection: Injection::new(scenario, now_ns)
                .map_err(|error| PlantError::Scenario(error.to_string()))?,
            untold: entries(scenario),
            has_news: true,
            commands: CommandFaults::new(&scenario.faults),
            events: Journal::new(),
        })
    }

    /// Lets these faults and stimuli of the scenario act no more from that time on, ns.
    pub(crate) fn withdraw(&mut self, scenario: &Scenario, withdrawn: Withdrawn, from_ns: u64) {
        self.injection.withdraw(withdrawn, from_ns);
        (self.untold, self.has_news) = (entries(scenario), true);
    }

    /// Whether there are neither faults nor stimuli.
    pub(crate) fn is_empty(&self) -> bool {
        self.injection.is_empty()
    }

    /// Takes the controller's state from a command in the cycle that samples at `sampled_ns`.
    pub(crate) fn note_command(&mut self, command: &Command, sampled_ns: u64) {
        if command.version == LAYOUT_VERSION
            && let Ok(state) = ControllerState::try_from(command.controller_state)
        {
            self.injection.note_state(state, sampled_ns);
            self.has_news = true;
        }
    }

    /// Notes the strike of a bus fault, which the wire reports itself.
    pub(crate) fn note_bus_fault(&mut self, place: usize, time_ns: u64) {
        self.injection.note_begin(Injected::Fault(place), time_ns);
        self.has_news = true;
    }

    /// Takes the beginning or the end of what the emulation carries out.
    pub(crate) fn note(&mut self, occurrence: &Occurrence, cycle: u64) {
        if !occurrence.has_ended {
            self.injection.note_begin(occurrence.injected, occurrence.time_ns);
            self.has_news = true;
        }
        self.events.add(occurrence.event(cycle));
    }

    /// The next window that has become known.
    pub(crate) fn next_window(&mut self) -> Option<(Injected, Range<u64>)> {
        if !self.has_news {
            return None;
        }
        let injection = &self.injection;
        let known = self.untold.iter().position(|(injected, _)| injection.window_ns(*injected).is_some());
        let Some(place) = known else {
            self.has_news = false;
            return None;
        };
        let (injected, is_of_others) = self.untold.swap_remove(place);
        let window_ns = self.injection.window_ns(injected)?;
        if is_of_others {
            self.injection.note_begin(injected, window_ns.start);
        }
        self.commands.set_window(injected, &window_ns);
        Some((injected, window_ns))
    }

    /// The command that reaches the master in a cycle in place of the one received at `now_ns`.
    pub(crate) fn alter(
        &mut self,
        cycle: u64,
        sampled_ns: u64,
        now_ns: u64,
        command: Option<&Command>,
    ) -> Option<Command> {
        let Self { commands, injection, events, has_news, .. } = self;
        commands.alter(sampled_ns, now_ns, command.copied(), |occurrence| {
            if !occurrence.has_ended {
                injection.note_begin(occurrence.injected, now_ns);
                *has_news = true;
            }
            events.add(occurrence.event(cycle));
        })
    }
}

/// The entries of a scenario, each with whether the controller or the supervisor carries it out.
fn entries(scenario: &Scenario) -> Vec<(Injected, bool)> {
    let faults = scenario.faults.iter().enumerate();
    let faults = faults.map(|(place, fault)| (Injected::Fault(place), fault.kind.is_of_process()));
    let stimuli = scenario.stimulus.iter().enumerate();
    faults.chain(stimuli.map(|(place, of)| (Injected::Stimulus(place), of.is_of_controller()))).collect()
}

/// Lead of another controller's cycle count: more than any run has.
const FOREIGN_CYCLES: u64 = 1 << 40;

/// The faults of the commands.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub(super) struct CommandFaults(Vec<AlteringFault>);

#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
struct AlteringFault {
    injected: Injected,
    kind: CommandFault,
    axis: Option<usize>,
    size: f64,
    /// Most time of it, ns.
    longest_ns: u64,
    window_ns: Range<u64>,
    /// Whether its beginning is reported, and its end is not.
    is_acting: bool,
}

impl CommandFaults {
    /// Those of a scenario's list, none of which acts before its window is set.
    pub(super) fn new(list: &[FaultConfig]) -> Self {
        let altering = |(place, config): (usize, &FaultConfig)| {
            let FaultKindConfig::Command(kind) = config.kind else { return None };
            Some(AlteringFault {
                injected: Injected::Fault(place),
                kind,
                axis: config.axis(),
                size: config.size_si(),
                longest_ns: config.acting_ns(0..u64::MAX).end,
                window_ns: u64::MAX..u64::MAX,
                is_acting: false,
            })
        };
        Self(list.iter().enumerate().filter_map(altering).collect())
    }

    /// Sets when a fault acts.
    pub(super) fn set_window(&mut self, injected: Injected, window_ns: &Range<u64>) {
        for fault in self.0.iter_mut().filter(|fault| fault.injected == injected) {
            let Range { start, end } = *window_ns;
            fault.window_ns = start..end.min(start.saturating_add(fault.longest_ns));
        }
    }

    /// The command for the master in the cycle that samples at `sampled_ns`, in place of the one received at `now_ns`.
    /// Calls `report` with beginnings and ends.
    pub(super) fn alter(
        &mut self,
        sampled_ns: u64,
        now_ns: u64,
        received: Option<Command>,
        mut report: impl FnMut(Occurrence),
    ) -> Option<Command> {
        let mut command = received;
        for fault in &mut self.0 {
            let (injected, axis) = (fault.injected, fault.axis);
            let mut tell = |has_ended| report(Occurrence { injected, time_ns: now_ns, axis, has_ended });
            if fault.window_ns.contains(&sampled_ns) {
                let Some(received) = received else { continue };
                // A fault counts by its effect alone, also when another fault withholds the command.
                let is_altered = fault.altered(received) != Some(received);
                if is_altered && !std::mem::replace(&mut fault.is_acting, true) {
                    tell(false);
                }
                command = command.and_then(|given| fault.altered(given));
            } else if std::mem::take(&mut fault.is_acting) {
                tell(true);
            }
        }
        command
    }
}

impl AlteringFault {
    /// The effect of the fault on a command.
    fn altered(&self, mut command: Command) -> Option<Command> {
        match self.kind {
            CommandFault::ControllerStall => return None,
            CommandFault::Nan => command.target_m.fill(f64::NAN),
            CommandFault::Jump => command.target_m[self.axis.unwrap_or_default()] += self.size,
            CommandFault::Version => command.version += 1,
            CommandFault::Foreign => command.cycle += FOREIGN_CYCLES,
        }
        Some(command)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn alter(kind: CommandFault, size: Option<&str>) -> Option<Command> {
        let size = size.map(|size| size.parse().unwrap());
        let axis = (kind == CommandFault::Jump).then(|| "l2".to_owned());
        let mut faults = CommandFaults::new(&[FaultConfig { size, axis, ..FaultConfig::new(kind) }]);
        faults.set_window(Injected::Fault(0), &(0..u64::MAX));
        let command = Command { cycle: 3, target_m: [0.1; 6], version: 10, ..Command::default() };
        faults.alter(5, 6, Some(command), |_| {})
    }

    #[test]
    fn each_kind_changes_what_its_name_says_and_nothing_else() {
        use CommandFault::{ControllerStall, Foreign, Jump, Nan, Version};
        assert_eq!(alter(ControllerStall, Some("1 s")), None);
        assert!(alter(Nan, None).unwrap().target_m.iter().all(|target_m| target_m.is_nan()));
        let jump = alter(Jump, Some("1 mm")).unwrap();
        assert_eq!((jump.target_m, jump.cycle), ([0.1, 0.1, 0.1, 0.1, 0.101, 0.1], 3));
        assert_eq!(alter(Version, None).unwrap().version, 11);
        let foreign = alter(Foreign, None).unwrap();
        assert_eq!((foreign.cycle > 1_000_000, foreign.target_m), (true, [0.1; 6]));
    }

    #[test]
    fn a_stall_begins_with_the_first_command_that_is_withheld_and_ends_after_its_size() {
        let size = Some("2 ms".parse().unwrap());
        let mut faults =
            CommandFaults::new(&[FaultConfig { size, ..FaultConfig::new(CommandFault::ControllerStall) }]);
        faults.set_window(Injected::Fault(0), &(2_000_000..u64::MAX));
        let mut told = Vec::new();
        let arrived: Vec<_> = (1..7)
            .map(|cycle| {
                let command = (cycle != 2).then(Command::default);
                let sampled_ns = cycle * 1_000_000;
                faults
                    .alter(sampled_ns, sampled_ns + 5, command, |occurrence| told.push(occurrence))
                    .is_some()
            })
            .collect();
        assert_eq!(arrived, [true, false, false, true, true, true]);
        let told: Vec<_> = told.iter().map(|told| (told.time_ns, told.has_ended)).collect();
        assert_eq!(told, [(3_000_005, false), (4_000_005, true)], "nothing came in the second cycle");
    }

    #[test]
    fn each_fault_counts_by_what_it_alone_does() {
        let stall = FaultConfig {
            size: Some("9 ms".parse().unwrap()),
            ..FaultConfig::new(CommandFault::ControllerStall)
        };
        let jump = FaultConfig {
            axis: Some("l2".to_owned()),
            size: Some("0 mm".parse().unwrap()),
            ..FaultConfig::new(CommandFault::Jump)
        };
        let mut faults = CommandFaults::new(&[stall.clone(), stall, jump]);
        for (place, window_ns) in [1..9, 3..5, 2..7].iter().enumerate() {
            faults.set_window(Injected::Fault(place), window_ns);
        }
        let mut told = Vec::new();
        for now_ns in 0..10 {
            let mut note = |of: Occurrence| told.push((of.injected, of.time_ns, of.has_ended));
            let arrived = faults.alter(now_ns, now_ns, Some(Command::default()), &mut note);
            assert_eq!(arrived.is_none(), (1..9).contains(&now_ns), "{now_ns}");
        }
        let [outer, inner] = [0, 1].map(Injected::Fault);
        assert_eq!(told, [(outer, 1, false), (inner, 3, false), (inner, 5, true), (outer, 9, true)]);
    }
}
