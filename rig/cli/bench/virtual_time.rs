//! `bench virtual`: one motion of 10 s under virtual time without a recording, as a campaign plays it: from its plan to its
//! verdict, in one thread.

use std::fs;

use anyhow::{Context, ensure};
use masseter_runtime::clock;
use masseter_runtime::realtime::scheduling::{SchedulingRequest, obtain};
use masseter_terminal::Exit;
use rustix::mm::munlockall;

use super::candidate::{Candidate, Round};
use super::comparison::{Comparison, take_turns};
use super::durations::{no_durations, record};
use super::played_run::Interrupted;
use crate::run::interrupts::Interrupts;
use crate::run::judge_unrecorded;
use crate::run::request::{ClockKind, RunRequest};

/// Motion of a run, ns.
const MOTION_NS: f64 = 10e9;

/// What a run took.
struct Taken {
    wall_ns: u64,
    cpu_ns: u64,
    most_memory_kb: u64,
}

pub(super) fn measure(rounds: u32, core: usize) -> anyhow::Result<Comparison> {
    let interrupts = Interrupts::listen().context("cannot listen for signals")?;
    // Other benches lock the memory, which fills it with pages that nobody uses.
    munlockall().context("cannot unlock the memory")?;
    let played = take_turns(rounds, 1, &[core], |_| {
        std::thread::scope(|scope| {
            scope.spawn(|| play(core, &interrupts)).join().expect("a run does not panic")
        })
    });
    interrupts.restore_default_actions();
    let (runs, disturbance) = played?;
    let candidate = |name: &str, taken_ns: fn(&Taken) -> u64| {
        let round = |taken: &Taken| {
            let mut durations = no_durations();
            record(&mut durations, taken_ns(taken), 1);
            Round::from(durations)
        };
        Candidate::from_rounds(name, runs.iter().flatten().map(round).collect())
    };
    let candidates =
        vec![candidate("wall time", |taken| taken.wall_ns), candidate("CPU time", |taken| taken.cpu_ns)];
    let times = candidates.iter().filter_map(|candidate| {
        let median_ns = candidate.percentiles.first()?.median;
        Some(format!("{}: {:.1} times real time", candidate.name, MOTION_NS / median_ns))
    });
    let most_kb = runs.iter().flatten().map(|taken| taken.most_memory_kb).max().unwrap_or(0);
    let memory = format!("memory of the process: at most {:.1} MB", most_kb as f64 * 1.024e-3);
    Ok(Comparison {
        bench: "virtual",
        measures: "one motion of 10 s at 1 kHz without a recording, from its plan to its verdict",
        notes: times.chain([memory]).collect(),
        candidates,
        ratios: Vec::new(),
        disturbance,
    })
}

/// Plays the default scenario on a core.
fn play(core: usize, interrupts: &Interrupts) -> anyhow::Result<Taken> {
    obtain(SchedulingRequest { core: Some(core), fifo_priority: None, locked_memory: false });
    fs::write("/proc/self/clear_refs", "5").context("cannot restart the count of the most memory")?;
    let from_ns = [clock::now_ns(), clock::thread_cpu_ns()];
    let args = RunRequest { clock: ClockKind::Virtual, ..RunRequest::default() };
    let judgement = judge_unrecorded(&args, interrupts).map_err(|failure| failure.error)?;
    let to_ns = [clock::now_ns(), clock::thread_cpu_ns()];
    ensure!(!interrupts.is_stop_requested(), Interrupted);
    let (exit, reason) = (judgement.verdict.exit_code, &judgement.verdict.reason);
    ensure!(exit == Exit::Passed, "the run ended with {exit:?}: {reason}");
    let [wall_ns, cpu_ns] = [0, 1].map(|clock| to_ns[clock] - from_ns[clock]);
    Ok(Taken { wall_ns, cpu_ns, most_memory_kb: most_memory_kb()? })
}

/// The most memory that this process has used since the count was restarted.
fn most_memory_kb() -> anyhow::Result<u64> {
    let status = fs::read_to_string("/proc/self/status").context("cannot read the memory in use")?;
    let most = status.lines().find_map(|line| line.strip_prefix("VmHWM:")?.strip_suffix("kB"));
    most.and_then(|most| most.trim().parse().ok()).context("/proc/self/status has no VmHWM")
}
