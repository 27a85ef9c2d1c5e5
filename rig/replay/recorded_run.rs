//! What must be known of a recorded run before its first cycle is replayed.

use std::collections::{BTreeMap, VecDeque};
use std::io::{Read, Seek};

use masseter_analysis::{SequenceCheck, TopicFigures};
use masseter_recording::{Columns, Ending, Manifest, Reader, Recorded, Topic};
use masseter_runtime::messages::codes::{Cause, Source};
use masseter_runtime::messages::{Event, State};
use masseter_runtime::named::Declared;

use super::error::ReplayError;

/// Topics without a gap in a run that can be replayed.
const NEEDED: [Topic; 6] =
    [Topic::Reading, Topic::Command, Topic::State, Topic::Signals, Topic::Parameters, Topic::Event];

/// A run that can be replayed.
#[derive(Debug)]
pub(super) struct RecordedRun {
    columns: BTreeMap<Topic, Columns>,
    declared: Declared,
    first_state: State,
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
        let mut sequence = SequenceCheck::default();
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
        if let Some(TopicFigures { topic, missing, .. }) = gap {
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

    /// The fields of its messages.
    pub(super) fn columns(&self) -> &BTreeMap<Topic, Columns> {
        &self.columns
    }

    pub(super) fn first_state(&self) -> &State {
        &self.first_state
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
