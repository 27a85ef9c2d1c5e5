//! Triggers: an occurrence, or a condition that begins to hold.

use masseter_shared::config::Scenario;
use masseter_shared::messages::codes::ControllerState;

use super::condition::Condition;
use super::moment::Moment;
use super::occurrence::Occurrence;
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
    /// With whether the condition held at the last sample.
    Edge(Condition, bool),
}

impl Trigger {
    /// Reads an occurrence or a condition. `controller.running` and the like are the beginnings of the controller's states.
    pub(super) fn parse(text: &str, scenario: &Scenario, values: &mut Values) -> Result<Self, String> {
        let text = text.trim();
        let state = text.strip_prefix("controller.").unwrap_or(text);
        let source = match ControllerState::ALL.iter().find(|known| known.name() == state) {
            Some(state) => Source::Edge(Condition::of_state(*state, values)?, false),
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
            Source::Edge(condition, held) => {
                let holds = condition.holds(moment.values);
                let had_held = std::mem::replace(held, holds);
                if holds && !had_held { vec![moment.time_ns] } else { Vec::new() }
            }
        }
    }
}
