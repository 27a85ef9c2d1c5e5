//! The verdict on the function of a run: by its end, then its recording, then the machine, then its checks.
//!
//! [`Timing`] is judged apart. Lost cycles matter here only where they leave nothing to judge the function by.

use masseter_analysis::{EventRecord, Figures, Outage, StoppedBy};
use masseter_recording::{DmaLatency, Ending, Manifest, RunUsage};
use masseter_runtime::messages::codes::{Cause, EventKind, Source};
use masseter_scenario::wording::counted;
use masseter_scenario::{CanConfig, ChecksConfig, ExpectConfig, ExpectedVerdict, Scenario, TimingConfig};
use masseter_terminal::Exit;
use serde::Serialize;

use crate::check::{Check, CheckResult};
use crate::checks::{STIMULI, checks};
use crate::motion_checks::{FAULTS, left_its_path};
use crate::outcome::Outcome;
use crate::shortfall::Shortfall;
use crate::text::{self, grouped};
use crate::timing::{Timing, TimingWord};

/// The judgement of a run.
///
/// ```
/// use masseter_analysis::Analysis;
/// use masseter_recording::{MachineInfo, Manifest};
/// use masseter_report::Verdict;
/// use masseter_scenario::Scenario;
/// use masseter_runtime::named::Declared;
///
/// let machine = MachineInfo { cpu: "any".into(), cores: 2, kernel: "Linux".into(), is_virtual: false };
/// let manifest = Manifest::new("0.1.0", Scenario::default(), 10.0, "virtual", machine);
/// let figures = Analysis::new(&manifest.scenario, &Declared::default()).finish(false, &[]);
/// // The supervisor has not entered yet how the run ended.
/// assert_eq!(Verdict::new(&manifest, &figures).word, "DIED");
/// ```
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Verdict {
    /// The outcome in a word.
    pub word: &'static str,
    /// The reason in a sentence.
    pub reason: String,
    /// The outcome as the exit code of the program.
    pub exit_code: Exit,
    /// Whether the deadlines were kept.
    pub timing: Timing,
    /// Every check, also those that passed.
    pub checks: Vec<Check>,
}

impl Verdict {
    /// Judges a run.
    pub fn new(manifest: &Manifest, figures: &Figures) -> Self {
        let timing = Timing::new(manifest, figures);
        let all = checks(manifest, figures, &timing);
        let expect = manifest.scenario.expect.as_ref().filter(|expect| expect.has_outcome());
        let is_beside = |check: &Check| expect.is_some_and(|expect| stands_beside(check, expect));
        let (beside, checks): (Vec<_>, Vec<_>) = all.iter().cloned().partition(is_beside);
        let excuse = excuse(&manifest.ending, &timing, figures.outage);
        let is_too_late = left_its_path(&figures.tracking.actual, &manifest.scenario.checks)
            || checks.iter().any(|check| is_of_faults(check) && check.result == CheckResult::Failed);
        let (mut outcome, mut reason) = ending(&manifest.ending, figures.stopped_by, &figures.events)
            .or_else(|| stopped_by_stimulus(&manifest.scenario, &figures.events))
            // The machine caused the stop, or it came only after the jaw had left its path.
            .filter(|(outcome, _)| !(*outcome == Outcome::SafeStop && (excuse.is_some() || is_too_late)))
            .or_else(|| incomplete(figures))
            .or_else(|| {
                let unjudged = excuse.or_else(|| unjudged(&manifest.scenario.checks, &timing, &checks))?;
                Some((Outcome::Invalid, format!("{unjudged}; {}", account(manifest, figures, &timing))))
            })
            .or_else(|| {
                failed(&checks)
                    .map(|failure| with_shortfall(failure, manifest, figures))
                    .map(|failure| clock_jump(&manifest.usage, &manifest.scenario.can).unwrap_or(failure))
            })
            .or_else(|| untested(&checks, figures.cycles))
            .unwrap_or_else(|| (Outcome::Passed, "every check passed".to_owned()));
        if let Some(expect) = expect {
            (outcome, reason) = against(expect, (outcome, reason), [&checks, &beside], figures);
        }
        if outcome != Outcome::Passed {
            reason += &overload(&manifest.usage, manifest.scenario.rate_hz).unwrap_or_default();
        }
        Self { word: outcome.word(), reason, exit_code: outcome.exit(), timing, checks: all }
    }

    /// What to do about the machine; none where the machine disturbed nothing.
    pub(crate) fn advice(&self, manifest: &Manifest) -> Option<String> {
        // The reason of an INVALID run contains the advice.
        let is_missing = self.timing.word == TimingWord::Disturbed && self.exit_code != Exit::Invalid;
        is_missing.then(|| remedy(manifest))
    }

    /// Whether checks alone decided it, so that their findings are the reason.
    pub(crate) fn is_by_checks(&self) -> bool {
        self.word == Outcome::Untested.word() || self.reason.starts_with(FAILED)
    }
}

/// What the reason of a run begins with that failed by its checks.
const FAILED: &str = "failed: ";

/// Share of its core above which a real-time process is too busy: the kernel throttles at 95 %, by default.
const TOO_BUSY: f64 = 0.9;

/// The remedy for a real-time process that hardly ever slept.
fn overload(usage: &RunUsage, rate_hz: u32) -> Option<String> {
    let busy = |name: &'static str| {
        let share = usage.processes.get(name)?.share();
        (share > TOO_BUSY).then_some((name, share))
    };
    let (name, share) = ["controller", "plant"].into_iter().find_map(busy)?;
    Some(format!(
        "; the {name} kept its core busy for {:.0} % of the time, and the kernel throttles real-time tasks at 95 %: \
         use a rate_hz below {rate_hz}",
        share * 100.0
    ))
}

type OutcomeReason = (Outcome, String);

/// What master and drives show comes before what the controller reports.
fn ending(ending: &Ending, stopped_by: Option<StoppedBy>, events: &[EventRecord]) -> Option<OutcomeReason> {
    match ending {
        Ending::Completed => stopped_by.map(|by| (Outcome::SafeStop, stopped(Stopper::Drives(by), events))),
        Ending::SafeStop => Some((Outcome::SafeStop, stopped(Stopper::Controller, events))),
        Ending::Died { process, how } => Some((Outcome::Died, format!("the {process} died: {how}"))),
        Ending::Interrupted => Some((Outcome::Interrupted, "stopped by the user".to_owned())),
        Ending::NotStarted => Some((Outcome::Invalid, "real time was required and refused".to_owned())),
        Ending::RecordingFailed => {
            Some((Outcome::Incomplete, "the recorder could not write everything".to_owned()))
        }
    }
}

/// A stop that the scenario asks for ends the run as one by the user does.
fn stopped_by_stimulus(scenario: &Scenario, events: &[EventRecord]) -> Option<OutcomeReason> {
    let began = events.iter().filter(|event| event.cause == Cause::StimulusBegan);
    let number = began.map(|event| event.value as usize).find(|number| {
        number.checked_sub(1).and_then(|place| scenario.stimulus.get(place)).is_some_and(|found| found.stop)
    })?;
    Some((Outcome::Interrupted, format!("stopped by stimulus {number} of the scenario")))
}

/// Who says that the rig was stopped.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Stopper {
    /// The controller reports it.
    Controller,
    /// Master or drives show it, and the controller reports another end.
    Drives(StoppedBy),
}

/// The first fault explains the stop: the controller's own event often names only the master. A controller that reports
/// another end explains nothing.
fn stopped(stopper: Stopper, events: &[EventRecord]) -> String {
    let is_heard = |event: &&EventRecord| {
        event.kind == EventKind::Fault
            && (stopper == Stopper::Controller || event.source != Source::Controller)
    };
    let first = events.iter().find(is_heard);
    let why = first.map_or_else(String::new, |fault| format!("; first fault: {}", text::event(fault)));
    let who = match stopper {
        Stopper::Controller => "the controller stopped the rig",
        Stopper::Drives(StoppedBy::Master) => "the master stopped the drives",
        Stopper::Drives(StoppedBy::QuickStop) => "the drives made a quick stop",
        Stopper::Drives(StoppedBy::Drives) => "a drive left operation while the motion ran",
    };
    format!("{who}{why}")
}

fn incomplete(figures: &Figures) -> Option<OutcomeReason> {
    let missing = figures.missing_messages();
    let reason = if missing > 0 {
        format!("{missing} messages are missing from the recording")
    } else if figures.cut_short {
        "the recording lacks its end".to_owned()
    } else if let Some(damage) = figures.damage.first() {
        format!("the recording is damaged: {damage}")
    } else {
        return None;
    };
    Some((Outcome::Incomplete, reason))
}

/// Why the machine leaves nothing to judge a run by that ended normally; none where the run can be judged. What the rig
/// missed by itself fails the run, and where no cycle ran there is nothing to judge.
fn unjudged(limits: &ChecksConfig, timing: &Timing, checks: &[Check]) -> Option<String> {
    let has = |result| checks.iter().any(|check| check.result == result);
    if matches!(timing.word, TimingWord::Missed | TimingWord::Unknown) {
        return None;
    }
    if timing.is_disturbed() && limits.timing == TimingConfig::Strict {
        return Some("checks.timing = \"strict\" allows no lost cycle".to_owned());
    }
    if timing.lost_percent() > limits.machine_lost_percent {
        let (lost, limit) = (timing.lost_percent(), limits.machine_lost_percent);
        return Some(format!("the machine lost {lost:.1} % of the cycles, limit {limit} %"));
    }
    let excused =
        || named(checks, CheckResult::Excused).map(|names| format!("lost cycles may explain: {names}"));
    if has(CheckResult::Failed) { None } else { excused() }
}

/// How many cycles were lost, and what helps.
fn account(manifest: &Manifest, figures: &Figures, timing: &Timing) -> String {
    let lost = counted(timing.lost, "cycle");
    match manifest.refusal() {
        Some((process, refusal)) => format!("{lost} lost without real time; {process}: {refusal}"),
        None => format!("{lost} lost{}; {}", stalls(figures), remedy(manifest)),
    }
}

/// The time for which the machine stalled.
fn stalls(figures: &Figures) -> String {
    let (controller, plant) = (&figures.controller_skips, &figures.plant_skips);
    let stalled_ms = (controller.stalled_ns + plant.stalled_ns) as f64 / 1e6;
    let while_working = match controller.while_working + plant.while_working {
        0 => String::new(),
        n => format!(", {} of them during work", grouped(n)),
    };
    format!("{while_working}; the machine stalled for {stalled_ms:.1} ms while the rig waited")
}

/// Real interfaces stamp frames by the wall clock: once it was set, these times are useless. Simulated ones do not use it.
fn clock_jump(usage: &RunUsage, can: &CanConfig) -> Option<OutcomeReason> {
    let jump_s = usage.clock_jump_s;
    (jump_s != 0.0 && !can.is_virtual()).then(|| {
        let reason = format!(
            "the wall clock jumped by {jump_s:.3} s, as it does when it is set or the machine was suspended; repeat the run"
        );
        (Outcome::Invalid, reason)
    })
}

/// The remedy against stalls of the machine.
fn remedy(manifest: &Manifest) -> String {
    let latency = match &manifest.cpu_dma_latency {
        Some(DmaLatency { limit_us: None, .. }) => "; realtime.cpu_dma_latency = \"hold\" may help too",
        _ => "",
    };
    let is_virtual = manifest.scenario.can.is_virtual();
    let lockstep = if is_virtual { ", --clock lockstep keeps it out of the result" } else { "" };
    let first = manifest.mending_command.as_ref();
    let first = first.map_or_else(String::new, |command| format!("; first try: {command}"));
    format!("masseter doctor lists what disturbs this machine{lockstep}{latency}{first}")
}

/// The excuse for a safe stop, in words: the machine lost all missed cycles, and many of them just before the stop.
fn excuse(ending: &Ending, timing: &Timing, outage: Option<Outage>) -> Option<String> {
    let outage = outage.filter(|outage| *ending == Ending::SafeStop && outage.explains_the_stop())?;
    let is_machines = timing.is_disturbed() && timing.missed == 0;
    is_machines.then(|| {
        format!("lost cycles may explain the safe stop: {} of {} just before it", outage.missed, outage.of)
    })
}

/// A failure with what is short of the motion, which the names of checks do not say.
fn with_shortfall((outcome, reason): OutcomeReason, manifest: &Manifest, figures: &Figures) -> OutcomeReason {
    let short = Shortfall::of(manifest, figures).map(|short| format!("; {short}"));
    (outcome, reason + &short.unwrap_or_default())
}

fn failed(checks: &[Check]) -> Option<OutcomeReason> {
    named(checks, CheckResult::Failed).map(|names| (Outcome::Failed, format!("{FAILED}{names}")))
}

/// What was not tested, with what to do. Without a cycle that was everything.
fn untested(checks: &[Check], cycles: u64) -> Option<OutcomeReason> {
    let findings: Vec<_> = checks
        .iter()
        .filter(|check| check.result == CheckResult::Untested)
        .map(|check| format!("{}: {}", check.name, check.finding))
        .collect();
    let why = if cycles == 0 { "no cycle ran".to_owned() } else { findings.join("; ") };
    (!why.is_empty()).then_some((Outcome::Untested, why))
}

/// Whether a check counts beside the expected outcome, not towards it: an expected event always does. A requirement counts
/// towards whether the run passes, but says nothing on how it ends.
fn stands_beside(check: &Check, expect: &ExpectConfig) -> bool {
    use ExpectedVerdict::{Fail, Pass, Untested};
    let is_by_checks = [Pass, Fail, Untested].into_iter().any(|outcome| expect.accepts(outcome));
    check.is_expected_event() || (check.is_requirement() && !is_by_checks)
}

/// The outcome of a run that expects one: passed if the outcome is this one, and what stands beside it holds. A run that the
/// machine spoiled stays INVALID.
fn against(
    expect: &ExpectConfig,
    (outcome, reason): OutcomeReason,
    [checks, beside]: [&[Check]; 2],
    figures: &Figures,
) -> OutcomeReason {
    let Some(ending) = outcome.named() else { return (outcome, reason) };
    if !expect.accepts(ending) {
        let reason =
            if outcome == Outcome::Passed { "every check of the rig passed" } else { reason.as_str() };
        return (Outcome::Failed, format!("expected {}, but {}: {reason}", wanted(expect), outcome.word()));
    }
    // The rig's own checks still count where the run goes on in order to its end.
    let own = || {
        let is_in_order = matches!(outcome, Outcome::SafeStop | Outcome::Interrupted);
        let short = || incomplete(figures).or_else(|| failed(checks));
        let idle: Vec<_> = checks.iter().filter(|check| is_of_scenario(check)).cloned().collect();
        let in_order = is_in_order.then(short).flatten();
        in_order.or_else(|| if outcome == Outcome::Untested { None } else { untested(&idle, figures.cycles) })
    };
    let lost = || {
        let names = named(beside, CheckResult::Excused)?;
        Some((Outcome::Invalid, format!("lost cycles may explain: {names}")))
    };
    own()
        .or_else(|| failed(beside))
        .or_else(lost)
        .or_else(|| untested(beside, figures.cycles))
        .unwrap_or_else(|| (Outcome::Passed, format!("{}, as expected: {reason}", outcome.word())))
}

/// The expected outcome, in words.
fn wanted(expect: &ExpectConfig) -> String {
    let outcomes = ExpectedVerdict::ALL.into_iter().filter(|outcome| expect.accepts(*outcome));
    let words: Vec<_> = outcomes.map(|outcome| Outcome::of(outcome).word()).collect();
    words.join(" or ")
}

/// Whether it is the check of the declared faults.
fn is_of_faults(check: &Check) -> bool {
    check.name == FAULTS && !check.is_requirement()
}

/// Whether it is a check of what the scenario lets happen.
fn is_of_scenario(check: &Check) -> bool {
    is_of_faults(check) || (check.name == STIMULI && !check.is_requirement())
}

/// The checks of a result by their names; none without such checks.
fn named(checks: &[Check], result: CheckResult) -> Option<String> {
    let names: Vec<_> =
        checks.iter().filter(|check| check.result == result).map(|check| check.name.as_ref()).collect();
    (!names.is_empty()).then(|| names.join(", "))
}

#[cfg(test)]
mod tests {
    mod figures;

    use masseter_runtime::messages::Event;

    use super::*;
    use masseter_recording::Usage;

    #[test]
    fn a_safe_stop_is_explained_by_what_went_wrong_first() {
        let event = |source, kind, cause| Event::new(source, kind, cause);
        let lost = event(Source::Master, EventKind::Fault, Cause::ProcessDataLost);
        let events = [
            event(Source::Wire, EventKind::Notice, Cause::FaultInjected),
            Event { axis: 0, node: 1, value: 4.0, ..lost },
            event(Source::Controller, EventKind::Fault, Cause::MasterFault),
        ];
        let (outcome, reason) =
            ending(&Ending::SafeStop, None, &events.map(|event| EventRecord::from(&event))).unwrap();
        assert_eq!(outcome, Outcome::SafeStop);
        assert_eq!(
            reason,
            "the controller stopped the rig; first fault: master: process_data_lost \
             (axis d1 (node 1 on bus 0): process data missing for 4 cycles)"
        );
        assert_eq!(ending(&Ending::SafeStop, None, &[]).unwrap().1, "the controller stopped the rig");
    }

    #[test]
    fn what_master_and_drives_show_comes_before_what_the_controller_reports() {
        let fault = |source, cause| EventRecord::from(&Event::new(source, EventKind::Fault, cause));
        let events = [fault(Source::Controller, Cause::LawFailed), fault(Source::Master, Cause::BadMessage)];
        let shown = |stopped_by| ending(&Ending::Completed, stopped_by, &events);
        assert_eq!(shown(None), None);
        let stopped = |reason: &str| Some((Outcome::SafeStop, reason.to_owned()));
        assert_eq!(
            shown(Some(StoppedBy::Master)),
            stopped("the master stopped the drives; first fault: master: bad_message (value 0, limit 0)")
        );
        assert_eq!(
            ending(&Ending::Completed, Some(StoppedBy::QuickStop), &events[..1]),
            stopped("the drives made a quick stop")
        );
        // The end of a process comes before both.
        let died = Ending::died("plant", "signal 9".to_owned());
        assert_eq!(ending(&died, Some(StoppedBy::Master), &events).unwrap().0, Outcome::Died);
    }

    #[test]
    fn a_process_that_hardly_sleeps_is_named_with_what_to_do() {
        let usage = |cpu_s| {
            let plant = Usage { observed_s: 2.0, cpu_s, ..Usage::default() };
            RunUsage { processes: [("plant".to_owned(), plant)].into(), ..RunUsage::default() }
        };
        assert_eq!(overload(&usage(1.0), 20_000), None);
        let said = overload(&usage(1.9), 20_000).unwrap();
        assert!(said.contains("plant kept its core busy for 95 %") && said.contains("below 20000"), "{said}");
    }

    #[test]
    fn a_jump_of_the_clock_excuses_runs_on_real_interfaces_alone() {
        let simulated = CanConfig::default();
        let real = CanConfig { interfaces: vec!["can0".to_owned()], ..simulated.clone() };
        let jump = |clock_jump_s, can| clock_jump(&RunUsage { clock_jump_s, ..RunUsage::default() }, can);
        assert_eq!(jump(0.0, &real), None);
        assert_eq!(jump(-3.5, &simulated), None);
        let (outcome, reason) = jump(-3.5, &real).unwrap();
        assert_eq!(outcome, Outcome::Invalid);
        assert!(reason.contains("jumped by -3.500 s"), "{reason}");
    }
}
