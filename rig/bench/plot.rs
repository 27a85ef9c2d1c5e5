//! A bench's outcome as a percentile plot: duration over the number of nines, both as HdrHistogram plots
//! show them, so that the tail is as wide as the middle.

use std::error::Error;

use plotters::coord::ranged1d::ValueFormatter;
use plotters::prelude::*;

use super::contender::{Contender, Durations, durations};
use super::contest::Outcome;
use masseter_charts::palette::{BLUE, GREEN, ORANGE, PURPLE, SKY, VERMILION};

const SIZE: (u32, u32) = (960, 420);
/// Points of a curve for each nine.
const POINTS_PER_NINE: u32 = 20;
/// A curve of so few points shows each of them.
const POINTS_SHOWN: usize = 10;
const COLOURS: [RGBColor; 6] = [BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY];

/// A line of a plot.
pub(super) struct Curve {
    pub(super) name: String,
    pub(super) points: Vec<(f64, f64)>,
}

/// Where the value of something over all curves is least or most, if there are any points.
pub(super) fn bound(
    curves: &[Curve],
    of: impl Fn(&(f64, f64)) -> f64,
    better: fn(f64, f64) -> f64,
) -> Option<f64> {
    curves.iter().flat_map(|curve| &curve.points).map(of).reduce(better)
}

/// The plot as SVG; none when there is nothing to draw.
pub(super) fn of(outcome: &Outcome) -> Option<String> {
    let counted = outcome.contenders.iter().filter(|contender| contender.n > 0);
    let curves: Vec<_> = counted
        .map(|contender| Curve { name: contender.name.clone(), points: percentiles(contender) })
        .collect();
    let high_us = bound(&curves, |point| point.1, f64::max)?;
    let low_us = bound(&curves, |point| point.1, f64::min)?;
    let nines = bound(&curves, |point| point.0, f64::max)?;
    let mut svg = String::new();
    draw(&mut svg, outcome, &curves, nines, (low_us / 1.5, high_us * 1.5)).ok()?;
    Some(svg)
}

/// All rounds together: (nines, µs), as far as ten samples reach.
fn percentiles(contender: &Contender) -> Vec<(f64, f64)> {
    let mut all: Durations = durations();
    for round in contender.rounds.iter().flatten() {
        all.add(round).expect("a histogram that resizes itself takes any other");
    }
    let most = ((all.len() as f64 / 10.0).log10().max(0.0) * f64::from(POINTS_PER_NINE)) as u32;
    let point = |index| {
        let nines = f64::from(index) / f64::from(POINTS_PER_NINE);
        let value_ns = all.value_at_quantile(1.0 - 10_f64.powf(-nines));
        (nines, value_ns.max(1) as f64 / 1e3)
    };
    (0..=most).map(point).collect()
}

fn draw(
    svg: &mut String,
    outcome: &Outcome,
    curves: &[Curve],
    nines: f64,
    (low_us, high_us): (f64, f64),
) -> Result<(), Box<dyn Error>> {
    let area = SVGBackend::with_string(svg, SIZE).into_drawing_area();
    area.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(&area)
        .margin(12)
        .caption(&outcome.measures, ("sans-serif", 16))
        .x_label_area_size(36)
        .y_label_area_size(64)
        .build_cartesian_2d(0.0..nines.max(0.1), (low_us..high_us).log_scale())?;
    draw_curves(&mut chart, curves, ["nines of the percentile: 1 = 90 %, 2 = 99 %, 3 = 99.9 %", "µs"])?;
    area.present()?;
    drop(chart);
    Ok(())
}

/// Axes, one colour a curve, and their names.
pub(super) fn draw_curves<'a, X, Y>(
    chart: &mut ChartContext<'a, SVGBackend<'a>, Cartesian2d<X, Y>>,
    curves: &[Curve],
    [x_desc, y_desc]: [&str; 2],
) -> Result<(), Box<dyn Error>>
where
    X: Ranged<ValueType = f64> + ValueFormatter<f64>,
    Y: Ranged<ValueType = f64> + ValueFormatter<f64>,
{
    chart.configure_mesh().light_line_style(WHITE).x_desc(x_desc).y_desc(y_desc).draw()?;
    for (curve, colour) in curves.iter().zip(COLOURS) {
        let dot_size = if curve.points.len() <= POINTS_SHOWN { 3 } else { 0 };
        chart
            .draw_series(LineSeries::new(curve.points.iter().copied(), colour.filled()).point_size(dot_size))?
            .label(&curve.name)
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 16, y)], colour));
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperLeft)
        .background_style(WHITE)
        .border_style(BLACK)
        .draw()?;
    Ok(())
}
