//! `masseter robot restore`: the values from before `configure` back into the drives.

use anyhow::anyhow;
use masseter_plant::bringup::Settings;
use masseter_shared::geometry::AXIS_NAMES;
use masseter_terminal::{Exit, Failure, OrFailure, status};

use super::before::{self, Damaged, before_file};
use super::configure::WriteArgs;
use super::evidence::StepFolder;
use super::ledger;
use super::past::Past;
use super::robot_line::{RobotLine, failed, serials};
use super::step::Step;
use super::writing::{Written, finish, prove_all, write};

/// Restores, and tells what was changed.
pub(crate) fn restore(args: &WriteArgs) -> Result<Exit, Failure> {
    let scenario = args.robot.scenario().usage()?;
    let (axes, past) = (args.axes(), Past::read(&args.robot.folder).usage()?);
    let mut folder = StepFolder::begin(&args.robot.folder, Step::Restore, &axes, &scenario).usage()?;
    let mut robot = RobotLine::open(scenario, folder.log().usage()?).usage()?;
    ledger::settle(&args.robot.folder, &robot.scenario, &mut robot.line, args.take_over)?;
    let (surveys, boot_ups) = robot.surveys(&axes).map_err(failed)?;
    let serials = serials(&surveys);
    folder.note_serials(serials);
    let mut targets = Vec::new();
    for &axis in &axes {
        match old_values(&past, axis, serials[axis]).usage()? {
            Some(target) => targets.push((axis, target)),
            // A configuration that failed has not reached the drives after the failed one.
            None => status!("{}: configure wrote nothing to this drive", AXIS_NAMES[axis]),
        }
    }
    if targets.is_empty() {
        return Err(anyhow!("there is nothing to restore")).usage();
    }
    prove_all(&mut robot, &axes, args.take_over)?;
    let mut all: Vec<Written> = Vec::new();
    for (axis, target) in targets {
        let survey = surveys[axis].as_ref().expect("every axis was surveyed");
        all.push(write(&mut robot, &folder, axis, &target, (survey, boot_ups), args.store)?);
        if all.last().is_some_and(Written::failed) {
            break;
        }
    }
    finish(&mut robot, folder, all, args.store)
}

/// The values of a drive from before the first `configure` since it was last restored; none where `configure` has not begun with it.
fn old_values(past: &Past, axis: usize, serial: Option<u32>) -> Result<Option<Settings>, Damaged> {
    let steps = past.steps().filter(|(_, evidence)| evidence.is_about(axis));
    let steps: Vec<_> = steps.filter(|(_, evidence)| evidence.serials[axis] == serial).collect();
    let is_restored = |(_, evidence): &&&(_, super::evidence::Evidence)| {
        evidence.passed && evidence.step == Step::Restore.to_string()
    };
    let restored = steps.iter().rposition(|step| is_restored(&step)).map_or(0, |place| place + 1);
    let mut files = steps[restored..].iter().map(|(path, _)| path.join(before_file(axis)));
    files.find(|file| file.exists()).map(|file| before::read(&file)).transpose()
}
