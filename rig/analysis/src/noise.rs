//! How far a figure would move if nothing had changed.

/// The spread of fewer seconds is unknown.
const FEWEST: usize = 3;

/// Standard error of the mean of one figure's values in each second of a run; none with too few seconds.
pub(super) fn standard_error(seconds: &[f64]) -> Option<f64> {
    if seconds.len() < FEWEST {
        return None;
    }
    let n = seconds.len() as f64;
    let mean = seconds.iter().sum::<f64>() / n;
    let squares: f64 = seconds.iter().map(|value| (value - mean).powi(2)).sum();
    Some((squares / (n - 1.0) / n).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_seconds_have_no_noise_and_few_tell_nothing() {
        assert_eq!(standard_error(&[4.0; 5]), Some(0.0));
        assert_eq!(standard_error(&[1.0, 2.0]), None);
        // Variance 1, three seconds.
        assert!((standard_error(&[1.0, 2.0, 3.0]).unwrap() - (1.0f64 / 3.0).sqrt()).abs() < 1e-12);
    }
}
