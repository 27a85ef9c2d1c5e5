//! PDOs of a drive in cyclic synchronous position mode (CiA 301 objects 1600h and 1A00h). Each direction has one PDO,
//! synchronous (type 1).
//!
//! | PDO | mapped objects | bytes |
//! | --- | --- | --- |
//! | RPDO1 (200h + node) | 6040 controlword u16, 607A target position i32; 60B2 torque offset i16 where it is mapped | 6 or 8 |
//! | TPDO1 (180h + node) | 6041 statusword u16, 6064 position actual i32, 6077 torque actual i16 | 8 |
//!
//! A [`PdoMapping`] has their order. All values are little endian. Positions are encoder increments, torque is per
//! mille of the rated torque. The length of an increment and the effective time of a PDO are not part of this module.

use crate::canopen::{Cob, LengthError, NodeId, ObjectAddress};
use crate::cia402::{Controlword, Statusword};
use crate::frame::Frame;

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
    /// The frame to that drive.
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
    /// The frame from that drive.
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

/// Most objects of a mapping.
const MOST: usize = 3;
/// Objects that RPDO1 must carry: controlword and target position.
const RPDO1_NEEDS: [u32; 2] = [0x6040_0010, 0x607A_0020];
/// Objects that RPDO1 may carry: torque offset.
const RPDO1_MAY: [u32; 1] = [TORQUE_OFFSET];
const TORQUE_OFFSET: u32 = 0x60B2_0010;
/// Objects that TPDO1 must carry: statusword, position and torque.
const TPDO1_NEEDS: [u32; 3] = [0x6041_0010, 0x6064_0020, 0x6077_0010];

/// The objects of a PDO in their order.
///
/// # Examples
/// ```
/// use masseter_can::PdoMapping;
/// use masseter_can::canopen::ObjectAddress;
///
/// let objects = [0x6040, 0x607A, 0x60B2].map(|index| ObjectAddress::new(index, 0));
/// let mapping = PdoMapping::rpdo1(&objects)?;
/// assert_eq!((mapping.entries()[2], mapping.length()), (0x60B2_0010, 8));
/// assert!(PdoMapping::rpdo1(&objects[..1]).is_err(), "there is no target position");
/// # Ok::<(), masseter_can::PdoMappingError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct PdoMapping {
    entries: [u32; MOST],
    count: usize,
}

/// Why objects are no PDO of a drive.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum PdoMappingError {
    /// An object that the master does not exchange.
    #[error("the master does not exchange object {0}; remove the object")]
    Unknown(ObjectAddress),
    /// An object that occurs twice.
    #[error("object {0} occurs twice; name the object once")]
    Twice(ObjectAddress),
    /// An object that the master needs.
    #[error("the master needs object {0}; add the object")]
    Missing(ObjectAddress),
}

impl PdoMapping {
    /// Controlword and target position.
    pub const RPDO1: Self = Self { entries: [RPDO1_NEEDS[0], RPDO1_NEEDS[1], 0], count: 2 };
    /// Statusword, position and torque.
    pub const TPDO1: Self = Self { entries: TPDO1_NEEDS, count: 3 };

    /// A mapping of RPDO1.
    ///
    /// # Errors
    /// [`PdoMappingError`] unless 6040h and 607Ah are there, and besides 60B2h at most.
    pub fn rpdo1(objects: &[ObjectAddress]) -> Result<Self, PdoMappingError> {
        Self::new(objects, &RPDO1_NEEDS, &RPDO1_MAY)
    }

    /// A mapping of TPDO1.
    ///
    /// # Errors
    /// [`PdoMappingError`] unless 6041h, 6064h and 6077h are there, and nothing else.
    pub fn tpdo1(objects: &[ObjectAddress]) -> Result<Self, PdoMappingError> {
        Self::new(objects, &TPDO1_NEEDS, &[])
    }

    fn new(objects: &[ObjectAddress], needs: &[u32], may: &[u32]) -> Result<Self, PdoMappingError> {
        let mut mapping = Self { entries: [0; MOST], count: 0 };
        for &object in objects {
            let entry = needs.iter().chain(may).find(|&&entry| address(entry) == object);
            let &entry = entry.ok_or(PdoMappingError::Unknown(object))?;
            if mapping.entries().contains(&entry) {
                return Err(PdoMappingError::Twice(object));
            }
            mapping.entries[mapping.count] = entry;
            mapping.count += 1;
        }
        match needs.iter().find(|entry| !mapping.entries().contains(entry)) {
            Some(&missing) => Err(PdoMappingError::Missing(address(missing))),
            None => Ok(mapping),
        }
    }

    /// The entries of the mapping parameter (1600:01, 1A00:01 onwards): index, sub-index, bits.
    pub fn entries(&self) -> &[u32] {
        &self.entries[..self.count]
    }

    /// Bytes of the PDO.
    pub fn length(&self) -> usize {
        self.entries().iter().map(|entry| bits(*entry) as usize / 8).sum()
    }

    /// Whether the torque offset (60B2) is mapped.
    pub fn has_torque_offset(&self) -> bool {
        self.entries().contains(&TORQUE_OFFSET)
    }

    /// The frame with the value of each object.
    fn pack(&self, cob: Cob, value: impl Fn(ObjectAddress) -> u32) -> Frame {
        let (mut data, mut at) = (0, 0);
        for &entry in self.entries() {
            let bits = bits(entry);
            data |= u64::from(value(address(entry)) & (u32::MAX >> (32 - bits))) << at;
            at += bits;
        }
        Frame::new(cob.into(), &data.to_le_bytes()[..self.length()]).expect("a mapping fits a frame")
    }

    /// Reads the value of each object.
    fn unpack(
        &self,
        pdo: &'static str,
        data: &[u8],
        mut set: impl FnMut(ObjectAddress, u32),
    ) -> Result<(), LengthError> {
        if data.len() != self.length() {
            return Err(LengthError { object: pdo, expected: self.length(), actual: data.len() });
        }
        let mut bytes = [0; Frame::MAX_DATA];
        bytes[..data.len()].copy_from_slice(data);
        let mut data = u64::from_le_bytes(bytes);
        for &entry in self.entries() {
            set(address(entry), data as u32 & (u32::MAX >> (32 - bits(entry))));
            data >>= bits(entry);
        }
        Ok(())
    }
}

const fn address(entry: u32) -> ObjectAddress {
    ObjectAddress::new((entry >> 16) as u16, (entry >> 8) as u8)
}

const fn bits(entry: u32) -> u32 {
    entry & 0xFF
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

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

    #[test]
    fn a_mapping_has_what_the_master_needs_and_nothing_that_it_does_not_know() {
        let object = |index| ObjectAddress::new(index, 0);
        let rpdo1 =
            |indices: &[u16]| PdoMapping::rpdo1(&indices.iter().copied().map(object).collect::<Vec<_>>());
        assert_eq!(rpdo1(&[0x6040, 0x607A]), Ok(PdoMapping::RPDO1));
        for (indices, error) in [
            (&[0x6040, 0x60B2][..], PdoMappingError::Missing(object(0x607A))),
            (&[0x6040, 0x607A, 0x6040], PdoMappingError::Twice(object(0x6040))),
            (&[0x6040, 0x607A, 0x6060], PdoMappingError::Unknown(object(0x6060))),
        ] {
            assert_eq!(rpdo1(indices), Err(error));
        }
    }

    #[test]
    fn only_a_mapping_with_the_torque_offset_carries_one() {
        let with = PdoMapping::rpdo1(&[0x607A, 0x6040, 0x60B2].map(|index| ObjectAddress::new(index, 0)));
        assert!(with.unwrap().has_torque_offset() && !PdoMapping::RPDO1.has_torque_offset());
        assert_eq!(
            [PdoMapping::RPDO1.length(), with.unwrap().length(), PdoMapping::TPDO1.length()],
            [6, 8, 8]
        );
    }
}
