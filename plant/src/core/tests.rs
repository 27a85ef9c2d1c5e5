//! Scenarios of the whole plant under virtual time, with a commander that uses inverse kinematics only.

mod injected_faults;
mod stimuli;
mod wire_faults;

use masseter_can::canopen::{Cob, NodeId};
use masseter_model::geometry::{AXES, Mechanism, MechanismConfig, Pose, Vec3};
use masseter_runtime::messages::codes::{
    Cause, ControllerState, DriveRequest, DriveState, EventKind, NO_AXIS, Source,
};
use masseter_runtime::messages::{LAYOUT_VERSION, tap};

use super::*;

const PERIOD_NS: u64 = 1_000_000;
const EPOCH_NS: u64 = 1_000_000_000;
const ENABLED: [u32; AXES] = [DriveState::OperationEnabled as u32; AXES];

/// Targets and request for a reading.
type Answer<'a> = dyn Fn(&Reading) -> ([f64; AXES], DriveRequest) + 'a;

struct Bench {
    plant: PlantCore,
    mechanism: Mechanism,
    cycle: u64,
    reading: Reading,
    truth: Truth,
    frames: Vec<FrameTap>,
    events: Vec<Event>,
    controller_state: ControllerState,
}

impl Bench {
    fn new(scenario: &Scenario) -> Self {
        Self {
            plant: PlantCore::new(scenario, EPOCH_NS).unwrap(),
            mechanism: Mechanism::new(&MechanismConfig::default()).unwrap(),
            cycle: 0,
            reading: Reading::default(),
            truth: Truth::default(),
            frames: Vec::new(),
            events: Vec::new(),
            controller_state: ControllerState::Easing,
        }
    }

    /// One cycle, answered by `answer` (which sees the reading) or by nobody.
    fn cycle(&mut self, answer: Option<&Answer<'_>>) {
        self.cycle += 1;
        let sync_ns = EPOCH_NS + (self.cycle - 1) * PERIOD_NS;
        let wake = Wake::on_time(self.cycle, sync_ns);
        self.plant.begin_cycle(wake).unwrap();
        self.plant.collect(sync_ns + 525_000).unwrap();
        self.plant.fill_reading(&mut self.reading);
        self.truth = self.plant.truth().unwrap();
        let command = answer.map(|answer| {
            let (target_m, request) = answer(&self.reading);
            Command {
                cycle: self.cycle,
                target_m,
                request: request.code(),
                controller_state: self.controller_state.code(),
                version: LAYOUT_VERSION,
                ..Command::default()
            }
        });
        self.plant.apply(sync_ns + 545_000, command.as_ref()).unwrap();
        self.frames.extend(self.plant.drain_frames());
        self.plant.drain_events(&mut |event| self.events.push(event));
    }

    /// Runs cycles with a request to hold the actual position, until all drives are enabled.
    fn enable(&mut self) {
        for _ in 0..500 {
            self.cycle(Some(&|reading| (reading.position_m, DriveRequest::Enable)));
            if self.reading.drive_state == ENABLED {
                return;
            }
        }
        panic!("not enabled: {:?}", self.reading.drive_state);
    }

    fn causes(&self, kind: EventKind) -> Vec<Cause> {
        let events = self.events.iter().filter(|event| event.kind == kind.code());
        events.map(|event| Cause::try_from(event.cause).unwrap()).collect()
    }

    fn fastest_axis_m_s(&self) -> f64 {
        self.truth.joint_m_s.iter().fold(0.0, |fastest: f64, speed| fastest.max(speed.abs()))
    }
}

/// A wait for the link's next event ends exactly when the last process data arrive.
#[test]
fn the_process_data_are_complete_at_one_of_the_links_events() {
    const EVENTS: usize = 16;
    let mut bench = Bench::new(&Scenario::default());
    bench.enable();
    let sync_ns = EPOCH_NS + bench.cycle * PERIOD_NS;
    bench.plant.begin_cycle(Wake::on_time(bench.cycle + 1, sync_ns)).unwrap();
    let mut now_ns = sync_ns;
    let mut looks = 0;
    while !bench.plant.collect(now_ns).unwrap() {
        let next_ns = bench.plant.link.next_event_ns();
        assert!(next_ns > now_ns, "an event that is over");
        (now_ns, looks) = (next_ns, looks + 1);
        assert!(looks <= EVENTS, "after {} ns", now_ns - sync_ns);
    }
    bench.plant.fill_reading(&mut bench.reading);
    assert_eq!(bench.reading.complete_ns, now_ns);
}

/// Joint positions of a smooth motion about the pose the rig is switched on in: 15 mm up and down, some
/// pitch, 1.4 times a second; at rest at its beginning.
fn targets(mechanism: &Mechanism, start: &Pose, time_s: f64) -> [f64; AXES] {
    let share = (1.0 - (time_s * 1.4 * std::f64::consts::TAU).cos()) / 2.0;
    let shift = Vec3::new(-0.003, 0.002, -0.015) * share;
    let pose = Pose::from_parts(
        (start.translation.vector + shift).into(),
        nalgebra::UnitQuaternion::from_scaled_axis(Vec3::new(0.0, 0.15, 0.02) * share),
    );
    mechanism.inverse(&pose).unwrap().actuators.to_axes()
}

fn start_pose(bench: &Bench) -> Pose {
    Pose::translation(bench.truth.position_m[0], bench.truth.position_m[1], bench.truth.position_m[2])
}

/// Plays the motion for so many cycles; the largest distance of an axis from the target two cycles old.
fn play(bench: &mut Bench, cycles: u64) -> f64 {
    let start = start_pose(bench);
    let began = bench.cycle;
    let mechanism = bench.mechanism.clone();
    let at = |cycle: u64| targets(&mechanism, &start, cycle.saturating_sub(began) as f64 * 1e-3);
    let mut worst_m: f64 = 0.0;
    for _ in 0..cycles {
        let next = bench.cycle + 1;
        bench.cycle(Some(&|_| (at(next + 2), DriveRequest::Enable)));
        for (wanted, is) in at(next).into_iter().zip(bench.truth.joint_m) {
            worst_m = worst_m.max((wanted - is).abs());
        }
    }
    worst_m
}

#[test]
fn drives_boot_enable_and_follow_within_a_tenth_of_a_millimetre() {
    let mut bench = Bench::new(&Scenario::default());
    bench.enable();
    let worst_m = play(&mut bench, 2000);
    println!("largest error of an axis: {:.1} µm", worst_m * 1e6);
    assert!(worst_m < 1e-4, "{worst_m}");
    assert_eq!(bench.causes(EventKind::Fault), []);
    for _ in 0..50 {
        bench.cycle(Some(&|reading| (reading.position_m, DriveRequest::Off)));
    }
    assert!(bench.plant.master.drives_are_off());
}

#[test]
fn nothing_moves_while_the_drives_are_enabled() {
    let mut bench = Bench::new(&Scenario::default());
    bench.cycle(None);
    let before = bench.truth.joint_m;
    bench.enable();
    for _ in 0..50 {
        bench.cycle(Some(&|reading| (reading.position_m, DriveRequest::Enable)));
    }
    for (before, after) in before.iter().zip(bench.truth.joint_m) {
        assert!((before - after).abs() < 2e-4, "{before} became {after}");
    }
}

#[test]
fn without_commands_the_master_stops_the_drives_and_stays_stopped() {
    let mut bench = Bench::new(&Scenario::default());
    bench.enable();
    play(&mut bench, 200);
    assert!(bench.fastest_axis_m_s() > 0.02);
    for _ in 0..60 {
        bench.cycle(None);
    }
    assert!(bench.plant.master.drives_are_off());
    assert!(bench.fastest_axis_m_s() < 1e-3);
    assert_eq!(bench.causes(EventKind::Fault), [Cause::CommandLost]);
    assert_eq!(bench.reading.master_fault, 1);
    for _ in 0..50 {
        bench.cycle(Some(&|reading| (reading.position_m, DriveRequest::Enable)));
    }
    assert!(bench.plant.master.drives_are_off(), "a late commander moved the rig again");
}

#[test]
fn without_the_master_the_drives_stop_by_themselves() {
    let scenario = Scenario::default();
    let mut bench = Bench::new(&scenario);
    bench.enable();
    play(&mut bench, 200);
    let silent_from_ns = EPOCH_NS + bench.cycle * PERIOD_NS;
    let bound_ns = u64::from(scenario.can.heartbeat_consumer_ms) * PERIOD_NS + 60 * PERIOD_NS;
    bench.plant.link.advance(silent_from_ns + bound_ns).unwrap();
    for drive in &bench.plant.link.emulation.drives {
        assert_eq!(drive.axis.power, DriveState::SwitchOnDisabled);
    }
}

#[test]
fn a_bad_command_stops_the_rig_and_its_bad_value_is_reported() {
    let standing = Bench::new(&Scenario::default()).truth.joint_m;
    let with = |axis: usize, target_m: f64| {
        let mut targets_m = standing;
        targets_m[axis] = target_m;
        targets_m
    };
    let cases = [
        (with(0, f64::NAN), 1, 0, f64::NAN),
        (with(2, f64::INFINITY), 77, 2, f64::INFINITY),
        (standing, 77, NO_AXIS, 77.0),
    ];
    for (target_m, request, axis, value) in cases {
        let mut bench = Bench::new(&Scenario::default());
        bench.enable();
        let command = Command { cycle: 1, target_m, request, version: LAYOUT_VERSION, ..Command::default() };
        let now_ns = EPOCH_NS + bench.cycle * PERIOD_NS;
        bench.plant.apply(now_ns, Some(&command)).unwrap();
        for _ in 0..60 {
            bench.cycle(Some(&|reading| (reading.position_m, DriveRequest::Enable)));
        }
        assert!(bench.plant.master.drives_are_off());
        assert_eq!(bench.causes(EventKind::Fault), [Cause::BadMessage]);
        let told = bench.events.iter().find(|event| event.kind == EventKind::Fault.code()).unwrap();
        assert_eq!((told.axis, told.value.to_bits()), (axis, value.to_bits()), "{}", told.value);
    }
}

#[test]
fn a_cycle_on_the_wire_is_sync_then_process_data_up_then_down() {
    let mut bench = Bench::new(&Scenario::default());
    bench.enable();
    bench.cycle(Some(&|reading| (reading.position_m, DriveRequest::Enable)));
    bench.frames.clear();
    let sync_ns = EPOCH_NS + bench.cycle * PERIOD_NS;
    bench.cycle(Some(&|reading| (reading.position_m, DriveRequest::Enable)));
    bench.cycle(Some(&|reading| (reading.position_m, DriveRequest::Enable)));
    let node = |id| NodeId::new(id).unwrap();
    let on_bus = |bus: u32| {
        let frames = bench.frames.iter().filter(move |frame| frame.bus == bus);
        frames
            .map(|frame| *tap::decode(frame).unwrap().frame().unwrap())
            .filter(|frame| (sync_ns..sync_ns + PERIOD_NS).contains(&frame.time_ns))
            .map(|frame| Cob::try_from(frame.frame.id()).unwrap())
            .filter(|cob| !matches!(cob, Cob::Heartbeat(_)))
            .collect::<Vec<_>>()
    };
    for (bus, ids) in [(0, [1, 2, 3]), (1, [4, 5, 6])] {
        let [a, b, c] = ids.map(node);
        let expected = [
            Cob::Sync,
            Cob::Tpdo1(a),
            Cob::Tpdo1(b),
            Cob::Tpdo1(c),
            Cob::Rpdo1(a),
            Cob::Rpdo1(b),
            Cob::Rpdo1(c),
        ];
        assert_eq!(on_bus(bus), expected);
    }
}

#[test]
fn process_data_of_the_sync_before_are_no_answer_to_this_one() {
    let mut bench = Bench::new(&Scenario::default());
    bench.enable();
    // A cycle whose process data are not waited for; they lie in the queue when the next one begins.
    let sync_ns = EPOCH_NS + bench.cycle * PERIOD_NS;
    bench.plant.begin_cycle(Wake::on_time(bench.cycle + 1, sync_ns)).unwrap();
    bench.plant.begin_cycle(Wake::on_time(bench.cycle + 2, sync_ns + PERIOD_NS)).unwrap();
    assert!(!bench.plant.collect(sync_ns + PERIOD_NS + 300_000).unwrap());
    assert!(bench.plant.collect(sync_ns + PERIOD_NS + 525_000).unwrap());
}

#[test]
fn the_same_seed_gives_the_same_bytes_and_another_seed_other_noise() {
    let run = |seed| {
        let mut bench = Bench::new(&Scenario { seed, ..Scenario::default() });
        bench.enable();
        play(&mut bench, 300);
        (bench.reading, bench.truth, bench.frames)
    };
    assert_eq!(run(5), run(5));
    assert_ne!(run(5).2, run(6).2);
}

#[test]
fn drives_that_never_boot_are_named_each() {
    let mut bench = Bench::new(&Scenario {
        can: masseter_scenario::CanConfig { boot_timeout_ms: 10, ..Default::default() },
        ..Scenario::default()
    });
    for _ in 0..30 {
        bench.cycle(Some(&|reading| (reading.position_m, DriveRequest::Enable)));
    }
    assert_eq!(bench.causes(EventKind::Fault), [Cause::BootTimeout; AXES]);
    let named: Vec<_> = bench.events.iter().map(|event| event.axis).collect();
    assert_eq!(named[..AXES], [0, 1, 2, 3, 4, 5]);
}

mod following {
    //! The master's own following-error monitor on the whole plant: what a disturbed machine may do, and what no drive may.

    use super::*;

    /// A cycle of a disturbed machine.
    #[derive(Debug, Clone, Copy, Default)]
    struct Disturbance {
        /// SYNC goes out that much late, ns.
        late_ns: u64,
        skipped: u64,
        /// Whether no command comes.
        is_silent: bool,
    }

    /// The fastest step of the default motion, m.
    const STEP_M: f64 = 0.116e-3;

    /// Moves the legs at that speed and disturbs cycles meanwhile; the faults.
    fn faults(disturbances: &[Disturbance]) -> Vec<Cause> {
        let mut bench = Bench::new(&Scenario::default());
        bench.enable();
        let start = bench.reading.position_m;
        let (mut steps, mut speed, mut number, mut free_ns) = (0.0, 0.0, bench.cycle, 0);
        for cycle in 0..160_usize {
            let disturbance = cycle.checked_sub(60).and_then(|place| disturbances.get(place)).copied();
            let Disturbance { late_ns, skipped, is_silent } = disturbance.unwrap_or_default();
            number += 1 + skipped;
            let due_ns = EPOCH_NS + (number - 1) * PERIOD_NS;
            let woke_ns = free_ns.max(due_ns + late_ns);
            free_ns = woke_ns + 550_000;
            bench.plant.begin_cycle(Wake { woke_ns, ..Wake::on_time(number, due_ns) }).unwrap();
            bench.plant.collect(woke_ns + 525_000).unwrap();
            if !is_silent {
                speed = f64::min(speed + 0.05, 1.0);
                steps += speed;
            }
            let target_m =
                std::array::from_fn(|axis| start[axis] - if axis < 3 { 0.0 } else { steps * STEP_M });
            let request = DriveRequest::Enable.code();
            let command =
                Command { cycle: number, target_m, request, version: LAYOUT_VERSION, ..Command::default() };
            bench.plant.apply(woke_ns + 545_000, Some(&command).filter(|_| !is_silent)).unwrap();
            bench.plant.drain_events(&mut |event| bench.events.push(event));
        }
        bench.causes(EventKind::Fault)
    }

    /// At the fastest moment of the default motion and with its limit: late SYNCs, also such that SYNC overtakes the targets,
    /// skipped cycles and missing commands.
    #[test]
    fn a_disturbed_machine_makes_no_following_error() {
        let none = Disturbance::default();
        let late = |late_ns| Disturbance { late_ns, ..none };
        let mut cases = vec![vec![none]];
        for late_ns in [100_000, 300_000, 450_000, 600_000, 900_000, 990_000] {
            let [late, none] = [late_ns, 0].map(late);
            cases.extend([vec![late], vec![late; 2], vec![late; 20], [late, none].repeat(10)]);
            cases.extend([1, 2, 3, 5, 10, 20, 100].map(|skipped| vec![Disturbance { skipped, ..late }; 3]));
        }
        cases
            .extend([1, 2, 3, 5, 10, 20].map(|silent| vec![Disturbance { is_silent: true, ..none }; silent]));
        for case in cases {
            assert_eq!(faults(&case), [], "{case:?}");
        }
    }
}

mod refusals {
    //! Scenarios whose plant cannot work.

    use super::*;

    #[test]
    fn what_cannot_work_is_refused_with_its_key() {
        let default = Scenario::default;
        let with = |change: fn(&mut Scenario)| {
            let mut scenario = default();
            change(&mut scenario);
            check(&scenario).unwrap_err().to_string()
        };
        let slow = "can.heartbeat_consumer_ms = 90: use more than can.heartbeat_producer_ms and a cycle";
        let too_fine = "drives.leg.encoder_resolution_m = 0.000000000001: use more";
        let cases: [(String, &str); 14] = [
            (with(|s| s.can.heartbeat_consumer_ms = 50), "can.heartbeat_consumer_ms = 50: use more"),
            (with(|s| s.can.heartbeat_consumer_ms = 51), "can.heartbeat_consumer_ms = 51: use more"),
            (with(|s| (s.rate_hz, s.can.heartbeat_consumer_ms) = (10, 90)), slow),
            (with(|s| s.can.rpdo_timeout_ms = Some(2)), "can.rpdo_timeout_ms = 2: use 0 for none, or more"),
            (with(|s| s.can.node_ids[3] = 1), "node 1 is listed twice"),
            (with(|s| s.can.node_ids[3] = 0), "node id"),
            (with(|s| s.can.node_ids[3] = 127), "master"),
            (with(|s| s.can.buses = vec![vec![0, 1, 2], vec![3, 4]]), "axis 5 is named 0 times"),
            (with(|s| s.can.buses = vec![vec![0, 1, 2], vec![3, 4, 5, 0]]), "axis 0 is named 2 times"),
            (with(|s| s.can.buses = vec![vec![0, 1, 2], vec![3, 4, 5, 6]]), "axis 6"),
            (with(|s| s.can.buses.push(Vec::new())), "bus 2 has no drive"),
            (with(|s| s.drives.leg.encoder_resolution_m = 1e-12), too_fine),
            (with(|s| s.dynamics.initial_leg_m = 0.4), "dynamics.initial_leg_m = 0.4: "),
            (with(|s| s.mechanism.strokes.slide_m = [0.001, 0.03]), "initial_leg_m = 0.29: axis d1 at"),
        ];
        for (error, expected) in cases {
            assert!(error.contains(expected), "{error}");
        }
        assert_eq!(check(&default()), Ok(()));
        let boots_within = |start_timeout_s: f64| {
            let mut scenario = Scenario { rate_hz: 10, ..default() };
            scenario.controller.start_timeout_s = start_timeout_s;
            check(&scenario)
        };
        assert!(boots_within(5.0).unwrap_err().to_string().contains("the drives take 20.8 s to boot"));
        assert_eq!(boots_within(20.9), Ok(()));
    }

    #[test]
    fn the_rig_may_be_switched_on_with_its_legs_at_either_end() {
        for initial_leg_m in Scenario::default().mechanism.strokes.leg_m {
            let mut scenario = Scenario::default();
            scenario.dynamics.initial_leg_m = initial_leg_m;
            assert_eq!(check(&scenario), Ok(()), "{initial_leg_m}");
        }
    }
}

mod stops {
    //! Stops and limits of the whole plant: how hard, how far, and who may start it again.

    use masseter_can::canopen::{Nmt, NmtCommand, NmtTarget};
    use masseter_can::cia402::Controlword;
    use masseter_can::{Bus, Frame, PdoMapping, Rpdo1};

    use super::*;
    use crate::master::link::Buses;

    /// Late enough that no frame follows before SYNC, early enough to be sent before it.
    const LATE_NS: u64 = 850_000;

    /// A plant at full speed, and the commander that keeps it there.
    struct Moving {
        bench: Bench,
        start: Pose,
        began: u64,
    }

    impl Moving {
        fn new() -> Self {
            let mut bench = Bench::new(&Scenario::default());
            bench.enable();
            let (start, began) = (start_pose(&bench), bench.cycle);
            let mut moving = Self { bench, start, began };
            (0..180).for_each(|_| moving.cycle());
            assert!(moving.bench.fastest_axis_m_s() > 0.05);
            moving
        }

        fn cycle(&mut self) {
            let time_s = (self.bench.cycle + 3 - self.began) as f64 * 1e-3;
            let targets_m = targets(&self.bench.mechanism.clone(), &self.start, time_s);
            self.bench.cycle(Some(&|_| (targets_m, DriveRequest::Enable)));
        }

        /// A frame that somebody puts on the bus late in the present cycle.
        fn disturb(&mut self, bus: usize, frame: Frame) {
            let now_ns = EPOCH_NS + (self.bench.cycle - 1) * PERIOD_NS + LATE_NS;
            self.bench.plant.link.port(bus).send(now_ns, frame).unwrap();
        }
    }

    #[test]
    fn a_quick_stop_slows_down_along_its_ramp() {
        let Moving { mut bench, .. } = Moving::new();
        let ramp_m_s2 = Scenario::default().drives.leg.quick_stop_deceleration_m_s2;
        let mut hardest_m_s2: f64 = 0.0;
        let mut cycles = 0;
        while cycles < 2 || !bench.plant.master.drives_are_off() {
            let before = bench.truth.joint_m_s;
            bench.cycle(Some(&|reading| (reading.position_m, DriveRequest::QuickStop)));
            let slowed =
                before.into_iter().zip(bench.truth.joint_m_s).map(|(was, is)| (was - is).abs() / 1e-3);
            hardest_m_s2 = slowed.fold(hardest_m_s2, f64::max);
            cycles += 1;
            assert!(cycles < 30, "still moving");
        }
        println!("off after {cycles} ms, at most {hardest_m_s2:.1} m/s²");
        assert!(hardest_m_s2 < 1.5 * ramp_m_s2, "{hardest_m_s2} m/s²");
    }

    /// The drive obeys a quick stop that the master did not ask for: nobody may switch it on again.
    #[test]
    fn a_drive_that_leaves_operation_stops_them_all_for_good() {
        let mut moving = Moving::new();
        let stop =
            Rpdo1 { controlword: Controlword::QUICK_STOP, target_increments: 0, torque_offset_permille: 0 };
        moving.disturb(1, stop.frame(NodeId::new(4).unwrap(), &PdoMapping::RPDO1));
        (0..100).for_each(|_| moving.cycle());
        assert!(moving.bench.plant.master.drives_are_off(), "{:?}", moving.bench.reading.drive_state);
        assert_eq!(moving.bench.causes(EventKind::Fault), [Cause::DriveFault]);
    }

    #[test]
    fn a_drive_taken_out_of_operational_stops_them_all() {
        let mut moving = Moving::new();
        let target = NmtTarget::Node(NodeId::new(4).unwrap());
        moving.disturb(1, Nmt { command: NmtCommand::EnterPreOperational, target }.frame());
        (0..200).for_each(|_| moving.cycle());
        assert!(moving.bench.plant.master.drives_are_off(), "{:?}", moving.bench.reading.drive_state);
        // Its heartbeat or three cycles without data, whichever comes first.
        let causes = moving.bench.causes(EventKind::Fault);
        assert!(causes == [Cause::ProcessDataLost] || causes == [Cause::NodeStopped], "{causes:?}");
    }

    /// What a command asks for too much, and what the master says of it.
    #[test]
    fn a_command_beyond_a_limit_is_refused_as_a_whole_and_stops_the_rig() {
        type Change = fn([f64; AXES]) -> [f64; AXES];
        let cases: [(Change, Cause, u32); 5] = [
            (|at| [at[0], at[1], at[2], 0.301, at[4], at[5]], Cause::StrokeLimit, 3),
            (|at| [at[0], -0.0301, at[2], at[3], at[4], at[5]], Cause::StrokeLimit, 1),
            (|at| at.map(|at_m| at_m - 0.01), Cause::VelocityLimit, 0),
            (|_| [1e9; AXES], Cause::StrokeLimit, 0),
            (|at| [at[0], at[1], at[2], at[3], at[4], at[5] + 1.5e-4], Cause::AccelerationLimit, 5),
        ];
        for (change, cause, axis) in cases {
            let mut bench = Bench::new(&Scenario::default());
            bench.enable();
            let before = bench.reading.position_m;
            bench.frames.clear();
            bench.cycle(Some(&|_| (before, DriveRequest::Enable)));
            for _ in 0..50 {
                bench.cycle(Some(&|_| (change(before), DriveRequest::Enable)));
            }
            assert!(bench.plant.master.drives_are_off());
            assert_eq!(bench.causes(EventKind::Fault), [cause]);
            let told = bench.events.iter().find(|event| event.cause == cause.code()).unwrap();
            assert_eq!(told.axis, axis);
            assert!(told.value.abs() > told.limit.abs(), "{} of {}", told.value, told.limit);
            for frame in &bench.frames {
                let tapped = tap::decode(frame).unwrap();
                if let Some(Ok(Cob::Rpdo1(node))) =
                    tapped.frame().map(|frame| Cob::try_from(frame.frame.id()))
                {
                    let rpdo =
                        Rpdo1::decode(tapped.frame().unwrap().frame.data(), &PdoMapping::RPDO1).unwrap();
                    let sent_m = f64::from(rpdo.target_increments) * 1e-6;
                    let moved_m = sent_m - before[usize::from(node.get()) - 1];
                    assert!(moved_m.abs() < 5e-5, "{moved_m} m was on the wire");
                }
            }
        }
    }

    #[test]
    fn a_commander_that_switched_the_drives_off_may_go() {
        let mut bench = Bench::new(&Scenario::default());
        bench.enable();
        for _ in 0..20 {
            bench.cycle(Some(&|reading| (reading.position_m, DriveRequest::Off)));
        }
        for _ in 0..100 {
            bench.cycle(None);
        }
        assert_eq!(bench.causes(EventKind::Fault), []);
        assert_eq!(bench.reading.master_fault, 0);
    }

    #[test]
    fn a_commander_that_stops_the_drives_may_end_before_they_are_at_rest() {
        let Moving { mut bench, .. } = Moving::new();
        bench.cycle(Some(&|reading| (reading.position_m, DriveRequest::QuickStop)));
        (0..100).for_each(|_| bench.cycle(None));
        assert!(bench.plant.master.drives_are_off());
        assert_eq!(bench.causes(EventKind::Fault), []);
        assert_eq!(bench.reading.master_fault, 0);
    }

    #[test]
    fn a_commander_that_dies_while_it_enables_the_drives_is_missed() {
        let mut bench = Bench::new(&Scenario::default());
        while !bench.reading.drive_state.contains(&DriveState::SwitchedOn.code()) {
            bench.cycle(Some(&|reading| (reading.position_m, DriveRequest::Enable)));
        }
        (0..100).for_each(|_| bench.cycle(None));
        assert!(bench.plant.master.drives_are_off());
        assert_eq!(bench.causes(EventKind::Fault), [Cause::CommandLost]);
    }

    #[test]
    fn at_the_end_the_drives_are_stopped_at_once_however_long_commands_are_waited_for() {
        let mut scenario = Scenario::default();
        scenario.can.command_timeout_cycles = 10_000;
        let mut bench = Bench::new(&scenario);
        bench.enable();
        play(&mut bench, 180);
        assert!(bench.fastest_axis_m_s() > 0.05);
        bench.plant.master.stop();
        (0..30).for_each(|_| bench.cycle(None));
        assert!(bench.plant.master.drives_are_off());
        assert!(bench.fastest_axis_m_s() < 1e-3);
        assert_eq!(bench.causes(EventKind::Fault), []);
    }

    #[test]
    fn reading_and_truth_name_the_same_instant() {
        let mut bench = Bench::new(&Scenario::default());
        bench.enable();
        assert_eq!(bench.reading.sampled_ns, bench.truth.sampled_ns);
    }
}
