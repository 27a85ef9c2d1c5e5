//! The report's charts: which values they show, and beside which limits.

use masseter_controller::trajectory::closed_pose;
use masseter_shared::config::Scenario;
use masseter_shared::geometry::{AXIS_NAMES, LEGS, Mechanism, Vec3};
use masseter_shared::schedule::CycleSchedule;

use masseter_analysis::requirements::{RequirementFigures, RequirementPlot};
use masseter_analysis::{Curve, EventRecord, FaultFigures, Figures, IntervalFigures, SignalFigures};
use masseter_charts::{Axis, Drawn, Legend, Limit, Line, LineChart, Moment, Scale, palette};

/// Height of a chart over time, px.
const LOW: u32 = 260;
/// Height of a chart of many lines, px.
const HIGH: u32 = 420;

/// The least latency that a logarithmic axis shows, µs.
const LEAST_US: f64 = 0.01;

/// Percentiles of every interval, with the cycle's budgets.
pub(super) fn percentiles(scenario: &Scenario, figures: &Figures) -> Option<Drawn> {
    let measured = figures.intervals.iter().filter(|interval| interval.max_ns > Some(0));
    let line = |interval: &IntervalFigures| {
        let points = interval.curve.iter().map(|&(x, value)| (x, microseconds(value as f64)));
        Line::new(interval.name, points.collect())
    };
    LineChart {
        title: String::new(),
        x: Axis::fitted("percentile", Scale::Percentile),
        y: Axis::fitted("µs", Scale::Log),
        lines: measured.map(line).collect(),
        limits: budgets(scenario),
        moments: Vec::new(),
        legend: Legend::Beside,
    }
    .draw(HIGH)
}

/// What the time table leaves: the period, and from the controller's deadline to the latest command.
fn budgets(scenario: &Scenario) -> Vec<Limit> {
    let period_ns = scenario.period_ns();
    let mut budgets = vec![limit("budget: the period", &[period_ns as f64 / 1e3])];
    if let Ok(schedule) = CycleSchedule::new(scenario) {
        let controller_us = (schedule.command_by_ns - schedule.controller_at_ns) as f64 / 1e3;
        budgets.push(limit("budget: controller", &[controller_us]));
    }
    budgets
}

/// The latest wake-ups over time; none under virtual time, where no wake-up is late.
pub(super) fn jitter(scenario: &Scenario, figures: &Figures) -> Option<Drawn> {
    let over_time = &figures.over_time;
    let late = |name: &str, curve: &Curve| {
        Line::new(name, curve.iter().map(|&(at_s, late_ns)| (at_s, microseconds(late_ns))).collect())
    };
    let is_late = |curve: &Curve| curve.iter().any(|(_, late_ns)| *late_ns > 0.0);
    if !is_late(&over_time.controller_late_ns) && !is_late(&over_time.plant_late_ns) {
        return None;
    }
    let lines =
        vec![late("controller", &over_time.controller_late_ns), late("plant", &over_time.plant_late_ns)];
    let y = Axis::fitted("latest wake-up, µs", Scale::Log);
    chart_over_time(scenario, figures, y, lines, Vec::new())
}

fn microseconds(ns: f64) -> f64 {
    (ns / 1e3).max(LEAST_US)
}

/// Plots, each with its id in the page.
type Plots<const N: usize> = [(&'static str, Option<Drawn>); N];

/// Displacement of the incisal point from the closed jaw, desired and actual, and the distance between the two.
pub(super) fn motion(scenario: &Scenario, figures: &Figures) -> Plots<2> {
    let over_time = &figures.over_time;
    let distance = Line::new("distance", in_unit(&over_time.distance_m, 1e3));
    let chart = |label, lines| chart_over_time(scenario, figures, linear(label), lines, Vec::new());
    let displacement = closed_incisal_m(scenario).and_then(|closed_m| {
        let lines = |kind: &str, curves: &[Curve; 3]| {
            let names = ["x", "y", "z"].into_iter().zip([palette::BLUE, palette::VERMILION, palette::GREEN]);
            let line = |(((name, colour), curve), closed_m): (((&str, _), &Curve), &f64)| {
                let displacement = |&(at_s, place_m): &(f64, f64)| (at_s, (place_m - closed_m) * 1e3);
                Line::new(&format!("{name} {kind}"), curve.iter().map(displacement).collect())
                    .coloured(colour)
            };
            names.zip(curves).zip(&closed_m).map(line).collect::<Vec<_>>()
        };
        let desired = lines("desired", &over_time.desired_incisal_m).into_iter().map(Line::wide);
        let actual = lines(figures.tracking.actual_source.adjective(), &over_time.actual_incisal_m);
        chart("incisal point from closed, mm", desired.chain(actual).collect())
    });
    [("motion", displacement), ("error", chart("incisal point from desired, mm", vec![distance]))]
}

/// Place of the incisal point when the jaw is closed, base frame; none for a scenario without a closed pose, which no run
/// has.
fn closed_incisal_m(scenario: &Scenario) -> Option<[f64; 3]> {
    let mechanism = Mechanism::new(&scenario.mechanism).ok()?;
    let closed = closed_pose(&scenario.jaw, &mechanism).ok()?;
    let incisal = Vec3::from(scenario.jaw.reference_point_m);
    Some((closed.translation.vector + closed.rotation * incisal).into())
}

/// The first strike of every fault, and the event that began the first safe stop.
fn moments(scenario: &Scenario, figures: &Figures) -> Vec<Moment> {
    let strike = |fault: &FaultFigures| {
        let declared = scenario.faults.get(fault.number - 1)?;
        Some(moment(figures, &format!("fault {}: {declared}", fault.number), fault.struck_ns?))
    };
    let stop = figures.events.iter().find(|event| event.begins_stop());
    let detection = |EventRecord { source, cause, time_ns, .. }: &EventRecord| {
        moment(figures, &format!("safe stop: {source}, {cause}"), *time_ns)
    };
    figures.faults.iter().filter_map(strike).chain(stop.map(detection)).collect()
}

fn moment(figures: &Figures, name: &str, time_ns: u64) -> Moment {
    let at = time_ns.saturating_sub(figures.over_time.began_ns) as f64 / 1e9;
    Moment { name: format!("{name}, {at:.3} s"), at }
}

/// Positions of slides and legs, velocities and forces, against their limits.
pub(super) fn actuators(scenario: &Scenario, figures: &Figures) -> Plots<4> {
    let over_time = &figures.over_time;
    let strokes = &scenario.mechanism.strokes;
    let (slide, leg) = (&scenario.drives.slide, &scenario.drives.leg);
    let axes = |label: &str, bands: &[Curve], first: usize, unit: f64, limits: Vec<Limit>| {
        let line = |(axis, band)| Line::new(AXIS_NAMES[first + axis], in_unit(band, unit));
        let lines = bands.iter().enumerate().map(line).collect();
        chart_over_time(scenario, figures, linear(label), lines, limits)
    };
    let stroke = |[lowest, highest]: [f64; 2]| {
        vec![limit("lower end", &[lowest * 1e3]), limit("upper end", &[highest * 1e3])]
    };
    let both = |slide: f64, leg: f64| {
        vec![limit("limit of slides", &[slide, -slide]), limit("limit of legs", &[leg, -leg])]
    };
    let (slides_m, legs_m) = over_time.position_m.split_at(LEGS);
    let velocities = both(slide.max_velocity_m_s * 1e3, leg.max_velocity_m_s * 1e3);
    let forces = both(slide.max_force_n, leg.max_force_n);
    [
        ("slides", axes("slides, mm", slides_m, 0, 1e3, stroke(strokes.slide_m))),
        ("legs", axes("legs, mm", legs_m, LEGS, 1e3, stroke(strokes.leg_m))),
        ("velocities", axes("velocity, mm/s", &over_time.velocity_m_s, 0, 1e3, velocities)),
        ("forces", axes("force, N", &over_time.force_n, 0, 1.0, forces)),
    ]
}

/// The controller's signals, one chart for each unit, in the order of their declaration.
pub(super) fn signals(scenario: &Scenario, figures: &Figures) -> Vec<(String, Option<Drawn>)> {
    let mut charts: Vec<(&str, Vec<Line>)> = Vec::new();
    for (SignalFigures { signal, .. }, curve) in figures.signals.iter().zip(&figures.over_time.signals) {
        let line = Line::new(&signal.name, curve.clone());
        match charts.iter_mut().find(|(unit, _)| *unit == signal.unit) {
            Some((_, lines)) => lines.push(line),
            None => charts.push((&signal.unit, vec![line])),
        }
    }
    let drawn = |(number, (unit, lines)): (usize, (&str, Vec<Line>))| {
        // A chart of one line has no legend.
        let name = if let [only] = &lines[..] { &*only.name } else { "signals" };
        let label = if unit.is_empty() { name.to_owned() } else { format!("{name}, {unit}") };
        (format!("signals-{number}"), chart_over_time(scenario, figures, linear(&label), lines, Vec::new()))
    };
    charts.into_iter().enumerate().map(drawn).collect()
}

/// The signal of a requirement, its limits, and the moment of the smallest margin; none without a signal.
pub(super) fn requirement(scenario: &Scenario, figures: &Figures, of: &RequirementFigures) -> Option<Drawn> {
    let RequirementPlot { signal, unit, began_ns, curve, limits } = of.plot.as_ref()?;
    let shift_s = (*began_ns as f64 - figures.over_time.began_ns as f64) / 1e9;
    let line = Line::new(signal, curve.iter().map(|&(at_s, value)| (at_s + shift_s, value)).collect());
    let y = linear(&if unit.is_empty() { signal.clone() } else { format!("{signal}, {unit}") });
    let limits = if limits.is_empty() { Vec::new() } else { vec![limit("limit", limits)] };
    let mut chart = over_time(scenario, figures, y, vec![line], limits);
    chart.moments.extend(of.worst_ns.map(|ns| moment(figures, "smallest margin", ns)));
    chart.draw(LOW)
}

/// Share of each bus in use.
pub(super) fn bus_load(scenario: &Scenario, figures: &Figures) -> Option<Drawn> {
    let loads = figures.over_time.bus_load.iter().enumerate();
    let line = |(bus, load): (usize, &Curve)| Line::new(&format!("can{bus}"), in_unit(load, 100.0));
    let full = vec![limit("full", &[100.0])];
    chart_over_time(scenario, figures, linear("bus load, %"), loads.map(line).collect(), full)
}

/// A chart over the whole run, with its moments.
fn chart_over_time(
    scenario: &Scenario,
    figures: &Figures,
    y: Axis,
    lines: Vec<Line>,
    limits: Vec<Limit>,
) -> Option<Drawn> {
    over_time(scenario, figures, y, lines, limits).draw(LOW)
}

fn over_time(
    scenario: &Scenario,
    figures: &Figures,
    y: Axis,
    lines: Vec<Line>,
    limits: Vec<Limit>,
) -> LineChart {
    let x = Axis::new("time, s", Scale::Linear, [0.0, figures.over_time.duration_s]);
    let moments = moments(scenario, figures);
    LineChart { title: String::new(), x, y, lines, limits, moments, legend: Legend::Beside }
}

fn linear(label: &str) -> Axis {
    Axis::fitted(label, Scale::Linear)
}

fn limit(name: &str, values: &[f64]) -> Limit {
    Limit { name: name.to_owned(), values: values.to_vec() }
}

fn in_unit(curve: &Curve, unit: f64) -> Vec<(f64, f64)> {
    curve.iter().map(|&(at_s, value)| (at_s, value * unit)).collect()
}
