//! The times of the plant's faults and stimuli in a run, and their events.

use std::ops::Range;

use masseter_runtime::injection::{Injected, Injection};
use masseter_runtime::messages::codes::ControllerState;
use masseter_runtime::messages::{Command, Event, LAYOUT_VERSION};
use masseter_scenario::{FaultLayer, Scenario};

use super::commands::CommandFaults;
use super::mishap::Mishap;
use super::occurrence::Occurrence;
use crate::error::PlantError;
use crate::journal::Journal;

/// Follows the occurrences from which times count, tells every window once, and alters commands.
#[derive(Debug)]
pub(crate) struct Injector {
    injection: Injection,
    /// Those whose window is not told yet.
    untold: Vec<Untold>,
    /// Whether a window may have become known since the last look.
    has_news: bool,
    commands: CommandFaults,
    events: Journal,
}

#[derive(Debug, Clone, Copy)]
struct Untold {
    injected: Injected,
    /// Whether the controller or the supervisor carries it out. It begins when its window does.
    is_of_others: bool,
}

impl Injector {
    /// The faults and stimuli of a scenario that is switched on at `now_ns`.
    pub(crate) fn new(scenario: &Scenario, now_ns: u64) -> Result<Self, PlantError> {
        let faults = scenario.faults.iter().enumerate().map(|(place, fault)| Untold {
            injected: Injected::Fault(place),
            is_of_others: fault.kind.layer() == FaultLayer::Process,
        });
        let stimuli = scenario.stimulus.iter().enumerate().map(|(place, stimulus)| Untold {
            injected: Injected::Stimulus(place),
            is_of_others: stimulus.is_of_controller(),
        });
        Ok(Self {
            injection: Injection::new(scenario, now_ns)
                .map_err(|error| PlantError::Scenario(error.to_string()))?,
            untold: faults.chain(stimuli).collect(),
            has_news: true,
            commands: CommandFaults::new(&scenario.faults),
            events: Journal::new(),
        })
    }

    /// Whether there are neither faults nor stimuli.
    pub(crate) fn is_empty(&self) -> bool {
        self.injection.is_empty()
    }

    /// A command was received in the cycle that sampled at `sampled_ns`: it has the controller's state.
    pub(crate) fn note_command(&mut self, command: &Command, sampled_ns: u64) {
        if command.version == LAYOUT_VERSION
            && let Ok(state) = ControllerState::try_from(command.controller_state)
        {
            self.injection.note_state(state, sampled_ns);
            self.has_news = true;
        }
    }

    /// A fault of a bus strikes; the wire reports that itself.
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

    /// Takes a mishap of the mechanism.
    pub(crate) fn note_mishap(&mut self, time_ns: u64, mishap: &Mishap, cycle: u64) {
        self.events.add(mishap.event(time_ns, cycle));
    }

    /// The next window that has become known.
    pub(crate) fn next_window(&mut self) -> Option<(Injected, Range<u64>)> {
        if !self.has_news {
            return None;
        }
        let injection = &self.injection;
        let known = self.untold.iter().position(|untold| injection.window_ns(untold.injected).is_some());
        let Some(place) = known else {
            self.has_news = false;
            return None;
        };
        let Untold { injected, is_of_others } = self.untold.swap_remove(place);
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
        [sampled_ns, now_ns]: [u64; 2],
        command: Option<&Command>,
    ) -> Option<Command> {
        let Self { commands, injection, events, has_news, .. } = self;
        commands.alter([sampled_ns, now_ns], command.copied(), |occurrence| {
            if !occurrence.has_ended {
                injection.note_begin(occurrence.injected, now_ns);
                *has_news = true;
            }
            events.add(occurrence.event(cycle));
        })
    }

    /// Hands out the events since the last drain.
    pub(crate) fn drain_events(&mut self, out: &mut impl FnMut(Event)) {
        self.events.drain(out);
    }
}
