//! The jaw for researchers: paths of its points, course, velocities, and cycles.
//!
//! `jaw.js` takes the poses from the data of the 3-D view, and the cycles from here.

use masseter_analysis::{CoursePoint, Figures, JawCycleFigures, Statistic};
use masseter_page::{Block, Content, Section};
use masseter_scenario::Scenario;
use serde::Serialize;

use super::animation;

/// Values of a course to a thousandth: a micrometre, a millinewton.
const DIGITS: f64 = 1e3;

#[derive(Serialize)]
struct Cycles<'a> {
    statistics: Vec<Quantity>,
    rows: &'a [masseter_analysis::JawCycle],
    /// Of each point: opening, lateral, mm, force, N, then their standard deviations.
    mean: Vec<[f64; 6]>,
    /// Opening, lateral and force of each point of a cycle, one after the other.
    courses: Vec<Vec<f64>>,
    has_force: bool,
    count: u64,
}

/// A row of the table of statistics.
#[derive(Serialize)]
struct Quantity {
    name: &'static str,
    unit: &'static str,
    decimals: u32,
    #[serde(flatten)]
    statistic: Statistic,
}

/// None without a motion.
pub(super) fn section(scenario: &Scenario, figures: &Figures) -> Option<Section> {
    animation::data(scenario, figures)?;
    let data = serde_json::to_value(cycles(&figures.jaw_cycles)).ok()?;
    Some(Section::new("jaw", "Jaw", vec![Block::new("jaw", Content::Jaw(data))]))
}

fn cycles(found: &JawCycleFigures) -> Cycles<'_> {
    let rounded = |value: f64| (value * DIGITS).round() / DIGITS;
    let values = |point: &CoursePoint| [point.opening_mm, point.lateral_mm, point.force_n].map(rounded);
    let mean_and_sd = |[mean, sd]: &[CoursePoint; 2]| {
        let ([a, b, c], [d, e, f]) = (values(mean), values(sd));
        [a, b, c, d, e, f]
    };
    Cycles {
        statistics: statistics(found),
        rows: &found.cycles,
        mean: found.mean_course.iter().map(mean_and_sd).collect(),
        courses: found.courses.iter().map(|course| course.iter().flat_map(values).collect()).collect(),
        has_force: found.force_n.count > 0,
        count: found.count,
    }
}

fn statistics(found: &JawCycleFigures) -> Vec<Quantity> {
    let quantity = |name, unit, decimals, statistic| Quantity { name, unit, decimals, statistic };
    let all = [
        quantity("duration, opening to opening", "s", 3, found.duration_s),
        quantity("duration of the opening", "s", 3, found.opening_s),
        quantity("duration of the closing", "s", 3, found.closing_s),
        quantity("opening", "mm", 2, found.opening_mm),
        quantity("lateral width", "mm", 2, found.lateral_mm),
        quantity("peak opening velocity", "mm/s", 1, found.opening_mm_s),
        quantity("peak closing velocity", "mm/s", 1, found.closing_mm_s),
        quantity("peak bite force", "N", 1, found.force_n),
    ];
    all.into_iter().filter(|quantity| quantity.statistic.count > 0).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantities_without_a_value_have_no_row() {
        let one = Statistic { count: 1, mean: Some(18.0), sd: None };
        let found = JawCycleFigures { count: 1, opening_mm: one, ..JawCycleFigures::default() };
        let cycles = cycles(&found);
        let names: Vec<_> = cycles.statistics.iter().map(|quantity| quantity.name).collect();
        assert_eq!((names, cycles.has_force), (vec!["opening"], false));
    }
}
