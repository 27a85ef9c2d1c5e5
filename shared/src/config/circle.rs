//! Circles among the faults and stimuli of a scenario: entries whose times count from each other never begin.

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
    let lists = [
        ("faults.after", (0..faults.len()).map(Start::Fault).collect::<Vec<_>>()),
        ("stimulus.after", (0..stimuli.len()).map(Start::Stimulus).collect()),
    ];
    for (key, list) in lists {
        for (number, entry) in list.into_iter().enumerate() {
            let chain = std::iter::successors(before(entry), |start| before(*start));
            // A circle is no longer than all entries together.
            let chain: Vec<_> = chain.take(faults.len() + stimuli.len()).collect();
            let Some(end) = chain.iter().position(|start| *start == entry) else { continue };
            let names = std::iter::once(&entry).chain(&chain[..=end]).map(|start| name(*start, entries));
            let circle = names.collect::<Vec<_>>().join(" after ");
            let need =
                "these times count from each other, so nothing of them begins: let one count from the motion";
            return Err(ScenarioError::bad(key, &circle, need).of_entry(number));
        }
    }
    Ok(())
}

fn name(start: Start, entries: &EntryNames<'_>) -> String {
    match start {
        Start::Fault(place) => format!("fault.{}", entries.faults[place]),
        Start::Stimulus(place) => format!("stimulus.{}", entries.stimuli[place]),
        Start::SwitchOn => "switch-on".to_owned(),
        Start::State(state) => format!("controller.{}", state.name()),
    }
}
