//! The write of settings to a drive: PDOs by the standard's procedure, objects one by one, every value read back.

use masseter_can::canopen::{AbortCode, CobId, NmtCommand, ObjectAddress};
use masseter_model::geometry::AXIS_NAMES;
use masseter_plant::wanted::{COB_ID_BITS, PdoSetting, Setting, may_keep};
use masseter_runtime::clock::MILLISECOND_NS;
use masseter_scenario::{DriveProfile, ObjectKey, ObjectRule};
use serde::Serialize;

use crate::object_words::{object_name, value_text};
use crate::settings::{Settings, Survey};
use crate::{deviation::as_text, line::Line, line_error::LineError};

/// Longest time of a drive to become pre-operational, ns.
const ENTER_NS: u64 = 100 * MILLISECOND_NS;

/// A written value.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Change {
    /// The object.
    #[serde(serialize_with = "as_text")]
    pub object: ObjectAddress,
    /// Its name.
    pub name: &'static str,
    /// Its value before; none if unreadable.
    pub before: Option<String>,
    /// Its value now.
    pub after: String,
}

/// The reason why a drive lacks its settings.
#[derive(Debug, thiserror::Error)]
pub enum WriteError {
    /// The drive refuses a value.
    #[error(
        "{}: object {object} ({}) := {}: {code}{limits}; change {key}",
        AXIS_NAMES[*axis], object_name(*object), value_text(*object, *value)
    )]
    Refused {
        /// The axis.
        axis: usize,
        /// The object.
        object: ObjectAddress,
        /// The value.
        value: u32,
        /// The drive's reason.
        code: AbortCode,
        /// The limits of the profile in words; may be empty.
        limits: String,
        /// The key of the scenario that decides the value.
        key: String,
    },
    /// The drive acknowledges a value and shows another.
    #[error("{source}; change {key}")]
    NotKept {
        /// The object with its values.
        source: LineError,
        /// The key of the scenario that decides the value.
        key: String,
    },
    /// The line.
    #[error(transparent)]
    Line(#[from] LineError),
}

/// Writes settings to one drive, and keeps a list of the changes.
pub struct Writer<'a> {
    line: &'a mut Line,
    axis: usize,
    profile: &'a DriveProfile,
    changes: Vec<Change>,
}

impl<'a> Writer<'a> {
    /// The writer for the drive of an axis.
    pub fn new(line: &'a mut Line, axis: usize, profile: &'a DriveProfile) -> Self {
        Self { line, axis, profile, changes: Vec::new() }
    }

    /// Every written value.
    pub fn into_changes(self) -> Vec<Change> {
        self.changes
    }

    /// Makes the drive pre-operational, because many drives take PDO parameters in no other state. Writes the
    /// differences from the survey. The first refusal ends the writes.
    ///
    /// # Errors
    /// [`WriteError`].
    pub fn apply(&mut self, settings: &Settings, survey: &Survey) -> Result<(), WriteError> {
        self.line.command(self.axis, NmtCommand::EnterPreOperational)?;
        self.line.listen(ENTER_NS)?;
        for pdo in &settings.pdos {
            self.write_pdo(pdo, survey)?;
        }
        for setting in in_order(&settings.objects, survey) {
            self.write_object(setting, survey)?;
        }
        Ok(())
    }

    /// The PDO ceases to exist while it changes (CiA 301, 7.5.2.36).
    fn write_pdo(&mut self, pdo: &PdoSetting, survey: &Survey) -> Result<(), WriteError> {
        let alone = Settings { pdos: vec![pdo.clone()], objects: Vec::new() };
        let (cob_id, Some(found)) = (pdo.part(1), survey.number(pdo.part(1))) else { return Ok(()) };
        if alone.differences(survey).is_empty() {
            return Ok(());
        }
        let key = "can.node_ids";
        let invalid = CobId(found).invalidated();
        if CobId(found).is_valid() {
            self.write(cob_id, invalid.0, 4, key, Some(found))?;
        }
        if let Some(layout) = &pdo.layout {
            self.write(pdo.mapped(0), 0, 1, key, survey.number(pdo.mapped(0)))?;
            for (place, &object) in (1..).zip(&layout.mapping) {
                let before = survey.number(pdo.mapped(place));
                if before != Some(object) {
                    self.write(pdo.mapped(place), object, 4, key, before)?;
                }
            }
            self.write(pdo.mapped(0), layout.mapping.len() as u32, 1, key, Some(0))?;
            let parts = [(2, Some(layout.transmission), 1), (3, layout.inhibit, 2), (5, layout.event, 2)];
            for (part, value, bytes) in parts {
                let before = survey.number(pdo.part(part));
                if let (Some(value), Some(before)) = (value, before)
                    && value != before
                {
                    self.write(pdo.part(part), value, bytes, key, Some(before))?;
                }
            }
        }
        if CobId(pdo.cob_id).is_valid() {
            // The drive keeps its bit for remote requests, which nobody sends.
            let value = pdo.cob_id & COB_ID_BITS | found & !COB_ID_BITS;
            self.write(cob_id, value, 4, key, Some(invalid.0))?;
        }
        Ok(())
    }

    fn write_object(&mut self, setting: &Setting, survey: &Survey) -> Result<(), WriteError> {
        let Setting { object: ObjectKey(object), value, bytes, rule, ref key } = *setting;
        let before = survey.number(object);
        let is_right = before.is_some_and(|before| setting.is_shown_by(before));
        let is_left = rule == ObjectRule::Expect || (rule == ObjectRule::Optional && before.is_none());
        if is_right || is_left {
            return Ok(());
        }
        match self.write(object, value, bytes, key, before) {
            Err(WriteError::Refused { .. }) if may_keep(rule, object) => Ok(()),
            written => written,
        }
    }

    fn write(
        &mut self,
        object: ObjectAddress,
        value: u32,
        bytes: usize,
        key: &str,
        before: Option<u32>,
    ) -> Result<(), WriteError> {
        let (axis, key) = (self.axis, key.to_owned());
        let written = self.line.write(axis, object, value, bytes);
        let shown = match written {
            Ok(()) => Some(value),
            Err(LineError::NotKept { found, .. }) => found,
            Err(_) => None,
        };
        self.changes.extend(shown.map(|shown| Change {
            object,
            name: object_name(object),
            before: before.map(|before| value_text(object, before)),
            after: value_text(object, shown),
        }));
        written.map_err(|error| match error.abort_code() {
            Some(code) => WriteError::Refused { axis, object, value, code, limits: self.limits(object), key },
            None if matches!(error, LineError::NotKept { .. }) => WriteError::NotKept { source: error, key },
            None => error.into(),
        })
    }

    fn limits(&self, object: ObjectAddress) -> String {
        let config = self.profile.object(ObjectKey(object));
        let end = |end: Option<i64>| end.map_or_else(|| "any".to_owned(), |end| end.to_string());
        match (config.lowest, config.highest) {
            (None, None) => String::new(),
            (lowest, highest) => format!("; the profile takes {} to {}", end(lowest), end(highest)),
        }
    }
}

/// Drives refuse software limits that cross, so the limit that moves away from the other comes first.
fn in_order<'s>(settings: &'s [Setting], survey: &Survey) -> Vec<&'s Setting> {
    let mut settings: Vec<_> = settings.iter().collect();
    let place = |subindex| {
        let limit = ObjectKey(ObjectAddress::new(0x607D, subindex));
        settings.iter().position(|setting| setting.object == limit)
    };
    if let (Some(lower), Some(upper)) = (place(1), place(2)) {
        let old_upper = survey.number(ObjectAddress::new(0x607D, 2)).unwrap_or(0) as i32;
        let is_upper_first = settings[lower].value as i32 > old_upper;
        if is_upper_first != (upper < lower) {
            settings.swap(lower, upper);
        }
    }
    settings
}

#[cfg(test)]
mod tests {
    use std::io;

    use masseter_can::canopen::NodeId;
    use masseter_plant::wanted::WantedDrive;
    use masseter_scenario::Scenario;

    use super::*;

    const AXIS: usize = 3;

    fn line(scenario: &Scenario) -> (Line, Settings) {
        let mut line = Line::open(scenario, Box::new(io::sink())).unwrap();
        line.listen(100 * MILLISECOND_NS).unwrap();
        let node = NodeId::new(scenario.can.node_ids[AXIS]).unwrap();
        (line, Settings::wanted(&WantedDrive::of_axis(scenario, AXIS, node).unwrap()))
    }

    fn survey(line: &mut Line, settings: &Settings) -> Survey {
        Survey::of_drive(line, AXIS, settings.addresses()).unwrap()
    }

    fn set(line: &mut Line, index: u16, subindex: u8, value: u32, bytes: usize) {
        line.write(AXIS, ObjectAddress::new(index, subindex), value, bytes).unwrap();
    }

    /// The drive of an EPOS4 as delivered: one object in each PDO, other types, a further PDO.
    fn as_delivered(line: &mut Line) {
        for (communication, object) in [(0x1400, 0x6040_0010), (0x1800, 0x6041_0010)] {
            let cob_id = line.read_number(AXIS, ObjectAddress::new(communication, 1)).unwrap();
            set(line, communication, 1, CobId(cob_id).invalidated().0, 4);
            set(line, communication + 0x200, 0, 0, 1);
            set(line, communication + 0x200, 1, object, 4);
            set(line, communication + 0x200, 0, 1, 1);
            set(line, communication, 2, 255, 1);
            set(line, communication, 1, cob_id, 4);
        }
        set(line, 0x1601, 1, 0x6040_0010, 4);
        set(line, 0x1601, 0, 1, 1);
        set(line, 0x1401, 1, 0x304, 4);
        set(line, 0x6066, 0, 7, 2);
    }

    #[test]
    fn a_drive_as_delivered_gets_the_rigs_objects_and_its_own_back() {
        let scenario = Scenario::default();
        let (mut line, wanted) = line(&scenario);
        as_delivered(&mut line);
        let delivered = survey(&mut line, &wanted);
        assert_eq!(wanted.differences(&delivered).len(), 10, "{:?}", wanted.differences(&delivered));
        let before = wanted.found(&delivered);
        let profile = scenario.profile(AXIS);
        let mut writer = Writer::new(&mut line, AXIS, profile);
        writer.apply(&wanted, &delivered).unwrap();
        let changes = writer.into_changes();
        assert_eq!(changes.last().unwrap().after, "20", "{changes:?}");
        let configured = survey(&mut line, &wanted);
        assert_eq!(wanted.differences(&configured), []);
        let mut writer = Writer::new(&mut line, AXIS, profile);
        writer.apply(&wanted, &configured).unwrap();
        assert_eq!(writer.into_changes(), [], "equal values are not written again");
        Writer::new(&mut line, AXIS, profile).apply(&before, &configured).unwrap();
        assert_eq!(survey(&mut line, &wanted), delivered);
    }

    #[test]
    fn a_refusal_names_object_value_limits_and_key() {
        let text = "[[drive_profile]]\nobjects.60C2h = { rule = 'absent' }\n\
                objects.'60C2h:01' = { rule = 'absent' }\nobjects.'60C2h:02' = { value = -9, lowest = -9 }";
        let scenario = Scenario::parse(std::path::Path::new("robot.toml"), text).unwrap();
        let (mut line, wanted) = line(&scenario);
        let found = survey(&mut line, &wanted);
        let mut writer = Writer::new(&mut line, AXIS, scenario.profile(AXIS));
        let refusal = writer.apply(&wanted, &found).unwrap_err().to_string();
        assert_eq!(
            refusal,
            "l1: object 60C2h:02h (Interpolation time index) := -9: 06090032h (value is too low); the profile takes -9 to \
         any; change rate_hz"
        );
    }

    /// A drive may lack the torque offset, but not keep one. Here another node answers in its place with "read-only".
    #[test]
    fn an_offset_that_a_drive_keeps_is_refused_and_another_optional_value_is_left() {
        for (index, is_refused) in [(0x60B2_u16, true), (0x6072, false)] {
            let [high, low] = index.to_be_bytes();
            let faults = format!(
                "[[faults]]\nkind = 'lose'\nbus = 1\nnode = 4\nid = 0x604\nfrom_s = 0.15\n\
             [[faults]]\nkind = 'babble'\nbus = 1\nnode = 5\nid = 0x584\ncount = 1\nfrom_s = 0.2005\n\
             data = [0x80, {low}, {high}, 0, 2, 0, 1, 6]\n"
            );
            let scenario = Scenario::parse(std::path::Path::new("robot.toml"), &faults).unwrap();
            let (mut line, _) = line(&scenario);
            let object = ObjectAddress::new(index, 0);
            let mut found = Survey::default();
            found.insert(object, 55);
            let rule = ObjectRule::Optional;
            let zero =
                Setting { object: ObjectKey(object), value: 0, bytes: 2, rule, key: "profile".to_owned() };
            let settings = Settings { pdos: vec![], objects: vec![zero] };
            let applied = Writer::new(&mut line, AXIS, scenario.profile(AXIS)).apply(&settings, &found);
            let refused = matches!(applied, Err(WriteError::Refused { code: AbortCode::READ_ONLY, .. }));
            assert_eq!((applied.is_err(), refused), (is_refused, is_refused), "{index:X}: {applied:?}");
            assert_eq!(settings.differences(&found)[0].may_stay(), !is_refused);
        }
    }

    #[test]
    fn software_limits_never_cross() {
        let scenario = Scenario::default();
        let (mut line, wanted) = line(&scenario);
        let values = |subindex| {
            let limit = ObjectKey(ObjectAddress::new(0x607D, subindex));
            wanted.objects.iter().find(|setting| setting.object == limit).unwrap().value as i32
        };
        let [low, high] = [values(1), values(2)];
        for [old_low, old_high] in [[low - 900, low - 800], [high + 800, high + 900], [low + 1, high - 1]] {
            // The emulated drive refuses limits that cross.
            set(&mut line, 0x607D, 1, i32::MIN as u32, 4);
            set(&mut line, 0x607D, 2, old_high as u32, 4);
            set(&mut line, 0x607D, 1, old_low as u32, 4);
            let found = survey(&mut line, &wanted);
            let mut writer = Writer::new(&mut line, AXIS, scenario.profile(AXIS));
            writer.apply(&wanted, &found).unwrap();
            let changes = writer.into_changes();
            let limits = changes.iter().filter(|change| change.object.index == 0x607D);
            assert_eq!(limits.count(), 2, "{changes:?}");
        }
    }
}
