//! The intervals that a cycle passes through, each an HdrHistogram over every cycle of the run.
//!
//! A skipped deadline has no cycle and so no samples. Only the wake-ups have a second series in which it counts, with
//! the time until the wake-up that skipped it: corrected for coordinated omission once, by the skips as counted.

use masseter_runtime::messages::{Command, Reading, State};

use super::answer::{Answer, Answers};
use super::by_cycle::ByCycle;
use super::measured::{IntervalFigures, Measured};

/// An interval that a cycle passes through.
#[derive(Debug, Clone, Copy)]
enum Interval {
    PlantWakeUp,
    PlantWakeUpCorrected,
    ProcessData,
    ControllerWakeUp,
    ControllerWakeUpCorrected,
    ReadingTransport,
    ForwardKinematics,
    Control,
    ControllerCycle,
    CommandTransport,
    CommandToWire,
    SampleToWire,
    /// From the plant's wake-up to the reading's publication, and from the reading's reception to the command's: both
    /// processes and the wires, without the waits of the time table.
    RoundTrip,
}

/// The names of the intervals, each at the place that is its number.
const NAMES: [&str; Interval::RoundTrip as usize + 1] = [
    "plant wake-up",
    "plant wake-up corrected",
    "process data",
    "controller wake-up",
    "controller wake-up corrected",
    "reading transport",
    "forward kinematics",
    "control",
    "controller cycle",
    "command transport",
    "command to wire",
    "sample to wire",
    "round trip",
];

/// All intervals of a run, and the latest messages, between which they lie. The later message completes an interval,
/// whichever that is.
#[derive(Debug, Clone)]
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
        Self {
            period_ns,
            measured: NAMES.map(Measured::new).into(),
            answers: Answers::default(),
            readings: ByCycle::default(),
            received_ns: ByCycle::default(),
            states: ByCycle::default(),
            commands: ByCycle::default(),
            answered: ByCycle::default(),
        }
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
    pub(super) fn reading(&mut self, reading: &Reading, skipped: u64) {
        let wake_up = [Interval::PlantWakeUp, Interval::PlantWakeUpCorrected];
        self.add_wake_up(wake_up, [reading.due_ns, reading.woke_ns], skipped);
        if reading.complete_ns > 0 {
            self.add(Interval::ProcessData, reading.sampled_ns, reading.complete_ns);
        }
        if let Some(received_ns) = self.received_ns.get(reading.cycle).copied() {
            self.add(Interval::ReadingTransport, reading.published_ns, received_ns);
        }
        self.readings.insert(reading.cycle, *reading);
        let Some(answer) = self.answers.take(reading) else { return };
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
    pub(super) fn state(&mut self, state: &State, is_fresh: bool, skipped: u64) {
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

    pub(super) fn command(&mut self, command: &Command) {
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

    pub(super) fn finish(self) -> Vec<IntervalFigures> {
        self.measured.into_iter().map(Measured::finish).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD_NS: u64 = 1_000_000;

    fn intervals() -> Intervals {
        Intervals::new(PERIOD_NS)
    }

    /// Samples and largest value of each interval.
    fn found(intervals: Intervals) -> Vec<(&'static str, u64, Option<u64>)> {
        let figures = intervals.finish();
        figures.iter().map(|interval| (interval.name, interval.n, interval.max_ns)).collect()
    }

    /// Samples and largest value of one interval.
    fn only(name: &str, intervals: Intervals) -> (u64, Option<u64>) {
        let (_, n, max_ns) = found(intervals).into_iter().find(|(other, ..)| *other == name).unwrap();
        (n, max_ns)
    }

    /// Reading 4 came too late for cycle 4: cycle 5 used it.
    fn reading() -> Reading {
        let (sampled_ns, complete_ns, published_ns) = (130, 530, 600);
        Reading { cycle: 4, woke_ns: 30, sampled_ns, complete_ns, published_ns, ..Reading::default() }
    }

    fn state() -> State {
        let (received_ns, solved_ns, commanded_ns) = (1010, 1020, 1050);
        State { cycle: 5, reading_cycle: 4, received_ns, solved_ns, commanded_ns, ..State::default() }
    }

    fn command() -> Command {
        Command { cycle: 5, reading_cycle: 4, published_ns: 1060, ..Command::default() }
    }

    fn answer() -> Reading {
        let (command_received_ns, command_sent_ns) = (1100, 1400);
        Reading { cycle: 6, answers_cycle: 5, command_received_ns, command_sent_ns, ..Reading::default() }
    }

    #[test]
    fn a_late_reading_is_followed_to_the_wire_in_whatever_order_the_topics_are_recorded() {
        let expected = [
            ("process data", 1, Some(400)),
            ("reading transport", 1, Some(410)),
            ("forward kinematics", 1, Some(10)),
            ("control", 1, Some(30)),
            ("controller cycle", 1, Some(50)),
            ("command transport", 1, Some(40)),
            ("command to wire", 1, Some(300)),
            ("sample to wire", 1, Some(1270)),
            // SYNC to the reading's publication 570, its reception to the command's 90.
            ("round trip", 1, Some(660)),
        ];
        let take = |intervals: &mut Intervals, message: char| match message {
            'r' => intervals.reading(&reading(), 0),
            's' => intervals.state(&state(), true, 0),
            'c' => intervals.command(&command()),
            _ => intervals.reading(&answer(), 0),
        };
        for order in ["rsca", "rsac", "rcsa", "rcas", "rasc", "racs", "srca", "crsa", "scra", "csra"] {
            let mut intervals = intervals();
            order.chars().for_each(|message| take(&mut intervals, message));
            let found = found(intervals);
            for expected in expected {
                assert!(found.contains(&expected), "{order}: {expected:?} in {found:?}");
            }
        }
    }

    #[test]
    fn the_longest_round_trip_was_when_the_plant_had_the_command() {
        let mut intervals = intervals();
        intervals.reading(&reading(), 0);
        intervals.state(&state(), true, 0);
        intervals.reading(&answer(), 0);
        let figures = intervals.finish();
        let trip = figures.iter().find(|interval| interval.name == "round trip").unwrap();
        assert_eq!((trip.max_ns, trip.max_at_ns), (Some(660), Some(1100)));
    }

    #[test]
    fn a_reading_used_again_gives_no_samples() {
        let mut intervals = intervals();
        intervals.reading(&reading(), 0);
        intervals.state(&state(), true, 0);
        intervals.state(&State { cycle: 6, ..state() }, false, 0);
        assert_eq!(only("forward kinematics", intervals), (1, Some(10)));
    }

    #[test]
    fn a_command_that_never_reached_the_wire_has_no_way_there() {
        let mut intervals = intervals();
        intervals.reading(&reading(), 0);
        intervals.command(&command());
        intervals.reading(&Reading { command_sent_ns: 400, ..answer() }, 0);
        let found = found(intervals);
        for expected in
            [("command transport", 1, Some(40)), ("command to wire", 0, None), ("sample to wire", 0, None)]
        {
            assert!(found.contains(&expected), "{expected:?} in {found:?}");
        }
    }

    #[test]
    fn a_skipped_deadline_counts_in_the_corrected_wake_up_only() {
        let states = || {
            let mut intervals = intervals();
            intervals.state(&State::default(), false, 0);
            // Woken 200 µs after deadline 5; 2 to 4 were skipped.
            let late = State { due_ns: 5 * PERIOD_NS, woke_ns: 5_200_000, ..State::default() };
            intervals.state(&late, false, 3);
            intervals
        };
        assert_eq!(only("controller wake-up", states()), (2, Some(200_000)));
        assert_eq!(only("controller wake-up corrected", states()), (5, Some(3_200_000)));
    }
}
