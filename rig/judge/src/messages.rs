//! The counts of all messages: their digest, gaps in their numbers, and the values that the controller declares.
//!
//! The digest leaves out times. Simulated runs of the same scenario and seed have the same one, whatever the machine. In real
//! time, lost cycles and the phase of the start change it.

use std::collections::BTreeMap;

use crc32fast::Hasher;
use masseter_recording::{Recorded, Topic};
use masseter_runtime::messages::codes::Source;
use masseter_runtime::messages::{Event, Parameters, Signals};
use masseter_runtime::named::{Parameter, Signal};
use serde::Serialize;

/// Digests each topic by itself, since the recorder drains topic after topic.
#[derive(Debug, Clone, Default)]
pub(super) struct Digest {
    commands: Hasher,
    readings: Hasher,
    states: Hasher,
}

impl Digest {
    pub(super) fn add_message(&mut self, message: &Recorded) {
        let (hasher, cycle, code, numbers): (_, _, _, &[&[f64]]) = match message {
            Recorded::Command(command) => {
                (&mut self.commands, command.cycle, command.request, &[&command.target_m])
            }
            Recorded::Reading(reading) => {
                reading.drive_state.iter().for_each(|state| self.readings.update(&state.to_le_bytes()));
                (&mut self.readings, reading.cycle, reading.fresh_axes, &[&reading.position_m])
            }
            Recorded::State(state) => (
                &mut self.states,
                state.cycle,
                state.controller_state,
                &[&state.desired_position_m, &state.desired_quaternion_wxyz],
            ),
            _ => return,
        };
        hasher.update(&cycle.to_le_bytes());
        hasher.update(&code.to_le_bytes());
        numbers.iter().copied().flatten().for_each(|number| hasher.update(&number.to_le_bytes()));
    }

    /// Eight hexadecimal digits.
    pub(super) fn in_hex(self) -> String {
        let mut all = Hasher::new();
        for topic in [self.commands, self.readings, self.states] {
            all.update(&topic.finalize().to_le_bytes());
        }
        format!("{:08x}", all.finalize())
    }
}

/// Messages and losses of one topic.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct TopicFigures {
    /// The topic.
    pub topic: &'static str,
    /// Messages recorded.
    pub messages: u64,
    /// Messages published before the last recorded one, but not recorded.
    pub missing: u64,
}

/// The process that publishes an event: master, drives and simulated wires are one process. The stimuli of a scenario belong
/// to the process that carries them out.
fn publisher_of(event: &Event) -> u32 {
    if event.is_of_controller() {
        return Source::Controller.code();
    }
    let is_of_plant =
        [Source::Drive, Source::Wire, Source::Scenario].map(Source::code).contains(&event.source);
    if is_of_plant { Source::Master.code() } else { event.source }
}

/// Follows every publisher of every topic. Each counts its own messages from 1.
#[derive(Debug, Clone, Default)]
pub struct SequenceCheck {
    /// Of the topics that one process publishes.
    topics: [Stream; Topic::ALL.len()],
    /// Of the events, by their publisher.
    events: BTreeMap<u32, Stream>,
}

#[derive(Debug, Clone, Copy, Default)]
struct Stream {
    messages: u64,
    highest: u64,
}

impl SequenceCheck {
    /// Counts a message.
    pub fn take(&mut self, message: &Recorded) {
        let stream = match message {
            Recorded::Event(event) => self.events.entry(publisher_of(event)).or_default(),
            _ => &mut self.topics[message.topic() as usize],
        };
        stream.messages += 1;
        stream.highest = stream.highest.max(message.seq());
    }

    /// The counts of every topic.
    pub fn finish(self) -> Vec<TopicFigures> {
        let figures = Topic::ALL.into_iter().map(|topic| {
            let events = self.events.values().filter(|_| topic == Topic::Event);
            let mut figures = TopicFigures { topic: topic.name(), messages: 0, missing: 0 };
            for stream in events.chain([&self.topics[topic as usize]]) {
                figures.messages += stream.messages;
                figures.missing += stream.highest.saturating_sub(stream.messages);
            }
            figures
        });
        let mut figures: Vec<_> = figures.filter(|topic| topic.messages > 0).collect();
        figures.sort_by_key(|topic| topic.topic);
        figures
    }
}

/// A signal over the whole run. Values that are no finite numbers only count.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SignalFigures {
    /// Name, unit and meaning.
    #[serde(flatten)]
    pub signal: Signal,
    /// Finite values.
    pub values: u64,
    /// Other values.
    pub not_finite: u64,
    /// The smallest value; none without any.
    pub min: Option<f64>,
    /// The mean of all cycles.
    pub mean: Option<f64>,
    /// The largest value.
    pub max: Option<f64>,
    /// The last value.
    pub last: Option<f64>,
}

/// A parameter over the whole run.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ParameterFigures {
    /// Name, unit, meaning, range, and the value at the start.
    #[serde(flatten)]
    pub parameter: Parameter,
    /// The value at the end.
    pub last: f64,
    /// How often it was set to another value.
    pub changes: u64,
}

impl SignalFigures {
    /// Without a value yet.
    pub(crate) fn new(signal: &Signal) -> Self {
        let (signal, [min, mean, max, last]) = (signal.clone(), [None; 4]);
        Self { signal, values: 0, not_finite: 0, min, mean, max, last }
    }

    /// Takes the values of all signals.
    pub(crate) fn add_all(all: &mut [Self], message: &Signals) {
        all.iter_mut().zip(message.signals.as_slice()).for_each(|(figures, value)| figures.add_value(*value));
    }

    fn add_value(&mut self, value: f64) {
        if !value.is_finite() {
            self.not_finite += 1;
            return;
        }
        self.values += 1;
        let mean = self.mean.unwrap_or(0.0);
        self.mean = Some(mean + (value - mean) / self.values as f64);
        self.min = Some(self.min.map_or(value, |min| min.min(value)));
        self.max = Some(self.max.map_or(value, |max| max.max(value)));
        self.last = Some(value);
    }
}

impl ParameterFigures {
    /// With its value at the start.
    pub(crate) fn new(parameter: &Parameter) -> Self {
        Self { parameter: parameter.clone(), last: parameter.value, changes: 0 }
    }

    /// Takes the values of all parameters.
    pub(crate) fn add_all(all: &mut [Self], message: &Parameters) {
        for (figures, &value) in all.iter_mut().zip(message.parameters.as_slice()) {
            figures.changes += u64::from(value.to_bits() != figures.last.to_bits());
            figures.last = value;
        }
    }
}

#[cfg(test)]
mod tests;
