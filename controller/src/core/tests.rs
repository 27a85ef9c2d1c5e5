//! Scenarios of the controller alone: a plant that does what it is told, and one thing that goes wrong.

use masseter_shared::config::{ControllerConfig, JawConfig};
use masseter_shared::geometry::{LEGS, MechanismConfig};
use masseter_shared::messages::codes::{DriveRequest, EventKind};
use masseter_shared::messages::{Command, State, explain};

use super::*;

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

/// A plant that stands two cycles later where it was told to, and does what was requested at once.
struct Bench {
    controller: Controller,
    cycle: u64,
    commands: [Command; 2],
    events: Vec<Event>,
    /// The largest step of any axis from one target that the drives took to the next, m.
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
            controller: Controller::new(scenario, mechanism(), trajectory(scenario)),
            cycle: 0,
            commands: [start; 2],
            events: Vec::new(),
            largest_step_m: 0.0,
        }
    }

    fn reading(&self) -> Reading {
        let [told, last] = self.commands;
        let state = match DriveRequest::try_from(last.request).unwrap() {
            DriveRequest::Enable => DriveCondition::OperationEnabled,
            DriveRequest::Off | DriveRequest::QuickStop => DriveCondition::SwitchOnDisabled,
        };
        Reading {
            cycle: self.cycle + 1,
            answers_cycle: last.cycle,
            position_m: told.target_m,
            drive_state: [state.code(); AXES],
            fresh_axes: ALL_AXES,
            ..Reading::default()
        }
    }

    /// A cycle with the reading that `disturb` makes of the good one.
    fn cycle(&mut self, disturb: impl FnOnce(Reading) -> Option<Reading>) {
        let reading = disturb(self.reading());
        let command = self.controller_cycle(reading.as_ref());
        self.take(command);
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

    fn take(&mut self, mut command: Command) {
        let last = self.commands[1];
        if command.request == DriveRequest::Off.code() {
            command.target_m = last.target_m;
        }
        let steps_m = command.target_m.iter().zip(last.target_m).map(|(to_m, from_m)| (to_m - from_m).abs());
        self.largest_step_m = steps_m.fold(self.largest_step_m, f64::max);
        self.commands = [last, command];
    }

    /// Cycles that the controller misses: the drives reach their last target and hold it.
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

    /// Plays the motion with something happening in its midst.
    fn played(happening: impl FnOnce(&mut Self)) -> Self {
        let mut bench = Self::new();
        bench.run_until(ControllerState::Running);
        (0..730).for_each(|_| bench.cycle(Some));
        happening(&mut bench);
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
    assert!(!bench.controller.is_done(), "the last command must be repeated before the process ends");
    for _ in 0..FAREWELL_CYCLES {
        bench.cycle(Some);
    }
    assert!(bench.controller.is_done());
}

#[test]
fn what_is_wanted_at_a_sample_is_found_there() {
    let mut bench = Bench::new();
    bench.run_until(ControllerState::Running);
    let mut state = State::default();
    let mut worst_m: f64 = 0.0;
    for _ in 0..1000 {
        bench.cycle(Some);
        bench.controller.fill_state(&mut state);
        let wanted = nalgebra::Vector3::from(state.desired_position_m);
        worst_m = worst_m.max((wanted - nalgebra::Vector3::from(state.estimated_position_m)).norm());
    }
    // The plant is exact, so what is left is the trim's own doing.
    assert!(worst_m < 2e-5, "{worst_m}");
}

/// As after its drives were off: the encoders may count the end of the stroke as outside, or it was pushed there.
#[test]
fn a_rig_that_stands_a_little_outside_its_strokes_is_eased_back_into_them() {
    let lowest_m = MechanismConfig::default().strokes.leg_m[0];
    let start_m = [lowest_m - 1e-6, lowest_m, lowest_m - 0.5e-3];
    let mut bench = Bench::standing_at(start_m);
    bench.run_until(ControllerState::Easing);
    while bench.controller.state() == ControllerState::Easing {
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
    let mut bench = Bench::of(&Scenario { jaw, ..short() }, [0.29; LEGS]);
    bench.run_until(ControllerState::Running);
    while bench.controller.state() != ControllerState::Finished {
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
fn a_stop_for_want_of_a_pose_says_why_there_is_none() {
    let cases = [
        ([0.03, -0.03, 0.0, 0.3, 0.24, 0.24], "cannot be assembled"),
        ([0.0, 0.0, 0.0, 0.29, 0.0, 0.29], "axis l2: the leg has no length"),
    ];
    for (position_m, reason) in cases {
        let mut bench = Bench::new();
        bench.run_until(ControllerState::Running);
        bench.cycle(|reading| Some(Reading { position_m, ..reading }));
        let said = explain(bench.events.last().unwrap()).unwrap_or_default();
        assert!(said.contains(reason) && said.contains("[mechanism]"), "{said}");
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

/// Every disturbance while the motion plays, and the cause it must be reported with.
#[test]
fn whatever_goes_wrong_while_moving_ends_in_a_safe_stop_with_its_cause() {
    type Disturbance = fn(Reading) -> Option<Reading>;
    let cases: [(Cause, Disturbance); 9] = [
        (Cause::StaleReading, |_| None),
        (Cause::StaleReading, |reading| Some(Reading { fresh_axes: ALL_AXES - 1, ..reading })),
        (Cause::DriveFault, |mut reading| {
            reading.drive_state[2] = DriveCondition::Fault.code();
            Some(reading)
        }),
        (Cause::DriveFault, |mut reading| {
            reading.drive_state[4] = DriveCondition::SwitchOnDisabled.code();
            Some(reading)
        }),
        (Cause::MasterFault, |reading| Some(Reading { master_fault: 1, ..reading })),
        (Cause::BadMessage, |mut reading| {
            reading.position_m[0] = f64::NAN;
            Some(reading)
        }),
        (Cause::ForeignCommand, |reading| Some(Reading { answers_cycle: u64::MAX, ..reading })),
        (Cause::ForwardKinematics, |mut reading| {
            reading.position_m = [0.03, -0.03, 0.0, 0.3, 0.24, 0.24];
            Some(reading)
        }),
        (Cause::TrackingLost, |mut reading| {
            reading.position_m[LEGS..].iter_mut().for_each(|leg_m| *leg_m -= 0.006);
            Some(reading)
        }),
    ];
    for (cause, disturb) in cases {
        let mut bench = Bench::new();
        bench.run_until(ControllerState::Running);
        for _ in 0..200 {
            bench.cycle(Some);
        }
        let limit = u64::from(ControllerConfig::default().stale_cycles) + 1;
        for _ in 0..limit {
            bench.cycle(disturb);
        }
        assert_eq!(bench.controller.state(), ControllerState::SafeStop, "{cause}");
        assert_eq!(bench.last_cause(), cause);
        let mut command = Command::default();
        bench.controller.fill_command(&mut command);
        assert_eq!(command.request, DriveRequest::QuickStop.code());
        for _ in 0..100 {
            bench.cycle(Some);
        }
        assert_eq!(bench.controller.state(), ControllerState::SafeStop, "{cause}: it moved again");
    }
}

#[test]
fn a_bad_reading_is_reported_with_its_bad_value() {
    type Spoil = fn(&mut Reading);
    let cases: [(Spoil, u32, f64); 3] = [
        (|reading| reading.position_m[1] = f64::NEG_INFINITY, 1, f64::NEG_INFINITY),
        (|reading| reading.force_n[5] = f64::INFINITY, 5, f64::INFINITY),
        (|reading| reading.drive_state[3] = 99, 3, 99.0),
    ];
    for (spoil, axis, value) in cases {
        let mut bench = Bench::new();
        bench.run_until(ControllerState::Running);
        bench.cycle(|mut reading| {
            spoil(&mut reading);
            Some(reading)
        });
        assert_eq!(bench.last_cause(), Cause::BadMessage);
        let told = bench.events.last().unwrap();
        assert_eq!((told.axis, told.value.to_bits()), (axis, value.to_bits()), "{}", told.value);
    }
}

/// Its quick stop may still be under way, and the command must go on asking for it.
#[test]
fn a_safe_stop_waits_for_a_lost_drive_until_its_time_is_over() {
    let mut bench = Bench::new();
    bench.run_until(ControllerState::Running);
    let lose = |mut reading: Reading| {
        reading.drive_state[3] = DriveCondition::Unknown.code();
        Some(reading)
    };
    let waits = (SAFE_STOP_S / bench.controller.period_s) as u64;
    for _ in 1..waits {
        bench.cycle(lose);
        assert_eq!(bench.controller.state(), ControllerState::SafeStop);
        assert!(!bench.controller.is_done());
    }
    bench.cycle(lose);
    assert!(bench.controller.is_done());
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

#[test]
fn drives_that_never_get_ready_are_not_waited_for_forever() {
    let mut bench = Bench::new();
    for _ in 0..20_000 {
        bench.cycle(|mut reading| {
            reading.drive_state = [DriveCondition::ReadyToSwitchOn.code(); AXES];
            Some(reading)
        });
    }
    assert_eq!(bench.controller.state(), ControllerState::SafeStop);
    assert_eq!(bench.last_cause(), Cause::EnableTimeout);
}

/// All that a cycle computes is computed on the copy, the next targets among it.
#[test]
fn a_rehearsal_decides_the_cycle_to_come() {
    let mut bench = Bench::new();
    bench.run_until(ControllerState::Running);
    (0..300).for_each(|_| bench.cycle(Some));
    let rehearsed = bench.controller.rehearsal();
    bench.cycle(Some);
    let command = |controller: &Controller| {
        let mut command = Command::default();
        controller.fill_command(&mut command);
        command
    };
    let (rehearsed, played) = (command(&rehearsed), command(&bench.controller));
    assert_eq!((rehearsed.cycle, rehearsed.request), (played.cycle, played.request));
    for (rehearsed_m, played_m) in rehearsed.target_m.iter().zip(played.target_m) {
        assert!((rehearsed_m - played_m).abs() < 1e-6, "{rehearsed_m} {played_m}");
    }
}
