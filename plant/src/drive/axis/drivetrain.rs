//! From the command of a step to the force on the axis: servo loops, motor, brake and gear.

use masseter_scenario::{DriveConfig, FaultKindConfig};

use super::brake::Brake;
use super::gear::Gear;
use super::motion::Motion;
use super::motor::{Asked, Motor};
use super::servo::{Servo, ServoCommand, ServoLimits};
use crate::drive::quirks::AxisQuirks;
use crate::held_mean::HeldMean;
use crate::injection::Acting;

/// Share of the rated force at which a motor counts as pushing against a stop.
const STOP_SHARE: f64 = 0.2;

/// Loops, motor, brake and gear of an axis.
#[derive(Debug, Clone)]
pub(super) struct Drivetrain {
    config: DriveConfig,
    servo: Servo,
    gear: Gear,
    motor: Motor,
    brake: Brake,
    /// The motor's share of the force: without current the brake holds.
    motor_n: HeldMean,
}

impl Drivetrain {
    /// At rest at a position, the brake closed.
    pub(super) fn new(config: DriveConfig, quirks: &AxisQuirks, step_s: f64, position_m: f64) -> Self {
        Self {
            config,
            servo: Servo::new(config, step_s, position_m),
            gear: Gear::default(),
            motor: Motor::default(),
            brake: Brake::new(quirks.opening_ns, quirks.closing_ns),
            motor_n: HeldMean::new(0),
        }
    }

    /// The last measured position with the filtered velocity.
    pub(super) fn motion(&self) -> Motion {
        self.servo.motion()
    }

    /// Whether the last step limited force or velocity.
    pub(super) fn is_limited(&self) -> bool {
        self.servo.is_limited()
    }

    /// The motor's force as its current shows it, N.
    pub(super) fn motor_n(&self) -> f64 {
        self.motor_n.value()
    }

    /// Its mean since the last call, N.
    pub(super) fn take_mean_motor_n(&mut self, now_ns: u64) -> f64 {
        self.motor_n.take(now_ns)
    }

    /// Whether the motor pushes against a stop: towards smaller positions, towards larger ones.
    pub(super) fn pushes(&self) -> [bool; 2] {
        let threshold_n = STOP_SHARE * self.config.rated_force_n;
        [self.motor_n() <= -threshold_n, self.motor_n() >= threshold_n]
    }

    /// Begins to open the brake.
    pub(super) fn open_brake(&mut self, now_ns: u64) {
        self.brake.open(now_ns);
    }

    /// The earliest time from `now_ns` on at which the brake lets the axis move.
    pub(super) fn free_from_ns(&self, now_ns: u64) -> u64 {
        self.brake.free_from_ns(now_ns)
    }

    /// The distance of what the drive sees from the shaft, where its gear ratio is or was wrong.
    pub(super) fn gear_error_m(&mut self, demand_m: Option<f64>, faults: &mut Acting) -> f64 {
        let error_m = self.gear.error_m(faults.size(FaultKindConfig::DriveScale), demand_m);
        if error_m != 0.0 {
            faults.strike(FaultKindConfig::DriveScale);
        }
        error_m
    }

    /// A step with a measured position and its error: the force of motor and brake until the next one, N. The loops know
    /// nothing of a fault; the current that the drive shows is the motor's.
    pub(super) fn step(
        &mut self,
        now_ns: u64,
        [measured_m, error_m]: [f64; 2],
        command: ServoCommand,
        limits: &ServoLimits,
        faults: &mut Acting,
    ) -> f64 {
        let force_n = self.servo.step(measured_m, error_m, command, limits);
        let is_braking = command == ServoCommand::Brake;
        let mut motor_n = if is_braking { 0.0 } else { force_n };
        let mut asked = Asked { force_n, is_braking, max_force_n: self.config.max_force_n };
        let is_held = self.brake.holds(now_ns, is_braking);
        if is_braking && !is_held {
            asked.force_n = 0.0;
            self.servo.release_brake();
        }
        let force_n = self.motor.force_n(asked, self.servo.shaft(), faults);
        if faults.has(FaultKindConfig::DriveRunaway) {
            motor_n = asked.max_force_n;
        }
        self.motor_n.hold(motor_n, now_ns);
        if is_braking && faults.has(FaultKindConfig::BrakeOpen) {
            self.servo.release_brake();
        }
        force_n
    }
}
