//! Objects of one drive that a step changes for its own duration.

use masseter_can::canopen::ObjectAddress;

use super::line::{Line, LineError};

/// A changed object with its old value.
#[derive(Debug, Clone, Copy)]
struct Old {
    object: ObjectAddress,
    value: u32,
    bytes: usize,
}

/// The changed objects of a drive, in the order of their changes.
#[derive(Debug)]
pub(super) struct Borrowed {
    axis: usize,
    old: Vec<Old>,
}

impl Borrowed {
    /// Nothing is changed yet.
    pub(super) const fn of_axis(axis: usize) -> Self {
        Self { axis, old: Vec::new() }
    }

    /// Writes the lowest bytes of a value, and keeps the old one. An equal value is not written: some objects are constant.
    pub(super) fn set(
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
        line.write(self.axis, object, value, bytes)?;
        self.old.push(Old { object, value: before, bytes });
        Ok(())
    }

    /// Opens or closes the software limits (607Dh), never with the lower one above the upper one.
    pub(super) fn set_limits(
        &mut self,
        line: &mut Line,
        [lowest, highest]: [i32; 2],
    ) -> Result<(), LineError> {
        let [lower, upper] = [1, 2].map(|end| ObjectAddress::new(0x607D, end));
        if lowest > line.read_number(self.axis, upper)? as i32 {
            self.set(line, upper, highest as u32, 4)?;
            return self.set(line, lower, lowest as u32, 4);
        }
        self.set(line, lower, lowest as u32, 4)?;
        self.set(line, upper, highest as u32, 4)
    }

    /// Writes every old value back, the last change first. A failure does not keep the others from their old values.
    pub(super) fn restore(&mut self, line: &mut Line) -> Result<(), LineError> {
        let mut restored = Ok(());
        while let Some(Old { object, value, bytes }) = self.old.pop() {
            restored = restored.and(line.write(self.axis, object, value, bytes));
        }
        restored
    }
}
