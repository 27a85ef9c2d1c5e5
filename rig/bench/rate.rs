//! `bench rate`: the whole rig at 1 to 20 kHz, on wires whose bits take a nanosecond, so that what remains is the
//! rig's own time; and what each rate costs.
//!
//! Each turn is a run of its own with three processes, judged by nobody; the durations are those of its recording.

use std::collections::BTreeMap;
use std::fs::File;
use std::path::Path;
use std::process::{Command, Stdio};

use anyhow::{Context, bail};
use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use hdrhistogram::serialization::Deserializer;
use hdrhistogram::serialization::interval_log::{IntervalLogIterator, LogEntry};
use masseter_shared::config::Scenario;
use serde_json::Value;

use super::contest::{Contender, Durations, Outcome, Share, durations};
use crate::exit::Exit;
use crate::run::folder::RunFolder;
use crate::run::manifest::Manifest;

/// Rates, Hz.
const RATES_HZ: [u32; 5] = [1000, 2000, 5000, 10_000, 20_000];
/// Motion of a turn, s; starting, easing in and stopping add more than a second.
const MOTION_S: f64 = 2.0;
/// Silence after which the rig stops, ms, whatever the rate: as long as in a run at 1 kHz.
const PATIENCE_MS: u32 = 20;
/// The intervals that are compared, as their logs are named.
const INTERVALS: [(&str, &str); 3] = [
    ("wake-up", "controller-wake-up"),
    ("controller cycle", "controller-cycle"),
    ("round trip", "round-trip"),
];

/// What a turn gave.
struct Turn {
    durations: Vec<Durations>,
    shares: Vec<(String, f64)>,
    stopped: bool,
    /// Whether the machine kept the rig from too many cycles to judge it.
    is_disturbed: bool,
}

pub(super) fn measure(rounds: u32, cores: [usize; 2]) -> anyhow::Result<Outcome> {
    let mut turns: Vec<Vec<Turn>> = RATES_HZ.iter().map(|_| Vec::new()).collect();
    for round in 0..rounds as usize {
        for turn in 0..RATES_HZ.len() {
            let index = (round + turn) % RATES_HZ.len();
            turns[index].push(run_at(RATES_HZ[index], cores)?);
        }
    }
    let mut outcome = Outcome {
        bench: "rate",
        measures:
            "the whole rig without bus delays: wake-up of the controller after its deadline, controller cycle (reading received to command published), \
                   round trip (SYNC to reading published, reading received to command received)"
                .to_owned(),
        contenders: Vec::new(),
        ratios: Vec::new(),
        notes: Vec::new(),
    };
    for (rate_hz, turns) in RATES_HZ.into_iter().zip(turns) {
        let stopped =
            |by_machine| turns.iter().filter(|turn| turn.stopped && turn.is_disturbed == by_machine).count();
        for (count, why) in [
            (stopped(false), "the cores do not hold this rate"),
            (stopped(true), "the machine stood still for too long"),
        ] {
            if count > 0 {
                let note = format!("{rate_hz} Hz: {count} of {rounds} runs did not play to their end: {why}");
                outcome.notes.push(note);
            }
        }
        outcome.contenders.extend(contenders(rate_hz, turns));
    }
    Ok(outcome)
}

/// A contender an interval; the last one carries the shares.
fn contenders(rate_hz: u32, turns: Vec<Turn>) -> Vec<Contender> {
    let mut by_interval: Vec<Vec<Durations>> = INTERVALS.iter().map(|_| Vec::new()).collect();
    let mut shares: BTreeMap<String, Vec<f64>> = BTreeMap::new();
    for turn in turns {
        turn.durations.into_iter().zip(&mut by_interval).for_each(|(round, rounds)| rounds.push(round));
        for (name, percent) in turn.shares {
            shares.entry(name).or_default().push(percent);
        }
    }
    let mut contenders: Vec<_> = INTERVALS
        .iter()
        .zip(by_interval)
        .map(|((name, _), rounds)| Contender::of(format!("{rate_hz} Hz, {name}"), rounds))
        .collect();
    if let Some(last) = contenders.last_mut() {
        last.shares = shares.into_iter().map(|(name, percent)| Share::of(name, percent)).collect();
    }
    contenders
}

fn scenario(rate_hz: u32, cores: [usize; 2]) -> Scenario {
    let mut scenario =
        Scenario { name: "rate".to_owned(), rate_hz, duration_s: Some(MOTION_S), ..Scenario::default() };
    let patience_cycles = PATIENCE_MS * rate_hz / 1000;
    scenario.can.ideal = true;
    scenario.can.command_timeout_cycles = patience_cycles;
    scenario.controller.stale_cycles = patience_cycles;
    scenario.realtime.cores = cores;
    scenario
}

/// Plays a motion at that rate.
fn run_at(rate_hz: u32, cores: [usize; 2]) -> anyhow::Result<Turn> {
    let place = tempfile::tempdir().context("cannot create a folder for the runs")?;
    let file = place.path().join("scenario.toml");
    std::fs::write(&file, scenario(rate_hz, cores).to_toml()).context("cannot write the scenario")?;
    let folder = place.path().join("run");
    let output = Command::new(std::env::current_exe()?)
        .args(["run", "--quiet", "--format", "json", "--out"])
        .args([&folder, &file])
        .stdin(Stdio::null())
        .output()
        .context("cannot start a run")?;
    if !folder.join("summary.json").exists() {
        bail!("a run at {rate_hz} Hz left no summary: {}", String::from_utf8_lossy(&output.stderr).trim());
    }
    turn(&RunFolder::open(&folder)?)
}

fn turn(folder: &RunFolder) -> anyhow::Result<Turn> {
    let manifest = Manifest::read(folder)?;
    let summary: Value = serde_json::from_reader(File::open(folder.summary())?)?;
    let log = |(_, name): &(_, &str)| read_log(&folder.histograms().join(format!("{name}.hlog")));
    let durations = INTERVALS.iter().map(log).collect::<anyhow::Result<_>>()?;
    let figures = &summary["figures"];
    let count = |value: &Value| value.as_f64().unwrap_or(0.0);
    let skips = |process: &str, kind: &str| count(&figures[process][kind]);
    let skipped = skips("controller_skips", "skipped") + skips("plant_skips", "skipped");
    let by_machine = skips("controller_skips", "by_machine") + skips("plant_skips", "by_machine");
    let topics = figures["topics"].as_array().into_iter().flatten();
    let (recorded, dropped) = topics.fold((0.0, 0.0), |(recorded, dropped), topic| {
        (recorded + count(&topic["messages"]), dropped + count(&topic["missing"]))
    });
    // Both processes have a deadline a cycle.
    let deadlines = 2.0 * count(&figures["cycles"]) + skipped;
    let mut shares = vec![
        ("missed".to_owned(), skipped / deadlines),
        ("missed by the machine".to_owned(), by_machine / deadlines),
        ("dropped".to_owned(), dropped / (recorded + dropped)),
    ];
    // A process that ended at once was never observed.
    for (process, usage) in manifest.usage.processes.iter().filter(|(_, usage)| usage.observed_s > 0.0) {
        shares.push((format!("{process} CPU"), usage.cpu_s / usage.observed_s));
    }
    let shares = shares.into_iter().map(|(name, share)| (name, share * 100.0)).collect();
    Ok(Turn {
        durations,
        shares,
        stopped: figures["final_state"] != "finished",
        is_disturbed: summary["verdict"]["exit_code"] == Exit::Invalid as u8,
    })
}

/// All intervals of a log together.
fn read_log(path: &Path) -> anyhow::Result<Durations> {
    let unreadable = || format!("cannot read {}", path.display());
    let bytes = std::fs::read(path).with_context(unreadable)?;
    let mut deserializer = Deserializer::new();
    let mut all = durations();
    for entry in IntervalLogIterator::new(&bytes) {
        let Ok(LogEntry::Interval(interval)) = entry else { continue };
        let payload = BASE64_STANDARD.decode(interval.encoded_histogram()).with_context(unreadable)?;
        let histogram: Durations =
            deserializer.deserialize(&mut payload.as_slice()).with_context(unreadable)?;
        all.add(histogram).with_context(unreadable)?;
    }
    Ok(all)
}
