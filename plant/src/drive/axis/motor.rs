//! What the power stage, the motor and the brake make of the loops' force, when one of them is broken.
//!
//! Without faults the mechanism gets what the loops ask for.

use masseter_scenario::FaultKindConfig as Kind;

use super::motion::Motion;
use super::servo::{BRAKE_DAMPING_N_S_M, BRAKE_STIFFNESS_N_M};
use crate::injection::Acting;

/// What the drive asks for in a step.
#[derive(Debug, Clone, Copy)]
pub(super) struct Asked {
    /// The motor's force, or the brake's, N.
    pub(super) force_n: f64,
    /// Whether the brake is to be closed and the motor without current.
    pub(super) is_braking: bool,
    /// The motor's force at full current, N.
    pub(super) max_force_n: f64,
}

/// Motor and brake.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Motor {
    /// Where a brake closed that does not open.
    stuck_at_m: Option<f64>,
}

impl Motor {
    /// The force of motor and brake on the mechanism, N.
    pub(super) fn force_n(&mut self, asked: Asked, shaft: Motion, faults: &mut Acting) -> f64 {
        if faults.is_empty() {
            self.stuck_at_m = None;
            return asked.force_n;
        }
        motor_n(asked, faults) + self.brake_n(asked, shaft, faults)
    }

    fn brake_n(&mut self, asked: Asked, shaft: Motion, faults: &mut Acting) -> f64 {
        if asked.is_braking {
            self.stuck_at_m = None;
            if !faults.has(Kind::BrakeOpen) {
                return asked.force_n;
            }
            faults.strike(Kind::BrakeOpen);
            return 0.0;
        }
        if !faults.has(Kind::BrakeClosed) {
            self.stuck_at_m = None;
            return 0.0;
        }
        faults.strike(Kind::BrakeClosed);
        let at_m = *self.stuck_at_m.get_or_insert(shaft.position_m);
        BRAKE_STIFFNESS_N_M * (at_m - shaft.position_m) - BRAKE_DAMPING_N_S_M * shaft.velocity_m_s
    }
}

/// The motor's force: none without current, all of it where the drive runs away.
fn motor_n(asked: Asked, faults: &mut Acting) -> f64 {
    if faults.has(Kind::DriveSto) || faults.has(Kind::DriveReboot) {
        return 0.0;
    }
    if faults.has(Kind::DriveRunaway) {
        faults.strike(Kind::DriveRunaway);
        return asked.max_force_n;
    }
    if asked.is_braking {
        return 0.0;
    }
    let lost = faults.size(Kind::DriveTorqueLoss).unwrap_or(0.0);
    let lost_n = asked.force_n * lost;
    if lost_n != 0.0 {
        faults.strike(Kind::DriveTorqueLoss);
    }
    asked.force_n - lost_n
}

#[cfg(test)]
mod tests {
    use super::*;

    const MOVING: Asked = Asked { force_n: 40.0, is_braking: false, max_force_n: 500.0 };
    const BRAKING: Asked = Asked { force_n: -30.0, is_braking: true, max_force_n: 500.0 };

    /// The force at 0.1 mm beyond where the motor was at first, and whether the fault struck.
    fn force(kind: Kind, size: f64, asked: Asked) -> (f64, bool) {
        let (mut motor, mut faults) = (Motor::default(), Acting::default());
        faults.begin(kind, size);
        motor.force_n(asked, Motion::at_rest(0.27), &mut faults);
        let force_n = motor.force_n(asked, Motion::at_rest(0.2701), &mut faults);
        ((force_n * 1e6).round() / 1e6, faults.has_struck(kind))
    }

    #[test]
    fn each_fault_changes_the_force_of_motor_or_brake() {
        let table = [
            (Kind::DriveTorqueLoss, 0.25, [(30.0, true), (-30.0, false)]),
            (Kind::DriveRunaway, 0.0, [(500.0, true), (470.0, true)]),
            (Kind::DriveSto, 0.0, [(0.0, false), (-30.0, false)]),
            (Kind::DriveReboot, 1.0, [(0.0, false), (-30.0, false)]),
            (Kind::BrakeOpen, 0.0, [(40.0, false), (0.0, true)]),
            (Kind::BrakeClosed, 0.0, [(20.0, true), (-30.0, false)]),
        ];
        for (kind, size, expected) in table {
            assert_eq!([MOVING, BRAKING].map(|asked| force(kind, size, asked)), expected, "{kind}");
        }
    }

    #[test]
    fn without_faults_the_mechanism_gets_what_is_asked_for() {
        let force_n = Motor::default().force_n(MOVING, Motion::at_rest(0.27), &mut Acting::default());
        assert_eq!(force_n.to_bits(), MOVING.force_n.to_bits());
    }
}
