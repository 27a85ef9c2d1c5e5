//! Samples without a value, which are no pass: those between two values, and those before the first or after the last value
//! while the motion runs and no stop follows.

use masseter_runtime::messages::codes::ControllerState;

use crate::signals::CycleMessages;

/// What the rig does in a sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Phase {
    /// The controller runs, and states that the motion does.
    Running,
    /// A safe stop.
    Stopped,
    Other,
}

impl Phase {
    /// A controller that has died, or lost a cycle, runs no motion; a fault of the master is a stop, whatever the controller states.
    pub(super) fn of(messages: &CycleMessages) -> Self {
        if messages.reading.is_some_and(|reading| reading.master_fault != 0) {
            return Self::Stopped;
        }
        match messages.state.map(|state| ControllerState::try_from(state.controller_state)) {
            Some(Ok(ControllerState::Running)) => Self::Running,
            Some(Ok(ControllerState::SafeStop)) => Self::Stopped,
            _ => Self::Other,
        }
    }
}

/// Samples of a window without a value.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Missing {
    pub(super) all: u64,
    /// Those before the first value, while the motion ran.
    at_start: u64,
    /// Those between two values.
    between: u64,
    since_value: Option<u64>,
    /// Those after the last value, while the motion ran; 0 if a stop followed, with which a signal may end.
    at_end: u64,
    samples: u64,
    is_real_time: bool,
}

/// The share of a window's samples that may be missing in real time, where the loops lose or delay single cycles. What that does is
/// judged as timing.
const MISSING_IN_REAL_TIME: f64 = 0.01;

impl Missing {
    pub(super) fn count_sample(&mut self, has_value: bool, phase: Phase, is_real_time: bool) {
        self.samples += 1;
        self.is_real_time |= is_real_time;
        if has_value {
            self.between += self.since_value.replace(0).unwrap_or(0);
            self.at_end = 0;
        } else {
            self.all += 1;
            let at_edge = if self.since_value.is_some() { &mut self.at_end } else { &mut self.at_start };
            *at_edge += u64::from(phase == Phase::Running);
            self.since_value = self.since_value.map(|missing| missing + 1);
        }
    }

    /// A stop excuses values that are missing before it: drives and sensors may have been lost, which caused it.
    pub(super) fn apply_phase(&mut self, phase: Phase) {
        if phase == Phase::Stopped {
            self.at_end = 0;
        }
    }

    /// Whether values are missing in between or at an end of the motion: in simulated time any, in real time more than single ones.
    pub(super) fn is_too_much(&self) -> bool {
        let allowed = if self.is_real_time { MISSING_IN_REAL_TIME * self.samples as f64 } else { 0.0 };
        (self.at_start + self.between + self.at_end) as f64 > allowed
    }

    pub(super) fn in_words(&self) -> String {
        let places = [
            (self.at_start, "at the motion's start"),
            (self.between, "in between"),
            (self.at_end, "at the motion's end"),
        ];
        let named: Vec<_> = places.iter().filter(|(samples, _)| *samples > 0).collect();
        match (self.all, named.as_slice()) {
            (0, _) => String::new(),
            (all, []) => format!(", {all} missing"),
            (_, [(samples, first), more @ ..]) => {
                let more = more.iter().map(|(samples, place)| format!(", {samples} {place}"));
                format!(", {samples} missing {first}{}", more.collect::<String>())
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use masseter_scenario::Unit;

    use super::*;
    use crate::check::CheckResult;
    use crate::requirements::finding::Finding;

    /// Whether a bound passes, where one sample of this many is missing in between.
    fn passes(samples: usize, is_real_time: bool) -> bool {
        let mut missing = Missing::default();
        (0..samples).for_each(|sample| missing.count_sample(sample != 1, Phase::Other, is_real_time));
        let finding = Finding::new(true, String::new(), Unit::ONE).with_missing(&missing);
        finding.result == CheckResult::Passed
    }

    #[test]
    fn a_missing_sample_is_no_pass_but_a_single_one_in_real_time() {
        assert!(!passes(1000, false));
        assert!(passes(1000, true));
        assert!(!passes(50, true));
        assert!(passes(2, false), "after the motion none is needed");
    }

    #[test]
    fn a_signal_that_begins_after_the_motion_is_no_pass() {
        let begins = |first: Phase| {
            let mut missing = Missing::default();
            missing.count_sample(false, first, false);
            missing.count_sample(true, Phase::Running, false);
            let finding = Finding::new(true, "0 mm".to_owned(), Unit::ONE).with_missing(&missing);
            (finding.result, finding.text)
        };
        let untested = (CheckResult::Untested, "0 mm, 1 missing at the motion's start".to_owned());
        assert_eq!(begins(Phase::Running), untested);
        assert_eq!(begins(Phase::Other), (CheckResult::Passed, "0 mm, 1 missing".to_owned()));
    }

    #[test]
    fn a_signal_that_vanishes_while_the_motion_runs_is_no_pass_unless_a_stop_follows() {
        let vanishes = |then: Phase| {
            let mut missing = Missing::default();
            for (has_value, phase) in [(true, Phase::Running), (false, Phase::Running), (false, then)] {
                missing.apply_phase(phase);
                missing.count_sample(has_value, phase, false);
            }
            let finding = Finding::new(true, "0 mm".to_owned(), Unit::ONE).with_missing(&missing);
            (finding.result, finding.text)
        };
        let untested = |text: &str| (CheckResult::Untested, text.to_owned());
        assert_eq!(vanishes(Phase::Running), untested("0 mm, 2 missing at the motion's end"));
        assert_eq!(vanishes(Phase::Other), untested("0 mm, 1 missing at the motion's end"));
        assert_eq!(vanishes(Phase::Stopped), (CheckResult::Passed, "0 mm, 2 missing".to_owned()));
    }
}
