//! Curves over time as SVG.

use std::error::Error;

use plotters::prelude::*;

use crate::analysis::TrackingSample;

const SIZE: (u32, u32) = (960, 260);
/// Points a curve is thinned to, by taking every n-th.
const POINTS: usize = 2000;

/// A curve: its name and its points (seconds, value).
struct Curve {
    name: &'static str,
    colour: RGBColor,
    points: Vec<(f64, f64)>,
}

/// The platform's true height and its distance from the wanted position over time.
pub(super) fn of_track(track: &[TrackingSample]) -> Option<[String; 2]> {
    let first_ns = track.first()?.sampled_ns;
    let every = track.len().div_ceil(POINTS);
    let curve = |name, colour, value: &dyn Fn(&TrackingSample) -> f64| Curve {
        name,
        colour,
        points: track
            .iter()
            .step_by(every)
            .map(|sample| ((sample.sampled_ns - first_ns) as f64 / 1e9, value(sample)))
            .collect(),
    };
    let height = [
        curve("wanted", RGBColor(0xd5, 0x5e, 0x00), &|sample| sample.desired_m[2] * 1e3),
        curve("true", RGBColor(0x00, 0x72, 0xb2), &|sample| sample.found_m[2] * 1e3),
    ];
    let error = [curve("true against wanted", RGBColor(0x00, 0x72, 0xb2), &|sample| {
        let squares = (0..3).map(|i| (sample.desired_m[i] - sample.found_m[i]).powi(2));
        squares.sum::<f64>().sqrt() * 1e3
    })];
    Some([draw("height of the platform, mm", &height).ok()?, draw("distance, mm", &error).ok()?])
}

fn draw(label: &str, curves: &[Curve]) -> Result<String, Box<dyn Error>> {
    let points = || curves.iter().flat_map(|curve| curve.points.iter());
    let end_s = points().map(|point| point.0).fold(0.0, f64::max);
    let low = points().map(|point| point.1).fold(f64::INFINITY, f64::min);
    let high = points().map(|point| point.1).fold(f64::NEG_INFINITY, f64::max);
    let margin = ((high - low) * 0.05).max(1e-6);

    let mut svg = String::new();
    {
        let area = SVGBackend::with_string(&mut svg, SIZE).into_drawing_area();
        area.fill(&WHITE)?;
        let mut chart = ChartBuilder::on(&area)
            .margin(12)
            .x_label_area_size(36)
            .y_label_area_size(64)
            .build_cartesian_2d(0.0..end_s, low - margin..high + margin)?;
        chart.configure_mesh().light_line_style(WHITE).x_desc("time, s").y_desc(label).draw()?;
        for curve in curves {
            let colour = curve.colour;
            chart
                .draw_series(LineSeries::new(curve.points.iter().copied(), colour))?
                .label(curve.name)
                .legend(move |(x, y)| PathElement::new([(x, y), (x + 16, y)], colour));
        }
        if curves.len() > 1 {
            chart
                .configure_series_labels()
                .position(SeriesLabelPosition::LowerLeft)
                .background_style(WHITE)
                .border_style(BLACK)
                .draw()?;
        }
        area.present()?;
    }
    Ok(svg)
}
