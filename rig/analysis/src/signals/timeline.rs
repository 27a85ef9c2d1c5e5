//! The cycles of a run in the order of time, from messages that come topic after topic.
//!
//! A cycle is handed out once no message of it can come any more, together with the events up to its sample.

use std::collections::VecDeque;

use masseter_recording::Recorded;
use masseter_runtime::messages::{Parameters, State};

use super::cpu_share::CpuShare;
use super::cycle::CycleMessages;
use crate::events::EventRecord;

/// Cycles kept; more than a subscriber's queue holds of any topic.
const KEPT: usize = 1 << 13;
/// Cycles kept while the run goes on: more than come between two looks of the recorder.
const KEPT_WHILE_RUNNING: usize = 1 << 8;

/// A cycle whose messages are complete.
#[derive(Debug, Clone)]
pub struct Sample {
    /// When the drives sampled, ns.
    pub time_ns: u64,
    /// Its messages.
    pub messages: CycleMessages,
    /// The events since the cycle before, up to this sample.
    pub events: Vec<EventRecord>,
    /// Whether it is no sample: it only holds the events after the last one.
    pub is_closing: bool,
}

/// Joins the messages of each cycle.
#[derive(Debug, Clone)]
pub struct Timeline {
    kept: usize,
    cycles: VecDeque<CycleMessages>,
    /// Events that were not handed out yet.
    events: Vec<EventRecord>,
    parameters: Option<Parameters>,
    controller_cpu: CpuShare,
    plant_cpu: CpuShare,
    /// The newest cycle whose sample a state was computed from.
    newest_reading: u64,
    last_ns: u64,
    is_closed: bool,
}

impl Default for Timeline {
    fn default() -> Self {
        Self::keeping(KEPT)
    }
}

impl Timeline {
    /// For messages that come soon after their cycle: a message that comes 256
    /// cycles late is left out.
    pub fn while_running() -> Self {
        Self::keeping(KEPT_WHILE_RUNNING)
    }

    fn keeping(kept: usize) -> Self {
        Self {
            kept,
            cycles: VecDeque::new(),
            events: Vec::new(),
            parameters: None,
            controller_cpu: CpuShare::default(),
            plant_cpu: CpuShare::default(),
            newest_reading: 0,
            last_ns: 0,
            is_closed: false,
        }
    }

    /// Takes a message of a cycle; hands out a cycle that is complete now.
    pub fn take(&mut self, message: &Recorded) -> Option<Sample> {
        match message {
            Recorded::Reading(reading) => self.at(reading.cycle)?.reading = Some(*reading),
            Recorded::Truth(truth) => self.at(truth.cycle)?.truth = Some(*truth),
            Recorded::Contact(contact) => self.at(contact.cycle)?.contact = Some(*contact),
            Recorded::State(state) => self.state(state),
            Recorded::Command(command) => self.at(command.cycle)?.command = Some(*command),
            Recorded::Signals(signals) => self.at(signals.cycle)?.signals = Some(*signals),
            Recorded::Parameters(parameters) => self.at(parameters.cycle)?.parameters = Some(*parameters),
            Recorded::Event(_) | Recorded::Frame(_) | Recorded::Machine(_) => {}
        }
        if self.cycles.len() > self.kept { self.hand_out() } else { None }
    }

    /// A state belongs to the sample that it was computed from, which may be late. Without a new sample it belongs to its own
    /// cycle, unless a state comes that was computed from that cycle's sample.
    fn state(&mut self, state: &State) {
        let is_fresh = state.reading_cycle > self.newest_reading;
        self.newest_reading = self.newest_reading.max(state.reading_cycle);
        let cycle = if is_fresh { state.reading_cycle } else { state.cycle };
        let Some(messages) = self.at(cycle) else { return };
        if is_fresh || messages.state.is_none() {
            (messages.state, messages.has_solution) = (Some(*state), is_fresh);
        }
    }

    /// A lost cycle may have acted on the jaw in this cycle.
    pub fn disturb(&mut self, cycle: u64) {
        if let Some(messages) = self.at(cycle) {
            messages.is_disturbed = true;
        }
    }

    /// Takes an event, which belongs to the first sample at or after its time.
    pub fn event(&mut self, event: &EventRecord) {
        self.events.push(event.clone());
    }

    /// The next cycle of those that are left once every message has come; after the last one, a closing sample without
    /// messages, which holds the events that came later.
    pub fn finish(&mut self) -> Option<Sample> {
        while !self.cycles.is_empty() {
            if let Some(sample) = self.hand_out() {
                return Some(sample);
            }
        }
        let is_first = !std::mem::replace(&mut self.is_closed, true);
        is_first.then(|| {
            self.events.sort_by_key(|event| event.time_ns);
            let latest_ns = self.events.last().map_or(0, |event| event.time_ns);
            let (time_ns, events) = (latest_ns.max(self.last_ns + 1), std::mem::take(&mut self.events));
            Sample { time_ns, messages: CycleMessages::default(), events, is_closing: true }
        })
    }

    /// The messages of a cycle; none where the cycle was handed out, or is impossibly far ahead.
    fn at(&mut self, cycle: u64) -> Option<&mut CycleMessages> {
        let first = self.cycles.front().map_or(cycle, |messages| messages.cycle);
        if self.cycles.is_empty() {
            self.cycles.push_back(CycleMessages { cycle, ..CycleMessages::default() });
        }
        let place = cycle.checked_sub(first)? as usize;
        if place > 2 * KEPT {
            return None;
        }
        while self.cycles.len() <= place {
            let cycle = first + self.cycles.len() as u64;
            self.cycles.push_back(CycleMessages { cycle, ..CycleMessages::default() });
        }
        self.cycles.get_mut(place)
    }

    /// The oldest cycle; none where it has no message, as a skipped one.
    fn hand_out(&mut self) -> Option<Sample> {
        let mut messages = self.cycles.pop_front()?;
        self.parameters = messages.parameters.or(self.parameters);
        messages.parameters = self.parameters;
        let controller = messages.state.map(|state| [state.woke_ns, state.worked_ns + state.spun_ns]);
        let plant = messages.reading.map(|reading| [reading.woke_ns, reading.worked_ns + reading.spun_ns]);
        messages.cpu = [self.controller_cpu.take(controller), self.plant_cpu.take(plant)];
        let time_ns = messages.time_ns().filter(|time_ns| *time_ns > self.last_ns)?;
        self.last_ns = time_ns;
        let mut events = Vec::new();
        if !self.events.is_empty() {
            let is_due = |event: &mut EventRecord| event.time_ns <= time_ns;
            events.extend(self.events.extract_if(.., is_due));
            events.sort_by_key(|event| event.time_ns);
        }
        Some(Sample { time_ns, messages, events, is_closing: false })
    }
}

#[cfg(test)]
mod tests {
    use masseter_runtime::messages::{Event, Reading, State};

    use super::*;

    fn reading(cycle: u64) -> Recorded {
        Recorded::Reading(Reading { cycle, sampled_ns: cycle * 1000, ..Reading::default() })
    }

    #[test]
    fn messages_of_a_cycle_come_together_in_the_order_of_time_with_the_events_before_them() {
        let mut timeline = Timeline::default();
        for cycle in [1, 2, 4] {
            assert!(timeline.take(&reading(cycle)).is_none());
        }
        for cycle in 1..=4 {
            timeline.take(&Recorded::State(State { cycle, due_ns: cycle * 1000 + 500, ..State::default() }));
        }
        for time_ns in [2000, 1500, 9000] {
            timeline.event(&EventRecord::from(&Event { time_ns, ..Event::default() }));
        }
        let samples: Vec<_> = std::iter::from_fn(|| timeline.finish()).collect();
        let times: Vec<_> = samples.iter().map(|sample| sample.time_ns).collect();
        assert_eq!(times, [1000, 2000, 3500, 4000, 9000], "cycle 3 has no reading; the last one closes");
        let (closing, cycles) = samples.split_last().unwrap();
        assert!(closing.is_closing);
        assert!(cycles.iter().all(|sample| sample.messages.state.unwrap().cycle == sample.messages.cycle));
        let events: Vec<Vec<_>> =
            samples.iter().map(|sample| sample.events.iter().map(|event| event.time_ns).collect()).collect();
        assert_eq!(events, [vec![], vec![1500, 2000], vec![], vec![], vec![9000]]);
    }

    #[test]
    fn a_state_belongs_to_the_sample_that_it_was_computed_from() {
        let mut timeline = Timeline::default();
        (1..=4).for_each(|cycle| drop(timeline.take(&reading(cycle))));
        // Reading 2 comes too late for cycle 2: cycle 3 uses it, and cycle 4 has its own again.
        for (cycle, reading_cycle) in [(1, 1), (2, 1), (3, 2), (4, 4)] {
            timeline.take(&Recorded::State(State { cycle, reading_cycle, ..State::default() }));
        }
        let found: Vec<_> = std::iter::from_fn(|| timeline.finish())
            .map(|Sample { messages, .. }| (messages.state.map(|state| state.cycle), messages.has_solution))
            .collect();
        assert_eq!(found, [(Some(1), true), (Some(3), true), (None, false), (Some(4), true), (None, false)]);
    }

    #[test]
    fn a_long_run_is_handed_out_while_it_goes_on() {
        let mut timeline = Timeline::default();
        let total = 3 * KEPT as u64;
        let early = (1..=total).filter_map(|cycle| timeline.take(&reading(cycle))).count() as u64;
        assert_eq!(early, total - KEPT as u64);
        assert!(timeline.take(&reading(1)).is_none(), "too old");
        assert_eq!(std::iter::from_fn(|| timeline.finish()).count(), KEPT + 1);
    }
}
