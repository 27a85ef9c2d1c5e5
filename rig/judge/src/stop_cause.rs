//! What explains a stop: the first report of it, and the fault or stimulus of the scenario that came before.
//!
//! What was reported long before the stop, and an emergency without an error, stopped nothing and explains nothing. Of several
//! entries the likeliest is named: one that began just before the report comes before older ones, then one that acts where the
//! report is.

use masseter_model::geometry::AXIS_NAMES;
use masseter_recording::Manifest;
use masseter_runtime::injection::Injected;
use masseter_runtime::messages::codes::Cause;
use masseter_scenario::Scenario;

use crate::declared_faults::FaultFigures;
use crate::events::{AFTERMATH_NS, EventRecord};
use crate::figures::Figures;

/// What began so shortly before a report comes before what has acted for longer, ns.
const FRESH_NS: u64 = 100_000_000;

/// A fault or stimulus of the scenario that explains a stop.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct DeclaredCause {
    pub(crate) injected: Injected,
    pub(crate) struck_ns: u64,
}

/// How well the place of an entry fits that of the report.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Place {
    /// The entry acts on another axis, or on another bus.
    Elsewhere,
    /// Entry or report have no axis, or the entry acts on the bus of the axis.
    Anywhere,
    SameAxis,
}

/// The likeliest entry of the scenario that acted before the first report; none without one.
pub(crate) fn declared_cause(manifest: &Manifest, figures: &Figures) -> Option<DeclaredCause> {
    let report = figures.first_fault();
    let stopped_ns = stopped_ns(figures);
    let likelihood = |cause: &DeclaredCause| {
        let place = place(&manifest.scenario, cause.injected, report);
        let is_fresh = cause.struck_ns.saturating_add(FRESH_NS) >= stopped_ns;
        (is_fresh && place != Place::Elsewhere, place, cause.struck_ns)
    };
    // A stop that the scenario asks for explains no other one.
    let is_stop = |cause: &DeclaredCause| match cause.injected {
        Injected::Stimulus(place) => manifest.scenario.stimulus.get(place).is_some_and(|found| found.stop),
        Injected::Fault(_) => false,
    };
    faults(figures)
        .chain(stimuli(manifest, figures))
        .filter(|cause| !is_stop(cause) && cause.acted_before(stopped_ns, figures))
        .max_by_key(likelihood)
}

/// Whether a fault of the scenario acted before the first report.
pub(crate) fn has_declared_fault(figures: &Figures) -> bool {
    let stopped_ns = stopped_ns(figures);
    faults(figures).any(|cause| cause.acted_before(stopped_ns, figures))
}

/// When the stop was reported, or else began.
fn stopped_ns(figures: &Figures) -> u64 {
    let reported_ns = figures.first_fault().map(|event| event.time_ns);
    reported_ns.or(figures.last_act_ns()).unwrap_or(u64::MAX)
}

/// Whether a fault or stimulus of the scenario acted at that time, or had ended shortly before.
pub(crate) fn acted_before(manifest: &Manifest, figures: &Figures, time_ns: u64) -> bool {
    faults(figures).chain(stimuli(manifest, figures)).any(|cause| cause.acted_before(time_ns, figures))
}

fn faults(figures: &Figures) -> impl Iterator<Item = DeclaredCause> {
    figures.faults.iter().filter_map(of_fault)
}

fn of_fault(fault: &FaultFigures) -> Option<DeclaredCause> {
    let injected = Injected::Fault(fault.number.checked_sub(1)?);
    Some(DeclaredCause { injected, struck_ns: fault.struck_ns? })
}

/// No stimulus makes a program fail.
fn stimuli(manifest: &Manifest, figures: &Figures) -> impl Iterator<Item = DeclaredCause> {
    let began = figures.events.iter().filter(|event| event.cause == Cause::StimulusBegan);
    let is_cause = !is_of_program_alone(manifest, figures.first_fault());
    began.filter(move |_| is_cause).filter_map(|event| {
        let place = (event.value as usize).checked_sub(1)?;
        Some(DeclaredCause { injected: Injected::Stimulus(place), struck_ns: event.time_ns })
    })
}

/// Whether a program's own law or messages are what is reported.
fn is_of_program_alone(manifest: &Manifest, report: Option<&EventRecord>) -> bool {
    use Cause::{BadMessage, ForeignCommand, LawFailed};
    let causes = [LawFailed, BadMessage, ForeignCommand];
    manifest.is_of_program() && report.is_some_and(|event| causes.iter().any(|cause| event.cause == *cause))
}

impl DeclaredCause {
    /// Whether it began before that time, and had not ended long before.
    fn acted_before(&self, time_ns: u64, figures: &Figures) -> bool {
        let (end, place) = match self.injected {
            Injected::Fault(place) => (Cause::FaultEnded, place),
            Injected::Stimulus(place) => (Cause::StimulusEnded, place),
        };
        let is_end = |event: &&EventRecord| event.cause == end && event.value as usize == place + 1;
        let ended_ns = figures.events.iter().filter(is_end).map(|event| event.time_ns).next_back();
        self.struck_ns <= time_ns
            && ended_ns.is_none_or(|ended_ns| time_ns <= ended_ns.saturating_add(AFTERMATH_NS))
    }
}

fn place(scenario: &Scenario, injected: Injected, report: Option<&EventRecord>) -> Place {
    let fault = match injected {
        Injected::Fault(place) => scenario.faults.get(place),
        Injected::Stimulus(_) => None,
    };
    let Some((fault, axis)) = fault.zip(report.and_then(|event| event.axis)) else { return Place::Anywhere };
    match (&fault.axis, fault.bus) {
        (Some(of), _) if of == axis => Place::SameAxis,
        (Some(_), _) => Place::Elsewhere,
        (None, Some(bus)) if !carries(scenario, bus, axis) => Place::Elsewhere,
        (None, _) => Place::Anywhere,
    }
}

fn carries(scenario: &Scenario, bus: usize, axis: &str) -> bool {
    let axes = scenario.can.buses.get(bus).into_iter().flatten();
    axes.filter_map(|&place| AXIS_NAMES.get(place)).any(|name| *name == axis)
}

#[cfg(test)]
mod tests;
