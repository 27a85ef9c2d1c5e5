//! The injectable faults of a drive. The injector sets the acting faults, and reads the faults that have struck.

/// A kind of fault. A kind with a size has it in its own unit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DriveFault {
    /// The logic supply is too low.
    Fault,
    /// Targets are acknowledged and not followed.
    IgnoresTargets,
    /// The motor lacks a share of its force: the size, of 1.
    TorqueLoss,
    /// The motor has full current towards larger positions.
    Runaway,
    /// The torque is safely off.
    Sto,
    /// "Operation enabled" comes late by the size, s.
    SlowEnable,
    /// The brake never closes.
    BrakeOpen,
    /// The brake does not open.
    BrakeClosed,
    /// The supply is off.
    Reboot,
    /// The gear has another ratio: the size.
    Scale,
    /// Emergency messages come again and again, after the size, s.
    EmcyStorm,
}

const KINDS: usize = DriveFault::EmcyStorm as usize + 1;

/// The faults that act on a drive, with those that have struck.
#[derive(Debug, Clone, Copy, Default, serde::Serialize, serde::Deserialize)]
pub struct DriveFaults {
    sizes: [Option<f64>; KINDS],
    struck: [bool; KINDS],
    acting: usize,
}

impl DriveFaults {
    /// Sets the size of an acting fault (0 for a kind without a size), or ends the fault.
    pub(crate) fn set(&mut self, kind: DriveFault, size: Option<f64>) {
        self.sizes[kind as usize] = size;
        self.struck[kind as usize] = false;
        self.acting = self.sizes.iter().flatten().count();
    }

    /// Whether no fault acts.
    #[inline]
    pub fn is_empty(&self) -> bool {
        self.acting == 0
    }

    /// The size of the fault of that kind; none while no such fault acts.
    #[inline]
    pub fn size(&self, kind: DriveFault) -> Option<f64> {
        self.sizes[kind as usize]
    }

    /// Whether a fault of that kind acts.
    #[inline]
    pub(super) fn has(&self, kind: DriveFault) -> bool {
        self.size(kind).is_some()
    }

    /// Notes that the fault of that kind strikes now, if it acts; returns whether it acts.
    pub(super) fn strike(&mut self, kind: DriveFault) -> bool {
        let acts = self.has(kind);
        self.struck[kind as usize] |= acts;
        acts
    }

    /// Whether the fault of that kind has struck since its last change.
    pub fn has_struck(&self, kind: DriveFault) -> bool {
        self.struck[kind as usize]
    }
}
