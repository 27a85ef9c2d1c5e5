//! Values of the scenario with which a recorded motion fits, tried before they are suggested.

use masseter_controller::trajectory::Trajectory;
use masseter_model::geometry::Mechanism;
use masseter_plan::best_placement;
use masseter_scenario::{MotionConfig, Scenario};
use serde::Serialize;

use super::strokes::{Strokes, judge, strokes};

/// With less left of a stroke another place is suggested, mm: the trim and a slow stop need some.
const TIGHT_MM: f64 = 1.0;

/// Keys of the scenario.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Suggestion {
    /// `motion.axes`; none where the stated ones are likely.
    pub axes: Option<[String; 3]>,
    /// `jaw.closed_offset_m`; none where the stated one is good.
    pub closed_offset_m: Option<[f64; 3]>,
    /// What is then left of the strokes; negative where the motion is too large.
    pub strokes: Option<Strokes>,
    /// Why the rig would not play the motion even then.
    pub refused: Option<String>,
}

/// What to change; nothing where the motion fits as it is.
pub(super) fn suggest(
    scenario: &Scenario,
    mechanism: &Mechanism,
    axes: Option<&[String; 3]>,
    now: Option<&Strokes>,
) -> Option<Suggestion> {
    let mut changed = scenario.clone();
    if let (Some(axes), MotionConfig::File(file)) = (axes, &mut changed.motion) {
        file.axes.clone_from(axes);
    }
    let fits = |judged: Option<&Strokes>| judged.is_some_and(|strokes| strokes.margin_mm >= TIGHT_MM);
    let turned = if axes.is_none() { now.copied() } else { judged(&changed, mechanism).ok() };
    if axes.is_none() && fits(now) {
        return None;
    }
    let offset_m = if fits(turned.as_ref()) { None } else { better_offset(&changed, mechanism) };
    if let Some(offset_m) = offset_m {
        changed.jaw.closed_offset_m = offset_m;
    }
    let judged = judged(&changed, mechanism);
    if axes.is_none() && offset_m.is_none() {
        return None;
    }
    let (strokes, refused) = match judged {
        Ok(strokes) => (Some(strokes), None),
        Err(reason) => (None, Some(reason)),
    };
    Some(Suggestion { axes: axes.cloned(), closed_offset_m: offset_m, strokes, refused })
}

fn judged(scenario: &Scenario, mechanism: &Mechanism) -> Result<Strokes, String> {
    let judged = judge(scenario, mechanism).map_err(|error| error.to_string());
    judged.map(|(_, report)| strokes(&report, mechanism))
}

/// The offset with the most left of every stroke, to half a millimetre; none where there is no better one.
fn better_offset(scenario: &Scenario, mechanism: &Mechanism) -> Option<[f64; 3]> {
    let jaw = &scenario.jaw;
    let trajectory = Trajectory::new(&scenario.motion, jaw, mechanism, scenario.duration_s).ok()?;
    let best = best_placement(&trajectory, mechanism)?;
    if best.shift_m.iter().all(|shift_m| shift_m.abs() < 1e-9) {
        return None;
    }
    let at = |axis: usize| ((jaw.closed_offset_m[axis] + best.shift_m[axis]) * 1e4).round() / 1e4;
    Some(std::array::from_fn(at))
}
