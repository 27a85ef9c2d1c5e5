//! Maps of the workspace with the jaw's motions inside.

use plotters::prelude::*;

use super::axes::{Axes, Chart, curve, plain};
use super::{Area, Figure, TEXT, legend};
use crate::Study;
use crate::share::quantile;
use crate::workspace::{Coordinate, Map, Place};

/// Of the motions: the default scenario's, the other generators', the one given.
const MOTIONS: [RGBColor; 6] = [
    RGBColor(0xff, 0xff, 0xff),
    RGBColor(0xff, 0xb0, 0x00),
    RGBColor(0xff, 0x5f, 0x8f),
    RGBColor(0x9f, 0xff, 0xff),
    RGBColor(0xc0, 0x90, 0xff),
    RGBColor(0xff, 0x30, 0x30),
];

/// What a map's colours mean.
struct Measure {
    caption: &'static str,
    label: &'static str,
    of: fn(&Place) -> f64,
}

const CONDITION: Measure = Measure {
    caption: "conditioning (condition number of the 6×6 Jacobian, turns taken at the platform's side)",
    label: "condition number",
    of: |place| place.condition,
};
const SINGULARITY: Measure = Measure {
    caption: "distance to a singularity (change of the leg angles within which the Jacobian is proven regular)",
    label: "regular within, °",
    of: |place| place.regular_within_deg,
};
const SEPARATION: Measure = Measure {
    caption: "distance to the next other solution of the same input (largest difference of any leg's angle)",
    label: "next solution, °",
    of: |place| place.separation_deg,
};

pub(super) fn figures(study: &Study) -> anyhow::Result<Vec<Figure>> {
    let [xz, yz, roll_pitch, yaw_pitch] = &study.maps[..] else { return Ok(Vec::new()) };
    Ok(vec![
        figure(study, "workspace_translation", "Where the platform can go", &CONDITION, [xz, yz])?,
        figure(
            study,
            "workspace_orientation",
            "How the platform can turn",
            &CONDITION,
            [roll_pitch, yaw_pitch],
        )?,
        figure(study, "workspace_singularity", "Where the platform can go", &SINGULARITY, [xz, yz])?,
        figure(study, "workspace_separation", "Where the platform can go", &SEPARATION, [xz, yz])?,
    ])
}

fn figure(
    study: &Study,
    name: &'static str,
    what: &str,
    measure: &Measure,
    maps: [&Map; 2],
) -> anyhow::Result<Figure> {
    let caption = format!(
        "{what} within the strokes, and there: {}. White: out of reach. The other coordinates are those of the neutral \
         pose; the jaw's motions are projected, and leave the slice in them.",
        measure.caption
    );
    Figure::draw(name, caption, (1140, 554), |area| {
        let (names, content) = area.split_vertically(34);
        let motions = study.motions.iter().zip(MOTIONS).map(|(motion, colour)| (motion.name.clone(), colour));
        legend(&names, &motions.collect::<Vec<_>>(), MOTIONS.len())?;
        let (maps_area, bar) = content.split_horizontally(1030);
        let range = range(maps, measure);
        for (panel, map) in maps_area.split_evenly((1, 2)).iter().zip(maps) {
            draw_map(panel, study, map, measure, range)?;
        }
        colour_bar(&bar, measure, range)
    })
}

fn draw_map(area: &Area, study: &Study, map: &Map, measure: &Measure, range: [f64; 2]) -> anyhow::Result<()> {
    let ranges = [map.slice.across, map.slice.up].map(Coordinate::range);
    let axes = Axes {
        title: "",
        x: (map.slice.across.label(), ranges[0][0]..ranges[0][1], plain),
        y: (map.slice.up.label(), ranges[1][0]..ranges[1][1], plain),
    };
    let mut chart = axes.on(area)?;
    fill(&mut chart, map, ranges, |place| colour(range, (measure.of)(place)))?;
    // The wider opening first: the other runs along it.
    for (motion, colour) in study.motions.iter().zip(MOTIONS).rev() {
        let points: Vec<_> =
            motion.poses().map(|pose| (map.slice.across.of(&pose), map.slice.up.of(&pose))).collect();
        // A dark rim keeps the path visible on every colour of the map.
        chart.draw_series(LineSeries::new(points.iter().copied(), BLACK.stroke_width(4)))?;
        curve(&mut chart, "", &points, colour, false)?;
    }
    Ok(())
}

fn fill(
    chart: &mut Chart<'_, '_>,
    map: &Map,
    ranges: [[f64; 2]; 2],
    colour: impl Fn(&Place) -> RGBColor,
) -> anyhow::Result<()> {
    let [[left, right], [low, high]] = ranges;
    let (across, up) = ((right - left) / map.side as f64, (high - low) / map.side as f64);
    for (row, places) in map.places.chunks(map.side).enumerate() {
        let colours: Vec<_> = places.iter().map(|place| place.as_ref().map(&colour)).collect();
        let (y, mut from) = (low + row as f64 * up, 0);
        for run in colours.chunk_by(|a, b| a == b) {
            let (x, to) = (left + from as f64 * across, left + (from + run.len()) as f64 * across);
            if let Some(colour) = run[0] {
                chart.draw_series([Rectangle::new([(x, y), (to, y + up)], colour.filled())])?;
            }
            from += run.len();
        }
    }
    Ok(())
}

/// Steps of the colour scale; few enough that neighbours differ to the eye, many enough to show slopes.
const STEPS: f64 = 24.0;

/// From the least value to the one that nine in ten do not exceed: the rest would take the colours from them.
fn range(maps: [&Map; 2], measure: &Measure) -> [f64; 2] {
    let places = maps.into_iter().flat_map(|map| map.places.iter().flatten());
    let values: Vec<f64> =
        places.map(|place| (measure.of)(place)).filter(|value| value.is_finite()).collect();
    let [low, high] = [0.0, 0.9].map(|share| quantile(values.clone(), share));
    if low < high { [low, high] } else { [0.0, 1.0] }
}

fn colour([low, high]: [f64; 2], value: f64) -> RGBColor {
    let share = ((value - low) / (high - low)).clamp(0.0, 1.0);
    ViridisRGB.get_color((share * STEPS).round() / STEPS)
}

/// Decimals at which neighbouring labels of a colour bar differ: about ten labels share its range.
fn decimals(range: f64) -> usize {
    (1.0 - (range / 2.0).log10().floor()).max(0.0) as usize
}

fn colour_bar(area: &Area, measure: &Measure, range: [f64; 2]) -> anyhow::Result<()> {
    let [low, high] = range;
    let decimals = decimals(high - low);
    let mut chart = ChartBuilder::on(area)
        .margin(10)
        .margin_left(2)
        .margin_right(14)
        .margin_bottom(56)
        .right_y_label_area_size(58)
        .build_cartesian_2d(0.0..1.0, low..high)?
        .set_secondary_coord(0.0..1.0, low..high);
    let step = (high - low) / STEPS;
    let pieces = (0..STEPS as u32).map(|piece| {
        let from = low + f64::from(piece) * step;
        Rectangle::new([(0.0, from), (1.0, from + step)], colour(range, from + step / 2.0).filled())
    });
    chart.draw_series(pieces)?;
    chart
        .configure_secondary_axes()
        .label_style(("sans-serif", TEXT - 2))
        .axis_desc_style(("sans-serif", TEXT))
        .y_label_formatter(&|value| format!("{value:.decimals$}"))
        .y_desc(format!("{} (yellow: {high:.decimals$} and more)", measure.label))
        .draw()?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_of_a_colour_bar_differ() {
        for (low, high) in [(2.0, 2.04), (0.0, 0.9), (1.0, 3.5), (0.0, 20.0), (5.0, 800.0)] {
            let decimals = decimals(high - low);
            let label = |step: u32| format!("{:.decimals$}", low + (high - low) * f64::from(step) / 20.0);
            assert!((0..20).all(|step| label(step) != label(step + 1)), "{low} to {high}: {decimals}");
        }
    }
}
