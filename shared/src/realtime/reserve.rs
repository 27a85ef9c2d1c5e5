//! How long before a deadline a task stops sleeping: as long as what may come between has lately taken, as long as
//! that leaves the core time for others. Of sleeps that is how late they come back, of preparations how long they take.
//!
//! Pure: it is told what sleeps did and what share of its core the task used, and reads no clock.

use super::load::MOST_USED;

/// More than this helps nothing: sleeps that come back later are rare, and the machine's stalls are longer, ns.
const MOST_NS: u64 = 200_000;
/// The least, ns: what entering and leaving the kernel takes on a busy core.
const LEAST_NS: u64 = 5_000;
/// The reserve takes at most this part of a period: with a half, two loops at 10 kHz starve the logger (7 to 41 % of
/// all messages dropped, none with a third), and a quarter is less than sleeps come back late there (ARCHITECTURE.md).
const MOST_OF_PERIOD: u64 = 3;
/// The reserve aims at this many times the latest lateness, and at the least on top.
const TIMES_LATE: u64 = 2;
/// Sleeps until two thirds of a reserve that was not needed are forgotten, as a power of two: one that is needed
/// once in a thousand cycles stays.
const FORGETTING: u32 = 12;
/// A task that used more than [`MOST_USED`] has a quarter of what it may spin taken from it at each look, and one that did
/// not gets this part of the most back.
const GIVEN_BACK: u64 = 16;

/// The stretch before a deadline that is spun, and its bounds, ns.
#[derive(Debug)]
#[allow(clippy::struct_field_names, reason = "the unit")]
pub(super) struct Reserve {
    most_ns: u64,
    /// What the core has time for.
    allowed_ns: u64,
    current_ns: u64,
}

impl Reserve {
    /// For a task of this period: as much as is allowed, until sleeps have shown what is needed.
    pub(super) fn new(period_ns: u64) -> Self {
        let most_ns = MOST_NS.min(period_ns / MOST_OF_PERIOD);
        Self { most_ns, allowed_ns: most_ns, current_ns: most_ns }
    }

    /// The same, but so long at first.
    pub(super) fn beginning_with(period_ns: u64, first_ns: u64) -> Self {
        let reserve = Self::new(period_ns);
        Self { current_ns: first_ns.min(reserve.most_ns), ..reserve }
    }

    /// The reserve, ns.
    pub(super) fn ns(&self) -> u64 {
        self.current_ns
    }

    /// A sleep came back `late_ns` after its end.
    pub(super) fn learn(&mut self, late_ns: u64) {
        let needed_ns = TIMES_LATE * late_ns + LEAST_NS;
        let wanted_ns = match self.current_ns.checked_sub(needed_ns) {
            Some(spare_ns) => self.current_ns - (spare_ns >> FORGETTING),
            // The machine stood still: no reserve would have covered that.
            None if late_ns > self.most_ns => self.current_ns,
            None => needed_ns,
        };
        self.current_ns = wanted_ns.clamp(LEAST_NS, self.allowed_ns);
    }

    /// The task lately used this share of its core.
    pub(super) fn yield_to_others(&mut self, used: f64) {
        self.allowed_ns = if used > MOST_USED {
            (self.allowed_ns - self.allowed_ns / 4).max(LEAST_NS)
        } else {
            (self.allowed_ns + self.most_ns / GIVEN_BACK).min(self.most_ns)
        };
        self.current_ns = self.current_ns.min(self.allowed_ns);
    }
}

#[cfg(test)]
mod tests {
    use std::iter::repeat_n;

    use proptest::prelude::*;

    use super::*;

    const PERIOD: u64 = 1_000_000;

    /// A task at rest most of the time, whose sleeps come back so late.
    fn after(sleeps: impl IntoIterator<Item = u64>) -> u64 {
        let mut reserve = Reserve::new(PERIOD);
        sleeps.into_iter().for_each(|late_ns| reserve.learn(late_ns));
        reserve.ns()
    }

    #[test]
    fn before_anything_is_known_it_is_as_long_as_allowed() {
        assert_eq!(Reserve::new(PERIOD).ns(), MOST_NS);
        assert_eq!(Reserve::new(60_000).ns(), 20_000);
    }

    #[test]
    fn a_punctual_machine_is_not_spun_on_for_long() {
        assert!(
            (25_000..35_000).contains(&after(repeat_n(10_000, 40_000))),
            "{}",
            after(repeat_n(10_000, 40_000))
        );
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
    fn a_stall_that_no_reserve_covers_teaches_nothing() {
        let punctual = || repeat_n(10_000, 40_000);
        assert_eq!(after(punctual().chain([30_000_000])), after(punctual()));
    }

    /// The share of its core that a task uses in the end which works so long in each period of 50 µs, and whose sleeps
    /// cost and come back late as on a virtual machine.
    fn used_in_the_end(work_ns: u64) -> f64 {
        const PERIOD: u64 = 50_000;
        const SLEEP_COSTS: u64 = 20_000;
        let mut reserve = Reserve::new(PERIOD);
        let looks = (0..1000).map(|_| {
            (0..400).for_each(|_| reserve.learn(28_000));
            let used_ns = work_ns + SLEEP_COSTS + reserve.ns();
            let used = (used_ns as f64 / PERIOD as f64).min(1.0);
            reserve.yield_to_others(used);
            used
        });
        looks.skip(500).sum::<f64>() / 500.0
    }

    #[test]
    fn a_reserve_that_leaves_others_no_time_gives_way_and_comes_back() {
        assert!(used_in_the_end(2_000) < 0.8, "{}", used_in_the_end(2_000));
        for work_ns in [10_000, 14_000, 17_000] {
            let used = used_in_the_end(work_ns);
            assert!((0.75..MOST_USED + 0.02).contains(&used), "{work_ns} ns of work: {used}");
        }
        let mut reserve = Reserve::new(PERIOD);
        (0..100).for_each(|_| reserve.yield_to_others(1.0));
        assert_eq!(reserve.ns(), LEAST_NS);
        (0..100).for_each(|_| reserve.yield_to_others(0.2));
        reserve.learn(60_000);
        assert_eq!(reserve.ns(), 125_000);
    }

    proptest! {
        #[test]
        fn it_keeps_its_bounds_whatever_sleeps_do(
            period_ns in 50_000_u64..100_000_000,
            sleeps in prop::collection::vec((0_u64..1_000_000_000, 0.0..1.0), 0..200),
        ) {
            let mut reserve = Reserve::new(period_ns);
            for (late_ns, used) in sleeps {
                reserve.learn(late_ns);
                reserve.yield_to_others(used);
                prop_assert!((LEAST_NS..=MOST_NS.min(period_ns / MOST_OF_PERIOD)).contains(&reserve.ns()));
            }
        }
    }
}
