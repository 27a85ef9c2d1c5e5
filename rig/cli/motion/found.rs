//! What the file of a recorded motion holds, whether the rig would play it, and with which keys of the scenario it would.

use masseter_controller::trajectory::Trajectory;
use masseter_judge::{RecordedFigures, RecordedWatch};
use masseter_model::geometry::{AXES, AXIS_NAMES, Mechanism};
use masseter_plan::{best_placement, demands};
use masseter_recorded_motion::{Frame, Frames, RecordingSurvey, TrajectoryError, Unit, survey};
use masseter_scenario::{MotionConfig, Scenario};
use serde::Serialize;

/// With less left of a stroke another place is suggested, mm: the trim and a slow stop need some.
const TIGHT_MM: f64 = 1.0;

/// What the verb finds.
#[derive(Debug, Serialize)]
pub(super) struct Found {
    pub(super) file: std::path::PathBuf,
    #[serde(flatten)]
    pub(super) survey: RecordingSurvey,
    #[serde(flatten)]
    pub(super) judged: Judged,
    /// How far filter and ramps lead the motion from the file's rows; none of a motion that is refused.
    pub(super) recorded: Option<RecordedFigures>,
    /// With the axes that the motion shows; several where they are as likely as each other.
    pub(super) suggestions: Vec<Suggestion>,
    /// The first of them.
    suggestion: Option<Suggestion>,
}

/// Whether the rig would play a motion.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Judged {
    /// What is then left of the strokes; negative where the motion is too large.
    pub(super) strokes: Option<Strokes>,
    /// Why the rig would not play it.
    pub(super) refused: Option<String>,
}

/// The axis that comes nearest to an end of its stroke.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(super) struct Strokes {
    pub(super) axis: &'static str,
    pub(super) margin_mm: f64,
}

/// Keys of the scenario.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Suggestion {
    /// `motion.length_unit` or `motion.time_unit`; none where the stated ones are likely.
    #[serde(flatten)]
    pub(super) unit: Option<Unit>,
    /// `motion.axes`; none where the stated ones are likely.
    pub(super) axes: Option<[String; 3]>,
    /// The motion of the jaw with these axes.
    pub(super) jaw: Option<String>,
    /// `jaw.closed_offset_m`; none where the stated one is good.
    pub(super) closed_offset_m: Option<[f64; 3]>,
    /// Whether the rig would play the motion with them.
    #[serde(flatten)]
    pub(super) judged: Judged,
}

impl Found {
    /// What the file of a scenario's motion holds.
    pub(super) fn new(scenario: &Scenario, path: &std::path::Path) -> anyhow::Result<Self> {
        let MotionConfig::File(file) = &scenario.motion else { anyhow::bail!("the scenario plays no file") };
        let survey = survey(file, &scenario.jaw)?;
        let mechanism = Mechanism::new(&scenario.mechanism)?;
        let judged = Judged::new(scenario, &mechanism);
        let other = survey.frames.iter().filter(|frames| !frames.fits()).flat_map(Frames::likely);
        let mut frames: Vec<Option<&Frame>> = other.map(Some).collect();
        if frames.is_empty() {
            frames.push(None);
        }
        let suggest = |frame| suggest(scenario, &mechanism, survey.likely_unit, frame, &judged);
        let suggestions: Vec<_> = frames.into_iter().filter_map(suggest).collect();
        let suggestion = suggestions.first().cloned();
        let recorded = predicted(scenario, &mechanism);
        Ok(Self { file: path.to_owned(), survey, judged, recorded, suggestions, suggestion })
    }
}

impl Judged {
    fn new(scenario: &Scenario, mechanism: &Mechanism) -> Self {
        match Strokes::left(scenario, mechanism) {
            Ok(strokes) => Self { strokes: Some(strokes), refused: None },
            Err(error) => Self { strokes: None, refused: Some(error.to_string()) },
        }
    }

    fn fits(&self) -> bool {
        self.strokes.is_some_and(|strokes| strokes.margin_mm >= TIGHT_MM)
    }
}

impl Strokes {
    /// What a motion leaves of the strokes, if the rig would play it.
    fn left(scenario: &Scenario, mechanism: &Mechanism) -> Result<Self, TrajectoryError> {
        let trajectory = Trajectory::new(&scenario.motion, &scenario.jaw, mechanism, scenario.duration_s)?;
        let margin_m = demands(scenario, &trajectory, mechanism)?.margin_m(mechanism.strokes());
        let axis = (0..AXES).min_by(|&a, &b| margin_m[a].total_cmp(&margin_m[b])).unwrap_or_default();
        Ok(Self { axis: AXIS_NAMES[axis], margin_mm: margin_m[axis] * 1e3 })
    }
}

/// What to change; nothing where the motion fits as it is. Whatever is suggested was played.
fn suggest(
    scenario: &Scenario,
    mechanism: &Mechanism,
    unit: Option<Unit>,
    frame: Option<&Frame>,
    now: &Judged,
) -> Option<Suggestion> {
    let is_changed = unit.is_some() || frame.is_some();
    if !is_changed && now.fits() {
        return None;
    }
    let mut changed = scenario.clone();
    if let MotionConfig::File(file) = &mut changed.motion {
        if let Some(unit) = unit {
            *file = unit.applied(file);
        }
        if let Some(frame) = frame {
            file.axes.clone_from(&frame.axes);
        }
    }
    let is_enough = is_changed && Judged::new(&changed, mechanism).fits();
    let closed_offset_m = if is_enough { None } else { better_offset(&changed, mechanism) };
    if !is_changed && closed_offset_m.is_none() {
        return None;
    }
    changed.jaw.closed_offset_m = closed_offset_m.unwrap_or(changed.jaw.closed_offset_m);
    let judged = Judged::new(&changed, mechanism);
    let (axes, jaw) = (frame.map(|frame| frame.axes.clone()), frame.map(Frame::words));
    Some(Suggestion { unit, axes, jaw, closed_offset_m, judged })
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

/// The errors that a robot without errors would have: those of filter and ramps.
fn predicted(scenario: &Scenario, mechanism: &Mechanism) -> Option<RecordedFigures> {
    let trajectory = Trajectory::new(&scenario.motion, &scenario.jaw, mechanism, scenario.duration_s).ok()?;
    let cycles = (trajectory.duration_s() / scenario.period_s()) as u32;
    let mut watch = RecordedWatch::new(trajectory.clone(), &scenario.jaw);
    for cycle in 0..=cycles {
        let motion_s = trajectory.motion_time_s(f64::from(cycle) * scenario.period_s());
        watch.add(motion_s, &trajectory.pose_in_motion(motion_s));
    }
    watch.into_figures()
}
