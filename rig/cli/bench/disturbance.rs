//! How much time the machine took from a bench: stolen by its host, or standing still before a round.

use std::thread;
use std::time::Duration;

use masseter_machine::SystemRoot;
use masseter_machine::counters::stolen_ns;
use masseter_runtime::clock::{self, SECOND_NS};
use masseter_runtime::realtime::Waiter;
use masseter_runtime::realtime::scheduling::{Obtained, SchedulingRequest, obtain};
use masseter_scenario::RealtimeConfig;
use serde::Serialize;

/// With a greater share of time stolen or standing still, high percentiles come from the machine, %.
const BOUND_PERCENT: f64 = 1.0;
/// Length of an observation, before each round of a candidate.
const OBSERVED: Duration = Duration::from_millis(50);

/// The time lost, and whether it was too much.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Disturbance {
    /// Of all cores' time, as the kernel counts it.
    stolen_percent: f64,
    /// Of the time observed.
    stalled_percent: f64,
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

/// Observes on the core of the bench whether the machine stands still.
#[derive(Debug)]
pub(super) struct Stillness {
    core: usize,
    observed_ns: u64,
    stalled_ns: u64,
    began_ns: u64,
    stolen_before_ns: u64,
}

impl Stillness {
    pub(super) fn begin(core: usize) -> Self {
        let stolen_before_ns = stolen_ns(&SystemRoot::of_this_machine()).unwrap_or(0);
        Self { core, observed_ns: 0, stalled_ns: 0, began_ns: clock::now_ns(), stolen_before_ns }
    }

    /// Spins with the priority of the rig, and counts the gaps.
    pub(super) fn observe(&mut self) {
        let account = on_core(self.core, || {
            let mut waiter = Waiter::new(SECOND_NS);
            let until_ns = clock::now_ns() + OBSERVED.as_nanos() as u64;
            let mut spin = waiter.spin();
            while spin.now_ns() < until_ns {}
            waiter.account()
        });
        self.observed_ns += account.spun_ns + account.stalled_ns;
        self.stalled_ns += account.stalled_ns;
    }

    pub(super) fn end(self) -> Disturbance {
        let root = SystemRoot::of_this_machine();
        let passed_ns = (clock::now_ns() - self.began_ns) * root.online_cores().len().max(1) as u64;
        let stolen_ns = stolen_ns(&root).unwrap_or(0).saturating_sub(self.stolen_before_ns);
        let percent = |part_ns: u64, of_ns: u64| 100.0 * part_ns as f64 / of_ns.max(1) as f64;
        Disturbance::from_percentages(
            percent(stolen_ns, passed_ns),
            percent(self.stalled_ns, self.observed_ns),
        )
    }
}

/// Asks the kernel for the settings of a run on behalf of the calling thread.
pub(super) fn realtime_on(core: usize) -> Obtained {
    let priority = RealtimeConfig::default().priority;
    obtain(SchedulingRequest { core: Some(core), fifo_priority: Some(priority), locked_memory: true })
}

/// Runs `work` on a new thread with these settings, as far as the kernel grants them.
pub(super) fn on_core<T: Send>(core: usize, work: impl FnOnce() -> T + Send) -> T {
    thread::scope(|scope| {
        let thread = scope.spawn(|| {
            realtime_on(core);
            work()
        });
        thread.join().expect("measuring does not panic")
    })
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
    fn the_core_is_observed_before_every_round() {
        let mut stillness = Stillness::begin(0);
        stillness.observe();
        assert!(u128::from(stillness.observed_ns) > OBSERVED.as_nanos() / 2, "{stillness:?}");
        assert!(stillness.stalled_ns <= stillness.observed_ns, "{stillness:?}");
    }
}
