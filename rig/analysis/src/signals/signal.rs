//! A signal: its name, its unit, its meaning, and how its value follows from the messages of a cycle.

use std::fmt;

use masseter_model::geometry::Pose;
use masseter_scenario::{Dimension, Unit};
use serde::Serialize;

use super::cycle::CycleMessages;

/// How a signal's value follows from a cycle; none where the cycle does not have it.
type Extract = Box<dyn Fn(&CycleMessages, &Start) -> Option<f64> + Send + Sync>;

/// What some signals count from: the pose of the jaw in the first cycle of the motion.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Start {
    pub(super) pose: Option<Pose>,
}

/// The names of the values of a state.
pub(super) type StateNames = fn() -> Vec<(&'static str, u32)>;

/// A signal.
#[derive(Serialize)]
pub struct NamedSignal {
    /// Its name, such as `incisal.error`.
    pub name: String,
    /// The name of the unit in which it is shown.
    pub unit: String,
    /// What it is.
    pub about: String,
    #[serde(skip)]
    shown: Unit,
    #[serde(skip)]
    states: Option<StateNames>,
    /// Why it may have no value in a whole run.
    #[serde(skip)]
    absence: &'static str,
    #[serde(skip)]
    extract: Extract,
}

impl fmt::Debug for NamedSignal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} [{}]", self.name, self.unit)
    }
}

impl NamedSignal {
    /// A signal whose value this function gives.
    pub(super) fn new(
        name: String,
        unit: &str,
        about: String,
        extract: impl Fn(&CycleMessages, &Start) -> Option<f64> + Send + Sync + 'static,
    ) -> Self {
        let shown = Unit::named(unit).unwrap_or_else(|| Dimension::One.si_unit());
        let extract = Box::new(extract);
        Self { name, unit: unit.to_owned(), about, shown, states: None, absence: "", extract }
    }

    /// Its values are states with these names.
    pub(super) fn with_states(self, states: StateNames) -> Self {
        Self { states: Some(states), ..self }
    }

    /// Why it may have no value in a whole run.
    pub(super) fn with_absence(self, absence: &'static str) -> Self {
        Self { absence, ..self }
    }

    /// Its value in a cycle of a run with this start.
    pub(super) fn value(&self, messages: &CycleMessages, start: &Start) -> Option<f64> {
        (self.extract)(messages, start)
    }

    /// The unit in which it is shown.
    pub fn shown(&self) -> Unit {
        self.shown
    }

    /// Why it may have no value in a whole run; empty where nothing is known.
    pub(crate) fn absence(&self) -> &'static str {
        self.absence
    }

    /// The names of its values, where it is a state.
    pub fn states(&self) -> Option<Vec<(&'static str, u32)>> {
        self.states.map(|names| names())
    }
}
