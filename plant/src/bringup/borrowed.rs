//! Objects of one drive that a step changes for its own duration.

use masseter_can::canopen::ObjectAddress;
use masseter_shared::config::{DriveProfile, ObjectKey, ObjectRule};

use super::ledger::OldValue;
use super::line::{Line, LineError};

/// The changed objects of a drive, in the order of their changes.
#[derive(Debug)]
pub(super) struct Borrowed<'a> {
    axis: usize,
    profile: &'a DriveProfile,
    old: Vec<OldValue>,
}

impl<'a> Borrowed<'a> {
    /// Nothing is changed yet.
    pub(super) const fn of_axis(axis: usize, profile: &'a DriveProfile) -> Self {
        Self { axis, profile, old: Vec::new() }
    }

    /// Writes the lowest bytes of a value as the profile's rule allows, and keeps the old one.
    pub(super) fn set(
        &mut self,
        line: &mut Line,
        object: ObjectAddress,
        value: u32,
        bytes: usize,
    ) -> Result<(), LineError> {
        match self.profile.object(ObjectKey(object)).rule {
            ObjectRule::Absent | ObjectRule::Expect => Ok(()),
            ObjectRule::Optional => self.set_if_taken(line, object, value, bytes),
            ObjectRule::Write => self.replace(line, object, value, bytes),
        }
    }

    /// The same, unless the drive has no such object or refuses the value.
    pub(super) fn set_if_taken(
        &mut self,
        line: &mut Line,
        object: ObjectAddress,
        value: u32,
        bytes: usize,
    ) -> Result<(), LineError> {
        match self.replace(line, object, value, bytes) {
            Err(error) if error.abort_code().is_none() => Err(error),
            _ => Ok(()),
        }
    }

    /// An equal value is not written: some objects are constant. The old value is kept before: a kill may come between.
    fn replace(
        &mut self,
        line: &mut Line,
        object: ObjectAddress,
        value: u32,
        bytes: usize,
    ) -> Result<(), LineError> {
        let before = line.read_number(self.axis, object)?;
        let mask = u32::MAX >> (32 - 8 * bytes);
        if before & mask == value & mask {
            return Ok(());
        }
        self.old.push(OldValue { object: ObjectKey(object), value: before, bytes });
        line.keep_old_values(self.axis, &self.old)?;
        let written = line.write(self.axis, object, value, bytes);
        if written.is_err() {
            self.old.pop();
        }
        written
    }

    /// Sets the software limits (607Dh) to positions as 6064h shows them, in increments; never the lower one above the upper one.
    pub(super) fn set_limits(&mut self, line: &mut Line, ends: [i32; 2]) -> Result<(), LineError> {
        let offset = self.limit_offset(line)?;
        let [lowest, highest] = ends.map(|end| end.saturating_sub(offset) as u32);
        let [lower, upper] = [1, 2].map(|end| ObjectAddress::new(0x607D, end));
        if lowest as i32 > line.read_number(self.axis, upper)? as i32 {
            self.set(line, upper, highest, 4)?;
            return self.set(line, lower, lowest, 4);
        }
        self.set(line, lower, lowest, 4)?;
        self.set(line, upper, highest, 4)
    }

    /// What the drive adds to its software limits, increments: the position at home as the drive has it now.
    fn limit_offset(&self, line: &mut Line) -> Result<i32, LineError> {
        let homing = self.profile.homing;
        if !homing.limits_from_home {
            return Ok(0);
        }
        match line.read_number(self.axis, homing.home_object.0) {
            Ok(home) => Ok((home as i32).saturating_mul(homing.home_sign.into())),
            // Without such an object the drive has no offset.
            Err(error) if error.abort_code().is_some() => Ok(0),
            Err(error) => Err(error),
        }
    }

    /// Writes every old value back, the last change first. A failure does not keep the others from their old values.
    pub(super) fn restore(&mut self, line: &mut Line) -> Result<(), LineError> {
        let (mut restored, mut left) = (Ok(()), Vec::new());
        while let Some(old) = self.old.pop() {
            let OldValue { object: ObjectKey(object), value, bytes } = old;
            let written = line.write(self.axis, object, value, bytes);
            if written.is_err() {
                left.insert(0, old);
            }
            restored = restored.and(written);
        }
        restored.and(line.keep_old_values(self.axis, &left))
    }
}

/// Writes old values back that a killed step left, the last change first.
///
/// # Errors
/// The first failure; the other values have returned nevertheless.
pub fn give_back(
    line: &mut Line,
    axis: usize,
    profile: &DriveProfile,
    old: &[OldValue],
) -> Result<(), LineError> {
    Borrowed { axis, profile, old: old.to_vec() }.restore(line)
}
