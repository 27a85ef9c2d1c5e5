//! Figures of the signals and parameters that the controller declares.

use masseter_runtime::messages::{Parameters, Signals};
use masseter_runtime::named::{Declared, Parameter, Signal};
use serde::Serialize;

/// A signal over the whole run. Values that are no finite numbers only count.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SignalFigures {
    /// Name, unit and meaning.
    #[serde(flatten)]
    pub signal: Signal,
    /// Finite values.
    pub values: u64,
    /// Other values.
    pub not_finite: u64,
    /// The smallest value; none without any.
    pub min: Option<f64>,
    /// The mean of all cycles.
    pub mean: Option<f64>,
    /// The largest value.
    pub max: Option<f64>,
    /// The last value.
    pub last: Option<f64>,
}

/// A parameter over the whole run.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ParameterFigures {
    /// Name, unit, meaning, range, and the value at the start.
    #[serde(flatten)]
    pub parameter: Parameter,
    /// The value at the end.
    pub last: f64,
    /// How often it was set to another value.
    pub changes: u64,
}

/// Collects both.
#[derive(Debug, Clone, Default)]
pub(crate) struct NamedWatch {
    signals: Vec<SignalFigures>,
    parameters: Vec<ParameterFigures>,
}

impl NamedWatch {
    pub(crate) fn new(declared: &Declared) -> Self {
        let signal = |signal: &Signal| SignalFigures {
            signal: signal.clone(),
            values: 0,
            not_finite: 0,
            min: None,
            mean: None,
            max: None,
            last: None,
        };
        let parameter = |parameter: &Parameter| ParameterFigures {
            parameter: parameter.clone(),
            last: parameter.value,
            changes: 0,
        };
        Self {
            signals: declared.signals.iter().map(signal).collect(),
            parameters: declared.parameters.iter().map(parameter).collect(),
        }
    }

    pub(crate) fn signals(&mut self, message: &Signals) {
        for (figures, &value) in self.signals.iter_mut().zip(message.signals.as_slice()) {
            figures.take(value);
        }
    }

    pub(crate) fn parameters(&mut self, message: &Parameters) {
        for (figures, &value) in self.parameters.iter_mut().zip(message.parameters.as_slice()) {
            figures.changes += u64::from(value.to_bits() != figures.last.to_bits());
            figures.last = value;
        }
    }

    pub(crate) fn finish(self) -> (Vec<SignalFigures>, Vec<ParameterFigures>) {
        (self.signals, self.parameters)
    }
}

impl SignalFigures {
    fn take(&mut self, value: f64) {
        if !value.is_finite() {
            self.not_finite += 1;
            return;
        }
        self.values += 1;
        let mean = self.mean.unwrap_or(0.0);
        self.mean = Some(mean + (value - mean) / self.values as f64);
        self.min = Some(self.min.map_or(value, |min| min.min(value)));
        self.max = Some(self.max.map_or(value, |max| max.max(value)));
        self.last = Some(value);
    }
}

#[cfg(test)]
mod tests {
    use masseter_runtime::messages::Values;

    use super::*;

    fn values(given: &[f64]) -> Values {
        let mut values = Values::zeros(given.len());
        values.as_mut_slice().copy_from_slice(given);
        values
    }

    #[test]
    fn signals_have_extremes_and_mean_and_changes_of_parameters_are_counted() {
        let signals = vec![Signal { name: "a".into(), unit: "mm".into(), about: String::new() }];
        let declared =
            Declared { signals, parameters: vec![Parameter::new("gain", 1.0)], ..Declared::default() };
        let mut watch = NamedWatch::new(&declared);
        for value in [2.0, f64::NAN, -1.0, 5.0] {
            watch.signals(&Signals { signals: values(&[value]), ..Signals::default() });
        }
        for value in [1.0, 3.0, 3.0, 2.0] {
            watch.parameters(&Parameters { parameters: values(&[value]), ..Parameters::default() });
        }
        let (signals, parameters) = watch.finish();
        let SignalFigures { values, not_finite, min, mean, max, last, .. } = signals[0];
        assert_eq!((values, not_finite), (3, 1));
        assert_eq!([min, mean, max, last], [Some(-1.0), Some(2.0), Some(5.0), Some(5.0)]);
        assert_eq!((parameters[0].parameter.value, parameters[0].last, parameters[0].changes), (1.0, 2.0, 2));
    }
}
