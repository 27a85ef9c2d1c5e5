//! Bit rates and durations of bits.

/// A bit rate that CAN does not have.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum BitrateError {
    /// The bit rate of classical frames and of the arbitration of FD frames.
    #[error("bit rate {bps} bit/s is outside classical CAN (1 to 1000000 bit/s)")]
    Nominal {
        /// Bit rate asked for, bit/s.
        bps: u32,
    },
    /// The bit rate of the data phase of FD frames.
    #[error(
        "data bit rate {bps} bit/s: use at least the nominal bit rate ({nominal_bps} bit/s) and at most \
         8000000 bit/s"
    )]
    Data {
        /// Bit rate asked for, bit/s.
        bps: u32,
        /// The nominal one, bit/s.
        nominal_bps: u32,
    },
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
    /// The fastest data phase that transceivers are made for (CiA 601-4), 8 Mbit/s.
    pub const MAX_DATA: Self = Self { bps: 8_000_000 };

    /// That many bits a second, 1 to 1 000 000.
    ///
    /// # Errors
    /// [`BitrateError::Nominal`] for 0 and for more than 1 Mbit/s.
    pub const fn new(bps: u32) -> Result<Self, BitrateError> {
        if bps == 0 || bps > Self::MAX.bps { Err(BitrateError::Nominal { bps }) } else { Ok(Self { bps }) }
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

/// The bit rates of a bus: one for arbitration, and for FD with bit-rate switch one for the data phase.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Rates {
    nominal: Bitrate,
    data: Bitrate,
}

impl Rates {
    /// Rates of a bus without bit-rate switch.
    pub const fn classical(nominal: Bitrate) -> Self {
        Self { nominal, data: nominal }
    }

    /// Rates of a bus whose data phases run at `data_bps`.
    ///
    /// # Errors
    /// [`BitrateError::Data`] below the nominal bit rate and above 8 Mbit/s.
    pub const fn switching(nominal: Bitrate, data_bps: u32) -> Result<Self, BitrateError> {
        if data_bps < nominal.bps || data_bps > Bitrate::MAX_DATA.bps {
            return Err(BitrateError::Data { bps: data_bps, nominal_bps: nominal.bps });
        }
        Ok(Self { nominal, data: Bitrate { bps: data_bps } })
    }

    /// The nominal bit rate.
    pub const fn nominal(self) -> Bitrate {
        self.nominal
    }

    /// The bit rate of data phases.
    pub const fn data(self) -> Bitrate {
        self.data
    }

    /// How long a frame takes, each part rounded up, ns.
    pub const fn duration_ns(self, bits: FrameBits) -> u64 {
        let data_ns = if bits.data == 0 { 0 } else { self.data.bits_to_ns(bits.data) };
        self.nominal.bits_to_ns(bits.head + bits.tail) + data_ns
    }

    /// From the first bit of a frame to the end of its bit number `bit`, counted from 1, ns.
    pub const fn time_to_bit_ns(self, bits: FrameBits, bit: u32) -> u64 {
        if bit <= bits.head {
            return self.nominal.bits_to_ns(bit);
        }
        let behind = bit - bits.head;
        let data = if behind < bits.data { behind } else { bits.data };
        self.nominal.bits_to_ns(bits.head + behind - data) + self.data.bits_to_ns(data)
    }
}

/// Bits of a frame on the wire, in the order in which they go: at the nominal rate, at the data rate,
/// at the nominal rate again. A frame without bit-rate switch is all head.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FrameBits {
    /// From the start bit to the bit-rate switch, or to the end.
    pub head: u32,
    /// From the error state indicator to the CRC delimiter.
    pub data: u32,
    /// From the acknowledge slot on.
    pub tail: u32,
}

impl FrameBits {
    /// A frame that goes at the nominal rate.
    pub const fn nominal(bits: u32) -> Self {
        Self { head: bits, data: 0, tail: 0 }
    }

    /// All bits, whatever their rate.
    pub const fn total(self) -> u32 {
        self.head + self.data + self.tail
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_are_exact_at_one_megabit_and_rounded_up_elsewhere() {
        assert_eq!(Bitrate::MAX.bits_to_ns(135), 135_000);
        assert_eq!(Bitrate::new(300_000).unwrap().bits_to_ns(1), 3334);
        assert_eq!(Bitrate::new(0), Err(BitrateError::Nominal { bps: 0 }));
        assert_eq!(Bitrate::new(1_000_001), Err(BitrateError::Nominal { bps: 1_000_001 }));
    }

    #[test]
    fn data_phases_are_not_slower_than_arbitration_and_not_faster_than_transceivers() {
        let nominal = Bitrate::new(500_000).unwrap();
        assert!(Rates::switching(nominal, 500_000).is_ok());
        assert!(Rates::switching(nominal, 8_000_000).is_ok());
        for bps in [499_999, 8_000_001] {
            assert_eq!(Rates::switching(nominal, bps), Err(BitrateError::Data { bps, nominal_bps: 500_000 }));
        }
    }

    #[test]
    fn the_data_phase_goes_at_its_own_rate() {
        let rates = Rates::switching(Bitrate::MAX, 5_000_000).unwrap();
        let bits = FrameBits { head: 20, data: 100, tail: 12 };
        assert_eq!(rates.duration_ns(bits), 20_000 + 20_000 + 12_000);
        let times = [20, 25, 120, 132].map(|bit| rates.time_to_bit_ns(bits, bit));
        assert_eq!(times, [20_000, 21_000, 40_000, 52_000]);
    }
}
