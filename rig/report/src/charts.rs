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

/// The latest wake-ups over time; none under virtual time, where no wake-up is late.
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

/// Plots, each with its id in the page.
type Plots<const N: usize> = [(&'static str, Option<Drawn>); N];

/// The platform's displacement, desired and actual, and the distance between the two.
pub(super) fn motion(figures: &Figures) -> Plots<2> {
    let track = &figures.track;
    let actual = figures.tracking.actual_source.adjective();
    // Every chart has the time of the recording.
    let began_s = track.began_ns.saturating_sub(figures.over_time.began_ns) as f64 / 1e9;
    let in_run = |curve: &Curve| -> Curve {
        in_unit(curve, 1e3).into_iter().map(|(at_s, value)| (at_s + began_s, value)).collect()
    };
    let pair = |(axis, name): (usize, &str)| {
        [("desired", &track.desired_m), (actual, &track.actual_m)]
            .map(|(kind, curves)| Line::new(&format!("{name} {kind}"), in_run(&curves[axis])))
    };
    let lines = ["x", "y", "z"].into_iter().enumerate().flat_map(pair).collect();
    let distance = Line::new("distance", in_run(&track.distance_m));
    [
        ("motion", chart_over_time(linear("displacement of the platform, mm"), lines, Vec::new())),
        ("error", chart_over_time(linear("distance from desired, mm"), vec![distance], Vec::new())),
    ]
}

/// Positions of slides and legs, velocities and forces, against their limits.
pub(super) fn actuators(scenario: &Scenario, figures: &Figures) -> Plots<4> {
    let over_time = &figures.over_time;
    let strokes = &scenario.mechanism.strokes;
    let (slide, leg) = (&scenario.drives.slide, &scenario.drives.leg);
    let axes = |label: &str, bands: &[Curve], first: usize, unit: f64, limits: Vec<Limit>| {
        let line = |(axis, band)| Line::new(AXIS_NAMES[first + axis], in_unit(band, unit));
        chart_over_time(linear(label), bands.iter().enumerate().map(line).collect(), limits)
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
