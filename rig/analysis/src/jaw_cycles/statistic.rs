//! Mean and standard deviation of a stream of values.

use serde::Serialize;

/// Mean and standard deviation.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Statistic {
    /// Values.
    pub count: u64,
    /// Their mean; none without a value.
    pub mean: Option<f64>,
    /// Their standard deviation, as of a sample; none with fewer than two.
    pub sd: Option<f64>,
}

/// Collects them (Welford 1962).
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Moments {
    count: u64,
    mean: f64,
    squares: f64,
}

impl Moments {
    pub(super) fn add(&mut self, value: f64) {
        self.count += 1;
        let from_mean = value - self.mean;
        self.mean += from_mean / self.count as f64;
        self.squares += from_mean * (value - self.mean);
    }

    pub(super) fn finish(self) -> Statistic {
        let sd = (self.count > 1).then(|| (self.squares / (self.count - 1) as f64).sqrt());
        Statistic { count: self.count, mean: (self.count > 0).then_some(self.mean), sd }
    }
}
