//! `masseter bench`: what the rig's parts cost, each beside a baseline in the same run.
//!
//! Contenders take turns, round by round, because a machine changes its pace from second to second; what
//! counts is the ratio within a round (`contest`). Nothing is judged here.

mod contest;
mod fk;
pub mod ipc;
mod plot;
mod rate;
mod subscribers;
mod table;
mod wake;

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::Context;
use clap::{Args, ValueEnum};
use masseter_shared::config::RealtimeConfig;
use masseter_shared::realtime::scheduling::{Obtained, Wanted, obtain};
use serde::Serialize;

use crate::cli::Format;
use crate::exit::{Exit, Failure};
use crate::say::show;
use contest::Outcome;

/// Version of the result's form.
const FORM: u32 = 1;

/// What can be measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Kind {
    /// Wake-ups of the real-time loop, against cyclictest or a plain sleep loop
    Loop,
    /// Command and reading between two processes, against bare iceoryx2, a cache line, a socket, a pipe
    Ipc,
    /// The forward kinematics, warm and cold, against Newton's iteration
    Fk,
    /// The whole rig at 1 to 20 kHz without bus delays
    Rate,
    /// Publishing to 1 to 16 observers
    Subscribers,
}

/// What `bench` takes.
#[derive(Debug, Clone, Args)]
pub struct BenchArgs {
    /// What to measure
    #[arg(required = true, value_enum)]
    kinds: Vec<Kind>,
    /// Rounds in which the contenders take turns
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=1000))]
    rounds: u32,
    /// Cores of the two sides
    #[arg(long, value_name = "N,N", value_parser = crate::cli::parse_cores, default_value = "0,1")]
    cores: [usize; 2],
    /// Writes results, HdrHistogram logs and plots there
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// How the result is written to standard output
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

#[derive(Debug, Serialize)]
struct Results {
    form: u32,
    masseter: &'static str,
    outcomes: Vec<Outcome>,
}

/// Measures what was asked for, one after the other.
pub(crate) fn run(args: &BenchArgs) -> Result<Exit, Failure> {
    let mut outcomes = Vec::new();
    for kind in &args.kinds {
        eprintln!("bench {}: {} rounds …", kind_name(*kind), args.rounds);
        let outcome = match kind {
            Kind::Loop => wake::measure(args.rounds, args.cores[0])?,
            Kind::Ipc => ipc::measure(args.rounds, args.cores)?,
            Kind::Fk => fk::measure(args.rounds, args.cores[0])?,
            Kind::Rate => rate::measure(args.rounds, args.cores)?,
            Kind::Subscribers => subscribers::measure(args.rounds, args.cores[0])?,
        };
        if args.format == Format::Human {
            show(&table::of(&outcome));
        }
        outcomes.push(outcome);
    }
    let results = Results { form: FORM, masseter: env!("CARGO_PKG_VERSION"), outcomes };
    let json = serde_json::to_string_pretty(&results).context("cannot write the results")? + "\n";
    if args.format == Format::Json {
        show(&json);
    }
    if let Some(folder) = &args.out {
        write(folder, &json, &results.outcomes)?;
    }
    Ok(Exit::Passed)
}

fn kind_name(kind: Kind) -> String {
    kind.to_possible_value().map_or_else(String::new, |value| value.get_name().to_owned())
}

/// `results.json`, and a log a contender and a plot a bench.
fn write(folder: &Path, json: &str, outcomes: &[Outcome]) -> anyhow::Result<()> {
    let failed = || format!("cannot write to {}", folder.display());
    fs::create_dir_all(folder).with_context(failed)?;
    fs::write(folder.join("results.json"), json).with_context(failed)?;
    for outcome in outcomes {
        outcome.write_logs(folder).with_context(failed)?;
        if let Some(svg) = plot::of(outcome) {
            fs::write(folder.join(format!("{}.svg", outcome.bench)), svg).with_context(failed)?;
        }
    }
    Ok(())
}

/// Asks for the real time of a run on behalf of the calling thread.
fn realtime_on(core: usize) -> Obtained {
    let priority = RealtimeConfig::default().priority;
    obtain(Wanted { core: Some(core), fifo_priority: Some(priority), locked_memory: true })
}

/// Runs `work` on a thread of its own that has the real time of a run; with what was refused.
fn on_core<T: Send>(core: usize, work: impl FnOnce() -> T + Send) -> T {
    std::thread::scope(|scope| {
        let thread = scope.spawn(|| {
            for refusal in realtime_on(core).refusals {
                eprintln!("  {refusal}");
            }
            work()
        });
        thread.join().expect("measuring does not panic")
    })
}
