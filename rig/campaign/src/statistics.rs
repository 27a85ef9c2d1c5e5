//! The share of cases that passed, with its confidence interval.

/// Quantile of the normal distribution for an interval of 95 %.
const Z: f64 = 1.959_963_984_540_054;

/// A share with an interval that covers the true one in 95 of 100 campaigns.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SuccessRate {
    /// Cases that passed.
    pub passed: usize,
    /// Cases that were judged.
    pub judged: usize,
    /// Ends of the interval.
    pub interval: [f64; 2],
}

impl SuccessRate {
    /// The share with the interval of Wilson (1927), which also holds for few cases and for shares near 0 and 1. It means
    /// something for random cases; on a grid it is only a measure of their number.
    pub fn new(passed: usize, judged: usize) -> Self {
        let n = judged as f64;
        let share = if judged == 0 { 0.5 } else { passed as f64 / n };
        let (z_square, n) = (Z * Z, n.max(f64::MIN_POSITIVE));
        let middle = (share + z_square / (2.0 * n)) / (1.0 + z_square / n);
        let half = Z * (share * (1.0 - share) / n + z_square / (4.0 * n * n)).sqrt() / (1.0 + z_square / n);
        let interval = if judged == 0 { [0.0, 1.0] } else { [middle - half, middle + half] };
        Self { passed, judged, interval: interval.map(|end| end.clamp(0.0, 1.0)) }
    }

    /// The share; none without a case.
    pub fn share(&self) -> Option<f64> {
        (self.judged > 0).then(|| self.passed as f64 / self.judged as f64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_interval_is_wilsons() {
        // Newcombe (1998), table I: 81 of 263, and 0 of 20.
        let rate = SuccessRate::new(81, 263);
        assert!((rate.interval[0] - 0.2553).abs() < 5e-5 && (rate.interval[1] - 0.3662).abs() < 5e-5);
        let none = SuccessRate::new(0, 20);
        assert!(none.interval[0] <= 0.0 && (none.interval[1] - 0.1611).abs() < 5e-5);
        let [low, high] = SuccessRate::new(0, 0).interval;
        assert!(low <= 0.0 && high >= 1.0 && SuccessRate::new(0, 0).share().is_none());
    }
}
