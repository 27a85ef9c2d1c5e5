//! Where the robot stands: the positions of all axes, in whatever state their drives are.

use masseter_can::cia402::DriveState;
use masseter_model::geometry::AXES;
use masseter_scenario::Scenario;

use super::line::Line;
use super::motion_error::MotionError;
use super::watch::{read_position, read_state};

/// All axes at one moment, as far as one question after the other is one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stand {
    /// d1 to l3 by 6064h, m.
    pub positions_m: [f64; AXES],
    /// How far each axis moved between two readings, m.
    pub moved_m: [f64; AXES],
    /// The states of the drives.
    pub states: [DriveState; AXES],
}

/// Reads all axes twice. Nothing is written.
///
/// # Errors
/// [`MotionError::Line`] and [`MotionError::Statusword`].
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
