//! The cases of the matrix of faults: a fault of each kind, at each axis, in each phase of the motion, with a size that a
//! real one may have. [`masseter_campaign`] shows what each of them came to.

use masseter_campaign::{Coverage, FaultRow};
use masseter_judge::EventRecord;
use masseter_model::geometry::{AXIS_NAMES, Vec3};
use masseter_runtime::messages::codes::{Cause, EventKind};
use masseter_scenario::{ChecksConfig, DriveFault, FaultConfig, FaultKindConfig, Quantity};
use rayon::prelude::*;

use crate::prelude::*;
use crate::run::runner::{Judged, Runner, Source};

/// How long a fault acts that does not last, s.
const FOR_S: f64 = 0.5;
/// A fault that ends so soon after its strike is a single blow, ns.
const AT_ONCE_NS: u64 = 1_000_000;
/// Where the search for phases begins and ends: the motion has its speed by then, s.
const SEARCHED_S: [f64; 2] = [1.5, 3.5];
/// Distance of two looks, s.
const STEP_S: f64 = 0.01;

/// Plays the cases under virtual time on all cores.
pub(crate) fn play(base: &Scenario, cases: Vec<Case>, runner: &Runner) -> Result<Vec<FaultRow>, Failure> {
    let row = |case: Case| -> Result<FaultRow, Failure> {
        let scenario = scenario_of(base, &case);
        Ok(row_of(case, &runner.play(Source::Scenario(&scenario))?, &scenario.checks))
    };
    cases.into_par_iter().map(row).collect()
}

/// A fault to be played.
#[derive(Debug, Clone)]
pub(crate) struct Case {
    fault: FaultConfig,
    /// The axis concerned, directly or through its node.
    axis: Option<usize>,
    phase: &'static str,
}

/// Every case of a plan, of kinds with this text in their names. Faults of processes are left out: they exist only
/// with processes.
pub(crate) fn cases(plan: &RunPlan, filter: Option<&str>) -> Vec<Case> {
    let phases = phases(plan);
    let kinds = FaultKindConfig::ALL
        .iter()
        .filter(|kind| !kind.is_of_process() && filter.is_none_or(|text| kind.name().contains(text)));
    kinds.flat_map(|kind| of_kind(*kind, &plan.scenario, &phases)).collect()
}

fn of_kind(kind: FaultKindConfig, scenario: &Scenario, phases: &[Phase]) -> Vec<Case> {
    let has_axis = ["axis", "node"].iter().any(|key| kind.takes(key));
    let axes: Vec<_> = if has_axis { (0..AXIS_NAMES.len()).map(Some).collect() } else { vec![None] };
    // Only at the beginning of the run is a drive enabled.
    let boot = [Phase { name: "enabling", at_s: 0.0 }];
    let phases = if kind == DriveFault::SlowEnable.into() { &boot } else { phases };
    let case =
        |axis, phase: &Phase| Case { fault: fault(kind, axis, scenario, phase), axis, phase: phase.name };
    axes.iter().flat_map(|axis| phases.iter().map(|phase| case(*axis, phase))).collect()
}

fn fault(kind: FaultKindConfig, axis: Option<usize>, scenario: &Scenario, phase: &Phase) -> FaultConfig {
    let is_at_boot = kind == DriveFault::SlowEnable.into();
    let axis_if = |key| axis.filter(|_| kind.takes(key));
    let bus_of = |axis| scenario.can.buses.iter().position(|axes| axes.contains(&axis));
    let example = kind.declared().size.map(|size| size.example);
    FaultConfig {
        at_s: (!is_at_boot).then_some(phase.at_s),
        from_s: is_at_boot.then_some(0.0),
        for_s: (!is_at_boot).then_some(FOR_S),
        bus: axis_if("bus").and_then(bus_of),
        node: axis_if("node").map(|axis| scenario.can.node_ids[axis]),
        axis: axis_if("axis").map(|axis| AXIS_NAMES[axis].to_owned()),
        size: example.map(|text| text.parse::<Quantity>().expect("the examples are quantities")),
        ..FaultConfig::new(kind)
    }
}

/// The scenario of a case: long enough for the fault and what it leads to.
fn scenario_of(base: &Scenario, case: &Case) -> Scenario {
    let end_s = case.fault.at_s.unwrap_or(1.0) + FOR_S + 1.0;
    Scenario { duration_s: Some(end_s), faults: vec![case.fault.clone()], ..base.clone() }
}

/// A phase: its name and an instant of the motion in its middle, s.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Phase {
    name: &'static str,
    at_s: f64,
}

/// The instants at which the incisal point opens fastest, closes fastest, and rests longest.
fn phases(plan: &RunPlan) -> [Phase; 3] {
    let incisal = Vec3::from(plan.scenario.jaw.reference_point_m);
    let height_m = |at_s: f64| {
        let pose = plan.trajectory.pose(at_s);
        (pose.translation.vector + pose.rotation * incisal).z
    };
    let looks = ((SEARCHED_S[1] - SEARCHED_S[0]) / STEP_S) as usize;
    let speeds: Vec<_> = (0..looks)
        .map(|look| SEARCHED_S[0] + look as f64 * STEP_S)
        .map(|at_s| (at_s, (height_m(at_s + STEP_S) - height_m(at_s)) / STEP_S))
        .collect();
    let extreme = |by: fn(f64) -> f64| {
        speeds
            .iter()
            .min_by(|(_, a), (_, b)| by(*a).total_cmp(&by(*b)))
            .map_or(SEARCHED_S[0], |(at_s, _)| *at_s)
    };
    [
        Phase { name: "opening", at_s: extreme(|speed| speed) },
        Phase { name: "closing", at_s: extreme(|speed| -speed) },
        Phase { name: "rest", at_s: extreme(f64::abs) },
    ]
}

/// The first report while the fault acts. A drive's emergency is one too, although it stops nothing by itself. The jump as a fault
/// ends detects nothing; a fault that ends as it strikes, such as a single bus-off, acts by what follows.
fn detection(events: &[EventRecord], struck_ns: u64) -> Option<&EventRecord> {
    let is_end =
        |event: &&EventRecord| event.cause == Cause::FaultEnded && event.time_ns > struck_ns + AT_ONCE_NS;
    let ended_ns = events.iter().find(is_end).map_or(u64::MAX, |event| event.time_ns);
    let mut during = events.iter().filter(|event| (struck_ns..ended_ns).contains(&event.time_ns));
    during.find(|event| event.kind == EventKind::Fault)
}

/// What the fault of a case came to.
fn row_of(
    Case { fault, axis, phase }: Case,
    Judged { verdict, figures }: &Judged,
    limits: &ChecksConfig,
) -> FaultRow {
    let found = &figures.faults[0];
    let detection =
        found.struck_ns.and_then(|struck_ns| Some((struck_ns, detection(&figures.events, struck_ns)?)));
    // The negation also counts NaN.
    let is_beyond =
        !(found.deviation_mm <= limits.tracking_max_mm && found.deviation_deg <= limits.tracking_max_deg);
    let coverage = match (found.struck_ns, detection, is_beyond) {
        (None, ..) => Coverage::Idle,
        (_, None, false) => Coverage::Harmless,
        (_, None, true) => Coverage::Undetected,
        (_, Some(_), false) => Coverage::Detected,
        (_, Some(_), true) => Coverage::Late,
    };
    FaultRow {
        fault,
        axis: axis.map_or("", |axis| AXIS_NAMES[axis]),
        phase,
        coverage,
        detection: detection.map(|(_, event)| (event.source.to_string(), event.cause.to_string())),
        latency_ms: detection.map(|(struck_ns, event)| (event.time_ns - struck_ns) as f64 / 1e6),
        deviation_mm: found.deviation_mm,
        deviation_deg: found.deviation_deg,
        end_state: figures.final_state.map(|state| state.to_string()).unwrap_or_default(),
        verdict: verdict.word,
    }
}

#[cfg(test)]
mod tests {
    use masseter_runtime::messages::Event;
    use masseter_runtime::messages::codes::Source;

    use super::*;

    #[test]
    fn a_report_while_the_fault_acts_detects_it_and_one_at_its_end_does_not() {
        let event = |cause, kind, time_ns| {
            EventRecord::from(&Event { time_ns, ..Event::new(Source::Master, kind, cause) })
        };
        let ended = |time_ns| event(Cause::FaultEnded, EventKind::Notice, time_ns);
        let report = |time_ns| event(Cause::ProcessDataLost, EventKind::Fault, time_ns);
        let found = |events: &[EventRecord]| detection(events, 2_000_000_000).map(|event| event.time_ns);
        assert_eq!(found(&[report(2_003_000_000), ended(2_500_000_000)]), Some(2_003_000_000));
        assert_eq!(found(&[ended(2_500_000_000), report(2_500_478_000)]), None);
        assert_eq!(found(&[report(1_900_000_000), ended(2_500_000_000)]), None);
        let bus_off = [ended(2_000_000_000), report(2_003_489_000)];
        assert_eq!(found(&bus_off), Some(2_003_489_000), "a single bus-off ends as it strikes");
    }

    #[test]
    fn every_case_is_a_valid_scenario() {
        let plan = RunPlan::new(Scenario::default()).unwrap();
        let cases = cases(&plan, None);
        let kinds: std::collections::BTreeSet<_> = cases.iter().map(|case| case.fault.kind).collect();
        let of_processes = FaultKindConfig::ALL.iter().filter(|kind| kind.is_of_process()).count();
        assert_eq!(kinds.len(), FaultKindConfig::ALL.len() - of_processes);
        for case in &cases {
            scenario_of(&plan.scenario, case).validate().unwrap_or_else(|error| panic!("{case:?}: {error}"));
        }
    }
}
