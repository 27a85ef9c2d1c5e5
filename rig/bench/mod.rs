//! `masseter bench`: what the rig's parts cost, each beside a baseline in the same run.
//!
//! Contenders take turns, round by round, because a machine changes its pace from second to second; what
//! counts is the ratio within a round (`contest`). The rig is not judged here, but the machine is: `disturbance`.

mod circumstances;
mod contender;
mod contest;
mod disturbance;
mod fk;
pub mod ipc;
mod plot;
mod rate;
mod rate_plot;
mod rate_summary;
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

use circumstances::Circumstances;
use contest::Outcome;
use masseter_terminal::result;
use masseter_terminal::{Exit, Failure, OrFailure};
use masseter_terminal::{Format, status};

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
    #[arg(long, value_name = "N,N", value_parser = crate::arguments::parse_cores, default_value = "0,1")]
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
    circumstances: Circumstances,
    outcomes: Vec<Outcome>,
}

/// Measures what was asked for, one after the other; what is done is kept when a later one fails.
pub(crate) fn run(args: &BenchArgs) -> Result<Exit, Failure> {
    circumstances::check_cores(&args.kinds, args.cores).usage()?;
    if let Some(folder) = &args.out {
        fs::create_dir_all(folder).with_context(|| format!("cannot create {}", folder.display())).usage()?;
    }
    let mut results = Results {
        form: FORM,
        masseter: env!("CARGO_PKG_VERSION"),
        circumstances: Circumstances::on(args.cores),
        outcomes: Vec::new(),
    };
    let measured = measure_each(args, &mut results);
    if args.format == Format::Json {
        results.to_json().and_then(|json| result(&json)).usage()?;
    }
    measured.map_err(|error| {
        let exit = if error.is::<rate::Interrupted>() { Exit::Interrupted } else { Exit::Usage };
        Failure::with(exit, error)
    })?;
    let disturbed = results.outcomes.iter().any(|outcome| outcome.disturbance.disturbed);
    Ok(if disturbed { Exit::Invalid } else { Exit::Passed })
}

fn measure_each(args: &BenchArgs, results: &mut Results) -> anyhow::Result<()> {
    for kind in &args.kinds {
        let name = kind_name(*kind);
        status!("bench {name}: {} rounds …", args.rounds);
        let outcome = measure(*kind, args).with_context(|| format!("bench {name}"))?;
        let table = table::of(&outcome);
        results.outcomes.push(outcome);
        if let Some(folder) = &args.out {
            results.write(folder).with_context(|| format!("cannot write to {}", folder.display()))?;
        }
        if args.format == Format::Human {
            result(&table)?;
        }
    }
    Ok(())
}

fn measure(kind: Kind, args: &BenchArgs) -> anyhow::Result<Outcome> {
    match kind {
        Kind::Loop => wake::measure(args.rounds, args.cores[0]),
        Kind::Ipc => ipc::measure(args.rounds, args.cores),
        Kind::Fk => fk::measure(args.rounds, args.cores[0]),
        Kind::Rate => rate::measure(args.rounds, args.cores),
        Kind::Subscribers => subscribers::measure(args.rounds, args.cores[0]),
    }
}

fn kind_name(kind: Kind) -> String {
    kind.to_possible_value().map_or_else(String::new, |value| value.get_name().to_owned())
}

impl Results {
    fn to_json(&self) -> anyhow::Result<String> {
        Ok(serde_json::to_string_pretty(self).context("cannot write the results")? + "\n")
    }

    /// `results.json`, and of the last bench a log a contender and a plot.
    fn write(&self, folder: &Path) -> anyhow::Result<()> {
        fs::write(folder.join("results.json"), self.to_json()?)?;
        let Some(outcome) = self.outcomes.last() else { return Ok(()) };
        outcome.write_logs(folder)?;
        let plot = if outcome.bench == rate::NAME { rate_plot::of(outcome) } else { plot::of(outcome) };
        if let Some(svg) = plot {
            fs::write(folder.join(format!("{}.svg", outcome.bench)), svg)?;
        }
        Ok(())
    }
}

/// Asks for the real time of a run on behalf of the calling thread.
fn realtime_on(core: usize) -> Obtained {
    let priority = RealtimeConfig::default().priority;
    obtain(Wanted { core: Some(core), fifo_priority: Some(priority), locked_memory: true })
}

/// Runs `work` on a thread of its own that has the real time of a run; what is refused has been said by then.
fn on_core<T: Send>(core: usize, work: impl FnOnce() -> T + Send) -> T {
    std::thread::scope(|scope| {
        let thread = scope.spawn(|| {
            realtime_on(core);
            work()
        });
        thread.join().expect("measuring does not panic")
    })
}
