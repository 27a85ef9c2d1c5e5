//! Maps of the workspace with the jaw's motions inside.

use masseter_charts::{Area, Axis, ColourScale, Error, Key, LegendEntry, Scale, cells, chart, legend};
use plotters::prelude::*;

use super::draw::draw;
use crate::figure::Figure;
use crate::motions::Motion;
use crate::share::quantile;
use crate::study::Study;
use crate::workspace::{Coordinate, Map, PoseQuality};

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
    value: fn(&PoseQuality) -> f64,
}

const CONDITION: Measure = Measure {
    caption: "conditioning (condition number of the 6×6 Jacobian, turns taken at the platform's side)",
    label: "condition number",
    value: |quality| quality.condition,
};
const SINGULARITY: Measure = Measure {
    caption: "distance to a singularity (change of the leg angles within which the Jacobian is proven regular)",
    label: "regular within, °",
    value: |quality| quality.regular_within_deg,
};
const SEPARATION: Measure = Measure {
    caption: "distance to the next other solution of the same input (largest difference of any leg's angle)",
    label: "next solution, °",
    value: |quality| quality.separation_deg,
};

pub(super) fn figures(study: &Study) -> Result<Vec<Figure>, Error> {
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
) -> Result<Figure, Error> {
    let caption = format!(
        "{what} within the strokes, with {}. White: out of reach. The other coordinates are those of the neutral \
         pose; the jaw's motions are projections, which leave the slice in the other coordinates.",
        measure.caption
    );
    draw(name, caption, (1140, 554), |area| {
        let (names, content) = area.split_vertically(34);
        let entry =
            |(motion, colour): (&Motion, _)| LegendEntry { name: motion.name.clone(), colour, key: Key::Box };
        let motions: Vec<_> = study.motions.iter().zip(MOTIONS).map(entry).collect();
        legend(&names, &motions, MOTIONS.len())?;
        let (maps_area, bar) = content.split_horizontally(1030);
        let colours = ColourScale::new(measure.label, range(maps, measure));
        for (panel, map) in maps_area.split_evenly((1, 2)).iter().zip(maps) {
            draw_map(panel, study, map, measure, &colours)?;
        }
        colours.draw(&bar)
    })
}

fn draw_map(
    area: &Area,
    study: &Study,
    map: &Map,
    measure: &Measure,
    colours: &ColourScale,
) -> Result<(), Error> {
    let axis = |coordinate: Coordinate| Axis::new(coordinate.label(), Scale::Linear, coordinate.range());
    let mut chart = chart(area, "", axis(map.slice.across), axis(map.slice.up))?;
    cells(&mut chart, map.side, |cell| {
        map.poses[cell].as_ref().map(|quality| colours.colour((measure.value)(quality)))
    })?;
    // The last first: a wide opening covers no smaller one on the same path.
    let motions: Vec<_> = study.motions.iter().zip(MOTIONS).collect();
    for (motion, colour) in motions.into_iter().rev() {
        let points: Vec<_> =
            motion.poses().map(|pose| (map.slice.across.at(&pose), map.slice.up.at(&pose))).collect();
        // A dark rim keeps the path visible on every colour of the map.
        for style in [BLACK.stroke_width(4), colour.stroke_width(2)] {
            chart.draw_series(LineSeries::new(points.iter().copied(), style))?;
        }
    }
    Ok(())
}

/// From the least value to the 90th percentile: the highest values would leave the others without contrast.
fn range(maps: [&Map; 2], measure: &Measure) -> [f64; 2] {
    let poses = maps.into_iter().flat_map(|map| map.poses.iter().flatten());
    let values: Vec<f64> =
        poses.map(|quality| (measure.value)(quality)).filter(|value| value.is_finite()).collect();
    let [low, high] = [0.0, 0.9].map(|share| quantile(values.clone(), share));
    if low < high { [low, high] } else { [0.0, 1.0] }
}
