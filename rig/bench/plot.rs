//! A bench's outcome as a percentile plot: duration over the number of nines, both as HdrHistogram plots
//! show them, so that the tail is as wide as the middle.

use std::error::Error;

use plotters::prelude::*;

use super::contest::{Contender, Durations, Outcome, durations};

const SIZE: (u32, u32) = (960, 420);
/// Points of a curve for each nine.
const POINTS_PER_NINE: u32 = 20;
const COLOURS: [RGBColor; 6] = [
    RGBColor(0x00, 0x72, 0xb2),
    RGBColor(0xd5, 0x5e, 0x00),
    RGBColor(0x00, 0x9e, 0x73),
    RGBColor(0xcc, 0x79, 0xa7),
    RGBColor(0xe6, 0x9f, 0x00),
    RGBColor(0x56, 0xb4, 0xe9),
];

/// The plot as SVG; none when there is nothing to draw.
pub(super) fn of(outcome: &Outcome) -> Option<String> {
    let curves: Vec<_> =
        outcome.contenders.iter().map(|contender| (&contender.name, curve(contender))).collect();
    let points = || curves.iter().flat_map(|(_, curve)| curve);
    let high_us = points().map(|point| point.1).reduce(f64::max)?;
    let low_us = points().map(|point| point.1).reduce(f64::min)?;
    let nines = points().map(|point| point.0).reduce(f64::max)?;
    let mut svg = String::new();
    draw(&mut svg, outcome, &curves, nines, (low_us / 1.5, high_us * 1.5)).ok()?;
    Some(svg)
}

/// All rounds together: (nines, µs), as far as ten samples reach.
fn curve(contender: &Contender) -> Vec<(f64, f64)> {
    let mut all: Durations = durations();
    for round in &contender.rounds {
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
    curves: &[(&String, Vec<(f64, f64)>)],
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
    chart
        .configure_mesh()
        .light_line_style(WHITE)
        .x_desc("nines of the percentile: 1 = 90 %, 2 = 99 %, 3 = 99.9 %")
        .y_desc("µs")
        .draw()?;
    for ((name, curve), colour) in curves.iter().zip(COLOURS.into_iter().cycle()) {
        chart
            .draw_series(LineSeries::new(curve.iter().copied(), colour))?
            .label(name.as_str())
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 16, y)], colour));
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperLeft)
        .background_style(WHITE)
        .border_style(BLACK)
        .draw()?;
    area.present()?;
    drop(chart);
    Ok(())
}
