//! A recorded run, prepared for its replay: its cycles, and the reading that its controller received in each.

use std::collections::{BTreeMap, VecDeque};
use std::io::{Read, Seek};

use masseter_recording::{Columns, Ending, Manifest, ReadError, Reader, Recorded, Topic};
use masseter_runtime::messages::codes::{Cause, ControllerState, Source};
use masseter_runtime::messages::{Event, Reading, State};

/// Bits of a reading whose axes are all fresh.
const ALL_AXES: u32 = (1 << masseter_model::geometry::AXES) - 1;
/// Topics without a gap in a run that can be replayed.
const NEEDED: [Topic; 6] =
    [Topic::Reading, Topic::Command, Topic::State, Topic::Signals, Topic::Parameters, Topic::Event];

/// Why a run cannot be replayed, and what to do.
#[derive(Debug, thiserror::Error)]
pub(super) enum ReplayError {
    /// Another program controlled the robot.
    #[error(
        "the controller of this run was {}: only those of the rig (motion, hold) can be replayed; 'masseter diff' compares \
         two runs of any program",
        .0.as_deref().unwrap_or("another program")
    )]
    ForeignController(Option<String>),
    /// Messages of a topic are missing.
    #[error(
        "the recording lacks {} on '{topic}', so what the controller received is unknown: record the run again",
        masseter_scenario::wording::counted(*.missing, "message")
    )]
    Gap {
        /// The topic.
        topic: &'static str,
        /// Their number.
        missing: u64,
    },
    /// A part of the file is missing or damaged.
    #[error("the recording is incomplete: 'masseter recording verify' says where; record the run again")]
    Incomplete,
    /// No cycle was recorded.
    #[error("the recording has no cycle of the controller: the run ended before its first")]
    NoCycle,
    /// A state names a reading that is not there.
    #[error("in cycle {cycle} the controller used reading {reading}, which the recording does not have")]
    NoReading {
        /// The cycle.
        cycle: u64,
        /// The cycle of the reading.
        reading: u64,
    },
    /// The file cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
}

/// A run that can be replayed.
#[derive(Debug)]
pub(super) struct RecordedRun {
    /// The fields of its messages.
    pub(super) columns: BTreeMap<Topic, Columns>,
    declared: masseter_runtime::named::Declared,
    pub(super) first_state: State,
    /// The last cycle that is whole: that of a process which died may not be.
    last_cycle: u64,
    /// The events of stops and parameters, by their cycles.
    interventions: VecDeque<Event>,
}

impl RecordedRun {
    /// Reads a recording to its end; refuses one that lacks what the controller received or answered.
    pub(super) fn read<R: Read + Seek>(
        reader: &mut Reader<R>,
        manifest: &Manifest,
    ) -> Result<Self, ReplayError> {
        let mut sequence = masseter_judge::SequenceCheck::default();
        let mut interventions = VecDeque::new();
        let (mut first_state, mut last_cycles) = (None, [0, 0]);
        while let Some(message) = reader.next_message()? {
            sequence.take(&message);
            match message {
                Recorded::Event(event) if is_intervention(&event) => interventions.push_back(event),
                Recorded::State(state) => {
                    first_state.get_or_insert(state);
                    last_cycles = [last_cycles[1], state.cycle];
                }
                _ => {}
            }
        }
        if reader.was_cut_short() || !reader.damage().is_empty() {
            return Err(ReplayError::Incomplete);
        }
        let is_needed = |topic: &str| NEEDED.iter().any(|needed| needed.name() == topic);
        let gap = sequence.finish().into_iter().find(|of| of.missing > 0 && is_needed(of.topic));
        if let Some(masseter_judge::TopicFigures { topic, missing, .. }) = gap {
            return Err(ReplayError::Gap { topic, missing });
        }
        let has_died = matches!(manifest.ending, Ending::Died { .. });
        Ok(Self {
            columns: Columns::of_topics(reader.channels()),
            declared: manifest.declared.clone(),
            first_state: first_state.ok_or(ReplayError::NoCycle)?,
            last_cycle: if has_died { last_cycles[0] } else { last_cycles[1] },
            interventions,
        })
    }

    /// The name of the parameter at this place.
    pub(super) fn parameter(&self, place: usize) -> Option<&str> {
        self.declared.parameters.get(place).map(|parameter| parameter.name.as_str())
    }

    /// Whether the controller published the message in a cycle that is replayed.
    pub(super) fn is_answer(&self, message: &Recorded) -> bool {
        let is_of_controller = match message {
            Recorded::Event(event) => event.is_of_controller(),
            _ => {
                matches!(message.topic(), Topic::Command | Topic::State | Topic::Signals | Topic::Parameters)
            }
        };
        is_of_controller && message.cycle().is_some_and(|cycle| cycle <= self.last_cycle)
    }

    /// The next event of a stop or a parameter in a cycle, or in one that was skipped before it.
    pub(super) fn intervention_in(&mut self, cycle: u64) -> Option<Event> {
        let is_due = self.interventions.front().is_some_and(|event| event.cycle <= cycle);
        is_due.then(|| self.interventions.pop_front()).flatten()
    }
}

fn is_intervention(event: &Event) -> bool {
    let causes = [Cause::StopRequested.code(), Cause::ParameterSet.code()];
    event.source == Source::Controller.code() && causes.contains(&event.cause)
}

/// The readings that the controller has not received yet. They show which reading it received in each recorded cycle.
///
/// A state names the last complete reading that was used, and when the wait for a reading ended. A reading that moved
/// the former on was received. A complete one that did not was late, unless the controller refused it, which stops
/// the jaw. One that lacks an axis was received if it was published before the wait ended.
#[derive(Debug, Default)]
pub(super) struct Deliveries {
    waiting: VecDeque<Reading>,
    published_ns: u64,
    /// The cycle of the last complete reading.
    used: u64,
}

impl Deliveries {
    /// Adds the next reading of the recording.
    pub(super) fn push(&mut self, reading: &Reading) {
        self.published_ns = reading.published_ns;
        self.waiting.push_back(*reading);
    }

    /// Whether every reading that was published until then is here.
    pub(super) fn know_all_until(&self, time_ns: u64) -> bool {
        self.published_ns > time_ns
    }

    /// The reading that the controller received in the cycle of this state; none if it received none.
    pub(super) fn received_in(&mut self, state: &State) -> Result<Option<Reading>, ReplayError> {
        let until = if state.reading_cycle > self.used {
            self.used = state.reading_cycle;
            let place = self.waiting.iter().position(|reading| reading.cycle == state.reading_cycle);
            let lost = ReplayError::NoReading { cycle: state.cycle, reading: state.reading_cycle };
            place.ok_or(lost)? + 1
        } else {
            let in_time = self.waiting.iter().take_while(|reading| reading.published_ns <= state.received_ns);
            let in_time = in_time.count();
            let is_refused = state.controller_state == ControllerState::SafeStop.code();
            let newest = in_time.checked_sub(1).map(|place| &self.waiting[place]);
            if newest.is_none_or(|newest| newest.fresh_axes == ALL_AXES && !is_refused) {
                return Ok(None);
            }
            in_time
        };
        Ok(self.waiting.drain(..until).next_back())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn reading(cycle: u64, fresh_axes: u32) -> Reading {
        Reading { cycle, fresh_axes, published_ns: 1000 * cycle, ..Reading::default() }
    }

    fn state(cycle: u64, reading_cycle: u64, received_ns: u64) -> State {
        State { cycle, reading_cycle, received_ns, ..State::default() }
    }

    fn received(deliveries: &mut Deliveries, state: &State) -> Option<u64> {
        deliveries.received_in(state).unwrap().map(|reading| reading.cycle)
    }

    #[test]
    fn the_reading_that_a_state_used_was_received_and_those_before_it_were_not() {
        let mut deliveries = Deliveries::default();
        (1..=4).for_each(|cycle| deliveries.push(&reading(cycle, ALL_AXES)));
        assert_eq!(received(&mut deliveries, &state(1, 1, 1500)), Some(1));
        assert_eq!(received(&mut deliveries, &state(4, 4, 4500)), Some(4));
        assert!(deliveries.received_in(&state(5, 5, 5500)).is_err(), "it is not recorded");
    }

    #[test]
    fn a_complete_reading_that_was_not_used_was_late_unless_it_led_to_a_stop() {
        let mut deliveries = Deliveries::default();
        (1..=3).for_each(|cycle| deliveries.push(&reading(cycle, ALL_AXES)));
        assert_eq!(received(&mut deliveries, &state(1, 1, 1500)), Some(1));
        assert_eq!(received(&mut deliveries, &state(2, 1, 2000)), None);
        let stop = State { controller_state: ControllerState::SafeStop.code(), ..state(3, 1, 3500) };
        assert_eq!(received(&mut deliveries, &stop), Some(3));
    }

    #[test]
    fn a_reading_without_an_axis_was_received_if_it_was_published_in_time() {
        let mut deliveries = Deliveries::default();
        deliveries.push(&reading(1, 0b01_1111));
        assert_eq!(received(&mut deliveries, &state(1, 0, 999)), None);
        assert_eq!(received(&mut deliveries, &state(2, 0, 1000)), Some(1));
        assert_eq!(received(&mut deliveries, &state(3, 0, 3000)), None, "each is received once");
    }
}
