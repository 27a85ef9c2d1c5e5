//! Which reading each cycle of the controller used. Without a fresh reading, forward kinematics and control have no new
//! input.

use masseter_runtime::messages::State;
use serde::Serialize;

/// The cycles that the controller ran, by the reading they used.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct ReadingFigures {
    /// That of their own cycle.
    pub in_time: u64,
    /// One of an earlier cycle, which came too late for that.
    pub late: u64,
    /// No fresh one.
    pub none: u64,
    /// None yet: the drives were booting.
    pub before_first: u64,
}

/// Separates fresh readings from those used again.
#[derive(Debug, Clone, Default)]
pub(super) struct Freshness {
    last: u64,
    pub(super) figures: ReadingFigures,
}

impl Freshness {
    /// Whether the state's reading is used for the first time.
    pub(super) fn take(&mut self, state: &State) -> bool {
        let is_fresh = state.reading_cycle > self.last;
        let figures = &mut self.figures;
        let count = match (is_fresh, self.last) {
            (true, _) if state.reading_cycle < state.cycle => &mut figures.late,
            (true, _) => &mut figures.in_time,
            (false, 0) => &mut figures.before_first,
            (false, _) => &mut figures.none,
        };
        *count += 1;
        self.last = self.last.max(state.reading_cycle);
        is_fresh
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_cycle_is_counted_by_the_reading_it_used() {
        let mut freshness = Freshness::default();
        // The controller's cycle, the reading's, and whether that is fresh. Reading 7 is there before cycle 6, late
        // itself, looks for its own.
        let cycles = [
            (1, 0, false),
            (2, 0, false),
            (3, 3, true),
            (4, 3, false),
            (5, 4, true),
            (6, 7, true),
            (7, 7, false),
            (8, 8, true),
        ];
        for (cycle, reading_cycle, is_fresh) in cycles {
            let state = State { cycle, reading_cycle, ..State::default() };
            assert_eq!(freshness.take(&state), is_fresh, "cycle {cycle}");
        }
        let expected = ReadingFigures { in_time: 3, late: 1, none: 2, before_first: 2 };
        assert_eq!(freshness.figures, expected);
    }
}
