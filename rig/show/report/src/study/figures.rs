//! Figures of a study for print, as SVG: courses of the cycles with mean ± SD, and paths of the incisal point. Sizes are those of
//! one and two columns of a journal, 85 and 170 mm, with letters of 7 pt and lines of 0.4 mm.

use std::collections::BTreeSet;

use masseter_charts::{Axis, BLUE, Chart, GREEN, GREY, Look, PRINT_COLUMN, RED, Series, VERMILION, printed};
use masseter_judge::{COURSE_POINTS, Course, CoursePoint, mean_course};

use super::{Recorded, Study};

const COLOURS: [&str; 5] = [BLUE, VERMILION, GREEN, RED, GREY];
/// Height of a chart in a figure, px.
const HEIGHT: f64 = 250.0;
/// Room beyond the curves, as a share of their extent.
const ROOM: f64 = 0.04;

/// A figure with the name of its file.
pub(super) struct Figure {
    pub name: String,
    pub svg: String,
}

/// One figure of each kind and side in each width, and one of the paths.
pub(super) fn figures(study: &Study) -> Vec<Figure> {
    let mut all = Vec::new();
    for group in groups(study) {
        let courses = [
            course(study, group, "opening, mm", |at| at.opening_mm),
            course(study, group, "to the left, mm", |at| at.lateral_mm),
        ];
        all.extend(both_widths(&format!("cycles-{}", group.replace(' ', "-")), &courses));
    }
    all.extend(both_widths("paths", &[path(study, "forward, mm", 0), path(study, "to the left, mm", 1)]));
    all
}

/// Kinds and sides of which a recording has a course.
pub(super) fn groups(study: &Study) -> BTreeSet<&str> {
    let groups = study.recordings.iter().flat_map(|recorded| &recorded.jaw.groups);
    groups.filter(|group| !group.mean_course.is_empty()).map(|group| group.name.as_str()).collect()
}

/// Two charts: one below the other in a column, side by side over two.
fn both_widths(name: &str, charts: &[Chart; 2]) -> [Figure; 2] {
    let placed = |places: [[f64; 2]; 2]| {
        let mut charts = charts.clone();
        for (chart, [left, top]) in charts.iter_mut().zip(places) {
            chart.frame = [left, top, PRINT_COLUMN, HEIGHT];
        }
        charts
    };
    let below = printed([PRINT_COLUMN, 2.0 * HEIGHT], &placed([[0.0, 0.0], [0.0, HEIGHT]]));
    let beside = printed([2.0 * PRINT_COLUMN, HEIGHT], &placed([[0.0, 0.0], [PRINT_COLUMN, 0.0]]));
    [("85", below), ("170", beside)].map(|(width, svg)| Figure { name: format!("{name}-{width}mm.svg"), svg })
}

fn in_condition<'a>(study: &'a Study, condition: &'a str) -> impl Iterator<Item = &'a Recorded> {
    study.recordings.iter().filter(move |recorded| recorded.condition == condition)
}

/// Mean and standard deviation of the recordings' mean courses; of a single recording, of its cycles.
pub(super) fn band(study: &Study, group: &str, condition: &str) -> Vec<[CoursePoint; 2]> {
    let groups = in_condition(study, condition).flat_map(|recorded| recorded.jaw.groups.iter());
    let courses: Vec<_> = groups
        .filter(|of| of.name == group && !of.mean_course.is_empty())
        .map(|of| &of.mean_course)
        .collect();
    match &courses[..] {
        [only] => (*only).clone(),
        several => {
            let means: Vec<Course> =
                several.iter().map(|course| std::array::from_fn(|point| course[point][0])).collect();
            mean_course(&means.iter().collect::<Vec<_>>())
        }
    }
}

/// The share of the cycle at a point of a course, %.
pub(super) fn percent(point: usize) -> f64 {
    100.0 * point as f64 / (COURSE_POINTS - 1) as f64
}

/// Mean ± SD of a coordinate over the cycle, in each condition.
fn course(study: &Study, group: &str, label: &str, of: fn(&CoursePoint) -> f64) -> Chart {
    let [mut areas, mut lines] = [Vec::new(), Vec::new()];
    for (condition, colour) in study.conditions().into_iter().zip(COLOURS.into_iter().cycle()) {
        let band = band(study, group, condition);
        let edge =
            |sign: f64, point: usize| (percent(point), of(&band[point][0]) + sign * of(&band[point][1]));
        let upper = (0..band.len()).map(|point| edge(1.0, point));
        let lower = (0..band.len()).rev().map(|point| edge(-1.0, point));
        let area = upper.chain(lower).collect();
        areas.push(Series { name: String::new(), colour, look: Look::Area, points: area });
        let points = (0..band.len()).map(|point| edge(0.0, point)).collect();
        lines.push(Series { name: condition.to_owned(), colour, look: Look::Line, points });
    }
    let series: Vec<_> = areas.into_iter().chain(lines).collect();
    let values = series.iter().flat_map(|series| series.points.iter().map(|point| point.1));
    Chart {
        frame: [0.0; 4],
        title: format!("({group})"),
        x: Axis::around("share of the cycle, %", [0.0, 100.0], 0.0),
        y: Axis::around(label, values, ROOM),
        series,
    }
}

/// Paths of all recordings in a plane with the vertical, both axes to one scale.
fn path(study: &Study, label: &str, across: usize) -> Chart {
    let mut series = Vec::new();
    for (condition, colour) in study.conditions().into_iter().zip(COLOURS.into_iter().cycle()) {
        for (number, recorded) in in_condition(study, condition).enumerate() {
            let name = if number == 0 { condition.to_owned() } else { String::new() };
            let points = recorded.path_mm.iter().map(|place| (place[across], place[2])).collect();
            series.push(Series { name, colour, look: Look::Hair, points });
        }
    }
    let around = 1.0 + 2.0 * ROOM;
    let [x, y] = Axis::in_one_scale([label, "up, mm"], &series, [PRINT_COLUMN, HEIGHT], around);
    Chart { frame: [0.0; 4], title: "(incisal point)".to_owned(), x, y, series }
}
