//! PDOs of a drive in cyclic synchronous position mode (CiA 301 objects 1600h and 1A00h): one PDO in each direction, both
//! synchronous (type 1).
//!
//! | PDO | mapped objects | bytes |
//! | --- | --- | --- |
//! | RPDO1 (200h + node) | 6040 controlword u16, 607A target position i32; 60B2 torque offset i16 where it is mapped | 6 or 8 |
//! | TPDO1 (180h + node) | 6041 statusword u16, 6064 position actual i32, 6077 torque actual i16 | 8 |
//!
//! A [`PdoMapping`] has their order. All values are little endian. Positions are encoder increments, torque is per mille of
//! the rated torque. The length of an increment and the time at which a PDO takes effect are not part of this module.

use super::canopen::{Cob, LengthError, NodeId};
use super::cia402::{Controlword, Statusword};
use super::frame::Frame;
use super::pdo_mapping::PdoMapping;

/// From the master to a drive.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Rpdo1 {
    /// Object 6040.
    pub controlword: Controlword,
    /// Object 607A, absolute, encoder increments.
    pub target_increments: i32,
    /// Object 60B2, per mille of the rated torque; 0 where it is not mapped.
    pub torque_offset_permille: i16,
}

/// Transmission type of both PDOs (1400:02, 1800:02): with every SYNC.
pub const EVERY_SYNC: u8 = 1;

impl Rpdo1 {
    /// The frame that carries it to that drive.
    pub fn frame(self, node: NodeId, mapping: &PdoMapping) -> Frame {
        let Self { controlword, target_increments, torque_offset_permille } = self;
        mapping.pack(Cob::Rpdo1(node), |object| match object.index {
            0x6040 => controlword.0.into(),
            0x607A => target_increments as u32,
            _ => torque_offset_permille as u32,
        })
    }

    /// Reads the data bytes.
    ///
    /// # Errors
    /// [`LengthError`] unless there are as many as the mapping has: the sender has another mapping.
    pub fn decode(data: &[u8], mapping: &PdoMapping) -> Result<Self, LengthError> {
        let mut pdo = Self { controlword: Controlword(0), target_increments: 0, torque_offset_permille: 0 };
        mapping.unpack("RPDO1", data, |object, value| match object.index {
            0x6040 => pdo.controlword = Controlword(value as u16),
            0x607A => pdo.target_increments = value as i32,
            _ => pdo.torque_offset_permille = value as i16,
        })?;
        Ok(pdo)
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
    /// The frame that carries it from that drive.
    pub fn frame(self, node: NodeId, mapping: &PdoMapping) -> Frame {
        let Self { statusword, actual_increments, torque_permille } = self;
        mapping.pack(Cob::Tpdo1(node), |object| match object.index {
            0x6041 => statusword.0.into(),
            0x6064 => actual_increments as u32,
            _ => torque_permille as u32,
        })
    }

    /// Reads the data bytes.
    ///
    /// # Errors
    /// [`LengthError`] unless there are as many as the mapping has: the sender has another mapping.
    pub fn decode(data: &[u8], mapping: &PdoMapping) -> Result<Self, LengthError> {
        let mut pdo = Self { statusword: Statusword(0), actual_increments: 0, torque_permille: 0 };
        mapping.unpack("TPDO1", data, |object, value| match object.index {
            0x6041 => pdo.statusword = Statusword(value as u16),
            0x6064 => pdo.actual_increments = value as i32,
            _ => pdo.torque_permille = value as i16,
        })?;
        Ok(pdo)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::canopen::ObjectAddress;
    use proptest::prelude::*;

    fn mapping(direction: impl Fn(&[ObjectAddress]) -> PdoMapping, indices: &[u16]) -> PdoMapping {
        direction(&indices.iter().map(|&index| ObjectAddress::new(index, 0)).collect::<Vec<_>>())
    }

    fn rpdo1(indices: &[u16]) -> PdoMapping {
        mapping(|objects| PdoMapping::rpdo1(objects).unwrap(), indices)
    }

    #[test]
    fn bytes_lie_where_the_mapping_puts_them() {
        let node = NodeId::new(3).unwrap();
        let rpdo = Rpdo1 {
            controlword: Controlword(0x000F),
            target_increments: 0x0403_0201,
            torque_offset_permille: -500,
        };
        for (mapping, frame) in [
            (PdoMapping::RPDO1, "203#0F0001020304"),
            (rpdo1(&[0x6040, 0x607A, 0x60B2]), "203#0F00010203040CFE"),
            (rpdo1(&[0x607A, 0x60B2, 0x6040]), "203#010203040CFE0F00"),
        ] {
            assert_eq!(rpdo.frame(node, &mapping).to_string(), frame);
        }
        let tpdo = Tpdo1 { statusword: Statusword(0x1237), actual_increments: -2, torque_permille: -500 };
        let turned = mapping(|objects| PdoMapping::tpdo1(objects).unwrap(), &[0x6077, 0x6064, 0x6041]);
        for (mapping, frame) in
            [(PdoMapping::TPDO1, "183#3712FEFFFFFF0CFE"), (turned, "183#0CFEFEFFFFFF3712")]
        {
            assert_eq!(tpdo.frame(node, &mapping).to_string(), frame);
        }
    }

    proptest! {
        #[test]
        fn every_value_decodes_to_itself(word: u16, position: i32, torque: i16) {
            let (node, with_offset) = (NodeId::new(3).unwrap(), rpdo1(&[0x60B2, 0x607A, 0x6040]));
            let rpdo = Rpdo1 {
                controlword: Controlword(word),
                target_increments: position,
                torque_offset_permille: torque,
            };
            prop_assert_eq!(Rpdo1::decode(rpdo.frame(node, &with_offset).data(), &with_offset), Ok(rpdo));
            let tpdo = Tpdo1 { statusword: Statusword(word), actual_increments: position, torque_permille: torque };
            let mapping = PdoMapping::TPDO1;
            prop_assert_eq!(Tpdo1::decode(tpdo.frame(node, &mapping).data(), &mapping), Ok(tpdo));
        }

        #[test]
        fn another_length_is_refused(data in prop::collection::vec(any::<u8>(), 0..=8)) {
            prop_assert_eq!(Rpdo1::decode(&data, &PdoMapping::RPDO1).is_ok(), data.len() == 6);
            prop_assert_eq!(Tpdo1::decode(&data, &PdoMapping::TPDO1).is_ok(), data.len() == 8);
        }
    }
}
