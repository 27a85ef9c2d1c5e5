//! The drive's axis under CiA 402: power states, modes of operation, what the servo is to do, and what
//! the objects of the profile show of it.
//!
//! Knows nothing of frames. What is particular to a mode of operation stands in [`cyclic`](super::cyclic),
//! [`positioning`](super::positioning) and [`homing`](super::homing).

use masseter_can::cia402::{Command, Controlword, DriveState, StatusBit, Statusword};
use masseter_shared::config::DriveConfig;

use super::demand::Demand;
use super::dictionary::{Objects, names};
use super::errors::DriveError;
use super::homing::Homing;
use super::mode::Mode;
use super::motion::Motion;
use super::parameters::{LinkReaction, MotionLimits, Parameters, Stop};
use super::positioning::Positioning;
use super::profile::Profile;
use super::servo::{Servo, Task};
use crate::encoder::Encoder;

/// One axis.
#[derive(Debug, Clone)]
pub(super) struct Axis {
    pub(super) drive: DriveConfig,
    encoder: Encoder,
    servo: Servo,
    pub(super) parameters: Parameters,
    pub(super) demand: Demand,
    pub(super) controlword: Controlword,
    pub(super) positioning: Positioning,
    pub(super) homing: Homing,
    /// What the encoder counted last.
    pub(super) counts: i32,
    /// What position 0 of the encoder is called.
    pub(super) origin_increments: i32,
    /// Whether a target was cut to a limit.
    pub(super) is_cut: bool,
    pub(super) mode: Mode,
    power: DriveState,
    force_n: f64,
    /// The motor's part of the force: without current the brake holds.
    motor_n: f64,
    straying_since_ns: Option<u64>,
    /// Whether the following error window was left for too long; as long as the fault stands.
    has_strayed: bool,
}

impl Axis {
    /// An axis that is switched on where it stands.
    pub(super) fn new(
        drive: DriveConfig,
        encoder: Encoder,
        step_s: f64,
        position_m: f64,
        objects: &Objects,
    ) -> Self {
        let servo = Servo::new(drive, step_s, position_m);
        Self {
            counts: encoder.nearest(position_m),
            parameters: Parameters::of(objects, &drive),
            drive,
            encoder,
            servo,
            demand: Demand::new(),
            controlword: Controlword::DISABLE_VOLTAGE,
            positioning: Positioning::default(),
            homing: Homing::default(),
            origin_increments: 0,
            is_cut: false,
            mode: Mode::CyclicPosition,
            power: DriveState::NotReadyToSwitchOn,
            force_n: 0.0,
            motor_n: 0.0,
            straying_since_ns: None,
            has_strayed: false,
        }
    }

    /// State of the power stage.
    #[cfg(test)]
    pub(super) fn power(&self) -> DriveState {
        self.power
    }

    /// Whether it follows targets.
    pub(super) fn is_enabled(&self) -> bool {
        self.power == DriveState::OperationEnabled
    }

    fn is_in_fault(&self) -> bool {
        matches!(self.power, DriveState::FaultReactionActive | DriveState::Fault)
    }

    /// As after power-on, where it stands: the brake closes, the encoder's own zero holds again.
    pub(super) fn restart(&mut self, now_ns: u64, objects: &Objects) {
        self.controlword = Controlword::DISABLE_VOLTAGE;
        (self.homing, self.origin_increments) = (Homing::default(), 0);
        self.enter(DriveState::NotReadyToSwitchOn, now_ns);
        self.configure(now_ns, objects);
    }

    /// Takes up what the dictionary says. A mode that changes in operation brings the axis to rest first.
    pub(super) fn configure(&mut self, now_ns: u64, objects: &Objects) {
        self.parameters = Parameters::of(objects, &self.drive);
        let mode = Mode::of(objects.get(names::MODE)).unwrap_or(self.mode);
        if mode != self.mode {
            self.mode = mode;
            self.is_cut = false;
            (self.positioning, self.homing) = (Positioning::default(), self.homing.interrupted());
            if self.is_enabled() {
                self.slow_down(now_ns, self.parameters.profile.deceleration_m_s2);
            }
        }
    }

    /// Obeys a controlword; whether it ended a fault.
    pub(super) fn control(&mut self, now_ns: u64, word: Controlword, objects: &Objects) -> bool {
        let before = std::mem::replace(&mut self.controlword, word);
        let was_fault = self.power == DriveState::Fault;
        self.obey(word.command(before, self.power), now_ns);
        if self.is_enabled() {
            match self.mode {
                Mode::ProfilePosition => self.control_positioning(now_ns, before, objects),
                Mode::Homing => self.control_homing(now_ns, before),
                Mode::CyclicPosition | Mode::CyclicTorque => {}
            }
        }
        was_fault && self.power != DriveState::Fault
    }

    fn obey(&mut self, command: Command, now_ns: u64) {
        let next = if self.parameters.holds_quick_stop {
            self.power.after_in_held_quick_stop(command)
        } else {
            self.power.after(command)
        };
        self.enter(next, now_ns);
    }

    /// Nobody guides the drive any more (object 6007); whether that put it into fault.
    pub(super) fn lose_link(&mut self, now_ns: u64) -> bool {
        let was_in_fault = self.is_in_fault();
        match self.parameters.link {
            LinkReaction::Nothing => {}
            LinkReaction::Fault => self.enter(self.power.after_fault(), now_ns),
            LinkReaction::DisableVoltage => self.obey(Command::DisableVoltage, now_ns),
            LinkReaction::QuickStop => self.obey(Command::QuickStop, now_ns),
        }
        self.is_in_fault() && !was_in_fault
    }

    fn enter(&mut self, state: DriveState, now_ns: u64) {
        if state == self.power {
            return;
        }
        self.power = state;
        self.straying_since_ns = None;
        self.has_strayed &= self.is_in_fault();
        self.is_cut = false;
        (self.positioning, self.homing) = (Positioning::default(), self.homing.interrupted());
        match state {
            DriveState::OperationEnabled => self.begin(),
            DriveState::QuickStopActive => self.stop(now_ns, self.parameters.quick_stop),
            DriveState::FaultReactionActive => self.stop(now_ns, self.parameters.fault_stop),
            _ => self.demand.release(),
        }
    }

    /// The cyclic modes wait for their first target behind a closed brake, the others hold the axis.
    fn begin(&mut self) {
        let waits = matches!(self.mode, Mode::CyclicPosition | Mode::CyclicTorque);
        if !waits {
            self.demand.follow(Profile::hold(self.measured_m()));
        }
    }

    fn stop(&mut self, now_ns: u64, stop: Stop) {
        match stop {
            Stop::Brake => self.demand.release(),
            Stop::Ramp { deceleration_m_s2 } => self.slow_down(now_ns, deceleration_m_s2),
        }
    }

    pub(super) fn slow_down(&mut self, now_ns: u64, deceleration_m_s2: f64) {
        self.demand.slow_down(now_ns, self.servo.motion(), deceleration_m_s2);
    }

    /// Where the axis stands, m in the encoder's coordinates.
    pub(super) fn measured_m(&self) -> f64 {
        self.servo.motion().position_m
    }

    /// Moves to rest at a position, from where it is asked to be or stands.
    pub(super) fn move_to(&mut self, now_ns: u64, target_m: f64, limits: &MotionLimits) {
        let start = self.demand.at(now_ns).unwrap_or(Motion::at_rest(self.measured_m()));
        self.demand.follow(Profile::to(now_ns, start, target_m, limits));
    }

    /// A position of the dictionary in the encoder's metres.
    pub(super) fn metres(&self, increments: i32) -> f64 {
        self.encoder.metres(increments.saturating_sub(self.origin_increments))
    }

    /// A position in the encoder's metres as the dictionary has it.
    pub(super) fn increments(&self, position_m: f64) -> i32 {
        self.encoder.nearest(position_m).saturating_add(self.origin_increments)
    }

    /// The nearest target that the software position limits allow. Homing moves them with the home position, and may
    /// leave the axis outside of them: there it may stay or come nearer, but go no further.
    pub(super) fn within_limits(&self, now_ns: u64, target_increments: i32) -> i32 {
        let [lowest, highest] = self.parameters.position_limits;
        let here = self.increments(self.demand.position_m(now_ns).unwrap_or(self.measured_m()));
        target_increments.min(highest.max(here)).max(lowest.min(here))
    }

    /// A step of the servo loops with the axis at `position_m`; what went wrong in it.
    pub(super) fn step(&mut self, now_ns: u64, position_m: f64) -> Option<DriveError> {
        self.complete(now_ns);
        let before = std::mem::replace(&mut self.counts, self.encoder.read(position_m));
        if self.is_enabled() {
            match self.mode {
                Mode::ProfilePosition => self.continue_positioning(now_ns),
                Mode::Homing => self.continue_homing(now_ns, before),
                Mode::CyclicPosition | Mode::CyclicTorque => {}
            }
        }
        let limits = self.servo_limits();
        let measured_m = self.encoder.metres(self.counts);
        let task = self.demand.task(now_ns);
        self.force_n = self.servo.step(measured_m, task, &limits);
        self.motor_n = if task == Task::Brake { 0.0 } else { self.force_n };
        self.watch_following(now_ns)
    }

    /// The force of the last step on the mechanism, N.
    pub(super) fn force_n(&self) -> f64 {
        self.force_n
    }

    /// The drive's own transitions: initialised, quick stop ended, fault reaction ended.
    fn complete(&mut self, now_ns: u64) {
        let is_finished = match self.power {
            DriveState::QuickStopActive => {
                !self.parameters.holds_quick_stop && self.demand.is_at_rest(now_ns)
            }
            DriveState::FaultReactionActive => self.demand.is_at_rest(now_ns),
            _ => true,
        };
        if is_finished {
            self.enter(self.power.after_completion(), now_ns);
        }
    }

    /// Following error beyond its window (6065) for longer than its time-out (6066): fault.
    fn watch_following(&mut self, now_ns: u64) -> Option<DriveError> {
        let window_m = self.parameters.following_window_m?;
        let demand_m = self.demand.position_m(now_ns);
        let error_m = demand_m.map_or(0.0, |demand_m| demand_m - self.measured_m());
        if error_m.abs() <= window_m {
            self.straying_since_ns = None;
            return None;
        }
        let since_ns = *self.straying_since_ns.get_or_insert(now_ns);
        if now_ns - since_ns <= self.parameters.following_timeout_ns {
            return None;
        }
        self.enter(self.power.after_fault(), now_ns);
        self.has_strayed = true;
        Some(DriveError::FollowingError)
    }

    /// Reads the encoder with the axis at `position_m`, as SYNC asks for.
    pub(super) fn sample(&mut self, position_m: f64) {
        self.counts = self.encoder.read(position_m);
    }

    /// Writes what the axis does into the objects that show it.
    pub(super) fn show(&self, now_ns: u64, objects: &mut Objects) {
        let actual = self.counts.saturating_add(self.origin_increments);
        let demand = self.demand.position_m(now_ns).map_or(actual, |demand_m| self.increments(demand_m));
        let torque = self.motor_n / self.drive.rated_force_n * 1000.0;
        objects.set(names::STATUSWORD, self.statusword(now_ns).0);
        objects.set(names::MODE_DISPLAY, self.mode.number());
        objects.set(names::POSITION_DEMAND, demand);
        objects.set(names::POSITION_ACTUAL, actual);
        objects.set(names::VELOCITY_ACTUAL, self.encoder.nearest(self.servo.motion().velocity_m_s));
        objects.set(names::TORQUE_ACTUAL, torque.round() as i16);
        objects.set(names::FOLLOWING_ERROR, demand.saturating_sub(actual));
    }

    fn statusword(&self, now_ns: u64) -> Statusword {
        let is_enabled = self.is_enabled();
        let word = Statusword::of(self.power)
            .with(StatusBit::VoltageEnabled, true)
            .with(StatusBit::Remote, true)
            .with(StatusBit::InternalLimit, is_enabled && (self.is_cut || self.servo.is_limited()));
        match self.mode {
            Mode::CyclicPosition => word
                .with(StatusBit::TargetFollowed, is_enabled)
                .with(StatusBit::FollowingError, self.has_strayed),
            Mode::CyclicTorque => word.with(StatusBit::TargetFollowed, is_enabled),
            Mode::ProfilePosition => word
                .with(StatusBit::TargetReached, is_enabled && self.has_reached_setpoint(now_ns))
                .with(StatusBit::SETPOINT_ACKNOWLEDGED, is_enabled && self.positioning.is_acknowledged())
                .with(StatusBit::FollowingError, self.has_strayed),
            Mode::Homing => self.homing.show(word, self.demand.is_at_rest(now_ns)),
        }
    }
}
