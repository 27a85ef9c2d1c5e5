//! The requirements of a run, judged together.

use masseter_recording::Recorded;
use masseter_shared::config::{RequirementConfig, Scenario};
use masseter_shared::messages::codes::ControllerState;
use masseter_shared::named::Declared;

use super::finding::RequirementFigures;
use super::moment::Moment;
use super::requirement::Requirement;
use crate::events::EventRecord;
use crate::signals::{Registry, Sample, Timeline, Values};

/// Judges every requirement of a scenario.
///
/// ```
/// use masseter_analysis::requirements::{RequirementResult, Requirements};
/// use masseter_recording::Recorded;
/// use masseter_shared::config::{RequirementConfig, Scenario};
/// use masseter_shared::messages::Reading;
/// use masseter_shared::messages::codes::DriveState;
/// use masseter_shared::named::Declared;
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
/// # Ok::<(), masseter_shared::config::ScenarioError>(())
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
/// A sentence that names the requirement.
pub fn check_requirements(scenario: &Scenario, declared: Option<&Declared>) -> Result<(), String> {
    let mut values = Values::new(Registry::new(scenario, declared.unwrap_or(&Declared::default())));
    for (place, config) in scenario.require.iter().enumerate() {
        if scenario.require[..place].iter().any(|other| other.name == config.name) {
            return Err(format!("require '{}': another requirement has this name", config.name));
        }
        let read = Requirement::new(config, scenario, &mut values);
        if let Err(reason) = read
            && (declared.is_some() || !(reason.contains("'signal.") || reason.contains("'parameter.")))
        {
            return Err(format!("require '{}': {reason}", config.name));
        }
    }
    let expected = scenario.expect.iter().flat_map(|expect| &expect.events);
    for name in expected {
        super::trigger::Trigger::parse(name, scenario, &mut values)
            .map_err(|reason| format!("expect.events: {reason}"))?;
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
                .unwrap_or_else(|reason| Requirement::unknown(config, reason))
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
