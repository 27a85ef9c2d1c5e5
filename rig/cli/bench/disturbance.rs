//! How much time the machine took from a bench: stolen by its host, or standing still before a round.

use std::time::Duration;

use masseter_runtime::clock::{self, SECOND_NS};
use masseter_runtime::realtime::Waiter;
use serde::Serialize;

use super::durations::on_core;
use masseter_machine::SystemRoot;
use masseter_machine::counters::stolen_ns;

/// With a greater share of time stolen or standing still, high percentiles come from the machine, %.
const BOUND_PERCENT: f64 = 1.0;
/// Length of an observation, before each round of a candidate.
const OBSERVED: Duration = Duration::from_millis(50);

/// The time lost, and whether it was too much.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Disturbance {
    /// Of all cores' time, as the kernel counts it.
    pub(super) stolen_percent: f64,
    /// Of the time observed, on the core that lost most.
    pub(super) stalled_percent: f64,
    pub(super) disturbed: bool,
    /// The figures in a sentence, if it is disturbed.
    pub(super) reason: Option<String>,
}

impl Disturbance {
    fn from_percentages(stolen_percent: f64, stalled_percent: f64) -> Self {
        let disturbed = stolen_percent.max(stalled_percent) > BOUND_PERCENT;
        let reason = format!(
            "the machine stalled for {stalled_percent:.1} % of the time observed, and its host stole \
             {stolen_percent:.1} %; a bench is judged with at most {BOUND_PERCENT} % of each"
        );
        Self { stolen_percent, stalled_percent, disturbed, reason: disturbed.then_some(reason) }
    }
}

/// Observes whether the machine stands still.
#[derive(Debug)]
pub(super) struct Stillness {
    cores: Vec<ObservedCore>,
    began_ns: u64,
    stolen_before_ns: u64,
}

/// A core and the time observed on it, ns.
#[derive(Debug)]
struct ObservedCore {
    core: usize,
    observed_ns: u64,
    stalled_ns: u64,
}

impl Stillness {
    /// On the cores of the bench.
    pub(super) fn begin(cores: &[usize]) -> Self {
        let observed = |&core: &usize| ObservedCore { core, observed_ns: 0, stalled_ns: 0 };
        Self {
            cores: cores.iter().map(observed).collect(),
            began_ns: clock::now_ns(),
            stolen_before_ns: stolen_ns(&SystemRoot::of_this_machine()).unwrap_or(0),
        }
    }

    /// Spins on one core after the other, with the priority of the rig, and counts the gaps.
    pub(super) fn observe(&mut self) {
        for core in &mut self.cores {
            let account = on_core(core.core, || {
                let mut waiter = Waiter::new(SECOND_NS);
                let until_ns = clock::now_ns() + OBSERVED.as_nanos() as u64;
                let mut spin = waiter.spin();
                while spin.now_ns() < until_ns {}
                waiter.account()
            });
            core.observed_ns += account.spun_ns + account.stalled_ns;
            core.stalled_ns += account.stalled_ns;
        }
    }

    pub(super) fn end(self) -> Disturbance {
        let root = SystemRoot::of_this_machine();
        let passed_ns = (clock::now_ns() - self.began_ns) * root.online_cores().len().max(1) as u64;
        let stolen_ns = stolen_ns(&root).unwrap_or(0).saturating_sub(self.stolen_before_ns);
        Disturbance::from_percentages(percent(stolen_ns, passed_ns), worst_percent(&self.cores))
    }
}

/// A bench on two cores waits for the slower one.
fn worst_percent(cores: &[ObservedCore]) -> f64 {
    cores.iter().map(|core| percent(core.stalled_ns, core.observed_ns)).fold(0.0, f64::max)
}

fn percent(part_ns: u64, of_ns: u64) -> f64 {
    100.0 * part_ns as f64 / of_ns.max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn more_than_a_hundredth_of_the_time_lost_either_way_is_too_much_to_judge() {
        for (stolen, stalled, disturbed) in
            [(0.0, 0.0, false), (1.0, 1.0, false), (1.1, 0.0, true), (0.0, 1.1, true)]
        {
            let disturbance = Disturbance::from_percentages(stolen, stalled);
            assert_eq!(disturbance.disturbed, disturbed, "{disturbance:?}");
            assert_eq!(disturbance.reason.is_some(), disturbed);
        }
    }

    #[test]
    fn every_core_in_use_is_observed() {
        let mut stillness = Stillness::begin(&[0, 1]);
        stillness.observe();
        for core in &stillness.cores {
            assert!(u128::from(core.observed_ns) > OBSERVED.as_nanos() / 2, "{stillness:?}");
            assert!(core.stalled_ns <= core.observed_ns, "{stillness:?}");
        }
        assert_eq!(stillness.cores.len(), 2);
    }

    #[test]
    fn of_two_cores_the_one_that_lost_most_counts() {
        let observed = |core, stalled_ns| ObservedCore { core, observed_ns: 1000, stalled_ns };
        assert!((worst_percent(&[observed(0, 0), observed(1, 30)]) - 3.0).abs() < 1e-9);
        assert!((worst_percent(&[observed(0, 30), observed(1, 0)]) - 3.0).abs() < 1e-9);
    }
}
