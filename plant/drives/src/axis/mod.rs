//! The drive's axis under CiA 402: power states, modes of operation, and the objects that show them.
//!
//! An axis handles no frames and works in SI units. [`Axis`] sequences its parts: [`Positioning`] and [`Homing`] return
//! commands, the servo follows the [`Demand`], monitors judge both. [`Parameters`] is
//! the configuration in the object dictionary.

mod demand;
pub(crate) mod drivetrain;
pub(crate) mod encoder;
pub(crate) mod modes;
pub(crate) mod motion;
pub(crate) mod parameters;
mod power;
mod profile;
mod servo;
mod supervision;

use masseter_can::canopen::EmergencyCode;
use masseter_can::cia402::{ControlBit, Controlword, DriveState, StateCommand, StatusBit, Statusword};

use crate::faults::{DriveFault, DriveFaults};
use crate::{dictionary::Objects, names, quirks::AxisQuirks, ratings::Ratings, settings::DriveSettings};
use demand::{Demand, Ramp, ServoCommand};
use drivetrain::Drivetrain;
use encoder::{Coordinates, Look, Switches};
use modes::{Homing, Positioning, Sensed};
use motion::{Mode, Motion, MotionCommand, NewTargets, PositionView, clamp};
use parameters::{Offsets, Parameters};
use power::PowerStage;
use profile::Profile;
use servo::ServoLimits;
use supervision::{FollowingErrorMonitor, RunawayMonitor};

/// One axis.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub(crate) struct Axis {
    config: Ratings,
    quirks: AxisQuirks,
    coordinates: Coordinates,
    switches: Switches,
    drivetrain: Drivetrain,
    /// The motor's force in 6077h, N: at SYNC the mean since the last SYNC, otherwise the present value.
    shown_n: f64,
    parameters: Parameters,
    demand: Demand,
    following: FollowingErrorMonitor,
    runaway: RunawayMonitor,
    positioning: Positioning,
    pub(super) homing: Homing,
    mode: Mode,
    pub(crate) power: PowerStage,
    controlword: Controlword,
    /// Offsets of the cyclic modes.
    offsets: Offsets,
    /// Whether the newest cyclic target was limited.
    is_target_limited: bool,
    /// Injected faults of the drive.
    pub(crate) faults: DriveFaults,
}

impl Axis {
    /// An axis that is switched on at a position.
    pub(super) fn new(
        settings: &DriveSettings,
        quirks: AxisQuirks,
        now_ns: u64,
        position_m: f64,
        objects: &Objects,
    ) -> Self {
        let DriveSettings { ratings: config, step_ns, stroke_m, .. } = *settings;
        let step_s = step_ns as f64 * 1e-9;
        Self {
            parameters: Parameters::from_objects(objects, &config, &quirks),
            drivetrain: Drivetrain::new(config, &quirks, step_s, position_m),
            shown_n: 0.0,
            coordinates: Coordinates::new(config.encoder_resolution_m, position_m, quirks.is_incremental),
            switches: Switches::new(stroke_m, position_m),
            config,
            quirks,
            demand: Demand::Brake,
            following: FollowingErrorMonitor::default(),
            runaway: RunawayMonitor::default(),
            positioning: Positioning::default(),
            homing: Homing::default(),
            mode: Mode::from_number(objects.get(names::MODE)).unwrap_or(Mode::CyclicPosition),
            power: PowerStage::new(now_ns.saturating_add(quirks.torque_off_ns)),
            controlword: Controlword::DISABLE_VOLTAGE,
            offsets: Offsets::default(),
            is_target_limited: false,
            faults: DriveFaults::default(),
        }
    }

    /// Goes into fault; returns whether the fault is new.
    pub(super) fn fail(&mut self, now_ns: u64) -> bool {
        let fails = !self.power.is_in_fault();
        self.enter(self.power.state.after_fault(), now_ns);
        fails
    }

    /// The state after power-on: the brake closes, and positions count from the encoder's own zero.
    pub(super) fn restart(&mut self, now_ns: u64, objects: &Objects) {
        self.controlword = Controlword::DISABLE_VOLTAGE;
        self.homing = Homing::default();
        self.coordinates.restart();
        self.enter(DriveState::NotReadyToSwitchOn, now_ns);
        self.configure(now_ns, objects);
    }

    /// Applies the dictionary's configuration. A mode that changes in operation brings the axis to rest, unless the mode
    /// has a target already.
    pub(super) fn configure(&mut self, now_ns: u64, objects: &Objects) {
        self.parameters = Parameters::from_objects(objects, &self.config, &self.quirks);
        let mode = Mode::supported(objects.get(names::MODE), objects).unwrap_or(self.mode);
        if mode != self.mode {
            self.mode = mode;
            self.interrupt_mode();
            if self.power.is_enabled() {
                self.slow_down(now_ns, self.parameters.profile.deceleration_m_s2);
            }
        }
    }

    /// Obeys a controlword (6040h); returns whether the controlword ended a fault.
    pub(super) fn control(&mut self, now_ns: u64, word: Controlword, objects: &Objects) -> bool {
        let before = std::mem::replace(&mut self.controlword, word);
        let was_fault = self.power.state == DriveState::Fault;
        self.obey(word.command(before, self.power.state), now_ns);
        if self.power.is_operated() {
            let (words, view) = ([before, word], self.position_view(now_ns));
            let (target, method) = (objects.get(names::TARGET_POSITION), self.parameters.homing_method);
            let command = match self.mode {
                Mode::ProfilePosition => self.positioning.control(words, target, view),
                Mode::Homing => {
                    let (counts, limits) = (self.coordinates.counts, self.switches.limits);
                    self.homing.control(words, method, counts, limits, view)
                }
                Mode::ProfileVelocity | Mode::ProfileTorque => (word.has(ControlBit::Halt)
                    && !before.has(ControlBit::Halt))
                .then_some(MotionCommand::SlowDown),
                Mode::CyclicPosition | Mode::CyclicVelocity | Mode::CyclicTorque => None,
            };
            self.execute(command, now_ns);
        }
        was_fault && self.power.state != DriveState::Fault
    }

    fn obey(&mut self, command: StateCommand, now_ns: u64) {
        let holds_quick_stop = self.parameters.holds_quick_stop;
        let next = self.power.after(command, holds_quick_stop, now_ns, &mut self.faults);
        let Some(next) = next else { return };
        match (self.power.is_enabled(), command, next) {
            (true, StateCommand::Shutdown, next) => self.leave(next, self.parameters.shutdown_m_s2, now_ns),
            (true, StateCommand::SwitchOn, next) => self.leave(next, self.parameters.disable_m_s2, now_ns),
            _ => {
                self.power.leaves_for = None;
                self.enter(next, now_ns);
            }
        }
    }

    /// Leaves "operation enabled" at once, or at rest after a ramp.
    fn leave(&mut self, next: DriveState, deceleration_m_s2: Option<f64>, now_ns: u64) {
        let Some(deceleration_m_s2) = deceleration_m_s2 else { return self.enter(next, now_ns) };
        if self.power.leaves_for.replace(next).is_none() {
            self.interrupt_mode();
            self.slow_down(now_ns, deceleration_m_s2);
        }
    }

    /// Reacts by 6007h to the loss of control over the drive; returns whether the reaction is a fault.
    pub(super) fn abort_connection(&mut self, now_ns: u64) -> bool {
        let was_in_fault = self.power.is_in_fault();
        match self.parameters.abort_connection_option {
            0 => {}
            _ if self.quirks.coasts_without_master && self.power.is_operated() => {
                self.drivetrain.brake.fail_open();
                self.obey(StateCommand::DisableVoltage, now_ns);
            }
            1 => self.enter(self.power.state.after_fault(), now_ns),
            2 => self.obey(StateCommand::DisableVoltage, now_ns),
            _ => self.obey(StateCommand::QuickStop, now_ns),
        }
        self.power.is_in_fault() && !was_in_fault
    }

    /// Applies the buffered cyclic targets. If the velocity limit has cut the way to the last target, the axis goes on
    /// towards that target at every SYNC.
    pub(super) fn synchronise(&mut self, now_ns: u64, new: NewTargets, objects: &Objects) {
        let is_free = self.drivetrain.brake.free_from_ns(now_ns) == now_ns;
        if !self.power.is_operated() || !is_free || self.ignores(new) {
            return;
        }
        self.offsets = Offsets::from_objects(objects, &self.config);
        match self.mode {
            Mode::CyclicPosition
                if new.position
                    || self.is_target_limited && matches!(self.demand, Demand::Interpolate { .. }) =>
            {
                let target = objects.get(names::TARGET_POSITION);
                self.follow_target(now_ns, target.saturating_add(self.offsets.position));
            }
            Mode::CyclicVelocity if new.velocity => {
                let (target_m_s, start_m_s) = (self.target_m_s(objects), self.speed_m_s(now_ns));
                let rate_per_s = (target_m_s - start_m_s).abs() / self.parameters.period_s;
                self.demand =
                    Demand::Speed(Ramp { from_ns: now_ns, start: start_m_s, target: target_m_s, rate_per_s });
            }
            Mode::CyclicTorque if new.torque => {
                self.demand = Demand::Force(Ramp::at_once(self.target_n(objects)));
            }
            _ => {}
        }
    }

    /// Takes the target of profile velocity or torque, which counts as long as the drive is enabled and not halted. A
    /// target that runs already goes on.
    pub(super) fn retarget(&mut self, now_ns: u64, objects: &Objects) {
        let is_profile = matches!(self.mode, Mode::ProfileVelocity | Mode::ProfileTorque);
        if !is_profile || !self.power.is_operated() || self.controlword.has(ControlBit::Halt) {
            return;
        }
        if self.ignores(NewTargets { velocity: true, torque: true, ..NewTargets::default() }) {
            return;
        }
        // Nothing moves while the brake opens.
        let from_ns = self.drivetrain.brake.free_from_ns(now_ns);
        let Parameters { torque_slope_n_s, profile, .. } = self.parameters;
        if self.mode == Mode::ProfileTorque {
            let (target, start) = (self.target_n(objects), self.drivetrain.motor_n.value);
            if !matches!(self.demand, Demand::Force(ramp) if ramp.target.to_bits() == target.to_bits()) {
                self.demand = Demand::Force(Ramp { from_ns, start, target, rate_per_s: torque_slope_n_s });
            }
            return;
        }
        let (target, start) = (self.target_m_s(objects), self.speed_m_s(now_ns));
        if !matches!(self.demand, Demand::Speed(ramp) if ramp.target.to_bits() == target.to_bits()) {
            let speeds_up = target.abs() > start.abs();
            let rate_per_s = if speeds_up { profile.acceleration_m_s2 } else { profile.deceleration_m_s2 };
            self.demand = Demand::Speed(Ramp { from_ns, start, target, rate_per_s });
        }
    }

    /// The demanded velocity where there is one, else the actual one, m/s.
    fn speed_m_s(&self, now_ns: u64) -> f64 {
        let Demand::Speed(ramp) = self.demand else { return self.drivetrain.servo.motion.velocity_m_s };
        ramp.at(now_ns)
    }

    /// The target velocity (60FFh) within its limit, m/s.
    fn target_m_s(&mut self, objects: &Objects) -> f64 {
        let target = f64::from(objects.get(names::TARGET_VELOCITY)) * self.config.encoder_resolution_m;
        let limit_m_s = self.parameters.velocity_limit_m_s;
        let (target_m_s, is_limited) = clamp(target + self.offsets.velocity_m_s, [-limit_m_s, limit_m_s]);
        self.is_target_limited = is_limited;
        target_m_s
    }

    /// Whether an injected fault makes the drive ignore its targets.
    fn ignores(&mut self, new: NewTargets) -> bool {
        let ignores = self.faults.has(DriveFault::IgnoresTargets);
        if ignores && new != NewTargets::default() {
            self.faults.strike(DriveFault::IgnoresTargets);
        }
        ignores
    }

    /// Follows a position target within the software position limits and the velocity limit.
    fn follow_target(&mut self, now_ns: u64, target: i32) {
        let allowed = self.position_view(now_ns).clamp(target);
        let Parameters { velocity_limit_m_s: limit_m_s, period_s, .. } = self.parameters;
        let (actual_m, target_m) = (self.measured_m(), self.coordinates.metres(allowed));
        let is_too_fast = self.demand.interpolate(now_ns, actual_m, target_m, period_s, limit_m_s);
        self.is_target_limited = is_too_fast || allowed != target;
    }

    /// The target torque (6071h) within its limit, N.
    fn target_n(&mut self, objects: &Objects) -> f64 {
        let torque_permille = objects.get(names::TARGET_TORQUE);
        let target_n = f64::from(torque_permille) / 1000.0 * self.config.rated_force_n + self.offsets.force_n;
        let limit_n = self.parameters.force_limit_n;
        let (force_n, is_limited) = clamp(target_n, [-limit_n, limit_n]);
        self.is_target_limited = is_limited;
        force_n
    }

    /// A step of the servo loops with the shaft at a position. Returns the force until the next step, N, and the error
    /// that has become a fault. `look` gives the encoder's output at its own position.
    pub(super) fn step(
        &mut self,
        now_ns: u64,
        position_m: f64,
        look: &mut dyn FnMut(f64) -> Look,
    ) -> (f64, Option<EmergencyCode>) {
        self.complete_transition(now_ns);
        if let Some(state) = self.power.without_torque(&mut self.faults) {
            self.enter(state, now_ns);
        }
        let Look { shown_m, seen_m } = look(position_m + self.gear_error_m(now_ns));
        let counts = self.coordinates.read(shown_m);
        self.switches.look(position_m);
        if self.power.is_operated() {
            let is_at_rest = || self.demand.is_at_rest(now_ns);
            let command = match self.mode {
                Mode::ProfilePosition => self.positioning.step(self.controlword, is_at_rest()),
                Mode::Homing => {
                    let sensed = self.sensed(counts, is_at_rest());
                    self.homing.step(&sensed)
                }
                _ => None,
            };
            self.execute(command, now_ns);
        }
        let places_m = [self.coordinates.counted_m(), seen_m - position_m];
        let has_jumped = self.supervise_encoder(now_ns);
        let command = self.servo_command(now_ns);
        let limits = self.servo_limits(command);
        let before_m_s = self.drivetrain.servo.motion.velocity_m_s;
        let force_n = self.drivetrain.step(now_ns, places_m, command, &limits, &mut self.faults);
        self.shown_n = self.drivetrain.motor_n.value;
        let error = if has_jumped {
            Some(EmergencyCode::POSITION_SENSOR)
        } else if self.supervise_velocity(now_ns, command, before_m_s) {
            Some(EmergencyCode::VELOCITY)
        } else {
            self.supervise_following(now_ns, command).then_some(EmergencyCode::FOLLOWING_ERROR)
        };
        (force_n, error)
    }

    /// The command of the loops, with the velocity offset of cyclic synchronous position.
    fn servo_command(&self, now_ns: u64) -> ServoCommand {
        match self.demand.servo_command(now_ns) {
            ServoCommand::Follow(Motion { position_m, velocity_m_s })
                if self.mode == Mode::CyclicPosition =>
            {
                let velocity_m_s = velocity_m_s + self.offsets.velocity_m_s;
                ServoCommand::Follow(Motion { position_m, velocity_m_s })
            }
            command => command,
        }
    }

    /// The inputs of homing.
    fn sensed(&self, counts: [i32; 2], is_at_rest: bool) -> Sensed {
        let pushes = self.drivetrain.pushes();
        let (actual, limits) = (self.coordinates.actual(), self.switches.limits);
        Sensed { counts, actual, limits, pushes, is_at_rest }
    }

    /// Reads the encoder and takes the motor's mean force, as SYNC demands.
    pub(super) fn sample(&mut self, now_ns: u64, position_m: f64, look: &mut dyn FnMut(f64) -> Look) {
        self.shown_n = self.drivetrain.motor_n.take_mean(now_ns);
        let Look { shown_m, .. } = look(position_m + self.gear_error_m(now_ns));
        self.coordinates.read(shown_m);
    }

    /// The distance of the encoder from the shaft. Only a fault asks for the demand, which costs two divisions.
    fn gear_error_m(&mut self, now_ns: u64) -> f64 {
        let demand_m = if self.faults.is_empty() { None } else { self.demand.position_m(now_ns) };
        self.drivetrain.gear_error_m(demand_m, &mut self.faults)
    }

    /// Writes the state of the axis into the objects that show it.
    pub(super) fn show(&self, now_ns: u64, objects: &mut Objects) {
        let actual = self.coordinates.actual();
        let motion = self.demand.at(now_ns);
        let demand = motion.map_or(actual, |motion| self.coordinates.increments(motion.position_m));
        let speed_m_s = match &self.demand {
            Demand::Speed(ramp) => ramp.at(now_ns),
            _ => motion.map_or(0.0, |motion| motion.velocity_m_s),
        };
        let torque = self.shown_n / self.config.rated_force_n * 1000.0;
        objects.set(names::STATUSWORD, self.statusword(now_ns).0);
        objects.set(names::MODE_DISPLAY, self.mode.number());
        objects.set(names::POSITION_DEMAND, demand);
        objects.set(names::VELOCITY_DEMAND, self.coordinates.nearest(speed_m_s));
        objects.set(names::ENCODER_COUNTS, self.coordinates.shown_counts());
        objects.set(names::POSITION_ACTUAL, actual);
        objects
            .set(names::VELOCITY_ACTUAL, self.coordinates.nearest(self.drivetrain.servo.motion.velocity_m_s));
        objects.set(names::TORQUE_ACTUAL, torque.round() as i16);
        objects.set(names::FOLLOWING_ERROR, demand.saturating_sub(actual));
        objects.set(names::DIGITAL_INPUTS, self.switches.inputs());
    }

    fn statusword(&self, now_ns: u64) -> Statusword {
        let is_enabled = self.power.is_enabled();
        let is_free = is_enabled && self.drivetrain.brake.free_from_ns(now_ns) == now_ns;
        let is_limited =
            self.is_target_limited || self.positioning.is_limited || self.drivetrain.servo.is_limited;
        let word = Statusword::for_state(self.power.state)
            .with(StatusBit::VoltageEnabled, true)
            .with(StatusBit::Remote, true)
            .with(StatusBit::InternalLimit, is_enabled && is_limited);
        match self.mode {
            Mode::CyclicPosition => word
                .with(StatusBit::TargetFollowed, is_free)
                .with(StatusBit::FollowingError, self.following.is_fault),
            Mode::CyclicVelocity | Mode::CyclicTorque => word.with(StatusBit::TargetFollowed, is_free),
            Mode::ProfileVelocity => word
                .with(StatusBit::TargetReached, is_enabled && self.has_reached_value(now_ns))
                .with(StatusBit::SPEED_ZERO, self.stands()),
            Mode::ProfileTorque => {
                word.with(StatusBit::TargetReached, is_enabled && self.has_reached_value(now_ns))
            }
            Mode::ProfilePosition => word
                .with(StatusBit::TargetReached, is_enabled && self.has_reached_setpoint(now_ns))
                .with(StatusBit::SETPOINT_ACKNOWLEDGED, is_enabled && self.positioning.is_acknowledged)
                .with(StatusBit::FollowingError, self.following.is_fault),
            Mode::Homing => self.homing.show(word, self.demand.is_at_rest(now_ns)),
        }
    }

    /// Statusword bit 10 of profile position: within the position window of the last set-point, or halted.
    fn has_reached_setpoint(&self, now_ns: u64) -> bool {
        if !self.demand.is_at_rest(now_ns) || self.positioning.waiting.is_some() {
            return false;
        }
        let demand_m = self.demand.position_m(now_ns).unwrap_or(self.measured_m());
        self.controlword.has(ControlBit::Halt)
            || (demand_m - self.measured_m()).abs() <= self.parameters.position_window_m
    }

    /// Statusword bit 10 of profile velocity and torque: the target is there, or the axis is halted.
    fn has_reached_value(&self, now_ns: u64) -> bool {
        match &self.demand {
            Demand::Speed(ramp) => {
                let error_m_s = ramp.target - self.drivetrain.servo.motion.velocity_m_s;
                error_m_s.abs() <= self.parameters.velocity_window_m_s
            }
            Demand::Force(ramp) => ramp.at(now_ns).to_bits() == ramp.target.to_bits(),
            demand => self.controlword.has(ControlBit::Halt) && demand.is_at_rest(now_ns),
        }
    }

    /// Whether the axis is slower than the velocity threshold (606Fh).
    fn stands(&self) -> bool {
        self.drivetrain.servo.motion.velocity_m_s.abs() <= self.parameters.velocity_threshold_m_s
    }

    fn enter(&mut self, state: DriveState, now_ns: u64) {
        if state == self.power.state {
            return;
        }
        (self.power.state, self.power.leaves_for) = (state, None);
        self.runaway = RunawayMonitor::default();
        self.following.restart(self.power.is_in_fault());
        self.interrupt_mode();
        match state {
            DriveState::OperationEnabled => self.enable(now_ns),
            DriveState::QuickStopActive => self.stop(now_ns, self.parameters.quick_stop_m_s2),
            DriveState::FaultReactionActive => self.stop(now_ns, self.parameters.fault_stop_m_s2),
            _ => self.demand = Demand::Brake,
        }
    }

    fn interrupt_mode(&mut self) {
        (self.is_target_limited, self.offsets) = (false, Offsets::default());
        (self.positioning, self.homing) = (Positioning::default(), self.homing.interrupted());
    }

    /// The cyclic modes wait for their first target behind a closed brake; the other modes hold the position.
    fn enable(&mut self, now_ns: u64) {
        self.drivetrain.brake.open(now_ns);
        let waits = matches!(self.mode, Mode::CyclicPosition | Mode::CyclicVelocity | Mode::CyclicTorque);
        if !waits {
            let here = Motion::at_rest(self.measured_m());
            self.demand =
                Demand::Profile(Profile::stop(now_ns, here, self.parameters.profile.deceleration_m_s2));
        }
    }

    /// The drive's own transitions: initialised, quick stop ended, fault reaction ended.
    fn complete_transition(&mut self, now_ns: u64) {
        let is_complete = match self.power.state {
            DriveState::QuickStopActive => {
                !self.parameters.holds_quick_stop && self.demand.is_at_rest(now_ns)
            }
            DriveState::FaultReactionActive => self.demand.is_at_rest(now_ns),
            DriveState::OperationEnabled => self.power.leaves_for.is_some() && self.demand.is_at_rest(now_ns),
            _ => true,
        };
        if is_complete {
            self.enter(self.power.leaves_for.unwrap_or(self.power.state.after_completion()), now_ns);
        }
    }

    /// Judges the last count of an axis under torque; returns whether a jump has become a fault. The reaction is the brake:
    /// no loop shall follow the jump.
    fn supervise_encoder(&mut self, now_ns: u64) -> bool {
        let jumps =
            self.demand != Demand::Brake && self.drivetrain.servo.is_jump(self.coordinates.counted_m());
        if jumps {
            self.enter(DriveState::Fault, now_ns);
        }
        jumps
    }

    /// Judges the velocity against the demand; returns whether their distance is a new fault. An axis that stops stays near its
    /// ramp; a halt and a change of mode are no stops. In operation [`RunawayMonitor`] judges. The reaction is the brake: such a
    /// loop closes over a wrong position, or lacks the force (IEC 61800-5-2, SS1-r).
    fn supervise_velocity(&mut self, now_ns: u64, command: ServoCommand, before_m_s: f64) -> bool {
        let ServoCommand::Follow(demanded) = command else { return false };
        let is_stopping = self.power.leaves_for.is_some()
            || matches!(self.power.state, DriveState::QuickStopActive | DriveState::FaultReactionActive);
        let servo = &self.drivetrain.servo;
        let motion = servo.motion;
        let most_m_s = servo.runaway_m_s();
        let leaves_ramp = is_stopping && (motion.velocity_m_s - demanded.velocity_m_s).abs() > most_m_s;
        let runs_away = self.runaway.exceeds(before_m_s, motion, demanded, [servo.runaway_m(), most_m_s]);
        let is_new = (leaves_ramp || runs_away) && !self.power.is_in_fault();
        if leaves_ramp || runs_away {
            self.enter(DriveState::Fault, now_ns);
        }
        is_new
    }

    /// Judges the error of the servo from its demanded position.
    fn supervise_following(&mut self, now_ns: u64, command: ServoCommand) -> bool {
        let Some(window_m) = self.parameters.following_window_m else { return false };
        let error_m = match command {
            ServoCommand::Follow(demanded) => demanded.position_m - self.measured_m(),
            ServoCommand::Brake | ServoCommand::Speed { .. } | ServoCommand::Force { .. } => 0.0,
        };
        if !self.following.exceeds(now_ns, error_m, window_m, self.parameters.following_timeout_ns) {
            return false;
        }
        self.enter(self.power.state.after_fault(), now_ns);
        self.following.is_fault = true;
        true
    }

    /// Compares the last count with a second encoder at the joint; returns whether their distance has become a fault.
    /// The reaction is the brake instead of a ramp, because the true position is unknown.
    pub(super) fn compare_encoders(&mut self, now_ns: u64, joint_m: f64) -> bool {
        let Some(limit_m) = self.quirks.encoders_apart_m else { return false };
        let is_apart = (self.coordinates.counted_m() - joint_m).abs() > limit_m;
        let fails = is_apart && self.power.state != DriveState::Fault;
        if fails {
            self.enter(DriveState::Fault, now_ns);
        }
        fails
    }

    /// Executes a command of the mode of operation.
    fn execute(&mut self, command: Option<MotionCommand>, now_ns: u64) {
        let Some(command) = command else { return };
        let Parameters { profile, homing, homing_to_switch, halt_m_s2, .. } = self.parameters;
        let limits = match self.mode {
            Mode::Homing if matches!(self.homing, Homing::Approaching(_)) => homing_to_switch,
            Mode::Homing => homing,
            _ => profile,
        };
        // Nothing moves while the brake opens.
        let from_ns = self.drivetrain.brake.free_from_ns(now_ns);
        match command {
            MotionCommand::MoveTo { target } => {
                let start = self.demand.at(now_ns).unwrap_or(Motion::at_rest(self.measured_m()));
                self.demand =
                    Demand::Profile(Profile::to(from_ns, start, self.coordinates.metres(target), &limits));
            }
            MotionCommand::SlowDown => {
                let halt_m_s2 = halt_m_s2.filter(|_| self.controlword.has(ControlBit::Halt));
                self.slow_down(now_ns, halt_m_s2.unwrap_or(limits.deceleration_m_s2));
            }
            MotionCommand::Hold => {
                let here = Motion::at_rest(self.measured_m());
                self.demand = Demand::Profile(Profile::stop(now_ns, here, limits.deceleration_m_s2));
            }
            MotionCommand::SetHome { counts } => {
                self.coordinates.set_home(counts, self.parameters.home_position);
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
        let servo = &self.drivetrain.servo;
        self.demand.slow_down(now_ns, servo.motion, deceleration_m_s2, servo.runaway_m_s());
    }

    /// The software position limits, which have no meaning before the homing of an incremental encoder.
    fn position_limits(&self) -> [i32; 2] {
        let is_referenced = self.coordinates.is_referenced;
        if is_referenced { self.parameters.position_limits } else { [i32::MIN, i32::MAX] }
    }

    fn servo_limits(&self, command: ServoCommand) -> ServoLimits {
        let Parameters { velocity_limit_m_s, force_limit_n, .. } = self.parameters;
        let is_free = matches!(command, ServoCommand::Speed { .. } | ServoCommand::Force { .. });
        let free_velocity_m_s = if is_free { self.free_velocity_m_s() } else { [0.0; 2] };
        let is_fed = matches!(self.mode, Mode::CyclicPosition | Mode::CyclicVelocity);
        let feed_n = if is_fed { self.offsets.force_n } else { 0.0 };
        ServoLimits { force_n: force_limit_n, velocity_m_s: velocity_limit_m_s, free_velocity_m_s, feed_n }
    }

    /// Speed limit in velocity and force control: the axis can stop before the software position limits, at the profile deceleration
    /// (6084h).
    fn free_velocity_m_s(&self) -> [f64; 2] {
        let Parameters { velocity_limit_m_s, profile, .. } = self.parameters;
        let ([lowest_m, highest_m], at_m) =
            (self.position_limits().map(|end| self.coordinates.metres(end)), self.measured_m());
        let braking_m_s =
            |way_m: f64| (2.0 * profile.deceleration_m_s2 * way_m.max(0.0)).sqrt().min(velocity_limit_m_s);
        [-braking_m_s(at_m - lowest_m), braking_m_s(highest_m - at_m)]
    }

    /// The positions for a mode of operation. Homing moves the software position limits and may leave the axis outside:
    /// the axis may then stay or come nearer, but go no further.
    fn position_view(&self, now_ns: u64) -> PositionView {
        let [lowest, highest] = self.position_limits();
        let here = self.coordinates.increments(self.demand.position_m(now_ns).unwrap_or(self.measured_m()));
        PositionView { actual: self.coordinates.actual(), allowed: [lowest.min(here), highest.max(here)] }
    }

    /// The measured position, m in the encoder's coordinates.
    fn measured_m(&self) -> f64 {
        self.drivetrain.servo.motion.position_m
    }
}
