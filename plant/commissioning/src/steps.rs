//! Steps without a motion: proof that a drive has no power, positions of all axes, storing, answers to SYNC.

use masseter_can::canopen::{NmtCommand, ObjectAddress};
use masseter_can::cia402::{Controlword, DriveState};
use masseter_model::geometry::{AXES, AXIS_NAMES};
use masseter_plant::sdo::SdoReason;
use masseter_runtime::clock::{MILLISECOND_NS, SECOND_NS};
use masseter_scenario::{Scenario, StoreConfig};
use serde::Serialize;

use crate::watch::{read_position, read_state, read_status};
use crate::{line::Line, line_error::LineError, motion_error::MotionError};

/// Time of the watch over an axis, ns.
const WATCH_NS: u64 = 200 * MILLISECOND_NS;
/// Longest time of a drive from the command to the loss of its power, ns.
const POWER_OFF_NS: u64 = 5 * SECOND_NS;
const POSITION: ObjectAddress = ObjectAddress::new(0x6064, 0);

/// The reason why nothing may be written to a drive.
#[derive(Debug, thiserror::Error)]
pub enum PowerError {
    /// The statusword shows power, or cannot be read.
    #[error(
        "{}: statusword {word:04X}h does not show that the drive is without power; switch it off, or use --take-over",
        AXIS_NAMES[*axis]
    )]
    Powered {
        /// The axis.
        axis: usize,
        /// Its statusword.
        word: u16,
    },
    /// The axis moves.
    #[error(
        "{}: the axis moved by {increments} increments in {} ms, and at most {noise} are noise; hold it still",
        AXIS_NAMES[*axis], WATCH_NS / MILLISECOND_NS
    )]
    Moves {
        /// The axis.
        axis: usize,
        /// How far it moved.
        increments: u32,
        /// The limit of noise.
        noise: u32,
    },
    /// The line.
    #[error(transparent)]
    Line(#[from] LineError),
}

/// Proves that a drive has no power and its axis stands, up to that many increments of noise.
///
/// # Errors
/// [`PowerError`].
pub fn prove_no_power(line: &mut Line, axis: usize, noise: u32) -> Result<(), PowerError> {
    let status = read_status(line, axis)?;
    if !status.state().is_ok_and(|state| !state.is_powered()) {
        return Err(PowerError::Powered { axis, word: status.0 });
    }
    let moved = motion(line, axis, WATCH_NS)?;
    if moved > noise { Err(PowerError::Moves { axis, increments: moved, noise }) } else { Ok(()) }
}

/// Stops a drive that another program has left with power: quick stop, and no voltage once the axis stands.
/// [`prove_no_power`] proves the success.
///
/// # Errors
/// [`LineError`].
pub fn take_over(line: &mut Line, axis: usize, noise: u32) -> Result<(), LineError> {
    line.control(axis, Controlword::QUICK_STOP)?;
    let until_ns = line.now_ns() + POWER_OFF_NS;
    // An unreadable axis may move.
    while motion(line, axis, WATCH_NS / 4).map_or(true, |moved| moved > noise) && line.now_ns() < until_ns {}
    line.control(axis, Controlword::DISABLE_VOLTAGE)
}

/// Way of an axis in that time, increments.
fn motion(line: &mut Line, axis: usize, within_ns: u64) -> Result<u32, LineError> {
    let before = line.read_number(axis, POSITION)? as i32;
    line.listen(within_ns)?;
    Ok((line.read_number(axis, POSITION)? as i32).abs_diff(before))
}

/// All axes at nearly one moment, by one question after the other.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stand {
    /// d1 to l3 by 6064h, m.
    pub positions_m: [f64; AXES],
    /// Way of each axis between two readings, m.
    pub moved_m: [f64; AXES],
    /// The states of the drives.
    pub states: [DriveState; AXES],
}

/// Reads all axes twice. Nothing is written.
///
/// # Errors
/// [`MotionError::Line`] and [`AxisError::Statusword`](crate::motion_error::AxisError::Statusword).
pub fn stand(line: &mut Line, scenario: &Scenario, between_ns: u64) -> Result<Stand, MotionError> {
    let mut stand = Stand {
        positions_m: [0.0; AXES],
        moved_m: [0.0; AXES],
        states: [DriveState::NotReadyToSwitchOn; AXES],
    };
    for axis in 0..AXES {
        stand.moved_m[axis] = -read_position(line, axis, &scenario.scale(axis))?;
        stand.states[axis] = read_state(line, axis)?;
    }
    line.listen(between_ns)?;
    for axis in 0..AXES {
        stand.positions_m[axis] = read_position(line, axis, &scenario.scale(axis))?;
        stand.moved_m[axis] += stand.positions_m[axis];
    }
    Ok(stand)
}

/// "save", the last letter in the highest byte (CiA 301, 7.5.2.13).
const SAVE: u32 = 0x6576_6173;
/// Time between two looks at a drive that stores, ns.
const LOOK_NS: u64 = 100 * MILLISECOND_NS;
/// How long a drive may take to boot, ns.
const BOOT_NS: u64 = 10 * SECOND_NS;
/// Silence after a boot-up message that ends the boot, ns. A boot loader sends an earlier message of its own.
const SETTLED_NS: u64 = SECOND_NS;

/// Why a drive has not stored.
#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    /// The drive is not done in time.
    #[error(
        "{}: {object} did not show within {timeout_ms} ms that the drive stored; raise drive_profile.store.timeout_ms",
        AXIS_NAMES[*axis]
    )]
    Late {
        /// The axis.
        axis: usize,
        /// The object that stores.
        object: ObjectAddress,
        /// The time limit, ms.
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

/// Stores, and waits for the end of the storing.
///
/// # Errors
/// [`StoreError`].
pub fn store(line: &mut Line, axis: usize, config: StoreConfig) -> Result<(), StoreError> {
    let (object, timeout_ms) = (ObjectAddress::new(0x1010, config.subindex), config.timeout_ms);
    let until_ns = line.now_ns() + u64::from(timeout_ms) * MILLISECOND_NS;
    // Some drives give no answer before they are done.
    unless_silent(line.write(axis, object, SAVE, 4))?;
    let within_ns = until_ns.saturating_sub(line.now_ns());
    let look = |line: &mut Line| unless_silent(line.read_number(axis, object));
    match line.look_until(within_ns, LOOK_NS, look, |word| word.is_some_and(|word| word & 1 == 1))? {
        Some(word) if word & 1 == 1 => Ok(()),
        Some(_) => Err(StoreError::Late { axis, object, timeout_ms }),
        None => Err(LineError::Sdo { axis, object, reason: SdoReason::Silent }.into()),
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

/// Number of SYNCs for the measurement.
const SYNCS: usize = 50;
/// Time that a node takes to become operational, ns.
pub(crate) const START_NS: u64 = 50 * MILLISECOND_NS;

/// How a drive answered to SYNC.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct SyncAnswers {
    /// SYNCs that were sent.
    pub sent: usize,
    /// Those without process data of the drive.
    pub unanswered: usize,
    /// The longest time from the end of a SYNC until the drive began to transmit, ns; none without any answer.
    pub longest_ns: Option<u64>,
}

/// Sends SYNCs to a drive without power. The drive is operational meanwhile, and pre-operational before and after.
///
/// # Errors
/// [`LineError`] except those of transfers.
pub(crate) fn sync_answers(line: &mut Line, axis: usize) -> Result<SyncAnswers, LineError> {
    line.command(axis, NmtCommand::Start)?;
    line.listen(START_NS)?;
    let answers_ns = (0..SYNCS).map(|_| line.sync_answer_ns(axis)).collect::<Result<Vec<_>, _>>();
    line.command(axis, NmtCommand::EnterPreOperational)?;
    let answered: Vec<_> = answers_ns?.into_iter().flatten().collect();
    let longest_ns = answered.iter().copied().max();
    Ok(SyncAnswers { sent: SYNCS, unanswered: SYNCS - answered.len(), longest_ns })
}

#[cfg(test)]
mod power_tests {
    use std::io;

    use masseter_scenario::Scenario;

    use super::*;

    #[test]
    fn a_drive_with_power_is_refused_until_it_is_taken_over() {
        let mut line = Line::open(&Scenario::default(), Box::new(io::sink())).unwrap();
        line.listen(100 * MILLISECOND_NS).unwrap();
        prove_no_power(&mut line, 3, 50).unwrap();
        for word in [Controlword::SHUTDOWN, Controlword::SWITCH_ON] {
            line.control(3, word).unwrap();
        }
        line.listen(10 * MILLISECOND_NS).unwrap();
        let refusal = prove_no_power(&mut line, 3, 50).unwrap_err().to_string();
        assert!(refusal.starts_with("l1: statusword ") && refusal.ends_with("--take-over"), "{refusal}");
        take_over(&mut line, 3, 50).unwrap();
        prove_no_power(&mut line, 3, 50).unwrap();
    }
}

#[cfg(test)]
mod store_tests {
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

#[cfg(test)]
mod sync_answer_tests {
    use masseter_can::canopen::ObjectAddress;
    use masseter_scenario::Scenario;

    use super::*;
    use crate::tests::Log;

    #[test]
    fn a_drive_answers_every_sync_and_gets_no_controlword() {
        let log = Log::default();
        let mut line = Line::open(&Scenario::default(), Box::new(log.clone())).unwrap();
        line.listen(100 * MILLISECOND_NS).unwrap();
        let answers = sync_answers(&mut line, 3).unwrap();
        assert_eq!((answers.sent, answers.unanswered), (SYNCS, 0));
        assert!(answers.longest_ns.unwrap() < 10_000, "emulated drives answer at once: {answers:?}");
        line.write(3, ObjectAddress::new(0x1800, 1), 0xC000_0184, 4).unwrap();
        let silent = SyncAnswers { sent: SYNCS, unanswered: SYNCS, longest_ns: None };
        assert_eq!(sync_answers(&mut line, 3).unwrap(), silent, "TPDO1 is off");
        assert_eq!(log.controlwords(), []);
        let log = log.text();
        assert_eq!(
            (log.matches(" can1 184#").count(), log.matches(" can0 080#").count()),
            (SYNCS, 0),
            "{log}"
        );
    }
}
