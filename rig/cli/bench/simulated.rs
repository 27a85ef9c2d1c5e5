//! `bench simulated`: how fast runs in simulated time are, from the start of the run to its verdict.
//!
//! Each round of a clock is a whole run of the default scenario; its wall time is divided by its cycles.

use std::fs;
use std::time::Duration;

use anyhow::{Context, ensure};
use masseter_runtime::clock;
use masseter_scenario::Scenario;
use masseter_terminal::Exit;
use serde_json::Value;

use super::candidate::Candidate;
use super::comparison::{Comparison, Turn};
use super::durations::{Durations, no_durations, record};
use super::played_run::PlayedRun;
use crate::run::interrupts::Interrupts;

/// Motion of a run, s; start and report are a small part of so long a run.
const MOTION_S: f64 = 30.0;
/// Time between two checks whether a run has ended.
const CHECK_EVERY: Duration = Duration::from_millis(2);

pub(super) fn measure(rounds: u32, cores: [usize; 2]) -> anyhow::Result<Comparison> {
    const LOCKSTEP: &str = "lockstep";
    const VIRTUAL: &str = "virtual";
    let interrupts = Interrupts::listen().context("cannot listen for signals")?;
    let interrupts_seen = &interrupts;
    let run = |clock| -> Turn { Box::new(move || Ok(per_cycle(clock, cores, interrupts_seen)?.into())) };
    let turns = vec![(LOCKSTEP, run(LOCKSTEP)), (VIRTUAL, run(VIRTUAL))];
    let measures = "wall time of a whole run, from its start to its verdict, per cycle";
    let compared = Comparison::by_turns("simulated", measures, rounds, &cores, turns);
    interrupts.restore_default_actions();
    let mut comparison = compared?.comparing([(LOCKSTEP, VIRTUAL)]);
    comparison.notes = comparison.candidates.iter().filter_map(times_real_time).collect();
    Ok(comparison)
}

/// Wall time per cycle, once: a round has one run.
fn per_cycle(clock: &str, cores: [usize; 2], interrupts: &Interrupts) -> anyhow::Result<Durations> {
    let mut scenario =
        Scenario { name: "simulated".to_owned(), duration_s: Some(MOTION_S), ..Scenario::default() };
    scenario.realtime.cores = cores;
    let from_ns = clock::now_ns();
    let run = PlayedRun::make(&scenario, clock, CHECK_EVERY, interrupts)
        .with_context(|| format!("a run by --clock {clock}"))?;
    let wall_ns = clock::now_ns() - from_ns;
    let code = run.status.code();
    ensure!(code == Some(Exit::Passed as i32), "a run by --clock {clock} ended with {code:?} instead of 0");
    let summary: Value = serde_json::from_slice(&fs::read(run.folder().join("summary.json"))?)?;
    let cycles = summary["figures"]["cycles"].as_u64().context("a summary has no cycles")?;
    let mut durations = no_durations();
    record(&mut durations, wall_ns / cycles.max(1), 1);
    Ok(durations)
}

fn times_real_time(candidate: &Candidate) -> Option<String> {
    let taken = candidate.percentiles.first()?;
    let period_ns = Scenario::default().period_ns() as f64;
    Some(format!("{}: {:.1} times real time", candidate.name, period_ns / taken.median))
}
