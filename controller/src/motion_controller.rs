//! One cycle of the controller: reading → FK → pose → control → IK → limited command.
//!
//! A pure step function: time and readings come in, messages go out, and nothing is allocated. This module
//! uses no transport, no clock and no CAN.

mod outputs;

use std::hint::black_box;

use masseter_shared::config::{ControllerConfig, Scenario};
use masseter_shared::control::{Controller, Outcome, Tick};
use masseter_shared::geometry::{AXES, Actuators, Mechanism, Pose};
use masseter_shared::messages::codes::{Cause, ControllerState, DriveState, NO_DRIVE_STATE, drive_state};
use masseter_shared::messages::{Command, Event, Reading, State};

use crate::command_acknowledgement::CommandAcknowledgement;
use crate::kinematics::{ForwardTracker, Solution};
use crate::playback::Playback;
use crate::pose_control::PoseControl;
use crate::safety::{self, Fault};
use crate::sequence::{Trigger, next};
use crate::trajectory::Trajectory;
use crate::transition;

/// Bits of [`Reading::fresh_axes`] when all axes are fresh.
const ALL_AXES: u32 = (1 << AXES) - 1;

/// Age of a reading that comes late but is used.
const LATE_READING_CYCLES: u64 = 1;

/// Cycles for which the last command is repeated, so that the drives receive it.
const REPEATED_CYCLES: u64 = 5;
/// How long a safe stop waits for the drives to be off, s.
const SAFE_STOP_S: f64 = 0.3;

/// The estimate of the mechanism from the last complete reading.
#[derive(Debug, Clone, Copy)]
struct Estimate {
    reading_cycle: u64,
    sampled_ns: u64,
    measured: Actuators,
    solution: Solution,
}

/// The controller's whole memory.
#[derive(Debug)]
pub struct MotionController {
    mechanism: Mechanism,
    config: ControllerConfig,
    period_s: f64,
    velocity_limit_m_s: [f64; AXES],
    /// The most that the trim may move an axis.
    trim_reach_m: f64,
    tracker: ForwardTracker,
    playback: Playback,
    acknowledgement: CommandAcknowledgement,
    control: PoseControl,

    state: ControllerState,
    cycles_in_state: u64,
    /// Cycles in this state since the desired pose no longer changes.
    cycles_at_rest: u64,
    last_cycle: u64,
    steady_readings: u32,
    silent_cycles: u64,
    stop_requested: bool,
    estimate: Option<Estimate>,
    drive_state: [u32; AXES],
    /// The first fault since the last decision.
    fault: Option<Fault>,
    desired: Option<Pose>,
    target: Option<Actuators>,
}

impl MotionController {
    /// A controller that plays `trajectory` on `mechanism` once the rig is ready.
    pub fn new(scenario: &Scenario, mechanism: Mechanism, trajectory: Trajectory) -> Self {
        let config = scenario.controller;
        let velocity_limit_m_s = std::array::from_fn(|axis| scenario.drives.of_axis(axis).max_velocity_m_s);
        Self {
            tracker: ForwardTracker::new(mechanism.clone()),
            playback: Playback::new(trajectory, config.ease_s, config.stop_ramp_s),
            acknowledgement: CommandAcknowledgement::default(),
            control: PoseControl::new(&config),
            trim_reach_m: config.trim_limit_m + config.trim_limit_rad * mechanism.platform_arm_m(),
            mechanism,
            config,
            period_s: scenario.period_s(),
            velocity_limit_m_s,
            state: ControllerState::WaitReadings,
            cycles_in_state: 0,
            cycles_at_rest: 0,
            last_cycle: 0,
            steady_readings: 0,
            silent_cycles: 0,
            stop_requested: false,
            estimate: None,
            drive_state: [NO_DRIVE_STATE; AXES],
            fault: None,
            desired: None,
            target: None,
        }
    }

    /// The state of the sequence.
    pub fn state(&self) -> ControllerState {
        self.state
    }

    /// Whether all drives report that they are without voltage: a lost one reports nothing, and may not be.
    fn drives_are_off(&self) -> bool {
        let is_off = |&code: &u32| matches!(drive_state(code), Ok(Some(state)) if !state.is_powered());
        self.drive_state.iter().all(is_off)
    }

    fn take(&mut self, reading: &Reading) -> Result<(), Fault> {
        safety::check_reading(reading)?;
        safety::check_commander(reading, self.last_cycle)?;
        self.drive_state = reading.drive_state;
        safety::check_drives(reading, self.is_moving())?;
        if reading.fresh_axes != ALL_AXES {
            self.steady_readings = 0;
            return Ok(());
        }
        let measured = Actuators::from_axes(reading.position_m);
        let solution = self.tracker.update(&measured).map_err(|error| Fault::from(&error))?;
        self.estimate = Some(Estimate {
            reading_cycle: reading.cycle,
            sampled_ns: reading.sampled_ns,
            measured,
            solution,
        });
        self.acknowledgement.answer(reading.answers_cycle);
        self.silent_cycles = 0;
        self.steady_readings = self.steady_readings.saturating_add(1);
        Ok(())
    }

    /// The fault of a wait that took too long.
    fn overdue(&self) -> Option<Fault> {
        let timeout_cycles = self.config.start_timeout_s / self.period_s;
        let waited = self.cycles_in_state as f64;
        let silent = self.silent_cycles as f64;
        let stale_limit = f64::from(self.config.stale_cycles);
        match self.state {
            ControllerState::WaitReadings if waited > timeout_cycles => {
                Some(Fault::new(Cause::StaleReading, waited, timeout_cycles))
            }
            ControllerState::Enabling | ControllerState::Disabling if waited > timeout_cycles => {
                Some(Fault::new(Cause::EnableTimeout, waited, timeout_cycles))
            }
            ControllerState::WaitReadings | ControllerState::Finished | ControllerState::SafeStop => None,
            _ if silent > stale_limit => Some(Fault::new(Cause::StaleReading, silent, stale_limit)),
            _ => None,
        }
    }

    /// Pose control, inverse kinematics and limits: the targets of this cycle.
    fn control(&mut self) -> Result<(), Fault> {
        let desired = self.playback.pose_ahead(-self.sample_age_s());
        self.desired = Some(desired);
        if !self.is_moving() {
            return Ok(());
        }
        if let Some(estimate) = &self.estimate
            && self.silent_cycles == 0
        {
            safety::check_tracking(&desired, &estimate.solution.pose, self.config.tracking_limit_m)?;
            self.control.observe(&desired, &estimate.solution.pose, self.period_s);
        }
        let ahead = self.playback.pose_ahead(self.lead_s());
        let joints = self.mechanism.inverse(&self.control.correct(&ahead))?;
        // A motion that uses its strokes to the end leaves no room for the trim.
        let before = self.target.unwrap_or(joints.actuators);
        let target = self.mechanism.strokes().clamp(&joints.actuators, &before, self.trim_reach_m)?;
        safety::check_velocity(&target, &before, &self.velocity_limit_m_s, self.period_s)?;
        self.target = Some(target);
        Ok(())
    }

    /// How far the motion has gone on since the estimate's sample, against a reading in time, s. The motion waits for
    /// readings that are later than that.
    fn sample_age_s(&self) -> f64 {
        let reading_cycle = self.estimate.map_or(self.last_cycle, |estimate| estimate.reading_cycle);
        self.last_cycle.saturating_sub(reading_cycle).min(LATE_READING_CYCLES) as f64 * self.period_s
    }

    /// From a sample to the instant at which the command that answers it is reached, s.
    fn lead_s(&self) -> f64 {
        self.config.lead_cycles * self.period_s
    }

    fn is_moving(&self) -> bool {
        matches!(self.state, ControllerState::Easing | ControllerState::Running | ControllerState::Holding)
    }

    /// The most urgent trigger.
    fn trigger(&self, faulty: bool) -> Option<Trigger> {
        let enabled = DriveState::OperationEnabled.code();
        let held_s = self.cycles_at_rest as f64 * self.period_s;
        let progress = match self.state {
            ControllerState::WaitReadings => {
                (self.steady_readings >= self.config.steady_readings).then_some(Trigger::Steady)
            }
            ControllerState::Enabling => {
                self.drive_state.iter().all(|&code| code == enabled).then_some(Trigger::Enabled)
            }
            ControllerState::Easing => self.playback.is_over().then_some(Trigger::Eased),
            ControllerState::Running => self.playback.is_over().then_some(Trigger::Played),
            ControllerState::Holding => (held_s >= self.config.hold_s).then_some(Trigger::Rested),
            ControllerState::Disabling => self.drives_are_off().then_some(Trigger::Released),
            ControllerState::Finished | ControllerState::SafeStop => None,
        };
        let stop = self.stop_requested.then_some(Trigger::StopRequested);
        let stop = stop.filter(|&stop| next(self.state, stop) != self.state);
        faulty.then_some(Trigger::Fault).or(stop).or(progress)
    }

    /// Enters the state that follows, and reports it.
    fn follow(&mut self, trigger: Trigger, fault: Option<Fault>, tick: Tick) -> Option<Event> {
        let (from, to) = (self.state, next(self.state, trigger));
        if from == to {
            return None;
        }
        self.enter(to);
        Some(transition::event([from, to], trigger, fault, tick))
    }

    fn enter(&mut self, state: ControllerState) {
        match state {
            ControllerState::Enabling => {
                if let Some(estimate) = &self.estimate {
                    self.target = Some(estimate.measured);
                    self.playback.hold(estimate.solution.pose);
                }
            }
            ControllerState::Easing => self.playback.ease(),
            ControllerState::Running => self.playback.play(),
            ControllerState::Holding => self.playback.stop(),
            ControllerState::SafeStop => self.target = self.estimate.map(|estimate| estimate.measured),
            _ => {}
        }
        (self.state, self.cycles_in_state, self.cycles_at_rest) = (state, 0, 0);
    }
}

impl Controller for MotionController {
    fn observe(&mut self, reading: Option<&Reading>) {
        self.silent_cycles += 1;
        let Some(reading) = reading else {
            self.steady_readings = 0;
            return;
        };
        if let Err(fault) = self.take(reading) {
            self.steady_readings = 0;
            self.fault.get_or_insert(fault);
        }
    }

    fn decide(&mut self, tick: Tick) -> Option<Event> {
        self.last_cycle = tick.cycle;
        // A motion that waited goes on at full speed from the target that the drives held: a period's worth, as ever.
        if self.acknowledgement.takes_step(tick.cycle) {
            self.playback.advance(self.period_s);
        }
        let fault = self.fault.take().or_else(|| self.overdue()).or_else(|| self.control().err());
        let trigger = self.trigger(fault.is_some());
        let event = trigger.and_then(|trigger| self.follow(trigger, fault, tick));
        self.cycles_in_state += 1;
        self.cycles_at_rest = if self.playback.is_at_rest() { self.cycles_at_rest + 1 } else { 0 };
        event
    }

    fn fill_command(&self, command: &mut Command) {
        *command = self.command();
    }

    fn fill_state(&self, state: &mut State) {
        *state = self.state_message();
    }

    fn request_stop(&mut self) {
        self.stop_requested = true;
    }

    fn outcome(&self) -> Option<Outcome> {
        let is_repeated = self.cycles_in_state >= REPEATED_CYCLES;
        match self.state {
            ControllerState::Finished => is_repeated.then_some(Outcome::Finished),
            ControllerState::SafeStop => {
                let waited_s = self.cycles_in_state as f64 * self.period_s;
                let is_over = (is_repeated && self.drives_are_off()) || waited_s >= SAFE_STOP_S;
                is_over.then_some(Outcome::SafeStop)
            }
            _ => None,
        }
    }

    fn warm_up(&self) {
        if let Some(estimate) = &self.estimate {
            let solution = self.tracker.clone().update(&estimate.measured);
            let ahead = self.playback.pose_ahead(self.lead_s());
            let joints = self.mechanism.inverse(&self.control.correct(&ahead));
            let _ = black_box((solution, joints));
        }
    }
}

#[cfg(test)]
mod tests;
