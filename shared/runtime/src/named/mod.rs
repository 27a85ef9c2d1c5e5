//! The named numbers of a controller: signals, which the controller publishes, and parameters, which its user sets.
//!
//! A controller [declares](Declared) both once, before the start. The recording keeps the checked declaration.
//! [`NamedValues`] holds the values of a run. [`access`] gives other programs access to the parameters. This module
//! does not interpret a parameter.

pub mod access;
mod declared;

use std::sync::atomic::{AtomicU64, Ordering};
use std::{array, collections::BTreeMap, sync::Arc};

use crate::messages::codes::{Cause, EventKind, Source};
use crate::messages::{Event, MOST_VALUES, Values};

pub use declared::{Declared, NameError, Parameter, PlayedMotion, Signal};

/// The user's values of the parameters. Any thread may set a value; the loop that takes values over never waits.
#[derive(Debug)]
pub struct Settings {
    declared: Declared,
    /// The bits of each value.
    wanted: [AtomicU64; MOST_VALUES],
}

impl Settings {
    fn new(declared: Declared) -> Self {
        let value = |place: usize| declared.parameters.get(place).map_or(0.0, |parameter| parameter.value);
        let wanted = array::from_fn(|place| AtomicU64::new(value(place).to_bits()));
        Self { declared, wanted }
    }

    /// The controller's declaration.
    pub fn declared(&self) -> &Declared {
        &self.declared
    }

    /// The set value of a parameter, in force from the next cycle on at the latest.
    pub fn value(&self, place: usize) -> f64 {
        f64::from_bits(self.wanted[place].load(Ordering::Relaxed))
    }

    /// Sets the parameter at this place to a value within its range.
    pub(crate) fn store(&self, place: usize, value: f64) {
        self.wanted[place].store(value.to_bits(), Ordering::Relaxed);
    }

    /// Sets a parameter.
    ///
    /// # Errors
    /// [`NameError`] for an unknown parameter, or a value beyond its range.
    pub fn set(&self, name: &str, value: f64) -> Result<(), NameError> {
        let place = self.declared.place_of(name)?;
        self.declared.parameters[place].check(value)?;
        self.store(place, value);
        Ok(())
    }
}

/// A parameter with a new value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Change {
    /// The place of the parameter.
    pub place: usize,
    /// Its value before.
    pub from: f64,
    /// Its value from now on.
    pub to: f64,
}

impl Change {
    /// The event of the change in this cycle.
    pub fn event(&self, cycle: u64, time_ns: u64) -> Event {
        Event {
            time_ns,
            cycle,
            object: self.place as u32,
            value: self.to,
            limit: self.from,
            ..Event::new(Source::Controller, EventKind::Notice, Cause::ParameterSet)
        }
    }
}

/// The values of a controller's signals and parameters in a run.
#[derive(Debug)]
pub struct NamedValues {
    settings: Arc<Settings>,
    parameters: Values,
    signals: Values,
    is_changed: bool,
}

impl Clone for NamedValues {
    /// A copy of the values with independent settings.
    fn clone(&self) -> Self {
        let Self { settings, parameters, signals, is_changed } = self;
        let wanted = array::from_fn(|place| AtomicU64::new(settings.value(place).to_bits()));
        let settings = Arc::new(Settings { declared: settings.declared.clone(), wanted });
        Self { settings, parameters: *parameters, signals: *signals, is_changed: *is_changed }
    }
}

impl NamedValues {
    /// The values at the start: the declared values, or those given for parameters by their names.
    ///
    /// # Errors
    /// [`NameError`] for an invalid declaration, or for given values that do not fit.
    pub fn new(declared: Declared, given: &BTreeMap<String, f64>) -> Result<Self, NameError> {
        let declared = declared.with(given)?;
        let mut parameters = Values::zeros(declared.parameters.len());
        let values = declared.parameters.iter().map(|parameter| parameter.value);
        parameters.as_mut_slice().iter_mut().zip(values).for_each(|(place, value)| *place = value);
        let signals = Values::zeros(declared.signals.len());
        let is_changed = !declared.parameters.is_empty();
        Ok(Self { settings: Arc::new(Settings::new(declared)), parameters, signals, is_changed })
    }

    /// The user's values of the parameters.
    pub fn settings(&self) -> &Arc<Settings> {
        &self.settings
    }

    /// The parameters in force.
    pub fn parameters(&self) -> &[f64] {
        self.parameters.as_slice()
    }

    /// The signals, for writing.
    pub fn signals_mut(&mut self) -> &mut [f64] {
        self.signals.as_mut_slice()
    }

    /// The signals of a cycle, if any are declared.
    pub fn signals(&self) -> Option<Values> {
        (self.signals.length > 0).then_some(self.signals)
    }

    /// Takes over one parameter with a set value other than the value in force. A cycle takes over at most one, so that
    /// its work is bounded.
    pub fn take_change(&mut self) -> Option<Change> {
        let changed = |(place, value): (usize, &f64)| {
            let to = self.settings.value(place);
            (to.to_bits() != value.to_bits()).then_some(Change { place, from: *value, to })
        };
        let change = self.parameters.as_slice().iter().enumerate().find_map(changed)?;
        self.parameters.values[change.place] = change.to;
        self.is_changed = true;
        Some(change)
    }

    /// The parameters, once after the start and once after each change.
    pub fn take_changed_parameters(&mut self) -> Option<Values> {
        std::mem::take(&mut self.is_changed).then_some(self.parameters)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cycle_takes_one_change_over() {
        let parameters = ["a", "b"].map(|name| Parameter { range: [0.0, 9.0], ..Parameter::new(name, 1.0) });
        let declared = Declared { parameters: parameters.to_vec(), ..Declared::default() };
        let mut named = NamedValues::new(declared, &BTreeMap::new()).unwrap();
        assert_eq!(named.take_changed_parameters().unwrap().as_slice(), [1.0, 1.0]);
        assert_eq!((named.take_change(), named.take_changed_parameters()), (None, None));
        let settings = Arc::clone(named.settings());
        settings.set("b", 5.0).unwrap();
        settings.set("a", 4.0).unwrap();
        assert!(settings.set("a", 10.0).is_err() && settings.set("c", 1.0).is_err());
        assert_eq!(named.take_change(), Some(Change { place: 0, from: 1.0, to: 4.0 }));
        assert_eq!(named.take_changed_parameters().unwrap().as_slice(), [4.0, 1.0]);
        assert_eq!(named.take_change(), Some(Change { place: 1, from: 1.0, to: 5.0 }));
        assert_eq!(named.take_change(), None);
    }
}
