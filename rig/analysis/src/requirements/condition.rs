//! Conditions on a signal: `bite.force > 5 N`, `controller.state == safe_stop`, or a state of the controller alone.

use masseter_runtime::messages::codes::ControllerState;
use masseter_scenario::input::excerpt;
use masseter_scenario::{Dimension, Quantity, Unit};

use super::refusal::Reason;
use crate::signals::Values;

/// The comparison of a condition. `<` and `<=` are alike, since no measured value is exactly a limit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Comparison {
    AtMost,
    AtLeast,
    Equal,
    Unequal,
}

/// The comparisons as they are written, the longer ones first.
const COMPARISONS: [(&str, Comparison); 6] = [
    ("<=", Comparison::AtMost),
    (">=", Comparison::AtLeast),
    ("==", Comparison::Equal),
    ("!=", Comparison::Unequal),
    ("<", Comparison::AtMost),
    (">", Comparison::AtLeast),
];

/// A signal compared with a limit.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Condition {
    /// As written.
    pub(super) text: String,
    signal: usize,
    comparison: Comparison,
    limit: f64,
    /// The unit in which the signal is shown.
    pub(super) unit: Unit,
}

impl Condition {
    /// Reads a condition, and chooses its signal.
    pub(super) fn parse(text: &str, values: &mut Values) -> Result<Self, Reason> {
        let text = text.trim();
        if ControllerState::ALL.iter().any(|state| state.name() == text) {
            return Self::parse(&format!("controller.state == {text}"), values);
        }
        let (name, comparison, limit) = split(text).ok_or_else(|| {
            format!(
                "'{}' is no condition: write such as \"bite.force > 5 N\" or \"controller.state == running\"",
                excerpt(text)
            )
        })?;
        let signal = values.choose(name)?;
        let named = values.signal(signal);
        let unit = named.shown();
        let limit = match named.states() {
            Some(states) => state_code(limit, &states)?,
            None => limit_of(limit, unit.dimension)?,
        };
        let is_state = named.states().is_some();
        if is_state && matches!(comparison, Comparison::AtMost | Comparison::AtLeast) {
            return Err(format!("'{}': states have no order; use == or !=", excerpt(text)).into());
        }
        if !is_state
            && unit.dimension != Dimension::One
            && matches!(comparison, Comparison::Equal | Comparison::Unequal)
        {
            return Err(format!(
                "'{}': a measured value is never exactly a number; use < or >",
                excerpt(text)
            )
            .into());
        }
        Ok(Self { text: text.to_owned(), signal, comparison, limit, unit })
    }

    /// The controller is in that state.
    pub(super) fn of_state(state: ControllerState, values: &mut Values) -> Result<Self, Reason> {
        Self::parse(state.name(), values)
    }

    /// Whether the robustness is a number of the signal's unit.
    pub(super) fn is_numeric(&self) -> bool {
        matches!(self.comparison, Comparison::AtMost | Comparison::AtLeast)
    }

    /// How far the condition is from failing, in the signal's SI unit; infinite for states. None where the signal is
    /// missing.
    pub(super) fn robustness(&self, values: &[f64]) -> Option<f64> {
        let value = values[self.signal];
        let either = |holds: bool| if holds { f64::INFINITY } else { f64::NEG_INFINITY };
        (!value.is_nan()).then(|| match self.comparison {
            Comparison::AtMost => self.limit - value,
            Comparison::AtLeast => value - self.limit,
            Comparison::Equal => either(value.to_bits() == self.limit.to_bits()),
            Comparison::Unequal => either(value.to_bits() != self.limit.to_bits()),
        })
    }

    /// Whether the condition holds; not where the signal is missing.
    pub(super) fn holds(&self, values: &[f64]) -> bool {
        self.robustness(values).is_some_and(|robustness| robustness >= 0.0)
    }

    /// The share of a margin in the limit.
    pub(super) fn share(&self, margin: f64) -> Option<f64> {
        super::finding::Finding::share(margin, self.limit)
    }
}

fn split(text: &str) -> Option<(&str, Comparison, &str)> {
    COMPARISONS.into_iter().find_map(|(sign, comparison)| {
        let (name, limit) = text.split_once(sign)?;
        Some((name.trim(), comparison, limit.trim()))
    })
}

fn limit_of(text: &str, dimension: Dimension) -> Result<f64, String> {
    let quantity: Quantity =
        text.parse().map_err(|error: masseter_scenario::QuantityError| error.to_string())?;
    quantity.si_of(dimension).map_err(|need| format!("'{}': {need}", excerpt(text)))
}

fn state_code(name: &str, states: &[(&'static str, u32)]) -> Result<f64, String> {
    let code = states.iter().find(|(known, _)| *known == name).map(|(_, code)| f64::from(*code));
    code.ok_or_else(|| {
        let names: Vec<_> = states.iter().map(|(known, _)| *known).collect();
        format!("'{}' is no state: use {}", excerpt(name), names.join(", "))
    })
}
