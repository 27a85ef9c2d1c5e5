//! When a fault or a stimulus acts: from an instant on, for a time.
//!
//! Times count from switch-on, from the beginning of the motion, or from another occurrence. This module resolves names;
//! the runtime's `Injection` follows the occurrences of a run.

use std::collections::BTreeMap;

use super::error::ScenarioError;
use super::need::{require_duration, require_not_negative};
use crate::controller_state::ControllerState;
use crate::wording::nearest;

/// What the time of a fault or a stimulus counts from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
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
    /// What `after` can name; none where several entries have the name.
    starts: BTreeMap<String, Option<Start>>,
}

impl<'a> EntryNames<'a> {
    pub(super) fn new(faults: Vec<&'a str>, stimuli: Vec<&'a str>) -> Self {
        let of = |list: &str, name: &str| format!("{list}.{name}");
        let states = ControllerState::ALL.iter();
        let states = states.map(|state| (of("controller", state.name()), Start::State(*state)));
        let named_faults =
            faults.iter().enumerate().map(|(place, name)| (of("fault", name), Start::Fault(place)));
        let named_stimuli = stimuli.iter().enumerate();
        let named_stimuli = named_stimuli.map(|(place, name)| (of("stimulus", name), Start::Stimulus(place)));
        let mut starts = BTreeMap::new();
        for (name, start) in states.chain(named_faults).chain(named_stimuli) {
            starts.entry(name).and_modify(|start| *start = None).or_insert(Some(start));
        }
        Self { faults, stimuli, starts }
    }

    /// The occurrence of that name.
    fn start(&self, name: &str) -> Result<Start, String> {
        match self.starts.get(name) {
            Some(Some(start)) => Ok(*start),
            Some(None) => Err("several entries have this name: give each a name of its own".to_owned()),
            None => {
                let question = nearest(name, self.starts.keys().map(String::as_str))
                    .map_or_else(String::new, |likely| format!("; did you mean '{likely}'?"));
                Err(format!("use fault.NAME, stimulus.NAME or controller.STATE{question}"))
            }
        }
    }
}

/// When something acts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct When {
    /// What the time counts from.
    pub start: Start,
    /// When it begins, s from there.
    pub begin_s: f64,
    /// For how long, s; to the end of the run when absent.
    pub for_s: Option<f64>,
}

/// The keys of an entry that say when, as given.
pub(super) struct WhenKeys<'a> {
    /// The keys' names in messages.
    pub(super) names: [&'static str; 5],
    pub(super) at_s: Option<f64>,
    pub(super) after: Option<&'a str>,
    pub(super) for_s: Option<f64>,
    pub(super) from_s: Option<f64>,
    pub(super) until_s: Option<f64>,
}

impl WhenKeys<'_> {
    /// Resolves the keys.
    pub(super) fn resolve(&self, entries: &EntryNames<'_>) -> Result<When, ScenarioError> {
        let [at, after, for_s, from, until] = self.names;
        let refuse = |key, value: &str, need: &str| Err(ScenarioError::bad(key, &value, need));
        match (self.at_s, self.from_s) {
            (None, None) => return refuse(at, "none", "say when: at_s, in seconds of the motion"),
            (Some(_), Some(_)) => {
                return refuse(
                    from,
                    "given",
                    "give at_s (seconds of the motion) or from_s (since switch-on), not both",
                );
            }
            (Some(at_s), None) => require_not_negative(&[(at, at_s)])?,
            (None, Some(from_s)) => require_not_negative(&[(from, from_s)])?,
        }
        if let Some(given) = self.for_s {
            require_duration(&[(for_s, given)])?;
        }
        if let Some(from_s) = self.from_s {
            if self.after.is_some() {
                return refuse(after, "given", "give it with at_s, which then counts from there");
            }
            if self.for_s.is_some() && self.until_s.is_some() {
                return refuse(for_s, "given", "give for_s or until_s, not both");
            }
            let left_s = self.until_s.map(|until_s| until_s - from_s);
            if left_s.is_some_and(|left_s| !(left_s.is_finite() && left_s > 0.0)) {
                let value = self.until_s.unwrap_or_default();
                return Err(ScenarioError::bad(until, &value, "use a finite number above from_s"));
            }
            return Ok(When { start: Start::SwitchOn, begin_s: from_s, for_s: self.for_s.or(left_s) });
        }
        if self.until_s.is_some() {
            return refuse(until, "given", "give for_s with at_s; until_s goes with from_s");
        }
        let start = match self.after {
            None => Start::State(ControllerState::Running),
            Some(name) => {
                entries.start(name).map_err(|need| ScenarioError::bad(after, &format!("'{name}'"), need))?
            }
        };
        Ok(When { start, begin_s: self.at_s.unwrap_or_default(), for_s: self.for_s })
    }
}
