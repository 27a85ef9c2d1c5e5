//! Storing in a drive's non-volatile memory, proved by a reset.

use masseter_can::canopen::{NmtCommand, ObjectAddress};
use masseter_model::geometry::AXIS_NAMES;
use masseter_runtime::clock::{MILLISECOND_NS, SECOND_NS};
use masseter_scenario::StoreConfig;

use super::line::Line;
use super::line_error::{LineError, SdoReason};

/// "save", the last letter in the highest byte (CiA 301, 7.5.2.13).
const SAVE: u32 = 0x6576_6173;
/// Time between two looks at a drive that stores, ns.
const LOOK_NS: u64 = 100 * MILLISECOND_NS;
/// How long a drive may take to boot, ns.
const BOOT_NS: u64 = 10 * SECOND_NS;
/// Silence after a boot-up message that ends the boot: a boot loader sends a message of its own before, ns.
const SETTLED_NS: u64 = SECOND_NS;

/// Why a drive did not store.
#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    /// It is not done in time.
    #[error(
        "{}: {object} did not show within {timeout_ms} ms that the drive stored; raise drive_profile.store.timeout_ms",
        AXIS_NAMES[*axis]
    )]
    Late {
        /// The axis.
        axis: usize,
        /// The object that stores.
        object: ObjectAddress,
        /// The time that it had, ms.
        timeout_ms: u32,
    },
    /// No boot-up message after the reset.
    #[error("{}: no boot-up message within {} s of the reset; check the drive", AXIS_NAMES[*axis], BOOT_NS / SECOND_NS)]
    NoBoot {
        /// The axis.
        axis: usize,
    },
    /// The line.
    #[error(transparent)]
    Line(#[from] LineError),
}

/// Stores, and waits until the drive is done.
///
/// # Errors
/// [`StoreError`].
pub fn store(line: &mut Line, axis: usize, config: StoreConfig) -> Result<(), StoreError> {
    let (object, timeout_ms) = (ObjectAddress::new(0x1010, config.subindex), config.timeout_ms);
    let until_ns = line.now_ns() + u64::from(timeout_ms) * MILLISECOND_NS;
    // Some drives answer nothing until they are done.
    unless_silent(line.write(axis, object, SAVE, 4))?;
    loop {
        let read = line.read_number(axis, object);
        if matches!(read, Ok(word) if word & 1 == 1) {
            return Ok(());
        }
        if line.now_ns() >= until_ns {
            read?;
            return Err(StoreError::Late { axis, object, timeout_ms });
        }
        unless_silent(read)?;
        line.listen(LOOK_NS)?;
    }
}

/// Resets a drive, so that it starts from its memory, and waits for the last of its boot-up messages.
///
/// # Errors
/// [`StoreError`].
pub fn reset(line: &mut Line, axis: usize) -> Result<(), StoreError> {
    let boot_ups = |line: &Line| line.heard(axis).boot_ups;
    let before = boot_ups(line);
    line.command(axis, NmtCommand::ResetNode)?;
    if !line.listen_until(BOOT_NS, |line| boot_ups(line) > before)? {
        return Err(StoreError::NoBoot { axis });
    }
    let mut heard = boot_ups(line);
    while line.listen_until(SETTLED_NS, |line| boot_ups(line) > heard)? {
        heard = boot_ups(line);
    }
    Ok(())
}

/// A value, or none from a drive that is silent.
fn unless_silent<T>(answer: Result<T, LineError>) -> Result<Option<T>, LineError> {
    match answer {
        Err(LineError::Sdo { reason: SdoReason::Silent, .. }) => Ok(None),
        answer => answer.map(Some),
    }
}

#[cfg(test)]
mod tests {
    use std::io;

    use masseter_scenario::Scenario;

    use super::*;

    #[test]
    fn a_stored_value_survives_the_reset_and_another_does_not() {
        let mut line = Line::open(&Scenario::default(), Box::new(io::sink())).unwrap();
        line.listen(100 * MILLISECOND_NS).unwrap();
        let window = ObjectAddress::new(0x6065, 0);
        let delivered = line.read_number(3, window).unwrap();
        line.write(3, window, 77, 4).unwrap();
        reset(&mut line, 3).unwrap();
        assert_eq!(line.read_number(3, window).unwrap(), delivered);
        line.write(3, window, 77, 4).unwrap();
        store(&mut line, 3, StoreConfig::default()).unwrap();
        reset(&mut line, 3).unwrap();
        assert_eq!(line.read_number(3, window).unwrap(), 77);
    }
}
