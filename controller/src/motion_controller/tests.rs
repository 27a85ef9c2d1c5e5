//! Scenarios of the controller alone: an obedient plant, and one disturbance.

use masseter_model::geometry::{AXES, Actuators, Conditioning, Jacobian, LEGS, MechanismConfig};
use masseter_runtime::messages::codes::{Cause, DriveRequest, DriveState, EventKind, NO_DRIVE_STATE};
use masseter_scenario::{ControllerConfig, JawConfig};

use super::*;
use crate::sequencer::{ALL_AXES, REPEATED_CYCLES, SAFE_STOP_S};

mod changes;
mod faults;
mod laws;
mod limits;
mod stalls;

const PERIOD_NS: u64 = 1_000_000;

fn short() -> Scenario {
    Scenario { duration_s: Some(1.5), ..Scenario::default() }
}

fn mechanism() -> Mechanism {
    Mechanism::new(&MechanismConfig::default()).unwrap()
}

fn trajectory(scenario: &Scenario) -> Trajectory {
    Trajectory::new(&scenario.motion, &scenario.jaw, &mechanism(), scenario.duration_s).unwrap()
}

/// A plant that reaches its targets two cycles later, and obeys requests at once.
struct Bench {
    controller: MotionController,
    cycle: u64,
    commands: [Command; 2],
    events: Vec<Event>,
    /// The largest step of any axis between two targets of the drives, m.
    largest_step_m: f64,
}

impl Bench {
    fn new() -> Self {
        Self::standing_at([0.29; LEGS])
    }

    fn standing_at(leg_m: [f64; LEGS]) -> Self {
        Self::of(&short(), leg_m)
    }

    fn of(scenario: &Scenario, leg_m: [f64; LEGS]) -> Self {
        let at_start = Actuators { slide_m: [0.0; LEGS], leg_m };
        let start = Command { target_m: at_start.to_axes(), ..Command::default() };
        Self {
            controller: MotionController::new(scenario, mechanism(), trajectory(scenario)),
            cycle: 0,
            commands: [start; 2],
            events: Vec::new(),
            largest_step_m: 0.0,
        }
    }

    fn reading(&self) -> Reading {
        let [told, last] = self.commands;
        let state = match DriveRequest::try_from(last.request).unwrap() {
            DriveRequest::Enable => DriveState::OperationEnabled,
            DriveRequest::Off | DriveRequest::QuickStop => DriveState::SwitchOnDisabled,
        };
        Reading {
            cycle: self.cycle + 1,
            answers_cycle: last.cycle,
            sampled_ns: (self.cycle + 1) * PERIOD_NS,
            position_m: told.target_m,
            drive_state: [state.code(); AXES],
            fresh_axes: ALL_AXES,
            ..Reading::default()
        }
    }

    /// A cycle with a good reading changed by `disturb`.
    fn cycle(&mut self, disturb: impl FnOnce(Reading) -> Option<Reading>) {
        let reading = disturb(self.reading());
        let command = self.controller_cycle(reading.as_ref());
        self.drives_take(command);
    }

    fn controller_cycle(&mut self, reading: Option<&Reading>) -> Command {
        self.cycle += 1;
        self.controller.observe(reading);
        let tick = Tick { cycle: self.cycle, now_ns: self.cycle * PERIOD_NS };
        self.events.extend(self.controller.decide(tick));
        let mut command = Command::default();
        self.controller.fill_command(&mut command);
        command
    }

    fn drives_take(&mut self, mut command: Command) {
        let last = self.commands[1];
        if command.request == DriveRequest::Off.code() {
            command.target_m = last.target_m;
        }
        let steps_m = command.target_m.iter().zip(last.target_m).map(|(to_m, from_m)| (to_m - from_m).abs());
        self.largest_step_m = steps_m.fold(self.largest_step_m, f64::max);
        self.commands = [last, command];
    }

    /// Cycles that the controller misses: the drives reach and hold their last target.
    fn controller_stalls(&mut self, cycles: u64) {
        self.cycle += cycles;
        self.commands[0] = self.commands[1];
    }

    /// Cycles without SYNC: the controller gets no reading, and nobody takes its commands.
    fn plant_stalls(&mut self, cycles: u64) {
        for _ in 0..cycles {
            self.controller_cycle(None);
        }
    }

    /// Plays the motion, and calls `trigger` halfway.
    fn played(trigger: impl FnOnce(&mut Self)) -> Self {
        let mut bench = Self::new();
        bench.run_until(ControllerState::Running);
        (0..730).for_each(|_| bench.cycle(Some));
        trigger(&mut bench);
        bench.run_until(ControllerState::Finished);
        bench
    }

    fn run_until(&mut self, state: ControllerState) {
        for _ in 0..20_000 {
            if self.controller.state() == state {
                return;
            }
            self.cycle(Some);
        }
        panic!("{state} was not reached, but {}", self.controller.state());
    }

    fn states(&self) -> Vec<ControllerState> {
        self.events.iter().map(|event| ControllerState::try_from(event.to).unwrap()).collect()
    }

    fn last_cause(&self) -> Cause {
        Cause::try_from(self.events.last().unwrap().cause).unwrap()
    }
}

#[test]
fn a_run_goes_through_its_states_in_order_and_ends_with_the_drives_off() {
    let mut bench = Bench::new();
    bench.run_until(ControllerState::Finished);
    assert_eq!(
        bench.states(),
        [
            ControllerState::Enabling,
            ControllerState::Easing,
            ControllerState::Running,
            ControllerState::Holding,
            ControllerState::Disabling,
            ControllerState::Finished,
        ]
    );
    assert!(bench.events.iter().all(|event| event.kind == EventKind::Transition.code()));
    assert!(
        bench.controller.outcome().is_none(),
        "the last command must be repeated before the process ends"
    );
    for _ in 0..REPEATED_CYCLES {
        bench.cycle(Some);
    }
    assert!(bench.controller.outcome().is_some());
}

#[test]
fn the_estimated_pose_at_a_sample_is_the_desired_pose() {
    let mut bench = Bench::new();
    bench.run_until(ControllerState::Running);
    let mut state = State::default();
    let mut worst_m: f64 = 0.0;
    for _ in 0..1000 {
        bench.cycle(Some);
        bench.controller.fill_state(&mut state);
        let desired = nalgebra::Vector3::from(state.desired_position_m);
        worst_m = worst_m.max((desired - nalgebra::Vector3::from(state.estimated_position_m)).norm());
    }
    // The plant is exact, so only the trim's correction remains.
    assert!(worst_m < 2e-5, "{worst_m}");
}

#[test]
fn a_condition_number_is_computed_every_ten_cycles_and_held_in_between() {
    let mut bench = Bench::new();
    let mut state = State::default();
    bench.controller.fill_state(&mut state);
    assert_eq!(state.condition.to_bits(), 0, "without an estimate");
    bench.run_until(ControllerState::Running);
    // Away from the closed pose, where the jaw rests.
    (0..100).for_each(|_| bench.cycle(Some));
    let mut changes = Vec::new();
    for _ in 0..40 {
        let before = state.condition;
        bench.cycle(Some);
        bench.controller.fill_state(&mut state);
        if state.condition.to_bits() != before.to_bits() {
            changes.push(bench.controller.sequencer.cycle);
            let estimate = bench.controller.sequencer.estimate.unwrap();
            let mechanism = &bench.controller.targets.mechanism;
            let legs = mechanism.legs(&estimate.solution.pose).unwrap();
            let here = Conditioning::new(&Jacobian::of_legs(mechanism, &legs)).number();
            assert!((state.condition - here).abs() < 1e-9, "{} {here}", state.condition);
        }
    }
    assert!(changes.len() >= 4 && changes.windows(2).all(|pair| pair[1] - pair[0] == 10), "{changes:?}");
}

/// As after drives without power: the encoders may count the end of the stroke as outside, or a push has moved the axis
/// there.
#[test]
fn axes_slightly_outside_their_strokes_are_eased_back() {
    let lowest_m = MechanismConfig::default().strokes.leg_m[0];
    let start_m = [lowest_m - 1e-6, lowest_m, lowest_m - 0.5e-3];
    let mut bench = Bench::standing_at(start_m);
    bench.run_until(ControllerState::Easing);
    while bench.controller.state() == ControllerState::Easing {
        assert!(bench.cycle < 20_000);
        bench.cycle(Some);
        let target_m = &bench.commands[1].target_m[LEGS..];
        assert!(target_m.iter().zip(start_m).all(|(to_m, from_m)| *to_m >= from_m.min(lowest_m)));
    }
    assert_eq!(bench.controller.state(), ControllerState::Running);
    assert!(bench.largest_step_m < 1.2e-4, "{}", bench.largest_step_m);
}

/// The whole shift and the whole turn together, at the end of the legs' strokes.
#[test]
fn what_the_trim_carries_beyond_a_stroke_is_held_at_its_end() {
    let [_, highest_m] = MechanismConfig::default().strokes.leg_m;
    let jaw = JawConfig { closed_leg_m: highest_m, ..JawConfig::default() };
    let controller = ControllerConfig {
        tracking_limit_m: 1.0,
        tracking_limit_rad: 1.0,
        tracking_rms_limit_m: 1.0,
        tracking_rms_limit_rad: 1.0,
        ..ControllerConfig::default()
    };
    let mut bench = Bench::of(&Scenario { jaw, controller, ..short() }, [0.29; LEGS]);
    bench.run_until(ControllerState::Running);
    while bench.controller.state() != ControllerState::Finished {
        assert!(bench.cycle < 20_000);
        bench.cycle(|mut reading| {
            let lacking_m = [2.5e-3, 0.5e-3, 0.5e-3];
            reading.position_m[LEGS..].iter_mut().zip(lacking_m).for_each(|(leg_m, by_m)| *leg_m -= by_m);
            Some(reading)
        });
        assert_ne!(bench.controller.state(), ControllerState::SafeStop, "{:?}", bench.events.last());
        assert!(bench.commands[1].target_m[LEGS..].iter().all(|&leg_m| leg_m <= highest_m));
    }
}

#[test]
fn an_interrupted_motion_slows_down_on_its_path_and_ends_in_order() {
    let mut bench = Bench::new();
    bench.run_until(ControllerState::Running);
    for _ in 0..700 {
        bench.cycle(Some);
    }
    bench.controller.request_stop();
    bench.run_until(ControllerState::Finished);
    assert_eq!(bench.last_cause(), Cause::Sequence);
    let entered =
        |state: ControllerState| bench.events.iter().find(|event| event.to == state.code()).unwrap();
    let (holding, disabling) = (entered(ControllerState::Holding), entered(ControllerState::Disabling));
    assert_eq!(holding.cause, Cause::StopRequested.code());
    let ControllerConfig { stop_ramp_s, hold_s, .. } = ControllerConfig::default();
    let took_s = (disabling.time_ns - holding.time_ns) as f64 * 1e-9;
    assert!(took_s >= stop_ramp_s + hold_s, "the last pose is held once it stands still: {took_s} s");
}

/// One missing among every ten is never ten in a row.
#[test]
fn the_drives_are_switched_on_only_after_complete_readings_in_a_row() {
    type Disturbance = fn(Reading) -> Option<Reading>;
    let gaps: [Disturbance; 2] = [|_| None, |reading| Some(Reading { fresh_axes: ALL_AXES - 1, ..reading })];
    for gap in gaps {
        let mut bench = Bench::new();
        for cycle in 1..=100 {
            bench.cycle(if cycle % 10 == 0 { gap } else { Some });
        }
        assert_eq!(bench.controller.state(), ControllerState::WaitReadings);
        (0..10).for_each(|_| bench.cycle(Some));
        assert_eq!(bench.controller.state(), ControllerState::Enabling);
    }
}
