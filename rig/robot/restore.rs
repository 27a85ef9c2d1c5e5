//! `masseter robot restore`: the values from before `configure` back into the drives.

use std::path::PathBuf;

use anyhow::anyhow;
use masseter_model::geometry::AXIS_NAMES;
use masseter_plant::bringup::Settings;
use masseter_terminal::{Exit, Failure, OrFailure, status};

use super::args::WriteArgs;
use super::before::{self, before_file};
use super::evidence::{Evidence, StepFolder};
use super::identity::{Identity, Known, NOT_ASKED};
use super::ledger;
use super::past::Past;
use super::robot_line::{RobotLine, failed};
use super::step::Step;
use super::writing::{is_stored, write_all};

/// Restores, and tells what was changed.
pub(crate) fn restore(args: &WriteArgs) -> Result<Exit, Failure> {
    let scenario = args.robot.scenario().usage()?;
    let (axes, past) = (args.axes(), Past::read(&args.robot.folder).usage()?);
    let mut folder = StepFolder::begin(&args.robot.folder, Step::Restore, &axes, &scenario).usage()?;
    let mut robot = RobotLine::open(scenario, folder.log().usage()?).usage()?;
    ledger::settle(&args.robot.folder, &robot.scenario, &mut robot.line, args.take_over)?;
    let boot_ups = robot.listen().map_err(failed)?;
    let mut drives = NOT_ASKED;
    for &axis in &axes {
        let identity = Identity::read(&mut robot.line, &robot.scenario.can, axis).map_err(failed)?;
        drives[axis] = Known::Is(identity);
    }
    folder.note_drives(drives);
    let mut targets = Vec::new();
    for &axis in &axes {
        match old_values(&past, axis, drives[axis]).usage()? {
            Some(target) => targets.push((axis, target)),
            // A configuration that failed has not reached the drives after the failed one.
            None => status!("{}: configure wrote nothing to this drive", AXIS_NAMES[axis]),
        }
    }
    if targets.is_empty() {
        return Err(anyhow!("there is nothing to restore")).usage();
    }
    let surveys = robot.surveys(&targets, boot_ups).map_err(failed)?;
    write_all(&mut robot, folder, &targets, (&surveys, boot_ups), args)
}

/// The values of a drive from before the first `configure` since they were last restored for good; none where `configure` has not
/// begun with it. Values that were restored without `--store` last until a reset.
fn old_values(past: &Past, axis: usize, drive: Known) -> anyhow::Result<Option<Settings>> {
    past.check_old_values(axis)?;
    let steps = past.steps().filter(|(_, evidence)| evidence.is_about(axis));
    let steps: Vec<_> = steps.filter(|(_, evidence)| evidence.drives[axis] == drive).collect();
    let is_restored = |(_, evidence): &&(PathBuf, Evidence)| {
        evidence.passed && evidence.step == Step::Restore.to_string() && is_stored(evidence, axis)
    };
    let restored = steps.iter().rposition(is_restored).map_or(0, |place| place + 1);
    let mut files = steps[restored..].iter().map(|(path, _)| path.join(before_file(axis)));
    Ok(files.find(|file| file.exists()).map(|file| before::read(&file)).transpose()?)
}
