//! The quantity that bounds are held against: a signal, or an expression of signals.
//!
//! Expressions are those of the crate `exmex`, in SI units, with signals in braces: `abs({l1.force}) + abs({l2.force})`.

use exmex::{Express, FlatEx};
use masseter_shared::config::{Dimension, RequirementConfig, Unit};

use super::base_exponents::BaseExponents;
use super::dimension::derived;
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
    Expression { parsed: Box<FlatEx<f64>>, signals: Vec<usize>, arguments: Vec<f64> },
}

impl Quantified {
    pub(super) fn new(config: &RequirementConfig, values: &mut Values) -> Result<Self, String> {
        match (&config.signal, &config.expression) {
            (Some(name), None) => Self::of_signal(name, values),
            (None, Some(text)) => {
                let name = config.unit.as_deref().unwrap_or_default();
                let unit =
                    Unit::named(name).ok_or_else(|| format!("unit = '{name}': the unit is unknown"))?;
                Self::of_expression(text, unit, values).map_err(|why| format!("expression = '{text}': {why}"))
            }
            _ => Err("give a signal or an expression".to_owned()),
        }
    }

    fn of_signal(name: &str, values: &mut Values) -> Result<Self, String> {
        let signal = values.choose(name)?;
        let named = values.signal(signal);
        if named.states().is_some() {
            return Err(format!("{name} is a state, which has no bounds; use never, or when and then"));
        }
        let (unit, absence) = (named.shown(), named.absence());
        Ok(Self { text: name.to_owned(), unit, absence, source: Source::Signal(signal) })
    }

    fn of_expression(text: &str, unit: Unit, values: &mut Values) -> Result<Self, String> {
        let parsed = exmex::parse::<f64>(text).map_err(|error| error.to_string())?;
        let signals: Vec<_> =
            parsed.var_names().iter().map(|name| values.choose(name)).collect::<Result<_, _>>()?;
        if signals.is_empty() || text.matches('{').count() != text.matches('}').count() {
            return Err("write signals in braces, such as {l1.force}".to_owned());
        }
        let named: Vec<_> = signals.iter().map(|signal| values.signal(*signal)).collect();
        if let Some(state) = named.iter().find(|signal| signal.states().is_some()) {
            return Err(format!("{} is a state, no number", state.name));
        }
        let dimension_of = |name: &str| {
            let place = parsed.var_names().iter().position(|known| known == name);
            place.map_or(Dimension::One, |place| named[place].shown().dimension)
        };
        let derived = derived(text, dimension_of)?;
        if derived != BaseExponents::of(unit.dimension) {
            return Err(format!("its unit is {derived}, not '{}'", unit.name));
        }
        let absences = named.iter().map(|signal| signal.absence());
        Ok(Self {
            text: text.to_owned(),
            unit,
            absence: absences.into_iter().find(|absence| !absence.is_empty()).unwrap_or_default(),
            source: Source::Expression {
                arguments: vec![0.0; signals.len()],
                parsed: Box::new(parsed),
                signals,
            },
        })
    }

    /// The value in SI units; none where a signal is missing.
    pub(super) fn value(&mut self, values: &[f64]) -> Option<f64> {
        match &mut self.source {
            Source::Signal(signal) => Some(values[*signal]).filter(|value| !value.is_nan()),
            Source::Expression { parsed, signals, arguments } => {
                for (argument, signal) in arguments.iter_mut().zip(&*signals) {
                    *argument = values[*signal];
                }
                let has_all = arguments.iter().all(|argument| !argument.is_nan());
                has_all.then(|| parsed.eval(arguments).unwrap_or(f64::NAN))
            }
        }
    }
}
