//! Stalls of the two loops that faults of the scenario make. Cycles lost to them are neither the machine's nor the rig's.

use std::ops::Range;

use masseter_recording::ProcessFault;
use masseter_runtime::messages::{Reading, State};
use masseter_scenario::FaultKindConfig;

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
    fn take(&mut self, woke_ns: u64) -> bool {
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
            FaultKindConfig::PlantStall => &mut self.plant,
            FaultKindConfig::ControllerStall | FaultKindConfig::CoreStall => &mut self.controller,
            _ => return,
        };
        let end_ns = fault.ended_ns.map_or(u64::MAX, |ended_ns| ended_ns.saturating_add(AFTER_NS));
        stalled.windows_ns.push(fault.struck_ns..end_ns);
    }

    /// Whether the plant was stalled before this reading.
    pub(super) fn reading(&mut self, reading: &Reading) -> bool {
        self.plant.take(reading.woke_ns)
    }

    /// Whether the controller was stalled before this state; and whether either loop was, so that readings are late.
    pub(super) fn state(&mut self, state: &State) -> (bool, bool) {
        let is_own = self.controller.take(state.woke_ns);
        (is_own, is_own || self.plant.holds(state.woke_ns))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stall_takes_the_cycles_of_its_own_loop_until_the_skips_behind_it() {
        let mut stalls = ScenarioStalls::default();
        let fault = |ended_ns| ProcessFault { number: 1, struck_ns: 5_000_000, ended_ns };
        stalls.add(FaultKindConfig::PlantStall, &fault(Some(25_000_000)));
        stalls.add(FaultKindConfig::RecorderStall, &fault(None));
        let mut reading = |woke_ns| stalls.reading(&Reading { woke_ns, ..Reading::default() });
        assert_eq!(
            [4_500_000, 5_000_000, 26_000_000, 27_000_000, 35_000_000, 36_000_000].map(&mut reading),
            [false, false, true, true, true, false]
        );
        let mut state = |woke_ns| stalls.state(&State { woke_ns, ..State::default() });
        assert_eq!(
            [4_000_000, 6_000_000, 40_000_000].map(&mut state),
            [(false, false), (false, true), (false, false)]
        );
        stalls.add(FaultKindConfig::CoreStall, &fault(None));
        assert_eq!(stalls.state(&State { woke_ns: u64::MAX - 1, ..State::default() }), (true, true));
    }
}
