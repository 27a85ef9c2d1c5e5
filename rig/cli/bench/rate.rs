//! `bench rate`: the whole rig at 1 to 20 kHz, and the CPU time that each rate takes. A bit on the wire takes 1 ns, so that
//! the durations are the rig's own.
//!
//! Each round of a rate is a run with three processes; the figures come from its recording. The run's verdict is not used,
//! except to find out whether the machine stalled.

use std::time::Duration;

use anyhow::Context;
use masseter_analysis::{Analysis, Code, Figures};
use masseter_recording::{Manifest, Reader, RunFolder};
use masseter_runtime::messages::codes::ControllerState;
use masseter_runtime::named::Declared;
use masseter_scenario::Scenario;
use masseter_terminal::Exit;

use super::candidate::{Candidate, Round};
use super::comparison::{Comparison, take_turns};
use super::durations::{Durations, no_durations};
use super::played_run::PlayedRun;
use crate::run::interrupts::Interrupts;

/// Rates, Hz; the others are compared with the first.
const RATES_HZ: [u32; 5] = [1000, 2000, 5000, 10_000, 20_000];
/// Motion of a run, s; start, easing in and stop add more than a second.
const MOTION_S: f64 = 2.0;
/// Silence after which the rig stops, ms: at every rate that of a run at 1 kHz.
const TIMEOUT_MS: u32 = 20;
/// Time between two checks whether a run has ended; long, since the checks disturb the run.
const CHECK_EVERY: Duration = Duration::from_millis(50);
/// The intervals that are compared, with their names in the figures of a run. The last carries the shares.
const INTERVALS: [(&str, &str); 3] = [
    ("wake-up", "controller wake-up"),
    ("controller cycle", "controller cycle"),
    ("round trip", "round trip"),
];
/// Why a run does not count.
const UNCOUNTED: [&str; 3] = [TOO_SLOW, STALLED, INCOMPLETE];
const TOO_SLOW: &str = "did not play to their end: the cores are too slow for this rate";
const STALLED: &str = "did not play to their end: the machine stalled for too long";
const INCOMPLETE: &str = "are not judged: messages are missing from their recordings";

/// The figures of a run.
#[derive(Debug)]
struct Run {
    /// Why it does not count, if it does not.
    uncounted: Option<&'static str>,
    /// Of each interval; empty if the run does not count.
    durations: [Durations; INTERVALS.len()],
    shares: Vec<(String, f64)>,
}

pub(super) fn measure(rounds: u32, cores: [usize; 2]) -> anyhow::Result<Comparison> {
    let interrupts = Interrupts::listen().context("cannot listen for signals")?;
    let play = |index: usize| run_at(RATES_HZ[index], cores, &interrupts);
    let played = take_turns(rounds, RATES_HZ.len(), &cores, play);
    interrupts.restore_default_actions();
    let (runs, disturbance) = played?;
    let runs_of_rates = || RATES_HZ.into_iter().zip(&runs);
    let comparison = Comparison {
        bench: "rate",
        measures: "the whole rig without bus delays: wake-up of the controller after its deadline, controller cycle \
                   (reading received to command published), round trip (SYNC to reading published, reading received \
                   to command received)",
        candidates: runs_of_rates().flat_map(|(rate_hz, runs)| candidates(rate_hz, runs)).collect(),
        ratios: Vec::new(),
        notes: runs_of_rates().flat_map(|(rate_hz, runs)| notes(rate_hz, runs)).collect(),
        disturbance,
    };
    let [slowest_hz, faster_hz @ ..] = RATES_HZ;
    let against_slowest =
        |rate_hz| INTERVALS.map(|(name, _)| [rate_hz, slowest_hz].map(|hz| named(hz, name)).into());
    Ok(comparison.comparing(faster_hz.into_iter().flat_map(against_slowest)))
}

/// The name of an interval at a rate in results.
fn named(rate_hz: u32, interval: &str) -> String {
    format!("{rate_hz} Hz, {interval}")
}

/// Notes about runs of a rate that do not count.
fn notes(rate_hz: u32, runs: &[Run]) -> impl Iterator<Item = String> {
    let counts = UNCOUNTED.map(|why| (why, runs.iter().filter(|run| run.uncounted == Some(why)).count()));
    let of = runs.len();
    let counts = counts.into_iter().filter(|(_, count)| *count > 0);
    counts.map(move |(why, count)| format!("{rate_hz} Hz: {count} of {of} runs do not count: they {why}"))
}

/// One candidate for each interval.
fn candidates(rate_hz: u32, runs: &[Run]) -> impl Iterator<Item = Candidate> {
    INTERVALS.iter().enumerate().map(move |(index, (name, _))| {
        let is_last = index + 1 == INTERVALS.len();
        let round = |run: &Run| Round {
            durations: run.durations[index].clone(),
            shares: if is_last { run.shares.clone() } else { Vec::new() },
        };
        Candidate::from_rounds(&named(rate_hz, name), runs.iter().map(round).collect())
    })
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
fn run_at(rate_hz: u32, cores: [usize; 2], interrupts: &Interrupts) -> anyhow::Result<Run> {
    let played = PlayedRun::make(&scenario(rate_hz, cores), "rt", CHECK_EVERY, interrupts)
        .with_context(|| format!("a run at {rate_hz} Hz"))?;
    let folder = RunFolder::open(&played.folder())?;
    let manifest = Manifest::read(&folder)?;
    Ok(Run::new(
        &figures(&folder, &manifest.scenario)?,
        &manifest,
        played.status.code() == Some(Exit::Invalid as i32),
    ))
}

fn figures(folder: &RunFolder, scenario: &Scenario) -> anyhow::Result<Figures> {
    let mut reader = Reader::open(&folder.recording())?;
    let mut analysis = Analysis::new(scenario, &Declared::default());
    while let Some(message) = reader.next_message()? {
        analysis.take(&message)?;
    }
    Ok(analysis.finish(reader.was_cut_short(), reader.damage()))
}

impl Run {
    fn new(figures: &Figures, manifest: &Manifest, is_disturbed: bool) -> Self {
        let uncounted = match figures.final_state {
            Some(Code::Known(ControllerState::Finished)) if figures.missing_messages() == 0 => None,
            Some(Code::Known(ControllerState::Finished)) => Some(INCOMPLETE),
            _ if is_disturbed => Some(STALLED),
            _ => Some(TOO_SLOW),
        };
        let durations = INTERVALS.map(|(_, name)| {
            let mut all = no_durations();
            let measured = figures.intervals.iter().filter(|found| found.name == name && uncounted.is_none());
            for (_, second) in measured.flat_map(|interval| interval.seconds.iter()) {
                all.add(second).expect("a histogram that resizes itself takes any other");
            }
            all
        });
        let is_played = matches!(uncounted, None | Some(INCOMPLETE));
        let shares = if is_played { shares(figures, manifest) } else { Vec::new() };
        Self { uncounted, durations, shares }
    }
}

/// Messages lost, or if none was lost, deadlines missed; and CPU time used, %.
fn shares(figures: &Figures, manifest: &Manifest) -> Vec<(String, f64)> {
    let published = |of: &[&str]| -> u64 {
        let topics = figures.topics.iter().filter(|topic| of.is_empty() || of.contains(&topic.topic));
        topics.map(|topic| topic.messages + topic.missing).sum()
    };
    let missing = figures.missing_messages();
    let mut shares = vec![("dropped".to_owned(), missing as f64 / published(&[]) as f64)];
    if missing == 0 {
        let (skipped, by_machine) = figures.skipped();
        // Each process publishes one of these per cycle, and none in a cycle that it skips.
        let deadlines = (published(&["state", "reading"]) + skipped) as f64;
        shares.push(("missed".to_owned(), skipped as f64 / deadlines));
        shares.push(("missed by the machine".to_owned(), by_machine as f64 / deadlines));
    }
    for (process, usage) in &manifest.usage.processes {
        shares.push((format!("{process} CPU"), usage.cpu_s / usage.observed_s));
    }
    shares.into_iter().map(|(name, share)| (name, share * 100.0)).collect()
}

#[cfg(test)]
mod tests {
    use masseter_recording::{MachineInfo, Recorded};
    use masseter_runtime::messages::{Reading, State};

    use super::super::durations::record;
    use super::*;

    #[test]
    fn runs_that_stopped_or_lost_messages_are_noted_but_not_measured() {
        let run = |uncounted: Option<&'static str>, shares: &[(&str, f64)]| {
            let mut durations = INTERVALS.map(|_| no_durations());
            if uncounted.is_none() {
                for of in &mut durations {
                    record(of, 9000, 1);
                }
            }
            let shares = shares.iter().map(|(name, percent)| ((*name).to_owned(), *percent)).collect();
            Run { uncounted, durations, shares }
        };
        let runs = [
            run(Some(STALLED), &[]),
            run(None, &[("missed", 2.0)]),
            run(Some(TOO_SLOW), &[]),
            run(Some(INCOMPLETE), &[("dropped", 40.0)]),
            run(Some(INCOMPLETE), &[("dropped", 60.0)]),
        ];
        let notes: Vec<_> = notes(5000, &runs).collect();
        assert_eq!(notes.len(), 3);
        assert!(
            notes[2].starts_with("5000 Hz: 2 of 5 runs do not count") && notes[2].contains("missing"),
            "{notes:?}"
        );
        let trip = candidates(5000, &runs).last().unwrap();
        assert_eq!((trip.name.as_str(), trip.n, trip.rounds.len()), ("5000 Hz, round trip", 1, 5));
        assert!((trip.percentiles.last().unwrap().median - 9000.0).abs() < 10.0);
        let shares: Vec<_> = trip.shares.iter().map(|share| (share.name.as_str(), share.median)).collect();
        assert_eq!(shares, [("dropped", 50.0), ("missed", 2.0)]);
    }

    /// A run of ten cycles whose last state has this sequence number.
    fn run(last_seq: u64, state: ControllerState, is_disturbed: bool) -> Run {
        let mut analysis = Analysis::new(&Scenario::default(), &Declared::default());
        for cycle in 1..=10 {
            let seq = if cycle == 10 { last_seq } else { cycle };
            let (due_ns, skipped_cycles) = (cycle * 1_000_000, if cycle > 5 { 5 } else { 0 });
            let timed = State { seq, cycle, due_ns, woke_ns: due_ns + 700, ..State::default() };
            let state = State { skipped_cycles, controller_state: state.code(), ..timed };
            analysis.take(&Recorded::State(state)).unwrap();
            analysis.take(&Recorded::Reading(Reading { seq: cycle, cycle, ..Reading::default() })).unwrap();
        }
        let machine = MachineInfo { cpu: String::new(), cores: 2, kernel: String::new(), is_virtual: false };
        let manifest = Manifest::new("0.1.0", Scenario::default(), 1.0, "rt", machine);
        Run::new(&analysis.finish(false, &[]), &manifest, is_disturbed)
    }

    #[test]
    fn misses_are_shares_of_the_deadlines_of_both_processes() {
        let played = run(10, ControllerState::Finished, false);
        assert_eq!((played.uncounted, played.durations[0].max()), (None, 700));
        let shares: Vec<_> = played.shares.iter().map(|(name, percent)| (name.as_str(), *percent)).collect();
        assert_eq!(shares, [("dropped", 0.0), ("missed", 20.0), ("missed by the machine", 0.0)]);
    }

    #[test]
    fn a_run_with_missing_messages_gives_only_their_share() {
        let incomplete = run(15, ControllerState::Finished, false);
        assert_eq!(incomplete.uncounted, Some(INCOMPLETE));
        assert!(incomplete.durations.iter().all(Durations::is_empty));
        assert_eq!(incomplete.shares, [("dropped".to_owned(), 20.0)]);
    }

    #[test]
    fn a_run_that_did_not_finish_is_blamed_on_the_machine_only_if_it_stalled() {
        for (is_disturbed, why) in [(false, TOO_SLOW), (true, STALLED)] {
            let stopped = run(10, ControllerState::Running, is_disturbed);
            assert_eq!((stopped.uncounted, stopped.shares), (Some(why), Vec::new()));
        }
    }
}
