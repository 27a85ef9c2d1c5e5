//! Skipped deadlines, and whose fault they were.
//!
//! A real-time task that waits loses time only to the machine (interrupts, the hypervisor), and counts
//! it. A skip that the time lost since the cycle before explains is the machine's; any other is the
//! rig's own.

use serde::Serialize;

/// Skipped deadlines of one process.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct SkipFigures {
    /// Deadlines skipped.
    pub skipped: u64,
    /// Those that the machine is to blame for.
    pub by_machine: u64,
    /// Time that the machine withheld from the process while it waited, ns.
    pub stalled_ns: u64,
}

/// Follows the counters of one process.
#[derive(Debug, Default)]
pub(super) struct Skips {
    figures: SkipFigures,
    /// Time withheld in the cycle before, ns: a late cycle is skipped after, not before, it was run.
    recent_ns: u64,
}

impl Skips {
    /// The process' counters in its next message.
    pub(super) fn take(&mut self, skipped: u64, stalled_ns: u64, period_ns: u64) {
        let newly_skipped = skipped.saturating_sub(self.figures.skipped);
        let newly_stalled_ns = stalled_ns.saturating_sub(self.figures.stalled_ns);
        let explained = (newly_stalled_ns + self.recent_ns).div_ceil(period_ns);
        self.figures.by_machine += newly_skipped.min(explained);
        (self.figures.skipped, self.figures.stalled_ns) = (skipped, stalled_ns);
        self.recent_ns = newly_stalled_ns;
    }

    pub(super) fn finish(self) -> SkipFigures {
        self.figures
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD_NS: u64 = 1_000_000;

    #[test]
    fn skips_are_blamed_on_the_machine_as_far_as_it_withheld_time() {
        let mut skips = Skips::default();
        // In time; woken 8.6 ms late; the seven passed deadlines skipped.
        skips.take(0, 0, PERIOD_NS);
        skips.take(0, 8_600_000, PERIOD_NS);
        skips.take(7, 8_600_000, PERIOD_NS);
        // Three skipped without any time withheld.
        skips.take(7, 8_600_000, PERIOD_NS);
        skips.take(10, 8_600_000, PERIOD_NS);
        assert_eq!(skips.finish(), SkipFigures { skipped: 10, by_machine: 7, stalled_ns: 8_600_000 });
    }
}
