//! Named signals of a run, and their values cycle by cycle in the order of time.
//!
//! A [`Registry`] holds every signal that a run of a scenario has. A [`Timeline`] joins the messages of a cycle. The module
//! judges nothing: see [`requirements`](crate::requirements).

mod catalogue;
mod signal;
mod timeline;

use std::sync::Arc;

use masseter_runtime::named::Declared;
use masseter_scenario::{Scenario, input::excerpt, wording::nearest};

use self::{catalogue::signals, signal::Jaw};

pub use signal::NamedSignal;
pub use timeline::{CycleMessages, Pace, Sample, Timeline};

/// There is no signal of that name.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("there is no signal '{}'; masseter signals lists them{question}", excerpt(.name))]
pub struct UnknownSignal {
    name: String,
    /// The most similar name, as a question.
    question: String,
}

impl UnknownSignal {
    /// Whether the controller may declare it: a signal or a parameter of its own.
    pub fn is_of_controller(&self) -> bool {
        self.name.starts_with("signal.") || self.name.starts_with("parameter.")
    }
}

/// The signals of a run.
///
/// ```
/// use masseter_judge::signals::Registry;
/// use masseter_scenario::Scenario;
/// use masseter_runtime::named::Declared;
///
/// let registry = Registry::new(&Scenario::default(), &Declared::default());
/// let place = registry.place_of("incisal.error")?;
/// assert_eq!(registry.signals()[place].unit, "mm");
/// let refusal = registry.place_of("incisal.eror").unwrap_err().to_string();
/// assert!(refusal.ends_with("did you mean 'incisal.error'?"));
/// # Ok::<(), masseter_judge::signals::UnknownSignal>(())
/// ```
#[derive(Debug)]
pub struct Registry(Vec<NamedSignal>);

impl Registry {
    /// The signals of a run of this scenario whose controller declares these.
    pub fn new(scenario: &Scenario, declared: &Declared) -> Self {
        Self(signals(scenario, Jaw::new(scenario), declared))
    }

    /// Every signal.
    pub fn signals(&self) -> &[NamedSignal] {
        &self.0
    }

    /// The place of the signal of that name.
    ///
    /// # Errors
    /// [`UnknownSignal`] with the most similar name.
    pub fn place_of(&self, name: &str) -> Result<usize, UnknownSignal> {
        let place = |name: &str| self.0.iter().position(|signal| signal.name == name);
        place(name).ok_or_else(|| {
            let own = format!("signal.{name}");
            let names = self.0.iter().map(|signal| signal.name.as_str());
            let likely = if place(&own).is_some() { Some(&*own) } else { nearest(name, names) };
            let question = match likely {
                Some(likely) => format!("; did you mean '{likely}'?"),
                None if name.contains('.') => String::new(),
                None => format!(
                    "; one that your program declares is '{}', and masseter signals --controller PROGRAM lists it",
                    excerpt(&own)
                ),
            };
            UnknownSignal { name: name.to_owned(), question }
        })
    }

    /// The value of the signal of that name in a cycle, in its unit. None if the cycle lacks a message.
    ///
    /// # Errors
    /// As [`Self::place_of`].
    pub fn value(&self, name: &str, messages: &CycleMessages) -> Result<Option<f64>, UnknownSignal> {
        let signal = &self.0[self.place_of(name)?];
        Ok(signal.value(messages).map(|si| si / signal.shown().si))
    }
}

/// The values of chosen signals, cycle by cycle.
#[derive(Debug, Clone)]
pub struct Values {
    registry: Arc<Registry>,
    /// The places of the chosen signals.
    chosen: Vec<usize>,
}

impl Values {
    /// None chosen yet.
    pub fn new(registry: Registry) -> Self {
        Self { registry: Arc::new(registry), chosen: Vec::new() }
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
    pub fn take(&self, messages: &CycleMessages, values: &mut Vec<f64>) {
        values.clear();
        let signals = self.registry.signals();
        let value = |&place: &usize| signals[place].value(messages).unwrap_or(f64::NAN);
        values.extend(self.chosen.iter().map(value));
    }
}
