//! Results of a bench: its candidates by turns, their ratios, and the circumstances.

use std::fs;
use std::path::Path;
use std::thread;

use masseter_recording::MachineInfo;
use masseter_runtime::realtime::scheduling::Obtained;
use masseter_scenario::wording::counted;
use masseter_terminal::status;
use serde::Serialize;

use super::candidate::{Candidate, Ratio, Turn};
use super::disturbance::{Disturbance, Stillness, realtime_on};
use crate::BUILD;

/// Version of the form of `results.json`.
const FORM: u32 = 3;

/// The results with the circumstances.
#[derive(Debug, Serialize)]
pub(super) struct Results {
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
    pub(super) notes: Vec<String>,
    #[serde(flatten)]
    pub(super) disturbance: Disturbance,
}

impl Results {
    /// Measures a round of each candidate in turn, observes the machine before each, and compares `own` with the
    /// others. Each round begins with another candidate.
    pub(super) fn by_turns<'a>(
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
    pub(super) fn write(&self, folder: &Path, json: &str) -> anyhow::Result<()> {
        fs::write(folder.join("results.json"), json)?;
        Ok(self.candidates.iter().try_for_each(|candidate| candidate.write_log(folder))?)
    }

    /// Candidates in µs, then their ratios: median (minimum to maximum) over the rounds.
    pub(super) fn in_words(&self) -> String {
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

#[cfg(test)]
mod tests {
    use std::cell::RefCell;

    use super::*;
    use crate::cli::bench::candidate::{Round, add_durations, no_durations};

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
