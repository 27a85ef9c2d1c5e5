//! The time of a fault or a stimulus: from an instant on, for a duration.
//!
//! Times count from switch-on, from the beginning of the motion, or from another occurrence. This module resolves
//! names, and refuses times that count from each other. The runtime's `Injection` follows the occurrences of a run.

use std::{collections::BTreeMap, iter::successors};

use super::control::ControllerState;
use super::error::{Checked, ScenarioError, require};
use crate::wording::question;

/// The start of the time of a fault or a stimulus.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum Start {
    /// The rig is switched on.
    SwitchOn,
    /// The controller commands this state for the first time. The motion begins with `running`.
    State(ControllerState),
    /// The fault with this place in the scenario's list strikes for the first time.
    Fault(usize),
    /// The stimulus with this place in the scenario's list begins.
    Stimulus(usize),
}

/// The names of a scenario's faults and stimuli, which `after` may use.
#[derive(Debug, Clone)]
pub struct EntryNames<'a> {
    /// Of the faults, in their order.
    pub faults: Vec<&'a str>,
    /// Of the stimuli, in their order.
    pub stimuli: Vec<&'a str>,
    /// The valid names of `after`; none for a name of several entries.
    starts: BTreeMap<String, Option<Start>>,
}

impl<'a> EntryNames<'a> {
    pub(super) fn new(faults: Vec<&'a str>, stimuli: Vec<&'a str>) -> Self {
        let states =
            ControllerState::ALL.iter().map(|state| ("controller", state.name(), Start::State(*state)));
        let of_faults = (0..).zip(&faults).map(|(place, name)| ("fault", *name, Start::Fault(place)));
        let of_stimuli = (0..).zip(&stimuli).map(|(place, name)| ("stimulus", *name, Start::Stimulus(place)));
        let mut starts = BTreeMap::new();
        for (list, name, start) in states.chain(of_faults).chain(of_stimuli) {
            let known = starts.entry(format!("{list}.{name}"));
            known.and_modify(|start| *start = None).or_insert(Some(start));
        }
        Self { faults, stimuli, starts }
    }

    /// The occurrence of that name.
    fn start(&self, name: &str) -> Result<Start, String> {
        match self.starts.get(name) {
            Some(Some(start)) => Ok(*start),
            Some(None) => Err("several entries have this name: give each a name of its own".to_owned()),
            None => {
                let question = question(name, self.starts.keys().map(String::as_str));
                Err(format!("use fault.NAME, stimulus.NAME or controller.STATE{question}"))
            }
        }
    }
}

/// The time of a fault or a stimulus.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct When {
    /// The start of the time.
    pub start: Start,
    /// The beginning, s from the start.
    pub begin_s: f64,
    /// The duration, s; to the end of the run when absent.
    pub for_s: Option<f64>,
}

/// The given keys of an entry for its time.
pub(super) struct WhenKeys<'a> {
    pub(super) at_s: Option<f64>,
    pub(super) after: Option<&'a str>,
    pub(super) for_s: Option<f64>,
    pub(super) from_s: Option<f64>,
    pub(super) until_s: Option<f64>,
}

impl WhenKeys<'_> {
    /// Resolves the keys. Their declared ranges are not checked here. A refusal has the name of the key alone.
    pub(super) fn resolve(&self, entries: &EntryNames<'_>) -> Result<When, ScenarioError> {
        match (self.at_s, self.from_s) {
            (None, None) => {
                Err(ScenarioError::bad("at_s", &"none", "say when: at_s, in seconds of the motion"))
            }
            (Some(_), Some(_)) => {
                let need = "give at_s (seconds of the motion) or from_s (since switch-on), not both";
                Err(ScenarioError::bad("from_s", &"given", need))
            }
            (Some(at_s), None) => {
                let need = "give for_s with at_s; until_s goes with from_s";
                require(self.until_s.is_none(), "until_s", &"given", need)?;
                let refused =
                    |name: &str, need: String| ScenarioError::bad("after", &format!("'{name}'"), need);
                let named = self.after.map(|name| entries.start(name).map_err(|need| refused(name, need)));
                let start = named.unwrap_or(Ok(Start::State(ControllerState::Running)))?;
                Ok(When { start, begin_s: at_s, for_s: self.for_s })
            }
            (None, Some(from_s)) => {
                let need = "give it with at_s, which then counts from there";
                require(self.after.is_none(), "after", &"given", need)?;
                let is_one = self.for_s.is_none() || self.until_s.is_none();
                require(is_one, "for_s", &"given", "give for_s or until_s, not both")?;
                let left_s = self.until_s.map(|until_s| until_s - from_s);
                let is_left = left_s.is_none_or(|left_s| left_s.is_finite() && left_s > 0.0);
                let until_s = self.until_s.unwrap_or_default();
                require(is_left, "until_s", &until_s, "use a finite number above from_s")?;
                Ok(When { start: Start::SwitchOn, begin_s: from_s, for_s: self.for_s.or(left_s) })
            }
        }
    }
}

/// Refuses entries whose times count from each other, or from themselves. The starts are in the order of the faults and
/// of the stimuli.
pub(super) fn refuse_circles(faults: &[Start], stimuli: &[Start], entries: &EntryNames<'_>) -> Checked {
    let starts = [faults, stimuli].concat();
    // An entry has the number of its place in both lists, the stimuli behind the faults.
    let before = |entry: usize| match starts[entry] {
        Start::Fault(place) => Some(place),
        Start::Stimulus(place) => Some(faults.len() + place),
        Start::SwitchOn | Start::State(_) => None,
    };
    // The first walk that reaches each entry, so that the search looks at every entry once.
    let mut first_walk = vec![None; starts.len()];
    for walk in 0..starts.len() {
        for entry in successors(Some(walk), |entry| before(*entry)) {
            match first_walk[entry] {
                None => first_walk[entry] = Some(walk),
                Some(first) if first == walk => return Err(refuse_circle(entry, before, entries)),
                Some(_) => break,
            }
        }
    }
    Ok(())
}

/// The refusal of a circle, from its first entry on.
fn refuse_circle(
    on_it: usize,
    before: impl Fn(usize) -> Option<usize> + Copy,
    entries: &EntryNames<'_>,
) -> ScenarioError {
    let EntryNames { faults, stimuli, .. } = entries;
    let round = |from| successors(Some(from), move |entry| before(*entry).filter(|next| *next != from));
    let first = round(on_it).min().unwrap_or(on_it);
    let name = |entry: usize| match faults.get(entry) {
        Some(fault) => format!("fault.{fault}"),
        None => format!("stimulus.{}", stimuli[entry - faults.len()]),
    };
    let circle = round(first).chain([first]).map(name).collect::<Vec<_>>().join(" after ");
    let need = "these times count from each other, so nothing of them begins: let one count from the motion";
    let stimulus = first.checked_sub(faults.len());
    let (key, number) = stimulus.map_or(("faults.after", first), |number| ("stimulus.after", number));
    ScenarioError::bad(key, &circle, need).of_entry(number)
}
