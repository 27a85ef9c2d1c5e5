//! The values of signals, cycle by cycle.

use std::sync::Arc;

use masseter_runtime::messages::codes::ControllerState;

use super::cycle::CycleMessages;
use super::registry::{Registry, UnknownSignal};
use super::signal::{NamedSignal, Start};

/// The values of chosen signals, cycle by cycle.
#[derive(Debug, Clone)]
pub struct Values {
    registry: Arc<Registry>,
    /// The places of the chosen signals.
    chosen: Vec<usize>,
    start: Start,
}

impl Values {
    /// None chosen yet.
    pub fn new(registry: Registry) -> Self {
        Self { registry: Arc::new(registry), chosen: Vec::new(), start: Start::default() }
    }

    /// Every signal, at its place in the registry.
    pub fn of_all(registry: Registry) -> Self {
        let chosen = (0..registry.signals().len()).collect();
        Self { chosen, ..Self::new(registry) }
    }

    /// Chooses the signal of that name; returns its place among the chosen ones.
    ///
    /// # Errors
    /// As [`Registry::place_of`].
    pub fn choose(&mut self, name: &str) -> Result<usize, UnknownSignal> {
        let place = self.registry.place_of(name)?;
        Ok(self.chosen.iter().position(|chosen| *chosen == place).unwrap_or_else(|| {
            self.chosen.push(place);
            self.chosen.len() - 1
        }))
    }

    /// The chosen signal at that place.
    pub fn signal(&self, chosen: usize) -> &NamedSignal {
        &self.registry.signals()[self.chosen[chosen]]
    }

    /// The values of the chosen signals in a cycle; NaN where the cycle does not have one.
    pub fn take(&mut self, messages: &CycleMessages, values: &mut Vec<f64>) {
        let running = ControllerState::Running.code();
        if self.start.pose.is_none() && messages.state.is_some_and(|state| state.controller_state == running)
        {
            self.start.pose = self.registry.jaw().actual(messages);
        }
        values.clear();
        let signals = self.registry.signals();
        let value = |&place: &usize| signals[place].value(messages, &self.start).unwrap_or(f64::NAN);
        values.extend(self.chosen.iter().map(value));
    }
}
