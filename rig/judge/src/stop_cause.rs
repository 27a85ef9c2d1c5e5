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

use crate::breach::Breach;
use crate::declared_faults::FaultFigures;
use crate::events::{AFTERMATH_NS, EventRecord};
use crate::figures::Figures;

/// What began so short before a report comes before what has acted for longer, ns.
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
    let reported_ns = report.map_or(u64::MAX, |event| event.time_ns);
    let is_fresh = |cause: &DeclaredCause| cause.struck_ns.saturating_add(FRESH_NS) >= reported_ns;
    faults(figures)
        .chain(stimuli(manifest, figures))
        .filter(|cause| cause.acted_before(reported_ns, figures))
        .max_by_key(|cause| {
            (is_fresh(cause), place(&manifest.scenario, cause.injected, report), cause.struck_ns)
        })
}

/// Whether a fault of the scenario acted before the first report.
pub(crate) fn has_declared_fault(figures: &Figures) -> bool {
    let reported_ns = figures.first_fault().map_or(u64::MAX, |event| event.time_ns);
    faults(figures).any(|cause| cause.acted_before(reported_ns, figures))
}

/// The numbers of the faults that acted as the jaw left its path, or had ended shortly before; without such a time all faults.
pub(crate) fn suspects(figures: &Figures) -> Vec<usize> {
    let left_ns = figures.path_breach.first.as_ref().and_then(Breach::time_ns);
    let may_be = |fault: &&FaultFigures| {
        let acted = |left_ns| of_fault(fault).is_some_and(|cause| cause.acted_before(left_ns, figures));
        left_ns.is_none_or(acted)
    };
    figures.faults.iter().filter(may_be).map(|fault| fault.number).collect()
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

/// A stop that the scenario asks for is no cause of another one, and no stimulus makes a program fail.
fn stimuli(manifest: &Manifest, figures: &Figures) -> impl Iterator<Item = DeclaredCause> {
    let began = figures.events.iter().filter(|event| event.cause == Cause::StimulusBegan);
    let is_cause = !is_of_program_alone(manifest, figures.first_fault());
    began.filter(move |_| is_cause).filter_map(|event| {
        let place = (event.value as usize).checked_sub(1)?;
        let stimulus = manifest.scenario.stimulus.get(place)?;
        let cause = DeclaredCause { injected: Injected::Stimulus(place), struck_ns: event.time_ns };
        (!stimulus.stop).then_some(cause)
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
