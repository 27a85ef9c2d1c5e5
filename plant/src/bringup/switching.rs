//! Switching one drive on and off, with the times of its brake.

use masseter_can::canopen::ObjectAddress;
use masseter_can::cia402::{Controlword, DriveState};
use masseter_runtime::clock::{MILLISECOND_NS, SECOND_NS};
use masseter_scenario::{AxisScale, BrakeConfig};

use super::line::Line;
use super::motion_error::MotionError;
use super::watch::{Watch, read_error_code, read_position, read_state};

/// How long a drive may take from one state to the next, ns.
const TRANSITION_NS: u64 = SECOND_NS;
/// How long an axis is watched after its power went, ns.
const SETTLING_NS: u64 = SECOND_NS;
/// How far an axis may move as its brake closes, m: some turns of play, and not a fall.
const MOST_DROP_M: f64 = 5e-4;
/// How long a stop is tried, and after which time its command is repeated, ns.
const STOP_NS: u64 = SECOND_NS;
const REPEAT_NS: u64 = 200 * MILLISECOND_NS;

/// Switches a drive on, up to "operation enabled". The brake is opening then: the axis may not move yet. A drive that
/// restarted has lost its reduced limits: it gets no power. One that restarts later is no longer ready to switch on,
/// and takes no further word.
pub(super) fn switch_on(line: &mut Line, axis: usize, watch: &Watch) -> Result<(), MotionError> {
    for (word, wanted) in [
        (Controlword::SHUTDOWN, DriveState::ReadyToSwitchOn),
        (Controlword::SWITCH_ON, DriveState::SwitchedOn),
        (Controlword::ENABLE_OPERATION, DriveState::OperationEnabled),
    ] {
        line.control(axis, word)?;
        let state = wait_for(line, axis, TRANSITION_NS, |state| state == wanted)?;
        if state != wanted {
            let error_code = read_error_code(line, axis);
            return Err(MotionError::NotEnabled { axis, state, error_code });
        }
        watch.check_undisturbed(line)?;
    }
    Ok(())
}

/// Switches off an axis that stands: "disable operation" closes the brake, and the voltage goes once the brake holds. Returns
/// how far the axis moved until a second later, m.
///
/// # Errors
/// [`MotionError::Dropped`] for an axis that nothing holds without power.
pub(super) fn switch_off(
    line: &mut Line,
    axis: usize,
    scale: &AxisScale,
    brake: &BrakeConfig,
) -> Result<f64, MotionError> {
    let before_m = read_position(line, axis, scale)?;
    line.control(axis, Controlword::SWITCH_ON)?;
    line.listen(seconds(brake.close_s))?;
    disable_voltage(line, axis)?;
    line.listen(SETTLING_NS)?;
    let moved_m = read_position(line, axis, scale)? - before_m;
    if moved_m.abs() > MOST_DROP_M { Err(MotionError::Dropped { axis, moved_m }) } else { Ok(moved_m) }
}

/// Stops an axis in whatever it does: quick stop, then voltage off. Neither word can enable a drive, whatever its
/// state. Commands that are lost are repeated.
///
/// # Errors
/// [`MotionError::StaysOn`] unless the statusword proves that the drive is off.
pub(super) fn stop(line: &mut Line, axis: usize, brake: &BrakeConfig) -> Result<(), MotionError> {
    // The drive may stay in the quick stop (605Ah = 5 or 6): the voltage goes after the same time.
    let _ = repeat(line, axis, Controlword::QUICK_STOP);
    disable_voltage(line, axis)?;
    Ok(line.listen(seconds(brake.close_s))?)
}

fn disable_voltage(line: &mut Line, axis: usize) -> Result<(), MotionError> {
    match repeat(line, axis, Controlword::DISABLE_VOLTAGE) {
        Ok(()) => {
            line.note_off(axis);
            Ok(())
        }
        Err(reason) => Err(MotionError::StaysOn { axis, reason }),
    }
}

/// Sends a controlword again and again until the drive shows no voltage, for a limited time; returns why that is not proved.
fn repeat(line: &mut Line, axis: usize, word: Controlword) -> Result<(), String> {
    let until_ns = line.now_ns() + STOP_NS;
    loop {
        let sent = line.control(axis, word);
        let reason = match wait_for(line, axis, REPEAT_NS, |state| !state.is_powered()) {
            Ok(state) if !state.is_powered() => return Ok(()),
            Ok(state) => format!("it shows {state}"),
            Err(error) => error.to_string(),
        };
        if line.now_ns() >= until_ns {
            return Err(sent.err().map_or(reason, |error| error.to_string()));
        }
        // Time passes also where nothing can be sent.
        let _ = line.listen(MILLISECOND_NS);
    }
}

/// Waits until a drive shows a mode of operation (6061h).
pub(super) fn wait_for_mode(line: &mut Line, axis: usize, wanted: i8) -> Result<(), MotionError> {
    let until_ns = line.now_ns() + TRANSITION_NS;
    loop {
        let found = line.read_number(axis, ObjectAddress::new(0x6061, 0))? as i8;
        if found == wanted {
            return Ok(());
        }
        if line.now_ns() >= until_ns {
            return Err(MotionError::Mode { axis, wanted, found });
        }
        line.listen(MILLISECOND_NS)?;
    }
}

/// The state that a drive has when the condition holds, or at the end of the time.
fn wait_for(
    line: &mut Line,
    axis: usize,
    within_ns: u64,
    holds: impl Fn(DriveState) -> bool,
) -> Result<DriveState, MotionError> {
    let until_ns = line.now_ns() + within_ns;
    loop {
        let state = read_state(line, axis)?;
        if holds(state) || line.now_ns() >= until_ns {
            return Ok(state);
        }
        line.listen(MILLISECOND_NS)?;
    }
}

/// Seconds in ns.
pub(super) fn seconds(time_s: f64) -> u64 {
    (time_s * SECOND_NS as f64) as u64
}
