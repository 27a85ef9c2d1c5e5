//! Figures of a sample of values: mean, spread, how certain the mean is, and the sums of which checks and requirements take theirs.
//! No test of a hypothesis is here.

use serde::Serialize;

/// Values of one quantity in a few figures. All are none without a value; those of spread with fewer than two.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Statistic {
    /// Values.
    pub count: u64,
    /// Their mean.
    pub mean: Option<f64>,
    /// Their standard deviation, as of a sample.
    pub sd: Option<f64>,
    /// Their median.
    pub median: Option<f64>,
    /// Coefficient of variation: standard deviation by mean; none of a mean of 0.
    pub cv: Option<f64>,
    /// Lower end of the 95 % confidence interval of the mean, by Student's t.
    pub mean_low: Option<f64>,
    /// Its upper end.
    pub mean_high: Option<f64>,
}

impl Statistic {
    /// ```
    /// use masseter_judge::Statistic;
    ///
    /// let of = Statistic::of(&[1.0, 2.0, 4.0, 5.0]);
    /// assert_eq!((of.count, of.mean, of.median), (4, Some(3.0), Some(3.0)));
    /// assert!((of.mean_high.unwrap() - 5.902).abs() < 1e-3);
    /// ```
    #[must_use]
    pub fn of(values: &[f64]) -> Self {
        let mut sorted = values.to_vec();
        sorted.sort_by(f64::total_cmp);
        let (count, middle) = (values.len(), values.len() / 2);
        let Some(&upper) = sorted.get(middle) else { return Self::default() };
        let lower = if count % 2 == 0 { sorted[middle - 1] } else { upper };
        let mean = values.iter().sum::<f64>() / count as f64;
        let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
        let sd = (count > 1).then(|| (squares / (count - 1) as f64).sqrt());
        let half = sd.map(|sd| student_t(count as f64 - 1.0) * sd / (count as f64).sqrt());
        Self {
            count: count as u64,
            mean: Some(mean),
            sd,
            median: Some(f64::midpoint(lower, upper)),
            cv: sd.filter(|_| mean != 0.0).map(|sd| sd / mean.abs()),
            mean_low: half.map(|half| mean - half),
            mean_high: half.map(|half| mean + half),
        }
    }
}

/// Values that come one by one: the rig's own checks and the requirements of a scenario judge the same figures of them.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Sums {
    pub(crate) samples: u64,
    sum: f64,
    pub(crate) squares: f64,
    /// The smallest and the largest value.
    pub(crate) range: Option<[f64; 2]>,
}

impl Sums {
    pub(crate) fn add(&mut self, value: f64) {
        self.samples += 1;
        self.sum += value;
        self.squares += value * value;
        self.peak(value);
    }

    /// Takes a value that counts for the range alone.
    pub(crate) fn peak(&mut self, value: f64) {
        let [least, most] = self.range.unwrap_or([value; 2]);
        self.range = Some([least.min(value), most.max(value)]);
    }

    /// NaN without values, as the root of the mean square.
    pub(crate) fn mean(&self) -> f64 {
        self.sum / self.samples as f64
    }

    pub(crate) fn rms(&self) -> f64 {
        (self.squares / self.samples as f64).sqrt()
    }
}

/// The 97.5 % point of Student's t distribution: exact for one and two degrees of freedom, else the expansion of Cornish and
/// Fisher (Abramowitz and Stegun 26.7.5), 0.1 % off at three degrees and less beyond.
pub fn student_t(freedom: f64) -> f64 {
    const Z: f64 = 1.959_963_984_540_054;
    if freedom < 1.5 {
        return 12.706_204_736;
    }
    if freedom < 2.5 {
        return 4.302_652_730;
    }
    let power = |exponent| Z.powi(exponent);
    let terms = [
        (power(3) + Z) / 4.0,
        (5.0 * power(5) + 16.0 * power(3) + 3.0 * Z) / 96.0,
        (3.0 * power(7) + 19.0 * power(5) + 17.0 * power(3) - 15.0 * Z) / 384.0,
        (79.0 * power(9) + 776.0 * power(7) + 1482.0 * power(5) - 1920.0 * power(3) - 945.0 * Z) / 92_160.0,
    ];
    terms.into_iter().rev().fold(0.0, |sum, term| (sum + term) / freedom) + Z
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn student_t_is_that_of_the_tables() {
        for (freedom, t) in [
            (1.0, 12.706),
            (2.0, 4.303),
            (3.0, 3.182),
            (4.0, 2.776),
            (5.0, 2.571),
            (9.0, 2.262),
            (100.0, 1.984),
        ] {
            assert!((student_t(freedom) / t - 1.0).abs() < 1.5e-3, "{freedom}: {}", student_t(freedom));
        }
    }

    #[test]
    fn spread_needs_two_values_and_a_mean_of_zero_has_no_coefficient_of_variation() {
        let one = Statistic::of(&[3.0]);
        assert_eq!((one.mean, one.sd, one.median, one.mean_low), (Some(3.0), None, Some(3.0), None));
        let about_zero = Statistic::of(&[-1.0, 1.0]);
        assert_eq!((about_zero.mean, about_zero.cv), (Some(0.0), None));
        assert_eq!(Statistic::of(&[]), Statistic::default());
    }
}
