//! Where the closed jaw must be so that a motion fits the strokes.
//!
//! The motion is moved as a whole, without a turn, to where the axis that comes nearest to an end of its stroke is furthest
//! from it. Strokes alone count here: speeds and conditioning are those of [`demands`](crate::demands).

use masseter_controller::trajectory::Trajectory;
use masseter_model::geometry::{AXES, AXIS_NAMES, Mechanism, Pose, Vec3};

/// Poses of the motion that are looked at.
const POSES: u32 = 1000;
/// First and last step of the search, m.
const FIRST_M: f64 = 0.016;
const LAST_M: f64 = 0.0005;

/// A place of the closed jaw.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Placement {
    /// Shift from the place that the trajectory has now, base frame, m.
    pub shift_m: [f64; 3],
    /// What the axis nearest to the end of its stroke has left, m; negative where it is beyond.
    pub margin_m: f64,
    /// That axis.
    pub axis: &'static str,
}

impl Placement {
    /// By the rest of the stroke, to the micrometre; of two alike the shorter shift is greater.
    fn compare(&self, other: &Self) -> std::cmp::Ordering {
        let length_m = |placement: &Self| Vec3::from(placement.shift_m).norm();
        self.microns().total_cmp(&other.microns()).then(length_m(other).total_cmp(&length_m(self)))
    }

    fn microns(&self) -> f64 {
        (self.margin_m * 1e6).round()
    }
}

/// The best place of the closed jaw for a motion: `None` if no shift lets every leg reach it. A search in steps down to
/// 0.5 mm, from where the motion is.
///
/// ```
/// use masseter_plan::{RunPlan, best_placement};
/// use masseter_scenario::Scenario;
///
/// let plan = RunPlan::new(Scenario::default())?;
/// let now_m = plan.demands.margin_m(plan.mechanism.strokes()).into_iter().fold(f64::INFINITY, f64::min);
/// let best = best_placement(&plan.trajectory, &plan.mechanism).expect("chewing fits");
/// assert!(best.margin_m > now_m);
/// # Ok::<(), anyhow::Error>(())
/// ```
pub fn best_placement(trajectory: &Trajectory, mechanism: &Mechanism) -> Option<Placement> {
    let time_s = |pose: u32| trajectory.duration_s() * f64::from(pose) / f64::from(POSES);
    let poses: Vec<Pose> = (0..=POSES).map(|pose| trajectory.pose(time_s(pose))).collect();
    let place = |shift: Vec3| placement(&poses, mechanism, shift);
    let mut best = place(Vec3::zeros());
    let mut step_m = FIRST_M;
    while step_m >= LAST_M {
        let from = best.map_or_else(Vec3::zeros, |best| Vec3::from(best.shift_m));
        let around = neighbours().filter_map(|direction| place(from + direction * step_m));
        match around.max_by(Placement::compare) {
            Some(better) if best.is_none_or(|best| better.microns() > best.microns()) => best = Some(better),
            _ => step_m /= 2.0,
        }
    }
    best
}

/// The directions to the 26 neighbours in a cubic grid.
fn neighbours() -> impl Iterator<Item = Vec3> {
    let coordinate = |index: i32, place: u32| f64::from(index / 3_i32.pow(place) % 3 - 1);
    let all =
        (0..27).map(move |index| Vec3::new(coordinate(index, 0), coordinate(index, 1), coordinate(index, 2)));
    all.filter(|direction| *direction != Vec3::zeros())
}

fn placement(poses: &[Pose], mechanism: &Mechanism, shift: Vec3) -> Option<Placement> {
    let mut least = Placement { shift_m: shift.into(), margin_m: f64::INFINITY, axis: AXIS_NAMES[0] };
    for pose in poses {
        let axes_m = mechanism.actuators(&(nalgebra::Translation3::from(shift) * pose)).ok()?.to_axes();
        for axis in 0..AXES {
            let [lowest_m, highest_m] = mechanism.strokes().of_axis(axis);
            let margin_m = (axes_m[axis] - lowest_m).min(highest_m - axes_m[axis]);
            if margin_m < least.margin_m {
                (least.margin_m, least.axis) = (margin_m, AXIS_NAMES[axis]);
            }
        }
    }
    Some(least)
}

#[cfg(test)]
mod tests {
    use masseter_scenario::Scenario;

    use super::*;

    #[test]
    fn a_symmetric_motion_is_not_shifted_aside() {
        let mut scenario = Scenario::default().with("motion.kind=opening").unwrap();
        scenario.jaw.closed_offset_m = [0.01, 0.0, 0.0];
        let mechanism = Mechanism::new(&scenario.mechanism).unwrap();
        let trajectory = Trajectory::new(&scenario.motion, &scenario.jaw, &mechanism, None).unwrap();
        let best = best_placement(&trajectory, &mechanism).unwrap();
        assert!(best.shift_m[1] == 0.0 && best.margin_m > 0.002, "{best:?}");
    }
}
