//! Whether the drives are at the end of a step those of its beginning: a step may be done with a drive long before it ends.

use masseter_model::geometry::{AXES, AXIS_NAMES};
use masseter_plant::bringup::{BootUps, Line, LineError, OtherMaster, Restarted};
use masseter_scenario::CanConfig;

use super::identity::{Identity, Known};

/// Why what a step has read from a drive, or written to it, may not count any more.
#[derive(Debug, thiserror::Error)]
pub(super) enum Disturbance {
    /// It restarted.
    #[error(transparent)]
    Restarted(#[from] Restarted),
    /// Another master may have changed it.
    #[error(transparent)]
    OtherMaster(#[from] OtherMaster),
    /// It does not answer any more.
    #[error(transparent)]
    Line(#[from] LineError),
    /// Another drive answers.
    #[error(
        "{}: the drive's {}; leave the drives in their places during a step",
        AXIS_NAMES[*axis], .now.differs_from(before)
    )]
    OtherDrive {
        /// The axis.
        axis: usize,
        /// The drive at the beginning.
        before: Identity,
        /// The drive now.
        now: Identity,
    },
}

/// Refuses drives of which one restarted since then, or beside which another master was heard. Nothing is sent.
pub(super) fn check_undisturbed(line: &Line, axes: &[usize], since: BootUps) -> Result<(), Disturbance> {
    axes.iter().try_for_each(|&axis| since.check_axis(line, axis))?;
    Ok(line.strangers().refuse_masters()?)
}

/// The same, and asks the drives again who they are.
pub(super) fn check_present(
    line: &mut Line,
    can: &CanConfig,
    axes: &[usize],
    since: BootUps,
    drives: &[Known; AXES],
) -> Result<(), Disturbance> {
    let answers: Vec<_> = axes.iter().map(|&axis| (axis, Identity::read(line, can, axis))).collect();
    // A restart is the cause of a missing answer, and may become known while the answer is waited for.
    check_undisturbed(line, axes, since)?;
    for (axis, now) in answers {
        let now = now?;
        if let Known::Is(before) = drives[axis]
            && before != now
        {
            return Err(Disturbance::OtherDrive { axis, before, now });
        }
    }
    Ok(())
}
