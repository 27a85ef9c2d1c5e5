//! `masseter robot configure`: the rig's objects into drives without power.
//!
//! All drives are read and judged before the first one is written. The drive that refuses a value ends the step: the
//! drives after it are not touched, and no drive ever gets power.

use clap::Args;
use masseter_plant::bringup::{Deviation, Outcome, Survey};
use masseter_shared::geometry::AXES;
use masseter_shared::wording::counted;
use masseter_terminal::{Exit, Failure, OrFailure, result};

use super::args::{RobotArgs, parse_axis};
use super::evidence::{Basis, StepFolder};
use super::ledger;
use super::past::Past;
use super::robot_line::{RobotLine, failed, serials};
use super::step::Step;
use super::table::table;
use super::writing::{Written, finish, prove_all, write};

/// The arguments of `robot configure` and `robot restore`.
#[derive(Debug, Clone, Args)]
pub(crate) struct WriteArgs {
    #[command(flatten)]
    pub(super) robot: RobotArgs,
    /// This axis alone
    #[arg(long, value_parser = parse_axis)]
    pub(super) axis: Option<usize>,
    /// Store in the drives' memory, and prove it by a reset
    #[arg(long)]
    pub(super) store: bool,
    /// Stop a drive that somebody else left with power, instead of refusing
    #[arg(long)]
    pub(super) take_over: bool,
}

impl WriteArgs {
    /// The axes to be written.
    pub(super) fn axes(&self) -> Vec<usize> {
        self.axis.map_or_else(|| (0..AXES).collect(), |axis| vec![axis])
    }
}

/// Configures, and tells what was changed.
pub(crate) fn configure(args: &WriteArgs) -> Result<Exit, Failure> {
    let scenario = args.robot.scenario().usage()?;
    let (axes, past) = (args.axes(), Past::read(&args.robot.folder).usage()?);
    // A refused step makes no folder: it would replace the evidence of the same step from before.
    past.require(Step::Inspect, &axes, &Basis::new(&scenario, [None; AXES])).usage()?;
    let mut folder = StepFolder::begin(&args.robot.folder, Step::Configure, &axes, &scenario).usage()?;
    let mut robot = RobotLine::open(scenario, folder.log().usage()?).usage()?;
    ledger::settle(&args.robot.folder, &robot.scenario, &mut robot.line, args.take_over)?;
    let (surveys, boot_ups) = robot.surveys(&axes).map_err(failed)?;
    folder.note_serials(serials(&surveys));
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
    prove_all(&mut robot, &axes, args.take_over)?;
    let mut all: Vec<Written> = Vec::new();
    for (axis, survey) in surveys.iter().enumerate() {
        let Some(survey) = survey else { continue };
        let target = robot.settings(axis).clone();
        all.push(write(&mut robot, &folder, axis, &target, (survey, boot_ups), args.store)?);
        if all.last().is_some_and(Written::failed) {
            break;
        }
    }
    finish(&mut robot, folder, all, args.store)
}

/// What no writing can mend.
fn refused(robot: &RobotLine, surveys: &[Option<Survey>; AXES]) -> Vec<(usize, Deviation)> {
    let of_drive = |(axis, survey): (usize, &Option<Survey>)| {
        let deviations = survey.as_ref().map(|survey| robot.deviations(axis, survey)).unwrap_or_default();
        deviations
            .into_iter()
            .filter(|deviation| deviation.outcome == Outcome::Refused)
            .map(move |one| (axis, one))
    };
    surveys.iter().enumerate().flat_map(of_drive).collect()
}
