//! The requirements of a run, judged together.

use std::collections::BTreeSet;

use masseter_recording::Recorded;
use masseter_runtime::messages::codes::ControllerState;
use masseter_runtime::named::Declared;
use masseter_scenario::input::excerpt;
use masseter_scenario::{RequirementConfig, Scenario};

use super::finding::RequirementFigures;
use super::moment::Moment;
use super::refusal::{Reason, Refused, RequirementError};
use super::requirement::Requirement;
use super::trigger::Trigger;
use crate::events::EventRecord;
use crate::signals::{Registry, Sample, Timeline, Values};

/// Judges every requirement of a scenario.
///
/// ```
/// use masseter_analysis::requirements::{RequirementResult, Requirements};
/// use masseter_recording::Recorded;
/// use masseter_scenario::{RequirementConfig, Scenario};
/// use masseter_runtime::messages::Reading;
/// use masseter_runtime::messages::codes::DriveState;
/// use masseter_runtime::named::Declared;
///
/// let text = "[[require]]\nname = 'first leg'\nsignal = 'l1.position'\nmax = '300 mm'";
/// let scenario = Scenario::parse("s.toml".as_ref(), text)?;
/// let mut requirements = Requirements::new(&scenario, &Declared::default());
/// let mut reading = Reading { cycle: 1, sampled_ns: 1000, ..Reading::default() };
/// reading.position_m[3] = 0.29;
/// reading.drive_state = [DriveState::OperationEnabled.code(); 6];
/// requirements.take(&Recorded::Reading(reading));
/// let found = requirements.finish();
/// assert_eq!(found[0].result, RequirementResult::Passed);
/// assert_eq!(found[0].margin.map(f64::round), Some(10.0));
/// # Ok::<(), masseter_scenario::ScenarioError>(())
/// ```
#[derive(Debug, Clone)]
pub struct Requirements {
    list: Vec<Requirement>,
    values: Values,
    timeline: Timeline,
    row: Vec<f64>,
    state: usize,
    motion_ns: Option<u64>,
}

/// Refuses a scenario with a requirement that cannot be judged. Without `declared`, the controller's own signals and
/// parameters are unknown yet and not checked.
///
/// # Errors
/// [`RequirementError`] with the key in the scenario.
pub fn check_requirements(scenario: &Scenario, declared: Option<&Declared>) -> Result<(), RequirementError> {
    let mut values = Values::new(Registry::new(scenario, declared.unwrap_or(&Declared::default())));
    let may_come = |reason: &Reason| match reason {
        Reason::Unknown(signal) => declared.is_none() && signal.is_of_controller(),
        Reason::Wrong(_) => false,
    };
    let mut names = BTreeSet::new();
    for (place, config) in scenario.require.iter().enumerate() {
        let refused = |Refused { key, reason }| RequirementError {
            key,
            entry: Some(place),
            of: format!("require '{}'", excerpt(&config.name)),
            reason: reason.to_string(),
        };
        if !names.insert(&config.name) {
            return Err(refused(Refused::new("require.name", "another requirement has this name")));
        }
        match Requirement::new(config, scenario, &mut values) {
            Err(error) if !may_come(&error.reason) => return Err(refused(error)),
            _ => {}
        }
    }
    for name in scenario.expect.iter().flat_map(|expect| &expect.events) {
        Trigger::parse(name, scenario, &mut values).map_err(|reason| RequirementError {
            key: "expect.events",
            entry: None,
            of: "expect.events".to_owned(),
            reason: reason.to_string(),
        })?;
    }
    Ok(())
}

impl Requirements {
    /// The requirements of a scenario whose controller declares these signals and parameters, and the events that it expects.
    pub fn new(scenario: &Scenario, declared: &Declared) -> Self {
        let mut values = Values::new(Registry::new(scenario, declared));
        let expected = scenario.expect.iter().flat_map(|expect| &expect.events).map(expected_event);
        let mut read = |config: &RequirementConfig| {
            Requirement::new(config, scenario, &mut values)
                .unwrap_or_else(|refused| Requirement::unknown(config, refused.reason.to_string()))
        };
        let mut list: Vec<_> = scenario.require.iter().map(&mut read).collect();
        list.extend(expected.map(|config| read(&config).into_expected_event()));
        let state = values.choose("controller.state").expect("every run has this signal");
        Self { list, values, timeline: Timeline::default(), row: Vec::new(), state, motion_ns: None }
    }

    /// The same for messages that come while the run goes on, each soon after its cycle.
    #[must_use]
    pub fn while_running(scenario: &Scenario, declared: &Declared) -> Self {
        Self { timeline: Timeline::while_running(), ..Self::new(scenario, declared) }
    }

    /// Whether there are none: then nothing has to be taken.
    pub fn is_empty(&self) -> bool {
        self.list.is_empty()
    }

    /// Takes the next message of the recording.
    pub fn take(&mut self, message: &Recorded) {
        if let Some(sample) = self.timeline.take(message) {
            self.judge(&sample);
        }
    }

    /// Takes an event of the run.
    pub fn event(&mut self, event: &EventRecord) {
        self.timeline.event(event);
    }

    /// A lost cycle may have acted on the jaw in this cycle.
    pub fn disturb(&mut self, cycle: u64) {
        self.timeline.disturb(cycle);
    }

    /// What every requirement comes to.
    pub fn finish(mut self) -> Vec<RequirementFigures> {
        while let Some(sample) = self.timeline.finish() {
            self.judge(&sample);
        }
        self.list.into_iter().map(|requirement| requirement.finish(self.motion_ns)).collect()
    }

    fn judge(&mut self, Sample { time_ns, messages, events, is_closing }: &Sample) {
        self.values.take(messages, &mut self.row);
        if self.row[self.state].to_bits() == f64::from(ControllerState::Running.code()).to_bits() {
            self.motion_ns.get_or_insert(*time_ns);
        }
        let motion_s = self.motion_ns.map(|motion_ns| (time_ns - motion_ns) as f64 / 1e9);
        let (values, is_disturbed) = (self.row.as_slice(), messages.is_disturbed);
        let moment =
            Moment { time_ns: *time_ns, motion_s, values, events, is_disturbed, is_closing: *is_closing };
        self.list.iter_mut().for_each(|requirement| requirement.take(&moment));
    }
}

/// The requirement that an expected event occurs.
fn expected_event(name: &String) -> RequirementConfig {
    RequirementConfig {
        name: format!("expected event {name}"),
        event: Some(name.clone()),
        at_least: Some(1),
        ..Default::default()
    }
}
