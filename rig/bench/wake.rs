//! `bench loop`: wake-up latency of the real-time loop at 1 kHz, against cyclictest.
//!
//! Both run twice: with `/dev/cpu_dma_latency` held, as cyclictest does by default, and with idle states allowed. Which of
//! the two is better depends on the machine, and on a virtual machine on its host. cyclictest's histogram has a resolution
//! of 1 µs. Where cyclictest does not run, a loop of absolute sleeps with the same thread settings replaces it.

use std::cell::RefCell;
use std::process::Command;

use anyhow::{Context, bail};
use masseter_shared::clock::{self, SECOND_NS};
use masseter_shared::config::{CpuDmaLatency, RealtimeConfig};
use masseter_shared::realtime::{Cycle, Wake};
use masseter_shared::schedule::OFF_TICK_NS;

use super::candidate::{Durations, Round, no_durations, record};
use super::comparison::{Comparison, Turn};
use super::thread::on_core;
use crate::machine::dma_latency::Hold;

const PERIOD_NS: u64 = SECOND_NS / 1000;
/// Wake-ups per round.
const WAKE_UPS: u64 = 10_000;
/// A wake-up later than this is an outlier, ns.
const OUTLIER_NS: u64 = 50_000;
/// Highest lateness in cyclictest's histogram, µs.
const CYCLICTEST_UP_TO_US: u64 = 20_000;

pub(super) fn measure(rounds: u32, core: usize) -> anyhow::Result<Comparison> {
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
        notes.push(format!("{why:#}: a plain sleep replaces cyclictest"));
        others.push(("plain sleep".to_owned(), Box::new(move || Ok(on_core(core, plain_sleep)))));
    } else {
        notes.push("cyclictest does not count the deadlines that it skips".to_owned());
        others.push(("cyclictest --laptop".to_owned(), cyclictest(&["--laptop"])));
    }
    if let Some(refusal) = &Hold::new(CpuDmaLatency::Hold, false).obtained().refusal {
        notes.push(format!("/dev/cpu_dma_latency is not held: {refusal}"));
    } else {
        own_turns.push(("masseter, latency held".to_owned(), own(CpuDmaLatency::Hold)));
        if refused.is_none() {
            others.push(("cyclictest".to_owned(), cyclictest(&[])));
        }
    }
    let names = |turns: &[(String, Turn)]| turns.iter().map(|(name, _)| name.clone()).collect::<Vec<_>>();
    let (own_names, other_names) = (names(&own_turns), names(&others));
    let pairs = own_names.iter().flat_map(|own| other_names.iter().map(move |other| (own, other)));
    let measures = "wake-up latency at 1 kHz, one SCHED_FIFO thread on one core".to_owned();
    let turns = own_turns.into_iter().chain(others).collect();
    let comparison = Comparison::by_turns("loop", measures, rounds, &[core], turns)?.comparing(pairs);
    notes.push(outliers.borrow().note());
    Ok(notes.into_iter().fold(comparison, Comparison::with_note))
}

/// Late wake-ups of the rig's loop, and how many of them follow an observed standstill of the machine.
#[derive(Debug, Default)]
struct Outliers {
    late: u64,
    seen: u64,
    last: LastWake,
}

/// What the last wake-up explains of the next one.
#[derive(Debug, Default)]
struct LastWake {
    woke_ns: u64,
    stalled_ns: u64,
    was_seen: bool,
}

impl Outliers {
    /// A stall explains a wake-up if it was observed since the last wake-up. It also explains the next one if the last
    /// wake-up was so late that the next deadline had passed. The work here takes 1 µs, so long work is a stall as well.
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

    fn note(&self) -> String {
        format!(
            "masseter woke more than {} µs late {} times; before {} of them the machine stalled",
            OUTLIER_NS / 1000,
            self.late,
            self.seen
        )
    }
}

fn first_deadline_ns() -> u64 {
    clock::now_ns().next_multiple_of(PERIOD_NS) + PERIOD_NS + OFF_TICK_NS
}

/// A round with the share of its deadlines that passed before the loop could wait for them.
fn round(durations: Durations, skipped: u64) -> Round {
    let percent = 100.0 * skipped as f64 / (skipped + WAKE_UPS) as f64;
    Round { durations, shares: vec![("skipped deadlines".to_owned(), percent)] }
}

fn own_loop(outliers: &mut Outliers) -> Round {
    let mut late = no_durations();
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
    let mut late = no_durations();
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

/// Deadlines, from the next one on, that the rig's loop skips: all that passed but the last.
fn missed_by(next_due_ns: u64, now_ns: u64) -> u64 {
    now_ns.saturating_sub(next_due_ns) / PERIOD_NS
}

/// Whether cyclictest runs here with the rights of this process.
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

/// Reads lines `µs count`; a comment counts the samples beyond the last line.
fn histogram_of(output: &str) -> anyhow::Result<Durations> {
    let mut late = no_durations();
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
    fn an_outlier_is_explained_by_a_stall_before_it_or_before_the_outlier_that_it_follows() {
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
        assert_eq!(take(7000, 60, 3400), (3, 2), "late without an observed stall");
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
    fn a_histogram_of_cyclictest_includes_its_overflows() {
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
    fn empty_bins_of_cyclictest_do_not_raise_the_maximum() {
        let output = "000013 000002\n000044 000001\n019999 000000\n# Histogram Overflows: 00000\n";
        let late = histogram_of(output).unwrap();
        assert_eq!((late.len(), late.max() / 100), (3, 440));
    }
}
