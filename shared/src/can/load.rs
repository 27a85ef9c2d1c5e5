//! Whether a cycle's frames fit on a bus: worst-case bits of a cycle against the bits it has.
//!
//! Cyclic frames with 11-bit identifiers only. Heartbeats, emergencies and SDO share what is left, and
//! response times within the cycle are not analysed.

use std::fmt;

use super::wire::{Bitrate, worst_case_bits};

/// Equal frames of a cycle.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FrameGroup {
    /// What they are, as messages show it.
    pub name: &'static str,
    /// How many a cycle.
    pub count: u32,
    /// Data bytes of each.
    pub data_length: u32,
}

impl FrameGroup {
    fn bits_each(&self) -> u32 {
        worst_case_bits(self.data_length, false)
    }
}

impl fmt::Display for FrameGroup {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.count != 1 {
            write!(f, "{} x ", self.count)?;
        }
        f.write_str(self.name)?;
        if self.data_length != 0 {
            write!(f, " {} B", self.data_length)?;
        }
        write!(f, " {}", self.bits_each())
    }
}

/// The frames of one cycle on one bus.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CycleLoad {
    bus: usize,
    bitrate: Bitrate,
    period_ns: u64,
    groups: Vec<FrameGroup>,
}

/// A cycle whose frames do not fit.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "{0}: at most {rate:.0} Hz; use a longer period, a faster bit rate or more buses",
    rate = .0.max_rate_hz().floor()
)]
pub struct Overload(pub CycleLoad);

impl CycleLoad {
    /// The load that `groups` are every `period_ns` on the bus of that index.
    pub fn new(bus: usize, bitrate: Bitrate, period_ns: u64, groups: Vec<FrameGroup>) -> Self {
        Self { bus, bitrate, period_ns, groups }
    }

    /// Bits a cycle takes at worst, interframe spaces included.
    pub fn bits(&self) -> u64 {
        self.groups.iter().map(|group| u64::from(group.count) * u64::from(group.bits_each())).sum()
    }

    /// Whole bits that a period has.
    pub fn available_bits(&self) -> u64 {
        self.period_ns * u64::from(self.bitrate.bps()) / 1_000_000_000
    }

    /// Share of the period that the frames take at worst; more than 1 does not fit.
    pub fn share(&self) -> f64 {
        self.bits() as f64 / self.available_bits() as f64
    }

    /// The highest rate at which the frames still fit, Hz; infinite without frames.
    pub fn max_rate_hz(&self) -> f64 {
        f64::from(self.bitrate.bps()) / self.bits() as f64
    }

    /// Whether the frames fit into the period.
    ///
    /// # Errors
    /// [`Overload`], which shows the arithmetic, where they do not.
    pub fn check(&self) -> Result<(), Overload> {
        if self.bits() <= self.available_bits() { Ok(()) } else { Err(Overload(self.clone())) }
    }
}

impl fmt::Display for CycleLoad {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "bus {}: ", self.bus)?;
        for (index, group) in self.groups.iter().enumerate() {
            write!(f, "{}{group}", if index == 0 { "" } else { " + " })?;
        }
        write!(f, " = {} bits of {} bits a cycle", self.bits(), self.available_bits())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MILLISECOND_NS: u64 = 1_000_000;

    fn load(axes: u32, tpdo_length: u32) -> CycleLoad {
        let groups = vec![
            FrameGroup { name: "SYNC", count: 1, data_length: 0 },
            FrameGroup { name: "RPDO", count: axes, data_length: 6 },
            FrameGroup { name: "TPDO", count: axes, data_length: tpdo_length },
        ];
        CycleLoad::new(0, Bitrate::MAX, MILLISECOND_NS, groups)
    }

    #[test]
    fn three_axes_fit_into_a_millisecond_and_show_how() {
        let load = load(3, 8);
        assert_eq!(
            load.to_string(),
            "bus 0: SYNC 55 + 3 x RPDO 6 B 115 + 3 x TPDO 8 B 135 = 805 bits of 1000 bits a cycle"
        );
        assert_eq!(load.check(), Ok(()));
        assert!((load.share() - 0.805).abs() < 1e-12);
    }

    #[test]
    fn six_axes_do_not_and_the_error_tells_the_rate_that_would() {
        let load = load(6, 8);
        let message = load.check().unwrap_err().to_string();
        assert!(message.contains("= 1555 bits of 1000 bits a cycle: at most 643 Hz"), "{message}");
        assert!((load.max_rate_hz() - 1e6 / 1555.0).abs() < 1e-9);
    }

    #[test]
    fn a_cycle_filled_to_the_last_bit_fits() {
        let groups = vec![FrameGroup { name: "SYNC", count: 1, data_length: 0 }];
        let fits = |period_ns| CycleLoad::new(0, Bitrate::MAX, period_ns, groups.clone()).check().is_ok();
        assert!(fits(55_000));
        assert!(!fits(54_999));
    }
}
