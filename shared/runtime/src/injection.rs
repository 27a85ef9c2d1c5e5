//! The times of faults and stimuli in a run, from their starting occurrences. The operator of a scenario sets
//! parameters of the controller, requests a stop, and finds the due faults of processes.
//!
//! [`Injection`] acts on nothing: plant, controller and supervisor ask for the windows of their own faults and stimuli.
//! The [`Operator`] gets readings and the controller's states, and acts on nothing either.

use std::fmt::{self, Display, Formatter};
use std::ops::Range;

use masseter_scenario::{CommandFault, Scenario, ScenarioError, Start, StimulusConfig, When};

use crate::messages::codes::{Cause, ControllerState, EventKind, OF_OPERATOR, Source};
use crate::named::{Declared, NameError};
use crate::{clock::SECOND_NS, messages::Event};

/// A fault or a stimulus, with its place in the scenario's list.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum Injected {
    /// A fault.
    Fault(usize),
    /// A stimulus.
    Stimulus(usize),
}

impl Display for Injected {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self {
            Self::Fault(place) => write!(f, "[[faults]] number {}", place + 1),
            Self::Stimulus(place) => write!(f, "[[stimulus]] number {}", place + 1),
        }
    }
}

/// The faults and stimuli that a run goes on without.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum Withdrawn {
    /// Both.
    All,
    /// The faults.
    Faults,
    /// The stimuli.
    Stimuli,
    /// One of them.
    One(Injected),
}

impl Withdrawn {
    /// Whether this is one of them.
    pub fn holds(self, injected: Injected) -> bool {
        match self {
            Self::All => true,
            Self::Faults => matches!(injected, Injected::Fault(_)),
            Self::Stimuli => matches!(injected, Injected::Stimulus(_)),
            Self::One(one) => one == injected,
        }
    }
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
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub struct Injection {
    faults: Vec<Timed>,
    stimuli: Vec<Timed>,
    state: Option<ControllerState>,
    /// What acts no more from that time on, ns.
    withdrawn: Option<(Withdrawn, u64)>,
}

#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
struct Timed {
    when: When,
    window_ns: Option<Range<u64>>,
}

impl Injection {
    /// The faults and stimuli of a scenario with the switch-on at `now_ns`.
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
            withdrawn: None,
        };
        injection.occur(Start::SwitchOn, now_ns);
        Ok(injection)
    }

    /// Whether the scenario has none.
    pub fn is_empty(&self) -> bool {
        self.faults.is_empty() && self.stimuli.is_empty()
    }

    /// Notes the controller's state at that time, ns. Only the first cycle in a state counts.
    pub fn note_state(&mut self, state: ControllerState, now_ns: u64) {
        if self.state != Some(state) {
            self.state = Some(state);
            self.occur(Start::State(state), now_ns);
        }
    }

    /// Notes the first effect of a fault or a stimulus, ns.
    pub fn note_begin(&mut self, injected: Injected, now_ns: u64) {
        let start = match injected {
            Injected::Fault(place) => Start::Fault(place),
            Injected::Stimulus(place) => Start::Stimulus(place),
        };
        self.occur(start, now_ns);
    }

    /// The time of its effect, ns; none before the starting occurrence.
    pub fn window_ns(&self, injected: Injected) -> Option<Range<u64>> {
        let timed = match injected {
            Injected::Fault(place) => self.faults.get(place),
            Injected::Stimulus(place) => self.stimuli.get(place),
        };
        let Range { start, end } = timed?.window_ns.clone()?;
        let withdrawn = self.withdrawn.filter(|(withdrawn, _)| withdrawn.holds(injected));
        Some(start..withdrawn.map_or(end, |(_, from_ns)| end.min(from_ns).max(start)))
    }

    /// Lets these act no more from that time on, ns: what acts ends, and what has not begun never does.
    pub fn withdraw(&mut self, withdrawn: Withdrawn, from_ns: u64) {
        self.withdrawn = Some((withdrawn, from_ns));
    }

    /// Whether the fault or stimulus acts at that time, ns.
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

/// The reason why the operator cannot carry a scenario out.
#[derive(Debug, thiserror::Error)]
pub enum OperatorError {
    /// A time names nothing of the scenario.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// The controller has no such parameter, or refuses the value.
    #[error("{}: {error}", Injected::Stimulus(*stimulus))]
    Parameter {
        /// The place of the stimulus in the scenario's list.
        stimulus: usize,
        /// The refusal.
        error: NameError,
    },
    /// A time counts from an occurrence that the controller does not see.
    #[error(
        "{0}: its time counts from an occurrence in the plant, which the controller does not see: count from the motion \
         (at_s alone), or from controller.STATE"
    )]
    Unseen(Injected),
}

impl OperatorError {
    /// The key in the scenario and the number of its entry in the list, from 0.
    pub fn key(&self) -> Option<(&'static str, usize)> {
        match self {
            Self::Scenario(_) => None,
            Self::Parameter { stimulus, error: NameError::OutOfRange { .. } } => {
                Some(("stimulus.value", *stimulus))
            }
            Self::Parameter { stimulus, .. } => Some(("stimulus.parameter", *stimulus)),
            Self::Unseen(Injected::Fault(place)) => Some(("faults.after", *place)),
            Self::Unseen(Injected::Stimulus(place)) => Some(("stimulus.after", *place)),
        }
    }
}

/// A due action.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Due {
    /// A parameter gets a value.
    Set { place: usize, value: f64 },
    /// An orderly stop is asked for.
    Stop,
    /// A fault of a process, by its place in the scenario's list. The supervisor decides whether to carry the fault
    /// out.
    Fault(usize),
}

/// The operator of a run.
///
/// ```
/// use masseter_scenario::{Scenario, StimulusConfig};
/// use masseter_runtime::injection::Operator;
/// use masseter_runtime::named::Declared;
///
/// let set = StimulusConfig { parameter: Some("gain".into()), value: Some(3.0), ..StimulusConfig::at(1.0) };
/// let scenario = Scenario { stimulus: vec![set], ..Scenario::default() };
/// // The controller declares no such parameter.
/// assert!(Operator::new(&scenario, &Declared::default(), 0).is_err());
/// ```
#[derive(Debug, Clone)]
pub struct Operator {
    injection: Injection,
    /// Actions that have not been due.
    waiting: Vec<(Injected, Due)>,
    /// Time of the newest reading's sample, ns.
    sampled_ns: u64,
}

impl Operator {
    /// The operator of a scenario with the switch-on at `now_ns`, for a controller with these parameters.
    ///
    /// # Errors
    /// [`OperatorError`].
    pub fn new(scenario: &Scenario, declared: &Declared, now_ns: u64) -> Result<Self, OperatorError> {
        let (mut waiting, entries) = (Vec::new(), scenario.entry_names());
        for (place, stimulus) in scenario.stimulus.iter().enumerate() {
            if !stimulus.is_of_controller() {
                continue;
            }
            let when = stimulus.when(&entries)?;
            if !is_seen_by_controller(when, scenario) {
                return Err(OperatorError::Unseen(Injected::Stimulus(place)));
            }
            let refused = |error| OperatorError::Parameter { stimulus: place, error };
            waiting.push((Injected::Stimulus(place), due_of(stimulus, declared).map_err(refused)?));
        }
        for (place, fault) in scenario.faults.iter().enumerate() {
            let is_of_process = fault.kind.is_of_process();
            if !is_of_process && fault.kind != CommandFault::ControllerStall.into() {
                continue;
            }
            let when = fault.when(&entries)?;
            if !is_seen_by_controller(when, scenario) {
                // In simulated time the plant alone stalls the commands; real time refuses this before the start.
                if !is_of_process {
                    continue;
                }
                return Err(OperatorError::Unseen(Injected::Fault(place)));
            }
            waiting.push((Injected::Fault(place), Due::Fault(place)));
        }
        Ok(Self { injection: Injection::new(scenario, now_ns)?, waiting, sampled_ns: 0 })
    }

    /// Does no more of these from that time on, ns.
    pub fn withdraw(&mut self, withdrawn: Withdrawn, from_ns: u64) {
        self.injection.withdraw(withdrawn, from_ns);
    }

    /// The due action of a cycle with a reading sampled at this time, ns. A cycle gets at most one, so that its work is
    /// bounded. `None` as the time stands for a cycle without a new reading.
    pub(crate) fn take_due(&mut self, sampled_ns: Option<u64>) -> Option<(Injected, Due)> {
        self.sampled_ns = sampled_ns.unwrap_or(self.sampled_ns);
        let (injection, now_ns) = (&self.injection, self.sampled_ns);
        let place = self.waiting.iter().position(|(injected, _)| injection.is_active(*injected, now_ns))?;
        let (injected, due) = self.waiting.swap_remove(place);
        self.injection.note_begin(injected, now_ns);
        Some((injected, due))
    }

    /// Notes the controller's state in the cycle of the newest reading.
    pub(crate) fn note_state(&mut self, state: u32) {
        if self.waiting.is_empty() {
            return;
        }
        if let Ok(state) = ControllerState::try_from(state) {
            self.injection.note_state(state, self.sampled_ns);
        }
    }
}

/// The event of a begun stimulus; none for a fault, whose event comes from the part that carries the fault out.
pub(crate) fn begin_event(injected: Injected, cycle: u64, time_ns: u64) -> Option<Event> {
    let Injected::Stimulus(place) = injected else { return None };
    let value = (place + 1) as f64;
    let event = Event::new(Source::Scenario, EventKind::Notice, Cause::StimulusBegan);
    Some(Event { time_ns, cycle, value, object: OF_OPERATOR, ..event })
}

/// Whether the controller sees the start of the time.
pub fn is_seen_by_controller(when: When, scenario: &Scenario) -> bool {
    match when.start {
        Start::SwitchOn | Start::State(_) => true,
        Start::Stimulus(place) => scenario.stimulus.get(place).is_some_and(StimulusConfig::is_of_controller),
        Start::Fault(place) => scenario.faults.get(place).is_some_and(|fault| fault.kind.is_of_process()),
    }
}

fn due_of(stimulus: &StimulusConfig, declared: &Declared) -> Result<Due, NameError> {
    let Some(name) = &stimulus.parameter else { return Ok(Due::Stop) };
    let (place, value) = (declared.place_of(name)?, stimulus.value.unwrap_or_default());
    declared.parameters[place].check(value)?;
    Ok(Due::Set { place, value })
}

#[cfg(test)]
mod tests {
    use masseter_scenario::{EncoderFault, FaultConfig, ProcessFault};

    use super::*;
    use crate::named::Parameter;

    const RUNNING: u32 = ControllerState::Running.code();

    fn set(at_s: f64, value: f64) -> StimulusConfig {
        StimulusConfig { parameter: Some("gain".to_owned()), value: Some(value), ..StimulusConfig::at(at_s) }
    }

    fn declared() -> Declared {
        let gain = Parameter { range: [0.0, 9.0], ..Parameter::new("gain", 1.0) };
        Declared { parameters: vec![gain], ..Declared::default() }
    }

    #[test]
    fn one_thing_a_cycle_is_due_from_its_time_of_the_motion_on() {
        let kill = FaultConfig { at_s: Some(2.0), ..FaultConfig::new(ProcessFault::PlantKill) };
        let stop = StimulusConfig {
            stop: true,
            after: Some("stimulus.parameter".to_owned()),
            ..StimulusConfig::at(0.5)
        };
        let scenario =
            Scenario { stimulus: vec![set(1.0, 3.0), stop], faults: vec![kill], ..Scenario::default() };
        let mut operator = Operator::new(&scenario, &declared(), 0).unwrap();
        let s = |seconds: f64| Some((seconds * 1e9) as u64);
        assert_eq!(operator.take_due(s(5.0)), None, "nothing runs yet");
        operator.note_state(RUNNING);
        assert_eq!(operator.take_due(s(5.999)), None);
        let expected = (Injected::Stimulus(0), Due::Set { place: 0, value: 3.0 });
        assert_eq!(operator.take_due(s(6.0)), Some(expected));
        assert_eq!(operator.take_due(None), None, "time stands still without readings");
        assert_eq!(operator.take_due(s(6.5)), Some((Injected::Stimulus(1), Due::Stop)));
        assert_eq!(operator.take_due(s(7.0)), Some((Injected::Fault(0), Due::Fault(0))));
        assert_eq!(operator.take_due(s(8.0)), None);
    }

    #[test]
    fn what_the_controller_cannot_do_or_see_is_refused() {
        let refusal = |scenario: &Scenario| Operator::new(scenario, &declared(), 0).unwrap_err().to_string();
        let with = |stimulus| Scenario { stimulus, ..Scenario::default() };
        assert!(refusal(&with(vec![set(1.0, 10.0)])).contains("number 1: parameter 'gain' cannot be 10"));
        let unknown = StimulusConfig { parameter: Some("gian".to_owned()), ..set(1.0, 1.0) };
        assert!(refusal(&with(vec![set(0.0, 1.0), unknown])).contains("did you mean 'gain'"));
        let push = StimulusConfig { push_n: Some([1.0; 3]), ..StimulusConfig::at(0.0) };
        let late = StimulusConfig { after: Some("stimulus.push".to_owned()), ..set(1.0, 1.0) };
        assert!(refusal(&with(vec![push, late])).contains("[[stimulus]] number 2: its time counts from"));
    }

    #[test]
    fn times_count_from_switch_on_from_the_motion_and_from_each_other() {
        let at = |from_s, at_s, after: Option<&str>| FaultConfig {
            from_s,
            at_s,
            after: after.map(str::to_owned),
            axis: Some("l2".to_owned()),
            ..FaultConfig::new(EncoderFault::Stuck)
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
