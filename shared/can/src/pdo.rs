//! PDOs of a drive in cyclic synchronous position mode (CiA 301 objects 1600h and 1A00h): one PDO in each direction, both
//! synchronous (type 1).
//!
//! | PDO | mapped objects | bytes |
//! | --- | --- | --- |
//! | RPDO1 (200h + node) | 6040 controlword u16, 607A target position i32 | 6 |
//! | TPDO1 (180h + node) | 6041 statusword u16, 6064 position actual i32, 6077 torque actual i16 | 8 |
//!
//! All values are little endian. Positions are encoder increments, torque is per mille of the rated torque. The length of
//! an increment and the time at which a PDO takes effect are not part of this module.

use super::canopen::{Cob, LengthError, NodeId, exactly};
use super::cia402::{Controlword, Statusword};
use super::frame::Frame;

/// From the master to a drive.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Rpdo1 {
    /// Object 6040.
    pub controlword: Controlword,
    /// Object 607A, absolute, encoder increments.
    pub target_increments: i32,
}

/// Transmission type of both PDOs (1400:02, 1800:02): with every SYNC.
pub const EVERY_SYNC: u8 = 1;

impl Rpdo1 {
    /// Mapping entries (1600:01 onwards): index, sub-index, bits.
    pub const MAPPING: [u32; 2] = [0x6040_0010, 0x607A_0020];

    /// Bytes of the PDO.
    pub const LENGTH: usize = 6;

    /// The frame that carries it to that drive.
    pub fn frame(self, node: NodeId) -> Frame {
        Frame::fixed(Cob::Rpdo1(node).into(), self.encode())
    }

    /// The data bytes.
    pub fn encode(self) -> [u8; Self::LENGTH] {
        let [c0, c1] = self.controlword.0.to_le_bytes();
        let [p0, p1, p2, p3] = self.target_increments.to_le_bytes();
        [c0, c1, p0, p1, p2, p3]
    }

    /// Reads the data bytes.
    ///
    /// # Errors
    /// [`LengthError`] unless there are exactly 6: the sender has another mapping.
    pub fn decode(data: &[u8]) -> Result<Self, LengthError> {
        let [c0, c1, p0, p1, p2, p3] = exactly("RPDO1", data)?;
        Ok(Self {
            controlword: Controlword(u16::from_le_bytes([c0, c1])),
            target_increments: i32::from_le_bytes([p0, p1, p2, p3]),
        })
    }
}

/// From a drive to the master.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Tpdo1 {
    /// Object 6041.
    pub statusword: Statusword,
    /// Object 6064, encoder increments.
    pub actual_increments: i32,
    /// Object 6077, per mille of the rated torque (of the rated force, for a linear axis). An emulated drive gives the mean
    /// since the last SYNC.
    pub torque_permille: i16,
}

impl Tpdo1 {
    /// Mapping entries (1A00:01 onwards): index, sub-index, bits.
    pub const MAPPING: [u32; 3] = [0x6041_0010, 0x6064_0020, 0x6077_0010];

    /// Bytes of the PDO.
    pub const LENGTH: usize = 8;

    /// The frame that carries it from that drive.
    pub fn frame(self, node: NodeId) -> Frame {
        Frame::fixed(Cob::Tpdo1(node).into(), self.encode())
    }

    /// The data bytes.
    pub fn encode(self) -> [u8; Self::LENGTH] {
        let [s0, s1] = self.statusword.0.to_le_bytes();
        let [p0, p1, p2, p3] = self.actual_increments.to_le_bytes();
        let [t0, t1] = self.torque_permille.to_le_bytes();
        [s0, s1, p0, p1, p2, p3, t0, t1]
    }

    /// Reads the data bytes.
    ///
    /// # Errors
    /// [`LengthError`] unless there are exactly 8: the sender has another mapping.
    pub fn decode(data: &[u8]) -> Result<Self, LengthError> {
        let [s0, s1, p0, p1, p2, p3, t0, t1] = exactly("TPDO1", data)?;
        Ok(Self {
            statusword: Statusword(u16::from_le_bytes([s0, s1])),
            actual_increments: i32::from_le_bytes([p0, p1, p2, p3]),
            torque_permille: i16::from_le_bytes([t0, t1]),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_mapped_bits_fill_the_bytes() {
        let bytes = |mapping: &[u32]| mapping.iter().map(|entry| (entry & 0xFF) as usize / 8).sum::<usize>();
        assert_eq!(bytes(&Rpdo1::MAPPING), Rpdo1::LENGTH);
        assert_eq!(bytes(&Tpdo1::MAPPING), Tpdo1::LENGTH);
    }

    #[test]
    fn bytes_lie_where_the_mapping_puts_them() {
        let node = NodeId::new(3).unwrap();
        let rpdo = Rpdo1 { controlword: Controlword(0x000F), target_increments: 0x0403_0201 };
        assert_eq!(rpdo.frame(node).to_string(), "203#0F0001020304");
        let tpdo = Tpdo1 { statusword: Statusword(0x1237), actual_increments: -2, torque_permille: -500 };
        assert_eq!(tpdo.frame(node).to_string(), "183#3712FEFFFFFF0CFE");
    }

    proptest! {
        #[test]
        fn every_value_decodes_to_itself(word: u16, position: i32, torque: i16) {
            let rpdo = Rpdo1 { controlword: Controlword(word), target_increments: position };
            prop_assert_eq!(Rpdo1::decode(&rpdo.encode()), Ok(rpdo));
            let tpdo = Tpdo1 { statusword: Statusword(word), actual_increments: position, torque_permille: torque };
            prop_assert_eq!(Tpdo1::decode(&tpdo.encode()), Ok(tpdo));
        }

        #[test]
        fn another_length_is_refused(data in prop::collection::vec(any::<u8>(), 0..=8)) {
            prop_assert_eq!(Rpdo1::decode(&data).is_ok(), data.len() == Rpdo1::LENGTH);
            prop_assert_eq!(Tpdo1::decode(&data).is_ok(), data.len() == Tpdo1::LENGTH);
        }
    }
}
