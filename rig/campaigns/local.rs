//! The cases of a campaign on all cores of this machine.

use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use masseter_campaign::{Campaign, CampaignFolder, CaseResult, StopRules};
use masseter_runtime::clock;
use masseter_terminal::{Failure, status};

use super::player::Player;

/// Time between two lines of progress, ns.
const PROGRESS_EVERY_NS: u64 = 5_000_000_000;

/// Runs the cases in the order of their numbers, and stops by the rules of the campaign. Returns what has ended, in any order.
pub(super) fn run(
    campaign: &Campaign,
    folder: &CampaignFolder,
    player: &Player<'_>,
) -> Result<Vec<CaseResult>, Failure> {
    let points = campaign.points();
    let next = AtomicUsize::new(0);
    let tally = Mutex::new(Tally::new(campaign.case_count(), campaign.file.stop_after));
    let work = || -> Result<Vec<CaseResult>, Failure> {
        let mut ended = Vec::new();
        while !player.interrupts.is_stop_requested() && !lock(&tally).is_over() {
            let number = next.fetch_add(1, Ordering::Relaxed);
            if number >= campaign.case_count() {
                break;
            }
            let case = campaign.case(&points, number);
            let Some(result) = player.settle(folder, &case)? else { break };
            lock(&tally).count(&result);
            // Cases of equal content have one result.
            ended.push(CaseResult { number, ..result });
        }
        Ok(ended)
    };
    let ended = rayon::broadcast(|_| {
        // The others need not go on after an error.
        work().inspect_err(|_| next.store(usize::MAX / 2, Ordering::Relaxed))
    });
    Ok(ended.into_iter().collect::<Result<Vec<_>, _>>()?.concat())
}

/// No thread panics with it.
fn lock(tally: &Mutex<Tally>) -> std::sync::MutexGuard<'_, Tally> {
    tally.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
}

/// What has ended so far.
struct Tally {
    of: usize,
    rules: StopRules,
    began_ns: u64,
    said_ns: u64,
    ended: usize,
    failures: usize,
}

impl Tally {
    fn new(of: usize, rules: StopRules) -> Self {
        let now_ns = clock::now_ns();
        Self { of, rules, began_ns: now_ns, said_ns: now_ns, ended: 0, failures: 0 }
    }

    /// Whether a rule ends the campaign.
    fn is_over(&self) -> bool {
        self.rules.failures.is_some_and(|most| self.failures >= most)
            || self.rules.time_s.is_some_and(|most_s| self.lasted_s() >= most_s)
    }

    fn count(&mut self, result: &CaseResult) {
        self.ended += 1;
        self.failures += usize::from(!result.has_passed());
        let now_ns = clock::now_ns();
        if now_ns - self.said_ns >= PROGRESS_EVERY_NS {
            self.said_ns = now_ns;
            let left_s = self.lasted_s() / self.ended as f64 * (self.of - self.ended) as f64;
            status!(
                "{} of {} cases, {} did not pass, about {left_s:.0} s left",
                self.ended,
                self.of,
                self.failures
            );
        }
    }

    fn lasted_s(&self) -> f64 {
        (clock::now_ns() - self.began_ns) as f64 / 1e9
    }
}
