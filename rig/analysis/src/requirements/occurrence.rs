//! Occurrences in the events of a run: `fault.NAME`, `stimulus.NAME`, their ends, and `SOURCE.CAUSE`.

use std::collections::BTreeSet;

use masseter_runtime::messages::codes::{Cause, Source};
use masseter_scenario::input::excerpt;
use masseter_scenario::wording::nearest;
use masseter_scenario::{FaultConfig, FaultLayer, Scenario};

use crate::events::EventRecord;

/// The events that count as an occurrence.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Occurrence {
    /// An entry of the scenario begins or ends, by its number from 1.
    Entry { cause: Cause, number: usize },
    /// A reporter reports that cause.
    Event { source: Source, cause: Cause },
}

impl Occurrence {
    /// The occurrence of that name.
    pub(super) fn parse(name: &str, scenario: &Scenario) -> Result<Self, String> {
        let known = known(scenario);
        let found: Vec<_> = known.iter().filter(|(known, _)| known == name).collect();
        match found.as_slice() {
            [(_, occurrence)] => Ok(*occurrence),
            [] => {
                let question = nearest(name, known.iter().map(|(known, _)| known.as_str()))
                    .map_or_else(String::new, |likely| format!("; did you mean '{likely}'?"));
                Err(format!(
                    "'{}' is no occurrence: use fault.NAME, stimulus.NAME, controller.STATE or SOURCE.CAUSE{question}",
                    excerpt(name)
                ))
            }
            _ => Err(format!(
                "'{}': several entries have this name; give each a name of its own",
                excerpt(name)
            )),
        }
    }

    /// Whether the event is one.
    pub(super) fn matches(&self, event: &EventRecord) -> bool {
        match self {
            Self::Entry { cause, number } => {
                event.cause == *cause && event.value.to_bits() == (*number as f64).to_bits()
            }
            Self::Event { source, cause } => event.source == *source && event.cause == *cause,
        }
    }
}

/// What each reporter can report.
const REPORTS: [(Source, &[Cause]); 5] = [
    (
        Source::Controller,
        &[
            Cause::Sequence,
            Cause::StopRequested,
            Cause::StaleReading,
            Cause::DriveFault,
            Cause::ForwardKinematics,
            Cause::StrokeLimit,
            Cause::VelocityLimit,
            Cause::InverseKinematics,
            Cause::ForeignCommand,
            Cause::EnableTimeout,
            Cause::TrackingLost,
            Cause::OrientationLost,
            Cause::BadMessage,
            Cause::MasterFault,
            Cause::LawFailed,
            Cause::ParameterSet,
            Cause::StartTooFar,
        ],
    ),
    (
        Source::Master,
        &[
            Cause::Sequence,
            Cause::DriveFault,
            Cause::StrokeLimit,
            Cause::VelocityLimit,
            Cause::AccelerationLimit,
            Cause::FollowingError,
            Cause::CommandLost,
            Cause::BadMessage,
            Cause::HeartbeatLost,
            Cause::ProcessDataLost,
            Cause::BusRefused,
            Cause::BusOff,
            Cause::BootTimeout,
            Cause::Overflow,
            Cause::WrongIdentity,
            Cause::WrongPdo,
            Cause::NotAccepted,
            Cause::SdoAborted,
            Cause::SdoTimeout,
            Cause::DuplicateNode,
            Cause::NodeRestarted,
            Cause::FaultAtStart,
            Cause::NodeStopped,
            Cause::Recovered,
            Cause::WrongLength,
            Cause::UnknownNode,
            Cause::SecondMaster,
            Cause::StillPowered,
            Cause::HomeOffset,
            Cause::WrongObject,
            Cause::NotKept,
            Cause::WrongUnit,
            Cause::FaultFound,
            Cause::FaultReset,
            Cause::WaitsForDrive,
            Cause::NotReady,
            Cause::NotEnabled,
        ],
    ),
    (Source::Drive, &[Cause::Sequence, Cause::Emergency]),
    (Source::Wire, &[Cause::ErrorActive, Cause::ErrorPassive, Cause::BusOff]),
    (Source::Scenario, &[Cause::FoodBroke, Cause::EndStopHit]),
];

/// The ends of stimuli and faults that have none.
fn endless(scenario: &Scenario) -> BTreeSet<String> {
    let is_of_process = |fault: &&FaultConfig| fault.kind.layer() == FaultLayer::Process;
    let faults = scenario.faults.iter().filter(is_of_process).filter(|fault| fault.kind.size().is_none());
    let stimuli = scenario.stimulus.iter().filter(|stimulus| stimulus.is_of_controller());
    faults
        .map(|fault| format!("fault.{}.ended", fault.name()))
        .chain(stimuli.map(|stimulus| format!("stimulus.{}.ended", stimulus.name())))
        .collect()
}

/// The names of the events of the rig that can be occurrences.
pub fn event_names() -> impl Iterator<Item = String> {
    REPORTS
        .into_iter()
        .flat_map(|(source, causes)| causes.iter().map(move |cause| format!("{source}.{cause}")))
}

/// Every occurrence that a run of the scenario can have, with its name.
fn known(scenario: &Scenario) -> Vec<(String, Occurrence)> {
    let entries = |names: Vec<&str>, what: &str, causes: [Cause; 2]| -> Vec<_> {
        let of_entry = |(place, name): (usize, &str)| {
            let entry = |cause| Occurrence::Entry { cause, number: place + 1 };
            [(format!("{what}.{name}"), entry(causes[0])), (format!("{what}.{name}.ended"), entry(causes[1]))]
        };
        names.into_iter().enumerate().flat_map(of_entry).collect()
    };
    let names = scenario.entry_names();
    let faults = entries(names.faults, "fault", [Cause::FaultInjected, Cause::FaultEnded]);
    let stimuli = entries(names.stimuli, "stimulus", [Cause::StimulusBegan, Cause::StimulusEnded]);
    let events = REPORTS.into_iter().flat_map(|(source, causes)| {
        let named =
            move |cause: &Cause| (format!("{source}.{cause}"), Occurrence::Event { source, cause: *cause });
        causes.iter().map(named).collect::<Vec<_>>()
    });
    let endless = endless(scenario);
    faults.into_iter().chain(stimuli).chain(events).filter(|(name, _)| !endless.contains(name)).collect()
}
