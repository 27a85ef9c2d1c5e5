//! The proof that a drive has no power, before anything is written to it.

use masseter_can::canopen::ObjectAddress;
use masseter_can::cia402::{Controlword, Statusword};
use masseter_model::geometry::AXIS_NAMES;
use masseter_runtime::clock::{MILLISECOND_NS, SECOND_NS};

use super::line::Line;
use super::line_error::LineError;

/// For how long an axis is watched, ns.
const WATCH_NS: u64 = 200 * MILLISECOND_NS;
/// How long a drive may take to lose its power after it was told to, ns.
const STOP_NS: u64 = 5 * SECOND_NS;
const POSITION: ObjectAddress = ObjectAddress::new(0x6064, 0);
const STATUS: ObjectAddress = ObjectAddress::new(0x6041, 0);

/// Why nothing may be written to a drive.
#[derive(Debug, thiserror::Error)]
pub enum PowerError {
    /// The statusword tells of power, or of nothing.
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
        /// What counts as noise.
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
    let word = line.read_number(axis, STATUS)? as u16;
    if !Statusword(word).state().is_ok_and(|state| !state.is_powered()) {
        return Err(PowerError::Powered { axis, word });
    }
    let moved = motion(line, axis, WATCH_NS)?;
    if moved > noise { Err(PowerError::Moves { axis, increments: moved, noise }) } else { Ok(()) }
}

/// Stops a drive that somebody else left with power: quick stop, and no voltage once it stands. Whether it worked is for
/// [`prove_no_power`] to say.
///
/// # Errors
/// [`LineError`].
pub fn take_over(line: &mut Line, axis: usize, noise: u32) -> Result<(), LineError> {
    line.control(axis, Controlword::QUICK_STOP)?;
    let until_ns = line.now_ns() + STOP_NS;
    // An axis that cannot be read may move.
    while motion(line, axis, WATCH_NS / 4).map_or(true, |moved| moved > noise) && line.now_ns() < until_ns {}
    line.control(axis, Controlword::DISABLE_VOLTAGE)
}

/// How far an axis moves in that time, increments.
fn motion(line: &mut Line, axis: usize, within_ns: u64) -> Result<u32, LineError> {
    let before = line.read_number(axis, POSITION)? as i32;
    line.listen(within_ns)?;
    Ok((line.read_number(axis, POSITION)? as i32).abs_diff(before))
}

#[cfg(test)]
mod tests {
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
