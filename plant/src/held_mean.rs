//! The mean over time of a value that is held from one change to the next.

/// A held value, and its mean since it was taken last.
#[derive(Debug, Clone, Copy)]
pub(crate) struct HeldMean {
    value: f64,
    /// The value by the time, since `from_ns` and up to `at_ns`.
    value_ns: f64,
    from_ns: u64,
    at_ns: u64,
}

impl HeldMean {
    /// Zero from now on.
    pub(crate) fn new(now_ns: u64) -> Self {
        Self { value: 0.0, value_ns: 0.0, from_ns: now_ns, at_ns: now_ns }
    }

    /// The present value.
    pub(crate) fn value(&self) -> f64 {
        self.value
    }

    /// From now on the value is this one.
    pub(crate) fn hold(&mut self, value: f64, now_ns: u64) {
        self.value_ns += self.value * now_ns.saturating_sub(self.at_ns) as f64;
        (self.value, self.at_ns) = (value, now_ns);
    }

    /// The mean since the last call; the present value where no time has passed.
    pub(crate) fn take(&mut self, now_ns: u64) -> f64 {
        self.hold(self.value, now_ns);
        let passed_ns = now_ns.saturating_sub(self.from_ns);
        let mean = if passed_ns == 0 { self.value } else { self.value_ns / passed_ns as f64 };
        (self.value_ns, self.from_ns) = (0.0, now_ns);
        mean
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_value_counts_as_long_as_it_is_held() {
        let mut mean = HeldMean::new(1000);
        mean.hold(8.0, 1100);
        mean.hold(2.0, 1200);
        assert_eq!(mean.take(1400), (0.0 * 100.0 + 8.0 * 100.0 + 2.0 * 200.0) / 400.0);
        assert_eq!(mean.take(1400), 2.0, "no time has passed");
        mean.hold(5.0, 1500);
        assert_eq!((mean.take(1600), mean.value()), (3.5, 5.0));
    }
}
