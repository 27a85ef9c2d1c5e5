//! `masseter robot restore`: the values from before `configure` back into the drives.

use std::fs;

use anyhow::Context;
use masseter_plant::bringup::Settings;
use masseter_shared::geometry::AXIS_NAMES;
use masseter_terminal::{Exit, Failure, OrFailure};

use super::configure::WriteArgs;
use super::evidence::StepFolder;
use super::ledger;
use super::past::Past;
use super::robot_line::{RobotLine, failed, serials};
use super::step::Step;
use super::writing::{Written, before_file, finish, prove_all, write};

/// Restores, and tells what was changed.
pub(crate) fn restore(args: &WriteArgs) -> Result<Exit, Failure> {
    let scenario = args.robot.scenario().usage()?;
    let (axes, past) = (args.axes(), Past::read(&args.robot.folder).usage()?);
    let mut folder = StepFolder::begin(&args.robot.folder, Step::Restore, &axes, &scenario).usage()?;
    let mut robot = RobotLine::open(scenario, folder.log().usage()?).usage()?;
    ledger::settle(&args.robot.folder, &robot.scenario, &mut robot.line, args.take_over)?;
    let surveys = robot.surveys(&axes).map_err(failed)?;
    let serials = serials(&surveys);
    folder.note_serials(serials);
    let targets: Vec<_> = axes
        .iter()
        .map(|&axis| Ok((axis, before(&past, axis, serials[axis])?)))
        .collect::<anyhow::Result<_>>()
        .usage()?;
    prove_all(&mut robot, &axes, args.take_over)?;
    let mut all: Vec<Written> = Vec::new();
    for (axis, target) in targets {
        let survey = surveys[axis].as_ref().expect("every axis was surveyed");
        all.push(write(&mut robot, &folder, axis, &target, survey, args.store)?);
        if all.last().is_some_and(Written::failed) {
            break;
        }
    }
    finish(&mut robot, folder, all, args.store)
}

/// The values of a drive from before the first `configure` since it was last restored.
fn before(past: &Past, axis: usize, serial: Option<u32>) -> anyhow::Result<Settings> {
    let steps = past.steps().filter(|(_, evidence)| evidence.is_about(axis));
    let steps: Vec<_> = steps.filter(|(_, evidence)| evidence.serials[axis] == serial).collect();
    let is_restored = |(_, evidence): &&&(_, super::evidence::Evidence)| {
        evidence.passed && evidence.step == Step::Restore.to_string()
    };
    let restored = steps.iter().rposition(|step| is_restored(&step)).map_or(0, |place| place + 1);
    let mut files = steps[restored..].iter().map(|(path, _)| path.join(before_file(axis)));
    let file = files.find(|file| file.exists()).with_context(|| {
        format!("{}: configure wrote nothing to this drive, so there is nothing to restore", AXIS_NAMES[axis])
    })?;
    let text = fs::read_to_string(&file)?;
    serde_json::from_str(&text).with_context(|| file.display().to_string())
}
