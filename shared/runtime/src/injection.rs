//! The times of faults and stimuli in a run, from the occurrences that they count from.
//!
//! It acts on nothing: plant, controller and supervisor ask for the windows of what they carry out.

use std::ops::Range;

use masseter_scenario::{Scenario, ScenarioError, Start, When};

use crate::clock::SECOND_NS;
use crate::messages::codes::ControllerState;

/// A fault or a stimulus, with its place in the scenario's list.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Injected {
    /// A fault.
    Fault(usize),
    /// A stimulus.
    Stimulus(usize),
}

/// The times of every fault and stimulus of a run.
///
/// ```
/// use masseter_scenario::{Scenario, StimulusConfig};
/// use masseter_runtime::injection::{Injected, Injection};
/// use masseter_runtime::messages::codes::ControllerState;
///
/// let push = StimulusConfig { push_n: Some([0.0, 0.0, 5.0]), for_s: Some(0.5), ..StimulusConfig::at(1.0) };
/// let mut injection = Injection::new(&Scenario { stimulus: vec![push], ..Scenario::default() }, 0)?;
/// assert_eq!(injection.window_ns(Injected::Stimulus(0)), None);
/// injection.note_state(ControllerState::Running, 2_000_000_000);
/// assert_eq!(injection.window_ns(Injected::Stimulus(0)), Some(3_000_000_000..3_500_000_000));
/// # Ok::<(), masseter_scenario::ScenarioError>(())
/// ```
#[derive(Debug, Clone)]
pub struct Injection {
    faults: Vec<Timed>,
    stimuli: Vec<Timed>,
    state: Option<ControllerState>,
}

#[derive(Debug, Clone)]
struct Timed {
    when: When,
    window_ns: Option<Range<u64>>,
}

impl Injection {
    /// The faults and stimuli of a scenario that is switched on at `now_ns`.
    ///
    /// # Errors
    /// Those of [`Scenario::validate`].
    pub fn new(scenario: &Scenario, now_ns: u64) -> Result<Self, ScenarioError> {
        let entries = scenario.entry_names();
        let timed = |when: When| Timed { when, window_ns: None };
        let faults = scenario.faults.iter().map(|fault| fault.when(&entries).map(timed));
        let stimuli = scenario.stimulus.iter().map(|stimulus| stimulus.when(&entries).map(timed));
        let mut injection = Self {
            faults: faults.collect::<Result<_, _>>()?,
            stimuli: stimuli.collect::<Result<_, _>>()?,
            state: None,
        };
        injection.occur(Start::SwitchOn, now_ns);
        Ok(injection)
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.faults.is_empty() && self.stimuli.is_empty()
    }

    /// The controller is in this state at that time, ns. Only the first cycle in a state counts.
    pub fn note_state(&mut self, state: ControllerState, now_ns: u64) {
        if self.state != Some(state) {
            self.state = Some(state);
            self.occur(Start::State(state), now_ns);
        }
    }

    /// A fault or a stimulus acts for the first time, ns.
    pub fn note_begin(&mut self, injected: Injected, now_ns: u64) {
        self.occur(
            match injected {
                Injected::Fault(place) => Start::Fault(place),
                Injected::Stimulus(place) => Start::Stimulus(place),
            },
            now_ns,
        );
    }

    /// The time in which it acts, ns; none until the occurrence that the time counts from.
    pub fn window_ns(&self, injected: Injected) -> Option<Range<u64>> {
        let timed = match injected {
            Injected::Fault(place) => self.faults.get(place),
            Injected::Stimulus(place) => self.stimuli.get(place),
        };
        timed?.window_ns.clone()
    }

    /// Whether it acts at that time, ns.
    pub fn is_active(&self, injected: Injected, now_ns: u64) -> bool {
        self.window_ns(injected).is_some_and(|window_ns| window_ns.contains(&now_ns))
    }

    fn occur(&mut self, start: Start, now_ns: u64) {
        let ns = |seconds: f64| (seconds * SECOND_NS as f64) as u64;
        let waiting = self.faults.iter_mut().chain(&mut self.stimuli);
        for timed in waiting.filter(|timed| timed.window_ns.is_none() && timed.when.start == start) {
            let begin_ns = now_ns.saturating_add(ns(timed.when.begin_s));
            let end_ns = timed.when.for_s.map_or(u64::MAX, |for_s| begin_ns.saturating_add(ns(for_s)));
            timed.window_ns = Some(begin_ns..end_ns);
        }
    }
}

#[cfg(test)]
mod tests {
    use masseter_scenario::{FaultConfig, FaultKindConfig};

    use super::*;

    #[test]
    fn times_count_from_switch_on_from_the_motion_and_from_each_other() {
        let at = |from_s, at_s, after: Option<&str>| FaultConfig {
            from_s,
            at_s,
            after: after.map(str::to_owned),
            axis: Some("l2".to_owned()),
            ..FaultConfig::new(FaultKindConfig::EncoderStuck)
        };
        let named = |name: &str, fault: FaultConfig| FaultConfig { name: Some(name.to_owned()), ..fault };
        let faults = vec![
            named("first", at(Some(0.5), None, None)),
            named("second", at(None, Some(1.0), None)),
            named("third", at(None, Some(0.25), Some("fault.second"))),
            named("fourth", at(None, Some(0.0), Some("controller.holding"))),
        ];
        let scenario = Scenario { faults, ..Scenario::default() };
        scenario.validate().unwrap();
        let mut injection = Injection::new(&scenario, 1000).unwrap();
        let begin_ns = |injection: &Injection, place| {
            injection.window_ns(Injected::Fault(place)).map(|window_ns| window_ns.start)
        };
        assert_eq!(begin_ns(&injection, 0), Some(500_001_000));
        injection.note_state(ControllerState::Easing, 5000);
        assert_eq!(begin_ns(&injection, 1), None);
        injection.note_state(ControllerState::Running, 6000);
        injection.note_state(ControllerState::Running, 7000);
        assert_eq!(begin_ns(&injection, 1), Some(1_000_006_000));
        assert_eq!(begin_ns(&injection, 2), None);
        injection.note_begin(Injected::Fault(1), 1_000_006_100);
        assert_eq!(begin_ns(&injection, 2), Some(1_250_006_100));
        assert_eq!(begin_ns(&injection, 3), None);
        injection.note_state(ControllerState::Holding, 9000);
        assert_eq!(begin_ns(&injection, 3), Some(9000));
        assert!(
            injection.is_active(Injected::Fault(3), u64::MAX - 1)
                && !injection.is_active(Injected::Fault(3), 8999)
        );
    }
}
