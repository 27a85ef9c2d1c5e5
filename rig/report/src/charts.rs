//! The report's charts: which values they show, and beside which limits.

use masseter_shared::config::Scenario;
use masseter_shared::geometry::{AXIS_NAMES, LEGS};
use masseter_shared::schedule::CycleSchedule;

use masseter_analysis::{Curve, Figures, IntervalFigures};
use masseter_charts::{Axis, Drawn, Legend, Limit, Line, LineChart, Scale};

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
        legend: Legend::Beside,
    }
    .draw(HIGH)
}

/// What the time table leaves: the period, and from the controller's deadline to the latest command.
fn budgets(scenario: &Scenario) -> Vec<Limit> {
    let period_ns = scenario.period_ns();
    let mut budgets = vec![limit("budget: the period", &[period_ns as f64 / 1e3])];
    if let Ok(schedule) = CycleSchedule::new(&scenario.can, period_ns) {
        let controller_us = (schedule.command_by_ns - schedule.controller_at_ns) as f64 / 1e3;
        budgets.push(limit("budget: controller", &[controller_us]));
    }
    budgets
}

/// The latest wake-ups over time; none under virtual time, where nobody is late.
pub(super) fn jitter(figures: &Figures) -> Option<Drawn> {
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
    chart_over_time(Axis::fitted("latest wake-up, µs", Scale::Log), lines, Vec::new())
}

fn microseconds(ns: f64) -> f64 {
    (ns / 1e3).max(LEAST_US)
}

/// The platform's displacement, wanted and true, and the distance between the two.
pub(super) fn motion(figures: &Figures) -> [Option<Drawn>; 2] {
    let track = &figures.track;
    let actual = figures.tracking.actual_source.adjective();
    let pair = |(axis, name): (usize, &str)| {
        [("wanted", &track.desired_m), (actual, &track.actual_m)]
            .map(|(kind, curves)| Line::new(&format!("{name} {kind}"), in_unit(&curves[axis], 1e3)))
    };
    let lines = ["x", "y", "z"].into_iter().enumerate().flat_map(pair).collect();
    let distance = Line::new("distance", in_unit(&track.distance_m, 1e3));
    [
        chart_over_time(linear("displacement of the platform, mm"), lines, Vec::new()),
        chart_over_time(linear("distance from wanted, mm"), vec![distance], Vec::new()),
    ]
}

/// Positions of slides and legs, velocities and forces, against their limits.
pub(super) fn actuators(scenario: &Scenario, figures: &Figures) -> [Option<Drawn>; 4] {
    let over_time = &figures.over_time;
    let strokes = &scenario.mechanism.strokes;
    let drives = &scenario.drives;
    let slides = 0..LEGS;
    let legs = LEGS..2 * LEGS;
    let stroke = |[lowest, highest]: [f64; 2]| {
        vec![limit("lower end", &[lowest * 1e3]), limit("upper end", &[highest * 1e3])]
    };
    let both = |unit: f64, slide: f64, leg: f64| {
        let ways = |value: f64| [value * unit, -value * unit];
        vec![limit("limit of slides", &ways(slide)), limit("limit of legs", &ways(leg))]
    };
    [
        axes("slides, mm", &over_time.position_m, slides, 1e3, stroke(strokes.slide_m)),
        axes("legs, mm", &over_time.position_m, legs, 1e3, stroke(strokes.leg_m)),
        axes(
            "velocity, mm/s",
            &over_time.velocity_m_s,
            0..2 * LEGS,
            1e3,
            both(1e3, drives.slide.max_velocity_m_s, drives.leg.max_velocity_m_s),
        ),
        axes(
            "force, N",
            &over_time.force_n,
            0..2 * LEGS,
            1.0,
            both(1.0, drives.slide.max_force_n, drives.leg.max_force_n),
        ),
    ]
}

fn axes(
    label: &str,
    bands: &[Curve],
    of: std::ops::Range<usize>,
    unit: f64,
    limits: Vec<Limit>,
) -> Option<Drawn> {
    let line = |axis: usize| Line::new(AXIS_NAMES[axis], in_unit(&bands[axis], unit));
    chart_over_time(linear(label), of.map(line).collect(), limits)
}

/// Share of each bus in use.
pub(super) fn bus_load(figures: &Figures) -> Option<Drawn> {
    let loads = figures.over_time.bus_load.iter().enumerate();
    let line = |(bus, load): (usize, &Curve)| Line::new(&format!("can{bus}"), in_unit(load, 100.0));
    chart_over_time(linear("bus load, %"), loads.map(line).collect(), vec![limit("full", &[100.0])])
}

fn chart_over_time(y: Axis, lines: Vec<Line>, limits: Vec<Limit>) -> Option<Drawn> {
    let x = Axis::fitted("time, s", Scale::Linear).including(0.0);
    LineChart { title: String::new(), x, y, lines, limits, legend: Legend::Beside }.draw(LOW)
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
