//! The PDOs and objects of a drive: wanted, found, or to be restored.
//!
//! One form serves all three. A [`Survey`] holds what was read from a drive. This module sends nothing but uploads.

use std::collections::BTreeMap;

use masseter_can::EVERY_SYNC;
use masseter_can::canopen::{CobId, Expedited, ObjectAddress};
use masseter_scenario::{ObjectKey, ObjectRule};
use serde::{Deserialize, Serialize};

use super::errors::{LineError, SdoReason};
use super::line::Line;
use crate::master::sdo::number;
use crate::master::wanted::{COB_ID_BITS, OTHER_PDOS, WantedDrive, may_keep};

/// The COB-ID of a PDO that does not exist.
const NO_PDO: u32 = CobId(0).invalidated().0;

/// One object.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Setting {
    /// Its address.
    pub object: ObjectKey,
    /// Its value.
    pub value: u32,
    /// Bytes of the value.
    pub bytes: usize,
    /// Whether it is written or compared.
    pub rule: ObjectRule,
    /// The key of the scenario that decides the value.
    pub key: String,
}

/// One PDO.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct PdoSetting {
    /// Index of its communication parameter; that of its mapping is 200h higher.
    pub communication: u16,
    /// Its COB-ID. Without [`layout`](Self::layout) only its validity counts.
    pub cob_id: u32,
    /// What it carries and when; none where that does not matter.
    pub layout: Option<PdoLayout>,
}

/// What a PDO carries and when.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct PdoLayout {
    /// Transmission type.
    pub transmission: u32,
    /// Inhibit time; none for RPDOs and for drives that have none.
    pub inhibit: Option<u32>,
    /// Event timer of a TPDO, like `inhibit`.
    pub event: Option<u32>,
    /// The mapped objects: index, sub-index, bits.
    pub mapping: Vec<u32>,
}

/// PDOs and objects of a drive.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Settings {
    /// The PDOs.
    pub pdos: Vec<PdoSetting>,
    /// The objects, in the order in which they are written.
    pub objects: Vec<Setting>,
}

/// An object that is not as it shall be.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Difference {
    /// Its address.
    pub object: ObjectAddress,
    /// Its value as it shall be.
    pub wanted: u32,
    /// Its value; none where the drive has no such object.
    pub found: Option<u32>,
    /// Whether it is written or compared.
    pub rule: ObjectRule,
    /// The key of the scenario that decides the value.
    pub key: String,
}

impl Difference {
    /// Whether the drive may keep its value.
    pub fn may_stay(&self) -> bool {
        may_keep(self.rule, self.object)
    }
}

impl PdoSetting {
    /// Address of a part of the communication parameter.
    pub const fn part(&self, subindex: u8) -> ObjectAddress {
        ObjectAddress::new(self.communication, subindex)
    }

    /// Address of a part of the mapping.
    pub const fn mapped(&self, place: u8) -> ObjectAddress {
        ObjectAddress::new(self.communication + 0x200, place)
    }

    /// Whether it is sent by the drive.
    pub const fn is_transmitted(&self) -> bool {
        self.communication >= 0x1800
    }

    /// Whether a COB-ID is right: the number counts for a PDO that exists.
    pub(super) fn has_cob_id(&self, found: u32) -> bool {
        if CobId(self.cob_id).is_valid() {
            (self.cob_id ^ found) & COB_ID_BITS == 0
        } else {
            !CobId(found).is_valid()
        }
    }

    /// The parts but the COB-ID with their values.
    fn parts(&self) -> Vec<(ObjectAddress, u32)> {
        let Some(PdoLayout { transmission, inhibit, event, mapping }) = &self.layout else {
            return Vec::new();
        };
        let timers = [(3, *inhibit), (5, *event)];
        let timers = timers.into_iter().filter_map(|(part, value)| Some((self.part(part), value?)));
        let mapped = (1..).zip(mapping).map(|(place, &object)| (self.mapped(place), object));
        [(self.part(2), *transmission), (self.mapped(0), mapping.len() as u32)]
            .into_iter()
            .chain(timers)
            .chain(mapped)
            .collect()
    }
}

impl Settings {
    /// What the rig needs.
    pub fn wanted(wanted: &WantedDrive) -> Self {
        let pdos = wanted.pdos.iter().map(|pdo| {
            let timer = (pdo.communication >= 0x1800).then_some(0);
            let transmission = EVERY_SYNC.into();
            let layout = PdoLayout {
                transmission,
                inhibit: timer,
                event: timer,
                mapping: pdo.mapping.entries().to_vec(),
            };
            PdoSetting { communication: pdo.communication, cob_id: pdo.cob_id, layout: Some(layout) }
        });
        let others =
            OTHER_PDOS.map(|communication| PdoSetting { communication, cob_id: NO_PDO, layout: None });
        let home = Some(wanted.home).filter(|home| home.rule != ObjectRule::Absent);
        let objects = home.iter().chain(&wanted.objects).map(|wanted| Setting {
            object: ObjectKey(wanted.object),
            value: wanted.value,
            bytes: wanted.bytes,
            // A drive without the object has its home at its own zero.
            rule: if home == Some(*wanted) && wanted.value == 0 { ObjectRule::Optional } else { wanted.rule },
            key: wanted.key.to_owned(),
        });
        Self { pdos: pdos.chain(others).collect(), objects: objects.collect() }
    }

    /// The addresses of the objects.
    pub fn addresses(&self) -> impl Iterator<Item = ObjectAddress> {
        self.objects.iter().map(|setting| setting.object.0)
    }

    /// The same objects and PDOs with the values that were found, without those that the drive does not have.
    #[must_use]
    pub fn found(&self, survey: &Survey) -> Self {
        let pdo = |like: &PdoSetting| {
            let read = |part| survey.number(like.part(part));
            let timer = |part| read(part).filter(|_| like.is_transmitted());
            let mapping = || {
                let count = survey.number(like.mapped(0)).and_then(|count| u8::try_from(count).ok())?;
                (1..=count).map(|place| survey.number(like.mapped(place))).collect::<Option<Vec<_>>>()
            };
            let layout = || {
                let (inhibit, event) = (timer(3), timer(5));
                Some(PdoLayout { transmission: read(2)?, inhibit, event, mapping: mapping()? })
            };
            let layout = like.layout.as_ref().and_then(|_| layout());
            Some(PdoSetting { communication: like.communication, cob_id: read(1)?, layout })
        };
        let object = |like: &Setting| {
            let value = survey.number(like.object.0)?;
            Some(Setting { value, ..like.clone() })
        };
        Self {
            pdos: self.pdos.iter().filter_map(pdo).collect(),
            objects: self.objects.iter().filter_map(object).collect(),
        }
    }

    /// What is not as it shall be. An optional object may be absent, and so may the timers and PDOs that nobody needs.
    pub fn differences(&self, survey: &Survey) -> Vec<Difference> {
        let mut differences = Vec::new();
        for pdo in &self.pdos {
            let mut add = |object, wanted, found| {
                let key = "can.node_ids".to_owned();
                differences.push(Difference { object, wanted, found, rule: ObjectRule::Write, key });
            };
            let (cob_id, found) = (pdo.part(1), survey.number(pdo.part(1)));
            let is_missing = found.is_none() && pdo.layout.is_some();
            if is_missing || found.is_some_and(|found| !pdo.has_cob_id(found)) {
                add(cob_id, pdo.cob_id, found);
            }
            for (object, wanted) in pdo.parts() {
                let found = survey.number(object);
                let is_timer = object.index < 0x1A00 && object.subindex > 2;
                if found.is_some_and(|found| found != wanted) || (found.is_none() && !is_timer) {
                    add(object, wanted, found);
                }
            }
        }
        for Setting { object: ObjectKey(object), value, bytes, rule, key } in &self.objects {
            let found = survey.number(*object);
            let is_right = found.map_or(*rule == ObjectRule::Optional, |found| same(found, *value, *bytes));
            if !is_right {
                let (object, wanted) = (*object, *value);
                differences.push(Difference { object, wanted, found, rule: *rule, key: key.clone() });
            }
        }
        differences
    }
}

/// Whether two values have the same lowest bytes.
pub(super) fn same(one: u32, other: u32, bytes: usize) -> bool {
    (one ^ other) & (u32::MAX >> (32 - 8 * bytes)) == 0
}

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
        (value.len() <= Expedited::MAX).then(|| number(value))
    }

    /// A text.
    pub fn text(&self, object: ObjectAddress) -> Option<String> {
        let value = self.readings.get(&object)?.as_ref().ok()?;
        Some(String::from_utf8_lossy(value).trim_end_matches('\0').to_owned())
    }
}
