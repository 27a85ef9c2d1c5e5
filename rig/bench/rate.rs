//! `bench rate`: the whole rig at 1 to 20 kHz, on wires whose bits take a nanosecond, so that what remains is the
//! rig's own time; and what each rate costs.
//!
//! Each turn is a run of its own with three processes, judged by nobody; the durations are those of its recording.

use std::fs::{self, File};
use std::os::unix::process::CommandExt;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use anyhow::{Context, bail};
use masseter_shared::clock;
use masseter_shared::config::Scenario;
use rustix::process::{Pid, Signal, kill_process};

use super::contender::{Contender, Durations, Round, durations as empty};
use super::contest::{Outcome, take_turns};
use super::rate_summary::Summary;
use crate::machine::interrupts::Interrupts;
use masseter_recording::Manifest;
use masseter_recording::RunFolder;
use masseter_report::histogram_log;

/// As it is called in results.
pub(super) const NAME: &str = "rate";
/// Rates, Hz; the others are compared with the first.
pub(super) const RATES_HZ: [u32; 5] = [1000, 2000, 5000, 10_000, 20_000];
/// Motion of a turn, s; starting, easing in and stopping add more than a second.
const MOTION_S: f64 = 2.0;
/// Silence after which the rig stops, ms, whatever the rate: as long as in a run at 1 kHz.
const PATIENCE_MS: u32 = 20;
/// How often it is looked whether a run has ended or is to end; seldom, since it is measured.
const LOOK: Duration = Duration::from_millis(50);
/// The last of the intervals.
pub(super) const ROUND_TRIP: &str = "round trip";
/// The intervals that are compared, as their logs are named.
const INTERVALS: [(&str, &str); 3] =
    [("wake-up", "controller-wake-up"), ("controller cycle", "controller-cycle"), (ROUND_TRIP, "round-trip")];

/// Whoever started the bench has had enough of it.
#[derive(Debug, thiserror::Error)]
#[error("interrupted")]
pub(super) struct Interrupted;

/// What a turn gave.
enum Turn {
    /// The motion was played: an interval's durations each, and what else it tells.
    Played { durations: Vec<Durations>, shares: Vec<(String, f64)> },
    /// It was, but not everything was recorded: the durations are those of some cycles, and perhaps not of the worst.
    Incomplete { shares: Vec<(String, f64)> },
    /// It was not: a part of one is no run at that rate.
    Stopped {
        /// Whether the machine kept the rig from too many cycles to judge it.
        is_disturbed: bool,
    },
}

pub(super) fn measure(rounds: u32, cores: [usize; 2]) -> anyhow::Result<Outcome> {
    let interrupts = Interrupts::listen().context("cannot listen for signals")?;
    let play = |index: usize| run_at(RATES_HZ[index], cores, &interrupts);
    let played = take_turns(rounds, RATES_HZ.len(), &cores, play);
    interrupts.restore_default_actions();
    let (turns, disturbance) = played?;
    let mut outcome = Outcome {
        bench: NAME,
        measures: "the whole rig without bus delays: wake-up of the controller after its deadline, controller cycle \
                   (reading received to command published), round trip (SYNC to reading published, reading received \
                   to command received)"
            .to_owned(),
        contenders: Vec::new(),
        ratios: Vec::new(),
        notes: Vec::new(),
        disturbance,
    };
    for (rate_hz, turns) in RATES_HZ.into_iter().zip(turns) {
        outcome.notes.extend(uncounted(rate_hz, &turns));
        outcome.contenders.extend(contenders(rate_hz, turns));
    }
    let [slowest_hz, faster_hz @ ..] = RATES_HZ;
    let against_slowest = |rate_hz| {
        INTERVALS
            .map(|(interval, _)| (contender_name(rate_hz, interval), contender_name(slowest_hz, interval)))
    };
    Ok(outcome.comparing(faster_hz.into_iter().flat_map(against_slowest)))
}

/// What an interval at a rate is called in results.
pub(super) fn contender_name(rate_hz: u32, interval: &str) -> String {
    format!("{rate_hz} Hz, {interval}")
}

/// Why runs of a rate do not count.
fn uncounted(rate_hz: u32, turns: &[Turn]) -> Vec<String> {
    const REASONS: [&str; 3] = [
        "did not play to their end: the cores do not hold this rate",
        "did not play to their end: the machine stood still for too long",
        "are not judged: messages are missing from their recordings",
    ];
    let reason = |turn: &Turn| match turn {
        Turn::Played { .. } => None,
        Turn::Stopped { is_disturbed } => Some(REASONS[usize::from(*is_disturbed)]),
        Turn::Incomplete { .. } => Some(REASONS[2]),
    };
    let count = |why| turns.iter().filter(|turn| reason(turn) == Some(why)).count();
    let told = REASONS.into_iter().map(|why| (count(why), why)).filter(|(count, _)| *count > 0);
    told.map(|(count, why)| format!("{rate_hz} Hz: {count} of {} runs do not count, they {why}", turns.len()))
        .collect()
}

/// A contender an interval; the last one carries the shares.
fn contenders(rate_hz: u32, turns: Vec<Turn>) -> Vec<Contender> {
    let mut by_interval: Vec<Vec<Option<Round>>> = INTERVALS.iter().map(|_| Vec::new()).collect();
    for turn in turns {
        let rounds: Vec<_> = match turn {
            Turn::Stopped { .. } => INTERVALS.iter().map(|_| None).collect(),
            Turn::Played { durations, shares } => rounds_of(durations, shares),
            Turn::Incomplete { shares } => rounds_of(INTERVALS.map(|_| empty()).into(), shares),
        };
        rounds.into_iter().zip(&mut by_interval).for_each(|(round, rounds)| rounds.push(round));
    }
    let named = INTERVALS.iter().zip(by_interval);
    named.map(|((interval, _), rounds)| Contender::of(contender_name(rate_hz, interval), rounds)).collect()
}

/// A round an interval; the last one carries the shares.
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
    let patience_cycles = PATIENCE_MS * rate_hz / 1000;
    scenario.can.ideal = true;
    scenario.can.command_timeout_cycles = patience_cycles;
    scenario.controller.stale_cycles = patience_cycles;
    scenario.realtime.cores = cores;
    scenario
}

/// Plays a motion at that rate.
fn run_at(rate_hz: u32, cores: [usize; 2], interrupts: &Interrupts) -> anyhow::Result<Turn> {
    let place = tempfile::tempdir().context("cannot create a folder for the runs")?;
    let file = place.path().join("scenario.toml");
    fs::write(&file, scenario(rate_hz, cores).to_toml()).context("cannot write the scenario")?;
    let folder = place.path().join("run");
    let errors = place.path().join("errors");
    let mut run = Command::new(std::env::current_exe()?)
        .args(["run", "--quiet", "--format", "json", "--out"])
        .args([&folder, &file])
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(File::create(&errors).context("cannot create a file for what a run says")?)
        // A key on the terminal reaches this process alone, which tells the run.
        .process_group(0)
        .spawn()
        .context("cannot start a run")?;
    wait_for(&mut run, interrupts)?;
    if !folder.join("summary.json").exists() {
        bail!("a run at {rate_hz} Hz left no summary: {}", fs::read_to_string(errors)?.trim());
    }
    turn(&RunFolder::open(&folder)?)
}

/// Waits for a run. Each interrupt is handed on to it; the bench ends behind it.
fn wait_for(run: &mut Child, interrupts: &Interrupts) -> anyhow::Result<()> {
    let mut handed_on = 0;
    while run.try_wait()?.is_none() {
        if handed_on < u8::from(interrupts.is_stop_requested()) + u8::from(interrupts.is_abort_requested()) {
            // It may have ended meanwhile.
            let _ = kill_process(Pid::from_child(run), Signal::TERM);
            handed_on += 1;
        }
        clock::sleep(LOOK);
    }
    if interrupts.is_stop_requested() { Err(Interrupted.into()) } else { Ok(()) }
}

fn turn(folder: &RunFolder) -> anyhow::Result<Turn> {
    let path = folder.summary();
    let summary: Summary = serde_json::from_reader(File::open(&path)?)
        .with_context(|| format!("cannot read {}", path.display()))?;
    if !summary.is_finished() {
        return Ok(Turn::Stopped { is_disturbed: summary.is_disturbed() });
    }
    let shares = shares(folder, &summary)?;
    if !summary.is_whole() {
        return Ok(Turn::Incomplete { shares });
    }
    let log = |(_, name): &(_, &str)| {
        let path = folder.histograms().join(format!("{name}.hlog"));
        histogram_log::read(&path).with_context(|| format!("cannot read {}", path.display()))
    };
    Ok(Turn::Played { durations: INTERVALS.iter().map(log).collect::<anyhow::Result<_>>()?, shares })
}

/// What a run missed, lost and cost, %.
fn shares(folder: &RunFolder, summary: &Summary) -> anyhow::Result<Vec<(String, f64)>> {
    let usage = Manifest::read(folder)?.usage.processes;
    // One that was looked at only once has no usage.
    let observed = usage.into_iter().filter(|(_, usage)| usage.observed_s > 0.0);
    let cpu = observed.map(|(process, usage)| (format!("{process} CPU"), usage.cpu_s / usage.observed_s));
    let lost = summary.shares().into_iter().map(|(name, share)| (name.to_owned(), share));
    Ok(lost.chain(cpu).map(|(name, share)| (name, share * 100.0)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::contender::record;

    #[test]
    fn runs_that_stopped_or_lost_messages_are_counted_and_told_but_not_measured() {
        let mut slow = empty();
        record(&mut slow, 9000, 1);
        let played = Turn::Played {
            durations: vec![slow.clone(), slow.clone(), slow],
            shares: vec![("missed".to_owned(), 2.0)],
        };
        let dropped = |percent| ("dropped".to_owned(), percent);
        let turns = vec![
            Turn::Stopped { is_disturbed: true },
            played,
            Turn::Stopped { is_disturbed: false },
            Turn::Incomplete { shares: vec![dropped(40.0)] },
            Turn::Incomplete { shares: vec![dropped(60.0)] },
        ];
        let notes = uncounted(5000, &turns);
        assert_eq!(notes.len(), 3);
        assert!(
            notes[2].starts_with("5000 Hz: 2 of 5 runs do not count") && notes[2].contains("missing"),
            "{notes:?}"
        );
        let contenders = contenders(5000, turns);
        let trip = contenders.last().unwrap();
        assert_eq!((trip.name.as_str(), trip.n, trip.rounds.len()), ("5000 Hz, round trip", 1, 5));
        assert!((trip.median("max").unwrap() - 9000.0).abs() < 10.0);
        let shares: Vec<_> =
            trip.shares.iter().map(|share| (share.name.as_str(), share.percent.median)).collect();
        assert_eq!(shares, [("dropped", 50.0), ("missed", 2.0)]);
    }
}
