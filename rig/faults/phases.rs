//! The phases of the motion in which the matrix lets faults strike, found from the motion itself.

use masseter_model::geometry::Vec3;
use masseter_plan::RunPlan;

/// Where the search for phases begins and ends: the motion has its speed by then, s.
const SEARCHED_S: [f64; 2] = [1.5, 3.5];
/// Distance of two looks, s.
const STEP_S: f64 = 0.01;

/// A phase: its name and an instant of the motion in its middle, s.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Phase {
    pub(super) name: &'static str,
    pub(super) at_s: f64,
}

/// The instants at which the incisal point opens fastest, closes fastest, and rests longest.
pub(super) fn phases(plan: &RunPlan) -> [Phase; 3] {
    let incisal = Vec3::from(plan.scenario.jaw.reference_point_m);
    let height_m = |at_s: f64| {
        let pose = plan.trajectory.pose(at_s);
        (pose.translation.vector + pose.rotation * incisal).z
    };
    let looks = ((SEARCHED_S[1] - SEARCHED_S[0]) / STEP_S) as usize;
    let speeds: Vec<_> = (0..looks)
        .map(|look| SEARCHED_S[0] + look as f64 * STEP_S)
        .map(|at_s| (at_s, (height_m(at_s + STEP_S) - height_m(at_s)) / STEP_S))
        .collect();
    let extreme = |by: fn(f64) -> f64| {
        speeds
            .iter()
            .min_by(|(_, a), (_, b)| by(*a).total_cmp(&by(*b)))
            .map_or(SEARCHED_S[0], |(at_s, _)| *at_s)
    };
    [
        Phase { name: "opening", at_s: extreme(|speed| speed) },
        Phase { name: "closing", at_s: extreme(|speed| -speed) },
        Phase { name: "rest", at_s: extreme(f64::abs) },
    ]
}
