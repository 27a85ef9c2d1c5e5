//! The controller's estimate of the bite force beside the true force: error, stated uncertainty, and how often the
//! uncertainty covers the error. Whether that suffices is a requirement of the scenario, not of this file.

use hdrhistogram::Histogram;
use masseter_runtime::named::Declared;
use serde::{Deserialize, Serialize};

use crate::{poses::is_running, signals::CycleMessages};

/// The signals of the estimate and of its uncertainty.
const SIGNALS: [&str; 2] = ["bite_force_n", "bite_force_uncertainty_n"];
/// A histogram counts micronewtons.
const STEPS_PER_N: f64 = 1e6;
/// Significant decimal digits of a histogram.
const DIGITS: u8 = 3;

/// The estimate in the cycles of the motion.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct BiteEstimateFigures {
    /// Root mean square of the error, N.
    pub error_rms_n: f64,
    /// Median of the error without its sign, N.
    pub error_median_n: f64,
    /// 95 % of the cycles have a smaller error, N: a constant uncertainty of this size would cover them.
    pub error_95_n: f64,
    /// Median of the stated uncertainty, N.
    pub uncertainty_median_n: f64,
    /// Share of the cycles with an estimate in which the uncertainty is at least the error.
    pub covered: f64,
    /// Share of the cycles of the motion without an estimate, as during a calibration.
    pub missing: f64,
    /// Force of which the estimate has less in 95 % of the cycles in which nothing touches the jaw, N; none without such a
    /// cycle.
    pub phantom_n: Option<f64>,
}

/// Compares estimate and truth, cycle by cycle.
#[derive(Debug, Clone)]
pub(super) struct BiteEstimateWatch {
    /// Places of the two signals.
    places: [usize; 2],
    /// Root of the sum of the squared errors, N: also of huge ones the root is a number.
    root_n: f64,
    covered: u64,
    missing: u64,
    errors: Histogram<u64>,
    uncertainties: Histogram<u64>,
    phantoms: Histogram<u64>,
}

impl BiteEstimateWatch {
    /// None where the controller does not estimate the force.
    pub(super) fn new(declared: &Declared) -> Option<Self> {
        let place = |name: &str| declared.signals.iter().position(|signal| signal.name == name);
        let [Some(estimate), Some(uncertainty)] = SIGNALS.map(place) else { return None };
        let histogram = || Histogram::new(DIGITS).expect("three digits are allowed");
        let [errors, uncertainties, phantoms] = std::array::from_fn(|_| histogram());
        let places = [estimate, uncertainty];
        Some(Self { places, root_n: 0.0, covered: 0, missing: 0, errors, uncertainties, phantoms })
    }

    /// Takes a cycle of the motion with the truth; others have no error.
    pub(super) fn add(&mut self, messages: &CycleMessages) {
        let Some(truth) = messages.truth.as_ref().filter(|_| is_running(messages.controller_state)) else {
            return;
        };
        let signals = messages.signals.as_ref().map_or(&[][..], |signals| signals.signals.as_slice());
        let [estimate_n, uncertainty_n] =
            self.places.map(|place| signals.get(place).copied().unwrap_or(f64::NAN));
        let error_n = (estimate_n - truth.bite_force_n).abs();
        if !(error_n + uncertainty_n).is_finite() {
            self.missing += 1;
            return;
        }
        let record = |histogram: &mut Histogram<u64>, value_n: f64| {
            histogram
                .record((value_n * STEPS_PER_N) as u64)
                .expect("a histogram that resizes itself takes any value");
        };
        self.root_n = self.root_n.hypot(error_n);
        self.covered += u64::from(error_n <= uncertainty_n);
        record(&mut self.errors, error_n);
        record(&mut self.uncertainties, uncertainty_n);
        if truth.bite_force_n <= 0.0 {
            record(&mut self.phantoms, error_n);
        }
    }

    /// None without a cycle.
    pub(super) fn into_figures(self) -> Option<BiteEstimateFigures> {
        let count = self.errors.len();
        let at =
            |histogram: &Histogram<u64>, quantile| histogram.value_at_quantile(quantile) as f64 / STEPS_PER_N;
        (count > 0).then(|| BiteEstimateFigures {
            error_rms_n: self.root_n / (count as f64).sqrt(),
            error_median_n: at(&self.errors, 0.5),
            error_95_n: at(&self.errors, 0.95),
            uncertainty_median_n: at(&self.uncertainties, 0.5),
            covered: self.covered as f64 / count as f64,
            missing: self.missing as f64 / (count + self.missing) as f64,
            phantom_n: (!self.phantoms.is_empty()).then(|| at(&self.phantoms, 0.95)),
        })
    }
}

#[cfg(test)]
mod tests {
    use masseter_runtime::messages::codes::ControllerState;
    use masseter_runtime::messages::{Signals, Truth, Values};
    use masseter_runtime::named::Signal;

    use super::*;

    #[test]
    fn figures_are_those_of_the_motion_and_a_cycle_without_an_estimate_is_missing() {
        let signal =
            |name: &str| Signal { name: name.to_owned(), unit: "N".to_owned(), about: String::new() };
        let declared = Declared { signals: SIGNALS.map(signal).to_vec(), ..Declared::default() };
        assert!(BiteEstimateWatch::new(&Declared::default()).is_none());
        let mut watch = BiteEstimateWatch::new(&declared).unwrap();
        // Truth, estimate and uncertainty, N.
        let cycles =
            [(0.0, 3.0, 2.0), (0.0, -1.0, 2.0), (20.0, 20.0, 2.0), (20.0, 18.0, 4.0), (20.0, f64::NAN, 1.0)];
        for (bite_force_n, estimate_n, uncertainty_n) in cycles {
            for state in [ControllerState::Running, ControllerState::Holding] {
                let mut signals = Signals { signals: Values::zeros(2), ..Signals::default() };
                signals.signals.as_mut_slice().copy_from_slice(&[estimate_n, uncertainty_n]);
                watch.add(&CycleMessages {
                    truth: Some(Truth { bite_force_n, ..Truth::default() }),
                    signals: Some(signals),
                    controller_state: Some(state.code()),
                    ..CycleMessages::default()
                });
            }
        }
        let figures = watch.into_figures().unwrap();
        assert!((figures.error_rms_n - 3.5f64.sqrt()).abs() < 1e-9, "{figures:?}");
        assert!((figures.covered - 0.75).abs() < 1e-9, "{figures:?}");
        assert!((figures.missing - 0.2).abs() < 1e-9, "{figures:?}");
        assert!((figures.error_95_n - 3.0).abs() < 0.01, "{figures:?}");
        assert!((figures.uncertainty_median_n - 2.0).abs() < 0.01, "{figures:?}");
        assert!(figures.phantom_n.is_some_and(|most_n| (most_n - 3.0).abs() < 0.01), "{figures:?}");
    }
}
