//! The smallest controller: switches the drives on, holds the position found at the start, and switches them off.
//!
//! No trajectory, no feedback in pose space, no inverse kinematics: a second, minimal
//! implementation of [`Controller`].

use masseter_shared::config::Scenario;
use masseter_shared::control::{Controller, Outcome, Tick};
use masseter_shared::geometry::{AXES, Actuators, Mechanism, Pose};
use masseter_shared::messages::codes::{Cause, ControllerState, DriveState, drive_state};
use masseter_shared::messages::{Command, Event, Reading, State, pose_fields};

use crate::kinematics::{ForwardTracker, Solution};
use crate::safety::{self, Fault};
use crate::sequence::{Trigger, next, request};
use crate::transition;

/// Bits of [`Reading::fresh_axes`] when all axes are fresh.
const ALL_AXES: u32 = (1 << AXES) - 1;
/// Cycles for which the last command is repeated, so that the drives receive it.
const REPEATED_CYCLES: u64 = 5;

/// Holds the position found at the start.
#[derive(Debug, Clone)]
pub struct HoldPosition {
    tracker: ForwardTracker,
    hold_cycles: u64,
    timeout_cycles: u64,
    stale_cycles: u64,
    state: ControllerState,
    cycles_in_state: u64,
    cycle: u64,
    silent_cycles: u64,
    stop_requested: bool,
    fault: Option<Fault>,
    reading: Reading,
    solution: Option<Solution>,
    /// Targets and their pose, from the last reading before the drives are switched on.
    held: Option<(Actuators, Pose)>,
}

impl HoldPosition {
    /// A controller that holds the position for `hold_s` seconds.
    pub fn new(scenario: &Scenario, mechanism: Mechanism, hold_s: f64) -> Self {
        let cycles = |duration_s: f64| (duration_s / scenario.period_s()).ceil() as u64;
        Self {
            tracker: ForwardTracker::new(mechanism),
            hold_cycles: cycles(hold_s),
            timeout_cycles: cycles(scenario.controller.start_timeout_s),
            stale_cycles: scenario.controller.stale_cycles.into(),
            state: ControllerState::WaitReadings,
            cycles_in_state: 0,
            cycle: 0,
            silent_cycles: 0,
            stop_requested: false,
            fault: None,
            reading: Reading::default(),
            solution: None,
            held: None,
        }
    }

    fn take(&mut self, reading: &Reading) -> Result<(), Fault> {
        safety::check_reading(reading)?;
        safety::check_commander(reading, self.cycle)?;
        safety::check_drives(reading, self.state == ControllerState::Running)?;
        self.reading = *reading;
        if reading.fresh_axes == ALL_AXES {
            let measured = Actuators::from_axes(reading.position_m);
            let solution = self.tracker.update(&measured).map_err(|error| Fault::from(&error))?;
            self.solution = Some(solution);
            self.silent_cycles = 0;
        }
        Ok(())
    }

    fn timeout(&self) -> Option<Fault> {
        let over = |cause, cycles: u64, limit: u64| {
            (cycles > limit).then(|| Fault::new(cause, cycles as f64, limit as f64))
        };
        match self.state {
            ControllerState::Finished | ControllerState::SafeStop => None,
            ControllerState::Running => over(Cause::StaleReading, self.silent_cycles, self.stale_cycles),
            _ => over(Cause::EnableTimeout, self.cycles_in_state, self.timeout_cycles),
        }
    }

    fn trigger(&self) -> Option<Trigger> {
        let all = |holds: fn(DriveState) -> bool| {
            self.reading
                .drive_state
                .iter()
                .all(|&code| matches!(drive_state(code), Ok(Some(state)) if holds(state)))
        };
        let is_over = self.stop_requested || self.cycles_in_state >= self.hold_cycles;
        match self.state {
            ControllerState::WaitReadings | ControllerState::Enabling if self.stop_requested => {
                Some(Trigger::StopRequested)
            }
            ControllerState::WaitReadings => self.solution.map(|_| Trigger::Steady),
            ControllerState::Enabling => {
                all(|state| state == DriveState::OperationEnabled).then_some(Trigger::Enabled)
            }
            // Nothing has to be eased to, and a motion at rest need not be held any longer.
            ControllerState::Easing => Some(Trigger::Eased),
            ControllerState::Running => is_over.then_some(Trigger::Played),
            ControllerState::Holding => Some(Trigger::Rested),
            ControllerState::Disabling => all(|state| !state.is_powered()).then_some(Trigger::Released),
            ControllerState::Finished | ControllerState::SafeStop => None,
        }
    }
}

impl Controller for HoldPosition {
    fn observe(&mut self, reading: Option<&Reading>) {
        self.silent_cycles += 1;
        if let Some(Err(fault)) = reading.map(|reading| self.take(reading)) {
            self.fault.get_or_insert(fault);
        }
    }

    fn decide(&mut self, tick: Tick) -> Option<Event> {
        self.cycle = tick.cycle;
        self.cycles_in_state += 1;
        let fault = self.fault.take().or_else(|| self.timeout());
        let trigger = if fault.is_some() { Trigger::Fault } else { self.trigger()? };
        let (from, to) = (self.state, next(self.state, trigger));
        if from == to {
            return None;
        }
        (self.state, self.cycles_in_state) = (to, 0);
        if to == ControllerState::Enabling {
            let measured = Actuators::from_axes(self.reading.position_m);
            self.held = self.solution.map(|solution| (measured, solution.pose));
        }
        Some(transition::event([from, to], trigger, fault, tick))
    }

    fn fill_command(&self, command: &mut Command) {
        *command = Command {
            cycle: self.cycle,
            reading_cycle: self.reading.cycle,
            target_m: self.held.map_or([0.0; AXES], |(targets, _)| targets.to_axes()),
            request: request(self.state).code(),
            controller_state: self.state.code(),
            ..Command::default()
        };
    }

    fn fill_state(&self, state: &mut State) {
        *state = State {
            cycle: self.cycle,
            reading_cycle: self.reading.cycle,
            sampled_ns: self.reading.sampled_ns,
            controller_state: self.state.code(),
            ..State::default()
        };
        if let Some((_, pose)) = &self.held {
            (state.desired_position_m, state.desired_quaternion_wxyz) = pose_fields(pose);
        }
        if let Some(solution) = &self.solution {
            (state.estimated_position_m, state.estimated_quaternion_wxyz) = pose_fields(&solution.pose);
            state.leg_angle_rad = solution.theta_rad;
            (state.residual_m, state.iterations) = (solution.residual_m, solution.iterations);
        }
    }

    fn request_stop(&mut self) {
        self.stop_requested = true;
    }

    fn outcome(&self) -> Option<Outcome> {
        let is_repeated = self.cycles_in_state >= REPEATED_CYCLES;
        match self.state {
            ControllerState::Finished => is_repeated.then_some(Outcome::Finished),
            ControllerState::SafeStop => {
                (self.cycles_in_state >= self.timeout_cycles.min(300)).then_some(Outcome::SafeStop)
            }
            _ => None,
        }
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
            // Encoder noise moves no target.
            bench.reading.position_m[3] = found[3] + 1e-6;
            if bench.command.request == DriveRequest::Enable.code() {
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
            (0..=bench.controller.stale_cycles).for_each(|_| disturb(&mut bench));
            assert_eq!(bench.controller.state, ControllerState::SafeStop);
            assert_eq!(bench.command.request, DriveRequest::QuickStop.code());
        }
    }
}
