//! The motion as a picture: paths of the incisal point and the condyles, and their course.

use masseter_charts::{Axis, BLUE, Chart, GREEN, Look, RED, Series, VERMILION, drawing};
use masseter_recorded_motion::{Glitch, RecordingSurvey, SurveyRow};

const COLOURS: [&str; 3] = [BLUE, VERMILION, GREEN];
/// Size of the chart of a path, px.
const PATH: [f64; 2] = [480.0, 400.0];
/// Size of the chart of a course, px.
const COURSE: [f64; 2] = [960.0, 260.0];
/// Room around a path, as a share of its size.
const AROUND: f64 = 1.15;
/// Glitches that are marked.
const MOST_MARKS: usize = 5;
/// The component on which they are marked.
const UP: usize = 2;

/// Sagittal and frontal paths over displacements and turns.
pub(super) fn svg(survey: &RecordingSurvey) -> String {
    let way_mm = |row: &SurveyRow| row.points_m[0] * 1e3;
    let turn_deg = |row: &SurveyRow| row.turn_rad.map(f64::to_degrees);
    let below = PATH[1] + COURSE[1];
    let charts = [
        path(survey, 0.0, "sagittal", 0, "anterior, mm"),
        path(survey, PATH[0], "frontal", 1, "left, mm"),
        course(survey, PATH[1], "incisal point, mm", ["anterior", "left", "up"], way_mm),
        course(survey, below, "turn, degrees", ["roll", "opening", "yaw"], turn_deg),
    ];
    drawing([COURSE[0], below + COURSE[1]], &charts)
}

/// The three points in a plane, in one scale along both axes.
fn path(survey: &RecordingSurvey, left: f64, title: &str, across: usize, label: &str) -> Chart {
    let names = ["incisal point", "right condyle", "left condyle"].into_iter().zip(COLOURS).enumerate();
    let of = |(point, (name, colour)): (usize, (&str, _))| {
        let place = |row: &SurveyRow| (row.points_m[point][across] * 1e3, row.points_m[point][UP] * 1e3);
        let points = survey.path.iter().map(place).collect();
        Series { name: name.to_owned(), colour, look: Look::Line, points }
    };
    let series: Vec<Series> = names.map(of).collect();
    let [x, y] = Axis::in_one_scale([label, "up, mm"], &series, PATH, AROUND);
    Chart { frame: [left, 0.0, PATH[0], PATH[1]], title: title.to_owned(), x, y, series }
}

/// Three components over time, with the glitches.
fn course(
    survey: &RecordingSurvey,
    top: f64,
    label: &str,
    names: [&str; 3],
    of: impl Fn(&SurveyRow) -> nalgebra::Vector3<f64>,
) -> Chart {
    let component = |(axis, (name, colour)): (usize, (&str, _))| {
        let points = survey.path.iter().map(|row| (row.time_s, of(row)[axis])).collect();
        Series { name: name.to_owned(), colour, look: Look::Line, points }
    };
    let mark = |glitch: &Glitch| {
        let row = survey.path.partition_point(|row| row.time_s < glitch.time_s).min(survey.path.len() - 1);
        let points = vec![(glitch.time_s, of(&survey.path[row])[UP])];
        Series { name: format!("glitch, line {}", glitch.line), colour: RED, look: Look::Dots, points }
    };
    let components = names.into_iter().zip(COLOURS).enumerate().map(component);
    let series: Vec<_> = components.chain(survey.glitches.iter().take(MOST_MARKS).map(mark)).collect();
    let points = || series.iter().flat_map(|series| &series.points);
    let x = Axis::around("time, s", points().map(|point| point.0).chain([0.0]), 0.0);
    let y = Axis::around(label, points().map(|point| point.1), 0.05);
    Chart { frame: [0.0, top, COURSE[0], COURSE[1]], title: String::new(), x, y, series }
}
