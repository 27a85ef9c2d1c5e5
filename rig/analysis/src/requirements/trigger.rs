//! Triggers: an occurrence, or a condition that begins to hold.

use masseter_runtime::messages::{self, codes::ControllerState};
use masseter_scenario::Scenario;

use super::condition::Condition;
use super::moment::Moment;
use super::occurrence::Occurrence;
use super::refusal::Reason;
use crate::events::EventRecord;
use crate::signals::Values;

/// What a requirement waits for.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Trigger {
    /// As written.
    pub(super) text: String,
    source: Source,
}

#[derive(Debug, Clone, PartialEq)]
enum Source {
    Occurrence(Occurrence),
    Entry(StateEntry),
    /// With whether the condition held at the last sample.
    Edge(Condition, bool),
}

/// The controller enters a state. A sample shows the state that was decided after it, so the entry counts at the next one.
#[derive(Debug, Clone, PartialEq)]
struct StateEntry {
    state: ControllerState,
    condition: Condition,
    held: bool,
    /// The sample that first showed the state, ns.
    entered_ns: Option<u64>,
}

impl StateEntry {
    /// When the state was entered, if that is known now: by the controller's event, otherwise by the sample.
    fn take(&mut self, moment: &Moment<'_>) -> Option<u64> {
        let is_entry = |event: &&EventRecord| {
            let into = event.transition.as_ref().is_some_and(|[_, to]| to == self.state.name());
            event.source == messages::codes::Source::Controller && into
        };
        let of_event = moment.events.iter().find(is_entry).map(|event| event.time_ns);
        let entered_ns = self.entered_ns.take().map(|sampled_ns| of_event.unwrap_or(sampled_ns));
        // A sample without a state shows no change.
        if let Some(robustness) = self.condition.robustness(moment.values) {
            let had_held = std::mem::replace(&mut self.held, robustness >= 0.0);
            self.entered_ns = (self.held && !had_held).then_some(moment.time_ns);
        }
        entered_ns
    }
}

impl Trigger {
    /// Reads an occurrence or a condition. `controller.running` and the like are the beginnings of the controller's states.
    pub(super) fn parse(text: &str, scenario: &Scenario, values: &mut Values) -> Result<Self, Reason> {
        let text = text.trim();
        let state = text.strip_prefix("controller.").unwrap_or(text);
        let source = match ControllerState::ALL.iter().find(|known| known.name() == state) {
            Some(state) => {
                let condition = Condition::of_state(*state, values)?;
                Source::Entry(StateEntry { state: *state, condition, held: false, entered_ns: None })
            }
            None if text.contains(['<', '>', '=']) => Source::Edge(Condition::parse(text, values)?, false),
            None => Source::Occurrence(Occurrence::parse(text, scenario)?),
        };
        Ok(Self { text: text.to_owned(), source })
    }

    /// The times of what occurs at this sample, each when it occurred, ns.
    pub(super) fn take(&mut self, moment: &Moment<'_>) -> Vec<u64> {
        match &mut self.source {
            Source::Occurrence(occurrence) => {
                let events = moment.events.iter().filter(|event| occurrence.matches(event));
                events.map(|event| event.time_ns).collect()
            }
            Source::Entry(entry) => entry.take(moment).into_iter().collect(),
            Source::Edge(condition, held) => {
                let Some(robustness) = condition.robustness(moment.values) else { return Vec::new() };
                let holds = robustness >= 0.0;
                let had_held = std::mem::replace(held, holds);
                if holds && !had_held { vec![moment.time_ns] } else { Vec::new() }
            }
        }
    }
}
