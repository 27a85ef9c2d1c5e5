//! The common part of the controllers: readings, the sequence of states (a table), time-outs of waits, and the writing
//! of command and state.

use masseter_model::geometry::{AXES, Actuators, Mechanism, Pose};
use masseter_runtime::control::{Outcome, Tick};
use masseter_runtime::messages::codes::{
    Cause, ControllerState, DriveRequest, DriveState, EventKind, NO_DRIVE_STATE, Source, drive_state,
};
use masseter_runtime::messages::{Command, Event, Reading, State, pose_fields};
use masseter_scenario::{ControllerConfig, Scenario};

use crate::kinematics::{ForwardTracker, Solution};
use crate::safety::{self, Fault};
use ControllerState::{Disabling, Easing, Enabling, Finished, Holding, Running, SafeStop, WaitReadings};

/// Bits of [`Reading::fresh_axes`] when all axes are fresh.
pub(crate) const ALL_AXES: u32 = (1 << AXES) - 1;
/// Repetitions of the last command, so that the drives receive it.
pub(crate) const REPEATED_CYCLES: u64 = 5;
/// Longest wait of a safe stop for drives without voltage, s.
pub(crate) const SAFE_STOP_S: f64 = 0.3;

/// Greatest age of a late reading in use.
const LATE_READING_CYCLES: u64 = 1;

/// Triggers of a change of state. In one cycle only the most urgent trigger counts: the last in this order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Trigger {
    /// The condition that ends the state holds.
    Done,
    /// A stop is requested.
    StopRequested,
    /// A fault.
    Fault,
}

/// The state after `trigger` in `state`; the same state without a change.
fn next_state(state: ControllerState, trigger: Trigger) -> ControllerState {
    let [done, stop_requested] = match state {
        WaitReadings => [Enabling, Finished],
        Enabling => [Easing, Disabling],
        Easing => [Running, Holding],
        Running => [Holding, Holding],
        Holding => [Disabling, Holding],
        Disabling => [Finished, Disabling],
        Finished | SafeStop => return state,
    };
    match trigger {
        Trigger::Done => done,
        Trigger::StopRequested => stop_requested,
        Trigger::Fault => SafeStop,
    }
}

/// The request to all drives in that state.
fn requested(state: ControllerState) -> DriveRequest {
    match state {
        WaitReadings | Disabling | Finished => DriveRequest::Off,
        Enabling | Easing | Running | Holding => DriveRequest::Enable,
        SafeStop => DriveRequest::QuickStop,
    }
}

/// A complete reading and the pose of its positions.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Estimate {
    pub(crate) reading_cycle: u64,
    pub(crate) answers_cycle: u64,
    pub(crate) sampled_ns: u64,
    pub(crate) measured: Actuators,
    /// Of the drives, N.
    pub(crate) force_n: [f64; AXES],
    pub(crate) solution: Solution,
}

/// Cycles of a safe stop for the scenario's time of observation: one more than the periods.
fn observed_cycles(scenario: &Scenario) -> u64 {
    let periods = scenario.observation_s() / scenario.period_s();
    // Rounding may give a little more than a whole number of periods.
    if periods > 0.0 { (periods - 1e-6).ceil() as u64 + 1 } else { 0 }
}

/// The state of a controller's sequence, and the data for the next state.
#[derive(Debug, Clone)]
pub(crate) struct Sequencer {
    pub(crate) config: ControllerConfig,
    pub(crate) period_s: f64,
    /// Longest time for enabling the drives, s. The master has more of their state, and gives up first.
    enable_timeout_s: f64,
    /// Least cycles of observation of a safe stop.
    observed_cycles: u64,
    pub(crate) tracker: ForwardTracker,
    pub(crate) state: ControllerState,
    pub(crate) cycles_in_state: u64,
    /// The number of the last cycle.
    pub(crate) cycle: u64,
    /// The cycle of the last reading, complete or not.
    pub(crate) heard_cycle: u64,
    /// Cycles since the last complete reading.
    pub(crate) silent_cycles: u64,
    /// From the last complete reading.
    pub(crate) estimate: Option<Estimate>,
    steady_readings: u32,
    drive_state: [u32; AXES],
    stop_requested: bool,
    /// The first fault since the last decision.
    fault: Option<Fault>,
}

impl Sequencer {
    pub(crate) fn new(scenario: &Scenario, mechanism: Mechanism) -> Self {
        Self {
            config: scenario.controller,
            period_s: scenario.period_s(),
            enable_timeout_s: scenario.controller.start_timeout_s + scenario.can.longest_enabling_s(),
            observed_cycles: observed_cycles(scenario),
            tracker: ForwardTracker::new(mechanism),
            state: WaitReadings,
            cycles_in_state: 0,
            cycle: 0,
            heard_cycle: 0,
            silent_cycles: 0,
            estimate: None,
            steady_readings: 0,
            drive_state: [NO_DRIVE_STATE; AXES],
            stop_requested: false,
            fault: None,
        }
    }

    /// Takes the reading of a cycle, if there is one.
    pub(crate) fn observe(&mut self, reading: Option<&Reading>) {
        self.heard_cycle = reading.map_or(self.heard_cycle, |reading| reading.cycle);
        let taken = reading.map_or(Ok(false), |reading| self.apply_reading(reading));
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

    /// Whether the reading is complete: only a complete reading gives an estimate.
    fn apply_reading(&mut self, reading: &Reading) -> Result<bool, Fault> {
        safety::check_reading(reading)?;
        safety::check_commander(reading, self.cycle)?;
        self.drive_state = reading.drive_state;
        safety::check_drives(reading, self.is_moving())?;
        if reading.fresh_axes != ALL_AXES {
            return Ok(false);
        }
        let Reading { cycle: reading_cycle, answers_cycle, sampled_ns, force_n, .. } = *reading;
        let measured = Actuators::from_axes(reading.position_m);
        let solution = self.tracker.update(&measured).map_err(|error| Fault::from(&error))?;
        self.estimate =
            Some(Estimate { reading_cycle, answers_cycle, sampled_ns, measured, force_n, solution });
        Ok(true)
    }

    pub(crate) fn request_stop(&mut self) {
        self.stop_requested = true;
    }

    /// The estimate of this cycle's reading; none if the reading is missing or incomplete.
    pub(crate) fn fresh_estimate(&self) -> Option<&Estimate> {
        self.estimate.as_ref().filter(|_| self.silent_cycles == 0)
    }

    /// Age of the estimate's sample beyond that of a reading in time, s. The motion waits for readings that are later.
    pub(crate) fn sample_age_s(&self) -> f64 {
        self.sample_age_in(self.cycle)
    }

    /// The same in a given cycle.
    pub(crate) fn sample_age_in(&self, cycle: u64) -> f64 {
        let reading_cycle = self.estimate.map_or(cycle, |estimate| estimate.reading_cycle);
        cycle.saturating_sub(reading_cycle).min(LATE_READING_CYCLES) as f64 * self.period_s
    }

    pub(crate) fn is_moving(&self) -> bool {
        matches!(self.state, Easing | Running | Holding)
    }

    /// Begins the decision of a cycle: returns the fault of its reading, or of an overdue wait.
    pub(crate) fn begin_cycle(&mut self, tick: Tick) -> Option<Fault> {
        self.cycle = tick.cycle;
        self.fault.take().or_else(|| self.overdue())
    }

    fn overdue(&self) -> Option<Fault> {
        let over = |cause, cycles: u64, limit: f64| {
            (cycles as f64 > limit).then(|| Fault::new(cause, cycles as f64, limit))
        };
        let timeout_cycles = self.config.start_timeout_s / self.period_s;
        let enable_cycles = self.enable_timeout_s / self.period_s;
        let silence = || over(Cause::StaleReading, self.silent_cycles, self.config.stale_cycles.into());
        match self.state {
            WaitReadings => over(Cause::StaleReading, self.cycles_in_state, timeout_cycles),
            Enabling => over(Cause::EnableTimeout, self.cycles_in_state, enable_cycles).or_else(silence),
            Disabling => over(Cause::EnableTimeout, self.cycles_in_state, timeout_cycles).or_else(silence),
            Finished | SafeStop => None,
            Easing | Running | Holding => silence(),
        }
    }

    /// Follows the most urgent trigger to the next state, and reports the change. `is_over`: whether the motion or the
    /// hold of this state is over; a state without motion ignores `is_over`.
    pub(crate) fn follow(&mut self, fault: Option<Fault>, is_over: bool, tick: Tick) -> Option<Event> {
        let triggers = [
            (Trigger::Fault, fault.is_some()),
            (Trigger::StopRequested, self.stop_requested),
            (Trigger::Done, self.is_done(is_over)),
        ];
        let moves = triggers.into_iter().filter(|(_, is_active)| *is_active);
        let mut moves = moves.map(|(trigger, _)| (trigger, next_state(self.state, trigger)));
        let followed = moves.find(|(_, to)| *to != self.state);
        self.cycles_in_state += 1;
        let (trigger, to) = followed?;
        let from = std::mem::replace(&mut self.state, to);
        self.cycles_in_state = 1;
        let is_stop = trigger == Trigger::StopRequested;
        let cause = if is_stop { Cause::StopRequested } else { Cause::Sequence };
        let mut event = Event {
            time_ns: tick.now_ns,
            cycle: tick.cycle,
            from: from.code(),
            to: to.code(),
            ..Event::new(Source::Controller, EventKind::Transition, cause)
        };
        if let Some(fault) = fault {
            event.kind = EventKind::Fault.code();
            fault.explain(&mut event);
        }
        Some(event)
    }

    /// Whether the drives are about to be enabled.
    pub(crate) fn has_steady_readings(&self) -> bool {
        self.state == WaitReadings && self.steady_readings >= self.config.steady_readings
    }

    /// Whether the condition that ends the state holds.
    fn is_done(&self, is_over: bool) -> bool {
        let enabled = DriveState::OperationEnabled.code();
        match self.state {
            WaitReadings => self.has_steady_readings(),
            Enabling => self.drive_state.iter().all(|&code| code == enabled),
            Easing | Running | Holding => is_over,
            Disabling => self.drives_are_off(),
            Finished | SafeStop => false,
        }
    }

    /// Whether every drive reports no voltage. A lost drive reports nothing, and may have voltage.
    fn drives_are_off(&self) -> bool {
        let is_off = |&code: &u32| matches!(drive_state(code), Ok(Some(state)) if !state.is_powered());
        self.drive_state.iter().all(is_off)
    }

    /// The controller's outcome; none before its end. A safe stop waits until the drives are off.
    pub(crate) fn outcome(&self) -> Option<Outcome> {
        let is_repeated = self.cycles_in_state >= REPEATED_CYCLES;
        match self.state {
            Finished => is_repeated.then_some(Outcome::Finished),
            SafeStop => {
                let waited_s = self.cycles_in_state as f64 * self.period_s;
                let is_over = (is_repeated && self.drives_are_off()) || waited_s >= SAFE_STOP_S;
                (is_over && self.cycles_in_state >= self.observed_cycles).then_some(Outcome::SafeStop)
            }
            _ => None,
        }
    }

    /// This cycle's command. Before the first target the request is off, so that no drive follows the zeros.
    pub(crate) fn command(&self, target: Option<Actuators>) -> Command {
        Command {
            cycle: self.cycle,
            reading_cycle: self.estimate.map_or(0, |estimate| estimate.reading_cycle),
            target_m: target.map_or([0.0; AXES], Actuators::to_axes),
            request: requested(self.state).code(),
            controller_state: self.state.code(),
            ..Command::default()
        }
    }

    /// The state of this cycle.
    pub(crate) fn state_message(&self, desired: Option<&Pose>) -> State {
        let mut state = State { cycle: self.cycle, controller_state: self.state.code(), ..State::default() };
        if let Some(desired) = desired {
            (state.desired_position_m, state.desired_quaternion_wxyz) = pose_fields(desired);
        }
        if let Some(Estimate { reading_cycle, sampled_ns, solution, .. }) = &self.estimate {
            (state.reading_cycle, state.sampled_ns) = (*reading_cycle, *sampled_ns);
            (state.estimated_position_m, state.estimated_quaternion_wxyz) = pose_fields(&solution.pose);
            state.leg_angle_rad = solution.theta_rad;
            (state.residual_m, state.iterations) = (solution.residual_m, solution.iterations);
        }
        state
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_safe_stop_is_observed_for_the_whole_time_that_a_requirement_asks_for() {
        let cycles = |stays_for: &str, rate_hz| {
            let text = format!("rate_hz = {rate_hz}\n[[require]]\nname = 'r'\nthen = 'true'\n{stays_for}");
            observed_cycles(&Scenario::parse(std::path::Path::new("s.toml"), &text).unwrap())
        };
        assert_eq!(cycles("", 1000), 0);
        assert_eq!(cycles("stays_for = '50 ms'", 1000), 51);
        assert_eq!(cycles("stays_for = '50 ms'", 2000), 101);
        assert_eq!(cycles("stays_for = '9 ms'", 1000), 10, "0.009 s are nine periods");
        assert_eq!(cycles("stays_for = '0.5 ms'", 1000), 2);
    }

    const TRIGGERS: [Trigger; 3] = [Trigger::Done, Trigger::StopRequested, Trigger::Fault];

    /// Every pair that changes the state; all others must leave it.
    const MOVES: [(ControllerState, Trigger, ControllerState); 16] = [
        (WaitReadings, Trigger::Done, Enabling),
        (WaitReadings, Trigger::StopRequested, Finished),
        (WaitReadings, Trigger::Fault, SafeStop),
        (Enabling, Trigger::Done, Easing),
        (Enabling, Trigger::StopRequested, Disabling),
        (Enabling, Trigger::Fault, SafeStop),
        (Easing, Trigger::Done, Running),
        (Easing, Trigger::StopRequested, Holding),
        (Easing, Trigger::Fault, SafeStop),
        (Running, Trigger::Done, Holding),
        (Running, Trigger::StopRequested, Holding),
        (Running, Trigger::Fault, SafeStop),
        (Holding, Trigger::Done, Disabling),
        (Holding, Trigger::Fault, SafeStop),
        (Disabling, Trigger::Done, Finished),
        (Disabling, Trigger::Fault, SafeStop),
    ];

    #[test]
    fn every_pair_moves_as_specified_and_no_other_moves() {
        for state in ControllerState::ALL {
            for trigger in TRIGGERS {
                let specified = MOVES.iter().find(|(from, when, _)| (*from, *when) == (state, trigger));
                let expected = specified.map_or(state, |(_, _, to)| *to);
                assert_eq!(next_state(state, trigger), expected, "{state} on {trigger:?}");
            }
        }
    }

    #[test]
    fn a_safe_stop_is_never_left_and_every_moving_state_reaches_it() {
        for trigger in TRIGGERS {
            assert_eq!(next_state(SafeStop, trigger), SafeStop);
        }
        for state in [WaitReadings, Enabling, Easing, Running, Holding, Disabling] {
            assert_eq!(next_state(state, Trigger::Fault), SafeStop);
        }
    }
}
