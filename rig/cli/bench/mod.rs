//! `masseter bench loop`: wake-up latency of the real-time loop, beside that of cyclictest in the same run.
//!
//! Candidates take turns, round by round, because a machine changes its speed from second to second; the ratio within a
//! round counts ([`candidate`]). No bench judges the rig; [`disturbance`] judges the machine. What only developers
//! measure is in `scripts/bench`.

mod candidate;
mod disturbance;
mod wake;

use std::fs;
use std::path::{Path, PathBuf};
use std::thread;

use anyhow::Context;
use clap::{Args, Subcommand};
use masseter_recording::MachineInfo;
use masseter_runtime::realtime::scheduling::{Obtained, SchedulingRequest, obtain};
use masseter_scenario::RealtimeConfig;
use masseter_scenario::wording::counted;
use masseter_terminal::{Exit, Failure, Format, OrFailure, result, status};
use serde::Serialize;

use crate::BUILD;
use candidate::{Candidate, Ratio, Turn};
use disturbance::{Disturbance, Stillness};

/// Version of the form of `results.json`.
const FORM: u32 = 3;

/// The benches.
#[derive(Debug, Clone, Subcommand)]
pub(super) enum BenchVerb {
    /// Wake-ups of the real-time loop, against cyclictest
    #[command(after_help = "Example:\n  masseter bench loop --out figures")]
    Loop(LoopArgs),
}

/// The arguments of `bench loop`.
#[derive(Debug, Clone, Args)]
pub(super) struct LoopArgs {
    /// Rounds in which the candidates take turns
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=1000))]
    rounds: u32,
    /// Core of the loop
    #[arg(long, value_name = "N", default_value_t = 0)]
    core: usize,
    /// Folder for results and HdrHistogram logs
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Format of standard output
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

/// Measures, prints and keeps the results; [`Exit::Invalid`] on a disturbed machine.
pub(super) fn execute(BenchVerb::Loop(args): &BenchVerb) -> Result<Exit, Failure> {
    if let Some(folder) = &args.out {
        fs::create_dir_all(folder).with_context(|| format!("cannot create {}", folder.display())).usage()?;
    }
    status!("bench loop: {} …", counted(args.rounds.into(), "round"));
    let results = wake::measure(args.rounds, args.core).usage()?;
    let json = serde_json::to_string_pretty(&results).context("cannot write the results").usage()? + "\n";
    if let Some(folder) = &args.out {
        results
            .write(folder, &json)
            .with_context(|| format!("cannot write to {}", folder.display()))
            .usage()?;
    }
    result(&if args.format == Format::Json { json } else { results.in_words() }).usage()?;
    Ok(if results.disturbance.disturbed { Exit::Invalid } else { Exit::Passed })
}

/// The results with the circumstances.
#[derive(Debug, Serialize)]
struct Results {
    form: u32,
    masseter: &'static str,
    machine: MachineInfo,
    core: usize,
    /// Of a thread on the core.
    scheduling: Obtained,
    /// What the durations measure.
    measures: &'static str,
    candidates: Vec<Candidate>,
    ratios: Vec<Ratio>,
    notes: Vec<String>,
    #[serde(flatten)]
    disturbance: Disturbance,
}

impl Results {
    /// Measures a round of each candidate in turn, observes the machine before each, and compares `own` with the
    /// others. Each round begins with another candidate.
    fn by_turns<'a>(
        rounds: u32,
        core: usize,
        own: Vec<(&'static str, Turn<'a>)>,
        others: Vec<(&'static str, Turn<'a>)>,
    ) -> anyhow::Result<Self> {
        let scheduling = thread::spawn(move || realtime_on(core)).join().expect("the kernel is only asked");
        scheduling.refusals.iter().for_each(|refusal| status!("  {refusal}"));
        let own_count = own.len();
        let (names, mut turns): (Vec<_>, Vec<_>) = own.into_iter().chain(others).unzip();
        let mut measured: Vec<Vec<_>> = turns.iter().map(|_| Vec::new()).collect();
        let mut stillness = Stillness::begin(core);
        for round in 0..rounds as usize {
            for place in 0..turns.len() {
                let index = (round + place) % turns.len();
                stillness.observe();
                measured[index].push(turns[index]()?);
            }
        }
        let candidates = names.into_iter().zip(measured).map(|(name, rounds)| Candidate::new(name, rounds));
        let candidates: Vec<_> = candidates.collect();
        let (own, others) = candidates.split_at(own_count);
        let ratios = own.iter().flat_map(|own| others.iter().map(|other| own.ratio_to(other))).collect();
        Ok(Self {
            form: FORM,
            masseter: BUILD,
            machine: masseter_machine::describe(),
            core,
            scheduling,
            measures: "wake-up latency at 1 kHz, one SCHED_FIFO thread on one core",
            candidates,
            ratios,
            notes: Vec::new(),
            disturbance: stillness.end(),
        })
    }

    /// `results.json`, and a HdrHistogram V2 interval log for each candidate, with one line per round.
    fn write(&self, folder: &Path, json: &str) -> anyhow::Result<()> {
        fs::write(folder.join("results.json"), json)?;
        Ok(self.candidates.iter().try_for_each(|candidate| candidate.write_log(folder))?)
    }

    /// Candidates in µs, then their ratios: median (minimum to maximum) over the rounds.
    fn in_words(&self) -> String {
        let rounds = self.candidates.first().map_or(0, Candidate::round_count);
        let rows = self.candidates.iter().map(Candidate::row).collect::<Vec<_>>();
        let ratios = self.ratios.iter().map(Ratio::row).collect::<Vec<_>>();
        let width = rows.iter().chain(&ratios).map(|(name, _)| name.chars().count()).max().unwrap_or(0);
        let line = |(name, figures): &(String, String)| format!("  {name:<width$} {figures}\n");
        let mut text = format!(
            "\nloop: {}\nmedian (minimum–maximum) of {}, µs\n",
            self.measures,
            counted(rounds as u64, "round")
        );
        text.extend(rows.iter().map(line));
        text += if ratios.is_empty() { "" } else { "ratios within a round\n" };
        text.extend(ratios.iter().map(line));
        text.extend(self.notes.iter().map(|note| format!("  {note}\n")));
        text.extend(self.disturbance.reason.iter().map(|reason| format!("INVALID: {reason}\n")));
        text
    }
}

/// Asks the kernel for the settings of a run on behalf of the calling thread.
fn realtime_on(core: usize) -> Obtained {
    let priority = RealtimeConfig::default().priority;
    obtain(SchedulingRequest { core: Some(core), fifo_priority: Some(priority), locked_memory: true })
}

/// Runs `work` on a new thread with these settings, as far as the kernel grants them.
fn on_core<T: Send>(core: usize, work: impl FnOnce() -> T + Send) -> T {
    thread::scope(|scope| {
        let thread = scope.spawn(|| {
            realtime_on(core);
            work()
        });
        thread.join().expect("measuring does not panic")
    })
}

#[cfg(test)]
mod tests {
    use std::cell::RefCell;

    use super::candidate::{Round, add_durations, no_durations};
    use super::*;

    #[test]
    fn candidates_take_turns_and_are_compared_within_a_round() {
        let order = RefCell::new(Vec::new());
        // The machine gets slower from round to round; the ratio stays.
        let turn = |name: &'static str, ns: u64| {
            let (order, mut pace) = (&order, 0);
            let turn: Turn = Box::new(move || {
                order.borrow_mut().push(name);
                pace += 1;
                let mut durations = no_durations();
                add_durations(&mut durations, ns * pace, 1);
                Ok(Round { durations, skipped_percent: None })
            });
            (name, turn)
        };
        let results = Results::by_turns(3, 0, vec![turn("a", 100)], vec![turn("b", 400)]).unwrap();
        assert_eq!(*order.borrow(), ["a", "b", "b", "a", "a", "b"]);
        let text = results.in_words();
        assert!(text.contains("\n  a     p50   0.200 (0.100–0.300)"), "{text}");
        assert!(text.contains("\n  a / b p50   0.250 (0.250–0.250)"), "{text}");
    }
}
