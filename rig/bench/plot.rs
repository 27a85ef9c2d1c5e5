//! Durations over percentiles, all candidates of a comparison in one chart.

use masseter_charts::{Axis, Legend, Line, LineChart, Scale};

use super::candidate::{Candidate, no_durations};
use super::comparison::Comparison;

const HEIGHT: u32 = 420;
/// Points of a line for each nine of the percentile.
const POINTS_PER_NINE: u32 = 20;

/// The chart as SVG; none when no round counts.
pub(super) fn percentiles(comparison: &Comparison) -> Option<String> {
    let counted = comparison.candidates.iter().filter(|candidate| candidate.n > 0);
    let chart = LineChart {
        title: comparison.measures.clone(),
        x: Axis::fitted("percentile", Scale::Percentile),
        y: Axis::fitted("µs", Scale::Log),
        lines: counted.map(|candidate| Line::new(&candidate.name, points(candidate))).collect(),
        limits: Vec::new(),
        legend: Legend::Beside,
    };
    chart.draw(HEIGHT).map(|drawn| drawn.svg)
}

/// Of all rounds together: (1/(1 − quantile), µs), up to the quantile that ten samples exceed.
fn points(candidate: &Candidate) -> Vec<(f64, f64)> {
    let mut all = no_durations();
    for round in candidate.rounds.iter().flatten() {
        all.add(round).expect("a histogram that resizes itself takes any other");
    }
    let most = ((all.len() as f64 / 10.0).log10().max(0.0) * f64::from(POINTS_PER_NINE)) as u32;
    let point = |index| {
        let x = 10_f64.powf(f64::from(index) / f64::from(POINTS_PER_NINE));
        (x, all.value_at_quantile(1.0 - 1.0 / x).max(1) as f64 / 1e3)
    };
    (0..=most).map(point).collect()
}
