//! The last way back of a failed run: the last instant from which the run still passes without its faults and stimuli, or
//! with the controller's own value of a parameter.
//!
//! The run is played again under virtual time. From the instants of a grid it goes on without them to its end, and is judged.
//! Where two neighbours differ, their distance is halved down to one cycle. What changes and changes back between two
//! instants of the grid stays unseen.

#[cfg(test)]
mod tests;

use std::iter;

use masseter_judge::{Check, CheckResult, EventRecord, Figures, Verdict, Watch, signals::Registry};
use masseter_recording::manifest_of;
use masseter_report::why::{Detected, Instant, Interval, Left, Look, Why};
use masseter_runtime::injection::{Injected, Withdrawn};
use masseter_runtime::messages::codes::{Cause, ControllerState, EventKind};
use masseter_runtime::named::Declared;
use masseter_scenario::input::{MOST_KEPT_BYTES, read_text};
use masseter_virtual_time::{Branches, Mark, Requests, Run, Without};

use crate::prelude::*;
use crate::run::interrupts::Interrupts;
use crate::run::request::ControllerKind;
use crate::run::resolve_simulated;

/// Instants of the grid.
const LOOKS: u64 = 80;
/// Most signals that are named.
const NAMED: usize = 5;

/// Asks why the run of a folder failed: what acted on it is taken away.
pub(crate) fn why(run: &Path, without: Without, interrupts: &Interrupts) -> anyhow::Result<Why> {
    let folder = RunFolder::open(run)?;
    let manifest = manifest_of(&folder).with_context(|| folder.manifest().display().to_string())?;
    ensure!(
        !manifest.is_in_real_time(),
        "the run was in real time, which cannot be played again: run its scenario with --clock virtual"
    );
    let kind = ControllerKind::of_manifest(manifest.controller.as_deref()).with_context(|| {
        let name = manifest.controller.as_deref().unwrap_or_default();
        format!("the controller '{name}' is none of the rig's, and its state cannot be copied: only 'motion' and 'hold' can go on from an instant")
    })?;
    let scenario = scenario_with(Some(&folder.scenario()), &[])?;
    check_entries(&scenario, &without)?;
    let plan = resolve_simulated(&scenario, Some(&folder.scenario()), kind.builder())?;
    let digest = digest_of(&folder)?;
    Question { plan, build: kind.builder(), manifest, without, interrupts }.answer(&digest)
}

/// Refuses to take away what the scenario does not have.
fn check_entries(scenario: &Scenario, without: &Without) -> anyhow::Result<()> {
    let withdrawn = match without {
        Without::Acting(withdrawn) => *withdrawn,
        Without::Parameter(name) => {
            let is_set = scenario.parameters.contains_key(name);
            ensure!(
                is_set,
                "the scenario sets no parameter '{name}': --without {} takes nothing away",
                name_of(without)
            );
            return Ok(());
        }
    };
    let (faults, stimuli) = (scenario.faults.len(), scenario.stimulus.len());
    let mut all = (0..faults).map(Injected::Fault).chain((0..stimuli).map(Injected::Stimulus));
    let has_it = all.any(|one| withdrawn.holds(one));
    let [faults, stimuli] = [counted(faults as u64, "fault"), format!("{stimuli} stimuli")];
    ensure!(
        has_it,
        "the scenario has {faults} and {stimuli}: --without {} takes nothing away",
        name_of(without)
    );
    Ok(())
}

/// The digest of the run as it was judged.
fn digest_of(folder: &RunFolder) -> anyhow::Result<String> {
    let path = folder.summary();
    let summary = read_text(&path, MOST_KEPT_BYTES);
    let summary = summary
        .with_context(|| format!("{} is needed: 'masseter report' writes it again", path.display()))?;
    let summary: serde_json::Value =
        serde_json::from_str(&summary).with_context(|| path.display().to_string())?;
    let digest = summary["figures"]["digest"].as_str();
    Ok(digest
        .with_context(|| format!("{} has no digest: 'masseter report' writes it again", path.display()))?
        .to_owned())
}

struct Question<'a> {
    plan: RunPlan,
    build: masseter_controller::process::BuildController,
    manifest: Manifest,
    without: Without,
    interrupts: &'a Interrupts,
}

impl Question<'_> {
    fn answer(mut self, digest: &str) -> anyhow::Result<Why> {
        let mut branches = Branches::new(&self.plan, self.build)?;
        let start = branches.mark()?;
        let (verdict, figures) = self.end(&mut branches, true)?;
        ensure!(
            figures.digest == digest,
            "played again, the run has other messages than its recording: another build has made it, messages are missing, or \
             somebody stopped it or set a parameter; run its scenario again, and ask about that run"
        );
        ensure!(!passes(&verdict), "the run has not failed ({}): there is nothing to explain", verdict.word);
        let failed = |check: &&Check| check.result == CheckResult::Failed && check.figures.is_some();
        let check = verdict.checks.iter().find(failed);
        let unit = check.and_then(|check| Some(check.figures.as_ref()?.margin_unit));
        let margin_unit = unit.unwrap_or_default().to_owned();
        let check = check.map(|check| check.name.clone().into_owned());
        let period_ms = self.plan.scenario.period_s() * 1e3;
        let mut scan = Scan { question: self, branches, check, marks: vec![start], looks: Vec::new() };
        let acts =
            |event: &&EventRecord| event.cause == Cause::FaultInjected || event.cause == Cause::StimulusBegan;
        // A parameter acts from the start.
        let first = match scan.question.without {
            Without::Acting(_) => figures.events.iter().find(acts).map_or(1, |event| event.cycle),
            Without::Parameter(_) => 1,
        };
        scan.visit(0)?;
        ensure!(
            scan.looks[0].passes,
            "the run fails without them, too ({}): they are not the cause",
            verdict.reason
        );
        scan.play(first.saturating_sub(1), figures.cycles)?;
        let intervals = intervals(&scan.looks);
        let last = intervals.iter().rfind(|interval| interval.passes).map_or(0, |interval| interval.to_cycle);
        let Scan { question, branches, check, looks, .. } = scan;
        let left_first = question.compare(last, branches.declared())?;
        let began = figures.events.iter().find(|event| event.enters(ControllerState::Running));
        let motion_s =
            began.and_then(|began| Some((last + 1).checked_sub(began.cycle)? as f64 * period_ms / 1e3));
        let detection =
            figures.events.iter().find(|event| event.kind == EventKind::Fault && event.cycle > last);
        Ok(Why {
            without: name_of(&question.without),
            verdict: format!("{}: {}", verdict.word, verdict.reason),
            check,
            margin_unit,
            intervals,
            last_way_back: Instant { cycle: last, motion_s },
            left_first,
            detection: detection.map(|event| Detected {
                cycle: event.cycle,
                event: event.in_words(),
                after_ms: (event.cycle - last - 1) as f64 * period_ms,
            }),
            looks,
        })
    }

    /// Plays to the end, with what is taken away or without, and judges.
    fn end(&mut self, branches: &mut Branches, with_all: bool) -> anyhow::Result<(Verdict, Figures)> {
        let without = (!with_all).then_some(&self.without);
        let figures = branches.end(without, &mut self.manifest, self.interrupts)?;
        ensure!(!self.interrupts.is_stop_requested(), "interrupted");
        Ok((Verdict::new(&self.manifest, &figures), figures))
    }

    /// The signals that leave their nominal values first after that instant.
    fn compare(&self, last: u64, declared: &Declared) -> anyhow::Result<Vec<Left>> {
        let (mut nominal, mut found) = (self.watched(last, declared)?, self.watched(last, declared)?);
        nominal.run.go_without(&self.without)?;
        while !found.run.has_ended() && !nominal.run.has_ended() {
            nominal.run.play_cycle()?;
            found.run.play_cycle()?;
            let (cycle, [was, is]) = (found.run.cycle(), [nominal.values(), found.values()]);
            let mut left: Vec<Left> = found
                .registry
                .signals()
                .iter()
                .zip(was.into_iter().zip(is))
                .filter(|(_, (nominal, found))| {
                    nominal.is_finite() && found.is_finite() && nominal.to_bits() != found.to_bits()
                })
                .map(|(signal, (nominal, found))| Left {
                    signal: signal.name.clone(),
                    unit: signal.unit.clone(),
                    cycle,
                    nominal,
                    found,
                })
                .collect();
            if !left.is_empty() {
                left.sort_by(|a, b| b.share().total_cmp(&a.share()));
                left.truncate(NAMED);
                return Ok(left);
            }
        }
        Ok(Vec::new())
    }

    /// The run at that instant, with the values of its signals.
    fn watched(&self, cycle: u64, declared: &Declared) -> anyhow::Result<Watched> {
        let registry = Registry::new(&self.plan.scenario, declared);
        let mut watch = Watch::new(&self.plan.scenario, declared);
        for signal in registry.signals() {
            watch.choose(&signal.name)?;
        }
        let mut run = Run::new(&self.plan, self.build, watch)?;
        while run.cycle() < cycle {
            run.play_cycle()?;
        }
        Ok(Watched { run, registry })
    }
}

struct Watched {
    run: Run<Watch>,
    registry: Registry,
}

impl Watched {
    fn values(&mut self) -> Vec<f64> {
        self.run.sink_mut().values(None).to_vec()
    }
}

/// What is taken away.
fn name_of(without: &Without) -> String {
    match without {
        Without::Acting(Withdrawn::All) => "faults and stimuli".to_owned(),
        Without::Acting(Withdrawn::Faults) => "faults".to_owned(),
        Without::Acting(Withdrawn::Stimuli) => "stimuli".to_owned(),
        Without::Acting(Withdrawn::One(one)) => one.to_string(),
        Without::Parameter(name) => format!("parameters.{name}"),
    }
}

/// Whether a run fails nothing. A fault that never acts is untested, and that is no failure here.
fn passes(verdict: &Verdict) -> bool {
    verdict.exit_code == Exit::Passed || verdict.word == "UNTESTED"
}

/// The results at instants, as intervals without gaps. Neighbours with two results follow each other.
fn intervals(looks: &[Look]) -> Vec<Interval> {
    let of_one = looks.chunk_by(|a, b| a.passes == b.passes);
    let interval = |looks: &[Look]| {
        let (first, last) = (looks.first()?, looks.last()?);
        Some(Interval { from_cycle: first.cycle, to_cycle: last.cycle, passes: first.passes })
    };
    of_one.filter_map(interval).collect()
}

/// The instants that have been looked at, in their order.
struct Scan<'a> {
    question: Question<'a>,
    branches: Branches,
    check: Option<String>,
    marks: Vec<Mark>,
    looks: Vec<Look>,
}

impl Scan<'_> {
    /// Looks at an instant after all others, or at the controller's last cycle; returns the cycle.
    fn visit(&mut self, cycle: u64) -> anyhow::Result<u64> {
        let mark = self.mark(self.marks.len() - 1, cycle)?;
        let look = self.look(&mark)?;
        self.marks.push(mark);
        self.looks.push(look);
        Ok(look.cycle)
    }

    /// Looks at a grid from the first cycle in which something acts, and between neighbours that differ.
    fn play(&mut self, acting: u64, cycles: u64) -> anyhow::Result<()> {
        let step = (cycles.saturating_sub(acting) / LOOKS).max(1);
        let grid = (acting.max(1)..cycles).step_by(step as usize);
        // The last instant is that of the controller's last cycle.
        for cycle in grid.chain(iter::once(u64::MAX)) {
            if self.visit(cycle)? < cycle {
                break;
            }
        }
        let ends_well = self.looks.last().is_some_and(|look| look.passes);
        ensure!(
            !ends_well,
            "what fails the run acts after the controller's last cycle: nothing is too late before"
        );
        let mut place = 0;
        while let Some([before, after]) = self.looks.get(place..place + 2) {
            if before.passes == after.passes || after.cycle - before.cycle == 1 {
                place += 1;
                continue;
            }
            let middle = before.cycle.midpoint(after.cycle);
            // The marks begin with that of the run's start.
            let mark = self.mark(place + 1, middle)?;
            let look = self.look(&mark)?;
            self.marks.insert(place + 2, mark);
            self.looks.insert(place + 1, look);
        }
        Ok(())
    }

    /// The instant after that many cycles, from an earlier one.
    fn mark(&mut self, from: usize, cycle: u64) -> anyhow::Result<Mark> {
        self.branches.go_to(&self.marks[from])?;
        self.branches.advance_to(cycle)?;
        Ok(self.branches.mark()?)
    }

    /// What the run comes to from that instant, where it is.
    fn look(&mut self, mark: &Mark) -> anyhow::Result<Look> {
        let (verdict, _) = self.question.end(&mut self.branches, false)?;
        let check = verdict.checks.iter().find(|check| Some(&*check.name) == self.check.as_deref());
        let margin = check.and_then(|check| check.figures.as_ref()?.margin);
        Ok(Look { cycle: mark.cycle, passes: passes(&verdict), margin })
    }
}
