//! The judgement of a run's timing: whether controller and plant kept their deadlines, and who lost the others.
//!
//! What the lost cycles mean for the function of the rig is the [verdict](super::verdict)'s.

use std::fmt::{self, Display, Formatter};

use masseter_recording::Manifest;
use masseter_scenario::wording::{counted, grouped};
use serde::Serialize;

use crate::overruns::{Overrun, OverrunCause};
use crate::{figures::Figures, skips::OverrunAttribution};

/// Whether the deadlines were kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum TimingWord {
    /// They were, or the rig missed no more of them than the scenario allows.
    Held,
    /// The machine lost some; the rig missed no more than the scenario allows.
    Disturbed,
    /// Faults of the scenario stalled a loop; all other deadlines were kept as in a run whose timing held.
    Stalled,
    /// The rig missed too many.
    Missed,
    /// Simulated time has no deadlines.
    Simulated,
    /// No cycle ran.
    Unknown,
}

/// The judgement of a run's timing.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Timing {
    /// The judgement in a word.
    pub word: TimingWord,
    /// Cycles of controller and plant together, with those that they skipped.
    pub cycles: u64,
    /// Cycles that the machine took from controller or plant, and those of unknown cause. Without the scheduling that the
    /// rig requested, also those after overlong work that is not certainly a loop's own.
    pub lost: u64,
    /// Those of the loop that lost more.
    #[serde(skip)]
    pub(crate) lost_longest: u64,
    /// Cycles that the rig missed by itself.
    pub missed: u64,
    /// Cycles that faults of the scenario took from a loop.
    pub stalled: u64,
    /// Those of controller and plant.
    #[serde(skip)]
    missed_by: [u64; 2],
    /// The evidence on overlong stretches of work, in words; empty without such stretches.
    #[serde(skip)]
    pub(crate) evidence: String,
    /// The longest stretch of work that was a loop's own; without one, the longest of which the counters do not decide, or that
    /// of the machine.
    #[serde(skip)]
    pub(crate) overrun: Option<Overrun>,
}

impl Timing {
    /// Judges a run.
    pub(crate) fn new(manifest: &Manifest, figures: &Figures) -> Self {
        let loops = [&figures.controller_skips, &figures.plant_skips];
        let may_be_the_machine =
            figures.overrun_attribution.is_some_and(|overruns| overruns.may_be_the_machine());
        // Without real time, overlong work is no evidence against the rig by itself.
        let is_work_excused = may_be_the_machine || manifest.refusal().is_some();
        let lost_by = loops.map(|skips| {
            let undecided = if is_work_excused { skips.working_undecided() } else { 0 };
            skips.by_machine + skips.working_by_machine + undecided + skips.unknown_cause
        });
        let missed_by = [0, 1]
            .map(|index| loops[index].skipped.saturating_sub(lost_by[index] + loops[index].by_scenario));
        // What stops the machine stops both loops: their losses are one time.
        let lost_longest = lost_by.into_iter().max().unwrap_or_default();
        let (lost, missed) = (lost_by.iter().sum(), missed_by.iter().sum());
        let stalled = loops.iter().map(|skips| skips.by_scenario).sum();
        let word = if figures.cycles == 0 {
            TimingWord::Unknown
        } else if !manifest.is_in_real_time() {
            TimingWord::Simulated
        } else if missed > manifest.scenario.checks.missed_cycles {
            TimingWord::Missed
        } else if lost > 0 {
            TimingWord::Disturbed
        } else if stalled > 0 {
            TimingWord::Stalled
        } else {
            TimingWord::Held
        };
        let cycles = 2 * figures.cycles + loops[0].skipped + loops[1].skipped;
        let overrun = figures.overruns.first().copied();
        let told = overrun.map(|overrun| format!("; {overrun}")).unwrap_or_default();
        let evidence = figures.overrun_attribution.map(in_words).unwrap_or_default() + &told;
        Self { word, cycles, lost, lost_longest, missed, stalled, missed_by, evidence, overrun }
    }

    /// The loop's own stretch of work that made it miss deadlines, in words; empty without one.
    pub(crate) fn culprit(&self) -> String {
        let own = self.overrun.filter(|overrun| self.word == TimingWord::Missed && overrun.cause.is_own());
        own.map(|overrun| format!("; {overrun}")).unwrap_or_default()
    }

    /// The stretch of work whose cause the counters do not show, in words; empty without one.
    pub(crate) fn undecided(&self) -> String {
        let undecided = self.overrun.filter(|overrun| overrun.cause == OverrunCause::Unknown);
        undecided.map(|overrun| format!("; whose fault is not certain: {overrun}")).unwrap_or_default()
    }

    /// Share of the cycles that the machine lost, %.
    pub(crate) fn lost_percent(&self) -> f64 {
        100.0 * self.lost as f64 / self.cycles.max(1) as f64
    }

    /// Whether the machine may explain a failure.
    pub(crate) fn is_disturbed(&self) -> bool {
        self.lost > 0
    }
}

impl Display for Timing {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let Self { lost, missed, stalled, cycles, .. } = self;
        match self.word {
            TimingWord::Held if *missed > 0 => {
                write!(f, "held ({} missed, as allowed)", counted(*missed, "cycle"))
            }
            TimingWord::Held => f.write_str("held"),
            TimingWord::Disturbed => write!(
                f,
                "disturbed by the machine ({} of {} cycles of both loops, {:.2} %)",
                grouped(*lost),
                grouped(*cycles),
                self.lost_percent()
            ),
            TimingWord::Stalled => {
                return write!(f, "stalled by faults of the scenario ({})", counted(*stalled, "cycle"));
            }
            TimingWord::Missed => match self.missed_by.map(grouped) {
                [controller, _] if self.missed_by[1] == 0 => {
                    write!(f, "missed by the controller ({controller})")
                }
                [_, plant] if self.missed_by[0] == 0 => write!(f, "missed by the plant ({plant})"),
                [controller, plant] => write!(f, "missed by controller ({controller}) and plant ({plant})"),
            },
            TimingWord::Simulated => f.write_str("simulated"),
            TimingWord::Unknown => f.write_str("unknown, because no cycle ran"),
        }?;
        if *stalled > 0 {
            write!(f, "; faults of the scenario stalled {} more", grouped(*stalled))?;
        }
        Ok(())
    }
}

/// The evidence on the stretches of work that cost deadlines.
fn in_words(overruns: OverrunAttribution) -> String {
    format!(
        "; {} of work too long, {} of that length while waiting, work is {:.1} % of the time: probability by chance {:.2}",
        counted(overruns.while_working, "stretch"),
        counted(overruns.while_waiting, "stall"),
        overruns.work_share * 100.0,
        overruns.chance
    )
}
