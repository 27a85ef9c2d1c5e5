//! Settings into drives, with their old values kept first: the common part of `configure` and `restore`.

use std::fmt::Write;

use masseter_plant::bringup::{
    BootUps, Change, Line, PowerError, Settings, Survey, Writer, prove_no_power, reset, store, take_over,
};
use masseter_shared::config::{ObjectRule, Scenario};
use masseter_shared::geometry::AXIS_NAMES;
use masseter_shared::wording::counted;
use masseter_terminal::{Exit, Failure, OrFailure, Tone, result_with_tones};
use serde::Serialize;

use super::before::before_file;
use super::evidence::StepFolder;
use super::robot_line::{RobotLine, failed};

/// What became of one drive.
#[derive(Debug, Serialize)]
pub(super) struct Written {
    axis: &'static str,
    changes: Vec<Change>,
    stored: bool,
    error: Option<String>,
    /// Number of the axis, and the boot-ups when its turn ended.
    #[serde(skip)]
    turn: (usize, BootUps),
}

impl Written {
    /// Whether the drive does not have its settings.
    pub(super) fn failed(&self) -> bool {
        self.error.is_some()
    }

    /// Notes a restart since the drive's turn: values that are not stored are lost.
    fn note_restart(&mut self, line: &Line) {
        let (axis, boot_ups) = self.turn;
        if self.error.is_none() {
            self.error = boot_ups.check_axis(line, axis).err().map(|error| error.to_string());
        }
    }
}

/// Proves that none of these drives has power, before anything is written to one of them.
pub(super) fn prove_all(robot: &mut RobotLine, axes: &[usize], may_stop: bool) -> Result<(), Failure> {
    robot.refuse_masters().map_err(failed)?;
    axes.iter().try_for_each(|&axis| prove_off(&mut robot.line, &robot.scenario, axis, may_stop))
}

/// Proves that a drive has no power; one that has is stopped first if that is allowed.
pub(super) fn prove_off(
    line: &mut Line,
    scenario: &Scenario,
    axis: usize,
    may_stop: bool,
) -> Result<(), Failure> {
    let noise = scenario.scale(axis).window(scenario.profile(axis).homing.tolerance_m);
    match prove_no_power(line, axis, noise) {
        Err(PowerError::Powered { .. }) if may_stop => {
            take_over(line, axis, noise).map_err(failed)?;
            // A drive that the rig could not stop is the case of an emergency stop.
            let proved = prove_no_power(line, axis, noise);
            proved.map_err(|error| Failure::with(Exit::SafeStop, error))
        }
        proved => proved.map_err(failed),
    }
}

/// Keeps the old values of a drive in a file, writes the new ones, and reads everything again; stores on request. A drive
/// that does not take them is part of the result.
pub(super) fn write(
    robot: &mut RobotLine,
    folder: &StepFolder,
    axis: usize,
    target: &Settings,
    (survey, boot_ups): (&Survey, BootUps),
    stores: bool,
) -> Result<Written, Failure> {
    let before = serde_json::to_string_pretty(&target.found(survey)).incomplete()?;
    folder.keep(&before_file(axis), &(before + "\n")).incomplete()?;
    let profile = robot.scenario.profile(axis).clone();
    let mut writer = Writer::new(&mut robot.line, axis, &profile);
    let applied = writer.apply(target, survey);
    let (changes, mut stored) = (writer.into_changes(), false);
    let error = match applied {
        Err(error) => Some(error.to_string()),
        Ok(()) => check(robot, axis, target, "after writing").usage()?,
    };
    // What was read back before a restart is lost.
    let error = error.or_else(|| no_restart(robot, axis, boot_ups));
    let error = match error {
        None if stores => {
            let error = store_and_check(robot, axis, target, boot_ups).usage()?;
            stored = error.is_none();
            error
        }
        error => error,
    };
    let turn = (axis, BootUps::until_now(&robot.line));
    Ok(Written { axis: AXIS_NAMES[axis], changes, stored, error, turn })
}

/// The restart of a drive since then, if so.
fn no_restart(robot: &RobotLine, axis: usize, since: BootUps) -> Option<String> {
    since.check_axis(&robot.line, axis).err().map(|error| error.to_string())
}

/// Stores, resets, and reads everything again. No restart but this reset counts as a proof.
fn store_and_check(
    robot: &mut RobotLine,
    axis: usize,
    target: &Settings,
    before: BootUps,
) -> anyhow::Result<Option<String>> {
    let config = robot.scenario.profile(axis).store;
    if let Err(error) = store(&mut robot.line, axis, config) {
        return Ok(Some(error.to_string()));
    }
    if let Some(error) = no_restart(robot, axis, before) {
        return Ok(Some(error));
    }
    if let Err(error) = reset(&mut robot.line, axis) {
        return Ok(Some(error.to_string()));
    }
    let after = BootUps::until_now(&robot.line);
    let wrong = check(robot, axis, target, "after the reset, so the drive did not store it")?;
    Ok(wrong.or_else(|| no_restart(robot, axis, after)))
}

/// Reads everything again; returns what is not as it was written.
fn check(
    robot: &mut RobotLine,
    axis: usize,
    target: &Settings,
    when: &str,
) -> anyhow::Result<Option<String>> {
    let survey = robot.survey(axis)?;
    // An optional object may keep a value of its own.
    let wrong: Vec<_> = target
        .differences(&survey)
        .into_iter()
        .filter(|difference| difference.rule != ObjectRule::Optional)
        .map(|difference| difference.object.to_string())
        .collect();
    Ok((!wrong.is_empty()).then(|| format!("{}: {} differ {when}", AXIS_NAMES[axis], wrong.join(", "))))
}

/// Prints and keeps the result.
pub(super) fn finish(
    robot: &mut RobotLine,
    folder: StepFolder,
    mut all: Vec<Written>,
    stores: bool,
) -> Result<Exit, Failure> {
    robot.line.flush().incomplete()?;
    for written in &mut all {
        written.note_restart(&robot.line);
    }
    let mut text = String::new();
    for Written { axis, changes, stored, error, .. } in &all {
        let count = counted(changes.len() as u64, "value");
        let _ = writeln!(text, "{axis}: {count} written{}", if *stored { ", stored" } else { "" });
        for Change { object, name, before, after } in changes {
            let before = before.as_deref().unwrap_or("unreadable");
            let _ = writeln!(text, "  {object} {name}: {before} -> {after}");
        }
        if let Some(error) = error {
            let _ = writeln!(text, "failed: {error}");
        }
    }
    let failed = all.iter().any(Written::failed);
    let _ = match (failed, stores) {
        (true, _) => writeln!(
            text,
            "drives without a line here were not written; 'masseter robot restore' writes the old values back"
        ),
        (false, true) => writeln!(text, "passed: the values are stored"),
        (false, false) => writeln!(text, "passed: the values last until a reset; --store keeps them"),
    };
    folder.finish(!failed, &all).incomplete()?;
    result_with_tones(&text, &[("passed", Tone::Good), ("failed", Tone::Bad)]).usage()?;
    Ok(if failed { Exit::Failed } else { Exit::Passed })
}
