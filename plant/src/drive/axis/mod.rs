//! The drive's axis under CiA 402: power states, modes of operation, and the objects that show them.
//!
//! An axis handles no frames and works in SI units. [`Axis`] sequences its parts: [`Positioning`] and [`Homing`] return
//! commands, the servo follows the [`Demand`], [`FollowingErrorMonitor`] supervises the servo. [`Parameters`] is
//! the configuration in the object dictionary.

mod demand;
mod encoder;
mod following;
mod gear;
mod homing;
mod motion;
mod motor;
mod parameters;
mod positioning;
mod profile;
mod servo;

use masseter_can::cia402::{Controlword, DriveState, StateCommand, StatusBit, Statusword};
use masseter_shared::clock::SECOND_NS;
use masseter_shared::config::{DriveConfig, FaultKindConfig};

use crate::drive::dictionary::{Objects, names};
use crate::injection::Acting;
use demand::Demand;
use following::FollowingErrorMonitor;
use gear::Gear;
use motion::{Motion, MotionCommand, PositionView, clamp};
use motor::{Asked, Motor};
use parameters::Parameters;
use positioning::Positioning;
use profile::Profile;
use servo::{Servo, ServoCommand, ServoLimits};

pub(crate) use encoder::Encoder;
pub(super) use homing::Homing;
pub(crate) use motion::Shaft;
pub(super) use motion::{Mode, NewTargets};
pub(super) use parameters::configure;

/// One axis.
#[derive(Debug, Clone)]
pub(super) struct Axis {
    config: DriveConfig,
    encoder: Encoder,
    servo: Servo,
    parameters: Parameters,
    demand: Demand,
    following: FollowingErrorMonitor,
    positioning: Positioning,
    homing: Homing,
    mode: Mode,
    /// State of the power stage.
    power: DriveState,
    controlword: Controlword,
    /// The encoder's last count.
    counts: i32,
    /// Position of the encoder's zero in the dictionary.
    origin_increments: i32,
    /// Whether the newest cyclic target was limited.
    is_target_limited: bool,
    gear: Gear,
    motor: Motor,
    /// Injected faults of the drive.
    faults: Acting,
    /// Since when a fault delays "operation enabled", ns.
    enabling_since_ns: Option<u64>,
    /// The motor's share of the force: without current the brake holds.
    motor_n: f64,
}

impl Axis {
    /// An axis that is switched on at a position.
    pub(super) fn new(
        config: DriveConfig,
        encoder: Encoder,
        step_s: f64,
        position_m: f64,
        objects: &Objects,
    ) -> Self {
        Self {
            counts: encoder.nearest(position_m),
            parameters: Parameters::from_objects(objects, &config),
            servo: Servo::new(config, step_s, position_m),
            config,
            encoder,
            demand: Demand::Brake,
            following: FollowingErrorMonitor::default(),
            positioning: Positioning::default(),
            homing: Homing::default(),
            mode: Mode::CyclicPosition,
            power: DriveState::NotReadyToSwitchOn,
            controlword: Controlword::DISABLE_VOLTAGE,
            origin_increments: 0,
            is_target_limited: false,
            gear: Gear::default(),
            motor: Motor::default(),
            faults: Acting::default(),
            enabling_since_ns: None,
            motor_n: 0.0,
        }
    }

    /// State of the power stage.
    #[cfg(test)]
    pub(super) fn power(&self) -> DriveState {
        self.power
    }

    /// Whether homing is under way.
    pub(super) fn is_homing(&self) -> bool {
        self.homing.is_running()
    }

    /// Whether the axis follows targets.
    pub(super) fn is_enabled(&self) -> bool {
        self.power == DriveState::OperationEnabled
    }

    /// The injected faults that act on the drive.
    pub(super) fn faults(&self) -> &Acting {
        &self.faults
    }

    /// The injected faults, to begin and end them, and to tell that they struck.
    pub(super) fn faults_mut(&mut self) -> &mut Acting {
        &mut self.faults
    }

    /// Goes into fault by itself; returns whether it was in none.
    pub(super) fn fail(&mut self, now_ns: u64) -> bool {
        let fails = !self.is_in_fault();
        self.enter(self.power.after_fault(), now_ns);
        fails
    }

    fn is_in_fault(&self) -> bool {
        matches!(self.power, DriveState::FaultReactionActive | DriveState::Fault)
    }

    /// The state after power-on: the brake closes, and positions count from the encoder's own zero.
    pub(super) fn restart(&mut self, now_ns: u64, objects: &Objects) {
        self.controlword = Controlword::DISABLE_VOLTAGE;
        (self.homing, self.origin_increments) = (Homing::default(), 0);
        self.enter(DriveState::NotReadyToSwitchOn, now_ns);
        self.configure(now_ns, objects);
    }

    /// Applies the dictionary's configuration. A mode that changes in operation brings the axis to rest first.
    pub(super) fn configure(&mut self, now_ns: u64, objects: &Objects) {
        self.parameters = Parameters::from_objects(objects, &self.config);
        let mode = Mode::from_number(objects.get(names::MODE)).unwrap_or(self.mode);
        if mode != self.mode {
            self.mode = mode;
            self.interrupt_mode();
            if self.is_enabled() {
                self.slow_down(now_ns, self.parameters.profile.deceleration_m_s2);
            }
        }
    }

    /// Obeys a controlword (6040h); returns whether the controlword ended a fault.
    pub(super) fn control(&mut self, now_ns: u64, word: Controlword, objects: &Objects) -> bool {
        let before = std::mem::replace(&mut self.controlword, word);
        let was_fault = self.power == DriveState::Fault;
        self.obey(word.command(before, self.power), now_ns);
        if self.is_enabled() {
            let (words, view) = ([before, word], self.position_view(now_ns));
            let (target, method) = (objects.get(names::TARGET_POSITION), self.parameters.homing_method);
            let command = match self.mode {
                Mode::ProfilePosition => self.positioning.control(words, target, view),
                Mode::Homing => self.homing.control(words, method, self.counts, view),
                Mode::CyclicPosition | Mode::CyclicTorque => None,
            };
            self.execute(command, now_ns);
        }
        was_fault && self.power != DriveState::Fault
    }

    fn obey(&mut self, command: StateCommand, now_ns: u64) {
        let next = if self.parameters.holds_quick_stop {
            self.power.after_in_held_quick_stop(command)
        } else {
            self.power.after(command)
        };
        let next = if self.is_kept_off(next) { self.power } else { self.delayed(next, now_ns) };
        self.enter(next, now_ns);
    }

    /// Whether the drive would leave "switch on disabled" while the torque is safely off.
    fn is_kept_off(&mut self, next: DriveState) -> bool {
        let is_kept = self.faults.has(FaultKindConfig::DriveSto)
            && self.power == DriveState::SwitchOnDisabled
            && next != self.power;
        if is_kept {
            self.faults.strike(FaultKindConfig::DriveSto);
        }
        is_kept
    }

    /// The next state, where an injected fault delays "operation enabled".
    fn delayed(&mut self, next: DriveState, now_ns: u64) -> DriveState {
        let delay_s = self.faults.size(FaultKindConfig::DriveSlowEnable);
        let is_enabling = next == DriveState::OperationEnabled && !self.is_enabled();
        let Some(delay_s) = delay_s.filter(|_| is_enabling) else {
            self.enabling_since_ns = None;
            return next;
        };
        let since_ns = *self.enabling_since_ns.get_or_insert(now_ns);
        if now_ns - since_ns >= (delay_s * SECOND_NS as f64) as u64 {
            return next;
        }
        self.faults.strike(FaultKindConfig::DriveSlowEnable);
        if self.power == DriveState::ReadyToSwitchOn { DriveState::SwitchedOn } else { self.power }
    }

    /// Reacts by 6007h when nobody controls the drive any more; returns whether that put it into fault.
    pub(super) fn abort_connection(&mut self, now_ns: u64) -> bool {
        let was_in_fault = self.is_in_fault();
        match self.parameters.abort_connection_option {
            0 => {}
            1 => self.enter(self.power.after_fault(), now_ns),
            2 => self.obey(StateCommand::DisableVoltage, now_ns),
            _ => self.obey(StateCommand::QuickStop, now_ns),
        }
        self.is_in_fault() && !was_in_fault
    }

    /// The buffered cyclic targets take effect; a position beyond the velocity limit is approached further.
    pub(super) fn synchronise(&mut self, now_ns: u64, new: NewTargets, objects: &Objects) {
        if !self.is_enabled() || self.ignores(new) {
            return;
        }
        match self.mode {
            Mode::CyclicPosition
                if new.position
                    || self.is_target_limited && matches!(self.demand, Demand::Interpolate { .. }) =>
            {
                self.follow_target(now_ns, objects.get(names::TARGET_POSITION));
            }
            Mode::CyclicTorque if new.torque => self.apply_torque(objects.get(names::TARGET_TORQUE)),
            _ => {}
        }
    }

    /// Whether an injected fault makes the drive ignore its targets.
    fn ignores(&mut self, new: NewTargets) -> bool {
        let ignores = self.faults.has(FaultKindConfig::DriveIgnoresTargets);
        if ignores && new != NewTargets::default() {
            self.faults.strike(FaultKindConfig::DriveIgnoresTargets);
        }
        ignores
    }

    /// Follows a position target within the software position limits and the velocity limit.
    fn follow_target(&mut self, now_ns: u64, target: i32) {
        let allowed = self.position_view(now_ns).clamp(target);
        let Parameters { velocity_limit_m_s: limit_m_s, period_s, .. } = self.parameters;
        let (actual_m, target_m) = (self.measured_m(), self.metres(allowed));
        let is_too_fast = self.demand.interpolate(now_ns, actual_m, target_m, period_s, limit_m_s);
        self.is_target_limited = is_too_fast || allowed != target;
    }

    fn apply_torque(&mut self, torque_permille: i16) {
        let target_n = f64::from(torque_permille) / 1000.0 * self.config.rated_force_n;
        let limit_n = self.parameters.force_limit_n;
        let (force_n, is_limited) = clamp(target_n, [-limit_n, limit_n]);
        self.is_target_limited = is_limited;
        self.demand = Demand::Force { force_n };
    }

    /// A step of the servo loops; returns the force until the next one, N, and whether the following error became a
    /// fault.
    pub(super) fn step(&mut self, now_ns: u64, shaft: Shaft) -> (f64, bool) {
        self.complete_transition(now_ns);
        self.take_off_torque(now_ns);
        let seen_m = shaft.seen_m + self.gear_error_m(now_ns);
        let before = std::mem::replace(&mut self.counts, self.encoder.read(seen_m));
        if self.is_enabled() {
            let is_at_rest = self.demand.is_at_rest(now_ns);
            let command = match self.mode {
                Mode::ProfilePosition => self.positioning.step(self.controlword, is_at_rest),
                Mode::Homing => self.homing.step([before, self.counts], is_at_rest),
                Mode::CyclicPosition | Mode::CyclicTorque => None,
            };
            self.execute(command, now_ns);
        }
        let limits = self.servo_limits();
        let measured_m = self.encoder.metres(self.counts);
        let command = self.demand.servo_command(now_ns);
        let asked_n = self.servo.step(measured_m, seen_m - shaft.is_m, command, &limits);
        let is_braking = command == ServoCommand::Brake;
        self.motor_n = if is_braking { 0.0 } else { asked_n };
        let force_n =
            self.drive_motor(Asked { force_n: asked_n, is_braking, max_force_n: self.config.max_force_n });
        (force_n, self.supervise_following(now_ns))
    }

    /// The force of motor and brake, N. The loops know nothing of a fault; the current that the drive shows is the motor's.
    fn drive_motor(&mut self, asked: Asked) -> f64 {
        let force_n = self.motor.force_n(asked, self.servo.shaft(), &mut self.faults);
        if self.faults.has(FaultKindConfig::DriveRunaway) {
            self.motor_n = asked.max_force_n;
        }
        if asked.is_braking && self.faults.has(FaultKindConfig::BrakeOpen) {
            self.servo.release_brake();
        }
        force_n
    }

    /// Reads the encoder, as SYNC demands.
    pub(super) fn sample(&mut self, now_ns: u64, seen_m: f64) {
        let gear_error_m = self.gear_error_m(now_ns);
        self.counts = self.encoder.read(seen_m + gear_error_m);
    }

    /// The distance of what the drive sees from the shaft, where its gear ratio is or was wrong.
    fn gear_error_m(&mut self, now_ns: u64) -> f64 {
        let ratio = self.faults.size(FaultKindConfig::DriveScale);
        let error_m = self.gear.error_m(ratio, self.demand.position_m(now_ns));
        if error_m != 0.0 {
            self.faults.strike(FaultKindConfig::DriveScale);
        }
        error_m
    }

    /// While the torque is safely off, the drive stays in "switch on disabled", or in fault.
    fn take_off_torque(&mut self, now_ns: u64) {
        use DriveState::{
            Fault, FaultReactionActive, OperationEnabled, QuickStopActive, ReadyToSwitchOn, SwitchOnDisabled,
            SwitchedOn,
        };
        if !self.faults.has(FaultKindConfig::DriveSto) {
            return;
        }
        let state = match self.power {
            ReadyToSwitchOn | SwitchedOn | OperationEnabled | QuickStopActive => SwitchOnDisabled,
            FaultReactionActive => Fault,
            _ => return,
        };
        self.faults.strike(FaultKindConfig::DriveSto);
        self.enter(state, now_ns);
    }

    /// Writes the state of the axis into the objects that show it.
    pub(super) fn show(&self, now_ns: u64, objects: &mut Objects) {
        let actual = self.actual_increments();
        let demand = self.demand.position_m(now_ns).map_or(actual, |demand_m| self.increments(demand_m));
        let torque = self.motor_n / self.config.rated_force_n * 1000.0;
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
        let is_limited = self.is_target_limited || self.positioning.is_limited() || self.servo.is_limited();
        let word = Statusword::for_state(self.power)
            .with(StatusBit::VoltageEnabled, true)
            .with(StatusBit::Remote, true)
            .with(StatusBit::InternalLimit, is_enabled && is_limited);
        match self.mode {
            Mode::CyclicPosition => word
                .with(StatusBit::TargetFollowed, is_enabled)
                .with(StatusBit::FollowingError, self.following.is_fault()),
            Mode::CyclicTorque => word.with(StatusBit::TargetFollowed, is_enabled),
            Mode::ProfilePosition => word
                .with(StatusBit::TargetReached, is_enabled && self.has_reached_setpoint(now_ns))
                .with(StatusBit::SETPOINT_ACKNOWLEDGED, is_enabled && self.positioning.is_acknowledged())
                .with(StatusBit::FollowingError, self.following.is_fault()),
            Mode::Homing => self.homing.show(word, self.demand.is_at_rest(now_ns)),
        }
    }

    /// Statusword bit 10 of profile position: within the position window of the last set-point, or halted.
    fn has_reached_setpoint(&self, now_ns: u64) -> bool {
        if !self.demand.is_at_rest(now_ns) || self.positioning.has_waiting() {
            return false;
        }
        let demand_m = self.demand.position_m(now_ns).unwrap_or(self.measured_m());
        self.controlword.halts() || (demand_m - self.measured_m()).abs() <= self.parameters.position_window_m
    }

    fn enter(&mut self, state: DriveState, now_ns: u64) {
        if state == self.power {
            return;
        }
        self.power = state;
        self.following.restart(self.is_in_fault());
        self.interrupt_mode();
        match state {
            DriveState::OperationEnabled => self.enable(now_ns),
            DriveState::QuickStopActive => self.stop(now_ns, self.parameters.quick_stop_m_s2),
            DriveState::FaultReactionActive => self.stop(now_ns, self.parameters.fault_stop_m_s2),
            _ => self.demand = Demand::Brake,
        }
    }

    fn interrupt_mode(&mut self) {
        self.is_target_limited = false;
        (self.positioning, self.homing) = (Positioning::default(), self.homing.interrupted());
    }

    /// The cyclic modes wait for their first target behind a closed brake; the other modes hold the position.
    fn enable(&mut self, now_ns: u64) {
        if matches!(self.mode, Mode::ProfilePosition | Mode::Homing) {
            let here = Motion::at_rest(self.measured_m());
            self.demand =
                Demand::Profile(Profile::stop(now_ns, here, self.parameters.profile.deceleration_m_s2));
        }
    }

    /// The drive's own transitions: initialised, quick stop ended, fault reaction ended.
    fn complete_transition(&mut self, now_ns: u64) {
        let is_complete = match self.power {
            DriveState::QuickStopActive => {
                !self.parameters.holds_quick_stop && self.demand.is_at_rest(now_ns)
            }
            DriveState::FaultReactionActive => self.demand.is_at_rest(now_ns),
            _ => true,
        };
        if is_complete {
            self.enter(self.power.after_completion(), now_ns);
        }
    }

    fn supervise_following(&mut self, now_ns: u64) -> bool {
        let Some(window_m) = self.parameters.following_window_m else { return false };
        let error_m = self.demand.position_m(now_ns).map_or(0.0, |demand_m| demand_m - self.measured_m());
        if !self.following.exceeds(now_ns, error_m, window_m, self.parameters.following_timeout_ns) {
            return false;
        }
        self.enter(self.power.after_fault(), now_ns);
        self.following.fail();
        true
    }

    /// Executes a command of the mode of operation.
    fn execute(&mut self, command: Option<MotionCommand>, now_ns: u64) {
        let Parameters { profile, homing, .. } = self.parameters;
        let limits = if self.mode == Mode::Homing { homing } else { profile };
        match command {
            None => {}
            Some(MotionCommand::MoveTo { target }) => {
                let start = self.demand.at(now_ns).unwrap_or(Motion::at_rest(self.measured_m()));
                self.demand = Demand::Profile(Profile::to(now_ns, start, self.metres(target), &limits));
            }
            Some(MotionCommand::SlowDown) => self.slow_down(now_ns, limits.deceleration_m_s2),
            // Zero is the home offset (607Ch) beyond home, so that home has the position minus the offset (CiA 402).
            Some(MotionCommand::SetHome { counts }) => {
                self.origin_increments =
                    0_i32.saturating_sub(counts).saturating_sub(self.parameters.home_offset);
            }
        }
    }

    fn stop(&mut self, now_ns: u64, deceleration_m_s2: Option<f64>) {
        match deceleration_m_s2 {
            Some(deceleration_m_s2) => self.slow_down(now_ns, deceleration_m_s2),
            None => self.demand = Demand::Brake,
        }
    }

    fn slow_down(&mut self, now_ns: u64, deceleration_m_s2: f64) {
        self.demand.slow_down(now_ns, self.servo.motion(), deceleration_m_s2);
    }

    /// In force control the axis may be no faster than it can stop before the software position limits, at the
    /// profile deceleration (6084h).
    fn servo_limits(&self) -> ServoLimits {
        let Parameters { velocity_limit_m_s, force_limit_n, position_limits, profile, .. } = self.parameters;
        let ([lowest_m, highest_m], at_m) = (position_limits.map(|end| self.metres(end)), self.measured_m());
        let braking_m_s =
            |way_m: f64| (2.0 * profile.deceleration_m_s2 * way_m.max(0.0)).sqrt().min(velocity_limit_m_s);
        let free_velocity_m_s = [-braking_m_s(at_m - lowest_m), braking_m_s(highest_m - at_m)];
        ServoLimits { force_n: force_limit_n, velocity_m_s: velocity_limit_m_s, free_velocity_m_s }
    }

    /// The positions that a mode of operation sees. Homing moves the software position limits and may leave the axis
    /// outside of them: there it may stay or come nearer, but go no further.
    fn position_view(&self, now_ns: u64) -> PositionView {
        let [lowest, highest] = self.parameters.position_limits;
        let here = self.increments(self.demand.position_m(now_ns).unwrap_or(self.measured_m()));
        PositionView { actual: self.actual_increments(), allowed: [lowest.min(here), highest.max(here)] }
    }

    /// The measured position, m in the encoder's coordinates.
    fn measured_m(&self) -> f64 {
        self.servo.motion().position_m
    }

    /// Position actual value (6064h).
    fn actual_increments(&self) -> i32 {
        self.counts.saturating_add(self.origin_increments)
    }

    /// A position of the dictionary in the encoder's metres.
    fn metres(&self, increments: i32) -> f64 {
        self.encoder.metres(increments.saturating_sub(self.origin_increments))
    }

    /// A position in the encoder's metres as the dictionary has it.
    fn increments(&self, position_m: f64) -> i32 {
        self.encoder.nearest(position_m).saturating_add(self.origin_increments)
    }
}
