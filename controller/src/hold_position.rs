//! The smallest controller: switches the drives on, holds the position found at the start, and switches them off.
//!
//! No trajectory, no feedback in pose space, no inverse kinematics: a second, minimal
//! implementation of [`Controller`].

use masseter_model::geometry::Mechanism;
use masseter_runtime::control::{Controller, NoBranch, Outcome, Tick};
use masseter_runtime::messages::codes::ControllerState;
use masseter_runtime::messages::{Command, Event, Reading, State};
use masseter_runtime::named::{Declared, PlayedMotion};
use masseter_scenario::Scenario;

use crate::sequencer::{Estimate, Sequencer};

/// Holds the position found at the start.
///
/// ```
/// use masseter_controller::hold_position::HoldPosition;
/// use masseter_scenario::Scenario;
/// use masseter_runtime::control::{Controller, Tick};
/// use masseter_model::geometry::{Mechanism, MechanismConfig};
/// use masseter_runtime::messages::Command;
/// use masseter_runtime::messages::codes::DriveRequest;
///
/// let mut controller = HoldPosition::new(&Scenario::default(), Mechanism::new(&MechanismConfig::default())?, 2.0);
/// controller.observe(None);
/// controller.decide(Tick { cycle: 1, now_ns: 540_000 });
/// let mut command = Command::default();
/// controller.fill_command(&mut command);
/// // Without a reading the drives stay off.
/// assert_eq!((command.cycle, command.request), (1, DriveRequest::Off.code()));
/// # Ok::<_, masseter_model::geometry::GeometryError>(())
/// ```
#[derive(Debug, Clone)]
pub struct HoldPosition {
    sequencer: Sequencer,
    hold_cycles: u64,
    /// The estimate at the switch-on of the drives.
    held: Option<Estimate>,
}

impl HoldPosition {
    /// A controller that holds the position for `hold_s` seconds.
    pub fn new(scenario: &Scenario, mechanism: Mechanism, hold_s: f64) -> Self {
        let hold_cycles = (hold_s / scenario.period_s()).ceil() as u64;
        Self { sequencer: Sequencer::new(scenario, mechanism), hold_cycles, held: None }
    }
}

impl Controller for HoldPosition {
    fn observe(&mut self, reading: Option<&Reading>) {
        self.sequencer.observe(reading);
    }

    fn decide(&mut self, tick: Tick) -> Option<Event> {
        let fault = self.sequencer.begin_cycle(tick);
        // The start needs no easing, and a motion at rest needs no further hold.
        let is_running = self.sequencer.state == ControllerState::Running;
        let is_over = !is_running || self.sequencer.cycles_in_state >= self.hold_cycles;
        let event = self.sequencer.follow(fault, is_over, tick)?;
        if self.sequencer.state == ControllerState::Enabling {
            self.held = self.sequencer.estimate;
        }
        Some(event)
    }

    fn fill_command(&self, command: &mut Command) {
        *command = self.sequencer.command(self.held.map(|held| held.measured));
    }

    fn fill_state(&mut self, state: &mut State) {
        *state = self.sequencer.state_message(self.held.as_ref().map(|held| &held.solution.pose));
    }

    fn request_stop(&mut self) {
        self.sequencer.request_stop();
    }

    fn outcome(&self) -> Option<Outcome> {
        self.sequencer.outcome()
    }

    /// The scenario's motion is not played.
    fn declared(&self) -> Declared {
        Declared { motion: PlayedMotion::Own, ..Declared::default() }
    }

    fn branch(&self) -> Result<Box<dyn Controller>, NoBranch> {
        Ok(Box::new(self.clone()))
    }
}

#[cfg(test)]
mod tests {
    use masseter_model::geometry::AXES;
    use masseter_runtime::messages::codes::{DriveRequest, DriveState};

    use super::*;
    use crate::sequencer::ALL_AXES;

    /// Drives at a fixed position that obey a request at once.
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
            running += u32::from(bench.controller.sequencer.state == ControllerState::Running);
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
            while bench.controller.sequencer.state != ControllerState::Running {
                bench.cycle(true);
            }
            (0..=bench.controller.sequencer.config.stale_cycles).for_each(|_| disturb(&mut bench));
            assert_eq!(bench.controller.sequencer.state, ControllerState::SafeStop);
            assert_eq!(bench.command.request, DriveRequest::QuickStop.code());
        }
    }

    #[test]
    fn silence_stops_safely_in_every_state_with_voltage() {
        for state in [ControllerState::Enabling, ControllerState::Running] {
            let mut bench = Bench::new();
            while bench.controller.sequencer.state != state {
                bench.cycle(true);
            }
            (0..=bench.controller.sequencer.config.stale_cycles).for_each(|_| bench.cycle(false));
            assert_eq!(bench.controller.sequencer.state, ControllerState::SafeStop, "in {state}");
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
        assert_eq!(bench.controller.sequencer.state, ControllerState::WaitReadings);
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
        while bench.controller.sequencer.state != ControllerState::Enabling {
            bench.cycle(true);
        }
        bench.controller.request_stop();
        while bench.controller.outcome().is_none() {
            bench.cycle(true);
        }
        assert_eq!(bench.controller.outcome(), Some(Outcome::Finished));
    }
}
