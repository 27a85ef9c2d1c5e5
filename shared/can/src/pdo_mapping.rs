//! Which objects RPDO1 and TPDO1 carry, and in which order.

use super::canopen::{Cob, LengthError, ObjectAddress};
use super::frame::Frame;

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
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PdoMapping {
    entries: [u32; MOST],
    count: usize,
}

/// Objects that the PDO of a drive cannot have.
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
    pub(super) fn pack(&self, cob: Cob, value: impl Fn(ObjectAddress) -> u32) -> Frame {
        let (mut data, mut at) = (0, 0);
        for &entry in self.entries() {
            let bits = bits(entry);
            data |= u64::from(value(address(entry)) & (u32::MAX >> (32 - bits))) << at;
            at += bits;
        }
        Frame::new(cob.into(), &data.to_le_bytes()[..self.length()]).expect("a mapping fits a frame")
    }

    /// Hands out the value of each object.
    pub(super) fn unpack(
        &self,
        pdo: &'static str,
        data: &[u8],
        mut take: impl FnMut(ObjectAddress, u32),
    ) -> Result<(), LengthError> {
        if data.len() != self.length() {
            return Err(LengthError { object: pdo, expected: self.length(), actual: data.len() });
        }
        let mut bytes = [0; Frame::MAX_DATA];
        bytes[..data.len()].copy_from_slice(data);
        let mut data = u64::from_le_bytes(bytes);
        for &entry in self.entries() {
            take(address(entry), data as u32 & (u32::MAX >> (32 - bits(entry))));
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
    use super::*;

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
