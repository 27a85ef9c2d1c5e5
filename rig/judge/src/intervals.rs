//! The intervals that a cycle passes through, each an HdrHistogram over every cycle of the run.
//!
//! A skipped deadline has no cycle and so no samples. Only the wake-ups have a second series in which it counts, with
//! the time until the wake-up that skipped it: corrected for coordinated omission once, by the skips as counted.

use masseter_can::codes;
use masseter_runtime::messages::{Command, Reading, State};

use crate::measured::{IntervalFigures, Measured};
use crate::series::ByCycle;

/// A command that the plant took.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Answer {
    /// The controller's.
    pub(super) cycle: u64,
    pub(super) received_ns: u64,
    /// `None` if nothing went out, as before the drives exchange process data.
    pub(super) sent_ns: Option<u64>,
}

/// Finds the readings that answer a new command.
#[derive(Debug, Clone, Default)]
pub(super) struct Answers {
    last: u64,
}

impl Answers {
    /// Once for each command.
    pub(super) fn new_answer(&mut self, reading: &Reading) -> Option<Answer> {
        if reading.answers_cycle <= self.last {
            return None;
        }
        self.last = reading.answers_cycle;
        let (received_ns, sent_ns) = (reading.command_received_ns, reading.command_sent_ns);
        // An older instant belongs to an older command, whose times the plant repeats.
        let is_of_this = sent_ns > 0 && sent_ns >= received_ns;
        Some(Answer { cycle: self.last, received_ns, sent_ns: is_of_this.then_some(sent_ns) })
    }
}

codes! {
    /// An interval that a cycle passes through.
    Interval as u32 {
        PlantWakeUp = 0 "plant wake-up",
        PlantWakeUpCorrected = 1 "plant wake-up corrected",
        ProcessData = 2 "process data",
        ControllerWakeUp = 3 "controller wake-up",
        ControllerWakeUpCorrected = 4 "controller wake-up corrected",
        ReadingTransport = 5 "reading transport",
        ForwardKinematics = 6 "forward kinematics",
        Control = 7 "control",
        ControllerCycle = 8 "controller cycle",
        CommandTransport = 9 "command transport",
        CommandToWire = 10 "command to wire",
        SampleToWire = 11 "sample to wire",
        /// From the plant's wake-up to the reading's publication, and from the reading's reception to the command's: both
        /// processes and the wires, without the waits of the time table.
        RoundTrip = 12 "round trip",
    }
}

/// All intervals of a run, and the latest messages, between which they lie. The later message completes an interval,
/// whichever that is.
#[derive(Debug, Clone, Default)]
pub(super) struct Intervals {
    period_ns: u64,
    measured: Vec<Measured>,
    answers: Answers,
    /// By the plant's cycle.
    readings: ByCycle<Reading>,
    /// Reception of a reading, by the plant's cycle.
    received_ns: ByCycle<u64>,
    /// States with a fresh reading, commands, and their answers, by the controller's cycle.
    states: ByCycle<State>,
    commands: ByCycle<Command>,
    answered: ByCycle<Answer>,
}

impl Intervals {
    pub(super) fn new(period_ns: u64) -> Self {
        let measured = Interval::ALL.map(|interval| Measured::new(interval.name())).into();
        Self { period_ns, measured, ..Self::default() }
    }

    fn add(&mut self, interval: Interval, from_ns: u64, to_ns: u64) {
        self.measured[interval as usize].add(to_ns.saturating_sub(from_ns), to_ns);
    }

    /// A wake-up, and the deadlines skipped before it: each was due a period earlier than the next.
    fn add_wake_up(&mut self, [raw, corrected]: [Interval; 2], [due_ns, woke_ns]: [u64; 2], skipped: u64) {
        let late_ns = woke_ns.saturating_sub(due_ns);
        self.measured[raw as usize].add(late_ns, woke_ns);
        self.measured[corrected as usize].add_steps(late_ns, self.period_ns, skipped, woke_ns);
    }

    /// `skipped`: deadlines skipped just before it.
    pub(super) fn apply_reading(&mut self, reading: &Reading, skipped: u64) {
        let wake_up = [Interval::PlantWakeUp, Interval::PlantWakeUpCorrected];
        self.add_wake_up(wake_up, [reading.due_ns, reading.woke_ns], skipped);
        if reading.complete_ns > 0 {
            self.add(Interval::ProcessData, reading.sampled_ns, reading.complete_ns);
        }
        if let Some(received_ns) = self.received_ns.get(reading.cycle).copied() {
            self.add(Interval::ReadingTransport, reading.published_ns, received_ns);
        }
        self.readings.insert(reading.cycle, *reading);
        let Some(answer) = self.answers.new_answer(reading) else { return };
        if let Some(sent_ns) = answer.sent_ns {
            self.add(Interval::CommandToWire, answer.received_ns, sent_ns);
        }
        if let Some(command) = self.commands.get(answer.cycle).copied() {
            self.command_and_answer(&command, &answer);
        }
        if let Some(state) = self.states.get(answer.cycle).copied() {
            self.round_trip(&state, &answer);
        }
        self.answered.insert(answer.cycle, answer);
    }

    /// `is_fresh`: the state's reading is used for the first time. `skipped`: deadlines skipped just before it.
    pub(super) fn apply_state(&mut self, state: &State, is_fresh: bool, skipped: u64) {
        let wake_up = [Interval::ControllerWakeUp, Interval::ControllerWakeUpCorrected];
        self.add_wake_up(wake_up, [state.due_ns, state.woke_ns], skipped);
        if !is_fresh {
            return;
        }
        self.add(Interval::ForwardKinematics, state.received_ns, state.solved_ns);
        self.add(Interval::Control, state.solved_ns, state.commanded_ns);
        if let Some(reading) = self.readings.get(state.reading_cycle).copied() {
            self.add(Interval::ReadingTransport, reading.published_ns, state.received_ns);
        }
        if let Some(command) = self.commands.get(state.cycle).copied() {
            self.add(Interval::ControllerCycle, state.received_ns, command.published_ns);
        }
        if let Some(answer) = self.answered.get(state.cycle).copied() {
            self.round_trip(state, &answer);
        }
        self.received_ns.insert(state.reading_cycle, state.received_ns);
        self.states.insert(state.cycle, *state);
    }

    pub(super) fn apply_command(&mut self, command: &Command) {
        if let Some(state) = self.states.get(command.cycle).copied() {
            self.add(Interval::ControllerCycle, state.received_ns, command.published_ns);
        }
        if let Some(answer) = self.answered.get(command.cycle).copied() {
            self.command_and_answer(command, &answer);
        }
        self.commands.insert(command.cycle, *command);
    }

    fn command_and_answer(&mut self, command: &Command, answer: &Answer) {
        self.add(Interval::CommandTransport, command.published_ns, answer.received_ns);
        if let (Some(reading), Some(sent_ns)) =
            (self.readings.get(command.reading_cycle).copied(), answer.sent_ns)
        {
            self.add(Interval::SampleToWire, reading.sampled_ns, sent_ns);
        }
    }

    /// A reading is recorded before the one that answers it.
    fn round_trip(&mut self, state: &State, answer: &Answer) {
        if let Some(reading) = self.readings.get(state.reading_cycle).copied() {
            let exchange_ns = reading.published_ns.saturating_sub(reading.woke_ns);
            let answered_ns = answer.received_ns.saturating_sub(state.received_ns);
            let both_ns = answered_ns.saturating_add(exchange_ns);
            self.measured[Interval::RoundTrip as usize].add(both_ns, answer.received_ns);
        }
    }

    pub(super) fn into_figures(self) -> Vec<IntervalFigures> {
        self.measured.into_iter().map(Measured::into_figures).collect()
    }
}

#[cfg(test)]
mod tests;
