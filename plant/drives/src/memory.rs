//! The non-volatile memory of a drive.

use std::collections::BTreeMap;

use masseter_can::canopen::ObjectAddress;
use serde::{Deserialize, Serialize};

use crate::dictionary::{ENTRIES, Objects, Overlay, find};
use crate::names;

/// A value that a drive does not take from its memory.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum MemoryError {
    /// An object that the drive lacks.
    #[error("{key}: the drive has no such object")]
    Object {
        /// The object as the memory names it.
        key: String,
    },
    /// A value that no client could write either.
    #[error("{key} = {value}: the drive does not take this value")]
    Value {
        /// The object as the memory names it.
        key: String,
        /// The value.
        value: i64,
    },
}

/// The non-volatile memory of a drive, without values of delivery.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DriveMemory {
    /// Serial number (1018h:04); none for that of the settings.
    pub serial_number: Option<u32>,
    /// Stored values by their objects, such as `6065:00`.
    #[serde(default)]
    pub values: BTreeMap<String, i64>,
}

impl DriveMemory {
    /// The differences between stored values and those of delivery.
    pub(crate) fn of(stored: &Objects, factory: &Objects) -> Self {
        let differs = |place: &usize| stored.words[*place] != factory.words[*place];
        let value = |place: usize| {
            let entry = &ENTRIES[place];
            (key(entry.address), entry.kind.number(stored.words[place]))
        };
        let values = (0..ENTRIES.len()).filter(differs).map(value).collect();
        Self { serial_number: Some(stored.get(names::SERIAL_NUMBER)), values }
    }

    /// Writes the memory into a dictionary as delivered.
    ///
    /// # Errors
    /// The object that the drive lacks, or whose value the drive refuses.
    pub(crate) fn restore(&self, objects: &mut Objects, overlay: &Overlay) -> Result<(), MemoryError> {
        if let Some(serial_number) = self.serial_number {
            objects.set(names::SERIAL_NUMBER, serial_number);
        }
        for (key, value) in &self.values {
            let place = address(key).and_then(|address| find(address).ok());
            let entry = place.and_then(|place| Some((place, overlay.entry(place)?)));
            let Some((place, entry)) = entry else {
                return Err(MemoryError::Object { key: key.clone() });
            };
            let word = *value as u32;
            if entry.check_access().is_err()
                || entry.check_limits(word).is_err()
                || entry.kind.number(word) != *value
            {
                return Err(MemoryError::Value { key: key.clone(), value: *value });
            }
            objects.words[place] = word;
        }
        Ok(())
    }
}

fn key(ObjectAddress { index, subindex }: ObjectAddress) -> String {
    format!("{index:04X}:{subindex:02X}")
}

fn address(key: &str) -> Option<ObjectAddress> {
    let (index, subindex) = key.split_once(':')?;
    let number = |digits: &str| u16::from_str_radix(digits, 16).ok();
    Some(ObjectAddress::new(number(index)?, u8::try_from(number(subindex)?).ok()?))
}
