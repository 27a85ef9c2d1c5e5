//! `bench loop`: how late the real-time loop wakes at 1 kHz, against cyclictest.
//!
//! Both run holding `/dev/cpu_dma_latency`, as cyclictest's authors set it up, and with idle states allowed: which is
//! better depends on the machine, and on a virtual one on its host. Its histogram has steps of a microsecond. Where it
//! does not run, a plain absolute sleep on the same thread settings takes its place.

use std::cell::RefCell;
use std::process::Command;

use anyhow::{Context, bail};
use masseter_shared::clock::{self, SECOND_NS};
use masseter_shared::config::{CpuDmaLatency, RealtimeConfig};
use masseter_shared::realtime::{Cycle, Wake};

use super::contender::{Durations, Round, durations, record};
use super::contest::{Outcome, Turn};
use super::on_core;
use crate::machine::dma_latency::Hold;
use masseter_shared::schedule::OFF_TICK_NS;

const PERIOD_NS: u64 = SECOND_NS / 1000;
/// Wake-ups a round.
const WAKE_UPS: u64 = 10_000;
/// A wake-up later than this is an outlier, ns.
const OUTLIER_NS: u64 = 50_000;
/// Highest lateness in cyclictest's histogram, µs.
const CYCLICTEST_UP_TO_US: u64 = 20_000;

pub(super) fn measure(rounds: u32, core: usize) -> anyhow::Result<Outcome> {
    let outliers = RefCell::new(Outliers::default());
    let mut notes = Vec::new();
    let own = |wanted: CpuDmaLatency| -> Turn {
        let outliers = &outliers;
        Box::new(move || {
            let _hold = Hold::new(wanted, false);
            let mut outliers = outliers.borrow_mut();
            let outliers = &mut *outliers;
            Ok(on_core(core, move || own_loop(outliers)))
        })
    };
    let cyclictest = |more: &'static [&'static str]| -> Turn {
        Box::new(move || Ok(cyclictest(core, WAKE_UPS, more)?.into()))
    };
    let mut own_turns = vec![("masseter".to_owned(), own(CpuDmaLatency::Leave))];
    let mut others: Vec<(String, Turn)> = Vec::new();
    let refused = try_cyclictest(core).err();
    if let Some(why) = &refused {
        notes.push(format!("{why:#}: a plain sleep stands in for cyclictest"));
        others.push(("plain sleep".to_owned(), Box::new(move || Ok(on_core(core, plain_sleep)))));
    } else {
        notes.push("cyclictest does not tell the deadlines that it skips".to_owned());
        others.push(("cyclictest --laptop".to_owned(), cyclictest(&["--laptop"])));
    }
    if let Some(refusal) = &Hold::new(CpuDmaLatency::Hold, false).obtained().refusal {
        notes.push(format!("nobody holds the latency device: {refusal}"));
    } else {
        own_turns.push(("masseter, latency held".to_owned(), own(CpuDmaLatency::Hold)));
        if refused.is_none() {
            others.push(("cyclictest".to_owned(), cyclictest(&[])));
        }
    }
    let names = |turns: &[(String, Turn)]| turns.iter().map(|(name, _)| name.clone()).collect::<Vec<_>>();
    let (own_names, other_names) = (names(&own_turns), names(&others));
    let pairs = own_names.iter().flat_map(|own| other_names.iter().map(move |other| (own, other)));
    let measures = "wake-up lateness at 1 kHz, one SCHED_FIFO thread on one core".to_owned();
    let turns = own_turns.into_iter().chain(others).collect();
    let outcome = Outcome::of_turns("loop", measures, rounds, &[core], turns)?.comparing(pairs);
    notes.push(outliers.borrow().in_words());
    Ok(notes.into_iter().fold(outcome, Outcome::noting))
}

/// Late wake-ups of the own loop, and those of them before which it saw the machine stand still.
#[derive(Debug, Default)]
struct Outliers {
    late: u64,
    seen: u64,
    last: LastWake,
}

/// The last wake-up, as far as the next one may be late for its sake.
#[derive(Debug, Default)]
struct LastWake {
    woke_ns: u64,
    stalled_ns: u64,
    was_seen: bool,
}

impl Outliers {
    /// A stall is before a wake-up if it was noticed since the last one, or made that so late that this one's deadline
    /// had passed by then. The work here takes a microsecond: what takes long in it is a stall as well.
    fn take(&mut self, wake: Wake) {
        let stalled_ns = wake.account.stalled_ns + wake.account.overlong_ns;
        let follows = wake.due_ns < self.last.woke_ns && self.last.was_seen;
        let was_seen = stalled_ns > self.last.stalled_ns || follows;
        if wake.woke_ns - wake.due_ns > OUTLIER_NS {
            self.late += 1;
            self.seen += u64::from(was_seen);
        }
        self.last = LastWake { woke_ns: wake.woke_ns, stalled_ns, was_seen };
    }

    fn in_words(&self) -> String {
        format!(
            "masseter woke more than {} µs late {} times; the machine was seen to stand still before {} of them",
            OUTLIER_NS / 1000,
            self.late,
            self.seen
        )
    }
}

fn first_deadline_ns() -> u64 {
    clock::now_ns().next_multiple_of(PERIOD_NS) + PERIOD_NS + OFF_TICK_NS
}

/// A round with the share of its deadlines that passed before anybody could wait for them.
fn round(durations: Durations, skipped: u64) -> Round {
    let percent = 100.0 * skipped as f64 / (skipped + WAKE_UPS) as f64;
    Round { durations, shares: vec![("skipped deadlines".to_owned(), percent)] }
}

fn own_loop(outliers: &mut Outliers) -> Round {
    let mut late = durations();
    let mut skipped = 0;
    let mut cycle = Cycle::new(first_deadline_ns(), PERIOD_NS);
    outliers.last = LastWake::default();
    for _ in 0..WAKE_UPS {
        let wake = cycle.wait();
        record(&mut late, wake.woke_ns - wake.due_ns, 1);
        skipped = wake.skipped;
        outliers.take(wake);
    }
    round(late, skipped)
}

fn plain_sleep() -> Round {
    let mut late = durations();
    let mut skipped = 0;
    let mut due_ns = first_deadline_ns();
    for _ in 0..WAKE_UPS {
        clock::sleep_until(due_ns);
        let woke_ns = clock::now_ns();
        record(&mut late, woke_ns.saturating_sub(due_ns), 1);
        let missed = missed_by(due_ns + PERIOD_NS, woke_ns);
        skipped += missed;
        due_ns += PERIOD_NS * (1 + missed);
    }
    round(late, skipped)
}

/// Deadlines, from the next one on, that are skipped as the rig's loop skips them: all that passed but the last.
fn missed_by(next_due_ns: u64, now_ns: u64) -> u64 {
    now_ns.saturating_sub(next_due_ns) / PERIOD_NS
}

/// Whether cyclictest runs here, with the rights that it has.
fn try_cyclictest(core: usize) -> anyhow::Result<()> {
    cyclictest(core, 10, &["--laptop"]).map(drop)
}

fn cyclictest(core: usize, loops: u64, more: &[&str]) -> anyhow::Result<Durations> {
    let output = Command::new("cyclictest")
        .args(["--quiet", "--mlockall", "--threads=1", "--interval=1000"])
        .arg(format!("--priority={}", RealtimeConfig::default().priority))
        .arg(format!("--affinity={core}"))
        .arg(format!("--loops={loops}"))
        .arg(format!("--histogram={CYCLICTEST_UP_TO_US}"))
        .args(more)
        .output()
        .context("cyclictest cannot be started (`sudo apt install rt-tests`)")?;
    if !output.status.success() {
        let said = String::from_utf8_lossy(&output.stderr);
        bail!(
            "cyclictest failed: {}",
            said.lines().find(|line| !line.is_empty()).unwrap_or("it says nothing")
        );
    }
    histogram_of(&String::from_utf8_lossy(&output.stdout))
}

/// Lines `µs count`; what lies beyond the last of them stands as a count in a comment.
fn histogram_of(output: &str) -> anyhow::Result<Durations> {
    let mut late = durations();
    for line in output.lines() {
        if let Some(beyond) = line.strip_prefix("# Histogram Overflows:") {
            record(&mut late, CYCLICTEST_UP_TO_US * 1000, beyond.trim().parse()?);
        }
        let mut fields = line.split_whitespace().map(str::parse::<u64>);
        if let (Some(Ok(late_us)), Some(Ok(count)), None) = (fields.next(), fields.next(), fields.next()) {
            record(&mut late, late_us * 1000, count);
        }
    }
    if late.is_empty() {
        bail!("cyclictest gave no histogram");
    }
    Ok(late)
}

#[cfg(test)]
mod tests {
    use masseter_shared::realtime::Account;

    use super::*;

    #[test]
    fn an_outlier_is_seen_if_its_stall_was_noticed_before_it_or_before_the_one_that_it_follows() {
        let mut outliers = Outliers::default();
        let mut take = |due_us: u64, late_us: u64, stalled_us: u64| {
            let (due_ns, woke_ns) = (due_us * 1000, (due_us + late_us) * 1000);
            let account = Account { stalled_ns: stalled_us * 1000, ..Account::default() };
            outliers.take(Wake { woke_ns, account, ..Wake::on_time(0, due_ns) });
            (outliers.late, outliers.seen)
        };
        assert_eq!(take(1000, 0, 0), (0, 0));
        assert_eq!(take(2000, 3400, 3400), (1, 1));
        assert_eq!(take(5000, 400, 3400), (2, 2), "its deadline passed in the same stall");
        assert_eq!(take(6000, 0, 3400), (2, 2));
        assert_eq!(take(7000, 60, 3400), (3, 2), "late for no reason that was noticed");
        assert_eq!(take(8000, 50, 3500), (3, 2), "in time");
    }

    #[test]
    fn a_plain_sleep_skips_what_the_rigs_loop_skips() {
        let due_ns = 5 * PERIOD_NS;
        assert_eq!(missed_by(due_ns, 0), 0);
        assert_eq!(missed_by(due_ns, due_ns + PERIOD_NS - 1), 0, "late within its period");
        assert_eq!(missed_by(due_ns, due_ns + 4 * PERIOD_NS + 7), 4);
    }

    #[test]
    fn a_histogram_of_cyclictest_is_read_with_its_overflows() {
        let output = "# /dev/cpu_dma_latency set to 0us\n# Histogram\n000000 000000\n000013 000002\n\
                      000044 000001\n# Total: 000000003\n# Max Latencies: 25000\n\
                      # Histogram Overflows: 00001\n# Histogram Overflow at cycle number:\n# Thread 0:\n";
        let late = histogram_of(output).unwrap();
        assert_eq!(late.len(), 4);
        assert_eq!(late.count_between(13_000, 13_000), 2);
        assert!(late.max() >= CYCLICTEST_UP_TO_US * 1000);
        assert!(histogram_of("nothing\n").is_err());
    }

    #[test]
    fn of_cyclictests_empty_bins_none_is_the_maximum() {
        let output = "000013 000002\n000044 000001\n019999 000000\n# Histogram Overflows: 00000\n";
        let late = histogram_of(output).unwrap();
        assert_eq!((late.len(), late.max() / 100), (3, 440));
    }
}
