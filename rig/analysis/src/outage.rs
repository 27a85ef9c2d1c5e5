//! Cycles missed just before a safe stop. A controller that cannot run, or gets no readings, stops the rig correctly, so
//! such a stop is no fault of the rig.
//!
//! The cause of the missed cycles is not decided here; see [`OverrunAttribution`](crate::OverrunAttribution).

use std::collections::VecDeque;

use masseter_runtime::messages::codes::ControllerState;
use masseter_runtime::messages::{Reading, State};
use serde::Serialize;

/// How long before the stop a missed cycle may have led to it.
const BEFORE_NS: u64 = 100_000_000;

/// How far apart messages of the same time may lie in a recording: the recorder drains topic after topic.
const DISORDER_NS: u64 = 2_000_000_000;

/// Share of the cycles before a stop whose loss may explain it.
const EXPLAINS: f64 = 0.1;

/// The deadlines that controller or plant, whichever missed more, missed just before a safe stop.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Outage {
    /// Deadlines missed.
    pub missed: u64,
    /// Deadlines there were.
    pub of: u64,
}

impl Outage {
    /// Whether so many were missed that they may have caused the stop.
    pub fn explains_the_stop(self) -> bool {
        self.missed as f64 >= self.of as f64 * EXPLAINS
    }
}

/// Counts the deadlines that both processes miss until the rig stops.
#[derive(Debug, Clone, Default)]
pub(super) struct OutageWatch {
    stopped_ns: Option<u64>,
    controller: Misses,
    plant: Misses,
}

impl OutageWatch {
    /// `is_of_scenario`: a fault of the scenario made the misses.
    pub(super) fn state(&mut self, state: &State, is_of_scenario: bool) {
        if state.controller_state == ControllerState::SafeStop.code() {
            self.stopped_ns.get_or_insert(state.woke_ns);
        }
        self.controller.take(state.woke_ns, state.skipped_cycles, self.stopped_ns, is_of_scenario);
    }

    pub(super) fn reading(&mut self, reading: &Reading, is_of_scenario: bool) {
        self.plant.take(reading.woke_ns, reading.skipped_cycles, self.stopped_ns, is_of_scenario);
    }

    /// None without a safe stop.
    pub(super) fn finish(&self, period_ns: u64) -> Option<Outage> {
        let stopped_ns = self.stopped_ns?;
        let before = |misses: &Misses| misses.before(stopped_ns, period_ns);
        Some(Outage { missed: before(&self.controller).max(before(&self.plant)), of: BEFORE_NS / period_ns })
    }
}

/// Deadlines that a process missed around the stop: when it counted them, in its next message, and how many.
#[derive(Debug, Clone, Default)]
struct Misses {
    counted: u64,
    recent: VecDeque<(u64, u64)>,
}

impl Misses {
    fn take(&mut self, at_ns: u64, counted: u64, stopped_ns: Option<u64>, is_of_scenario: bool) {
        let missed = counted.saturating_sub(std::mem::replace(&mut self.counted, counted));
        if missed == 0 || is_of_scenario {
            return;
        }
        let is_old = |&(counted_ns, _): &(u64, u64)| counted_ns + BEFORE_NS + DISORDER_NS < at_ns;
        while stopped_ns.is_none() && self.recent.front().is_some_and(is_old) {
            self.recent.pop_front();
        }
        self.recent.push_back((at_ns, missed));
    }

    /// The deadlines before the stop among those that were missed in a row until they were counted.
    fn before(&self, stopped_ns: u64, period_ns: u64) -> u64 {
        let before = |&(at_ns, missed): &(u64, u64)| {
            let from_ns = at_ns
                .saturating_sub(missed.saturating_mul(period_ns))
                .max(stopped_ns.saturating_sub(BEFORE_NS));
            at_ns.min(stopped_ns).saturating_sub(from_ns) / period_ns
        };
        self.recent.iter().map(before).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD_NS: u64 = 1_000_000;

    /// When deadlines were missed, ms, and how many.
    type Missed<'a> = &'a [(u64, u64)];

    /// A run that stops safely at one second, and whose plant misses deadlines.
    fn outage(missed: Missed) -> Option<Outage> {
        let mut watch = OutageWatch::default();
        let mut skipped_cycles = 0;
        for &(at_ms, missed) in missed {
            skipped_cycles += missed;
            watch.reading(
                &Reading { woke_ns: at_ms * PERIOD_NS, skipped_cycles, ..Reading::default() },
                false,
            );
        }
        let controller_state = ControllerState::SafeStop.code();
        watch.state(&State { woke_ns: 1000 * PERIOD_NS, controller_state, ..State::default() }, false);
        watch.finish(PERIOD_NS)
    }

    #[test]
    fn only_what_is_missed_just_before_the_stop_explains_it() {
        let cases: [(Missed, u64, bool); 9] = [
            (&[], 0, false),
            (&[(980, 30)], 30, true),
            (&[(920, 4), (960, 6)], 10, true),
            (&[(920, 4), (960, 5)], 9, false),
            (&[(500, 80)], 0, false),
            (&[(950, 80)], 50, true),
            (&[(950, u64::MAX)], 50, true),
            // Counted in the message after the stop, however late it comes.
            (&[(1005, 25)], 20, true),
            (&[(1150, 170), (1500, 200)], 20, true),
        ];
        for (missed, expected, explains) in cases {
            let outage = outage(missed).unwrap();
            assert_eq!(outage, Outage { missed: expected, of: 100 }, "{missed:?}");
            assert_eq!(outage.explains_the_stop(), explains, "{missed:?}");
        }
    }

    #[test]
    fn a_run_that_did_not_stop_has_no_outage() {
        let mut watch = OutageWatch::default();
        watch.reading(&Reading { skipped_cycles: 50, ..Reading::default() }, false);
        assert_eq!(watch.finish(PERIOD_NS), None);
    }
}
