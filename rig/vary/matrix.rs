//! The matrix of faults: a fault of each kind, at each axis, in each phase of the motion, with a size that a real one
//! may have. What does it do to the jaw, and who detects it? The answers as a table, as a picture and in words.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::fs;
use std::path::Path;

use anyhow::Context;
use masseter_model::geometry::{AXIS_NAMES, Vec3};
use masseter_plan::RunPlan;
use masseter_runtime::messages::codes::EventKind;
use masseter_scenario::{ChecksConfig, DriveFault, FaultConfig, FaultKindConfig, Quantity, Scenario};
use masseter_terminal::Failure;
use rayon::prelude::*;

use crate::run::runner::{Judged, Runner, Source};

/// How long a fault acts that does not last, s.
const FOR_S: f64 = 0.5;
/// Where the search for phases begins and ends: the motion has its speed by then, s.
const SEARCHED_S: [f64; 2] = [1.5, 3.5];
/// Distance of two looks, s.
const STEP_S: f64 = 0.01;
/// The first line of the CSV file.
const HEADER: &str = "kind,layer,axis,phase,size,struck,detected_by,cause,latency_ms,deviation_mm,deviation_deg,end_state,verdict\n";
/// Size of a cell, px.
const CELL: [usize; 2] = [46, 20];
/// Room for the names of the kinds, and for the two header lines, px.
const LEFT: usize = 170;
const TOP: usize = 56;

/// Plays the cases under virtual time on all cores.
pub(crate) fn play(base: &Scenario, cases: Vec<Case>, runner: Runner<'_>) -> Result<Vec<Row>, Failure> {
    let row = |case: Case| -> Result<Row, Failure> {
        let scenario = scenario_of(base, &case);
        Ok(Row::new(case, &runner.play(Source::Scenario(&scenario))?, &scenario.checks))
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
    cases_in(&plan.scenario, &phases(plan), filter)
}

fn cases_in(scenario: &Scenario, phases: &[Phase], filter: Option<&str>) -> Vec<Case> {
    let kinds = FaultKindConfig::ALL
        .iter()
        .filter(|kind| !kind.is_of_process() && filter.is_none_or(|text| kind.name().contains(text)));
    kinds.flat_map(|kind| of_kind(*kind, scenario, phases)).collect()
}

fn of_kind(kind: FaultKindConfig, scenario: &Scenario, phases: &[Phase]) -> Vec<Case> {
    let has_axis = ["axis", "node"].iter().any(|key| kind.takes(key));
    let axes: Vec<_> = if has_axis { (0..AXIS_NAMES.len()).map(Some).collect() } else { vec![None] };
    let case = |axis: Option<usize>, phase: &Phase| Case {
        fault: fault(kind, axis, scenario, phase),
        axis,
        phase: phase.name,
    };
    // Only at the beginning of the run is a drive enabled.
    let boot = Phase { name: "enabling", at_s: 0.0 };
    let phases = if kind == DriveFault::SlowEnable.into() { &[boot] } else { phases };
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

/// What a fault came to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Coverage {
    /// It never acted.
    Idle,
    /// Nobody detected it, and the jaw stayed within the limits.
    Harmless,
    /// It was detected before the jaw left the limits.
    Detected,
    /// It was detected too late.
    Late,
    /// Nobody detected it, and the jaw left the limits.
    Undetected,
}

impl Coverage {
    /// The word for it.
    fn word(self) -> &'static str {
        match self {
            Self::Idle => "never struck",
            Self::Harmless => "within the limits, undetected",
            Self::Detected => "detected in time",
            Self::Late => "detected too late",
            Self::Undetected => "beyond the limits, undetected",
        }
    }
}

/// A row.
#[derive(Debug, Clone)]
pub(crate) struct Row {
    case: Case,
    coverage: Coverage,
    /// Who detected it first, and as what.
    detection: Option<(String, String)>,
    latency_ms: Option<f64>,
    deviation_mm: f64,
    deviation_deg: f64,
    end_state: String,
    verdict: &'static str,
}

impl Row {
    /// Whether the jaw left the limits before anybody detected the fault.
    pub(crate) fn is_bad(&self) -> bool {
        matches!(self.coverage, Coverage::Undetected | Coverage::Late)
    }

    fn new(case: Case, Judged { verdict, figures }: &Judged, limits: &ChecksConfig) -> Self {
        let fault = &figures.faults[0];
        let struck_ns = fault.struck_ns;
        // A drive's emergency is a detection too, although it stops nothing by itself.
        let first = struck_ns.and_then(|struck_ns| {
            let events = figures.events.iter().filter(|event| event.time_ns >= struck_ns);
            events.into_iter().find(|event| event.kind == EventKind::Fault)
        });
        // The negation also counts what is no number.
        let is_beyond =
            !(fault.deviation_mm <= limits.tracking_max_mm && fault.deviation_deg <= limits.tracking_max_deg);
        let coverage = match (struck_ns, first, is_beyond) {
            (None, ..) => Coverage::Idle,
            (_, None, false) => Coverage::Harmless,
            (_, None, true) => Coverage::Undetected,
            (_, Some(_), false) => Coverage::Detected,
            (_, Some(_), true) => Coverage::Late,
        };
        Self {
            case,
            coverage,
            detection: first.map(|event| (event.source.to_string(), event.cause.to_string())),
            latency_ms: first
                .zip(struck_ns)
                .map(|(event, struck_ns)| (event.time_ns - struck_ns) as f64 / 1e6),
            deviation_mm: fault.deviation_mm,
            deviation_deg: fault.deviation_deg,
            end_state: figures.final_state.map(|state| state.to_string()).unwrap_or_default(),
            verdict: verdict.word,
        }
    }

    /// The axis by name; empty where the fault has none.
    fn axis(&self) -> &'static str {
        self.case.axis.map_or("", |axis| AXIS_NAMES[axis])
    }
}

/// Writes the table and the picture into a folder.
pub(crate) fn write(folder: &Path, rows: &[Row]) -> anyhow::Result<()> {
    let table = HEADER.to_owned() + &rows.iter().map(csv_line).collect::<String>();
    for (name, text) in [("matrix.csv", table), ("matrix.svg", svg(rows))] {
        let path = folder.join(name);
        fs::write(&path, text).with_context(|| format!("cannot write {}", path.display()))?;
    }
    Ok(())
}

/// How many cases came to what, and each that left the limits.
pub(crate) fn summary(folder: &Path, rows: &[Row]) -> String {
    let mut counts: BTreeMap<Coverage, usize> = BTreeMap::new();
    for row in rows {
        *counts.entry(row.coverage).or_default() += 1;
    }
    let counts = counts.iter().map(|(coverage, count)| format!("{count:>5}  {}\n", coverage.word()));
    let bad = rows.iter().filter(|row| row.is_bad()).map(|row| {
        let detection = row.detection.as_ref().map_or_else(
            || "nobody detected it".to_owned(),
            |(source, cause)| format!("detected by {source} as {cause}"),
        );
        format!(
            "  {} {} {}: {:.3} mm, {:.3}°, {detection}\n",
            row.case.fault,
            row.axis(),
            row.case.phase,
            row.deviation_mm,
            row.deviation_deg
        )
    });
    format!("{}{}\n{}\n", counts.collect::<String>(), bad.collect::<String>(), folder.display())
}

/// The line of the CSV file.
fn csv_line(row: &Row) -> String {
    let Case { fault, phase, .. } = &row.case;
    let (source, cause) = row.detection.clone().unwrap_or_else(|| ("nobody".to_owned(), String::new()));
    let size = fault.size.map(|size| size.to_string()).unwrap_or_default();
    let latency = row.latency_ms.map(|latency_ms| format!("{latency_ms:.3}")).unwrap_or_default();
    format!(
        "{},{},{},{phase},{size},{},{source},{cause},{latency},{:.4},{:.4},{},{}\n",
        fault.kind,
        fault.kind.declared().layer,
        row.axis(),
        row.coverage != Coverage::Idle,
        row.deviation_mm,
        row.deviation_deg,
        row.end_state,
        row.verdict
    )
}

/// The picture. Each cell has the initial of who detected the fault, and all figures as its title.
fn svg(rows: &[Row]) -> String {
    let mut kinds: Vec<_> = rows.iter().map(|row| row.case.fault.kind).collect();
    kinds.dedup();
    let mut phases: Vec<_> = rows.iter().map(|row| row.case.phase).collect();
    phases.sort_by_key(|phase| rows.iter().position(|row| row.case.phase == *phase));
    phases.dedup();
    let columns: Vec<_> = std::iter::once("")
        .chain(AXIS_NAMES)
        .flat_map(|axis| phases.iter().map(move |phase| (axis, *phase)))
        .filter(|(axis, phase)| rows.iter().any(|row| row.axis() == *axis && row.case.phase == *phase))
        .collect();
    let (width, height) = (LEFT + columns.len() * CELL[0] + 10, TOP + kinds.len() * CELL[1] + 60);
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" width=\"{width}\" height=\"{height}\" \
         font-family=\"sans-serif\" font-size=\"11\">\n<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n"
    );
    for (place, (axis, phase)) in columns.iter().enumerate() {
        let x = LEFT + place * CELL[0] + CELL[0] / 2;
        let axis = if axis.is_empty() { "rig" } else { axis };
        let _ = writeln!(svg, "<text x=\"{x}\" y=\"20\" text-anchor=\"middle\">{axis}</text>");
        let _ =
            writeln!(svg, "<text x=\"{x}\" y=\"40\" text-anchor=\"middle\" font-size=\"9\">{phase}</text>");
    }
    for (place, kind) in kinds.iter().enumerate() {
        let y = TOP + place * CELL[1] + 14;
        let _ = writeln!(svg, "<text x=\"{}\" y=\"{y}\" text-anchor=\"end\">{kind}</text>", LEFT - 8);
    }
    for row in rows {
        let column = columns.iter().position(|(axis, phase)| row.axis() == *axis && row.case.phase == *phase);
        let line = kinds.iter().position(|kind| *kind == row.case.fault.kind);
        if let Some((column, line)) = column.zip(line) {
            svg += &cell(row, LEFT + column * CELL[0], TOP + line * CELL[1]);
        }
    }
    svg += &legend(TOP + kinds.len() * CELL[1] + 24);
    svg + "</svg>\n"
}

fn cell(row: &Row, x: usize, y: usize) -> String {
    let (source, cause) = row.detection.clone().unwrap_or_else(|| ("nobody".to_owned(), String::new()));
    let initial = match source.as_str() {
        "controller" => "C",
        "master" => "M",
        "drive" => "D",
        _ => "–",
    };
    let initial = if row.coverage == Coverage::Idle { "" } else { initial };
    let title = format!(
        "{} {}: {}, {source} {cause}, {:.3} mm, {:.3}°",
        row.case.fault,
        row.case.phase,
        row.coverage.word(),
        row.deviation_mm,
        row.deviation_deg
    );
    format!(
        "<g><title>{title}</title><rect x=\"{x}\" y=\"{y}\" width=\"{}\" height=\"{}\" fill=\"{}\"/>\
         <text x=\"{}\" y=\"{}\" text-anchor=\"middle\">{initial}</text></g>\n",
        CELL[0] - 2,
        CELL[1] - 2,
        colour(row.coverage),
        x + CELL[0] / 2 - 1,
        y + 13
    )
}

/// Colours that colour-blind readers can tell apart: Okabe and Ito, lightened.
fn colour(coverage: Coverage) -> &'static str {
    match coverage {
        Coverage::Idle => "#ffffff",
        Coverage::Harmless => "#e5e5e5",
        Coverage::Detected => "#9ad1f0",
        Coverage::Late => "#f5c26b",
        Coverage::Undetected => "#e8825a",
    }
}

fn legend(y: usize) -> String {
    let entries =
        [Coverage::Detected, Coverage::Harmless, Coverage::Late, Coverage::Undetected, Coverage::Idle];
    let entries = entries.iter().enumerate().map(|(place, coverage)| {
        let x = 20 + place * 190;
        format!(
            "<rect x=\"{x}\" y=\"{}\" width=\"14\" height=\"14\" fill=\"{}\" stroke=\"#999\"/>\
             <text x=\"{}\" y=\"{y}\">{}</text>\n",
            y - 11,
            colour(*coverage),
            x + 20,
            coverage.word()
        )
    });
    let key = "C controller, M master, D drive, – nobody: the first that reported a fault after the strike";
    let key = format!("<text x=\"20\" y=\"{}\">{key}</text>\n", y + 22);
    entries.collect::<String>() + &key
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_case_is_a_valid_scenario() {
        let base = Scenario::default();
        let phases = [Phase { name: "opening", at_s: 1.6 }];
        let cases = cases_in(&base, &phases, None);
        let kinds: std::collections::BTreeSet<_> = cases.iter().map(|case| case.fault.kind).collect();
        let of_processes = FaultKindConfig::ALL.iter().filter(|kind| kind.is_of_process()).count();
        assert_eq!(kinds.len(), FaultKindConfig::ALL.len() - of_processes);
        for case in &cases {
            scenario_of(&base, case).validate().unwrap_or_else(|error| panic!("{case:?}: {error}"));
        }
    }
}
