//! The signals of a run by their names.

use masseter_runtime::named::Declared;
use masseter_scenario::Scenario;
use masseter_scenario::input::excerpt;
use masseter_scenario::wording::nearest;

use super::catalogue::signals;
use super::derived::Jaw;
use super::signal::NamedSignal;

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
/// use masseter_analysis::signals::Registry;
/// use masseter_scenario::Scenario;
/// use masseter_runtime::named::Declared;
///
/// let registry = Registry::new(&Scenario::default(), &Declared::default());
/// let place = registry.place_of("incisal.error")?;
/// assert_eq!(registry.signals()[place].unit, "mm");
/// let refusal = registry.place_of("incisal.eror").unwrap_err().to_string();
/// assert!(refusal.ends_with("did you mean 'incisal.error'?"));
/// # Ok::<(), masseter_analysis::signals::UnknownSignal>(())
/// ```
#[derive(Debug)]
pub struct Registry {
    signals: Vec<NamedSignal>,
    jaw: Jaw,
}

impl Registry {
    /// The signals of a run of this scenario whose controller declares these.
    pub fn new(scenario: &Scenario, declared: &Declared) -> Self {
        let jaw = Jaw::new(&scenario.jaw, scenario.can.is_virtual());
        Self { signals: signals(scenario, jaw, declared), jaw }
    }

    /// Every signal.
    pub fn signals(&self) -> &[NamedSignal] {
        &self.signals
    }

    /// The place of the signal of that name.
    ///
    /// # Errors
    /// [`UnknownSignal`] with the most similar name.
    pub fn place_of(&self, name: &str) -> Result<usize, UnknownSignal> {
        self.signals.iter().position(|signal| signal.name == name).ok_or_else(|| {
            let question = nearest(name, self.signals.iter().map(|signal| signal.name.as_str()))
                .map_or_else(String::new, |likely| format!("; did you mean '{likely}'?"));
            UnknownSignal { name: name.to_owned(), question }
        })
    }

    /// The jaw whose points are signals.
    pub(super) fn jaw(&self) -> &Jaw {
        &self.jaw
    }
}
