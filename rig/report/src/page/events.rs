//! The events: those of the drives' start, which the page folds, and all others.

use masseter_analysis::{EventRecord, Figures};
use masseter_page::{Block, Content, EventRow, Events, Section};
use masseter_runtime::messages::codes::{ControllerState, EventKind};

use super::times::since_s;
use crate::text;

pub(super) fn section(figures: &Figures) -> Section {
    let row = |event: &EventRecord| {
        let source = event.source.to_string();
        let text = text::event(event);
        let text = text.strip_prefix(&source).map_or(&*text, |rest| rest.trim_start_matches([':', ' ']));
        EventRow {
            at_s: since_s(figures, event.time_ns),
            is_fault: event.kind == EventKind::Fault,
            text: text.to_owned(),
            source,
        }
    };
    let (start, rest) = phases(&figures.events);
    let events = Events { start: start.iter().map(row).collect(), rest: rest.iter().map(row).collect() };
    Section::new("what-happened", "Events", vec![Block::new("events", Content::Events(events))])
}

/// The events until the controller first moves the jaw, and those from then on.
fn phases(events: &[EventRecord]) -> (&[EventRecord], &[EventRecord]) {
    let moves = |event: &EventRecord| {
        event.transition.as_ref().is_some_and(|[_, to]| to == ControllerState::Easing.name())
    };
    events.split_at(events.iter().position(moves).unwrap_or(0))
}
