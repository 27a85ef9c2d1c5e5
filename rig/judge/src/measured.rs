//! One measured interval: a histogram of the whole run, one of each second, and the noise of its percentiles.

use hdrhistogram::Histogram;
use hdrhistogram::serialization::{Deserializer, Serializer, V2Serializer};
use masseter_runtime::clock::SECOND_NS;
use serde::Serialize;

use crate::statistic::Statistic;

/// Below this many samples the 99.9th percentile rests on fewer than ten of them and is not given.
const SAMPLES_FOR_P999: u64 = 10_000;
/// End of the first bucket of a plot, ns.
const FIRST_BUCKET_NS: u64 = 10;
/// Significant decimal digits of a histogram.
const DIGITS: u8 = 3;

/// One measured interval.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct IntervalFigures {
    /// The measured interval.
    pub name: &'static str,
    /// Samples.
    pub n: u64,
    /// Median, ns; none without samples, as the others.
    pub p50_ns: Option<u64>,
    /// Standard error of the median, by its seconds, ns; none with less than three of them.
    pub p50_noise_ns: Option<f64>,
    /// 99th percentile, ns.
    pub p99_ns: Option<u64>,
    /// Standard error of the 99th percentile, by its seconds, ns.
    pub p99_noise_ns: Option<f64>,
    /// 99.9th percentile, ns; only with at least 10,000 samples.
    pub p999_ns: Option<u64>,
    /// Largest, ns.
    pub max_ns: Option<u64>,
    /// When the largest was, ns of the run's clock.
    pub max_at_ns: Option<u64>,
    /// The distribution, for plots: 1/(1 − quantile) and value in ns.
    #[serde(skip)]
    pub curve: Vec<(f64, u64)>,
    /// Samples in buckets of a tenth of a decade, for plots: the end of the bucket, ns, and how many.
    #[serde(skip)]
    pub buckets: Vec<(u64, u64)>,
    /// The samples of each second, for histogram logs.
    #[serde(skip)]
    pub seconds: Seconds,
}

/// One histogram for each second in which there were samples. Serialised, they take a hundredth of their memory.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Seconds(Vec<(u64, Vec<u8>)>);

impl Seconds {
    fn push(&mut self, began_ns: u64, second: &Histogram<u64>) {
        let mut bytes = Vec::new();
        V2Serializer::new().serialize(second, &mut bytes).expect("memory takes any histogram");
        self.0.push((began_ns, bytes));
    }

    /// The beginning of each second, ns since the first sample, and the histogram of its samples, ns.
    pub fn iter(&self) -> impl Iterator<Item = (u64, Histogram<u64>)> {
        let first_ns = self.0.first().map_or(0, |(began_ns, _)| *began_ns);
        self.0.iter().map(move |(began_ns, bytes)| {
            let second = Deserializer::new().deserialize(&mut bytes.as_slice()).expect("serialised above");
            (began_ns - first_ns, second)
        })
    }
}

/// Durations, ns.
#[derive(Debug, Clone)]
pub(super) struct Durations(pub(super) Histogram<u64>);

impl Default for Durations {
    fn default() -> Self {
        Self(Histogram::new(DIGITS).expect("three digits are allowed"))
    }
}

impl Durations {
    pub(super) fn record(&mut self, value_ns: u64, times: u64) {
        self.0.record_n(value_ns, times).expect("a histogram that resizes itself takes any value");
    }
}

/// Collects the samples of an interval.
#[derive(Debug, Clone, Default)]
pub(super) struct Measured {
    name: &'static str,
    total: Durations,
    max_ns: u64,
    max_at_ns: u64,
    second: Durations,
    second_began_ns: u64,
    seconds: Seconds,
    medians_ns: Vec<f64>,
    p99s_ns: Vec<f64>,
}

/// Width of the bucket that holds this value, ns: a histogram cannot separate closer values.
pub fn resolution_ns(value_ns: u64) -> u64 {
    Durations::default().0.equivalent_range(value_ns)
}

impl Measured {
    pub(super) fn new(name: &'static str) -> Self {
        Self { name, ..Self::default() }
    }

    pub(super) fn add(&mut self, value_ns: u64, at_ns: u64) {
        self.add_steps(value_ns, 1, 0, at_ns);
    }

    /// Adds a value, and `more` of them, each a step above the one before.
    pub(super) fn add_steps(&mut self, value_ns: u64, step_ns: u64, more: u64, at_ns: u64) {
        let more = more.min((u64::MAX - value_ns) / step_ns);
        let largest_ns = value_ns + more * step_ns;
        if largest_ns > self.max_ns || self.total.0.is_empty() {
            (self.max_ns, self.max_at_ns) = (largest_ns, at_ns);
        }
        if at_ns >= self.second_began_ns.saturating_add(SECOND_NS) {
            self.close_second();
            self.second_began_ns = at_ns;
        }
        let (mut value_ns, mut left) = (value_ns, more + 1);
        while left > 0 {
            // Values of one bucket are recorded at once: a damaged message may count any number of skips.
            let alike = ((self.total.0.highest_equivalent(value_ns) - value_ns) / step_ns + 1).min(left);
            self.total.record(value_ns, alike);
            self.second.record(value_ns, alike);
            left -= alike;
            value_ns = value_ns.saturating_add(alike.saturating_mul(step_ns));
        }
    }

    /// Ends a whole second, whose quantiles show the noise.
    fn close_second(&mut self) {
        let Durations(second) = &mut self.second;
        if second.is_empty() {
            return;
        }
        self.medians_ns.push(second.value_at_quantile(0.50) as f64);
        self.p99s_ns.push(second.value_at_quantile(0.99) as f64);
        self.seconds.push(self.second_began_ns, second);
        second.reset();
    }

    pub(super) fn into_figures(mut self) -> IntervalFigures {
        if !self.second.0.is_empty() {
            self.seconds.push(self.second_began_ns, &self.second.0);
        }
        let n = self.total.0.len();
        let measured = |ns: u64| (n > 0).then_some(ns);
        IntervalFigures {
            name: self.name,
            n,
            p50_ns: measured(self.quantile_ns(0.50)),
            p50_noise_ns: standard_error(&self.medians_ns),
            p99_ns: measured(self.quantile_ns(0.99)),
            p99_noise_ns: standard_error(&self.p99s_ns),
            p999_ns: (n >= SAMPLES_FOR_P999).then(|| self.quantile_ns(0.999)),
            max_ns: measured(self.max_ns),
            max_at_ns: measured(self.max_at_ns),
            curve: self.curve(),
            buckets: self.buckets(),
            seconds: self.seconds,
        }
    }

    /// A histogram gives the end of a value's bucket, which may lie beyond the largest value.
    fn quantile_ns(&self, quantile: f64) -> u64 {
        self.total.0.value_at_quantile(quantile).min(self.max_ns)
    }

    fn buckets(&self) -> Vec<(u64, u64)> {
        let steps = self.total.0.iter_log(FIRST_BUCKET_NS, 10_f64.powf(0.1));
        steps.map(|step| (step.value_iterated_to(), step.count_since_last_iteration())).collect()
    }

    /// The distribution as HdrHistogram plots it; the largest value lies where its own share ends.
    fn curve(&self) -> Vec<(f64, u64)> {
        let samples = self.total.0.len() as f64;
        let steps = self.total.0.iter_quantiles(5);
        let points = steps.map(|step| (step.quantile_iterated_to(), step.value_iterated_to()));
        points
            .map(|(quantile, value)| ((1.0 / (1.0 - quantile)).min(samples), value.min(self.max_ns)))
            .collect()
    }
}

/// The spread of fewer seconds is unknown.
const FEWEST_SECONDS: usize = 3;

/// Standard error of the mean of one figure's values in each second of a run; none with too few seconds.
pub(super) fn standard_error(seconds: &[f64]) -> Option<f64> {
    let sd = Statistic::of(seconds).sd.filter(|_| seconds.len() >= FEWEST_SECONDS)?;
    Some(sd / (seconds.len() as f64).sqrt())
}

#[cfg(test)]
mod tests;
