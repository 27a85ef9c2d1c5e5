//! The faults that act on one part of the plant at an instant.

use arrayvec::ArrayVec;
use masseter_scenario::FaultKindConfig;

/// More kinds than any part has.
const MOST: usize = 16;

/// The kinds of faults that act on a part, each with its size, and whether it has really changed something.
#[derive(Debug, Clone, Default)]
pub(crate) struct Acting {
    acts: ArrayVec<Act, MOST>,
}

#[derive(Debug, Clone, Copy)]
struct Act {
    kind: FaultKindConfig,
    size: f64,
    has_struck: bool,
}

impl Acting {
    /// Whether none acts.
    #[inline]
    pub(crate) fn is_empty(&self) -> bool {
        self.acts.is_empty()
    }

    /// A fault begins. One of its kind that acts already is replaced.
    pub(crate) fn begin(&mut self, kind: FaultKindConfig, size: f64) {
        self.end(kind);
        // Every kind has room once; a part has fewer kinds than that.
        let _ = self.acts.try_push(Act { kind, size, has_struck: false });
    }

    /// A fault ends.
    pub(crate) fn end(&mut self, kind: FaultKindConfig) {
        self.acts.retain(|act| act.kind != kind);
    }

    /// The size of the fault of that kind, 0 where the kind has none; none while no such fault acts.
    #[inline]
    pub(crate) fn size(&self, kind: FaultKindConfig) -> Option<f64> {
        self.acts.iter().find(|act| act.kind == kind).map(|act| act.size)
    }

    /// Whether a fault of that kind acts.
    #[inline]
    pub(crate) fn has(&self, kind: FaultKindConfig) -> bool {
        self.size(kind).is_some()
    }

    /// A fault of that kind has changed something.
    pub(crate) fn strike(&mut self, kind: FaultKindConfig) {
        self.acts.iter_mut().filter(|act| act.kind == kind).for_each(|act| act.has_struck = true);
    }

    /// Whether the fault of that kind has changed something since it began.
    pub(crate) fn has_struck(&self, kind: FaultKindConfig) -> bool {
        self.acts.iter().any(|act| act.kind == kind && act.has_struck)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use FaultKindConfig::{DriveScale, DriveSto};

    #[test]
    fn a_fault_acts_between_its_begin_and_its_end_and_strikes_when_its_part_says_so() {
        let mut acting = Acting::default();
        assert!(acting.is_empty() && !acting.has(DriveSto));
        acting.begin(DriveScale, 1.5);
        acting.begin(DriveSto, 0.0);
        assert_eq!((acting.size(DriveScale), acting.size(DriveSto)), (Some(1.5), Some(0.0)));
        acting.strike(DriveSto);
        assert!(acting.has_struck(DriveSto) && !acting.has_struck(DriveScale));
        acting.end(DriveSto);
        acting.strike(DriveSto);
        assert!(!acting.has(DriveSto) && !acting.has_struck(DriveSto));
        acting.begin(DriveScale, 2.0);
        assert_eq!(acting.size(DriveScale), Some(2.0));
    }
}
