//! When a task begins to prepare for a deadline, whether there is time to do so again, and how much of a repeat was work.
//!
//! Pure: it is told how long preparations took, and reads no clock.

use super::reserve::Reserve;

/// For how long the first preparation is taken to last, ns.
const FIRST_NS: u64 = 40_000;
/// Where less than this is left before the preparations, they would take too large a share of the core, ns.
const WORTH_IT_NS: u64 = 100_000;
/// What takes longer than the same work a moment ago by more than this was held up by the machine, ns.
const HELD_UP_NS: u64 = 50_000;

/// What is known of a task's preparations.
#[derive(Debug)]
pub(super) struct Preparation {
    /// The stretch before a deadline in which it is prepared for.
    lead: Reserve,
    /// How long the last one took, ns.
    last_ns: u64,
}

impl Preparation {
    /// For a task of this period.
    pub(super) fn new(period_ns: u64) -> Self {
        Self { lead: Reserve::beginning_with(period_ns, FIRST_NS), last_ns: u64::MAX }
    }

    /// When to begin with those for a deadline, unless that is too close, ns.
    pub(super) fn begin_ns(&self, now_ns: u64, due_ns: u64) -> Option<u64> {
        let begin_ns = due_ns.saturating_sub(self.lead.ns());
        (begin_ns > now_ns + WORTH_IT_NS).then_some(begin_ns)
    }

    /// The first for a deadline took so long: with cold caches, so that one that was warm hardly takes longer.
    pub(super) fn learn_first(&mut self, took_ns: u64) {
        // Half as long again is enough of a lead: preparations vary less than sleeps.
        self.lead.learn(took_ns * 3 / 4);
        self.last_ns = self.last_ns.min(took_ns);
    }

    /// Whether there is time for another before the deadline.
    pub(super) fn fits(&self, now_ns: u64, due_ns: u64) -> bool {
        now_ns.saturating_add(self.last_ns.saturating_mul(2)) < due_ns
    }

    /// One more took so long; how much of that was work. What was done a moment ago in a fraction of the time was held
    /// up by the machine, not by itself.
    pub(super) fn learn_repeat(&mut self, took_ns: u64) -> u64 {
        let before_ns = std::mem::replace(&mut self.last_ns, took_ns);
        if took_ns > before_ns.saturating_add(HELD_UP_NS) { before_ns } else { took_ns }
    }

    /// The task lately used this share of its core.
    pub(super) fn yield_to_others(&mut self, used: f64) {
        self.lead.yield_to_others(used);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD_NS: u64 = 1_000_000;
    const DUE_NS: u64 = 10 * PERIOD_NS;

    #[test]
    fn far_deadlines_are_prepared_for_and_near_ones_are_not() {
        let preparation = Preparation::new(PERIOD_NS);
        let begin_ns = DUE_NS - FIRST_NS;
        assert_eq!(preparation.begin_ns(0, DUE_NS), Some(begin_ns));
        assert_eq!(preparation.begin_ns(begin_ns - WORTH_IT_NS, DUE_NS), None);
        assert_eq!(preparation.begin_ns(DUE_NS, 0), None);
    }

    #[test]
    fn what_takes_long_is_begun_earlier() {
        let mut preparation = Preparation::new(PERIOD_NS);
        preparation.learn_first(60_000);
        assert_eq!(preparation.begin_ns(0, DUE_NS), Some(DUE_NS - 95_000));
    }

    #[test]
    fn another_is_begun_while_twice_the_time_of_the_last_is_left() {
        let mut preparation = Preparation::new(PERIOD_NS);
        assert!(!preparation.fits(0, DUE_NS), "nothing is known");
        preparation.learn_first(20_000);
        assert!(preparation.fits(DUE_NS - 40_001, DUE_NS));
        assert!(!preparation.fits(DUE_NS - 40_000, DUE_NS));
        preparation.learn_repeat(10_000);
        assert!(preparation.fits(DUE_NS - 20_001, DUE_NS));
        assert!(!preparation.fits(DUE_NS - 20_000, DUE_NS));
    }

    #[test]
    fn a_repeat_that_takes_much_longer_than_the_last_was_held_up_and_the_next_is_compared_with_it() {
        let mut preparation = Preparation::new(PERIOD_NS);
        preparation.learn_first(20_000);
        assert_eq!(preparation.learn_repeat(10_000), 10_000);
        assert_eq!(preparation.learn_repeat(10_000 + HELD_UP_NS), 10_000 + HELD_UP_NS);
        preparation.learn_first(10_000);
        assert_eq!(preparation.learn_repeat(10_001 + HELD_UP_NS), 10_000);
        assert_eq!(
            preparation.learn_repeat(10_001 + HELD_UP_NS),
            10_001 + HELD_UP_NS,
            "it is the work that grew"
        );
    }

    #[test]
    fn a_held_up_repeat_is_forgotten_with_the_next_deadline() {
        let mut preparation = Preparation::new(PERIOD_NS);
        preparation.learn_first(10_000);
        preparation.learn_repeat(30_000_000);
        assert!(!preparation.fits(DUE_NS - 100_000, DUE_NS));
        preparation.learn_first(20_000);
        assert!(preparation.fits(DUE_NS - 100_000, DUE_NS));
    }
}
