//! The signals of a run and the margins of its requirements, step by step, for whoever acts while the run is played.

use masseter_model::geometry::Pose;
use masseter_recording::Recorded;
use masseter_runtime::named::Declared;
use masseter_scenario::{Scenario, input::excerpt};

use crate::signals::{CycleMessages, Pace, Registry, Timeline, UnknownSignal, Values};
use crate::{events::EventRecord, requirements::Requirements};

/// The scenario has no requirement of that name.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("the scenario has no requirement '{}'; {remedy}", excerpt(.name))]
pub struct UnknownRequirement {
    name: String,
    /// The most similar name as a question, or where to write one.
    remedy: String,
}

/// Takes the messages of a run in simulated time, in their order.
#[derive(Debug, Clone)]
pub struct Watch {
    declared: Declared,
    timeline: Timeline,
    requirements: Requirements,
    values: Values,
    /// The last complete cycle, with what the next one has so far in its place.
    messages: CycleMessages,
    events: Vec<EventRecord>,
    row: Vec<f64>,
}

impl Watch {
    /// Of a run of this scenario, whose controller declares these.
    pub fn new(scenario: &Scenario, declared: &Declared) -> Self {
        Self {
            timeline: Timeline::new(scenario, declared, Pace::Stepped),
            requirements: Requirements::new(scenario, declared),
            values: Values::new(Registry::new(scenario, declared)),
            declared: declared.clone(),
            messages: CycleMessages::default(),
            events: Vec::new(),
            row: Vec::new(),
        }
    }

    /// Chooses a signal; returns its place among the values.
    ///
    /// # Errors
    /// Where there is no signal of that name, with the most similar one.
    pub fn choose(&mut self, signal: &str) -> Result<usize, UnknownSignal> {
        self.values.choose(signal)
    }

    /// The place of a requirement.
    ///
    /// # Errors
    /// Where there is no requirement of that name, with the most similar one.
    pub fn requirement(&self, name: &str) -> Result<usize, UnknownRequirement> {
        self.requirements.place_of(name).map_err(|likely| {
            let question = likely.map(|likely| format!("did you mean '{likely}'?"));
            let remedy = question.unwrap_or_else(|| "give one of its [[require]] names".to_owned());
            UnknownRequirement { name: name.to_owned(), remedy }
        })
    }

    /// Takes the next message.
    pub fn take(&mut self, message: &Recorded) {
        if let Some(sample) = self.timeline.take(message) {
            self.requirements.judge_sample(&sample);
            self.messages = CycleMessages { cycle: sample.messages.cycle + 1, ..sample.messages };
        }
        let messages = &mut self.messages;
        match message {
            Recorded::Reading(reading) => messages.reading = Some(*reading),
            Recorded::Truth(truth) => messages.truth = Some(*truth),
            Recorded::Contact(contact) => messages.contact = Some(*contact),
            Recorded::Event(event) => {
                let event = EventRecord::of_run(event, &self.declared, &[]);
                self.timeline.event(&event);
                self.events.push(event);
            }
            _ => {}
        }
    }

    /// The values of the chosen signals, in their units: of the newest reading, and of the last command and state of the
    /// controller. NaN where there is none. `desired` is the pose that the jaw should have at the reading.
    pub fn values(&mut self, desired: Option<Pose>) -> &[f64] {
        self.messages.desired = desired.or(self.messages.desired);
        self.values.take(&self.messages, &mut self.row);
        for (place, value) in self.row.iter_mut().enumerate() {
            *value /= self.values.signal(place).shown().si;
        }
        &self.row
    }

    /// The margin of a requirement up to the last complete cycle, in its unit; none before it shows.
    pub fn margin(&mut self, requirement: usize) -> Option<f64> {
        self.requirements.margin_so_far(requirement)
    }

    /// The events since the last call.
    pub fn take_events(&mut self) -> Vec<EventRecord> {
        std::mem::take(&mut self.events)
    }
}
