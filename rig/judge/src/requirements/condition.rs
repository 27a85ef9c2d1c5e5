//! Conditions on a signal: `bite.force > 5 N`, `controller.state == safe_stop`, or a state of the controller alone.

use masseter_runtime::messages::codes::ControllerState;
use masseter_scenario::{Dimension, Quantity, QuantityError, Scenario, Unit, input::excerpt};

use super::finding::{Finding, Reason};
use super::missing::Phase;
use crate::events::EventRecord;
use crate::signals::{UnknownSignal, Values};

/// What a requirement is read from: the scenario, and the signals, of which it chooses some.
pub(super) struct Lookup<'a> {
    pub(super) scenario: &'a Scenario,
    pub(super) values: &'a mut Values,
}

/// The values and events of one sample.
#[derive(Debug, Clone, Copy)]
pub(super) struct Moment<'a> {
    /// When, ns of the run's clock.
    pub(super) time_ns: u64,
    /// Since the motion began, s; none before.
    pub(super) motion_s: Option<f64>,
    /// The chosen signals; NaN where one is missing.
    pub(super) values: &'a [f64],
    /// The events since the sample before.
    pub(super) events: &'a [EventRecord],
    pub(super) phase: Phase,
    /// Whether a lost cycle may have acted on the jaw.
    pub(super) is_disturbed: bool,
    /// Whether the loops run in real time, where they may lose or delay single cycles.
    pub(super) is_real_time: bool,
    /// Whether it is no sample, but holds the events after the last one.
    pub(super) is_closing: bool,
}

/// The comparison of a condition. `<` and `<=` are alike, since no measured value is exactly a limit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Comparison {
    AtMost,
    AtLeast,
    Equal,
    Unequal,
}

impl Comparison {
    /// Whether it compares numbers, so that there is a margin.
    fn is_of_order(self) -> bool {
        matches!(self, Self::AtMost | Self::AtLeast)
    }
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
    /// Whether the signal is one of the mechanism.
    pub(super) is_truth: bool,
}

impl Condition {
    /// Reads a condition, and chooses its signal.
    pub(super) fn parse(text: &str, values: &mut Values) -> Result<Self, Reason> {
        let text = text.trim();
        if state_of_controller(text).is_some() {
            return Self::parse(&format!("controller.state == {text}"), values);
        }
        let compared = COMPARISONS.into_iter().find_map(|(sign, comparison)| {
            let (name, limit) = text.split_once(sign)?;
            Some((name.trim(), comparison, limit.trim()))
        });
        let example = "write such as \"bite.force > 5 N\" or \"controller.state == running\"";
        let no_condition = || format!("'{}' is no condition: {example}", excerpt(text));
        let (name, comparison, limit) = compared.ok_or_else(no_condition)?;
        let signal = values.choose(name);
        // A controller's own signal is a number: a limit that is no number is wrong, whatever the controller declares.
        if signal.as_ref().is_err_and(UnknownSignal::is_of_controller) {
            limit.parse::<Quantity>().map_err(|error| error.to_string())?;
        }
        let signal = signal?;
        let named = values.signal(signal);
        let (unit, states, is_truth) = (named.shown(), named.states(), named.is_truth);
        let limit = match &states {
            Some(states) => state_code(limit, states)?,
            None => limit_of(limit, unit.dimension)?,
        };
        let misfit = match states {
            Some(_) if comparison.is_of_order() => "states have no order; use == or !=",
            None if !comparison.is_of_order() && unit.dimension != Dimension::One => {
                "a measured value is never exactly a number; use < or >"
            }
            _ => {
                let text = text.to_owned();
                return Ok(Self { text, signal, comparison, limit, unit, is_truth });
            }
        };
        Err(format!("'{}': {misfit}", excerpt(text)).into())
    }

    /// Whether the robustness is a number of the signal's unit.
    pub(super) fn is_numeric(&self) -> bool {
        self.comparison.is_of_order()
    }

    /// How far the condition is from failing, in the signal's SI unit; infinite for states. `None` if the signal is
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
        Finding::share(margin, self.limit)
    }
}

/// The state of the controller with this name.
pub(super) fn state_of_controller(name: &str) -> Option<ControllerState> {
    ControllerState::ALL.iter().copied().find(|state| state.name() == name)
}

/// Whether the text is written as a condition: a comparison, or a state of the controller alone.
pub(super) fn is_condition(text: &str) -> bool {
    has_comparison(text) || state_of_controller(text.trim()).is_some()
}

pub(super) fn has_comparison(text: &str) -> bool {
    text.contains(['<', '>', '='])
}

fn limit_of(text: &str, dimension: Dimension) -> Result<f64, String> {
    let quantity: Quantity = text.parse().map_err(|error: QuantityError| error.to_string())?;
    quantity.si_of(dimension).map_err(|need| format!("'{}': {need}", excerpt(text)))
}

fn state_code(name: &str, states: &[(&'static str, u32)]) -> Result<f64, String> {
    let code = states.iter().find(|(known, _)| *known == name).map(|(_, code)| f64::from(*code));
    code.ok_or_else(|| {
        let names: Vec<_> = states.iter().map(|(known, _)| *known).collect();
        format!("'{}' is no state: use {}", excerpt(name), names.join(", "))
    })
}
