//! The mechanism in three dimensions, the motion of the jaw, and the pressure between the jaws.

use masseter_analysis::{Curve, Figures, ToothFigures};
use masseter_controller::trajectory::closed_pose;
use masseter_model::geometry::{Mechanism, Vec3};
use masseter_page::{Block, Chart, Content, Points, Pressure, Section, Series, Style, Tooth};
use masseter_scenario::Scenario;

use super::animation;
use super::charts::{in_unit, plain};
use super::times::since_s;
use crate::table;

/// Directions of the base, and where they point.
const DIRECTIONS: [[&str; 2]; 3] = [["x", "forward"], ["y", "to the left"], ["z", "up"]];

/// Least end of a scale of forces, N.
const LEAST_N: f64 = 0.1;

/// None without a motion.
pub(super) fn mechanism(scenario: &Scenario, figures: &Figures) -> Option<Section> {
    let scene = Content::Scene(animation::data(scenario, figures)?);
    Some(Section::new("mechanism", "Mechanism", vec![Block::new("scene", scene)]))
}

pub(super) fn section(scenario: &Scenario, figures: &Figures) -> Section {
    let over_time = &figures.over_time;
    let mut blocks = vec![Block::text("motion-in-words", in_words(figures))];
    if let Some(closed_m) = closed_incisal_m(scenario) {
        let along = |axis: usize| {
            let chart = displacement(figures, axis, closed_m[axis]);
            Block::chart(format!("motion-{}", DIRECTIONS[axis][0]), chart)
        };
        // The jaw opens downwards, so z says most.
        blocks.extend([along(2), along(0).half(), along(1).half()]);
    }
    let error = |title: &str, unit: &str, curve: &Curve, factor: f64| Chart {
        series: vec![plain("distance", curve, factor)],
        otherwise: "There was no desired motion.".to_owned(),
        height: 140,
        ..Chart::over_time(title, unit)
    };
    let distance = error("Incisal point from desired", "µm", &over_time.distance_m, 1e6);
    let mut angle = error("Platform from desired, angle", "°", &over_time.angle_rad, 1f64.to_degrees());
    "angle".clone_into(&mut angle.series[0].name);
    blocks.push(Block::chart("error", distance).half());
    blocks.push(Block::chart("angle", angle).half());
    if figures.bite_force_max_n.is_some() {
        let force = Chart {
            series: vec![plain("bite force", &over_time.bite_force_n, 1.0)],
            ..Chart::over_time("Bite force, vertical", "N")
        };
        blocks.push(Block::chart("bite", force));
    }
    Section::new("motion", "Motion", blocks)
}

/// Desired, actual and estimated displacement of the incisal point from the closed jaw, along one direction.
fn displacement(figures: &Figures, axis: usize, closed_m: f64) -> Chart {
    let over_time = &figures.over_time;
    let series = |name: &str, style: Style, curves: &[Curve; 3]| {
        Series::new(name, style, Points::over_time(&in_unit(&curves[axis], closed_m, 1e3)))
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

fn in_words(figures: &Figures) -> String {
    let tracking = &figures.tracking;
    let estimate = tracking.estimate_rms_mm.map(|rms| format!("Estimated against true: rms {rms:.4} mm."));
    let bite = figures.bite_force_max_n.map(|most_n| format!("Bite force: at most {most_n:.1} N."));
    let sentences = [format!("Platform, {}.", table::distances(tracking))];
    sentences.into_iter().chain(estimate).chain(bite).collect::<Vec<_>>().join(" ")
}

/// Place of the incisal point when the jaw is closed, base frame; none for a scenario without a closed pose, which no run
/// has.
fn closed_incisal_m(scenario: &Scenario) -> Option<[f64; 3]> {
    let mechanism = Mechanism::new(&scenario.mechanism).ok()?;
    let closed = closed_pose(&scenario.jaw, &mechanism).ok()?;
    let incisal = Vec3::from(scenario.jaw.reference_point_m);
    Some((closed.translation.vector + closed.rotation * incisal).into())
}

/// None where the jaws cannot touch.
pub(super) fn pressure(figures: &Figures) -> Option<Section> {
    let contact = figures.contact.as_ref()?;
    let tooth = |tooth: &ToothFigures| Tooth {
        number: tooth.number,
        across_mm: -tooth.place_m[1] * 1e3,
        forward_mm: tooth.place_m[0] * 1e3,
        points: Points::over_time(&tooth.course_n),
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
