//! What a finished run is checked for, each with its finding and its limit.
//!
//! What the checks come to is the [verdict](super::verdict)'s.

use masseter_shared::messages::codes::{Cause, ControllerState};
use serde::Serialize;

use crate::text;
use masseter_analysis::{
    BusResponse, Code, EventRecord, Figures, OverrunAttribution, ResponseFigures, TrackingFigures,
};
use masseter_recording::{Ending, Manifest};

/// Whether what was checked is as it should be.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum CheckResult {
    /// It is.
    Passed,
    /// It is not.
    Failed,
    /// This run does not decide the check; the finding has the reason.
    NotJudged,
}

impl CheckResult {
    pub(crate) fn is_failed(self) -> bool {
        self == Self::Failed
    }

    /// The word in tables.
    pub fn mark(self) -> &'static str {
        match self {
            Self::Passed => "ok",
            Self::Failed => "FAIL",
            Self::NotJudged => "skip",
        }
    }
}

/// One thing that was judged.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Check {
    /// What.
    pub name: &'static str,
    /// What was found, with its limit.
    pub finding: String,
    /// Whether it is as it should be.
    pub result: CheckResult,
}

impl Check {
    fn judged(name: &'static str, finding: String, passed: bool) -> Self {
        let result = if passed { CheckResult::Passed } else { CheckResult::Failed };
        Self { name, finding, result }
    }

    /// A failure that `excused` explains is none.
    fn unless(self, excused: bool) -> Self {
        match self.result {
            CheckResult::Failed if excused => Self { result: CheckResult::NotJudged, ..self },
            _ => self,
        }
    }

    fn not_judged(name: &'static str, why: String) -> Self {
        Self { name, finding: why, result: CheckResult::NotJudged }
    }
}

/// `is_disturbed`: the machine kept the rig from too many cycles to hold its sequence or its tracking against it.
pub(crate) fn checks(manifest: &Manifest, figures: &Figures, is_disturbed: bool) -> Vec<Check> {
    let limits = &manifest.scenario.checks;
    let (skipped, by_machine) = figures.skipped();
    let sequence = sequence(figures.final_state, &figures.events);
    let is_played = sequence.result == CheckResult::Passed;
    let mut checks = vec![
        sequence.unless(is_disturbed),
        tracking(&figures.tracking, limits.tracking_rms_mm, is_played).unless(is_disturbed),
        Check {
            name: "missed cycles",
            finding: format!(
                "{skipped} ({by_machine} by the machine{}{}), limit {}",
                of_unknown_cause(figures),
                figures.overrun_attribution.map(overruns_in_words).unwrap_or_default(),
                limits.missed_cycles
            ),
            result: missed_cycles(manifest, figures),
        },
        dropped_messages(
            figures.missing_messages(),
            &manifest.ending,
            figures.cut_short,
            !figures.damage.is_empty(),
        ),
        bus_response(&figures.bus_response),
    ];
    checks.extend(faults(manifest.scenario.faults.len(), &figures.events, is_played));
    checks
}

/// The motion must be played to its end, and not be broken off by somebody who asked the controller to stop.
fn sequence(state: Option<Code<ControllerState>>, events: &[EventRecord]) -> Check {
    let was_stopped = events.iter().any(|event| event.cause == Cause::StopRequested);
    let how = if was_stopped { ", asked to stop before the motion's end" } else { "" };
    let in_words = state.map_or_else(|| "none".to_owned(), |state| state.to_string());
    let is_finished = state.is_some_and(|state| state == ControllerState::Finished);
    Check::judged("sequence", format!("ended in state {in_words}{how}"), is_finished && !was_stopped)
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

/// A motion that was played and left nothing to compare is no less a failure than one that was followed badly.
fn tracking(tracking: &TrackingFigures, limit_mm: f64, is_played: bool) -> Check {
    const NAME: &str = "tracking";
    let TrackingFigures { rms_mm, samples, .. } = *tracking;
    if rms_mm.is_none() && !is_played {
        return Check::not_judged(NAME, "the motion never began".to_owned());
    }
    let in_words = text::or_dash(rms_mm, text::decimals);
    let finding = format!("rms {in_words} mm over {samples} samples, limit {limit_mm} mm");
    Check::judged(NAME, finding, rms_mm.is_some_and(|rms_mm| rms_mm <= limit_mm))
}

/// A test with faults that passes without them has tested nothing. None where none is declared.
fn faults(declared: usize, events: &[EventRecord], is_played: bool) -> Option<Check> {
    let struck = |number: usize| {
        events.iter().any(|event| event.cause == Cause::FaultInjected && event.value as usize == number)
    };
    let idle: Vec<_> =
        (1..=declared).filter(|&number| !struck(number)).map(|number| number.to_string()).collect();
    let which = if idle.is_empty() { String::new() } else { format!(", number {} never", idle.join(", ")) };
    let finding = format!("{} of {declared} declared struck{which}", declared - idle.len());
    (declared > 0).then(|| Check::judged("faults", finding, idle.is_empty()).unless(!is_played))
}

/// No message may take longer on its bus than the plan allows at worst.
fn bus_response(response: &BusResponse) -> Check {
    const NAME: &str = "bus response";
    if let Some(why) = &response.unbounded {
        return Check::not_judged(NAME, why.clone());
    }
    let in_words = |message: &ResponseFigures| {
        let [max_us, bound_us] =
            [message.max_ns, message.bound_ns].map(|ns| text::or_dash(ns, text::microseconds));
        format!("{} on bus {} took {max_us} µs, bound {bound_us} µs", message.message, message.bus)
    };
    let exceeding: Vec<_> = response.exceeding().map(in_words).collect();
    if exceeding.is_empty() {
        let tightest = response.tightest().map_or_else(|| "no message has a bound".to_owned(), in_words);
        Check::judged(NAME, format!("closest: {tightest}"), response.tightest().is_some())
    } else {
        Check::judged(NAME, exceeding.join("; "), false)
    }
}

/// Whether too many cycles were missed. When none of them is certainly the rig's doing, or it was not given the cores
/// that it asked for, there is nothing to judge it by.
pub(crate) fn missed_cycles(manifest: &Manifest, figures: &Figures) -> CheckResult {
    let (skipped, by_machine) = figures.skipped();
    if skipped <= manifest.scenario.checks.missed_cycles {
        CheckResult::Passed
    } else if by_machine + figures.skipped_of_unknown_cause() == skipped || manifest.refusal().is_some() {
        CheckResult::NotJudged
    } else {
        CheckResult::Failed
    }
}

/// Said of cycles that were missed behind messages which were not recorded.
fn of_unknown_cause(figures: &Figures) -> String {
    match figures.skipped_of_unknown_cause() {
        0 => String::new(),
        n => format!(", {n} of unknown cause: the messages before them are missing"),
    }
}

/// What stretches of work that cost deadlines were held against.
fn overruns_in_words(overruns: OverrunAttribution) -> String {
    format!(
        "; {} stretches of work against {} stalls as long while waiting, {:.1} % of the time at work: chance does so \
         with probability {:.2}",
        overruns.while_working,
        overruns.while_waiting,
        overruns.work_share * 100.0,
        overruns.chance
    )
}

#[cfg(test)]
mod tests {
    use masseter_shared::messages::Event;
    use masseter_shared::messages::codes::{EventKind, Source};

    use super::*;

    fn struck(number: usize) -> EventRecord {
        let injected = Event::new(Source::Wire, EventKind::Notice, Cause::FaultInjected);
        EventRecord::from(&Event { value: number as f64, ..injected })
    }

    #[test]
    fn a_declared_fault_that_never_struck_fails_a_run_that_was_played_to_its_end() {
        let ended = EventRecord { cause: Code::Known(Cause::FaultEnded), ..struck(2) };
        let events = [struck(1), ended];
        let cases = [
            (0, true, None),
            (1, true, Some(("ok", "1 of 1 declared struck"))),
            (2, true, Some(("FAIL", "1 of 2 declared struck, number 2 never"))),
            (2, false, Some(("skip", "1 of 2 declared struck, number 2 never"))),
            (3, true, Some(("FAIL", "1 of 3 declared struck, number 2, 3 never"))),
        ];
        for (declared, is_played, expected) in cases {
            let check = faults(declared, &events, is_played);
            let found = check.as_ref().map(|check| (check.result.mark(), check.finding.as_str()));
            assert_eq!(found, expected);
        }
    }

    #[test]
    fn a_motion_that_never_began_is_not_judged_unless_the_run_says_that_it_was_played() {
        let still = TrackingFigures::default();
        let moved = TrackingFigures { samples: 9, rms_mm: Some(0.2), ..still };
        let cases = [
            (still, false, "skip", "the motion never began"),
            (still, true, "FAIL", "rms – mm over 0 samples, limit 0.1 mm"),
            (moved, false, "FAIL", "rms 0.2000 mm over 9 samples, limit 0.1 mm"),
        ];
        for (figures, is_played, mark, finding) in cases {
            let check = tracking(&figures, 0.1, is_played);
            assert_eq!((check.result.mark(), check.finding.as_str()), (mark, finding));
        }
    }

    #[test]
    fn only_a_failure_is_excused() {
        let check = |passed| Check::judged("tracking", String::new(), passed);
        let cases = [(false, true, "skip"), (false, false, "FAIL"), (true, true, "ok"), (true, false, "ok")];
        for (passed, excused, mark) in cases {
            assert_eq!(check(passed).unless(excused).result.mark(), mark);
        }
    }

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
        BusResponse { messages: vec![sync], unbounded: unbounded.map(str::to_owned) }
    }

    #[test]
    fn a_message_beyond_its_bound_fails_unless_the_bound_does_not_hold() {
        let cases =
            [(190_000, None, "ok"), (191_000, None, "FAIL"), (191_000, Some("bus 0 had 1 errors"), "skip")];
        for (max_ns, unbounded, mark) in cases {
            let check = bus_response(&response(max_ns, unbounded));
            assert_eq!(check.result.mark(), mark, "{check:?}");
        }
        let failed = bus_response(&response(191_000, None));
        assert_eq!(failed.finding, "SYNC on bus 1 took 191.00 µs, bound 190.00 µs");
    }
}
