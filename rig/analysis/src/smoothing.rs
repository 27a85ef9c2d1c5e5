//! The moving mean of values over time, without delay: each mean stands at the middle of its values.

use std::collections::VecDeque;

/// Time that a mean covers, ns.
const WINDOW_NS: u64 = 20_000_000;

/// Smooths `N` values that come together.
#[derive(Debug, Clone, Default)]
pub(super) struct Smoothing<const N: usize> {
    held: VecDeque<(u64, [f64; N])>,
}

impl<const N: usize> Smoothing<N> {
    /// Takes the next values and their time; returns a mean and its time once the window is full.
    pub(super) fn take(&mut self, time_ns: u64, values: [f64; N]) -> Option<(u64, [f64; N])> {
        self.held.push_back((time_ns, values));
        let mut is_full = false;
        while self.held.front()?.0 + WINDOW_NS <= time_ns {
            self.held.pop_front();
            is_full = true;
        }
        let (first_ns, _) = self.held.front()?;
        let count = self.held.len() as f64;
        let mean = |place: usize| self.held.iter().map(|(_, values)| values[place]).sum::<f64>() / count;
        is_full.then(|| (first_ns.midpoint(time_ns), std::array::from_fn(mean)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ramp_stays_a_ramp_and_a_ripple_goes() {
        let mut smoothing = Smoothing::default();
        let mut means = 0;
        for millisecond in 0..100_u64 {
            let ripple = if millisecond % 2 == 0 { 1.0 } else { -1.0 };
            if let Some((at_ns, [ramp, rippled])) =
                smoothing.take(millisecond * 1_000_000, [millisecond as f64, ripple])
            {
                assert!((ramp - at_ns as f64 / 1e6).abs() < 1e-9 && rippled.abs() < 1e-9, "{ramp} {rippled}");
                means += 1;
            }
        }
        assert_eq!(means, 80);
    }
}
