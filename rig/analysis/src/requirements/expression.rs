//! The quantity that bounds are held against: a signal, or an expression of signals.
//!
//! Expressions are those of the crate `exmex`, in SI units, with signals in braces: `abs({l1.force}) + abs({l2.force})`.

use exmex::{Express, FlatEx};
use masseter_scenario::input::{excerpt, sentence};
use masseter_scenario::{Dimension, RequirementConfig, Unit};

use super::base_exponents::BaseExponents;
use super::dimension::derived;
use super::refusal::{OfKey, Reason, Refused};
use crate::signals::Values;

/// Bytes of the longest expression.
const MOST_BYTES: usize = 4096;
/// Most parentheses around a part of an expression.
const MOST_LEVELS: usize = 64;

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
        let quoted = |reason: &str| format!("'{}': {}", excerpt(text), sentence(reason));
        check_size(text).map_err(|reason| quoted(&reason))?;
        let parsed = exmex::parse::<f64>(text).map_err(|error| quoted(&error.to_string()))?;
        let signals: Vec<_> =
            parsed.var_names().iter().map(|name| values.choose(name)).collect::<Result<_, _>>()?;
        if signals.is_empty() || text.matches('{').count() != text.matches('}').count() {
            return Err(quoted("write signals in braces, such as {l1.force}").into());
        }
        let named: Vec<_> = signals.iter().map(|signal| values.signal(*signal)).collect();
        if let Some(state) = named.iter().find(|signal| signal.states().is_some()) {
            return Err(quoted(&format!("{} is a state, no number", state.name)).into());
        }
        let dimension_of = |name: &str| {
            let place = parsed.var_names().iter().position(|known| known == name);
            place.map_or(Dimension::One, |place| named[place].shown().dimension)
        };
        let derived = derived(text, dimension_of).map_err(|reason| quoted(&reason))?;
        if derived != BaseExponents::of(unit.dimension) {
            return Err(quoted(&format!("its unit is {derived}, not '{}'", unit.name)).into());
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

/// Refuses what would take long to read: the reader's time grows faster than the text.
fn check_size(text: &str) -> Result<(), String> {
    let level = |(now, most): (usize, usize), c: char| match c {
        '(' => (now + 1, most.max(now + 1)),
        ')' => (now.saturating_sub(1), most),
        _ => (now, most),
    };
    let (_, levels) = text.chars().fold((0, 0), level);
    if text.len() > MOST_BYTES {
        return Err(format!("it has {} bytes: write at most {MOST_BYTES}", text.len()));
    }
    if levels > MOST_LEVELS {
        return Err(format!("its parentheses are {levels} levels deep: use at most {MOST_LEVELS}"));
    }
    Ok(())
}
