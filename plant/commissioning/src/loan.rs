//! Objects of one drive that a step changes for its own duration, and the return of their old values.

use std::mem;

use masseter_can::canopen::ObjectAddress;
use masseter_plant::wanted::value_bits;
use masseter_scenario::{DriveProfile, ObjectKey, ObjectRule};

use crate::line::{Line, OldValue};
use crate::line_error::LineError;

/// A value for the duration of a step.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Loan {
    pub(crate) object: ObjectAddress,
    pub(crate) value: u32,
    pub(crate) bytes: usize,
    /// Whether the drive may lack the object or refuse the value, for every profile.
    pub(crate) may_lack: bool,
}

impl Loan {
    /// The lowest bytes of a value.
    pub(crate) const fn new(index: u16, subindex: u8, value: u32, bytes: usize) -> Self {
        Self { object: ObjectAddress::new(index, subindex), value, bytes, may_lack: false }
    }
}

/// The changed objects of a drive, in the order of their changes.
#[derive(Debug)]
pub(crate) struct Borrowed<'a> {
    axis: usize,
    profile: &'a DriveProfile,
    old: Vec<OldValue>,
}

impl<'a> Borrowed<'a> {
    /// No changes.
    pub(crate) const fn of_axis(axis: usize, profile: &'a DriveProfile) -> Self {
        Self { axis, profile, old: Vec::new() }
    }

    /// Writes values by the profile's rules. Keeps all old values before the first write.
    pub(crate) fn set_all(&mut self, line: &mut Line, loans: &[Loan]) -> Result<(), LineError> {
        let mut writes = Vec::new();
        for loan in loans {
            if let Some(may_lack) = self.may_lack(loan)
                && let Some(old) = self.read(line, loan, may_lack)?
            {
                writes.push((loan, may_lack, old));
            }
        }
        if writes.is_empty() {
            return Ok(());
        }
        // A kill may come in between.
        self.old.extend(writes.iter().map(|(.., old)| *old));
        line.keep_old_values(self.axis, &self.old)?;
        for (loan, may_lack, old) in writes {
            match line.write(self.axis, loan.object, loan.value, loan.bytes) {
                // The drive has refused, so nothing has changed. Without an answer the drive may have the value.
                Err(error) if error.abort_code().is_some() => {
                    let place = self.old.iter().rposition(|kept| *kept == old);
                    self.old.remove(place.expect("it was kept"));
                    line.keep_old_values(self.axis, &self.old)?;
                    if !may_lack {
                        return Err(error);
                    }
                }
                written => written?,
            }
        }
        Ok(())
    }

    /// Whether the drive may lack the object or refuse the value; none where the profile leaves the object.
    fn may_lack(&self, loan: &Loan) -> Option<bool> {
        match self.profile.object(ObjectKey(loan.object)).rule {
            _ if loan.may_lack => Some(true),
            ObjectRule::Absent | ObjectRule::Expect => None,
            ObjectRule::Optional => Some(true),
            ObjectRule::Write => Some(false),
        }
    }

    /// The old value; none without a write. An equal value is not written, because some objects are constant.
    fn read(&self, line: &mut Line, loan: &Loan, may_lack: bool) -> Result<Option<OldValue>, LineError> {
        let &Loan { object, value, bytes, .. } = loan;
        match line.read_number(self.axis, object) {
            Err(error) if may_lack && error.abort_code().is_some() => Ok(None),
            Err(error) => Err(error),
            Ok(before) if (before ^ value) & value_bits(bytes) == 0 => Ok(None),
            Ok(before) => Ok(Some(OldValue { object: ObjectKey(object), value: before, bytes })),
        }
    }

    /// Sets the software limits (607Dh) to positions of 6064h, in increments. The lower limit is never above the upper.
    pub(crate) fn set_limits(&mut self, line: &mut Line, ends: [i32; 2]) -> Result<(), LineError> {
        let offset = self.limit_offset(line)?;
        let [lowest, highest] = ends.map(|end| end.saturating_sub(offset) as u32);
        let mut limits = [(1, lowest), (2, highest)].map(|(end, value)| Loan::new(0x607D, end, value, 4));
        if lowest as i32 > line.read_number(self.axis, limits[1].object)? as i32 {
            limits.reverse();
        }
        self.set_all(line, &limits)
    }

    /// Addend of the drive to its software limits, increments: the drive's present position at home.
    fn limit_offset(&self, line: &mut Line) -> Result<i32, LineError> {
        let homing = self.profile.homing;
        if !homing.limits_from_home {
            return Ok(0);
        }
        // Without such an object the drive has no offset.
        let home = line.read_if_there(self.axis, homing.home_object.0)?.unwrap_or(0);
        Ok((home as i32).saturating_mul(homing.home_sign.into()))
    }

    /// Writes every old value back, the last change first. A failure does not stop the other writes.
    pub(crate) fn restore(&mut self, line: &mut Line) -> Result<(), LineError> {
        let failures = write_back(line, self.axis, &mem::take(&mut self.old));
        let left: Vec<_> = failures.iter().rev().map(|(old, _)| *old).collect();
        let kept = line.keep_old_values(self.axis, &left);
        failures.into_iter().next().map_or(kept, |(_, error)| Err(error))
    }
}

/// Writes the old values of a killed step back, the last change first. Returns the values that the drive refuses: the
/// drive never takes them, so the ledger may drop them.
///
/// # Errors
/// The first failure. The other values have returned.
pub fn give_back(line: &mut Line, axis: usize, old: &[OldValue]) -> Result<Vec<OldValue>, LineError> {
    let failures = write_back(line, axis, old);
    let (refused, lost): (Vec<_>, Vec<_>) =
        failures.into_iter().partition(|(_, error)| error.abort_code().is_some());
    let left: Vec<_> = lost.iter().rev().map(|(old, _)| *old).collect();
    line.keep_old_values(axis, &left)?;
    let refused = refused.into_iter().map(|(old, _)| old).collect();
    lost.into_iter().next().map_or(Ok(refused), |(_, error)| Err(error))
}

/// Writes the oldest value of each object, the last object first. Returns the failures in this order. A refused value
/// gets another attempt after the others, because software limits of a restarted drive must not cross either.
fn write_back(line: &mut Line, axis: usize, old: &[OldValue]) -> Vec<(OldValue, LineError)> {
    let mut write = |old: &OldValue| {
        let OldValue { object: ObjectKey(object), value, bytes } = *old;
        Some((*old, line.write(axis, object, value, bytes).err()?))
    };
    let is_oldest =
        |(place, one): &(usize, &OldValue)| old[..*place].iter().all(|other| other.object != one.object);
    let oldest: Vec<_> = old.iter().enumerate().filter(is_oldest).map(|(_, one)| one).collect();
    let failed: Vec<_> = oldest.into_iter().rev().filter_map(&mut write).collect();
    let again = |(old, error): (OldValue, LineError)| match error.abort_code() {
        Some(_) => write(&old),
        None => Some((old, error)),
    };
    failed.into_iter().filter_map(again).collect()
}
