//! Settings into drives, with their old values kept first: the common part of `configure` and `restore`.

use std::fmt::Write;

use anyhow::{Context, ensure};
use masseter_model::geometry::{AXES, AXIS_NAMES};
use masseter_plant::bringup::{
    BootUps, Change, Line, PowerError, Settings, Survey, Writer, prove_no_power, reset, store, take_over,
};
use masseter_scenario::Scenario;
use masseter_scenario::wording::counted;
use masseter_terminal::{Exit, Failure, OrFailure, Tone, result_with_tones};
use serde::Serialize;

use super::args::WriteArgs;
use super::before::before_file;
use super::evidence::{Evidence, StepFolder};
use super::identity::Known;
use super::presence::{check_present, check_undisturbed};
use super::robot_line::{RobotLine, Surveys, failed};

/// What became of one drive.
#[derive(Debug, Serialize)]
struct Written {
    axis: &'static str,
    changes: Vec<Change>,
    stored: bool,
    error: Option<String>,
    /// Number of the axis, and the boot-ups when its turn ended.
    #[serde(skip)]
    end: (usize, BootUps),
}

impl Written {
    /// Notes what has happened to the drive since its turn: values that are not stored may be lost.
    fn judge(&mut self, robot: &mut RobotLine, drives: &[Known; AXES]) {
        let (axis, boot_ups) = self.end;
        if self.error.is_none() {
            let present = check_present(&mut robot.line, &robot.scenario.can, &[axis], boot_ups, drives);
            self.error = present.err().map(|error| error.to_string());
        }
    }
}

/// Whether a drive has stored what this step wrote to it, by the step's result.
pub(super) fn is_stored(evidence: &Evidence, axis: usize) -> bool {
    let all = evidence.result.as_array().into_iter().flatten();
    all.filter(|written| written["axis"] == AXIS_NAMES[axis]).any(|written| written["stored"] == true)
}

/// Proves that none of these drives has power, before anything is written to one of them.
fn prove_all(robot: &mut RobotLine, targets: &[(usize, Settings)], may_stop: bool) -> Result<(), Failure> {
    robot.line.strangers().refuse_masters().context("nothing was written").map_err(failed)?;
    targets.iter().try_for_each(|&(axis, _)| prove_off(&mut robot.line, &robot.scenario, axis, may_stop))
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

/// Writes settings to drives without power, one after the other, up to the first that does not take them; then prints
/// and keeps the result.
pub(super) fn write_all(
    robot: &mut RobotLine,
    folder: StepFolder,
    targets: &[(usize, Settings)],
    (surveys, boot_ups): (&Surveys, BootUps),
    args: &WriteArgs,
) -> Result<Exit, Failure> {
    prove_all(robot, targets, args.take_over)?;
    let mut all: Vec<Written> = Vec::new();
    for (axis, target) in targets {
        let survey = surveys[*axis].as_ref().expect("every axis was surveyed");
        all.push(write(robot, &folder, *axis, target, (survey, boot_ups), args.store)?);
        if all.last().is_some_and(|written| written.error.is_some()) {
            break;
        }
    }
    finish(robot, folder, all, args.store)
}

/// Keeps the old values of a drive in a file, writes the new ones, and reads everything again; stores on request. A drive
/// that does not take them is part of the result.
fn write(
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
    let changes = writer.into_changes();
    let written = match applied {
        Err(error) => Err(error.into()),
        Ok(()) => check(robot, axis, target, "after writing"),
    };
    let written = undisturbed(robot, axis, boot_ups, written);
    let is_written = written.is_ok();
    let done = match written {
        Ok(()) if stores => store_and_check(robot, axis, target, boot_ups),
        written => written,
    };
    let (stored, error) = (is_written && stores && done.is_ok(), done.err().map(|error| error.to_string()));
    let end = (axis, BootUps::until_now(&robot.line));
    Ok(Written { axis: AXIS_NAMES[axis], changes, stored, error, end })
}

/// What was done, unless the drive restarted since then or another master was heard: that is the cause of whatever else failed.
fn undisturbed(
    robot: &RobotLine,
    axis: usize,
    since: BootUps,
    done: anyhow::Result<()>,
) -> anyhow::Result<()> {
    check_undisturbed(&robot.line, &[axis], since)?;
    done
}

/// Stores, resets, and reads everything again. No restart but this reset counts as a proof.
fn store_and_check(
    robot: &mut RobotLine,
    axis: usize,
    target: &Settings,
    before: BootUps,
) -> anyhow::Result<()> {
    let config = robot.scenario.profile(axis).store;
    let stored = store(&mut robot.line, axis, config);
    undisturbed(robot, axis, before, stored.map_err(Into::into))?;
    reset(&mut robot.line, axis)?;
    let after = BootUps::until_now(&robot.line);
    let checked = check(robot, axis, target, "after the reset, so the drive did not store it");
    undisturbed(robot, axis, after, checked)
}

/// Reads everything again; refuses what is not as it was written.
fn check(robot: &mut RobotLine, axis: usize, target: &Settings, when: &str) -> anyhow::Result<()> {
    let survey = robot.whole_survey(axis, target)?;
    // An optional object may keep a value of its own.
    let wrong: Vec<_> = target
        .differences(&survey)
        .into_iter()
        .filter(|difference| !difference.may_stay())
        .map(|difference| difference.object.to_string())
        .collect();
    ensure!(wrong.is_empty(), "{}: {} differ {when}", AXIS_NAMES[axis], wrong.join(", "));
    Ok(())
}

/// Judges all drives once more, prints and keeps the result.
fn finish(
    robot: &mut RobotLine,
    folder: StepFolder,
    mut all: Vec<Written>,
    stores: bool,
) -> Result<Exit, Failure> {
    for written in &mut all {
        written.judge(robot, &folder.basis().drives);
    }
    robot.line.flush().incomplete()?;
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
    let failed = all.iter().any(|written| written.error.is_some());
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
