//! The operator of a scenario: sets parameters of the controller and asks for a stop, at times of the motion. It also says
//! when the faults of processes are due, since only here their times are known.
//!
//! It sees what the controller sees: readings and its own states. It acts on nothing.

use masseter_scenario::{FaultKindConfig, FaultLayer, Scenario, ScenarioError, Start, StimulusConfig, When};

use crate::injection::{Injected, Injection};
use crate::messages::Event;
use crate::messages::codes::{Cause, ControllerState, EventKind, OF_OPERATOR, Source};
use crate::named::{Declared, NameError};

/// Why the operator cannot do what the scenario says.
#[derive(Debug, thiserror::Error)]
pub enum OperatorError {
    /// A time names nothing of the scenario.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// The controller has no such parameter, or refuses the value.
    #[error("[[stimulus]] number {number}: {error}")]
    Parameter {
        /// The number of the stimulus, from 1.
        number: usize,
        /// The refusal.
        error: NameError,
    },
    /// A time counts from what the controller does not see.
    #[error(
        "{table} number {number}: its time counts from an occurrence in the plant, which the controller does not see: \
         count from the motion (at_s alone), or from controller.STATE"
    )]
    Unseen {
        /// The table.
        table: &'static str,
        /// The number in it, from 1.
        number: usize,
    },
}

impl OperatorError {
    /// The key in the scenario, and the number of its entry in the list, from 0.
    pub fn key(&self) -> Option<(&'static str, usize)> {
        match self {
            Self::Scenario(_) => None,
            Self::Parameter { number, error: NameError::OutOfRange { .. } } => {
                Some(("stimulus.value", number - 1))
            }
            Self::Parameter { number, .. } => Some(("stimulus.parameter", number - 1)),
            Self::Unseen { table: "[[faults]]", number } => Some(("faults.after", number - 1)),
            Self::Unseen { number, .. } => Some(("stimulus.after", number - 1)),
        }
    }
}

/// What is due.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Due {
    /// A parameter gets a value.
    Set { place: usize, value: f64 },
    /// An orderly stop is asked for.
    Stop,
    /// A fault of a process, with its place in the scenario's list. The supervisor knows whether it is to carry it out.
    Fault(usize),
}

/// The operator of a run.
///
/// ```
/// use masseter_scenario::{Scenario, StimulusConfig};
/// use masseter_runtime::control::Operator;
/// use masseter_runtime::named::Declared;
///
/// let set = StimulusConfig { parameter: Some("gain".into()), value: Some(3.0), ..StimulusConfig::at(1.0) };
/// let scenario = Scenario { stimulus: vec![set], ..Scenario::default() };
/// // The controller declares no such parameter.
/// assert!(Operator::new(&scenario, &Declared::default(), 0).is_err());
/// ```
#[derive(Debug)]
pub struct Operator {
    injection: Injection,
    /// What has not been due yet.
    waiting: Vec<(Injected, Due)>,
    /// When the newest reading was sampled, ns.
    sampled_ns: u64,
}

impl Operator {
    /// The operator of a scenario that is switched on at `now_ns`, for a controller that declares these parameters.
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
                return Err(OperatorError::Unseen { table: "[[stimulus]]", number: place + 1 });
            }
            let due = due(stimulus, declared)
                .map_err(|error| OperatorError::Parameter { number: place + 1, error })?;
            waiting.push((Injected::Stimulus(place), due));
        }
        for (place, fault) in scenario.faults.iter().enumerate() {
            let is_of_process = fault.kind.layer() == FaultLayer::Process;
            if !is_of_process && fault.kind != FaultKindConfig::ControllerStall {
                continue;
            }
            let when = fault.when(&entries)?;
            if !is_seen_by_controller(when, scenario) {
                // In simulated time the plant alone stalls the commands; real time refuses this before the start.
                if !is_of_process {
                    continue;
                }
                return Err(OperatorError::Unseen { table: "[[faults]]", number: place + 1 });
            }
            waiting.push((Injected::Fault(place), Due::Fault(place)));
        }
        Ok(Self { injection: Injection::new(scenario, now_ns)?, waiting, sampled_ns: 0 })
    }

    /// What is due in a cycle that uses a reading sampled at this time, ns: at most one thing, so that the work of a cycle is
    /// bounded. None stands for a cycle without a new reading.
    pub(crate) fn take_due(&mut self, sampled_ns: Option<u64>) -> Option<(Injected, Due)> {
        self.sampled_ns = sampled_ns.unwrap_or(self.sampled_ns);
        let (injection, now_ns) = (&self.injection, self.sampled_ns);
        let place = self.waiting.iter().position(|(injected, _)| injection.is_active(*injected, now_ns))?;
        let (injected, due) = self.waiting.swap_remove(place);
        self.injection.note_begin(injected, now_ns);
        Some((injected, due))
    }

    /// The controller was in this state in the cycle of the newest reading.
    pub(crate) fn note_state(&mut self, state: u32) {
        if self.waiting.is_empty() {
            return;
        }
        if let Ok(state) = ControllerState::try_from(state) {
            self.injection.note_state(state, self.sampled_ns);
        }
    }
}

/// The event of a stimulus that began; none for a fault, which whoever carries it out enters.
pub(crate) fn event(injected: Injected, cycle: u64, time_ns: u64) -> Option<Event> {
    let Injected::Stimulus(place) = injected else { return None };
    let value = (place + 1) as f64;
    let event = Event::new(Source::Scenario, EventKind::Notice, Cause::StimulusBegan);
    Some(Event { time_ns, cycle, value, object: OF_OPERATOR, ..event })
}

/// Whether the controller sees what the time counts from.
pub fn is_seen_by_controller(when: When, scenario: &Scenario) -> bool {
    match when.start {
        Start::SwitchOn | Start::State(_) => true,
        Start::Stimulus(place) => scenario.stimulus.get(place).is_some_and(StimulusConfig::is_of_controller),
        Start::Fault(place) => {
            scenario.faults.get(place).is_some_and(|fault| fault.kind.layer() == FaultLayer::Process)
        }
    }
}

fn due(stimulus: &StimulusConfig, declared: &Declared) -> Result<Due, NameError> {
    let Some(name) = &stimulus.parameter else { return Ok(Due::Stop) };
    let (place, value) = (declared.place_of(name)?, stimulus.value.unwrap_or_default());
    declared.parameters[place].check(value)?;
    Ok(Due::Set { place, value })
}

#[cfg(test)]
mod tests {
    use masseter_scenario::FaultConfig;

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
        let kill = FaultConfig { at_s: Some(2.0), ..FaultConfig::new(FaultKindConfig::PlantKill) };
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
}
