//! Codes and events of messages, resolved. A recording of another version may hold codes that this program does not
//! have.

use std::fmt;

use masseter_model::geometry::AXIS_NAMES;
use masseter_runtime::messages::codes::{
    BootPhase, Cause, ControllerState, EventKind, Source, drive_state_name,
};
use masseter_runtime::messages::{Event, explain};
use masseter_runtime::named::Declared;
use masseter_scenario::{Dimension, Unit};
use serde::{Serialize, Serializer};

/// What ended earlier than this before a report, or was reported earlier than this before a stop, does not belong to it, ns.
pub(crate) const AFTERMATH_NS: u64 = 500_000_000;

/// The meaning of a code, or its number where the code has no meaning in this version.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Code<T> {
    /// The meaning.
    Known(T),
    /// The number.
    Unknown(u32),
}

impl<T: TryFrom<u32>> From<u32> for Code<T> {
    fn from(code: u32) -> Self {
        T::try_from(code).map_or(Self::Unknown(code), Self::Known)
    }
}

impl<T: PartialEq> PartialEq<T> for Code<T> {
    fn eq(&self, other: &T) -> bool {
        matches!(self, Self::Known(known) if known == other)
    }
}

impl<T: fmt::Display> fmt::Display for Code<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Known(known) => known.fmt(f),
            Self::Unknown(code) => write!(f, "code {code}"),
        }
    }
}

/// As its name.
impl<T: fmt::Display> Serialize for Code<T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

/// An event with its codes resolved.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EventRecord {
    /// When, ns of the run's clock.
    pub time_ns: u64,
    /// Cycle of the process that reported it.
    pub cycle: u64,
    /// Who reported it.
    pub source: Code<Source>,
    /// What it is.
    pub kind: Code<EventKind>,
    /// Why.
    pub cause: Code<Cause>,
    /// The axis concerned.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub axis: Option<&'static str>,
    /// State before and after.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub transition: Option<[String; 2]>,
    /// The defect, its place and the remedy, where figures alone do not show it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub text: Option<String>,
    /// The value that explains it; NaN without one.
    pub value: f64,
    /// The limit it is held against.
    pub limit: f64,
}

impl EventRecord {
    /// Whether it begins a safe stop. The master's faults all stop the drives; a drive's emergency alone stops nothing.
    pub fn begins_stop(&self) -> bool {
        self.enters(ControllerState::SafeStop) || self.is_fault_of_master()
    }

    /// Whether the controller enters that state.
    pub fn enters(&self, state: ControllerState) -> bool {
        let is_into = |[_, to]: &[String; 2]| to == state.name();
        self.source == Source::Controller && self.transition.as_ref().is_some_and(is_into)
    }

    pub(crate) fn is_fault_of_master(&self) -> bool {
        self.source == Source::Master && self.kind == EventKind::Fault
    }

    /// Whether it is the emergency message of a drive that has no error (error register 00h).
    pub fn is_without_error(&self) -> bool {
        self.source == Source::Drive && self.cause == Cause::Emergency && self.limit == 0.0
    }

    /// The event in words, without its time.
    pub fn in_words(&self) -> String {
        let Self { source, cause, .. } = self;
        if let Some(text) = &self.text {
            return format!("{source}: {cause} ({text})");
        }
        let axis = self.axis.map_or_else(String::new, |axis| format!(" {axis}"));
        let transition =
            self.transition.as_ref().map(|[from, to]| format!("{from} → {to}")).unwrap_or_default();
        let text = match cause {
            Code::Known(Cause::Sequence) => return format!("{source}{axis}: {transition}"),
            Code::Known(Cause::StopRequested) => format!("{source}{axis}: {cause} {transition}"),
            _ => {
                let [value, limit] = [self.value, self.limit].map(|number| self.unit().text(number));
                format!("{source}{axis}: {cause} (value {value}, limit {limit}) {transition}")
            }
        };
        text.trim_end().to_owned()
    }

    /// Whether the controller stops the rig because the jaw left its path.
    pub(crate) fn stops_off_path(&self) -> bool {
        let is_off_path = matches!(self.cause, Code::Known(Cause::TrackingLost | Cause::OrientationLost));
        is_off_path && self.enters(ControllerState::SafeStop)
    }

    /// In which value and limit are shown. Cycles and times of the bus are numbers as they are.
    fn unit(&self) -> Unit {
        use Cause::{
            AccelerationLimit, EndStopHit, FollowingError, OrientationLost, StartTooFar, StrokeLimit,
            TrackingLost, VelocityLimit,
        };
        let name = match self.cause {
            Code::Known(StrokeLimit | FollowingError | TrackingLost | StartTooFar) => "mm",
            Code::Known(VelocityLimit | EndStopHit) => "mm/s",
            Code::Known(AccelerationLimit) => "m/s2",
            Code::Known(OrientationLost) => "deg",
            _ => "",
        };
        Unit::named(name).unwrap_or(Dimension::One.si_unit())
    }

    /// The same, of a run on these interfaces whose controller declared these parameters.
    pub(crate) fn of_run(event: &Event, declared: &Declared, interfaces: &[String]) -> Self {
        let text = of_force_control(event, declared).or_else(|| explain(event, interfaces));
        let text = text.or_else(|| change(event, declared));
        Self { text, ..event.into() }
    }
}

impl From<&Event> for EventRecord {
    fn from(event: &Event) -> Self {
        let source = Code::from(event.source);
        let state = |code: u32| match source {
            Code::Known(Source::Controller) => Code::<ControllerState>::from(code).to_string(),
            Code::Known(Source::Master) => Code::<BootPhase>::from(code).to_string(),
            _ => drive_state_name(code)
                .map_or_else(|unknown| format!("code {}", unknown.number), str::to_owned),
        };
        let moved = event.from != event.to;
        Self {
            time_ns: event.time_ns,
            cycle: event.cycle,
            source,
            kind: event.kind.into(),
            cause: event.cause.into(),
            axis: AXIS_NAMES.get(event.axis as usize).copied(),
            transition: moved.then(|| [state(event.from), state(event.to)]),
            text: explain(event, &[]),
            value: event.value,
            limit: event.limit,
        }
    }
}

/// The first heard fault that belongs to the stop. `quiet_stop_ns`: when a program stopped without an event.
pub(crate) fn first_report(
    events: &[EventRecord],
    quiet_stop_ns: Option<u64>,
    is_heard: impl Fn(&EventRecord) -> bool,
) -> Option<&EventRecord> {
    let stops = events.iter().filter(|event| event.begins_stop());
    let stopped_ns = stops.map(|event| event.time_ns).min().or(quiet_stop_ns);
    let since_ns = stopped_ns.map_or(0, |ns| ns.saturating_sub(AFTERMATH_NS));
    let belongs = |event: &&EventRecord| {
        event.kind == EventKind::Fault && event.time_ns >= since_ns && !event.is_without_error()
    };
    events.iter().filter(belongs).find(|event| is_heard(event))
}

/// The sentence for the rig's own control of the bite force, which gives up in two cases alone.
fn of_force_control(event: &Event, declared: &Declared) -> Option<String> {
    let has_failed = event.cause == Cause::LawFailed.code() && event.value == 0.0 && event.limit == 0.0;
    let is_own = has_failed && declared.signals.iter().any(|signal| signal.name == "force_phase");
    let why = "the bite: food keeps the mouth further open than force_control.reach_m, or the load cell is at an end of its range";
    is_own.then(|| why.to_owned())
}

/// The sentence for a parameter that was set.
fn change(event: &Event, declared: &Declared) -> Option<String> {
    let is_set = event.cause == Cause::ParameterSet.code();
    let parameter = declared.parameters.get(event.object as usize).filter(|_| is_set)?;
    let text =
        format!("{} was set from {} to {} {}", parameter.name, event.limit, event.value, parameter.unit);
    Some(text.trim_end().to_owned())
}

#[cfg(test)]
mod tests {
    use masseter_runtime::messages::codes::EventKind;

    use super::*;

    #[test]
    fn the_rigs_own_force_control_says_why_it_gives_up_and_a_users_law_is_asked() {
        let failed = Event::new(Source::Controller, EventKind::Fault, Cause::LawFailed);
        let failed = Event { value: 0.0, limit: 0.0, ..failed };
        let words = |declared: &Declared| EventRecord::of_run(&failed, declared, &[]).in_words();
        assert!(words(&Declared::default()).contains("see the message of your controller"));
        let (name, unit, about) = ("force_phase".to_owned(), String::new(), String::new());
        let signals = vec![masseter_runtime::named::Signal { name, unit, about }];
        let own = words(&Declared { signals, ..Declared::default() });
        assert!(own.contains("force_control.reach_m"), "{own}");
    }

    #[test]
    fn a_code_is_written_as_its_name_and_an_unknown_code_as_its_number() {
        let fault = Code::<EventKind>::from(EventKind::Fault.code());
        assert!(fault == EventKind::Fault && fault != EventKind::Transition);
        let stroke = Event {
            axis: 0,
            value: 0.000_100_633_137_3,
            limit: 1e-4,
            ..Event::new(Source::Master, EventKind::Fault, Cause::StrokeLimit)
        };
        let words = "master d1: stroke_limit (value 0.1006 mm, limit 0.1 mm)";
        assert_eq!(EventRecord { text: None, ..EventRecord::from(&stroke) }.in_words(), words);
        let unknown = Code::<EventKind>::from(4000);
        assert!(EventKind::ALL.iter().all(|kind| unknown != *kind));
        assert_eq!(serde_json::to_string(&[fault, unknown]).unwrap(), r#"["fault","code 4000"]"#);
    }
}
