//! The mechanism in three dimensions, the motion of the jaw, the pressure between the jaws, and the actuators.
//!
//! `jaw.js` takes the poses from the data of the 3-D view, and the cycles from here.

use std::ops::Range;

use masseter_controller::trajectory::closed_pose;
use masseter_judge::{
    Band, Course, CoursePoint, Figures, JawCycleFigures, JawCycleGroup, PoseSource, RecordedError,
    RecordedFigures, ToothFigures, ToothLoads, TrackingSample, closed_incisal_m,
};
use masseter_model::geometry::{AXES, AXIS_NAMES, LEGS, Mechanism, Pose};
use masseter_page::{
    Block, Chart, Column, Content, Limit, Points, Pressure, Section, Series, Style, Table, Tooth,
};
use masseter_recording::jaw_points;
use masseter_runtime::messages::pose_fields;
use masseter_scenario::{Scenario, ToothConfig};
use serde::Serialize;
use serde_json::Value;

use super::times::{in_unit, limit, plain, since_s};
use crate::{table, text::or_dash};

/// Directions of the base, and where they point.
const DIRECTIONS: [[&str; 2]; 3] = [["x", "forward"], ["y", "to the left"], ["z", "up"]];

/// Least end of a scale of forces, N.
const LEAST_N: f64 = 0.1;

/// None without a motion.
pub(super) fn mechanism_section(scenario: &Scenario, figures: &Figures) -> Option<Section> {
    let scene = Content::Scene(animation_data(scenario, figures)?);
    Some(Section::new("mechanism", "Mechanism", vec![Block::new("scene", scene)]))
}

pub(super) fn motion_section(scenario: &Scenario, figures: &Figures) -> Section {
    let over_time = &figures.over_time;
    let error = |title: &str, unit: &str, band: &Band, factor: f64| Chart {
        series: vec![plain("distance", &band.highest(), factor)],
        otherwise: "There was no desired motion.".to_owned(),
        ..Chart::over_time(title, unit)
    };
    let distance = error("Incisal point from desired", "µm", &over_time.distance_m, 1e6);
    let mut angle = error("Platform from desired, angle", "°", &over_time.angle_rad, 1f64.to_degrees());
    "angle".clone_into(&mut angle.series[0].name);
    // Errors come first: only the run shows them.
    let mut blocks = vec![
        Block::text("motion-in-words", motion_in_words(figures)),
        Block::chart("error", distance),
        Block::chart("angle", angle),
    ];
    blocks.extend(figures.recorded.iter().flat_map(recorded_blocks));
    if let Some(closed_m) = closed_incisal_m(scenario) {
        let along = |axis: usize| {
            let chart = displacement(figures, axis, closed_m[axis]);
            Block::chart(format!("motion-{}", DIRECTIONS[axis][0]), chart)
        };
        // The jaw opens downwards, so z shows most.
        blocks.extend([along(2), along(0).half(), along(1).half()]);
    }
    if figures.bite_force_max_n.is_some() {
        let mut series = vec![plain("bite force", &over_time.bite_force_n.curve(), 1.0)];
        let shown =
            [("bite_force_n", "estimate"), ("bite_force_uncertainty_n", "uncertainty of the estimate")];
        let place = |name: &str| figures.signals.iter().position(|of| of.signal.name == name);
        series.extend(shown.into_iter().filter_map(|(signal, name)| {
            Some(plain(name, &over_time.signals.get(place(signal)?)?.curve(), 1.0))
        }));
        let force = Chart { series, ..Chart::over_time("Bite force, vertical", "N") };
        blocks.push(Block::chart("bite", force));
    }
    if figures.tracking.actual_source.is_truth() {
        let names = ["drives", "friction", "food, teeth and others", "motion and height: their sum"];
        let series =
            names.iter().zip(&over_time.energy_j).map(|(name, band)| plain(name, &band.curve(), 1.0));
        let energy = Chart {
            series: series.collect(),
            ..Chart::over_time("Work on the mechanism since the start", "J")
        };
        blocks.push(Block::chart("energy", energy));
    }
    Section::new("motion", "Motion", blocks)
}

/// A recorded motion against the played one: a table of errors, and the jaw's figures in a sentence.
fn recorded_blocks(figures: &RecordedFigures) -> [Block; 2] {
    let row = |error: &RecordedError| {
        let share = or_dash(error.share, |share| format!("{:.0} %", share * 100.0));
        let [rms, p95, max] =
            [error.rms, error.p95, error.max].map(|value| format!("{value:.4} {}", error.unit));
        [error.place.to_owned(), error.source.to_owned(), rms, p95, max, share]
    };
    let columns = [
        Column::texts(&["recorded against played", "by"]),
        Column::numbers(&["rms", "95 %", "max", "share of the mean square"]),
    ];
    let table = Table::new("Recorded against played", columns, figures.errors.iter().map(row));
    [Block::table("recorded", table), Block::text("recorded-in-words", figures.in_words())]
}

/// Desired, actual and estimated displacement of the incisal point from the closed jaw, along one direction.
fn displacement(figures: &Figures, axis: usize, closed_m: f64) -> Chart {
    let over_time = &figures.over_time;
    let series = |name: &str, style: Style, bands: &[Band; 3]| {
        Series::new(name, style, Points::over_time(&in_unit(&bands[axis].curve(), closed_m, 1e3)))
    };
    let source = figures.tracking.actual_source;
    let mut all = vec![series("desired", Style::Desired, &over_time.desired_incisal_m)];
    if source.is_truth() {
        all.push(series("true", Style::True, &over_time.actual_incisal_m));
        all.push(series("estimated", Style::Estimated, &over_time.estimated_incisal_m));
    } else {
        all.push(series("estimated", Style::Estimated, &over_time.actual_incisal_m));
    }
    let [name, direction] = DIRECTIONS[axis];
    Chart {
        series: all,
        otherwise: "Nothing moved.".to_owned(),
        height: 150,
        ..Chart::over_time(format!("Incisal point from closed, {name} ({direction})"), "mm")
    }
}

fn motion_in_words(figures: &Figures) -> String {
    let tracking = &figures.tracking;
    let estimate = tracking.estimate_rms_mm.map(|rms| format!("Estimated against true: rms {rms:.4} mm."));
    let bite = figures.bite_force_max_n.map(|most_n| format!("Bite force: at most {most_n:.1} N."));
    let sentences = [format!("Platform, {}.", table::distances(tracking))];
    let of_bite =
        figures.bite_estimate.as_ref().map(|of| format!("Estimated bite force: {}.", table::estimated(of)));
    sentences.into_iter().chain(estimate).chain(bite).chain(of_bite).collect::<Vec<_>>().join(" ")
}

/// None where the jaws cannot touch.
pub(super) fn pressure_section(figures: &Figures) -> Option<Section> {
    let contact = figures.contact.as_ref()?;
    let tooth = |tooth: &ToothFigures| Tooth {
        number: tooth.number,
        across_mm: -tooth.place_m[1] * 1e3,
        forward_mm: tooth.place_m[0] * 1e3,
        points: Points::over_time(&tooth.force_n.highest()),
    };
    let pressure = Pressure {
        teeth: contact.teeth.iter().map(tooth).collect(),
        most_n: contact.teeth.iter().map(|tooth| tooth.max_n).fold(LEAST_N, f64::max),
        at_s: since_s(figures, contact.total_max_at_ns),
    };
    let words = format!(
        "Force of antagonist and food on each lower tooth, mean over a cycle, from above: at most {:.1} N on all teeth \
         together. The area of a disc is the force.",
        contact.total_max_n
    );
    let blocks =
        vec![Block::text("pressure-in-words", words), Block::new("pressure", Content::Pressure(pressure))];
    Some(Section::new("pressure-between-jaws", "Pressure between the jaws", blocks))
}

/// Positions to the micrometre and quaternions to a millionth are finer than any screen.
const DIGITS: f64 = 1e6;

/// Mechanism and motion; metres, base frame.
#[derive(Serialize)]
struct Animation {
    /// Middle of each slide.
    centres: [[f64; 3]; LEGS],
    /// Direction of each slide.
    along: [[f64; 3]; LEGS],
    /// Ends of the slides' strokes.
    slide_ends: [f64; 2],
    /// Platform corners in the platform frame.
    corners: [[f64; 3]; LEGS],
    /// Incisal point and condyles in the platform frame.
    jaw: [[f64; 3]; 3],
    /// The platform when the jaw is closed, x y z, w x y z.
    closed: Vec<f64>,
    /// Numbers and places of the lower teeth in the platform frame.
    teeth: Vec<(u8, [f64; 3])>,
    /// Forces on the teeth. A row begins with the time since the run's first SYNC, s. Four numbers follow for each
    /// tooth with a force: the place in `teeth`, and the force along x, y and z of the base, N.
    forces: Vec<Vec<f64>>,
    /// What the actual pose is called.
    actual_name: &'static str,
    /// Time since the run's first SYNC, s, then the actual and the desired pose of the platform, each as x y z, w x y z.
    /// The estimated pose follows where the actual one is the true one.
    frames: Vec<Vec<f64>>,
}

/// The animation; none without a motion or without a mechanism.
pub(super) fn animation_data(scenario: &Scenario, figures: &Figures) -> Option<Value> {
    let mechanism = Mechanism::new(&scenario.mechanism).ok()?;
    let samples = &figures.track;
    samples.first()?;
    let source = figures.tracking.actual_source;
    let frame = |sample| frame(sample, figures.over_time.began_ns(), source);
    let contact = figures.contact.as_ref();
    let tooth = |tooth: &ToothConfig| (tooth.number, tooth.point_m.map(rounded));
    let animation = Animation {
        centres: std::array::from_fn(|leg| mechanism.hinge(leg, 0.0).into()),
        along: std::array::from_fn(|leg| mechanism.slide_direction(leg).into()),
        slide_ends: mechanism.strokes().slide_m,
        corners: mechanism.platform_corners().map(Into::into),
        jaw: jaw_points(&scenario.jaw).map(Into::into),
        closed: numbers(&closed_pose(&scenario.jaw, &mechanism).ok()?).collect(),
        teeth: scenario.arch().iter().map(tooth).collect(),
        forces: contact.map(|contact| contact.moments.iter().map(tooth_forces).collect()).unwrap_or_default(),
        actual_name: source.adjective(),
        frames: samples.iter().map(frame).collect(),
    };
    serde_json::to_value(&animation).ok()
}

fn frame(sample: &TrackingSample, began_ns: u64, source: PoseSource) -> Vec<f64> {
    let mut frame = vec![rounded(sample.sampled_ns.saturating_sub(began_ns) as f64 / 1e9)];
    frame.extend(numbers(&sample.actual).chain(numbers(&sample.desired)));
    if source == PoseSource::Truth {
        frame.extend(numbers(&sample.estimated));
    }
    frame
}

fn tooth_forces(moment: &ToothLoads) -> Vec<f64> {
    let to_tenth = |force_n: f64| (force_n * 10.0).round() / 10.0;
    let forces = moment.forces_n.iter();
    let of_teeth =
        forces.flat_map(|(place, force_n)| [*place as f64].into_iter().chain(force_n.map(to_tenth)));
    [rounded(moment.at_s)].into_iter().chain(of_teeth).collect()
}

fn numbers(pose: &Pose) -> impl Iterator<Item = f64> {
    let (position_m, quaternion) = pose_fields(pose);
    position_m.into_iter().chain(quaternion).map(rounded)
}

fn rounded(value: f64) -> f64 {
    (value * DIGITS).round() / DIGITS
}

/// Values of a course to a thousandth: a micrometre, a millinewton.
const COURSE_DIGITS: f64 = 1e3;

#[derive(Serialize)]
struct Cycles<'a> {
    #[serde(flatten)]
    found: &'a JawCycleFigures,
    has_force: bool,
    /// The drawings of each group.
    drawn: Vec<Drawn>,
}

#[derive(Serialize)]
struct Drawn {
    /// Of each point: opening, lateral, mm, force, N, then their standard deviations.
    mean: Vec<[f64; 6]>,
    /// The number of a cycle, and opening, lateral and force of each of its points, one after the other.
    courses: Vec<(u64, Vec<f64>)>,
}

pub(super) fn jaw_section(figures: &Figures) -> Option<Section> {
    let data = serde_json::to_value(cycles(&figures.jaw_cycles)).ok()?;
    Some(Section::new("jaw", "Jaw", vec![Block::new("jaw", Content::Jaw(data))]))
}

fn cycles(found: &JawCycleFigures) -> Cycles<'_> {
    let has_force = found.cycles.iter().any(|cycle| cycle.force_n.is_some());
    Cycles { found, has_force, drawn: found.groups.iter().map(drawn).collect() }
}

fn drawn(of: &JawCycleGroup) -> Drawn {
    let rounded = |value: f64| (value * COURSE_DIGITS).round() / COURSE_DIGITS;
    let values = |point: &CoursePoint| [point.opening_mm, point.lateral_mm, point.force_n].map(rounded);
    let mean_and_sd = |[mean, sd]: &[CoursePoint; 2]| {
        let ([a, b, c], [d, e, f]) = (values(mean), values(sd));
        [a, b, c, d, e, f]
    };
    let course = |(number, course): &(u64, Course)| (*number, course.iter().flat_map(values).collect());
    Drawn {
        mean: of.mean_course.iter().map(mean_and_sd).collect(),
        courses: of.courses.iter().map(course).collect(),
    }
}

/// Three axes of one kind.
#[derive(Clone, Copy)]
enum Kind {
    Slides,
    Legs,
}

impl Kind {
    /// In words and in the page's ids.
    fn name(self) -> &'static str {
        match self {
            Self::Slides => "slides",
            Self::Legs => "legs",
        }
    }

    fn axes(self) -> Range<usize> {
        let first = self as usize * LEGS;
        first..first + LEGS
    }
}

pub(super) fn actuators_section(scenario: &Scenario, figures: &Figures) -> Section {
    const KINDS: [Kind; 2] = [Kind::Slides, Kind::Legs];
    let over_time = &figures.over_time;
    let strokes_m = [scenario.mechanism.strokes.slide_m, scenario.mechanism.strokes.leg_m];
    let drives = [&scenario.drives.slide, &scenario.drives.leg];
    let both_ways = |most: f64| vec![limit("limit", &[most, -most])];
    let position = |kind: Kind| {
        let [low, high] = strokes_m[kind as usize].map(|end_m| end_m * 1e3);
        let limits = vec![limit("lower end", &[low]), limit("upper end", &[high])];
        Block::chart(kind.name(), curve_chart(kind, "Position", "mm", &over_time.position_m, limits)).half()
    };
    let velocity = |kind: Kind| {
        let limits = both_ways(drives[kind as usize].max_velocity_m_s * 1e3);
        let chart = curve_chart(kind, "Velocity", "mm/s", &over_time.velocity_m_s, limits);
        Block::chart(format!("velocity-{}", kind.name()), chart).half()
    };
    let force = |kind: Kind| {
        let limits = both_ways(scenario.max_force_n(kind.axes().start));
        Block::chart(format!("force-{}", kind.name()), force_chart(kind, figures, limits)).half()
    };
    let charts = [KINDS.map(position), KINDS.map(velocity), KINDS.map(force)];
    let blocks = charts.into_iter().flatten().collect();
    Section::new("actuators", "Actuators", blocks)
}

fn curve_chart(kind: Kind, quantity: &str, unit: &str, si: &[Band; AXES], limits: Vec<Limit>) -> Chart {
    let series = kind.axes().map(|axis| plain(AXIS_NAMES[axis], &si[axis].curve(), 1e3)).collect();
    Chart { series, limits, ..Chart::over_time(format!("{quantity} of the {}", kind.name()), unit) }
}

/// Pale raw forces under their moving means.
fn force_chart(kind: Kind, figures: &Figures, limits: Vec<Limit>) -> Chart {
    let over_time = &figures.over_time;
    let series = |name: String, style: Style, place: usize, band: &Band| {
        Series::new(name, style, Points::over_time(&band.curve())).coloured(place)
    };
    let raw = kind.axes().enumerate().map(|(place, axis)| {
        series(format!("{} raw", AXIS_NAMES[axis]), Style::Raw, place, &over_time.force_n[axis])
    });
    let smooth = kind.axes().enumerate().map(|(place, axis)| {
        series(AXIS_NAMES[axis].to_owned(), Style::Smoothed, place, &over_time.smooth_force_n[axis])
    });
    let title = format!("Force of the {}, raw and mean of 20 ms", kind.name());
    Chart { series: raw.chain(smooth).collect(), limits, ..Chart::over_time(title, "N") }
}

#[cfg(test)]
mod tests;
