//! Whether the rig would play a motion, and what the motion leaves of the strokes.

use masseter_controller::trajectory::{Trajectory, TrajectoryError, TrajectoryReport};
use masseter_model::geometry::{AXES, AXIS_NAMES, Mechanism};
use masseter_plan::demands;
use masseter_scenario::Scenario;
use serde::Serialize;

/// The axis that comes nearest to an end of its stroke.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(super) struct Strokes {
    pub axis: &'static str,
    pub margin_mm: f64,
}

/// The motion and its demands, if the rig would play it.
pub(super) fn judge(
    scenario: &Scenario,
    mechanism: &Mechanism,
) -> Result<(Trajectory, TrajectoryReport), TrajectoryError> {
    let trajectory = Trajectory::new(&scenario.motion, &scenario.jaw, mechanism, scenario.duration_s)?;
    let report = demands(scenario, &trajectory, mechanism)?;
    Ok((trajectory, report))
}

pub(super) fn strokes(report: &TrajectoryReport, mechanism: &Mechanism) -> Strokes {
    let margin_m = report.margin_m(mechanism.strokes());
    let axis = (0..AXES).min_by(|&a, &b| margin_m[a].total_cmp(&margin_m[b])).unwrap_or_default();
    Strokes { axis: AXIS_NAMES[axis], margin_mm: margin_m[axis] * 1e3 }
}
