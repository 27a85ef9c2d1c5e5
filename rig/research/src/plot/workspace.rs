//! Maps of the workspace with the jaw's motions inside.

use masseter_charts::{Area, Axis, ColourScale, Error, Key, LegendEntry, Scale, cells, chart, legend};
use plotters::prelude::*;

use crate::motions::Motion;
use crate::share::quantile;
use crate::study::Study;
use crate::workspace::{Map, PoseQuality};

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
type Measure = (&'static str, fn(&PoseQuality) -> f64);
const CONDITION: Measure = ("condition number", |quality| quality.condition);
const SINGULARITY: Measure = ("regular within, °", |quality| quality.regular_within_deg);
const SEPARATION: Measure = ("next solution, °", |quality| quality.separation_deg);

pub(super) fn figures(study: &Study) -> Result<Vec<(&'static str, String)>, Error> {
    let [xz, yz, roll_pitch, yaw_pitch] = &study.maps;
    let figures = [
        ("workspace_translation", CONDITION, [xz, yz]),
        ("workspace_orientation", CONDITION, [roll_pitch, yaw_pitch]),
        ("workspace_singularity", SINGULARITY, [xz, yz]),
        ("workspace_separation", SEPARATION, [xz, yz]),
    ];
    figures.into_iter().map(|(name, measure, maps)| Ok((name, svg(study, measure, maps)?))).collect()
}

fn svg(study: &Study, (label, value): Measure, maps: [&Map; 2]) -> Result<String, Error> {
    masseter_charts::svg((1140, 554), |area| {
        let (names, content) = area.split_vertically(34);
        let entry =
            |(motion, colour): (&Motion, _)| LegendEntry { name: motion.name.clone(), colour, key: Key::Box };
        let motions: Vec<_> = study.motions.iter().zip(MOTIONS).map(entry).collect();
        legend(&names, &motions, MOTIONS.len())?;
        let (maps_area, bar) = content.split_horizontally(1030);
        let colours = ColourScale::new(label, range(maps, value));
        for (panel, map) in maps_area.split_evenly((1, 2)).iter().zip(maps) {
            draw_map(panel, study, map, |quality| colours.colour(value(quality)))?;
        }
        colours.draw(&bar)
    })
}

fn draw_map(
    area: &Area,
    study: &Study,
    map: &Map,
    colour: impl Fn(&PoseQuality) -> RGBColor,
) -> Result<(), Error> {
    let [across, up] = map.slice.axes;
    let [x, y] = [across, up].map(|axis| Axis::new(axis.label, Scale::Linear, axis.range));
    let mut chart = chart(area, "", x, y)?;
    cells(&mut chart, map.side, |cell| map.poses[cell].as_ref().map(&colour))?;
    // The last first: a wide opening covers no smaller one on the same path.
    let motions: Vec<_> = study.motions.iter().zip(MOTIONS).collect();
    for (motion, colour) in motions.into_iter().rev() {
        let points: Vec<_> = motion.poses().map(|pose| (across.at(&pose), up.at(&pose))).collect();
        // A dark rim keeps the path visible on every colour of the map.
        for style in [BLACK.stroke_width(4), colour.stroke_width(2)] {
            chart.draw_series(LineSeries::new(points.iter().copied(), style))?;
        }
    }
    Ok(())
}

/// From the least value to the 90th percentile: the highest values would leave the others without contrast.
fn range(maps: [&Map; 2], value: fn(&PoseQuality) -> f64) -> [f64; 2] {
    let values = || maps.into_iter().flat_map(|map| map.poses.iter().flatten()).map(value);
    let [low, high] = [0.0, 0.9].map(|share| quantile(values().filter(|value| value.is_finite()), share));
    if low < high { [low, high] } else { [0.0, 1.0] }
}
