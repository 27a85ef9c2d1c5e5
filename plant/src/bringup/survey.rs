//! What a drive says of itself: uploads and nothing else.

use std::collections::BTreeMap;

use masseter_can::canopen::{Expedited, ObjectAddress};

use super::line::Line;
use super::line_error::{LineError, SdoReason};

/// Device, state and units: index and sub-indices.
const OF_EVERY_DRIVE: [(u16, &[u8]); 21] = [
    (0x1000, &[0]),
    (0x1001, &[0]),
    (0x1003, &[0]),
    (0x1008, &[0]),
    (0x1009, &[0]),
    (0x100A, &[0]),
    (0x1010, &[1]),
    (0x1018, &[1, 2, 3, 4]),
    (0x6502, &[0]),
    (0x6041, &[0]),
    (0x6061, &[0]),
    (0x603F, &[0]),
    (0x6064, &[0]),
    (0x60FD, &[0]),
    (0x608F, &[1, 2]),
    (0x6091, &[1, 2]),
    (0x6092, &[1, 2]),
    (0x60A8, &[0]),
    (0x60A9, &[0]),
    (0x60AA, &[0]),
    (0x607D, &[1, 2]),
];
/// Most objects of a PDO.
const MAPPED_MAX: u32 = 64;
/// Most errors of the history (1003h) that are read.
const ERRORS_MAX: u32 = 8;
/// Communication parameters of the PDOs with identifiers of CiA 301.
const PDOS: [u16; 8] = [0x1400, 0x1401, 0x1402, 0x1403, 0x1800, 0x1801, 0x1802, 0x1803];

/// The answers of one drive.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Survey {
    readings: BTreeMap<ObjectAddress, Result<Vec<u8>, SdoReason>>,
}

impl Survey {
    /// Reads a drive: what every drive has, its PDOs, and these objects. The first silence ends the survey.
    ///
    /// # Errors
    /// [`LineError`] except those of transfers, which are part of the survey.
    pub fn take(
        line: &mut Line,
        axis: usize,
        objects: impl IntoIterator<Item = ObjectAddress>,
    ) -> Result<Self, LineError> {
        let mut survey = Self::default();
        for (index, subindices) in OF_EVERY_DRIVE {
            for &subindex in subindices {
                survey.read(line, axis, ObjectAddress::new(index, subindex))?;
            }
        }
        let errors = survey.number(ObjectAddress::new(0x1003, 0)).unwrap_or(0).min(ERRORS_MAX);
        for place in 1..=errors as u8 {
            survey.read(line, axis, ObjectAddress::new(0x1003, place))?;
        }
        for communication in PDOS {
            survey.read_pdo(line, axis, communication)?;
        }
        objects.into_iter().try_for_each(|object| survey.read(line, axis, object))?;
        Ok(survey)
    }

    fn read_pdo(&mut self, line: &mut Line, axis: usize, communication: u16) -> Result<(), LineError> {
        let parts: &[u8] = if communication < 0x1800 { &[1, 2, 5] } else { &[1, 2, 3, 5] };
        for &part in parts {
            self.read(line, axis, ObjectAddress::new(communication, part))?;
        }
        let mapped = |place| ObjectAddress::new(communication + 0x200, place);
        self.read(line, axis, mapped(0))?;
        let count = self.number(mapped(0)).filter(|&count| count <= MAPPED_MAX).unwrap_or(0);
        (1..=count as u8).try_for_each(|place| self.read(line, axis, mapped(place)))
    }

    fn read(&mut self, line: &mut Line, axis: usize, object: ObjectAddress) -> Result<(), LineError> {
        if self.fell_silent() || self.readings.contains_key(&object) {
            return Ok(());
        }
        let reading = match line.read(axis, object) {
            Err(LineError::Sdo { reason, .. }) => Err(reason),
            read => Ok(read?),
        };
        self.readings.insert(object, reading);
        Ok(())
    }

    #[cfg(test)]
    pub(super) fn insert(&mut self, object: ObjectAddress, value: u32) {
        self.readings.insert(object, Ok(value.to_le_bytes().to_vec()));
    }

    /// Whether the drive never answered.
    pub fn is_silent(&self) -> bool {
        self.readings.values().all(Result::is_err) && self.fell_silent()
    }

    /// Whether an answer is missing, so that the survey is not complete.
    pub fn fell_silent(&self) -> bool {
        self.readings.values().any(|reading| *reading == Err(SdoReason::Silent))
    }

    /// Every object that was asked for, with its answer.
    pub fn readings(&self) -> impl Iterator<Item = (ObjectAddress, &Result<Vec<u8>, SdoReason>)> {
        self.readings.iter().map(|(&object, reading)| (object, reading))
    }

    /// Why an object could not be read.
    pub fn refusal(&self, object: ObjectAddress) -> Option<SdoReason> {
        self.readings.get(&object)?.as_ref().err().copied()
    }

    /// An object of at most four bytes.
    pub fn number(&self, object: ObjectAddress) -> Option<u32> {
        let value = self.readings.get(&object)?.as_ref().ok()?;
        let number = value.iter().rfold(0, |number: u32, &byte| number << 8 | u32::from(byte));
        (value.len() <= Expedited::MAX).then_some(number)
    }

    /// A text.
    pub fn text(&self, object: ObjectAddress) -> Option<String> {
        let value = self.readings.get(&object)?.as_ref().ok()?;
        Some(String::from_utf8_lossy(value).trim_end_matches('\0').to_owned())
    }
}
