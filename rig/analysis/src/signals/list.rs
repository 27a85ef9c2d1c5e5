//! A list of signals that grows.

use super::cycle::CycleMessages;
use super::signal::{NamedSignal, Start, StateNames};

/// Signals, in the order in which they are listed.
#[derive(Debug, Default)]
pub(super) struct SignalList {
    signals: Vec<NamedSignal>,
}

impl SignalList {
    /// Adds a signal whose value a cycle alone gives.
    pub(super) fn add(
        &mut self,
        name: impl Into<String>,
        unit: &str,
        about: impl Into<String>,
        extract: impl Fn(&CycleMessages) -> Option<f64> + Send + Sync + 'static,
    ) {
        self.add_from(name, unit, about, move |messages, _| extract(messages));
    }

    /// Adds a signal whose value counts from the start of the motion.
    pub(super) fn add_from(
        &mut self,
        name: impl Into<String>,
        unit: &str,
        about: impl Into<String>,
        extract: impl Fn(&CycleMessages, &Start) -> Option<f64> + Send + Sync + 'static,
    ) {
        self.push(NamedSignal::new(name.into(), unit, about.into(), extract));
    }

    /// Adds a state, whose values have these names.
    pub(super) fn add_state(
        &mut self,
        name: impl Into<String>,
        about: &str,
        states: StateNames,
        extract: impl Fn(&CycleMessages) -> Option<u32> + Send + Sync + 'static,
    ) {
        let extract = move |messages: &CycleMessages, _: &Start| extract(messages).map(f64::from);
        self.push(NamedSignal::new(name.into(), "", about.to_owned(), extract).with_states(states));
    }

    /// Adds a signal.
    pub(super) fn push(&mut self, signal: NamedSignal) {
        self.signals.push(signal);
    }

    /// All of them.
    pub(super) fn into_signals(self) -> Vec<NamedSignal> {
        self.signals
    }
}
