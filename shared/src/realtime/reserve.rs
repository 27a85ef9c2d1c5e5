//! How long before a deadline a task stops sleeping and spins: as long as sleeps have lately come back late, as
//! long as that leaves the core time for others.
//!
//! Pure: it is told what sleeps did, and reads no clock.

/// More than this helps nothing: sleeps that come back later are rare, and the machine's stalls are longer, ns.
const MOST_NS: u64 = 200_000;
/// The least, ns: what entering and leaving the kernel takes on a busy core.
const LEAST_NS: u64 = 5_000;
/// The reserve takes at most this part of a period: with a half, two loops at 10 kHz starve the logger (7 to 41 % of
/// all messages dropped, none with a third), and a quarter is less than sleeps come back late there (docs/realtime.md).
const MOST_OF_PERIOD: u64 = 3;
/// The reserve aims at this many times the latest lateness, and at the least on top.
const TIMES_LATE: u64 = 2;
/// Sleeps until two thirds of a reserve that was not needed are forgotten, as a power of two: one that is needed
/// once in a thousand cycles stays.
const FORGETTING: u32 = 12;
/// Share of the time that a task may be awake. Well below the 95 % at which the kernel throttles real-time tasks.
const MOST_AWAKE: f64 = 0.85;
/// Periods over which the share is averaged.
const AWAKE_MEMORY: u64 = 64;

/// The stretch before a deadline that is spun, and what it is learned from.
#[derive(Debug)]
pub(super) struct Reserve {
    most_ns: u64,
    current_ns: u64,
    memory_ns: u64,
    awake: f64,
}

impl Reserve {
    /// For a task of this period: as much as is allowed, until sleeps have shown what is needed.
    pub(super) fn new(period_ns: u64) -> Self {
        let most_ns = MOST_NS.min(period_ns / MOST_OF_PERIOD);
        Self { most_ns, current_ns: most_ns, memory_ns: AWAKE_MEMORY * period_ns, awake: 0.0 }
    }

    /// The reserve, ns.
    pub(super) fn ns(&self) -> u64 {
        self.current_ns
    }

    /// A sleep of `slept_ns` came back `late_ns` after its end; before it the task had been awake for `awake_ns`.
    pub(super) fn learn(&mut self, awake_ns: u64, slept_ns: u64, late_ns: u64) {
        self.remember(awake_ns, slept_ns);
        if self.gives_way() {
            return;
        }
        let needed_ns = TIMES_LATE * late_ns + LEAST_NS;
        let wanted_ns = match self.current_ns.checked_sub(needed_ns) {
            Some(spare_ns) => self.current_ns - (spare_ns >> FORGETTING),
            // The machine stood still: no reserve would have covered that.
            None if late_ns > self.most_ns => self.current_ns,
            None => needed_ns,
        };
        self.current_ns = wanted_ns.clamp(LEAST_NS, self.most_ns);
    }

    /// There was time left, but no more than the reserve: the task has been awake for `awake_ns` and stays so.
    pub(super) fn stay_awake(&mut self, awake_ns: u64) {
        self.remember(awake_ns, 0);
        self.gives_way();
    }

    fn remember(&mut self, awake_ns: u64, slept_ns: u64) {
        let passed_ns = (awake_ns + slept_ns).max(1);
        let weight = (passed_ns as f64 / self.memory_ns as f64).min(1.0);
        self.awake += (awake_ns as f64 / passed_ns as f64 - self.awake) * weight;
    }

    /// Shrinks while the task is awake for too long; whether it is.
    fn gives_way(&mut self) -> bool {
        let is_too_busy = self.awake > MOST_AWAKE;
        if is_too_busy {
            self.current_ns = (self.current_ns - self.current_ns / 16).max(LEAST_NS);
        }
        is_too_busy
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
        sleeps.into_iter().for_each(|late_ns| reserve.learn(PERIOD / 4, PERIOD * 3 / 4, late_ns));
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

    /// The share of the time for which a task is awake in the end that works so long in each period of 50 µs, and whose
    /// sleeps come back in time.
    fn awake_share(work_ns: u64) -> f64 {
        const PERIOD: u64 = 50_000;
        let (mut reserve, mut awake_ns, mut asleep_ns) = (Reserve::new(PERIOD), 0, 0);
        for cycle in 0..20_000 {
            let slept_ns = (PERIOD - work_ns).saturating_sub(reserve.ns());
            if slept_ns > 0 {
                reserve.learn(PERIOD - slept_ns, slept_ns, 0);
            } else {
                reserve.stay_awake(PERIOD);
            }
            if cycle >= 10_000 {
                (awake_ns, asleep_ns) = (awake_ns + PERIOD - slept_ns, asleep_ns + slept_ns);
            }
        }
        awake_ns as f64 / (awake_ns + asleep_ns) as f64
    }

    #[test]
    fn a_reserve_that_leaves_no_time_to_sleep_is_given_up() {
        assert!(awake_share(20_000) < MOST_AWAKE);
        assert!(awake_share(35_000) <= MOST_AWAKE + 0.01, "{}", awake_share(35_000));
        assert!(awake_share(44_000) < 1.0, "{}", awake_share(44_000));
    }

    proptest! {
        #[test]
        fn it_keeps_its_bounds_whatever_sleeps_do(
            period_ns in 50_000_u64..100_000_000,
            sleeps in prop::collection::vec((0_u64..1_000_000_000, 0_u64..1_000_000_000, 0_u64..1_000_000_000), 0..200),
        ) {
            let mut reserve = Reserve::new(period_ns);
            for (awake_ns, slept_ns, late_ns) in sleeps {
                match slept_ns % 3 {
                    0 => reserve.stay_awake(awake_ns),
                    _ => reserve.learn(awake_ns, slept_ns, late_ns),
                }
                prop_assert!((LEAST_NS..=MOST_NS.min(period_ns / MOST_OF_PERIOD)).contains(&reserve.ns()));
            }
        }
    }
}
