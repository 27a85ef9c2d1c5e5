//! The signals of a run by their names.

use masseter_shared::config::Scenario;
use masseter_shared::named::Declared;
use masseter_shared::wording::nearest;

use super::catalogue::signals;
use super::derived::Jaw;
use super::signal::NamedSignal;

/// The signals of a run.
///
/// ```
/// use masseter_analysis::signals::Registry;
/// use masseter_shared::config::Scenario;
/// use masseter_shared::named::Declared;
///
/// let registry = Registry::new(&Scenario::default(), &Declared::default());
/// let place = registry.place_of("incisal.error")?;
/// assert_eq!(registry.signals()[place].unit, "mm");
/// assert!(registry.place_of("incisal.eror").unwrap_err().ends_with("did you mean 'incisal.error'?"));
/// # Ok::<(), String>(())
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
    /// A sentence with the most similar name.
    pub fn place_of(&self, name: &str) -> Result<usize, String> {
        self.signals.iter().position(|signal| signal.name == name).ok_or_else(|| {
            let question = nearest(name, self.signals.iter().map(|signal| signal.name.as_str()))
                .map_or_else(String::new, |likely| format!("; did you mean '{likely}'?"));
            format!("there is no signal '{name}'; masseter signals lists them{question}")
        })
    }

    /// The jaw whose points are signals.
    pub(super) fn jaw(&self) -> &Jaw {
        &self.jaw
    }
}
