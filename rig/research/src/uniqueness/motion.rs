//! The inputs of a motion as boxes: the path that the actuators are asked to go, widened to all sides.
//!
//! Between two cycles an actuator goes straight from target to target, as the drives interpolate. The path
//! is the desired one; the width must cover the tracking error.

use masseter_controller::kinematics::uniqueness::{Enclosure, InputBox};
use masseter_model::geometry::Actuators;

use masseter_plan::RunPlan;

/// Boxes that together contain every input within `around_m` (metres) of the motion's path, in each axis.
///
/// # Errors
/// When inverse kinematics has no solution on the path.
pub fn boxes(plan: &RunPlan, around_m: f64) -> anyhow::Result<Vec<InputBox>> {
    let period_s = plan.scenario.period_s();
    let cycles = (plan.trajectory.duration_s() / period_s).ceil() as usize;
    let path = (0..=cycles)
        .map(|cycle| Ok(plan.mechanism.inverse(&plan.trajectory.pose(cycle as f64 * period_s))?.actuators))
        .collect::<anyhow::Result<Vec<_>>>()?;
    Ok(stretches(&path, around_m).map(|stretch| widened(stretch, around_m)).collect())
}

/// The path cut where a stretch of it would be wider than what it is widened by. Each begins with the end of the one
/// before, so that nothing between them is left out.
fn stretches(path: &[Actuators], longest_m: f64) -> impl Iterator<Item = InputBox> {
    let mut rest = path;
    std::iter::from_fn(move || {
        let [first, ref others @ ..] = *rest else { return None };
        let mut stretch = point(&first);
        let mut taken = 0;
        for input in others {
            let longer = hull(&stretch, &point(input));
            let is_too_long = longer.axes().iter().any(|axis| axis.width() > longest_m);
            if is_too_long && taken > 0 {
                break;
            }
            stretch = longer;
            taken += 1;
        }
        rest = if taken == others.len() { &[] } else { &rest[taken..] };
        Some(stretch)
    })
}

fn point(input: &Actuators) -> InputBox {
    InputBox { slide_m: input.slide_m.map(Enclosure::point), leg_m: input.leg_m.map(Enclosure::point) }
}

fn hull(a: &InputBox, b: &InputBox) -> InputBox {
    InputBox {
        slide_m: std::array::from_fn(|leg| a.slide_m[leg].hull(b.slide_m[leg])),
        leg_m: std::array::from_fn(|leg| a.leg_m[leg].hull(b.leg_m[leg])),
    }
}

fn widened(stretch: InputBox, by_m: f64) -> InputBox {
    let wider = |axis: Enclosure| Enclosure::new(axis.low() - by_m, axis.high() + by_m);
    InputBox { slide_m: stretch.slide_m.map(wider), leg_m: stretch.leg_m.map(wider) }
}

#[cfg(test)]
mod tests {
    use masseter_scenario::Scenario;

    use super::*;

    fn contains(whole: &InputBox, part: &InputBox) -> bool {
        whole
            .axes()
            .iter()
            .zip(part.axes())
            .all(|(whole, part)| whole.low() <= part.low() && part.high() <= whole.high())
    }

    /// Every straight piece of the path, with all that is around it, lies in one box.
    #[test]
    fn the_boxes_of_a_motion_hold_its_path_and_what_is_around_it() {
        let around_m = 1e-3;
        let plan = RunPlan::new(Scenario::default()).unwrap();
        let boxes = boxes(&plan, around_m).unwrap();
        let at = |cycle: u32| {
            let pose = plan.trajectory.pose(f64::from(cycle) * plan.scenario.period_s());
            point(&plan.mechanism.inverse(&pose).unwrap().actuators)
        };
        for cycle in 0..10_000 {
            let piece = widened(hull(&at(cycle), &at(cycle + 1)), 0.999 * around_m);
            assert!(boxes.iter().any(|whole| contains(whole, &piece)), "cycle {cycle}");
        }
        assert!(boxes.len() < 5_000, "{} boxes", boxes.len());
    }

    #[test]
    fn a_path_is_cut_where_it_gets_wide_and_a_long_step_is_a_stretch_of_its_own() {
        let at = |mm: f64| Actuators { slide_m: [mm * 1e-3; 3], leg_m: [0.27; 3] };
        let path = [0.0, 0.4, 0.8, 1.2, 5.0, 5.1].map(at);
        let ends: Vec<_> = stretches(&path, 1e-3)
            .map(|stretch| [stretch.slide_m[0].low() * 1e3, stretch.slide_m[0].high() * 1e3])
            .collect();
        assert_eq!(ends, [[0.0, 0.8], [0.8, 1.2], [1.2, 5.0], [5.0, 5.1]]);
        assert_eq!(stretches(&path[..1], 1e-3).count(), 1);
        assert_eq!(stretches(&[], 1e-3).count(), 0);
    }
}
