//! The non-volatile memory of a drive: its serial number and what it has stored (1010h).

use std::collections::BTreeMap;

use masseter_can::canopen::ObjectAddress;
use serde::{Deserialize, Serialize};

use super::dictionary::{ENTRIES, Objects, Overlay, find, names};

/// What a drive keeps without supply. Values that are as delivered are left out.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct DriveMemory {
    /// Serial number (1018h:04); none for that of the scenario.
    pub(crate) serial_number: Option<u32>,
    /// Stored values by their objects, such as `6065:00`.
    #[serde(default)]
    pub(crate) values: BTreeMap<String, i64>,
}

impl DriveMemory {
    /// What differs between stored values and those of delivery.
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
    /// The object that the drive does not have, or whose value it would not take.
    pub(crate) fn restore(&self, objects: &mut Objects, overlay: &Overlay) -> Result<(), String> {
        if let Some(serial_number) = self.serial_number {
            objects.set(names::SERIAL_NUMBER, serial_number);
        }
        for (key, value) in &self.values {
            let place = address(key).and_then(|address| find(address).ok());
            let entry = place.and_then(|place| Some((place, overlay.entry(place)?)));
            let Some((place, entry)) = entry else {
                return Err(format!("{key}: the drive has no such object"));
            };
            let word = *value as u32;
            if entry.check_access().is_err()
                || entry.check_limits(word).is_err()
                || entry.kind.number(word) != *value
            {
                return Err(format!("{key} = {value}: the drive does not take this value"));
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
