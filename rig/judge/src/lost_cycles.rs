//! Cycles without a fresh reading, cycles missed before a stop, and the time in which a lost cycle may still act on the jaw.
//!
//! Who caused a loss is not decided here; see [`OverrunAttribution`](crate::OverrunAttribution). Cycles lost to stalls that
//! the scenario makes are neither the machine's nor the rig's.

use std::{collections::VecDeque, ops::Range};

use masseter_recording::ProcessFault;
use masseter_runtime::messages::codes::ControllerState;
use masseter_runtime::messages::{Reading, State};
use masseter_scenario::{CommandFault, FaultKindConfig, ProcessFault as Kind};
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
    pub(super) fn is_first_use(&mut self, state: &State) -> bool {
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

/// Time after a lost cycle in which the jaw may be off its path for that reason, ns. Drives settle within 12 ms; pose
/// control then takes back what the drives' lag has added to its integral.
const SETTLING_NS: u64 = 100_000_000;

/// Follows the controller's messages.
#[derive(Debug, Clone, Default)]
pub(super) struct Disturbance {
    skipped: u64,
    was_in_time: bool,
    until_ns: u64,
}

impl Disturbance {
    /// Whether a lost cycle may act on the jaw in the cycle of a state. `is_fresh`: the state is the first to use its reading.
    /// What the scenario stalls is part of its test.
    pub(super) fn may_act_in(&mut self, state: &State, is_fresh: bool, is_of_scenario: bool) -> bool {
        let skipped = std::mem::replace(&mut self.skipped, state.skipped_cycles);
        let is_in_time = is_fresh && state.reading_cycle >= state.cycle;
        // Readings that always come late are the rig's.
        let was_in_time = std::mem::replace(&mut self.was_in_time, is_in_time);
        let is_lost = !is_of_scenario && (state.skipped_cycles > skipped || (was_in_time && !is_in_time));
        if is_lost {
            self.until_ns = state.woke_ns.saturating_add(SETTLING_NS);
        }
        is_lost || state.woke_ns < self.until_ns
    }
}

/// How long before the stop a missed cycle may have led to it.
const BEFORE_NS: u64 = 100_000_000;

/// How far apart messages of the same time may lie in a recording: the recorder drains topic after topic.
const DISORDER_NS: u64 = 2_000_000_000;

/// Share of the cycles before a stop whose loss may explain it.
const EXPLAINS: f64 = 0.1;

/// The deadlines that controller or plant, whichever missed more, missed just before a stop.
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

    /// Whether a deviation that stopped the rig may come from them. One skipped deadline is enough.
    pub fn explains_a_deviation(self) -> bool {
        self.missed > 0
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
    pub(super) fn apply_state(&mut self, state: &State, is_of_scenario: bool) {
        if state.controller_state == ControllerState::SafeStop.code() {
            self.stop(state.woke_ns);
        }
        self.controller.count_missed(state.woke_ns, state.skipped_cycles, self.stopped_ns, is_of_scenario);
    }

    pub(super) fn apply_reading(&mut self, reading: &Reading, is_of_scenario: bool) {
        self.plant.count_missed(reading.woke_ns, reading.skipped_cycles, self.stopped_ns, is_of_scenario);
    }

    /// Master, drives or controller stop, whichever is first: the messages of both loops come in any order.
    pub(super) fn stop(&mut self, time_ns: u64) {
        self.stopped_ns = Some(self.stopped_ns.map_or(time_ns, |stopped_ns| stopped_ns.min(time_ns)));
    }

    /// None without a stop.
    pub(super) fn outage(&self, period_ns: u64) -> Option<Outage> {
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
    fn count_missed(&mut self, at_ns: u64, counted: u64, stopped_ns: Option<u64>, is_of_scenario: bool) {
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
            let row_ns = missed.saturating_mul(period_ns);
            let from_ns = at_ns.saturating_sub(row_ns).max(stopped_ns.saturating_sub(BEFORE_NS));
            at_ns.min(stopped_ns).saturating_sub(from_ns) / period_ns
        };
        self.recent.iter().map(before).sum()
    }
}

/// Time after a stall in which its late cycle and the skips behind it follow, ns: a stopped process goes on when the kernel
/// lets it.
const AFTER_NS: u64 = 10_000_000;

/// The stalls, and how far the messages of each loop have come.
#[derive(Debug, Clone, Default)]
pub(super) struct ScenarioStalls {
    controller: Stalled,
    plant: Stalled,
}

/// The stalls of one loop.
#[derive(Debug, Clone, Default)]
struct Stalled {
    windows_ns: Vec<Range<u64>>,
    woke_ns: u64,
}

impl Stalled {
    /// Whether it was stalled between the message before and this one.
    fn was_stalled_before(&mut self, woke_ns: u64) -> bool {
        let since_ns = std::mem::replace(&mut self.woke_ns, woke_ns);
        self.windows_ns.iter().any(|window_ns| window_ns.start < woke_ns && since_ns < window_ns.end)
    }

    fn holds(&self, ns: u64) -> bool {
        self.windows_ns.iter().any(|window_ns| window_ns.contains(&ns))
    }
}

impl ScenarioStalls {
    /// A fault that the supervisor carried out. One without an end lasted longer than the run.
    pub(super) fn add(&mut self, kind: FaultKindConfig, fault: &ProcessFault) {
        let stalled = match kind {
            FaultKindConfig::Process(Kind::PlantStall) => &mut self.plant,
            FaultKindConfig::Process(Kind::CoreStall)
            | FaultKindConfig::Command(CommandFault::ControllerStall) => &mut self.controller,
            FaultKindConfig::Process(
                Kind::ControllerKill
                | Kind::PlantKill
                | Kind::RecorderKill
                | Kind::RecorderStall
                | Kind::DiskFull,
            )
            | FaultKindConfig::Command(
                CommandFault::Nan | CommandFault::Jump | CommandFault::Version | CommandFault::Foreign,
            )
            | FaultKindConfig::Bus(_)
            | FaultKindConfig::Encoder(_)
            | FaultKindConfig::Drive(_)
            | FaultKindConfig::Axis(_)
            | FaultKindConfig::Platform(_) => return,
        };
        let end_ns = fault.ended_ns.map_or(u64::MAX, |ended_ns| ended_ns.saturating_add(AFTER_NS));
        stalled.windows_ns.push(fault.struck_ns..end_ns);
    }

    /// Whether the plant was stalled before this reading.
    pub(super) fn apply_reading(&mut self, reading: &Reading) -> bool {
        self.plant.was_stalled_before(reading.woke_ns)
    }

    /// Whether the controller was stalled before this state; and whether either loop was, so that readings are late.
    pub(super) fn apply_state(&mut self, state: &State) -> (bool, bool) {
        let is_own = self.controller.was_stalled_before(state.woke_ns);
        (is_own, is_own || self.plant.holds(state.woke_ns))
    }
}

#[cfg(test)]
mod tests;
