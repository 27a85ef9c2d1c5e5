//! Bit rates and durations of bits.

/// A bit rate that CAN does not have.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("bit rate {bps} bit/s is outside classical CAN (1 to 1000000 bit/s)")]
pub struct BitrateError {
    /// Bit rate asked for, bit/s.
    pub bps: u32,
}

/// Bit rate of a bus, bit/s.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Bitrate {
    bps: u32,
}

impl Bitrate {
    /// The fastest of classical CAN, 1 Mbit/s.
    pub const MAX: Self = Self { bps: 1_000_000 };
    /// One bit a nanosecond, which no CAN has. A frame takes about 0.14 µs, so the time of a run is that of the software.
    pub const IDEAL: Self = Self { bps: 1_000_000_000 };

    /// That many bits a second, 1 to 1 000 000.
    ///
    /// # Errors
    /// [`BitrateError`] for 0 and for more than 1 Mbit/s.
    pub const fn new(bps: u32) -> Result<Self, BitrateError> {
        if bps == 0 || bps > Self::MAX.bps { Err(BitrateError { bps }) } else { Ok(Self { bps }) }
    }

    /// Bits a second.
    pub const fn bps(self) -> u32 {
        self.bps
    }

    /// Duration of that many bits, rounded up, ns.
    pub const fn bits_to_ns(self, bits: u32) -> u64 {
        (bits as u64 * 1_000_000_000).div_ceil(self.bps as u64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_are_exact_at_one_megabit_and_rounded_up_elsewhere() {
        assert_eq!(Bitrate::MAX.bits_to_ns(135), 135_000);
        assert_eq!(Bitrate::new(300_000).unwrap().bits_to_ns(1), 3334);
        assert_eq!(Bitrate::new(0), Err(BitrateError { bps: 0 }));
        assert_eq!(Bitrate::new(1_000_001), Err(BitrateError { bps: 1_000_001 }));
    }
}
