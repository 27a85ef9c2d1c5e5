//! A process's counter of the time that the machine withheld, as its messages carry it in every wake-up.

/// Computes the counter at the deadline from the counter at the wake-up.
#[derive(Debug, Default)]
pub(super) struct Stalls {
    counted_ns: u64,
}

impl Stalls {
    /// A wake-up that was late was so because of the last stall before it: as much of the growth belongs to the cycle
    /// that begins, the rest to the one before.
    pub(super) fn when_due_ns(&mut self, counted_ns: u64, late_ns: u64) -> u64 {
        let growth_ns = counted_ns.saturating_sub(std::mem::replace(&mut self.counted_ns, counted_ns));
        counted_ns - growth_ns.min(late_ns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stall_counts_before_a_deadline_but_for_what_made_the_wake_up_late() {
        let mut stalls = Stalls::default();
        // What was counted in a wake-up, how late that was, and what was counted at its deadline.
        for (counted_ns, late_ns, when_due_ns) in
            [(0, 20, 0), (300, 0, 300), (1000, 700, 300), (1000, 20, 1000), (1500, 400, 1100)]
        {
            assert_eq!(stalls.when_due_ns(counted_ns, late_ns), when_due_ns, "{counted_ns} ns");
        }
    }
}
