//! Triggers of requirements: occurrences in the events of a run, and conditions that begin to hold. Occurrences are
//! `fault.NAME`, `stimulus.NAME`, their ends, and `SOURCE.CAUSE`. A trigger may also begin the part of a run for
//! which a requirement counts.

use std::collections::BTreeSet;

use masseter_runtime::clock::SECOND_NS;
use masseter_runtime::messages::codes::{Cause, ControllerState, Source};
use masseter_scenario::{During, RequirementConfig, Scenario, TimeWindow, input::excerpt, wording::nearest};

use super::condition::{Condition, Lookup, Moment, has_comparison, state_of_controller};
use super::finding::{Finding, OfKey, Reason, Refused};
use crate::events::EventRecord;

/// What a requirement waits for.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Trigger {
    /// As written.
    pub(super) text: String,
    watched: Watched,
}

#[derive(Debug, Clone, PartialEq)]
enum Watched {
    Occurrence(Occurrence),
    /// The controller enters a state. A sample shows the state that was decided after it, so the entry counts at the next
    /// one; `shown_ns` is the sample that first showed the state.
    Entry {
        state: ControllerState,
        edge: Edge,
        shown_ns: Option<u64>,
    },
    Edge(Edge),
}

/// A condition, and whether it held at the last sample that has its value.
#[derive(Debug, Clone, PartialEq)]
struct Edge {
    condition: Condition,
    held: bool,
}

impl Edge {
    fn parse(text: &str, of: &mut Lookup<'_>) -> Result<Self, Reason> {
        Ok(Self { condition: Condition::parse(text, of.values)?, held: false })
    }

    /// Whether the condition begins to hold at this sample. One without the value shows no change.
    fn begins_to_hold(&mut self, moment: &Moment<'_>) -> bool {
        let Some(robustness) = self.condition.robustness(moment.values) else { return false };
        let had_held = std::mem::replace(&mut self.held, robustness >= 0.0);
        self.held && !had_held
    }
}

impl Trigger {
    /// Reads an occurrence or a condition. `controller.running` and the like are the beginnings of the controller's states.
    pub(super) fn parse(text: &str, of: &mut Lookup<'_>) -> Result<Self, Reason> {
        let text = text.trim();
        let watched = match state_of_controller(text.strip_prefix("controller.").unwrap_or(text)) {
            Some(state) => Watched::Entry { state, edge: Edge::parse(state.name(), of)?, shown_ns: None },
            None if has_comparison(text) => Watched::Edge(Edge::parse(text, of)?),
            None => Watched::Occurrence(Occurrence::parse(text, of.scenario)?),
        };
        Ok(Self { text: text.to_owned(), watched })
    }

    /// The times of what occurs at this sample, each when it occurred, ns. Every sample of the run must be given.
    pub(super) fn times_ns(&mut self, moment: &Moment<'_>) -> Vec<u64> {
        let mut events = moment.events.iter();
        match &mut self.watched {
            Watched::Occurrence(occurrence) => {
                events.filter(|event| occurrence.matches(event)).map(|event| event.time_ns).collect()
            }
            Watched::Entry { state, edge, shown_ns } => {
                let of_event = events.find(|event| event.enters(*state)).map(|event| event.time_ns);
                let entered_ns = shown_ns.take().map(|sampled_ns| of_event.unwrap_or(sampled_ns));
                *shown_ns = edge.begins_to_hold(moment).then_some(moment.time_ns);
                entered_ns.into_iter().collect()
            }
            Watched::Edge(edge) => {
                edge.begins_to_hold(moment).then_some(moment.time_ns).into_iter().collect()
            }
        }
    }
}

/// The events that count as an occurrence.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Occurrence {
    /// An entry of the scenario begins or ends, by its number from 1.
    Entry { cause: Cause, number: usize },
    /// A reporter reports that cause.
    Event { source: Source, cause: Cause },
}

impl Occurrence {
    /// The occurrence of that name.
    fn parse(name: &str, scenario: &Scenario) -> Result<Self, Reason> {
        let known = known(scenario);
        let found: Vec<_> = known.iter().filter(|(known, _)| known == name).collect();
        let why = match found.as_slice() {
            [(_, occurrence)] => return Ok(*occurrence),
            [] => {
                let likely = nearest(name, known.iter().map(|(known, _)| known.as_str()));
                let question = likely.map(|likely| format!("; did you mean '{likely}'?")).unwrap_or_default();
                let forms = "fault.NAME, stimulus.NAME, controller.STATE or SOURCE.CAUSE";
                format!(" is no occurrence: use {forms}{question}")
            }
            _ => ": several entries have this name; give each a name of its own".to_owned(),
        };
        Err(Reason::wrong(format!("'{}'{why}", excerpt(name))))
    }

    /// Whether the event is one.
    fn matches(&self, event: &EventRecord) -> bool {
        match self {
            Self::Entry { cause, number } => {
                event.cause == *cause && event.value.to_bits() == (*number as f64).to_bits()
            }
            Self::Event { source, cause } => event.source == *source && event.cause == *cause,
        }
    }
}

/// Causes by their names alone, so that a list of many stays short.
macro_rules! causes {
    ($($cause:ident)*) => { &[$(Cause::$cause),*] };
}

/// What each reporter can report.
const REPORTS: [(Source, &[Cause]); 5] = [
    (
        Source::Controller,
        causes!(
            Sequence StopRequested StaleReading DriveFault ForwardKinematics StrokeLimit VelocityLimit
            InverseKinematics ForeignCommand EnableTimeout TrackingLost OrientationLost BadMessage MasterFault
            LawFailed ParameterSet StartTooFar ForceLimit MotionLate WrongStiffness
        ),
    ),
    (
        Source::Master,
        causes!(
            Sequence DriveFault StrokeLimit VelocityLimit AccelerationLimit FollowingError CommandLost
            BadMessage HeartbeatLost ProcessDataLost BusRefused BusOff BootTimeout Overflow WrongIdentity
            WrongPdo NotAccepted SdoAborted SdoTimeout DuplicateNode NodeRestarted FaultAtStart NodeStopped
            Recovered WrongLength UnknownNode SecondMaster StillPowered HomeOffset WrongObject NotKept
            WrongUnit FaultFound FaultReset WaitsForDrive NotReady NotEnabled Emergency
        ),
    ),
    (Source::Drive, causes!(Sequence Emergency)),
    (Source::Wire, causes!(ErrorActive ErrorPassive BusOff)),
    (Source::Scenario, causes!(FoodBroke EndStopHit)),
];

/// The ends of stimuli and faults that have none.
fn endless(scenario: &Scenario) -> BTreeSet<String> {
    let faults =
        scenario.faults.iter().filter(|fault| fault.kind.is_of_process() && !fault.kind.takes("size"));
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

/// When a requirement is judged.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Window {
    /// In words; empty for the whole run.
    pub(super) text: String,
    extent: Extent,
    /// Whether it must not be cut.
    is_whole: bool,
    /// How far the motion came, s, and when the last sample was, ns.
    reached: (f64, u64),
}

#[derive(Debug, Clone, PartialEq)]
enum Extent {
    Always,
    While(Condition),
    /// Of the motion, s; both ends belong to it.
    Motion {
        from_s: f64,
        to_s: f64,
    },
    /// After an occurrence, with the time when it ends, ns.
    After {
        trigger: Trigger,
        for_ns: u64,
        until_ns: Option<u64>,
    },
}

impl Window {
    pub(super) fn new(config: &RequirementConfig, of: &mut Lookup<'_>) -> Result<Self, Refused> {
        let (text, extent) = match &config.during {
            None => (String::new(), Extent::Always),
            Some(During::While(text)) => {
                let condition = Condition::parse(text, of.values).of_key("require.during")?;
                (format!(" while {}", condition.text), Extent::While(condition))
            }
            Some(During::Time(window)) => Self::of_time(window, of).of_key("require.during")?,
        };
        Ok(Self { text, extent, is_whole: config.whole, reached: (0.0, 0) })
    }

    fn of_time(window: &TimeWindow, of: &mut Lookup<'_>) -> Result<(String, Extent), Reason> {
        let TimeWindow { from_s, to_s, after, for_s } = window;
        if let Some(name) = after {
            if from_s.is_some() || to_s.is_some() {
                return Err(Reason::wrong("give after and for_s, or from_s and to_s"));
            }
            let trigger = Trigger::parse(name, of)?;
            if for_s.is_some_and(|for_s| !(for_s.is_finite() && for_s > 0.0)) {
                return Err(Reason::wrong("for_s: use a finite number above 0"));
            }
            let for_ns = for_s.map_or(u64::MAX, |for_s| (for_s * SECOND_NS as f64) as u64);
            let how_long = for_s.map_or_else(String::new, |for_s| format!("{for_s} s "));
            let text = format!(" {how_long}after {}", trigger.text);
            return Ok((text, Extent::After { trigger, for_ns, until_ns: None }));
        }
        if for_s.is_some() {
            return Err(Reason::wrong("give for_s with after"));
        }
        let (from_s, end_s) = (from_s.unwrap_or(0.0), to_s.unwrap_or(f64::INFINITY));
        if !(from_s >= 0.0 && end_s > from_s) {
            let given = format!("from_s = {from_s}, to_s = {end_s}");
            return Err(Reason::wrong(format!("{given}: give a time from 0 s on, and a later end")));
        }
        let until = to_s.map_or_else(String::new, |to_s| format!(" to {to_s} s"));
        Ok((format!(" from {from_s} s{until}"), Extent::Motion { from_s, to_s: end_s }))
    }

    /// The finding with the part of the window that was judged, where the run ended before. `cut` is what it cuts else.
    pub(super) fn limit(&self, finding: Finding, cut: Option<String>) -> Finding {
        let (reached_s, last_ns) = self.reached;
        let part = match self.extent {
            Extent::Motion { to_s, .. } if to_s.is_finite() && reached_s < to_s => {
                Some(format!("judged to {reached_s:.3} s of {to_s} s"))
            }
            Extent::After { for_ns, until_ns: Some(until_ns), .. }
                if for_ns < u64::MAX && last_ns < until_ns =>
            {
                let [judged_s, whole_s] = [for_ns - (until_ns - last_ns).min(for_ns), for_ns]
                    .map(|ns| ns as f64 / SECOND_NS as f64);
                Some(format!("judged for {judged_s:.3} s of {whole_s} s"))
            }
            _ => None,
        };
        finding.with_cut(part.or(cut), self.is_whole)
    }

    /// Whether the sample belongs to the window. Every sample of the run must be given, in the order of time.
    pub(super) fn contains(&mut self, moment: &Moment<'_>) -> bool {
        if !moment.is_closing {
            self.reached = (moment.motion_s.unwrap_or(0.0), moment.time_ns);
        }
        match &mut self.extent {
            Extent::Always => true,
            Extent::While(condition) => condition.holds(moment.values),
            Extent::Motion { from_s, to_s } => {
                moment.motion_s.is_some_and(|motion_s| *from_s <= motion_s && motion_s <= *to_s)
            }
            Extent::After { trigger, for_ns, until_ns } => {
                if let Some(began_ns) = trigger.times_ns(moment).last() {
                    *until_ns = Some(began_ns.saturating_add(*for_ns));
                }
                until_ns.is_some_and(|until_ns| moment.time_ns <= until_ns)
            }
        }
    }
}
