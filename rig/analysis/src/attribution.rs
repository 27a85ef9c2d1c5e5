//! Rig or machine as the cause of overlong stretches of work.
//!
//! A process cannot distinguish a stall of the hypervisor from work that takes long: both use up CPU time. But a stall
//! is as likely while a core spins as while it works. If stalls fall at random, the share of them that hits work is the
//! share of work in the running time. So this module compares two counts: overlong stretches of work, from the
//! shortest that cost a deadline, and stalls of that length while the rig waited. If chance puts so many of both into
//! work with a probability of one percent or more, the machine may be the cause, and the run cannot be judged. A rig
//! that is too slow is slow far more often.
//!
//! Late returns from sleep count as stalls, and sleep does not count as running time. Both choices favour the machine.
//!
//! The price: a fault of the rig that costs one or two deadlines in a run looks like a stall. The timing of such a run is
//! disturbed, never held; a longer run decides.

use serde::Serialize;

use super::skips::{SkipFigures, Skips};

/// Least probability at which the machine may be the cause.
const LEAST_CHANCE: f64 = 0.01;

/// The overlong stretches of work of a run, beside the stalls of the machine.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[doc(alias("root cause", "binomial test"))]
pub struct OverrunAttribution {
    /// Stretches of work at least as long as the shortest that cost a deadline.
    pub while_working: u64,
    /// Stalls of that length while waiting.
    pub while_waiting: u64,
    /// Share of work in the running time, without the stalls.
    pub work_share: f64,
    /// Probability that chance puts so many of both into work.
    pub chance: f64,
}

impl OverrunAttribution {
    /// Counts the processes of a run together, since they share the machine. None if no stretch of work cost a deadline.
    pub(super) fn new(processes: &[&Skips]) -> Option<Self> {
        let least_ns = processes.iter().filter_map(|skips| skips.shortest_costly_ns).min()?;
        let counts = processes.iter().map(|skips| skips.as_long_as(least_ns));
        let (while_waiting, while_working) =
            counts.fold((0, 0), |sum, count| (sum.0 + count.0, sum.1 + count.1));
        let sum_ns = |part: fn(&SkipFigures) -> u64| -> u64 {
            processes.iter().map(|skips| part(&skips.figures)).sum()
        };
        let worked_ns = sum_ns(|figures| figures.worked_ns.saturating_sub(figures.overlong_ns));
        let spun_ns = sum_ns(|figures| figures.spun_ns);
        let work_share = worked_ns as f64 / (worked_ns + spun_ns).max(1) as f64;
        let chance = at_least(while_working, while_working + while_waiting, work_share);
        Some(Self { while_working, while_waiting, work_share, chance })
    }

    /// Whether the machine may be the cause. A single stretch is no evidence against the rig: the same work took its
    /// normal time in every other cycle.
    pub fn may_be_the_machine(&self) -> bool {
        self.while_working <= 1 || self.chance >= LEAST_CHANCE
    }
}

/// Probability that at least `hits` of `n` independent events, each of probability `p`, come true.
fn at_least(hits: u64, n: u64, p: f64) -> f64 {
    if hits == 0 || p >= 1.0 {
        return 1.0;
    }
    if p <= 0.0 {
        return 0.0;
    }
    let odds = (p / (1.0 - p)).ln();
    // Logarithm of the probability of exactly i events, from i = 0 on: the powers alone would underflow.
    let mut exactly = n as f64 * (1.0 - p).ln();
    let mut sum = 0.0;
    for i in 0..=n {
        if i >= hits {
            sum += exactly.exp();
        }
        exactly += ((n - i) as f64 / (i + 1) as f64).ln() + odds;
    }
    sum.min(1.0)
}

#[cfg(test)]
mod tests {
    use super::super::skips::Counters;
    use super::*;

    const PERIOD_NS: u64 = 1_000_000;
    const STALL_NS: u64 = 3_000_000;

    /// A process of 10,000 cycles that works a tenth of its running time; some cycles bring a stall of the
    /// machine, some a stretch of work of the same length.
    fn process(stalls: impl Fn(u64) -> bool, slow: impl Fn(u64) -> bool) -> Skips {
        let mut skips = Skips::default();
        let mut counters = Counters::default();
        for cycle in 0..10_000 {
            counters.worked_ns += PERIOD_NS / 40;
            counters.spun_ns += 9 * PERIOD_NS / 40;
            if stalls(cycle) {
                counters.stalled_ns += STALL_NS;
                counters.skipped += 2;
            }
            if slow(cycle) {
                counters.overlong_ns += STALL_NS;
                counters.worked_ns += STALL_NS;
                counters.skipped += 2;
            }
            counters.seq += 1;
            skips.take(&counters, PERIOD_NS, false);
        }
        skips
    }

    #[test]
    fn a_rig_that_is_too_slow_is_distinguished_from_a_machine_that_stalls() {
        // Every how many cycles the machine stalls while waiting, and work takes too long; whether the
        // machine may have done the latter.
        let cases = [
            ("one stretch, machine quiet", 0, 9_000, true),
            ("one in ten stalls hits work", 500, 4_000, true),
            ("stalls hit work twice as often as they should", 500, 2_000, true),
            ("a slow cycle a second, machine quiet", 0, 1_000, false),
            ("a slow cycle a second, machine restless", 1_000, 999, false),
            ("always slow", 0, 1, false),
            ("always slow, machine restless", 100, 2, false),
        ];
        for (name, stall_every, slow_every, expected) in cases {
            let stalls = |cycle: u64| stall_every > 0 && cycle % stall_every == 7;
            let slow = |cycle: u64| cycle % slow_every == slow_every - 1;
            let attribution = OverrunAttribution::new(&[&process(stalls, slow)]).unwrap();
            assert_eq!(attribution.may_be_the_machine(), expected, "{name}: {attribution:?}");
        }
    }

    #[test]
    fn stalls_seen_by_either_process_speak_for_the_machine() {
        let slow_thrice = process(|_| false, |cycle| cycle % 3_000 == 2_999);
        assert!(!OverrunAttribution::new(&[&slow_thrice]).unwrap().may_be_the_machine());
        let restless = process(|cycle| cycle % 500 == 7, |_| false);
        assert!(OverrunAttribution::new(&[&slow_thrice, &restless]).unwrap().may_be_the_machine());
    }

    #[test]
    fn without_a_costly_stretch_there_is_nothing_to_attribute() {
        assert_eq!(OverrunAttribution::new(&[&process(|cycle| cycle % 100 == 3, |_| false)]), None);
    }

    #[test]
    fn chances_are_those_of_the_binomial_distribution() {
        let cases = [
            (0, 5, 0.3, 1.0),
            (1, 1, 0.03, 0.03),
            (2, 3, 0.5, 0.5),
            (2, 2, 0.1, 0.01),
            (5, 5, 0.0, 0.0),
            (3, 5, 1.0, 1.0),
            (1, 10, 0.1, 1.0 - 0.9_f64.powi(10)),
        ];
        for (hits, n, p, expected) in cases {
            assert!((at_least(hits, n, p) - expected).abs() < 1e-12, "{hits} of {n} at {p}");
        }
        assert!(at_least(100_000, 100_000, 0.3) < 1e-100);
        assert!((at_least(30_000, 100_000, 0.3) - 0.5).abs() < 0.01);
    }
}
