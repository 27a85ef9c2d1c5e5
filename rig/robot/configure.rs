//! `masseter robot configure`: the rig's objects into drives without power.
//!
//! All drives are read and judged before the first one is written. The drive that refuses a value ends the step: the
//! drives after it are not touched, and no drive ever gets power.

use masseter_plant::bringup::{Deviation, Outcome, Settings};
use masseter_scenario::wording::counted;
use masseter_terminal::{Exit, Failure, OrFailure, result};

use super::args::WriteArgs;
use super::evidence::{Basis, StepFolder};
use super::identity::NOT_ASKED;
use super::ledger;
use super::past::Past;
use super::robot_line::{RobotLine, Surveys, drives, failed};
use super::step::Step;
use super::table::table;
use super::writing::write_all;

/// Configures, and tells what was changed.
pub(crate) fn configure(args: &WriteArgs) -> Result<Exit, Failure> {
    let scenario = args.robot.scenario().usage()?;
    let (axes, past) = (args.axes(), Past::read(&args.robot.folder).usage()?);
    // A refused step makes no folder: it would replace the evidence of the same step from before.
    past.require(Step::Inspect, &axes, &Basis::new(&scenario, NOT_ASKED)).usage()?;
    let mut folder = StepFolder::begin(&args.robot.folder, Step::Configure, &axes, &scenario).usage()?;
    let mut robot = RobotLine::open(scenario, folder.log().usage()?).usage()?;
    ledger::settle(&args.robot.folder, &robot.scenario, &mut robot.line, args.take_over)?;
    let boot_ups = robot.listen().map_err(failed)?;
    let targets: Vec<(usize, Settings)> =
        axes.iter().map(|&axis| (axis, robot.settings(axis).clone())).collect();
    let surveys = robot.surveys(&targets, boot_ups).map_err(failed)?;
    folder.note_drives(drives(&surveys, &robot.scenario.can));
    past.require(Step::Inspect, &axes, &folder.basis()).usage()?;
    let refused = refused(&robot, &surveys);
    if !refused.is_empty() {
        let count = counted(refused.len() as u64, "deviation");
        result(&format!("{}failed: configure cannot mend {count}; nothing was written\n", table(&refused)))
            .usage()?;
        let refused: Vec<_> = refused.iter().map(|(_, deviation)| deviation).collect();
        folder.finish(false, &refused).incomplete()?;
        return Ok(Exit::Failed);
    }
    write_all(&mut robot, folder, &targets, (&surveys, boot_ups), args)
}

/// What no writing can mend.
fn refused(robot: &RobotLine, surveys: &Surveys) -> Vec<(usize, Deviation)> {
    let of_drive = |(axis, survey): (usize, &Option<_>)| {
        let deviations = survey.as_ref().map(|survey| robot.deviations(axis, survey)).unwrap_or_default();
        deviations
            .into_iter()
            .filter(|deviation| deviation.outcome == Outcome::Refused)
            .map(move |one| (axis, one))
    };
    surveys.iter().enumerate().flat_map(of_drive).collect()
}
