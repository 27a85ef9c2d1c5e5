//! `bench rate`: the whole rig at 1 to 20 kHz, and the CPU time that each rate takes. A bit on the wire takes 1 ns, so that
//! the durations are the rig's own.
//!
//! Each round of a rate is a run with three processes; the durations come from its recording. The run's verdict is not used,
//! except to find out whether the machine stalled.

use std::fs::{self, File};
use std::os::unix::process::CommandExt;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use anyhow::{Context, bail};
use masseter_recording::Manifest;
use masseter_recording::RunFolder;
use masseter_report::histogram_log;
use masseter_shared::clock;
use masseter_shared::config::Scenario;
use rustix::process::{Pid, Signal, kill_process};

use super::candidate::{Candidate, Durations, Round, no_durations};
use super::comparison::{Comparison, take_turns};
use super::rate_summary::Summary;
use crate::machine::interrupts::Interrupts;

/// The name in results.
pub(super) const NAME: &str = "rate";
/// Rates, Hz; the others are compared with the first.
pub(super) const RATES_HZ: [u32; 5] = [1000, 2000, 5000, 10_000, 20_000];
/// Motion of a run, s; start, easing in and stop add more than a second.
const MOTION_S: f64 = 2.0;
/// Silence after which the rig stops, ms: at every rate that of a run at 1 kHz.
const TIMEOUT_MS: u32 = 20;
/// Time between two checks whether a run has ended; long, since the checks disturb the run.
const CHECK_EVERY: Duration = Duration::from_millis(50);
/// The last of the intervals.
pub(super) const ROUND_TRIP: &str = "round trip";
/// The intervals that are compared, with the names of their logs.
const INTERVALS: [(&str, &str); 3] =
    [("wake-up", "controller-wake-up"), ("controller cycle", "controller-cycle"), (ROUND_TRIP, "round-trip")];

/// The user stopped the bench.
#[derive(Debug, thiserror::Error)]
#[error("interrupted")]
pub(super) struct Interrupted;

/// The result of a run.
enum RunResult {
    /// The motion was played: durations of each interval, and shares.
    Played { durations: Vec<Durations>, shares: Vec<(String, f64)> },
    /// The motion was played, but messages are missing: the worst durations may be among them.
    Incomplete { shares: Vec<(String, f64)> },
    /// The motion was not played to its end.
    Stopped {
        /// Whether the machine stalled for too many cycles.
        is_disturbed: bool,
    },
}

pub(super) fn measure(rounds: u32, cores: [usize; 2]) -> anyhow::Result<Comparison> {
    let interrupts = Interrupts::listen().context("cannot listen for signals")?;
    let play = |index: usize| run_at(RATES_HZ[index], cores, &interrupts);
    let played = take_turns(rounds, RATES_HZ.len(), &cores, play);
    interrupts.restore_default_actions();
    let (runs, disturbance) = played?;
    let mut comparison = Comparison {
        bench: NAME,
        measures: "the whole rig without bus delays: wake-up of the controller after its deadline, controller cycle \
                   (reading received to command published), round trip (SYNC to reading published, reading received \
                   to command received)"
            .to_owned(),
        candidates: Vec::new(),
        ratios: Vec::new(),
        notes: Vec::new(),
        disturbance,
    };
    for (rate_hz, runs) in RATES_HZ.into_iter().zip(runs) {
        comparison.notes.extend(uncounted(rate_hz, &runs));
        comparison.candidates.extend(candidates(rate_hz, runs));
    }
    let [slowest_hz, faster_hz @ ..] = RATES_HZ;
    let against_slowest = |rate_hz| {
        INTERVALS
            .map(|(interval, _)| (candidate_name(rate_hz, interval), candidate_name(slowest_hz, interval)))
    };
    Ok(comparison.comparing(faster_hz.into_iter().flat_map(against_slowest)))
}

/// The name of an interval at a rate in results.
pub(super) fn candidate_name(rate_hz: u32, interval: &str) -> String {
    format!("{rate_hz} Hz, {interval}")
}

/// Notes about runs of a rate that do not count.
fn uncounted(rate_hz: u32, runs: &[RunResult]) -> Vec<String> {
    const REASONS: [&str; 3] = [
        "did not play to their end: the cores are too slow for this rate",
        "did not play to their end: the machine stalled for too long",
        "are not judged: messages are missing from their recordings",
    ];
    let reason = |run: &RunResult| match run {
        RunResult::Played { .. } => None,
        RunResult::Stopped { is_disturbed } => Some(REASONS[usize::from(*is_disturbed)]),
        RunResult::Incomplete { .. } => Some(REASONS[2]),
    };
    let count = |why| runs.iter().filter(|run| reason(run) == Some(why)).count();
    let notes = REASONS.into_iter().map(|why| (count(why), why)).filter(|(count, _)| *count > 0);
    notes
        .map(|(count, why)| format!("{rate_hz} Hz: {count} of {} runs do not count: they {why}", runs.len()))
        .collect()
}

/// One candidate for each interval; the last carries the shares.
fn candidates(rate_hz: u32, runs: Vec<RunResult>) -> Vec<Candidate> {
    let mut by_interval: Vec<Vec<Option<Round>>> = INTERVALS.iter().map(|_| Vec::new()).collect();
    for run in runs {
        let rounds: Vec<_> = match run {
            RunResult::Stopped { .. } => INTERVALS.iter().map(|_| None).collect(),
            RunResult::Played { durations, shares } => rounds_of(durations, shares),
            RunResult::Incomplete { shares } => rounds_of(INTERVALS.map(|_| no_durations()).into(), shares),
        };
        rounds.into_iter().zip(&mut by_interval).for_each(|(round, rounds)| rounds.push(round));
    }
    let named = INTERVALS.iter().zip(by_interval);
    named
        .map(|((interval, _), rounds)| Candidate::from_rounds(candidate_name(rate_hz, interval), rounds))
        .collect()
}

/// One round for each interval; the last carries the shares.
fn rounds_of(durations: Vec<Durations>, shares: Vec<(String, f64)>) -> Vec<Option<Round>> {
    let mut rounds: Vec<_> = durations.into_iter().map(Round::from).collect();
    if let Some(last) = rounds.last_mut() {
        last.shares = shares;
    }
    rounds.into_iter().map(Some).collect()
}

fn scenario(rate_hz: u32, cores: [usize; 2]) -> Scenario {
    let mut scenario =
        Scenario { name: "rate".to_owned(), rate_hz, duration_s: Some(MOTION_S), ..Scenario::default() };
    let timeout_cycles = TIMEOUT_MS * rate_hz / 1000;
    scenario.can.ideal = true;
    scenario.can.command_timeout_cycles = timeout_cycles;
    scenario.controller.stale_cycles = timeout_cycles;
    scenario.realtime.cores = cores;
    scenario
}

/// Makes a run at that rate.
fn run_at(rate_hz: u32, cores: [usize; 2], interrupts: &Interrupts) -> anyhow::Result<RunResult> {
    let scratch = tempfile::tempdir().context("cannot create a folder for the runs")?;
    let file = scratch.path().join("scenario.toml");
    fs::write(&file, scenario(rate_hz, cores).to_toml()).context("cannot write the scenario")?;
    let folder = scratch.path().join("run");
    let errors = scratch.path().join("errors");
    let mut run = Command::new(std::env::current_exe()?)
        .args(["run", "--quiet", "--format", "json", "--out"])
        .args([&folder, &file])
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(File::create(&errors).context("cannot create a file for the errors of a run")?)
        // An interrupt from the terminal reaches this process alone; it passes it on to the run.
        .process_group(0)
        .spawn()
        .context("cannot start a run")?;
    wait_for(&mut run, interrupts)?;
    if !folder.join("summary.json").exists() {
        bail!("a run at {rate_hz} Hz left no summary: {}", fs::read_to_string(errors)?.trim());
    }
    result(&RunFolder::open(&folder)?)
}

/// Waits for a run. Each interrupt is passed on to the run; the bench ends after it.
fn wait_for(run: &mut Child, interrupts: &Interrupts) -> anyhow::Result<()> {
    let mut passed_on = 0;
    while run.try_wait()?.is_none() {
        if passed_on < u8::from(interrupts.is_stop_requested()) + u8::from(interrupts.is_abort_requested()) {
            // The run may have ended meanwhile.
            let _ = kill_process(Pid::from_child(run), Signal::TERM);
            passed_on += 1;
        }
        clock::sleep(CHECK_EVERY);
    }
    if interrupts.is_stop_requested() { Err(Interrupted.into()) } else { Ok(()) }
}

fn result(folder: &RunFolder) -> anyhow::Result<RunResult> {
    let path = folder.summary();
    let summary: Summary = serde_json::from_reader(File::open(&path)?)
        .with_context(|| format!("cannot read {}", path.display()))?;
    if !summary.is_finished() {
        return Ok(RunResult::Stopped { is_disturbed: summary.is_disturbed() });
    }
    let shares = shares(folder, &summary)?;
    if !summary.is_whole() {
        return Ok(RunResult::Incomplete { shares });
    }
    let log = |(_, name): &(_, &str)| {
        let path = folder.file("hist").join(format!("{name}.hlog"));
        histogram_log::read(&path).with_context(|| format!("cannot read {}", path.display()))
    };
    Ok(RunResult::Played { durations: INTERVALS.iter().map(log).collect::<anyhow::Result<_>>()?, shares })
}

/// Deadlines missed, messages lost and CPU time used, %.
fn shares(folder: &RunFolder, summary: &Summary) -> anyhow::Result<Vec<(String, f64)>> {
    let usage = Manifest::read(folder)?.usage.processes;
    // A process that was sampled only once has no usage.
    let observed = usage.into_iter().filter(|(_, usage)| usage.observed_s > 0.0);
    let cpu = observed.map(|(process, usage)| (format!("{process} CPU"), usage.cpu_s / usage.observed_s));
    let lost = summary.shares().into_iter().map(|(name, share)| (name.to_owned(), share));
    Ok(lost.chain(cpu).map(|(name, share)| (name, share * 100.0)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::candidate::record;

    #[test]
    fn runs_that_stopped_or_lost_messages_are_noted_but_not_measured() {
        let mut slow = no_durations();
        record(&mut slow, 9000, 1);
        let played = RunResult::Played {
            durations: vec![slow.clone(), slow.clone(), slow],
            shares: vec![("missed".to_owned(), 2.0)],
        };
        let dropped = |percent| ("dropped".to_owned(), percent);
        let runs = vec![
            RunResult::Stopped { is_disturbed: true },
            played,
            RunResult::Stopped { is_disturbed: false },
            RunResult::Incomplete { shares: vec![dropped(40.0)] },
            RunResult::Incomplete { shares: vec![dropped(60.0)] },
        ];
        let notes = uncounted(5000, &runs);
        assert_eq!(notes.len(), 3);
        assert!(
            notes[2].starts_with("5000 Hz: 2 of 5 runs do not count") && notes[2].contains("missing"),
            "{notes:?}"
        );
        let candidates = candidates(5000, runs);
        let trip = candidates.last().unwrap();
        assert_eq!((trip.name.as_str(), trip.n, trip.rounds.len()), ("5000 Hz, round trip", 1, 5));
        assert!((trip.median("max").unwrap() - 9000.0).abs() < 10.0);
        let shares: Vec<_> =
            trip.shares.iter().map(|share| (share.name.as_str(), share.percent.median)).collect();
        assert_eq!(shares, [("dropped", 50.0), ("missed", 2.0)]);
    }
}
