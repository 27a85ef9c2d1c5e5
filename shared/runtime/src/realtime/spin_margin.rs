//! How long before a deadline a task stops sleeping and spins: twice the recent wake-up latency, at most 200 µs and
//! a third of the period.
//!
//! Pure: the latencies come in as arguments; no clock is read here.

/// The longest margin, ns: a later wake-up is rare, and the machine's stalls are longer.
const LONGEST_NS: u64 = 200_000;
/// The shortest margin, ns: entering and leaving the kernel takes this long on a busy core.
const SHORTEST_NS: u64 = 5_000;
/// The margin is at most the period divided by this. Two loops at 10 kHz that spin for half of it starve the recorder
/// (docs/realtime-log.md).
const PARTS_OF_PERIOD: u64 = 3;
/// The margin covers this many times the latency.
const SAFETY_FACTOR: u64 = 2;
/// The surplus of the margin shrinks by one part in 2^12 with each sleep, so that a latency seen once in a thousand
/// cycles stays covered.
const DECAY: u32 = 12;

/// The stretch before a deadline that a task spins, ns.
#[doc(alias("busy wait", "spin time"))]
#[derive(Debug)]
pub(super) struct SpinMargin {
    longest_ns: u64,
    current_ns: u64,
}

impl SpinMargin {
    /// For a task of this period: the longest margin, until sleeps have shown the latency.
    pub(super) fn new(period_ns: u64) -> Self {
        let longest_ns = LONGEST_NS.min(period_ns / PARTS_OF_PERIOD);
        Self { longest_ns, current_ns: longest_ns }
    }

    /// The margin, but at least `least_ns` as far as the period allows, ns.
    pub(super) fn at_least(&self, least_ns: u64) -> u64 {
        self.current_ns.max(least_ns.min(self.longest_ns))
    }

    /// The recent wake-up latency alone, for waits that may end late, ns.
    pub(super) fn latency_ns(&self) -> u64 {
        self.current_ns / SAFETY_FACTOR
    }

    /// Learns from a sleep that ended `latency_ns` late.
    pub(super) fn learn(&mut self, latency_ns: u64) {
        if latency_ns > self.longest_ns {
            // The machine stalled: no margin covers that.
            return;
        }
        let needed_ns = SAFETY_FACTOR * latency_ns + SHORTEST_NS;
        let surplus_ns = self.current_ns.saturating_sub(needed_ns);
        let learned_ns = needed_ns.max(self.current_ns - (surplus_ns >> DECAY));
        self.current_ns = learned_ns.clamp(SHORTEST_NS, self.longest_ns);
    }
}

#[cfg(test)]
mod tests {
    use std::iter::repeat_n;

    use proptest::prelude::*;

    use super::*;

    const PERIOD_NS: u64 = 1_000_000;

    /// The margin at 1 kHz after sleeps of these latencies, ns.
    fn after(latencies: impl IntoIterator<Item = u64>) -> u64 {
        let mut margin = SpinMargin::new(PERIOD_NS);
        latencies.into_iter().for_each(|latency_ns| margin.learn(latency_ns));
        margin.current_ns
    }

    #[test]
    fn the_first_margin_is_the_longest() {
        assert_eq!(SpinMargin::new(PERIOD_NS).current_ns, LONGEST_NS);
        assert_eq!(SpinMargin::new(60_000).current_ns, 20_000);
    }

    #[test]
    fn the_margin_can_be_lengthened_as_far_as_the_period_allows_and_halved_where_a_wait_may_end_late() {
        let mut margin = SpinMargin::new(90_000);
        assert_eq!(
            (margin.current_ns, margin.at_least(50_000), margin.latency_ns()),
            (30_000, 30_000, 15_000)
        );
        repeat_n(1_000, 100_000).for_each(|latency_ns| margin.learn(latency_ns));
        assert_eq!(margin.at_least(10_000), margin.current_ns.max(10_000));
        assert!(margin.current_ns < 20_000);
    }

    #[test]
    fn a_punctual_machine_gets_a_short_margin() {
        let margin_ns = after(repeat_n(10_000, 40_000));
        assert!((25_000..35_000).contains(&margin_ns), "{margin_ns}");
    }

    #[test]
    fn one_late_sleep_is_remembered_for_thousands_of_cycles() {
        let late = |after_it: usize| {
            after(repeat_n(10_000, 40_000).chain([80_000]).chain(repeat_n(10_000, after_it)))
        };
        assert_eq!(late(0), 165_000);
        assert!(late(1000) > 130_000, "{}", late(1000));
        assert!(late(10_000) < 60_000, "{}", late(10_000));
    }

    #[test]
    fn a_stall_that_no_margin_covers_changes_nothing() {
        let punctual = || repeat_n(10_000, 40_000);
        assert_eq!(after(punctual().chain([30_000_000])), after(punctual()));
    }

    proptest! {
        #[test]
        fn the_margin_keeps_its_bounds(
            period_ns in 50_000_u64..100_000_000,
            latencies in prop::collection::vec(0_u64..1_000_000_000, 0..200),
        ) {
            let mut margin = SpinMargin::new(period_ns);
            for latency_ns in latencies {
                margin.learn(latency_ns);
                prop_assert!((SHORTEST_NS..=LONGEST_NS.min(period_ns / PARTS_OF_PERIOD)).contains(&margin.current_ns));
            }
        }
    }
}
