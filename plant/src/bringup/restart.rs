//! Drives that restart during a step: whatever was written and not stored is lost, and perhaps the position too.

use std::fmt::{self, Display, Formatter};

use masseter_model::geometry::{AXES, AXIS_NAMES};

use super::heard::NMT;
use super::line::Line;

/// The boot-up messages that were heard until a moment.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BootUps([u32; AXES]);

/// A drive that restarted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Restarted {
    /// Its axis.
    pub axis: usize,
    /// Whether another master was heard, which may have reset it.
    pub by_master: bool,
}

impl std::error::Error for Restarted {}

impl Display for Restarted {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let (name, remedy) = (
            AXIS_NAMES[self.axis],
            if self.by_master { "end the other master, which sends NMT" } else { "check its supply" },
        );
        write!(f, "{name} restarted during the step; {remedy} (values that are not stored are lost)")
    }
}

impl BootUps {
    /// Those until now.
    pub fn until_now(line: &Line) -> Self {
        Self(std::array::from_fn(|axis| line.heard(axis).boot_ups))
    }

    /// Refuses a drive that has restarted since then.
    ///
    /// # Errors
    /// The drive of this axis.
    pub fn check_axis(&self, line: &Line, axis: usize) -> Result<(), Restarted> {
        let by_master = line.strangers().masters.iter().any(|(_, sign)| *sign == NMT);
        let is_same = line.heard(axis).boot_ups == self.0[axis];
        if is_same { Ok(()) } else { Err(Restarted { axis, by_master }) }
    }

    /// The same for all drives.
    ///
    /// # Errors
    /// The first such drive.
    pub fn check(&self, line: &Line) -> Result<(), Restarted> {
        (0..AXES).try_for_each(|axis| self.check_axis(line, axis))
    }
}
