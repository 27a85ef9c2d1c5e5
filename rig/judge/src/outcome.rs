//! The outcomes of a run, each with its word, its exit code and its reason in words. Which outcome a run has is the
//! [verdict](super::verdict)'s.

use masseter_recording::{Ending, Manifest, RunUsage};
use masseter_runtime::injection::Injected;
use masseter_runtime::messages::codes::{Cause, ControllerState, Source};
use masseter_scenario::ExpectedVerdict::{
    self, Died, Fail, Incomplete, Interrupted, Pass, SafeStop, Untested,
};
use masseter_scenario::wording::{counted, grouped};
use masseter_scenario::{CanConfig, Scenario};
use masseter_terminal::Exit;

use crate::checks::{is_often_late, lag_cause};
use crate::played::StoppedBy;
use crate::stop_cause::{DeclaredCause, declared_cause, has_declared_fault};
use crate::{
    events::{EventRecord, first_report},
    figures::Figures,
    lost_cycles::Outage,
    shortfall::Shortfall,
    timing::Timing,
};

/// The outcome of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Outcome {
    /// One that a scenario can expect.
    Named(ExpectedVerdict),
    /// Failed, by checks alone: their findings are the reason.
    ChecksFailed,
    /// The run cannot be judged, which no scenario expects.
    Invalid,
}

impl Outcome {
    /// Its name in `[expect]`; none of a run that cannot be judged.
    pub(crate) fn named(self) -> Option<ExpectedVerdict> {
        match self {
            Self::Named(outcome) => Some(outcome),
            Self::ChecksFailed => Some(Fail),
            Self::Invalid => None,
        }
    }

    pub(crate) fn word(self) -> &'static str {
        self.word_and_exit().0
    }

    /// The word in reports, and the exit code of the program. A test that tested nothing is as red as one that failed.
    pub(crate) fn word_and_exit(self) -> (&'static str, Exit) {
        match self.named() {
            Some(Pass) => ("PASS", Exit::Passed),
            Some(Fail) => ("FAIL", Exit::Failed),
            Some(Untested) => ("UNTESTED", Exit::Failed),
            Some(Died) => ("DIED", Exit::Died),
            Some(SafeStop) => ("SAFE STOP", Exit::SafeStop),
            Some(Incomplete) => ("INCOMPLETE", Exit::Incomplete),
            Some(Interrupted) => ("INTERRUPTED", Exit::Interrupted),
            None => ("INVALID", Exit::Invalid),
        }
    }
}

/// A shorter delay of the motion is not worth a word, ms.
const LEAST_LAG_MS: f64 = 0.5;
/// Share of its core above which a real-time process is too busy: the kernel throttles at 95 %, by default.
const TOO_BUSY: f64 = 0.9;

/// The remedy for a real-time process that hardly ever slept.
pub(crate) fn overload(usage: &RunUsage, rate_hz: u32) -> Option<String> {
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

/// An outcome, and why the run has it.
pub(crate) type OutcomeReason = (Outcome, String);

/// What master and drives show comes before what the controller reports.
pub(crate) fn ending(ending: &Ending, declared: Option<String>, figures: &Figures) -> Option<OutcomeReason> {
    match ending {
        Ending::Completed | Ending::Overdue => {
            // The plant itself stops the drives of a controller that is overdue.
            let is_cause = |by: &StoppedBy| *ending == Ending::Completed || *by == StoppedBy::Master;
            let by = figures.stopped_by.filter(is_cause);
            by.map(|by| (Outcome::Named(SafeStop), stopped(Some(by), declared, figures)))
        }
        Ending::SafeStop => Some((Outcome::Named(SafeStop), stopped(None, declared, figures))),
        Ending::Died { process, how } => Some((Outcome::Named(Died), format!("the {process} died: {how}"))),
        Ending::Interrupted => Some((Outcome::Named(Interrupted), "stopped by the user".to_owned())),
        Ending::NotStarted => Some((Outcome::Invalid, "real time was required and refused".to_owned())),
        Ending::RecordingFailed => {
            Some((Outcome::Named(Incomplete), "the recorder could not write everything".to_owned()))
        }
    }
}

/// A stop that the scenario asks for ends the run as one by the user does.
pub(crate) fn stopped_by_stimulus(scenario: &Scenario, events: &[EventRecord]) -> Option<OutcomeReason> {
    let began = events.iter().filter(|event| event.cause == Cause::StimulusBegan);
    let number = began.map(|event| event.value as usize).find(|number| {
        number.checked_sub(1).and_then(|place| scenario.stimulus.get(place)).is_some_and(|found| found.stop)
    })?;
    Some((Outcome::Named(Interrupted), format!("stopped by stimulus {number} of the scenario")))
}

/// The first fault explains the stop: the controller's own event often names only the master. A controller that reports
/// another end explains nothing. `by`: what master or drives show of it, whatever the controller reports.
///
/// A declared fault or stimulus stands before what followed from it.
fn stopped(by: Option<StoppedBy>, declared: Option<String>, figures: &Figures) -> String {
    let Figures { events, stop_without_event_ns, .. } = figures;
    let first = first_report(events, *stop_without_event_ns, |event| {
        by.is_none() || event.source != Source::Controller
    });
    let since_s = |fault: &EventRecord| since_motion_s(events, fault.time_ns);
    let who = by.map_or_else(|| "the controller stopped the rig".to_owned(), |by| by.to_string());
    match (declared, first) {
        (Some(declared), Some(found)) => {
            let at = since_s(found).map_or_else(String::new, |at_s| format!(" at {at_s:.3} s"));
            format!("{declared} → detected{at}: {} → {who}", found.in_words())
        }
        (Some(declared), None) => format!("{declared} → {who}"),
        (None, Some(found)) => {
            let at = since_s(found).map(|at_s| format!(", {at_s:.3} s after the motion began"));
            format!("{who}; first fault: {}{}", found.in_words(), at.unwrap_or_default())
        }
        (None, None) => who,
    }
}

/// Time since the motion began; none before.
fn since_motion_s(events: &[EventRecord], time_ns: u64) -> Option<f64> {
    let began = events.iter().find(|event| event.enters(ControllerState::Running))?;
    Some(time_ns.checked_sub(began.time_ns)? as f64 / 1e9)
}

/// The fault or stimulus of the scenario that explains the stop, in words.
pub(crate) fn declared_in_words(manifest: &Manifest, figures: &Figures) -> Option<String> {
    let DeclaredCause { injected, struck_ns } = declared_cause(manifest, figures)?;
    let declared = match injected {
        Injected::Fault(place) => format!("fault {}", manifest.scenario.faults.get(place)?),
        Injected::Stimulus(place) => {
            let stimulus = manifest.scenario.stimulus.get(place)?;
            let name = Some(stimulus.name()).filter(|name| *name != stimulus.to_string());
            format!("stimulus {stimulus}{}", name.map_or_else(String::new, |name| format!(" ({name})")))
        }
    };
    let at = since_motion_s(&figures.events, struck_ns);
    Some(format!("{declared}{}", at.map_or_else(String::new, |at_s| format!(" at {at_s:.3} s"))))
}

/// When a process died, by the last cycle that both loops ran.
pub(crate) fn when_died(figures: &Figures) -> String {
    match figures.path_breach.motion_ns {
        None => "before the motion".to_owned(),
        Some(_) if figures.final_state.is_some_and(|state| state == ControllerState::Finished) => {
            "after the motion".to_owned()
        }
        Some([began_ns, _]) => {
            let died_s = figures.last_cycle_ns.saturating_sub(began_ns) as f64 / 1e9;
            format!("{died_s:.3} s after the motion began")
        }
    }
}

pub(crate) fn incomplete(figures: &Figures) -> Option<OutcomeReason> {
    missing_part(figures).map(|reason| (Outcome::Named(Incomplete), reason))
}

/// What a recording lacks; none of a whole one.
pub fn missing_part(figures: &Figures) -> Option<String> {
    match (figures.missing_messages(), figures.damage.first()) {
        (missing @ 1.., _) => Some(format!("{missing} messages are missing from the recording")),
        _ if figures.cut_short => Some("the recording lacks its end".to_owned()),
        (_, damage) => damage.map(|damage| format!("the recording is damaged: {damage}")),
    }
}

/// How many cycles were lost.
pub(crate) fn account(manifest: &Manifest, figures: &Figures, timing: &Timing) -> String {
    let lost = counted(timing.lost, "cycle");
    match manifest.refusal() {
        Some((process, refusal)) => {
            format!("{lost} lost without real time{}; {process}: {refusal}", timing.undecided())
        }
        None => format!("{lost} lost{}{}", stalls(figures), timing.undecided()),
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
pub(crate) fn clock_jump(usage: &RunUsage, can: &CanConfig) -> Option<OutcomeReason> {
    let jump_s = usage.clock_jump_s;
    (jump_s != 0.0 && !can.is_virtual()).then(|| {
        let reason = format!(
            "the wall clock jumped by {jump_s:.3} s, as it does when it is set or the machine was suspended"
        );
        (Outcome::Invalid, reason)
    })
}

/// The excuse for a stop, in words: the machine lost all missed cycles. Many of them were just before a safe stop, or one just before
/// a deviation that stopped the rig; or an overdue controller had less than its time.
pub(crate) fn excuse(manifest: &Manifest, figures: &Figures, timing: &Timing) -> Option<String> {
    if !timing.is_disturbed() || timing.missed > 0 {
        return None;
    }
    let lost_s = timing.lost_longest as f64 * manifest.scenario.period_s();
    let beyond_s = manifest.scenario.controller.overdue_s;
    // No lost cycle excuses a declared fault that led the jaw off its path.
    let is_off_path =
        !has_declared_fault(figures) && figures.first_fault().is_some_and(EventRecord::stops_off_path);
    let explains = if is_off_path { Outage::explains_a_deviation } else { Outage::explains_the_stop };
    let outage = figures.outage.filter(|outage| explains(*outage));
    match (&manifest.ending, figures.stopped_by) {
        (Ending::SafeStop, _) | (Ending::Completed, Some(_)) | (Ending::Overdue, Some(StoppedBy::Master)) => {
            let Outage { missed, of } = outage?;
            Some(format!("lost cycles may explain the safe stop: {missed} of {of} just before it"))
        }
        (Ending::Overdue, _) if lost_s >= beyond_s => Some(format!(
            "lost cycles may explain the late controller: {lost_s:.1} s, controller.overdue_s {beyond_s} s"
        )),
        _ => None,
    }
}

/// A failure with the missing part of the motion, which the names of checks do not show.
pub(crate) fn with_shortfall(
    (outcome, reason): OutcomeReason,
    manifest: &Manifest,
    figures: &Figures,
) -> OutcomeReason {
    let short = Shortfall::of(manifest, figures);
    // A motion at another time is the cause of what the jaw did not go.
    let is_of_time =
        short.is_none_or(|short| matches!(short, Shortfall::NotPlayed { .. } | Shortfall::Early { .. }));
    let cause = lag_cause(&figures.motion, manifest.scenario.checks.motion_lag_ms).filter(|_| is_of_time);
    let why = cause.into_iter().chain(short.map(|short| short.to_string()));
    (outcome, why.fold(reason, |reason, why| format!("{reason}; {why}")))
}

/// The reason of a pass, with what somebody has to know beside.
pub(crate) fn passed(manifest: &Manifest, figures: &Figures) -> String {
    let motion = &figures.motion;
    let late = motion.lag_ms.filter(|lag_ms| *lag_ms >= LEAST_LAG_MS);
    let late = late.map_or_else(String::new, |lag_ms| format!("; motion delayed by {lag_ms:.0} ms"));
    let commands = if manifest.is_in_real_time() && is_often_late(manifest, motion) {
        format!("; {} used a cycle late", counted(motion.late_commands, "command"))
    } else {
        String::new()
    };
    let idle = idle_force(manifest, figures).map_or_else(String::new, |idle| format!("; {idle}"));
    format!("every check passed{late}{commands}{idle}")
}

/// What estimate and control of the bite force that the scenario asks for never did. A law of a user takes their place.
fn idle_force(manifest: &Manifest, figures: &Figures) -> Option<&'static str> {
    if manifest.is_of_program() {
        return None;
    }
    let signal = |name| figures.signals.iter().find(move |found| found.signal.name == name);
    let is_below =
        |name, least: f64| signal(name).is_some_and(|found| found.max.is_none_or(|max| max < least));
    if signal("bite_force_n").is_some_and(|found| found.values == 0) {
        return Some(
            "the bite force was never estimated: shorten force_estimate.calibration_s, or play longer",
        );
    }
    if is_below("force_phase", 1.0) {
        return Some("the bite force was never controlled: no contact came while the mouth closed");
    }
    is_below("probed_stiffness_n_per_m", f64::MIN_POSITIVE).then_some(
        "no probe of the stiffness came to its end: the motion left it no time, or the force no rise",
    )
}

#[cfg(test)]
mod tests;
