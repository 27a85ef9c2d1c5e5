//! `bench loop`: wake-up latency of the real-time loop at 1 kHz, against cyclictest.
//!
//! Both run twice: with `/dev/cpu_dma_latency` held, as cyclictest does by default, and with idle states allowed.
//! Which of the two is better depends on the machine; for a virtual machine, it depends on the host. cyclictest's
//! histogram has a resolution of 1 µs. Where cyclictest does not run, the loop is measured alone.

use std::process::Command;

use anyhow::{Context, bail};
use masseter_machine::dma_latency::Hold;
use masseter_runtime::clock::{self, SECOND_NS};
use masseter_runtime::realtime::Cycle;
use masseter_runtime::schedule::OFF_TICK_NS;
use masseter_scenario::{CpuDmaLatency, RealtimeConfig};

use super::candidate::{Durations, Round, Turn, add_durations, no_durations};
use super::disturbance::on_core;
use super::results::Results;

const PERIOD_NS: u64 = SECOND_NS / 1000;
/// Wake-ups per round.
const WAKE_UPS: u64 = 10_000;
/// Highest lateness in cyclictest's histogram, µs.
const CYCLICTEST_UP_TO_US: u64 = 20_000;

pub(super) fn measure(rounds: u32, core: usize) -> anyhow::Result<Results> {
    let own = |wanted: CpuDmaLatency| -> Turn {
        Box::new(move || {
            let _hold = Hold::new(wanted, false);
            Ok(on_core(core, own_loop))
        })
    };
    let other =
        |more: &'static [&'static str]| -> Turn { Box::new(move || cyclictest(core, WAKE_UPS, more)) };
    let mut notes = Vec::new();
    let mut own_turns = vec![("masseter", own(CpuDmaLatency::Leave))];
    let mut others = vec![("cyclictest --laptop", other(&["--laptop"]))];
    if let Some(refusal) = &Hold::new(CpuDmaLatency::Hold, false).obtained.refusal {
        notes.push(format!("/dev/cpu_dma_latency is not held: {refusal}"));
    } else {
        own_turns.push(("masseter, latency held", own(CpuDmaLatency::Hold)));
        others.push(("cyclictest", other(&[])));
    }
    // Whether it runs here with the rights of this process.
    if let Err(why) = cyclictest(core, 10, &["--laptop"]) {
        notes.push(format!("{why:#}: nothing to compare with"));
        others.clear();
    } else {
        notes.push("cyclictest does not count the deadlines that it skips".to_owned());
    }
    let mut results = Results::by_turns(rounds, core, own_turns, others)?;
    results.notes = notes;
    Ok(results)
}

/// A round with the share of its deadlines that passed before the loop could wait for them.
fn own_loop() -> Round {
    let mut durations = no_durations();
    let mut skipped = 0;
    let first_ns = clock::now_ns().next_multiple_of(PERIOD_NS) + PERIOD_NS + OFF_TICK_NS;
    let mut cycle = Cycle::new(first_ns, PERIOD_NS);
    for _ in 0..WAKE_UPS {
        let wake = cycle.wait();
        add_durations(&mut durations, wake.woke_ns - wake.due_ns, 1);
        skipped = wake.skipped;
    }
    Round { durations, skipped_percent: Some(100.0 * skipped as f64 / (skipped + WAKE_UPS) as f64) }
}

fn cyclictest(core: usize, loops: u64, more: &[&str]) -> anyhow::Result<Round> {
    let output = Command::new("cyclictest")
        .args(["--quiet", "--mlockall", "--threads=1", "--interval=1000"])
        .arg(format!("--priority={}", RealtimeConfig::default().priority))
        .arg(format!("--affinity={core}"))
        .arg(format!("--loops={loops}"))
        .arg(format!("--histogram={CYCLICTEST_UP_TO_US}"))
        .args(more)
        .output()
        .context("cyclictest cannot be started ('sudo apt install rt-tests')")?;
    if !output.status.success() {
        let said = String::from_utf8_lossy(&output.stderr);
        bail!("cyclictest failed: {}", said.lines().find(|line| !line.is_empty()).unwrap_or("no message"));
    }
    let durations = histogram_of(&String::from_utf8_lossy(&output.stdout))?;
    Ok(Round { durations, skipped_percent: None })
}

/// Reads lines `µs count`; a comment counts the samples beyond the last line.
fn histogram_of(output: &str) -> anyhow::Result<Durations> {
    let mut late = no_durations();
    for line in output.lines() {
        if let Some(beyond) = line.strip_prefix("# Histogram Overflows:") {
            add_durations(&mut late, CYCLICTEST_UP_TO_US * 1000, beyond.trim().parse()?);
        }
        let mut fields = line.split_whitespace().map(str::parse::<u64>);
        if let (Some(Ok(late_us)), Some(Ok(count)), None) = (fields.next(), fields.next(), fields.next()) {
            add_durations(&mut late, late_us * 1000, count);
        }
    }
    if late.is_empty() {
        bail!("cyclictest gave no histogram");
    }
    Ok(late)
}

#[cfg(test)]
mod tests {
    use super::*;

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
