//! The kernel's counters around a cycle: the cause of a long cycle is often outside the rig.

use masseter_runtime::messages::Machine;
use serde::Serialize;

/// Growth of the kernel's counters between the samples before and after a cycle.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct KernelCounts {
    /// From one sample to the other, ns.
    pub looked_over_ns: Option<u64>,
    /// Time that the hypervisor took from all cores meanwhile, as far as it reports that, ns.
    pub stolen_ns: Option<u64>,
    /// Times that one of the loops lost its core.
    pub involuntary_switches: Option<u64>,
    /// Page faults of both processes.
    pub page_faults: Option<u64>,
}

impl KernelCounts {
    /// Growth between the last of all samples before a stretch of time and the first behind it.
    pub(super) fn around(samples: &[Machine], from_ns: u64, to_ns: u64) -> Self {
        let before = samples.partition_point(|sample| sample.time_ns <= from_ns);
        let after = samples.partition_point(|sample| sample.time_ns < to_ns);
        match (before.checked_sub(1), samples.get(after)) {
            (Some(before), Some(after)) => Self::between(&samples[before], after),
            _ => Self::default(),
        }
    }

    fn between(before: &Machine, after: &Machine) -> Self {
        let growth = |counter: fn(&Machine) -> u64| Some(counter(after).saturating_sub(counter(before)));
        Self {
            looked_over_ns: growth(|machine| machine.time_ns),
            stolen_ns: growth(|machine| machine.stolen_ns),
            involuntary_switches: growth(|machine| machine.involuntary_switches.iter().sum()),
            page_faults: growth(|machine| machine.page_faults.iter().sum()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_counted_is_that_between_the_samples_before_and_behind() {
        let samples = [(0, 0, 1), (50, 3_000, 3), (100, 3_000, 3)].map(|(time_ns, stolen_ns, switches)| {
            let involuntary_switches = [switches, 0];
            Machine { time_ns, stolen_ns, involuntary_switches, ..Default::default() }
        });
        let told = |stolen_ns, switches| KernelCounts {
            looked_over_ns: Some(50),
            stolen_ns: Some(stolen_ns),
            involuntary_switches: Some(switches),
            page_faults: Some(0),
        };
        assert_eq!(KernelCounts::around(&samples, 40, 41), told(3_000, 2));
        assert_eq!(KernelCounts::around(&samples, 70, 71), told(0, 0));
        assert_eq!(KernelCounts::around(&samples, 100, 101), KernelCounts::default());
    }
}
