//! Stretches of a run in which a late or lost cycle may still act on the jaw.
//!
//! A lost cycle shows in the controller's own messages, whichever process lost the cycle: the controller skipped deadlines,
//! or ceases to have a reading of its own cycle. Who caused the loss is not decided here.

use masseter_runtime::messages::State;

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
    pub(super) fn take(&mut self, state: &State, is_fresh: bool, is_of_scenario: bool) -> bool {
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

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD_NS: u64 = 1_000_000;

    /// States of a run whose cycle 500 is changed, and how many cycles are disturbed.
    fn disturbed(change: fn(&mut State)) -> usize {
        let mut disturbance = Disturbance::default();
        let mut skipped_cycles = 0;
        let states = (1..=1000).map(|cycle| {
            let mut state = State { cycle, woke_ns: cycle * PERIOD_NS, skipped_cycles, ..State::default() };
            state.reading_cycle = if cycle > 10 { cycle } else { 0 };
            if cycle == 500 {
                change(&mut state);
            }
            skipped_cycles = state.skipped_cycles;
            state
        });
        states
            .filter(|state| disturbance.take(state, state.reading_cycle >= state.cycle.min(499), false))
            .count()
    }

    #[test]
    fn a_lost_cycle_disturbs_a_tenth_of_a_second() {
        assert_eq!(disturbed(|_| ()), 0, "the boot of the drives is none");
        assert_eq!(disturbed(|state| state.skipped_cycles += 1), 100);
        assert_eq!(disturbed(|state| state.reading_cycle = 499), 100, "a late reading");
        assert_eq!(disturbed(|state| state.reading_cycle = 1), 100, "no fresh reading");
    }
}
