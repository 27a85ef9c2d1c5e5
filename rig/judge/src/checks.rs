//! What a finished run is checked for, each with its finding and its limit. One check is whether the intended motion
//! was played. It depends on the share of the scenario's motion that the jaw went; of an own motion, on the time for which
//! the drives were enabled.
//!
//! What the checks come to is the [verdict](super::verdict)'s.

use masseter_recording::{Ending, Manifest};
use masseter_runtime::messages::codes::{Cause, ControllerState};
use masseter_runtime::{named::PlayedMotion, schedule::CycleSchedule};
use masseter_scenario::{Dimension, ExpectedVerdict, wording::counted};

use crate::check::{Check, CheckFigures, CheckResult, Subject, faults, stimuli, tracking};
use crate::response::{BusResponse, ResponseFigures};
use crate::timing::{Timing, TimingWord};
use crate::{
    breach::Breach, events::EventRecord, figures::Figures, played::MotionFigures,
    requirements::RequirementFigures, shortfall::Shortfall, skips::SkipFigures, standstill::standstill,
    tracking::TrackingFigures,
};

/// None in a run that ended before its first cycle.
pub(crate) fn checks(manifest: &Manifest, figures: &Figures, timing: &Timing) -> Vec<Check> {
    if figures.cycles == 0 {
        return Vec::new();
    }
    let limits = &manifest.scenario.checks;
    let is_disturbed = timing.is_disturbed();
    let sequence = Check { subject: Subject::Sequence, ..sequence(manifest, figures) };
    let path = &figures.path_breach;
    let TrackingFigures { actual_source, actual, estimated, undisturbed, .. } = &figures.tracking;
    let tracking_of = |name, errors, undisturbed_errors| {
        let check = tracking(name, errors, limits);
        let of_motion = check.breach.clone().map(|breach| breach.over(path.motion_ns));
        let check = check.with_breach(of_motion);
        // What also fails where no lost cycle acted on the jaw is the rig's.
        let rest = tracking(name, undisturbed_errors, limits);
        check.unless(is_disturbed && !rest.result.is_failed())
    };
    let of_path = tracking_of("tracking", actual, &undisturbed.actual);
    let first = path.first.clone().or_else(|| of_path.breach.clone());
    let mut checks = vec![sequence, of_path.with_breach(first)];
    if actual_source.is_truth() {
        checks.push(tracking_of("estimated tracking", estimated, &undisturbed.estimated));
    }
    checks.extend(stated_pose(&figures.tracking));
    // A stop ends the motion somewhere, and has a verdict of its own.
    let is_stopped = figures.stopped_by.is_some()
        || figures.final_state.is_some_and(|state| state == ControllerState::SafeStop);
    if !is_stopped {
        let of_motion =
            [motion_lag(&figures.motion, limits.motion_lag_ms), missed_commands(manifest, figures)];
        checks.extend(of_motion.into_iter().flatten().map(|check| check.unless(is_disturbed)));
    }
    let is_partial = figures.cut_short || !figures.damage.is_empty();
    checks.extend(standstill(&figures.standstill, &manifest.ending, is_partial, limits));
    checks.extend(kept_time(timing, limits.missed_cycles));
    checks.extend(late_commands(manifest, &figures.motion).filter(|_| !is_stopped));
    checks.extend([
        dropped_messages(
            figures.missing_messages(),
            &manifest.ending,
            figures.cut_short,
            !figures.damage.is_empty(),
        ),
        bus_response(&figures.bus_response, &figures.plant_skips),
    ]);
    // No lost cycle excuses a declared fault that led the jaw too far.
    let last_act_ns = figures.last_act_ns();
    let faults = faults(&manifest.scenario, &figures.faults, last_act_ns, lasted_s(figures));
    checks.extend(faults.map(|check| check.with_breach(path.first.clone())));
    checks.extend(stimuli(&manifest.scenario, &began_ns(manifest, figures), last_act_ns));
    checks
        .extend(figures.requirements.iter().map(|requirement| self::requirement(requirement, is_disturbed)));
    checks
}

/// How long the run lasted since the motion began, and since the rig was switched on, s.
fn lasted_s(figures: &Figures) -> [Option<f64>; 2] {
    let ended_ns = figures.ended_ns.unwrap_or(figures.last_cycle_ns);
    let of_motion =
        figures.path_breach.motion_ns.map(|[began_ns, _]| ended_ns.saturating_sub(began_ns) as f64 / 1e9);
    [of_motion, Some(figures.duration_s)]
}

/// A desired pose in the state that is none: the controller computes with such numbers. None where each was a pose.
fn stated_pose(found: &TrackingFigures) -> Option<Check> {
    let samples = counted(found.without_pose, "sample");
    let breach = Breach::new("without a finite pose", samples.clone(), "0").at(found.without_pose_ns);
    let why =
        format!("{samples} of the motion in which the controller stated no finite pose as the desired one");
    (found.without_pose > 0).then(|| Check::judged("stated pose", why, false).with_breach(breach))
}

/// A motion that waited for lost commands or readings is late from then on. The true jaw may be ahead by no more than it may be
/// late. `None` if the scenario's motion never began.
fn motion_lag(motion: &MotionFigures, limit_ms: f64) -> Option<Check> {
    let lag_ms = motion.way_mm.and(motion.lag_ms)?;
    let why = lag_cause(motion, limit_ms).map_or_else(String::new, |why| format!("; {why}"));
    let is_kept = lag_ms <= limit_ms && motion.ahead_ms.is_none();
    let check = Check::judged("motion lag", format!("{lag_ms:.1} ms, limit {limit_ms} ms{why}"), is_kept);
    let (what, beyond_ms) = motion.ahead_ms.map_or(("delay", lag_ms), |ahead_ms| ("lead", ahead_ms));
    let breach = Breach::new(what, format!("{beyond_ms:.1} ms"), format!("{limit_ms} ms"));
    // A lead is found over a window.
    Some(check.with_breach(breach.at(motion.late_ns.filter(|_| motion.ahead_ms.is_none()))))
}

/// What the controller did that put the motion beyond its limit; none where it waited, or kept the limit.
pub(crate) fn lag_cause(motion: &MotionFigures, limit_ms: f64) -> Option<String> {
    let [began_late_ms, ran_back_ms] = motion.lag_causes_ms;
    if let Some(ahead_ms) = motion.ahead_ms {
        return Some(format!("the true jaw was {ahead_ms:.1} ms ahead of the motion"));
    }
    let is_late = motion.lag_ms.is_some_and(|lag_ms| lag_ms > limit_ms);
    match is_late {
        true if began_late_ms > limit_ms => {
            Some(format!("the controller began the motion {began_late_ms:.1} ms after its lead-in"))
        }
        true if ran_back_ms > limit_ms => {
            Some(format!("the controller's motion time ran back by {ran_back_ms:.1} ms"))
        }
        _ => None,
    }
}

/// A cycle of the motion without a new command leaves the drives with the last one. As many in a row are allowed as the controller
/// may miss readings; a single one in real time is a late command. `None` if the scenario's own faults stall a loop.
fn missed_commands(manifest: &Manifest, figures: &Figures) -> Option<Check> {
    let MotionFigures { lag_ms, missed_commands, missed_in_a_row, .. } = figures.motion;
    let limit = u64::from(manifest.scenario.controller.stale_cycles);
    let is_of_scenario = figures.controller_skips.by_scenario + figures.plant_skips.by_scenario > 0;
    lag_ms?;
    let finding = format!("{}, {missed_in_a_row} in a row, limit {limit}", counted(missed_commands, "cycle"));
    if is_of_scenario {
        let why = format!("{finding}; faults of the scenario stall a loop");
        return Some(Check::not_judged("commands missed", why));
    }
    let breach = Breach::new("in a row", counted(missed_in_a_row, "cycle"), limit.to_string());
    Some(Check::judged("commands missed", finding, missed_in_a_row <= limit).with_breach(breach))
}

/// Whether so many commands were late that the motion is another one than in simulated time, where none is.
pub(crate) fn is_often_late(manifest: &Manifest, motion: &MotionFigures) -> bool {
    motion.late_commands > u64::from(manifest.scenario.controller.stale_cycles)
}

/// A command that comes after its time goes out a cycle later: the robot follows late, which tracking judges. None in simulated
/// time, and where the motion never began.
fn late_commands(manifest: &Manifest, motion: &MotionFigures) -> Option<Check> {
    const NAME: &str = "commands late";
    motion.lag_ms.filter(|_| manifest.is_in_real_time())?;
    let late = counted(motion.late_commands, "command");
    if !is_often_late(manifest, motion) {
        return Some(Check::judged(NAME, late, true));
    }
    let schedule = CycleSchedule::new(&manifest.scenario).ok()?;
    let room_us = (schedule.command_by_ns - schedule.controller_at_ns) / 1000;
    let why = format!(
        "{late} used a cycle late: from its wake-up to the command a controller has {room_us} µs; a lower rate_hz gives it more"
    );
    Some(Check::not_judged(NAME, why))
}

/// Cycles that the machine lost are no failure of the rig. None in simulated time, which has no deadlines.
fn kept_time(timing: &Timing, limit: u64) -> Option<Check> {
    let result = match timing.word {
        TimingWord::Held | TimingWord::Stalled => CheckResult::Passed,
        TimingWord::Missed => CheckResult::Failed,
        TimingWord::Disturbed => CheckResult::NotJudged,
        TimingWord::Simulated | TimingWord::Unknown => return None,
    };
    let finding = format!("{timing}{}, limit of the rig {limit}", timing.evidence);
    let breach = Breach::new("missed by the rig", counted(timing.missed, "cycle"), limit.to_string());
    Some(Check::new("timing", finding, result).with_breach(breach))
}

/// The motion must be played to its end, and not be stopped by request, unless the scenario expects that. The facts of master
/// and drives come before the controller's state.
fn sequence(manifest: &Manifest, figures: &Figures) -> Check {
    const NAME: &str = "sequence";
    let (state, expect) = (figures.final_state, manifest.scenario.expect.as_ref());
    let was_stopped = figures.was_stopped_by_request();
    let stopped_by =
        figures.stopped_by.filter(|_| state.is_none_or(|state| state != ControllerState::SafeStop));
    let how = match stopped_by {
        Some(by) => format!(", though {by}"),
        None if was_stopped => ", stopped before the motion's end".to_owned(),
        None => String::new(),
    };
    let in_words = state.map_or_else(|| "none".to_owned(), |state| state.to_string());
    let is_in = |expected| state.is_some_and(|state| state == expected);
    let is_expected = |outcome| expect.is_some_and(|expect| expect.accepts(outcome));
    if is_expected(ExpectedVerdict::Died) || is_expected(ExpectedVerdict::Incomplete) {
        return Check::not_judged(NAME, format!("ended in state {in_words}{how}"));
    }
    if let Some(shortfall) = Shortfall::of(manifest, figures) {
        return shortfall.check(NAME, figures);
    }
    let has_finished = is_in(ControllerState::Finished) && figures.stopped_by.is_none();
    let has_stopped = is_in(ControllerState::SafeStop) || figures.stopped_by.is_some();
    let (is_good, as_expected) = if is_expected(ExpectedVerdict::SafeStop) && has_stopped {
        (true, ", as expected")
    } else if is_expected(ExpectedVerdict::Interrupted) {
        (was_stopped && has_finished, ", as expected")
    } else {
        (has_finished && !was_stopped, "")
    };
    let as_expected = if is_good { as_expected } else { "" };
    let whose = whose_motion(manifest);
    let due = if is_expected(ExpectedVerdict::Interrupted) {
        "finished, after a stop before the motion's end"
    } else {
        "finished, without a stop"
    };
    let breach = Breach::new("last state", &in_words, due).at(figures.stopped_ns());
    Check::judged(NAME, format!("ended in state {in_words}{how}{as_expected}{whose}"), is_good)
        .with_breach(breach)
}

/// When each stimulus first began, ns; none after the controller's end.
fn began_ns(manifest: &Manifest, Figures { events, ended_ns, .. }: &Figures) -> Vec<Option<u64>> {
    let of = |place: usize| {
        let is_begin = |event: &&EventRecord| {
            event.cause == Cause::StimulusBegan
                && event.value as usize == place + 1
                && ended_ns.is_none_or(|ended_ns| event.time_ns <= ended_ns)
        };
        events.iter().find(is_begin).map(|event| event.time_ns)
    };
    (0..manifest.scenario.stimulus.len()).map(of).collect()
}

/// A requirement of the scenario. The machine excuses a failure where a lost cycle may have caused it.
fn requirement(found: &RequirementFigures, is_disturbed: bool) -> Check {
    let significant = |number: f64| Dimension::One.si_unit().text(number);
    let CheckFigures { margin, margin_unit, worst_at_s, .. } = found.figures;
    let margin = margin.map(|margin| format!("; margin {} {margin_unit}", significant(margin)));
    let moment = worst_at_s.map(|at_s| format!(" at {at_s:.3} s"));
    let words = [Some(found.must.clone()).filter(|must| !must.is_empty()), Some(found.finding.clone())];
    let words = words.into_iter().flatten().collect::<Vec<_>>().join(": ");
    let finding = [Some(words), margin.map(|margin| margin.trim_end().to_owned()), moment];
    let finding = finding.into_iter().flatten().collect::<String>();
    let subject = if found.is_expected_event { Subject::ExpectedEvent } else { Subject::Requirement };
    let is_excused = is_disturbed && found.may_be_disturbed;
    let result = match found.result {
        CheckResult::Failed | CheckResult::Untested if is_excused => CheckResult::Excused,
        result => result,
    };
    let (id, figures) = (found.id.clone(), Some(found.figures.clone()));
    let check = Check::new(found.name.clone(), finding, result).with_breach(found.breach.clone());
    Check { id, figures, subject, ..check }
}

/// Gaps show losses before the last recorded message. Losses behind it, and in unreadable parts, are unknown.
fn dropped_messages(missing: u64, ending: &Ending, is_cut_short: bool, is_damaged: bool) -> Check {
    const NAME: &str = "dropped messages";
    let reasons = [
        (is_cut_short, "the recording lacks its end"),
        (is_damaged, "the recording is damaged"),
        (*ending == Ending::RecordingFailed, "the recorder could not write everything"),
    ];
    let check = match reasons.into_iter().find(|(is_so, _)| *is_so) {
        Some((_, why)) if missing == 0 => Check::not_judged(NAME, format!("no gap, but {why}")),
        _ => Check::judged(NAME, missing.to_string(), missing == 0).with_breach(Breach::new(
            "not recorded",
            counted(missing, "message"),
            "0",
        )),
    };
    Check { subject: Subject::Recording, ..check }
}

/// No message may take longer on its bus than the plan allows at worst. Frames beside a stall are left out only where the
/// machine lost cycles.
fn bus_response(response: &BusResponse, plant: &SkipFigures) -> Check {
    const NAME: &str = "bus response";
    if let Some(why) = &response.unbounded {
        return Check::not_judged(NAME, why.clone());
    }
    let us = |ns: Option<u64>| {
        let tenths = format!("{:.1}", ns.unwrap_or(0) as f64 / 1e3);
        format!("{} µs", tenths.trim_end_matches(".0"))
    };
    let in_words = |message: &ResponseFigures| {
        let [max, bound] = [message.max_ns, message.bound_ns].map(us);
        format!("{} on bus {} took {max}, bound {bound}", message.message, message.bus)
    };
    let unjudged = match response.off_time_frames {
        0 => String::new(),
        frames => format!("; {} beside a stall not judged", counted(frames, "frame")),
    };
    let exceeding: Vec<_> = response.exceeding().map(in_words).collect();
    let excess_ns = |message: &ResponseFigures| Some(message.max_ns?.saturating_sub(message.bound_ns?));
    let longest_excess_ns = response.exceeding().filter_map(excess_ns).max().unwrap_or(0);
    let stalled_ns = plant.stalled_ns + plant.overlong_ns;
    if exceeding.is_empty() {
        let tightest = response.tightest().map_or_else(|| "no message has a bound".to_owned(), in_words);
        let found = format!("closest to its bound: {tightest}{unjudged}");
        Check::judged(NAME, found, response.tightest().is_some())
    } else if longest_excess_ns <= stalled_ns {
        // The plant's process moves the frames of simulated wires.
        let stalled_ms = stalled_ns as f64 / 1e6;
        let why = format!("; the plant stalled for {stalled_ms:.1} ms in all, which may explain that");
        Check::not_judged(NAME, exceeding.join("; ") + &why)
    } else {
        let first = response.exceeding().next().map(|message| {
            Breach::new(
                format!("{} on bus {}", message.message, message.bus),
                us(message.max_ns),
                us(message.bound_ns),
            )
        });
        Check::judged(NAME, exceeding.join("; "), false).with_breach(first)
    }
}

/// The words added where the motion is not the scenario's.
pub fn whose_motion(manifest: &Manifest) -> &'static str {
    match manifest.declared.motion {
        PlayedMotion::Scenario => "",
        PlayedMotion::Own => ", own motion of the controller",
    }
}

#[cfg(test)]
mod tests;
