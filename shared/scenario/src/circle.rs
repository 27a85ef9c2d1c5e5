//! Circles among the faults and stimuli of a scenario: entries whose times count from each other never begin.

use std::iter::successors;

use super::error::ScenarioError;
use super::when::{EntryNames, Start};

/// Refuses entries whose times count from each other, or from themselves. The starts are those of the faults and of the
/// stimuli, in their order.
pub(super) fn refuse_circles(
    faults: &[Start],
    stimuli: &[Start],
    entries: &EntryNames<'_>,
) -> Result<(), ScenarioError> {
    let before = |start: Start| match start {
        Start::Fault(place) => faults.get(place).copied(),
        Start::Stimulus(place) => stimuli.get(place).copied(),
        Start::SwitchOn | Start::State(_) => None,
    };
    let place = |start: Start| match start {
        Start::Fault(place) => Some(place),
        Start::Stimulus(place) => Some(faults.len() + place),
        Start::SwitchOn | Start::State(_) => None,
    };
    let all = (0..faults.len()).map(Start::Fault).chain((0..stimuli.len()).map(Start::Stimulus));
    // The walk that first came to each entry: every entry is looked at once.
    let mut first_walk = vec![None; faults.len() + stimuli.len()];
    for (walk, entry) in all.enumerate() {
        for start in successors(Some(entry), |start| before(*start)) {
            let Some(there) = place(start).map(|place| &mut first_walk[place]) else { break };
            match there {
                None => *there = Some(walk),
                Some(first) if *first == walk => return Err(circle(start, before, place, entries)),
                Some(_) => break,
            }
        }
    }
    Ok(())
}

/// The refusal of a circle, told from its first entry on.
fn circle(
    on_it: Start,
    before: impl Fn(Start) -> Option<Start> + Copy,
    place: impl Fn(Start) -> Option<usize>,
    entries: &EntryNames<'_>,
) -> ScenarioError {
    let round = |from| successors(Some(from), move |start| before(*start).filter(|next| *next != from));
    let first = round(on_it).min_by_key(|start| place(*start)).unwrap_or(on_it);
    let names = round(first).chain([first]).map(|start| name(start, entries));
    let circle = names.collect::<Vec<_>>().join(" after ");
    let need = "these times count from each other, so nothing of them begins: let one count from the motion";
    let (key, number) = match first {
        Start::Stimulus(number) => ("stimulus.after", number),
        Start::Fault(number) => ("faults.after", number),
        Start::SwitchOn | Start::State(_) => ("faults.after", 0),
    };
    ScenarioError::bad(key, &circle, need).of_entry(number)
}

fn name(start: Start, entries: &EntryNames<'_>) -> String {
    match start {
        Start::Fault(place) => format!("fault.{}", entries.faults[place]),
        Start::Stimulus(place) => format!("stimulus.{}", entries.stimuli[place]),
        Start::SwitchOn => "switch-on".to_owned(),
        Start::State(state) => format!("controller.{}", state.name()),
    }
}
