//! The motion as a picture: paths of the incisal point and the condyles, and their course.

use masseter_charts::{Axis, Error, Line, LineChart, Scale, SeriesLabelPosition, palette, svg as draw_svg};
use masseter_controller::trajectory::{Glitch, RecordingSurvey, SurveyRow};

const WIDTH: u32 = 960;
const PATHS: u32 = 400;
const COURSE: u32 = 260;
/// Height over width of the plot of a path, without its labels and title.
const PLOT: f64 = 316.0 / 386.0;
/// Room around a path, as a share of its size.
const ROOM: f64 = 1.15;
/// Glitches that are marked.
const MOST_MARKS: usize = 5;
/// The component on which they are marked.
const UP: usize = 2;
/// A path of no size is drawn in a box of this size, mm.
const LEAST_MM: f64 = 1.0;

/// A plane through the jaw: its title, and its axes with their names.
struct Plane {
    title: &'static str,
    axes: [usize; 2],
    names: [&'static str; 2],
}

const SAGITTAL: Plane = Plane { title: "Sagittal", axes: [0, 2], names: ["anterior, mm", "up, mm"] };
const FRONTAL: Plane = Plane { title: "Frontal", axes: [1, 2], names: ["left, mm", "up, mm"] };

/// Sagittal and frontal paths over displacements and turns.
pub(super) fn svg(survey: &RecordingSurvey) -> Result<String, Error> {
    draw_svg((WIDTH, PATHS + 2 * COURSE), |area| {
        let (paths, courses) = area.split_vertically(PATHS);
        let (sagittal, frontal) = paths.split_horizontally(WIDTH / 2);
        path(survey, &SAGITTAL).draw_on(&sagittal)?;
        path(survey, &FRONTAL).draw_on(&frontal)?;
        let (way, turn) = courses.split_vertically(COURSE);
        course(survey, "incisal point, mm", ["anterior", "left", "up"], |row| row.points_m[0] * 1e3)
            .draw_on(&way)?;
        let turns = |row: &SurveyRow| row.turn_rad.map(f64::to_degrees);
        course(survey, "turn, degrees", ["roll", "opening", "yaw"], turns).draw_on(&turn)
    })
}

/// The three points in a plane, in one scale along both axes.
fn path(survey: &RecordingSurvey, plane: &Plane) -> LineChart {
    let names = ["incisal point", "right condyle", "left condyle"];
    let of = |point: usize| {
        let place = |row: &SurveyRow| {
            let [across, up] = plane.axes.map(|axis| row.points_m[point][axis] * 1e3);
            (across, up)
        };
        Line::new(names[point], survey.path.iter().map(place).collect())
    };
    let lines: Vec<Line> = (0..3).map(of).collect();
    let points = || lines.iter().flat_map(|line| &line.points);
    let [x, y] = [span(points().map(|point| point.0)), span(points().map(|point| point.1))];
    let width = ROOM * (x[1] - x[0]).max((y[1] - y[0]) / PLOT).max(LEAST_MM);
    let ends = |[low, high]: [f64; 2], length: f64| {
        let middle = f64::midpoint(low, high);
        [middle - length / 2.0, middle + length / 2.0]
    };
    LineChart {
        title: plane.title.to_owned(),
        x: Axis::new(plane.names[0], Scale::Linear, ends(x, width)),
        y: Axis::new(plane.names[1], Scale::Linear, ends(y, width * PLOT)),
        lines,
        legend: SeriesLabelPosition::LowerRight,
    }
}

fn span(values: impl Iterator<Item = f64>) -> [f64; 2] {
    values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| [low.min(value), high.max(value)])
}

/// Three components over time, with the glitches.
fn course(
    survey: &RecordingSurvey,
    label: &str,
    names: [&str; 3],
    of: impl Fn(&SurveyRow) -> nalgebra::Vector3<f64>,
) -> LineChart {
    let line = |(axis, name): (usize, &str)| {
        Line::new(name, survey.path.iter().map(|row| (row.time_s, of(row)[axis])).collect())
    };
    let mark = |glitch: &Glitch| {
        let row = survey.path.partition_point(|row| row.time_s < glitch.time_s).min(survey.path.len() - 1);
        let at = (glitch.time_s, of(&survey.path[row])[UP]);
        Line::new(&format!("glitch, line {}", glitch.line), vec![at]).marked().coloured(palette::RED)
    };
    LineChart {
        title: String::new(),
        x: Axis::fitted("time, s", Scale::Linear).including(0.0),
        y: Axis::fitted(label, Scale::Linear),
        lines: names
            .into_iter()
            .enumerate()
            .map(line)
            .chain(survey.glitches.iter().take(MOST_MARKS).map(mark))
            .collect(),
        legend: SeriesLabelPosition::LowerRight,
    }
}
