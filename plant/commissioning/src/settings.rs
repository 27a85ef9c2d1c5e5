//! The PDOs and objects of a drive: wanted, found, or to be restored.
//!
//! One form serves all three. A [`Survey`] holds the answers of a drive. This module sends only uploads.

use std::collections::BTreeMap;

use masseter_can::canopen::{Expedited, ObjectAddress};
use masseter_plant::sdo::{SdoReason, number};
use masseter_plant::wanted::{PdoLayout, PdoSetting, Setting, WantedDrive, may_keep};
use masseter_scenario::{ObjectKey, ObjectRule};
use serde::{Deserialize, Serialize};

use crate::{line::Line, line_error::LineError};

/// PDOs and objects of a drive.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Settings {
    /// The PDOs.
    pub pdos: Vec<PdoSetting>,
    /// The objects, in the order of the writes.
    pub objects: Vec<Setting>,
}

/// An object with a deviation.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Difference {
    /// The wanted object.
    pub wanted: Setting,
    /// Its value; none for a drive without the object.
    pub found: Option<u32>,
}

impl Difference {
    /// Whether the drive may keep its value.
    pub fn may_stay(&self) -> bool {
        may_keep(self.wanted.rule, self.wanted.object.0)
    }
}

impl Settings {
    /// The settings that the rig needs.
    pub fn wanted(wanted: &WantedDrive) -> Self {
        let mut home = Some(&wanted.home).filter(|home| home.rule != ObjectRule::Absent).cloned();
        // A drive without the object has its home at its own zero.
        if let Some(home) = home.as_mut().filter(|home| home.value == 0) {
            home.rule = ObjectRule::Optional;
        }
        let objects = home.into_iter().chain(wanted.objects.iter().cloned()).collect();
        Self { pdos: wanted.pdos.clone(), objects }
    }

    /// The addresses of the objects.
    pub fn addresses(&self) -> impl Iterator<Item = ObjectAddress> {
        self.objects.iter().map(|setting| setting.object.0)
    }

    /// These objects and PDOs with the found values, without objects that the drive lacks.
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

    /// The deviations. An optional object may be absent, and also timers and PDOs without a use.
    pub fn differences(&self, survey: &Survey) -> Vec<Difference> {
        let mut differences = Vec::new();
        for pdo in &self.pdos {
            let mut add = |object, value, found| {
                let (rule, key) = (ObjectRule::Write, "can.node_ids".to_owned());
                let wanted = Setting { object: ObjectKey(object), value, bytes: 4, rule, key };
                differences.push(Difference { wanted, found });
            };
            let (cob_id, found) = (pdo.part(1), survey.number(pdo.part(1)));
            let is_missing = found.is_none() && pdo.layout.is_some();
            if is_missing || found.is_some_and(|found| !pdo.has_cob_id(found)) {
                add(cob_id, pdo.cob_id, found);
            }
            for (object, wanted) in pdo.parts() {
                let found = survey.number(object);
                if found.map_or(!pdo.is_timer(object), |found| found != wanted) {
                    add(object, wanted, found);
                }
            }
        }
        differences.extend(self.objects.iter().filter_map(|wanted| {
            let found = survey.number(wanted.object.0);
            let is_right =
                found.map_or(wanted.rule == ObjectRule::Optional, |found| wanted.is_shown_by(found));
            (!is_right).then(|| Difference { wanted: wanted.clone(), found })
        }));
        differences
    }
}

/// Device, state and units: objects of one value, and objects of several with their last sub-index.
const SINGLE: [u16; 15] = [
    0x1000, 0x1001, 0x1003, 0x1008, 0x1009, 0x100A, 0x6502, 0x6041, 0x6061, 0x603F, 0x6064, 0x60FD, 0x60A8,
    0x60A9, 0x60AA,
];
const SEVERAL: [(u16, u8); 6] =
    [(0x1010, 1), (0x1018, 4), (0x608F, 2), (0x6091, 2), (0x6092, 2), (0x607D, 2)];
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
    /// Reads a drive: the common objects, its PDOs, and these objects. The first silence ends the survey.
    ///
    /// # Errors
    /// [`LineError`] except those of transfers, which are part of the survey.
    pub fn of_drive(
        line: &mut Line,
        axis: usize,
        objects: impl IntoIterator<Item = ObjectAddress>,
    ) -> Result<Self, LineError> {
        let mut survey = Self::default();
        let several = SEVERAL.iter().flat_map(|&(index, last)| (1..=last).map(move |part| (index, part)));
        for (index, subindex) in SINGLE.map(|index| (index, 0)).into_iter().chain(several) {
            survey.read(line, axis, ObjectAddress::new(index, subindex))?;
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
    pub(crate) fn insert(&mut self, object: ObjectAddress, value: u32) {
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

    /// Every requested object with its answer.
    pub fn readings(&self) -> impl Iterator<Item = (ObjectAddress, &Result<Vec<u8>, SdoReason>)> {
        self.readings.iter().map(|(&object, reading)| (object, reading))
    }

    /// The reason for an unread object.
    pub fn refusal(&self, object: ObjectAddress) -> Option<SdoReason> {
        self.readings.get(&object)?.as_ref().err().copied()
    }

    /// An object of at most four bytes.
    pub fn number(&self, object: ObjectAddress) -> Option<u32> {
        let value = self.readings.get(&object)?.as_ref().ok()?;
        (value.len() <= Expedited::MAX).then(|| number(value))
    }

    /// A text.
    pub fn string(&self, object: ObjectAddress) -> Option<String> {
        let value = self.readings.get(&object)?.as_ref().ok()?;
        Some(String::from_utf8_lossy(value).trim_end_matches('\0').to_owned())
    }
}
