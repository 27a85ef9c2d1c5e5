//! The time in which a fault of the plant acts, from its window.

use std::ops::Range;

use masseter_runtime::clock::SECOND_NS;
use masseter_runtime::injection::{Injected, Injection};
use masseter_scenario::{FaultConfig, FaultKindConfig, Scenario};

/// The window of a fault, cut where its size says how long the fault lasts.
pub(crate) fn acting_ns(fault: &FaultConfig, window_ns: Range<u64>) -> Range<u64> {
    let is_for_its_size =
        matches!(fault.kind, FaultKindConfig::DriveReboot | FaultKindConfig::ControllerStall);
    let longest_ns = (fault.size_si() * SECOND_NS as f64).round() as u64;
    let end_ns = if is_for_its_size { window_ns.start.saturating_add(longest_ns) } else { u64::MAX };
    window_ns.start..window_ns.end.min(end_ns)
}

/// Every fault and stimulus of a scenario whose window is known.
pub(crate) fn known_windows(
    scenario: &Scenario,
    injection: &Injection,
) -> impl Iterator<Item = (Injected, Range<u64>)> {
    let faults = (0..scenario.faults.len()).map(Injected::Fault);
    let stimuli = (0..scenario.stimulus.len()).map(Injected::Stimulus);
    faults.chain(stimuli).filter_map(|injected| Some((injected, injection.window_ns(injected)?)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_dip_of_the_supply_lasts_as_long_as_its_size_says_and_no_longer_than_its_window() {
        let size = Some("20 ms".parse().unwrap());
        let dip = FaultConfig { size, ..FaultConfig::new(FaultKindConfig::DriveReboot) };
        assert_eq!(acting_ns(&dip, 1000..u64::MAX), 1000..20_001_000);
        assert_eq!(acting_ns(&dip, 1000..5000), 1000..5000);
        let slow = FaultConfig { kind: FaultKindConfig::DriveSlowEnable, ..dip };
        assert_eq!(acting_ns(&slow, 1000..u64::MAX), 1000..u64::MAX);
    }
}
