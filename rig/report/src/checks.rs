//! What a finished run is checked for, each with its finding and its limit.
//!
//! What the checks come to is the [verdict](super::verdict)'s.

use masseter_runtime::messages::codes::{Cause, ControllerState};
use masseter_scenario::wording::counted;
use masseter_scenario::{ExpectedVerdict, StimulusConfig};

use crate::check::{Check, CheckFigures, CheckResult};
use crate::motion_checks::{faults, tracking};
use crate::shortfall::{Shortfall, was_stopped_by_request, whose_motion};
use crate::text;
use crate::timing::{Timing, TimingWord};
use masseter_analysis::requirements::{RequirementFigures, RequirementResult};
use masseter_analysis::{
    BusResponse, EventRecord, Figures, ResponseFigures, SkipFigures, StoppedBy, TrackingFigures,
};
use masseter_recording::{Ending, Manifest};

/// None in a run that ended before its first cycle.
pub(crate) fn checks(manifest: &Manifest, figures: &Figures, timing: &Timing) -> Vec<Check> {
    if figures.cycles == 0 {
        return Vec::new();
    }
    let limits = &manifest.scenario.checks;
    let is_disturbed = timing.is_disturbed();
    let sequence = sequence(manifest, figures);
    let TrackingFigures { actual_source, samples, actual, estimated, undisturbed, .. } = &figures.tracking;
    let tracking_of = |name, errors, undisturbed_errors| {
        let check = tracking(name, *samples, errors, limits);
        // What also fails where no lost cycle acted on the jaw is the rig's.
        let rest = tracking(name, undisturbed.samples, undisturbed_errors, limits);
        check.unless(is_disturbed && !rest.result.is_failed())
    };
    let mut checks = vec![sequence, tracking_of("tracking", actual, &undisturbed.actual)];
    if actual_source.is_truth() {
        checks.push(tracking_of("estimated tracking", estimated, &undisturbed.estimated));
    }
    checks.extend(kept_time(timing, limits.missed_cycles));
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
    checks.extend(faults(&manifest.scenario.faults, &figures.faults, limits));
    checks.extend(stimuli(&manifest.scenario.stimulus, &figures.events));
    checks
        .extend(figures.requirements.iter().map(|requirement| self::requirement(requirement, is_disturbed)));
    checks
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
    Some(Check::new("timing", finding, result))
}

/// The motion must be played to its end, and not be stopped by request, unless the scenario expects that. The facts of master
/// and drives come before the controller's state.
fn sequence(manifest: &Manifest, figures: &Figures) -> Check {
    const NAME: &str = "sequence";
    let (state, expect) = (figures.final_state, manifest.scenario.expect.as_ref());
    let was_stopped = was_stopped_by_request(figures);
    let how =
        match figures.stopped_by.filter(|_| state.is_none_or(|state| state != ControllerState::SafeStop)) {
            Some(StoppedBy::Master) => ", though the master stopped the drives",
            Some(StoppedBy::QuickStop) => ", though the drives made a quick stop",
            Some(StoppedBy::Drives) => ", though a drive left operation while the motion ran",
            None if was_stopped => ", stopped by request before the motion's end",
            None => "",
        };
    let in_words = state.map_or_else(|| "none".to_owned(), |state| state.to_string());
    let is_in = |expected| state.is_some_and(|state| state == expected);
    let is_expected = |outcome| expect.is_some_and(|expect| expect.accepts(outcome));
    if is_expected(ExpectedVerdict::Died) || is_expected(ExpectedVerdict::Incomplete) {
        return Check::not_judged(NAME, format!("ended in state {in_words}{how}"));
    }
    if let Some(shortfall) = Shortfall::of(manifest, figures) {
        return Check::new(NAME, shortfall.to_string(), shortfall.result());
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
    Check::judged(NAME, format!("ended in state {in_words}{how}{as_expected}{whose}"), is_good)
}

/// The name of the check of the stimuli.
pub(crate) const STIMULI: &str = "stimuli";

/// A test with stimuli of which one never began has not tested what it should. None where there are none.
fn stimuli(declared: &[StimulusConfig], events: &[EventRecord]) -> Option<Check> {
    let is_begin =
        |event: &EventRecord, number| event.cause == Cause::StimulusBegan && event.value as usize == number;
    let idle: Vec<_> = (1..=declared.len())
        .filter(|number| !events.iter().any(|event| is_begin(event, *number)))
        .map(|number| number.to_string())
        .collect();
    let began = format!("{} of {} stimuli began", declared.len() - idle.len(), declared.len());
    let check = if idle.is_empty() {
        Check::judged(STIMULI, began, true)
    } else {
        let which = idle.join(", ");
        Check::untested(
            STIMULI,
            format!("{began}, number {which} never: let the stimulus begin earlier, or play longer"),
        )
    };
    (!declared.is_empty()).then_some(check)
}

/// A requirement of the scenario. The machine excuses a failure where a lost cycle may have caused it.
fn requirement(found: &RequirementFigures, is_disturbed: bool) -> Check {
    let result = match found.result {
        RequirementResult::Passed => CheckResult::Passed,
        RequirementResult::Failed => CheckResult::Failed,
        RequirementResult::Untested => CheckResult::Untested,
    };
    let margin =
        found.margin.map(|margin| format!("; margin {} {}", text::significant(margin), found.margin_unit));
    let moment = found.worst_at_s.map(|at_s| format!(" at {at_s:.3} s"));
    let words = [Some(found.must.clone()).filter(|must| !must.is_empty()), Some(found.finding.clone())];
    let words = words.into_iter().flatten().collect::<Vec<_>>().join(": ");
    let finding = [Some(words), margin.map(|margin| margin.trim_end().to_owned()), moment];
    let figures = CheckFigures {
        margin: found.margin,
        margin_unit: found.margin_unit,
        relative_margin: found.relative_margin,
        worst_at_s: found.worst_at_s,
        latency_ms: found.latency_ms,
        is_expected_event: found.is_expected_event,
    };
    let finding = finding.into_iter().flatten().collect::<String>();
    let check = Check { figures: Some(figures), ..Check::new(found.name.clone(), finding, result) };
    check.unless(is_disturbed && found.may_be_disturbed)
}

/// Gaps show losses before the last recorded message. Losses behind it, and in unreadable parts, are unknown.
fn dropped_messages(missing: u64, ending: &Ending, is_cut_short: bool, is_damaged: bool) -> Check {
    const NAME: &str = "dropped messages";
    let reasons = [
        (is_cut_short, "the recording lacks its end"),
        (is_damaged, "the recording is damaged"),
        (*ending == Ending::RecordingFailed, "the recorder could not write everything"),
    ];
    match reasons.into_iter().find(|(is_so, _)| *is_so) {
        Some((_, why)) if missing == 0 => Check::not_judged(NAME, format!("no gap, but {why}")),
        _ => Check::judged(NAME, missing.to_string(), missing == 0),
    }
}

/// No message may take longer on its bus than the plan allows at worst. Frames off their times are left out only where
/// the machine lost cycles.
fn bus_response(response: &BusResponse, plant: &SkipFigures) -> Check {
    const NAME: &str = "bus response";
    if let Some(why) = &response.unbounded {
        return Check::not_judged(NAME, why.clone());
    }
    let in_words = |message: &ResponseFigures| {
        let [max_us, bound_us] =
            [message.max_ns, message.bound_ns].map(|ns| text::or_dash(ns, text::microseconds));
        format!("{} on bus {} took {max_us} µs, bound {bound_us} µs", message.message, message.bus)
    };
    let unjudged = match response.off_time_frames {
        0 => String::new(),
        frames => format!("; {} off their times not judged", counted(frames, "frame")),
    };
    let exceeding: Vec<_> = response.exceeding().map(in_words).collect();
    let stalled_ns = plant.stalled_ns + plant.overlong_ns;
    if exceeding.is_empty() {
        let tightest = response.tightest().map_or_else(|| "no message has a bound".to_owned(), in_words);
        Check::judged(NAME, format!("closest: {tightest}{unjudged}"), response.tightest().is_some())
    } else if longest_excess_ns(response) <= stalled_ns {
        // The plant's process moves the frames of simulated wires.
        let stalled_ms = stalled_ns as f64 / 1e6;
        let why = format!("; the plant stalled for {stalled_ms:.1} ms in all, which may explain that");
        Check::not_judged(NAME, exceeding.join("; ") + &why)
    } else {
        Check::judged(NAME, exceeding.join("; "), false)
    }
}

/// How far a message was beyond its bound at most.
fn longest_excess_ns(response: &BusResponse) -> u64 {
    let excess_ns = |message: &ResponseFigures| Some(message.max_ns?.saturating_sub(message.bound_ns?));
    response.exceeding().filter_map(excess_ns).max().unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_gap_in_a_part_of_a_recording_says_nothing_of_the_rest() {
        let cases = [
            (Ending::Completed, false, false, 0, "ok"),
            (Ending::Completed, false, false, 1, "FAIL"),
            (Ending::Completed, true, false, 0, "skip"),
            (Ending::Completed, false, true, 0, "skip"),
            (Ending::RecordingFailed, false, false, 0, "skip"),
            (Ending::RecordingFailed, true, true, 1, "FAIL"),
        ];
        for (ending, is_cut_short, is_damaged, missing, mark) in cases {
            let check = dropped_messages(missing, &ending, is_cut_short, is_damaged);
            assert_eq!(check.result.mark(), mark, "{ending:?} {check:?}");
        }
    }

    fn response(max_ns: u64, unbounded: Option<&str>) -> BusResponse {
        let sync = ResponseFigures {
            bus: 1,
            message: "SYNC".to_owned(),
            frames: 1,
            max_ns: Some(max_ns),
            bound_ns: unbounded.is_none().then_some(190_000),
        };
        BusResponse { messages: vec![sync], off_time_frames: 0, unbounded: unbounded.map(str::to_owned) }
    }

    #[test]
    fn a_message_beyond_its_bound_fails_unless_the_bound_does_not_hold() {
        let cases =
            [(190_000, None, "ok"), (191_000, None, "FAIL"), (191_000, Some("bus 0 had 1 errors"), "skip")];
        for (max_ns, unbounded, mark) in cases {
            let check = bus_response(&response(max_ns, unbounded), &SkipFigures::default());
            assert_eq!(check.result.mark(), mark, "{check:?}");
        }
        let failed = bus_response(&response(191_000, None), &SkipFigures::default());
        assert_eq!(failed.finding, "SYNC on bus 1 took 191.00 µs, bound 190.00 µs");
        let off_time = BusResponse { off_time_frames: 7, ..response(150_000, None) };
        let check = bus_response(&off_time, &SkipFigures::default());
        assert_eq!(check.result.mark(), "ok");
        assert!(check.finding.ends_with("; 7 frames off their times not judged"), "{check:?}");
    }

    #[test]
    fn a_message_beyond_its_bound_by_no_more_than_the_plant_stalled_is_not_judged() {
        for (stalled_ns, overlong_ns, mark) in [(999, 0, "FAIL"), (1000, 0, "skip"), (500, 500, "skip")] {
            let plant = SkipFigures { stalled_ns, overlong_ns, ..SkipFigures::default() };
            let check = bus_response(&response(191_000, None), &plant);
            assert_eq!(check.result.mark(), mark, "{check:?}");
        }
    }
}
