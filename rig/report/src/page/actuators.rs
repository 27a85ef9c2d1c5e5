//! Positions, velocities and forces of slides and legs, against their limits.

use masseter_analysis::{Curve, Figures};
use masseter_model::geometry::{AXES, AXIS_NAMES, LEGS};
use masseter_page::{Block, Chart, Limit, Points, Section, Series, Style};
use masseter_scenario::Scenario;

use super::charts::{limit, plain};

/// Three axes of one kind.
struct Kind {
    /// In the page's ids.
    id: &'static str,
    name: &'static str,
    /// Place of the first among the axes.
    first: usize,
}

const KINDS: [Kind; 2] =
    [Kind { id: "slides", name: "slides", first: 0 }, Kind { id: "legs", name: "legs", first: LEGS }];

pub(super) fn section(scenario: &Scenario, figures: &Figures) -> Section {
    let over_time = &figures.over_time;
    let strokes = &scenario.mechanism.strokes;
    let drives = [&scenario.drives.slide, &scenario.drives.leg];
    let strokes_mm = [strokes.slide_m, strokes.leg_m].map(|ends_m| ends_m.map(|end_m| end_m * 1e3));
    let each = |build: &dyn Fn(&Kind, usize) -> Block| [build(&KINDS[0], 0), build(&KINDS[1], 1)];
    let positions = each(&|kind, at| {
        let [low, high] = strokes_mm[at];
        let limits = vec![limit("lower end", &[low]), limit("upper end", &[high])];
        let chart = curves(kind, "Position", "mm", &over_time.position_m, limits);
        Block::chart(kind.id, chart).half()
    });
    let velocities = each(&|kind, at| {
        let most = drives[at].max_velocity_m_s * 1e3;
        let chart = curves(kind, "Velocity", "mm/s", &over_time.velocity_m_s, both_ways(most));
        Block::chart(format!("velocity-{}", kind.id), chart).half()
    });
    let forces = each(&|kind, at| {
        let limits = both_ways(drives[at].max_force_n);
        Block::chart(format!("force-{}", kind.id), forces(kind, figures, limits)).half()
    });
    let blocks = positions.into_iter().chain(velocities).chain(forces).collect();
    Section::new("actuators", "Actuators", blocks)
}

fn both_ways(most: f64) -> Vec<Limit> {
    vec![limit("limit", &[most, -most])]
}

fn curves(kind: &Kind, quantity: &str, unit: &str, si: &[Curve; AXES], limits: Vec<Limit>) -> Chart {
    let series = (kind.first..kind.first + LEGS).map(|axis| plain(AXIS_NAMES[axis], &si[axis], 1e3));
    Chart {
        series: series.collect(),
        limits,
        ..Chart::over_time(format!("{quantity} of the {}", kind.name), unit)
    }
}

/// Pale raw forces under their moving means.
fn forces(kind: &Kind, figures: &Figures, limits: Vec<Limit>) -> Chart {
    let over_time = &figures.over_time;
    let axes = || (kind.first..kind.first + LEGS).enumerate();
    let series = |name: String, style: Style, place: usize, curve: &Curve| {
        Series::new(name, style, Points::over_time(curve)).coloured(place)
    };
    let raw = axes().map(|(place, axis)| {
        series(format!("{} raw", AXIS_NAMES[axis]), Style::Raw, place, &over_time.force_n[axis])
    });
    let smooth = axes().map(|(place, axis)| {
        series(AXIS_NAMES[axis].to_owned(), Style::Smoothed, place, &over_time.smooth_force_n[axis])
    });
    Chart {
        series: raw.chain(smooth).collect(),
        limits,
        ..Chart::over_time(format!("Force of the {}, raw and mean of 20 ms", kind.name), "N")
    }
}
