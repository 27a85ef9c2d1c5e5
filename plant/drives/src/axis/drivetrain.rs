//! From the command of a step to the force on the axis: servo loops, motor, brake and gear.
//!
//! While a brake opens, the motor holds the axis already; while a brake closes, the motor has no current. Without
//! faults the mechanism gets the force of the loops.

use super::servo::{BRAKE_DAMPING_N_S_M, BRAKE_STIFFNESS_N_M, Servo, ServoLimits};
use super::{demand::ServoCommand, motion::Motion};
use crate::faults::{DriveFault, DriveFaults};
use crate::{quirks::AxisQuirks, ratings::Ratings};

/// Share of the rated force at which a motor counts as pushing against a stop.
const STOP_SHARE: f64 = 0.2;

/// Loops, motor, brake and gear of an axis.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub(super) struct Drivetrain {
    config: Ratings,
    pub(super) servo: Servo,
    gear: Gear,
    motor: Motor,
    pub(super) brake: Brake,
    /// How far the closed brake slips in a step, m.
    slip_m: f64,
    /// The motor's share of the force: without current the brake holds.
    pub(super) motor_n: HeldMean,
}

impl Drivetrain {
    /// At rest at a position, the brake closed.
    pub(super) fn new(config: Ratings, quirks: &AxisQuirks, step_s: f64, position_m: f64) -> Self {
        Self {
            config,
            servo: Servo::new(config, step_s, position_m),
            gear: Gear::default(),
            motor: Motor::default(),
            brake: Brake::new(quirks.opening_ns, quirks.closing_ns),
            slip_m: quirks.creep_m_s * step_s,
            motor_n: HeldMean::new(0),
        }
    }

    /// Whether the motor pushes against a stop: towards smaller positions, towards larger ones.
    pub(super) fn pushes(&self) -> [bool; 2] {
        let threshold_n = STOP_SHARE * self.config.rated_force_n;
        [self.motor_n.value <= -threshold_n, self.motor_n.value >= threshold_n]
    }

    /// The distance of the drive's counted position from the shaft's, by a present or past wrong gear ratio.
    pub(super) fn gear_error_m(&mut self, demand_m: Option<f64>, faults: &mut DriveFaults) -> f64 {
        let before_m = self.gear.missed_m;
        let error_m = self.gear.error_m(faults.size(DriveFault::Scale), demand_m);
        if error_m.to_bits() != before_m.to_bits() {
            faults.strike(DriveFault::Scale);
        }
        error_m
    }

    /// A step with a measured position and its error. Returns the force of motor and brake until the next step, N. The
    /// loops are not told of a fault; the drive shows the motor's current.
    pub(super) fn step(
        &mut self,
        now_ns: u64,
        [measured_m, error_m]: [f64; 2],
        command: ServoCommand,
        limits: &ServoLimits,
        faults: &mut DriveFaults,
    ) -> f64 {
        self.servo.slip(self.slip_m);
        let force_n = self.servo.step(measured_m, error_m, command, limits);
        let is_braking = command == ServoCommand::Brake;
        let mut motor_n = if is_braking { 0.0 } else { force_n };
        let mut asked = Asked { force_n, is_braking, max_force_n: self.config.max_force_n };
        let is_held = self.brake.holds(now_ns, is_braking);
        if is_braking && !is_held {
            asked.force_n = 0.0;
            self.servo.release_brake();
        }
        let force_n = self.motor.force_n(asked, self.servo.shaft, faults);
        if faults.has(DriveFault::Runaway) {
            motor_n = asked.max_force_n;
        }
        self.motor_n.hold(motor_n, now_ns);
        if is_braking && faults.has(DriveFault::BrakeOpen) {
            self.servo.release_brake();
        }
        force_n
    }
}

/// The brake.
#[derive(Debug, Clone, Copy, serde::Serialize, serde::Deserialize)]
#[expect(clippy::struct_field_names, reason = "each name ends with its unit")]
pub(super) struct Brake {
    opening_ns: u64,
    /// None without a brake.
    closing_ns: Option<u64>,
    /// When the brake is open, once it was asked to open.
    open_at_ns: u64,
    /// When the brake is closed, once it was asked to close.
    closed_at_ns: Option<u64>,
}

impl Brake {
    /// A brake that has been closed for long; none without a time to close.
    pub(super) fn new(opening_ns: u64, closing_ns: Option<u64>) -> Self {
        Self { opening_ns, closing_ns, open_at_ns: 0, closed_at_ns: Some(0) }
    }

    /// Begins to open, unless it is open.
    pub(super) fn open(&mut self, now_ns: u64) {
        if self.closed_at_ns.is_some() {
            self.open_at_ns = now_ns + self.opening_ns;
        }
    }

    /// Never closes again.
    pub(super) fn fail_open(&mut self) {
        self.closing_ns = None;
    }

    /// The earliest time from `now_ns` on at which the axis may move.
    pub(super) fn free_from_ns(&self, now_ns: u64) -> u64 {
        now_ns.max(self.open_at_ns)
    }

    /// Whether it holds in a step in which it is to be closed, or not.
    pub(super) fn holds(&mut self, now_ns: u64, is_to_close: bool) -> bool {
        if !is_to_close {
            self.closed_at_ns = None;
            return false;
        }
        let Some(closing_ns) = self.closing_ns else { return false };
        now_ns >= *self.closed_at_ns.get_or_insert(now_ns + closing_ns)
    }
}

/// The missed way of the shaft so far.
#[derive(Debug, Clone, Copy, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct Gear {
    missed_m: f64,
    /// The demand at the last step with a wrong ratio.
    demand_m: Option<f64>,
}

impl Gear {
    /// The distance from the shaft's true position to the one that the drive counts, m. `ratio` is given while the
    /// gear ratio is wrong; `demand_m` is the drive's demand.
    pub(super) fn error_m(&mut self, ratio: Option<f64>, demand_m: Option<f64>) -> f64 {
        let demand_m = demand_m.filter(|_| ratio.is_some());
        if let (Some(ratio), Some(from_m), Some(to_m)) = (ratio, self.demand_m, demand_m) {
            self.missed_m += (1.0 - ratio) * (to_m - from_m);
        }
        self.demand_m = demand_m;
        self.missed_m
    }
}

/// The drive's request in a step.
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
#[derive(Debug, Clone, Copy, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct Motor {
    /// Where a brake closed that does not open.
    stuck_at_m: Option<f64>,
}

impl Motor {
    /// The force of motor and brake on the mechanism, N.
    pub(super) fn force_n(&mut self, asked: Asked, shaft: Motion, faults: &mut DriveFaults) -> f64 {
        if faults.is_empty() {
            self.stuck_at_m = None;
            return asked.force_n;
        }
        motor_n(asked, faults) + self.brake_n(asked, shaft, faults)
    }

    fn brake_n(&mut self, asked: Asked, shaft: Motion, faults: &mut DriveFaults) -> f64 {
        if asked.is_braking {
            self.stuck_at_m = None;
            return if faults.strike(DriveFault::BrakeOpen) { 0.0 } else { asked.force_n };
        }
        if !faults.strike(DriveFault::BrakeClosed) {
            self.stuck_at_m = None;
            return 0.0;
        }
        let at_m = *self.stuck_at_m.get_or_insert(shaft.position_m);
        BRAKE_STIFFNESS_N_M * (at_m - shaft.position_m) - BRAKE_DAMPING_N_S_M * shaft.velocity_m_s
    }
}

/// The motor's force: none without current, all of it where the drive runs away.
fn motor_n(asked: Asked, faults: &mut DriveFaults) -> f64 {
    if faults.has(DriveFault::Sto) || faults.has(DriveFault::Reboot) {
        return 0.0;
    }
    if faults.strike(DriveFault::Runaway) {
        return asked.max_force_n;
    }
    if asked.is_braking {
        return 0.0;
    }
    let lost = faults.size(DriveFault::TorqueLoss).unwrap_or(0.0).min(1.0);
    let lost_n = asked.force_n * lost;
    if lost_n != 0.0 {
        faults.strike(DriveFault::TorqueLoss);
    }
    asked.force_n - lost_n
}

/// A held value, and its mean since it was taken last.
#[derive(Debug, Clone, Copy, serde::Serialize, serde::Deserialize)]
pub struct HeldMean {
    /// The present value.
    pub value: f64,
    /// The value by the time, since `from_ns` and up to `at_ns`.
    value_ns: f64,
    from_ns: u64,
    at_ns: u64,
}

impl HeldMean {
    /// Sets zero from now on.
    pub fn new(now_ns: u64) -> Self {
        Self { value: 0.0, value_ns: 0.0, from_ns: now_ns, at_ns: now_ns }
    }

    /// Sets the value from now on.
    pub fn hold(&mut self, value: f64, now_ns: u64) {
        self.value_ns += self.value * now_ns.saturating_sub(self.at_ns) as f64;
        (self.value, self.at_ns) = (value, now_ns);
    }

    /// The mean since the last call; the present value if no time has passed.
    pub fn take_mean(&mut self, now_ns: u64) -> f64 {
        self.hold(self.value, now_ns);
        let passed_ns = now_ns.saturating_sub(self.from_ns);
        let mean = if passed_ns == 0 { self.value } else { self.value_ns / passed_ns as f64 };
        (self.value_ns, self.from_ns) = (0.0, now_ns);
        mean
    }
}

#[cfg(test)]
mod brake_tests {
    use super::*;

    #[test]
    fn it_closes_and_opens_after_its_times() {
        let mut brake = Brake::new(200, Some(1000));
        assert!(brake.holds(0, true), "closed since long ago");
        brake.open(50);
        assert_eq!([0, 249, 300].map(|now_ns| brake.free_from_ns(now_ns)), [250, 250, 300]);
        assert!(!brake.holds(300, false));
        assert!(!brake.holds(400, true) && !brake.holds(1399, true) && brake.holds(1400, true));
    }

    #[test]
    fn without_a_brake_nothing_holds() {
        assert!(!Brake::new(0, None).holds(0, true));
    }

    #[test]
    fn by_default_it_acts_at_once() {
        let mut brake = Brake::new(0, Some(0));
        brake.open(7);
        assert_eq!(brake.free_from_ns(7), 7);
        assert!(!brake.holds(8, false) && brake.holds(9, true));
    }
}

#[cfg(test)]
mod gear_tests {
    use super::*;

    #[test]
    fn what_the_shaft_moves_too_little_adds_up_while_the_ratio_is_wrong_and_stays() {
        let mut gear = Gear::default();
        let mut error_um = |ratio, demand_m| (gear.error_m(ratio, demand_m) * 1e6).round() as i64;
        assert_eq!(error_um(None, Some(0.270)), 0);
        assert_eq!(error_um(Some(0.9), Some(0.270)), 0, "from where it is");
        assert_eq!(error_um(Some(0.9), Some(0.280)), 1000);
        assert_eq!(error_um(Some(0.9), None), 1000, "the brake is closed");
        assert_eq!(error_um(Some(0.9), Some(0.250)), 1000);
        assert_eq!(error_um(Some(0.9), Some(0.240)), 0);
        assert_eq!(error_um(Some(1.5), Some(0.242)), -1000);
        assert_eq!(error_um(None, Some(0.270)), -1000);
    }
}

#[cfg(test)]
mod motor_tests {
    use super::*;

    const MOVING: Asked = Asked { force_n: 40.0, is_braking: false, max_force_n: 500.0 };
    const BRAKING: Asked = Asked { force_n: -30.0, is_braking: true, max_force_n: 500.0 };

    /// The force at 0.1 mm beyond where the motor was at first, and whether the fault struck.
    fn force(kind: DriveFault, size: f64, asked: Asked) -> (f64, bool) {
        let (mut motor, mut faults) = (Motor::default(), DriveFaults::default());
        faults.set(kind, Some(size));
        motor.force_n(asked, Motion::at_rest(0.27), &mut faults);
        let force_n = motor.force_n(asked, Motion::at_rest(0.2701), &mut faults);
        ((force_n * 1e6).round() / 1e6, faults.has_struck(kind))
    }

    #[test]
    fn each_fault_changes_the_force_of_motor_or_brake() {
        let table = [
            (DriveFault::TorqueLoss, 0.25, [(30.0, true), (-30.0, false)]),
            (DriveFault::Runaway, 0.0, [(500.0, true), (470.0, true)]),
            (DriveFault::Sto, 0.0, [(0.0, false), (-30.0, false)]),
            (DriveFault::Reboot, 1.0, [(0.0, false), (-30.0, false)]),
            (DriveFault::BrakeOpen, 0.0, [(40.0, false), (0.0, true)]),
            (DriveFault::BrakeClosed, 0.0, [(20.0, true), (-30.0, false)]),
        ];
        for (kind, size, expected) in table {
            assert_eq!([MOVING, BRAKING].map(|asked| force(kind, size, asked)), expected, "{kind:?}");
        }
    }

    #[test]
    fn without_faults_the_mechanism_gets_what_is_asked_for() {
        let force_n = Motor::default().force_n(MOVING, Motion::at_rest(0.27), &mut DriveFaults::default());
        assert_eq!(force_n.to_bits(), MOVING.force_n.to_bits());
    }
}

#[cfg(test)]
mod held_mean_tests {
    use super::*;

    #[test]
    fn every_value_counts_as_long_as_it_is_held() {
        let mut mean = HeldMean::new(1000);
        mean.hold(8.0, 1100);
        mean.hold(2.0, 1200);
        // 0 for 100 ns, 8 for 100 ns, 2 for 200 ns; then no time; then 2 and 5 for 100 ns each.
        let means = [mean.take_mean(1400), mean.take_mean(1400)];
        mean.hold(5.0, 1500);
        assert_eq!((means, mean.take_mean(1600), mean.value), ([3.0, 2.0], 3.5, 5.0));
    }
}
