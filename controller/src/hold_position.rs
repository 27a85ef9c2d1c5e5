//! The smallest controller: switches the drives on, holds the position found at the start, and switches them off.
//!
//! No trajectory, no feedback in pose space, no inverse kinematics: a second, minimal
//! implementation of [`Controller`].

use masseter_shared::config::{ControllerConfig, Scenario};
use masseter_shared::control::{Controller, Outcome, Tick};
use masseter_shared::geometry::{AXES, Actuators, Mechanism};
use masseter_shared::messages::codes::{ControllerState, DriveState, NO_DRIVE_STATE};
use masseter_shared::messages::{Command, Event, Reading, State, pose_fields};

use crate::kinematics::{ForwardTracker, Solution};
use crate::progress::Progress;
use crate::safety::{self, Fault};
use crate::sequence::{Trigger, next, request};
use crate::transition;

/// Bits of [`Reading::fresh_axes`] when all axes are fresh.
const ALL_AXES: u32 = (1 << AXES) - 1;
/// A complete reading and the pose of its positions.
#[derive(Debug, Clone, Copy)]
struct Estimate {
    reading_cycle: u64,
    sampled_ns: u64,
    measured: Actuators,
    solution: Solution,
}

/// Holds the position found at the start.
#[derive(Debug, Clone)]
pub struct HoldPosition {
    tracker: ForwardTracker,
    config: ControllerConfig,
    period_s: f64,
    hold_cycles: u64,
    state: ControllerState,
    cycles_in_state: u64,
    cycle: u64,
    silent_cycles: u64,
    stop_requested: bool,
    fault: Option<Fault>,
    steady_readings: u32,
    drive_state: [u32; AXES],
    /// The last complete reading and its solution.
    estimate: Option<Estimate>,
    /// The estimate when the drives are switched on.
    held: Option<Estimate>,
}

impl HoldPosition {
    /// A controller that holds the position for `hold_s` seconds.
    pub fn new(scenario: &Scenario, mechanism: Mechanism, hold_s: f64) -> Self {
        let period_s = scenario.period_s();
        Self {
            tracker: ForwardTracker::new(mechanism),
            config: scenario.controller,
            period_s,
            hold_cycles: (hold_s / period_s).ceil() as u64,
            state: ControllerState::WaitReadings,
            cycles_in_state: 0,
            cycle: 0,
            silent_cycles: 0,
            stop_requested: false,
            fault: None,
            steady_readings: 0,
            drive_state: [NO_DRIVE_STATE; AXES],
            estimate: None,
            held: None,
        }
    }

    /// Whether the reading is complete, and so gives an estimate.
    fn take(&mut self, reading: &Reading) -> Result<bool, Fault> {
        safety::check_reading(reading)?;
        safety::check_commander(reading, self.cycle)?;
        self.drive_state = reading.drive_state;
        safety::check_drives(reading, self.state == ControllerState::Running)?;
        if reading.fresh_axes != ALL_AXES {
            return Ok(false);
        }
        let Reading { cycle: reading_cycle, sampled_ns, .. } = *reading;
        let measured = Actuators::from_axes(reading.position_m);
        let solution = self.tracker.update(&measured).map_err(|error| Fault::from(&error))?;
        self.estimate = Some(Estimate { reading_cycle, sampled_ns, measured, solution });
        Ok(true)
    }

    fn progress(&self) -> Progress {
        Progress {
            state: self.state,
            cycles_in_state: self.cycles_in_state,
            silent_cycles: self.silent_cycles,
            drive_state: self.drive_state,
            period_s: self.period_s,
        }
    }

    fn trigger(&self) -> Option<Trigger> {
        let is_over = self.stop_requested || self.cycles_in_state >= self.hold_cycles;
        match self.state {
            ControllerState::WaitReadings | ControllerState::Enabling if self.stop_requested => {
                Some(Trigger::StopRequested)
            }
            ControllerState::WaitReadings => {
                (self.steady_readings >= self.config.steady_readings).then_some(Trigger::Steady)
            }
            ControllerState::Enabling => {
                let enabled = DriveState::OperationEnabled.code();
                self.drive_state.iter().all(|&code| code == enabled).then_some(Trigger::Enabled)
            }
            // Nothing has to be eased to, and a motion at rest need not be held any longer.
            ControllerState::Easing => Some(Trigger::Eased),
            ControllerState::Running => is_over.then_some(Trigger::Played),
            ControllerState::Holding => Some(Trigger::Rested),
            ControllerState::Disabling => self.progress().drives_are_off().then_some(Trigger::Released),
            ControllerState::Finished | ControllerState::SafeStop => None,
        }
    }
}

impl Controller for HoldPosition {
    fn observe(&mut self, reading: Option<&Reading>) {
        let taken = reading.map_or(Ok(false), |reading| self.take(reading));
        if taken == Ok(true) {
            self.silent_cycles = 0;
            self.steady_readings = self.steady_readings.saturating_add(1);
        } else {
            self.silent_cycles += 1;
            self.steady_readings = 0;
        }
        if let Err(fault) = taken {
            self.fault.get_or_insert(fault);
        }
    }

    fn decide(&mut self, tick: Tick) -> Option<Event> {
        self.cycle = tick.cycle;
        self.cycles_in_state += 1;
        let fault = self.fault.take().or_else(|| self.progress().overdue(&self.config));
        let trigger = if fault.is_some() { Trigger::Fault } else { self.trigger()? };
        let (from, to) = (self.state, next(self.state, trigger));
        if from == to {
            return None;
        }
        (self.state, self.cycles_in_state) = (to, 0);
        if to == ControllerState::Enabling {
            self.held = self.estimate;
        }
        Some(transition::event([from, to], trigger, fault, tick))
    }

    fn fill_command(&self, command: &mut Command) {
        *command = Command {
            cycle: self.cycle,
            reading_cycle: self.estimate.map_or(0, |estimate| estimate.reading_cycle),
            target_m: self.held.map_or([0.0; AXES], |held| held.measured.to_axes()),
            request: request(self.state).code(),
            controller_state: self.state.code(),
            ..Command::default()
        };
    }

    fn fill_state(&self, state: &mut State) {
        *state = State { cycle: self.cycle, controller_state: self.state.code(), ..State::default() };
        if let Some(held) = &self.held {
            (state.desired_position_m, state.desired_quaternion_wxyz) = pose_fields(&held.solution.pose);
        }
        if let Some(Estimate { reading_cycle, sampled_ns, solution, .. }) = &self.estimate {
            (state.reading_cycle, state.sampled_ns) = (*reading_cycle, *sampled_ns);
            (state.estimated_position_m, state.estimated_quaternion_wxyz) = pose_fields(&solution.pose);
            state.leg_angle_rad = solution.theta_rad;
            (state.residual_m, state.iterations) = (solution.residual_m, solution.iterations);
        }
    }

    fn request_stop(&mut self) {
        self.stop_requested = true;
    }

    fn outcome(&self) -> Option<Outcome> {
        self.progress().outcome()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use masseter_shared::messages::codes::DriveRequest;

    /// Drives that do at once what they are asked to, at a fixed position.
    struct Bench {
        controller: HoldPosition,
        reading: Reading,
        command: Command,
    }

    impl Bench {
        fn new() -> Self {
            let scenario = Scenario::default();
            let mechanism = Mechanism::new(&scenario.mechanism).unwrap();
            let reading = Reading {
                position_m: [1e-3, -2e-3, 0.0, 0.28, 0.281, 0.279],
                drive_state: [DriveState::SwitchOnDisabled.code(); AXES],
                fresh_axes: ALL_AXES,
                ..Reading::default()
            };
            let controller = HoldPosition::new(&scenario, mechanism, 0.1);
            Self { controller, reading, command: Command::default() }
        }

        fn cycle(&mut self, has_reading: bool) {
            self.reading.cycle += 1;
            self.controller.observe(Some(&self.reading).filter(|_| has_reading));
            self.controller.decide(Tick { cycle: self.reading.cycle, now_ns: 0 });
            self.controller.fill_command(&mut self.command);
            let is_enabled = self.command.request == DriveRequest::Enable.code();
            let state = if is_enabled { DriveState::OperationEnabled } else { DriveState::SwitchOnDisabled };
            self.reading.drive_state = [state.code(); AXES];
            self.reading.answers_cycle = self.command.cycle;
        }
    }

    #[test]
    fn the_position_found_at_the_start_is_held_and_the_drives_are_switched_off() {
        let mut bench = Bench::new();
        let found = bench.reading.position_m;
        let mut running = 0;
        while bench.controller.outcome().is_none() {
            bench.cycle(true);
            if bench.command.request == DriveRequest::Enable.code() {
                // Encoder noise moves no target.
                bench.reading.position_m[3] = found[3] + 1e-6;
                assert_eq!(bench.command.target_m.map(f64::to_bits), found.map(f64::to_bits));
            }
            running += u32::from(bench.controller.state == ControllerState::Running);
        }
        assert_eq!((bench.controller.outcome(), running), (Some(Outcome::Finished), 100));
        assert_eq!(bench.command.request, DriveRequest::Off.code());
    }

    #[test]
    fn silence_and_a_drive_in_fault_stop_safely() {
        let silent = |bench: &mut Bench| bench.cycle(false);
        let faulty = |bench: &mut Bench| {
            bench.reading.drive_state[2] = DriveState::Fault.code();
            bench.cycle(true);
        };
        for disturb in [silent, faulty] {
            let mut bench = Bench::new();
            while bench.controller.state != ControllerState::Running {
                bench.cycle(true);
            }
            (0..=bench.controller.config.stale_cycles).for_each(|_| disturb(&mut bench));
            assert_eq!(bench.controller.state, ControllerState::SafeStop);
            assert_eq!(bench.command.request, DriveRequest::QuickStop.code());
        }
    }

    #[test]
    fn silence_stops_safely_in_every_state_with_voltage() {
        for state in [ControllerState::Enabling, ControllerState::Running] {
            let mut bench = Bench::new();
            while bench.controller.state != state {
                bench.cycle(true);
            }
            (0..=bench.controller.config.stale_cycles).for_each(|_| bench.cycle(false));
            assert_eq!(bench.controller.state, ControllerState::SafeStop, "in {state}");
        }
    }

    #[test]
    fn incomplete_readings_are_no_start_and_give_no_target() {
        let mut bench = Bench::new();
        let complete = bench.reading.position_m;
        bench.cycle(true);
        bench.reading.fresh_axes = 0b01_1111;
        bench.reading.position_m[5] += 1e-3;
        (0..10).for_each(|_| bench.cycle(true));
        assert_eq!(bench.controller.state, ControllerState::WaitReadings);
        bench.reading.fresh_axes = ALL_AXES;
        bench.reading.position_m = complete;
        while bench.command.request != DriveRequest::Enable.code() {
            bench.cycle(true);
        }
        assert_eq!(bench.command.target_m.map(f64::to_bits), complete.map(f64::to_bits));
    }

    #[test]
    fn a_stop_while_the_drives_are_switched_on_switches_them_off() {
        let mut bench = Bench::new();
        while bench.controller.state != ControllerState::Enabling {
            bench.cycle(true);
        }
        bench.controller.request_stop();
        while bench.controller.outcome().is_none() {
            bench.cycle(true);
        }
        assert_eq!(bench.controller.outcome(), Some(Outcome::Finished));
    }
}
