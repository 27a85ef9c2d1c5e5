//! Whether the machine let a bench be: what its host stole, and how long it stood still before the rounds.

use std::time::Duration;

use masseter_shared::clock::{self, SECOND_NS};
use masseter_shared::realtime::Waiter;
use serde::Serialize;

use super::on_core;
use crate::machine::SystemRoot;
use crate::machine::counters::stolen_ns;

/// Above this share of time stolen or stood still, tails are the machine's, %.
const BOUND_PERCENT: f64 = 1.0;
/// The machine is looked at for so long before each turn.
const LOOK: Duration = Duration::from_millis(50);

/// What became of the time, and whether too much of it was lost.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Disturbance {
    /// Of all cores' time, as the kernel counts it.
    pub(super) stolen_percent: f64,
    /// Of the time that a thread of the rig's priority spun before the turns, on the core that lost most.
    pub(super) stalled_percent: f64,
    pub(super) disturbed: bool,
    /// Why it is.
    pub(super) reason: Option<String>,
}

impl Disturbance {
    fn of(stolen_percent: f64, stalled_percent: f64) -> Self {
        let disturbed = stolen_percent.max(stalled_percent) > BOUND_PERCENT;
        let reason = format!(
            "the machine stood still for {stalled_percent:.1} % of the time that it was looked at, and its host stole \
             {stolen_percent:.1} %; up to {BOUND_PERCENT} % of either can be judged"
        );
        Self { stolen_percent, stalled_percent, disturbed, reason: disturbed.then_some(reason) }
    }
}

/// Looks at the machine now and then.
#[derive(Debug)]
pub(super) struct Watch {
    cores: Vec<Looks>,
    began_ns: u64,
    stolen_before_ns: Option<u64>,
}

impl Watch {
    /// From the cores that are measured on.
    pub(super) fn begin(cores: &[usize]) -> Self {
        let stolen_before_ns = stolen_ns(&SystemRoot::of_this_machine());
        Self { cores: cores.iter().map(Looks::from).collect(), began_ns: clock::now_ns(), stolen_before_ns }
    }

    /// On one core after the other.
    pub(super) fn look(&mut self) {
        self.cores.iter_mut().for_each(Looks::look);
    }

    pub(super) fn end(self) -> Disturbance {
        let root = SystemRoot::of_this_machine();
        let passed_ns = (clock::now_ns() - self.began_ns) * root.online_cores().len().max(1) as u64;
        let stolen_ns =
            stolen_ns(&root).zip(self.stolen_before_ns).map_or(0, |(to, from)| to.saturating_sub(from));
        Disturbance::of(percent(stolen_ns, passed_ns), worst_percent(&self.cores))
    }
}

/// What was seen of a core, ns.
#[derive(Debug)]
struct Looks {
    core: usize,
    looked_ns: u64,
    stalled_ns: u64,
}

impl From<&usize> for Looks {
    fn from(core: &usize) -> Self {
        Self { core: *core, looked_ns: 0, stalled_ns: 0 }
    }
}

impl Looks {
    /// Spins on the core and counts the gaps.
    fn look(&mut self) {
        let account = on_core(self.core, || {
            let mut waiter = Waiter::new(SECOND_NS);
            let until_ns = clock::now_ns() + LOOK.as_nanos() as u64;
            let mut spin = waiter.spin();
            while spin.now_ns() < until_ns {}
            waiter.account()
        });
        self.looked_ns += account.spun_ns + account.stalled_ns;
        self.stalled_ns += account.stalled_ns;
    }
}

/// A bench on two cores waits for the slower one.
fn worst_percent(cores: &[Looks]) -> f64 {
    cores.iter().map(|looks| percent(looks.stalled_ns, looks.looked_ns)).fold(0.0, f64::max)
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
            let disturbance = Disturbance::of(stolen, stalled);
            assert_eq!(disturbance.disturbed, disturbed, "{disturbance:?}");
            assert_eq!(disturbance.reason.is_some(), disturbed);
        }
    }

    #[test]
    fn what_is_looked_at_is_what_was_spun_on_every_core_in_use() {
        let mut watch = Watch::begin(&[0, 1]);
        watch.look();
        for looks in &watch.cores {
            assert!(u128::from(looks.looked_ns) > LOOK.as_nanos() / 2, "{watch:?}");
            assert!(looks.stalled_ns <= looks.looked_ns, "{watch:?}");
        }
        assert_eq!(watch.cores.len(), 2);
    }

    #[test]
    fn of_two_cores_the_one_that_lost_most_tells() {
        let looks = |core, stalled_ns| Looks { core, looked_ns: 1000, stalled_ns };
        assert!((worst_percent(&[looks(0, 0), looks(1, 30)]) - 3.0).abs() < 1e-9);
        assert!((worst_percent(&[looks(0, 30), looks(1, 0)]) - 3.0).abs() < 1e-9);
    }
}
