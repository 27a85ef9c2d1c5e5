//! Whether a drive has lost its power since its homing: a number in an object that the drive forgets without power.
//!
//! The object is the profile velocity (6081h). Only jog, the proof of the watchdogs and home use it, and each takes the mark
//! out first. Home leaves a new one. Drives whose encoder keeps its position need no mark.

use anyhow::Context;
use masseter_can::canopen::ObjectAddress;
use masseter_commissioning::{Line, LineError};
use masseter_model::geometry::{AXES, AXIS_NAMES};
use masseter_runtime::clock;
use masseter_scenario::{DriveProfile, ObjectConfig, ObjectKey, ObjectRule, Scenario};
use masseter_terminal::{Failure, status};
use serde::{Deserialize, Serialize};

use super::evidence::{Evidence, Past};
use super::robot_line::{failed, prove_off};
use super::step::Step;

/// The profile velocity.
const MARKED: ObjectAddress = ObjectAddress::new(0x6081, 0);
/// A mark is below the velocity by this much at most.
const FURTHEST: u32 = 100_000;

/// The mark of a drive.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Mark {
    /// The velocity without it.
    before: u32,
    /// The velocity that is the mark.
    value: u32,
}

/// The mark of each drive; none where the drive needs none, or its profile leaves no room for one.
pub(super) type Marks = [Option<Mark>; AXES];

/// Why a drive does not prove that it has kept its position.
#[derive(Debug, thiserror::Error)]
pub(super) enum MarkError {
    /// No lower velocity is left.
    #[error(
        "{}: 6081h is {found}, so that no mark fits below it; store a higher profile velocity in the drive",
        AXIS_NAMES[*axis]
    )]
    NoRoom { axis: usize, found: u32 },
    /// The drive does not keep the mark.
    #[error(
        "{}: 6081h shows {found} after {value} was written; a drive that takes no mark needs the rule 'absent' for \
         6081h",
        AXIS_NAMES[*axis]
    )]
    NotTaken { axis: usize, value: u32, found: u32 },
    /// The evidence has none.
    #[error(
        "{}: the step of {since} left no mark in the drive; home the axis and check the pose again",
        AXIS_NAMES[*axis]
    )]
    Missing { axis: usize, since: String },
    /// The drive has another value.
    #[error(
        "{}: the drive was without power, reset or jogged since {since} (6081h is {found}, the mark is \
         {value}); home the axis and check the pose again",
        AXIS_NAMES[*axis]
    )]
    Lost { axis: usize, since: String, found: u32, value: u32 },
    /// The line.
    #[error(transparent)]
    Line(#[from] LineError),
}

/// The part of home's result for one axis that matters here.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Homed {
    pub(super) axis: String,
    pub(super) mark: Option<Mark>,
}

/// Whether a drive needs a mark and has room for one. Warns of a drive without room.
fn needs_mark(profile: &DriveProfile, axis: usize) -> bool {
    let ObjectConfig { rule, value, .. } = profile.object(ObjectKey(MARKED));
    let is_free = matches!(rule, ObjectRule::Write | ObjectRule::Optional) && value.is_none();
    if !profile.homing.absolute && !is_free {
        status!(
            "warning: {}: the profile uses 6081h, so that nothing shows whether the drive lost its power since home",
            AXIS_NAMES[axis]
        );
    }
    !profile.homing.absolute && is_free
}

/// Leaves a mark in a drive that loses its position without power: a velocity below the present one. Another start
/// does not have it.
pub(super) fn leave_mark(
    scenario: &Scenario,
    line: &mut Line,
    axis: usize,
) -> Result<Option<Mark>, MarkError> {
    if !needs_mark(scenario.profile(axis), axis) {
        return Ok(None);
    }
    let before = line.read_number(axis, MARKED)?;
    if before < 2 {
        return Err(MarkError::NoRoom { axis, found: before });
    }
    let value = before - 1 - clock::wall_time().subsec_micros() % (before - 1).min(FURTHEST);
    match line.write(axis, MARKED, value, 4) {
        Err(LineError::NotKept { found: Some(found), .. }) => Err(MarkError::NotTaken { axis, value, found }),
        written => Ok(written.map(|()| Some(Mark { before, value }))?),
    }
}

/// Writes the velocity from before its mark into a drive that still has the mark of a homing.
pub(super) fn remove_mark(
    past: &Past,
    scenario: &Scenario,
    line: &mut Line,
    axis: usize,
) -> Result<(), Failure> {
    let homings = past.steps.iter().filter(|evidence| evidence.step == Step::Home);
    let marks: Vec<_> = homings.filter_map(|homed| mark_of_home(homed, axis).ok().flatten()).collect();
    if marks.is_empty() {
        return Ok(());
    }
    let found = line.read_number(axis, MARKED).map_err(failed)?;
    let Some(mark) = marks.iter().rev().find(|mark| mark.value == found) else { return Ok(()) };
    prove_off(line, scenario, axis, false)?;
    line.write(axis, MARKED, mark.before, 4).map_err(failed)
}

/// The mark that a homing left in the drive of an axis.
pub(super) fn mark_of_home(homed: &Evidence, axis: usize) -> anyhow::Result<Option<Mark>> {
    let all: Vec<Homed> = homed
        .result_as()
        .with_context(|| format!("the result of home at {} cannot be read; home again", homed.started))?;
    Ok(all.into_iter().find(|of_axis| of_axis.axis == AXIS_NAMES[axis]).and_then(|of_axis| of_axis.mark))
}

/// The marks that a pose check found.
pub(super) fn marks_of_pose_check(checked: &Evidence) -> anyhow::Result<Marks> {
    Marks::deserialize(&checked.result["marks"]).with_context(|| {
        format!("the marks of the pose check at {} cannot be read; check it again", checked.started)
    })
}

/// Refuses drives without their marks.
pub(super) fn check_marks(
    scenario: &Scenario,
    marks: &Marks,
    since: &str,
    line: &mut Line,
) -> Result<(), MarkError> {
    (0..AXES).try_for_each(|axis| check_mark(scenario, marks[axis], since, line, axis))
}

/// Refuses a drive without its mark.
pub(super) fn check_mark(
    scenario: &Scenario,
    mark: Option<Mark>,
    since: &str,
    line: &mut Line,
    axis: usize,
) -> Result<(), MarkError> {
    if !needs_mark(scenario.profile(axis), axis) {
        return Ok(());
    }
    let since = since.to_owned();
    let Some(Mark { value, .. }) = mark else { return Err(MarkError::Missing { axis, since }) };
    let found = line.read_number(axis, MARKED)?;
    if found == value { Ok(()) } else { Err(MarkError::Lost { axis, since, found, value }) }
}

#[cfg(test)]
mod tests {
    use std::{io, path::Path};

    use masseter_commissioning::{JogOrder, Wish, jog, reset};
    use serde_json::{Value, json};

    use super::super::evidence::StepFolder;
    use super::*;

    const L2: usize = 4;

    /// Emulated drives, of which l1 and l2 forget their position.
    fn robot(more: &str) -> (Scenario, Line) {
        let text = format!(
            "[[drive_profile]]\naxes = ['l1', 'l2']\nhoming = {{ absolute = false, home_position_m = 0.29 }}\n{more}"
        );
        let scenario = Scenario::parse(Path::new("robot.toml"), &text).unwrap();
        let mut line = Line::open(&scenario, Box::new(io::sink())).unwrap();
        line.listen(100_000_000).unwrap();
        (scenario, line)
    }

    fn leave_all(scenario: &Scenario, line: &mut Line) -> Marks {
        std::array::from_fn(|axis| leave_mark(scenario, line, axis).unwrap())
    }

    fn velocity(line: &mut Line) -> u32 {
        line.read_number(L2, MARKED).unwrap()
    }

    /// Evidence of a step with that result.
    fn evidence(folder: &Path, step: Step, result: &Value) -> Past {
        let begun = StepFolder::begin(folder, step, &step.axes(), &Scenario::default()).unwrap();
        begun.finish_step(true, result).unwrap();
        Past::read(folder).unwrap()
    }

    #[test]
    fn a_drive_that_was_reset_since_its_mark_is_refused() {
        let (scenario, mut line) = robot("");
        let marks = leave_all(&scenario, &mut line);
        assert_eq!(marks.map(|mark| mark.is_some()), [false, false, false, true, true, false]);
        check_marks(&scenario, &marks, "today", &mut line).unwrap();
        reset(&mut line, L2).unwrap();
        let refusal = check_marks(&scenario, &marks, "today", &mut line).unwrap_err().to_string();
        assert!(
            refusal.starts_with("l2: the drive was without power, reset or jogged since today"),
            "{refusal}"
        );
    }

    #[test]
    fn a_missing_mark_is_none_that_a_drive_has() {
        let (scenario, mut line) = robot("");
        let missing = check_marks(&scenario, &Marks::default(), "today", &mut line).unwrap_err();
        assert!(matches!(missing, MarkError::Missing { axis: 3, .. }), "{missing}");
        let (scenario, mut line) = robot("objects.6081h = { rule = 'absent' }");
        assert_eq!(leave_all(&scenario, &mut line), Marks::default());
        check_marks(&scenario, &Marks::default(), "today", &mut line).unwrap();
        let folder = tempfile::tempdir().unwrap();
        for result in [json!({}), json!({ "marks": [7, 7, 7, 7, 7, 7] }), json!({ "marks": [] })] {
            let past = evidence(folder.path(), Step::CheckPose, &result);
            let checked = past.newest(Step::CheckPose, 0).unwrap();
            assert!(marks_of_pose_check(checked).is_err(), "{result}");
        }
    }

    #[test]
    fn a_drive_that_takes_no_mark_is_refused() {
        let (scenario, mut line) = robot("");
        line.write(L2, MARKED, 1, 4).unwrap();
        assert!(matches!(
            leave_mark(&scenario, &mut line, L2),
            Err(MarkError::NoRoom { axis: L2, found: 1 })
        ));
    }

    /// A restart in the middle of a jog: what the jog writes back is no mark.
    #[test]
    fn a_jog_writes_no_mark_back_and_marks_do_not_lower_the_velocity() {
        let (scenario, mut line) = robot("");
        let (folder, delivered) = (tempfile::tempdir().unwrap(), velocity(&mut line));
        for _ in 0..2 {
            let mark = leave_mark(&scenario, &mut line, L2).unwrap();
            assert_eq!(mark.unwrap().before, delivered);
            let past = evidence(folder.path(), Step::Home, &json!([{ "axis": "l2", "mark": mark }]));
            let homed = past.newest(Step::Home, L2).unwrap();
            assert_eq!(mark_of_home(homed, L2).unwrap(), mark);
            assert_ne!(velocity(&mut line), delivered);
            remove_mark(&past, &scenario, &mut line, L2).unwrap();
            let order = JogOrder::usual(&scenario, L2, 1e-3);
            jog(&mut line, &scenario, &order, &mut |_| Wish::Move).unwrap();
            assert_eq!(velocity(&mut line), delivered);
            assert!(check_mark(&scenario, mark, "today", &mut line, L2).is_err());
        }
    }
}
