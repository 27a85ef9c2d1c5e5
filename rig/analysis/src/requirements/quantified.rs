//! The quantity that bounds are held against: a signal, or an expression of signals.

use std::fmt::Display;

use masseter_scenario::input::excerpt;
use masseter_scenario::{RequirementConfig, Unit};

use super::base_exponents::BaseExponents;
use super::expression::Expression;
use super::refusal::{OfKey, Reason, Refused};
use crate::signals::Values;

/// A signal or an expression.
#[derive(Debug, Clone)]
pub(super) struct Quantified {
    /// As written.
    pub(super) text: String,
    /// The unit in which it is shown.
    pub(super) unit: Unit,
    /// Why it may have no value in a whole run; empty where nothing is known.
    pub(super) absence: &'static str,
    source: Source,
}

#[derive(Debug, Clone)]
enum Source {
    Signal(usize),
    Expression { expression: Expression, signals: Vec<usize> },
}

impl Quantified {
    pub(super) fn new(config: &RequirementConfig, values: &mut Values) -> Result<Self, Refused> {
        match (&config.signal, &config.expression) {
            (Some(name), None) => Self::of_signal(name, values).of_key("require.signal"),
            (None, Some(text)) => {
                let name = config.unit.as_deref().unwrap_or_default();
                let unknown =
                    || Refused::new("require.unit", format!("'{}': the unit is unknown", excerpt(name)));
                let unit = Unit::named(name).ok_or_else(unknown)?;
                Self::of_expression(text, unit, values).of_key("require.expression")
            }
            _ => Err(Refused::new("require.expression", "give a signal or an expression")),
        }
    }

    fn of_signal(name: &str, values: &mut Values) -> Result<Self, Reason> {
        let signal = values.choose(name)?;
        let named = values.signal(signal);
        if named.states().is_some() {
            return Err(format!("{name} is a state, which has no bounds; use never, or when and then").into());
        }
        let (unit, absence) = (named.shown(), named.absence());
        Ok(Self { text: name.to_owned(), unit, absence, source: Source::Signal(signal) })
    }

    fn of_expression(text: &str, unit: Unit, values: &mut Values) -> Result<Self, Reason> {
        let quoted = |reason: &dyn Display| format!("'{}': {reason}", excerpt(text));
        let expression = Expression::read(text).map_err(|error| quoted(&error))?;
        let names = expression.signals.iter();
        let signals: Vec<_> = names.map(|name| values.choose(name)).collect::<Result<_, _>>()?;
        if signals.is_empty() {
            return Err(quoted(&"write signals in braces, such as {l1.force}").into());
        }
        let named: Vec<_> = signals.iter().map(|signal| values.signal(*signal)).collect();
        if let Some(state) = named.iter().find(|signal| signal.states().is_some()) {
            return Err(quoted(&format_args!("{} is a state, no number", state.name)).into());
        }
        let derived = expression.dimension(|place| named[place].shown().dimension);
        let derived = derived.map_err(|error| quoted(&error))?;
        if derived != BaseExponents::of(unit.dimension) {
            return Err(quoted(&format_args!("its unit is {derived}, not '{}'", unit.name)).into());
        }
        let absences = named.iter().map(|signal| signal.absence());
        Ok(Self {
            text: text.to_owned(),
            unit,
            absence: absences.into_iter().find(|absence| !absence.is_empty()).unwrap_or_default(),
            source: Source::Expression { expression, signals },
        })
    }

    /// The value in SI units; none where a signal is missing.
    pub(super) fn value(&mut self, values: &[f64]) -> Option<f64> {
        match &mut self.source {
            Source::Signal(signal) => Some(values[*signal]).filter(|value| !value.is_nan()),
            Source::Expression { expression, signals } => {
                let has_all = signals.iter().all(|signal| !values[*signal].is_nan());
                has_all.then(|| expression.value(|place| values[signals[place]]))
            }
        }
    }
}
