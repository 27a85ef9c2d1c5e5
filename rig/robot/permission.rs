//! Whether `masseter run` may move a real robot: only with a passed pose check of the same drives and profiles, and at full speed
//! only after a passed dry run.

use std::io;
use std::path::Path;

use anyhow::{Context, bail};
use masseter_model::geometry::AXES;
use masseter_plant::bringup::Line;
use masseter_terminal::status;

use super::dry_run::{FOLDER, Played, check_motion};
use super::evidence::Basis;
use super::identity::{Identity, Known, NOT_ASKED, warn_of_gaps};
use super::ledger;
use super::past::Past;
use super::power_mark;
use super::step::Step;

/// Refuses a run on real interfaces without its earlier steps. The files are read before anything is sent; then the drives
/// tell who they are.
pub(crate) fn check_bring_up(played: &Played<'_>, is_waived: bool) -> anyhow::Result<()> {
    let scenario = played.scenario;
    if scenario.can.is_virtual() {
        return Ok(());
    }
    if is_waived {
        status!(
            "WITHOUT BRING-UP: signs, scales and zeros are not proved, and a wrong one can drive an axis into its end"
        );
        return Ok(());
    }
    let refused = "a run needs a passed pose check of this robot, and at full speed also a passed dry run; \
                   --without-bring-up skips both: a wrong sign, scale or zero can then drive an axis into its end";
    let folder = Path::new(FOLDER);
    if let Some(&axis) = ledger::owed_axes(folder).first() {
        bail!(ledger::advice(folder, axis));
    }
    let past = Past::read(folder)?;
    let axes: [usize; AXES] = std::array::from_fn(|axis| axis);
    let unknown = Basis::new(scenario, NOT_ASKED);
    let steps: &[Step] =
        if scenario.dry.is_on { &[Step::CheckPose] } else { &[Step::CheckPose, Step::DryRun] };
    let require = |basis: &Basis| steps.iter().try_for_each(|&step| past.require(step, &axes, basis));
    require(&unknown).context(refused)?;
    if !scenario.dry.is_on {
        check_motion(&past, played).context(refused)?;
    }
    let mut line = Line::open(scenario, Box::new(io::sink()))?;
    let drives = Identity::read_all(&mut line, &scenario.can).context(refused)?.map(Known::Is);
    require(&Basis { drives, ..unknown }).context(refused)?;
    warn_of_gaps(&drives);
    let (_, checked) = past.newest(Step::CheckPose, 0).context("there is no pose check")?;
    let marks = power_mark::of_pose_check(checked).context(refused)?;
    power_mark::check(scenario, &marks, &checked.started, &mut line).context(refused)
}
