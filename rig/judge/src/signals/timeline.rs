//! The cycles of a run in the order of time, from messages that come topic after topic.
//!
//! A cycle is handed out once no message of it can come any more, together with the events up to its sample.

use std::collections::VecDeque;

use masseter_model::geometry::Pose;
use masseter_recording::Recorded;
use masseter_runtime::messages::{Command, Contact, Parameters, Reading, Signals, State, Truth};
use masseter_runtime::named::Declared;
use masseter_scenario::Scenario;

use crate::events::EventRecord;
use crate::poses::{estimated_pose, is_running, true_pose};
use crate::reference::{Progress, Reference};

/// The messages of a cycle; a missing message is `None`.
#[derive(Debug, Clone, Copy, Default, serde::Serialize, serde::Deserialize)]
pub struct CycleMessages {
    /// Number of the cycle, from 1: that of both loops, which count deadlines from one epoch.
    pub cycle: u64,
    /// Whether a lost cycle may have acted on the jaw.
    pub is_disturbed: bool,
    /// The plant's sample.
    pub reading: Option<Reading>,
    /// The true motion at the sample.
    pub truth: Option<Truth>,
    /// That of the cycle before.
    pub truth_before: Option<Truth>,
    /// The forces between the jaws in the cycle before.
    pub contact: Option<Contact>,
    /// The controller's state in its cycle of this number.
    pub state: Option<State>,
    /// What the controller made of this sample, which may have come late.
    pub solution: Option<State>,
    /// The controller's last state, as a code.
    pub controller_state: Option<u32>,
    /// The pose that the jaw should have.
    pub desired: Option<Pose>,
    /// By how much the motion is late, s; none but while the scenario's motion plays.
    pub lag_s: Option<f64>,
    /// Whether the motion plays already, and the controller has not begun it.
    pub is_awaited: bool,
    /// How far the desired pose has come on the motion, s, from any instant.
    pub progress_s: f64,
    /// The actual pose in the first cycle of the motion; none before.
    pub start: Option<Pose>,
    /// The controller's command.
    pub command: Option<Command>,
    /// The signals that the controller declares.
    pub signals: Option<Signals>,
    /// Shares of their cores that the loops of controller and plant took since the message before.
    pub cpu: [Option<f64>; 2],
    /// The controller's parameters, which hold until they change.
    pub parameters: Option<Parameters>,
}

impl CycleMessages {
    /// The pose that the jaw has: the true one where the mechanism is emulated, otherwise the estimated one.
    pub(crate) fn actual(&self, has_truth: bool) -> Option<Pose> {
        if has_truth { true_pose(self.truth.as_ref()?) } else { self.estimated() }
    }

    /// The pose that forward kinematics found.
    pub(crate) fn estimated(&self) -> Option<Pose> {
        estimated_pose(self.solution.as_ref()?)
    }

    /// When the drives sampled, ns; without a sample the controller's deadline.
    pub fn time_ns(&self) -> Option<u64> {
        let sampled =
            self.reading.map(|reading| reading.sampled_ns).or(self.truth.map(|truth| truth.sampled_ns));
        sampled.filter(|ns| *ns > 0).or(self.state.map(|state| state.due_ns))
    }
}

/// Cycles kept; more than a subscriber's queue holds of any topic.
const KEPT: usize = (1 << 13) - 1;
/// Cycles kept while the run goes on: more than come between two looks of the recorder.
const KEPT_WHILE_RUNNING: usize = (1 << 8) - 1;
/// Cycles kept of messages that come in the order of time: more than a motion can wait.
const KEPT_IN_ORDER: usize = (1 << 5) - 1;

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
#[derive(Debug, Clone, Default)]
pub struct Timeline {
    pace: Pace,
    cycles: VecDeque<CycleMessages>,
    /// Events that were not handed out yet.
    events: Vec<EventRecord>,
    parameters: Option<Parameters>,
    controller_state: Option<u32>,
    truth: Option<Truth>,
    /// Whether the actual pose is the true one, or the estimated one.
    has_truth: bool,
    start: Option<Pose>,
    /// Deadlines that the controller's loop has skipped.
    skipped_cycles: u64,
    /// The motion beside which the run was played.
    pub(crate) reference: Reference,
    controller_cpu: CpuShare,
    plant_cpu: CpuShare,
    /// The newest cycle whose sample a state was computed from.
    newest_reading: u64,
    last_ns: u64,
    is_closed: bool,
}

/// How far apart messages of one cycle come.
#[derive(Debug, Clone, Copy, Default)]
pub enum Pace {
    /// As far as the recorder's queues reach.
    #[default]
    Recorded,
    /// Soon after their cycle: a message that comes 255 cycles late is left out.
    Live,
    /// In the order of time.
    InOrder,
    /// In the order of time, each cycle before the next: a cycle is handed out with the first message of the next one.
    Stepped,
}

impl Timeline {
    /// Of a run of this scenario whose controller declares these.
    pub fn new(scenario: &Scenario, declared: &Declared, pace: Pace) -> Self {
        let (has_truth, reference) = (scenario.can.is_virtual(), Reference::new(scenario, declared));
        Self { pace, has_truth, reference, ..Self::default() }
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
        let kept = match self.pace {
            Pace::Recorded => KEPT,
            Pace::Live => KEPT_WHILE_RUNNING,
            Pace::InOrder => KEPT_IN_ORDER,
            Pace::Stepped => 1,
        };
        if self.cycles.len() > kept { self.hand_out() } else { None }
    }

    /// A state is the solution of the sample that it was computed from first.
    fn state(&mut self, state: &State) {
        if let Some(messages) = self.at(state.cycle) {
            messages.state = Some(*state);
        }
        if state.reading_cycle > self.newest_reading {
            self.newest_reading = state.reading_cycle;
            if let Some(messages) = self.at(state.reading_cycle) {
                messages.solution = Some(*state);
            }
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
        self.reference.apply_event(event);
        self.events.push(event.clone());
    }

    /// The next of the cycles that are left once every message has come. After the last one comes a closing sample
    /// without messages, which holds the later events.
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

    /// The messages of a cycle; `None` if the cycle was handed out, or is impossibly far ahead.
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

    /// The oldest cycle; `None` if it has no message, as a skipped one.
    fn hand_out(&mut self) -> Option<Sample> {
        let mut messages = self.cycles.pop_front()?;
        self.parameters = messages.parameters.or(self.parameters);
        messages.parameters = self.parameters;
        self.controller_state = messages.state.map(|state| state.controller_state).or(self.controller_state);
        messages.controller_state = self.controller_state;
        messages.truth_before = self.truth.filter(|truth| truth.cycle + 1 == messages.cycle);
        self.truth = messages.truth;
        if self.start.is_none() && is_running(messages.controller_state) {
            self.start = messages.actual(self.has_truth);
        }
        messages.start = self.start;
        self.compare_with_motion(&mut messages);
        let controller = messages.state.map(|state| [state.woke_ns, state.worked_ns + state.spun_ns]);
        let plant = messages.reading.map(|reading| [reading.woke_ns, reading.worked_ns + reading.spun_ns]);
        messages.cpu = [self.controller_cpu.of_next(controller), self.plant_cpu.of_next(plant)];
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

    /// Of a sample that the controller did not use, the next one that it used tells how far the motion came, or else its next state.
    fn compare_with_motion(&mut self, messages: &mut CycleMessages) {
        let skipped = |cycle: &CycleMessages| cycle.state.map(|state| state.skipped_cycles);
        let is_counted =
            skipped(messages).or_else(|| self.cycles.iter().take(KEPT_IN_ORDER).find_map(skipped));
        let is_lost = messages.state.is_none() && is_counted.is_none_or(|now| now > self.skipped_cycles);
        self.skipped_cycles = skipped(messages).unwrap_or(self.skipped_cycles);
        let soon = || self.cycles.iter().take(KEPT_IN_ORDER);
        let used = [&*messages].into_iter().chain(soon()).find(|cycle| cycle.solution.is_some());
        let desired = self.reference.advance(&Progress {
            cycle: messages.cycle,
            has_sync: messages.reading.is_some() || messages.truth.is_some(),
            state: messages.controller_state,
            has_run: !is_lost,
            reading: messages.reading.as_ref(),
            // Simulated time has no account of the loops, and no lost cycles.
            is_disturbed: messages.is_disturbed && messages.state.is_some_and(|state| state.worked_ns > 0),
            next_use: used.map_or_else(|| soon().next()?.state.as_ref(), |cycle| cycle.solution.as_ref()),
            is_used: messages.solution.is_some(),
            is_open: messages.truth.is_some_and(|truth| truth.bite_force_n <= 0.0),
            parameters: messages.parameters.as_ref(),
        });
        // What disturbed the next cycle that the controller ran acts on those that it lost.
        let next_run = soon().find(|cycle| cycle.state.is_some());
        messages.is_disturbed |= messages.state.is_none() && next_run.is_some_and(|cycle| cycle.is_disturbed);
        (messages.desired, messages.lag_s) = (desired.pose, desired.lag_s);
        messages.is_awaited = desired.is_awaited;
        messages.progress_s = desired.progress_s;
    }
}

/// Follows the account of a loop.
#[derive(Debug, Clone, Default)]
struct CpuShare {
    last: Option<[u64; 2]>,
}

impl CpuShare {
    /// The share since the message before. `account` has this one's wake-up, and the time that the loop has worked
    /// and spun since the start, ns. None in simulated time, which has no account.
    fn of_next(&mut self, account: Option<[u64; 2]>) -> Option<f64> {
        let [woke_ns, busy_ns] = account.filter(|[_, busy_ns]| *busy_ns > 0)?;
        let [before_ns, busy_before_ns] = self.last.replace([woke_ns, busy_ns])?;
        let elapsed_ns = woke_ns.checked_sub(before_ns).filter(|elapsed_ns| *elapsed_ns > 0)?;
        Some(busy_ns.saturating_sub(busy_before_ns) as f64 / elapsed_ns as f64)
    }
}

#[cfg(test)]
mod tests;
