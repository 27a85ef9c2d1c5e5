//! Scenarios of the whole plant under virtual time, with a commander that uses inverse kinematics only.

mod following;
mod injected_faults;
mod refusals;
mod stimuli;
mod stops;
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

/// Joint positions of a smooth motion about the pose at switch-on, from rest: 15 mm up and down, some pitch, 1.4 times
/// a second.
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

/// Plays the motion for this many cycles. Returns the largest distance of an axis from the target two cycles old.
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
        assert_eq!(drive.state(), DriveState::SwitchOnDisabled);
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
fn a_heartbeat_is_the_last_frame_of_its_node_in_a_cycle() {
    let mut bench = Bench::new(&Scenario::default());
    bench.enable();
    bench.frames.clear();
    (0..160).for_each(|_| bench.cycle(Some(&|reading| (reading.position_m, DriveRequest::Enable))));
    for bus in 0..2 {
        let frames = bench.frames.iter().filter(|frame| frame.bus == bus);
        let frames = frames.map(|frame| *tap::decode(frame).unwrap().frame().unwrap());
        let cobs: Vec<_> = frames.map(|frame| Cob::try_from(frame.frame.id()).unwrap()).collect();
        let mut beats = 0;
        for cycle in cobs.split(|cob| *cob == Cob::Sync).skip(1) {
            for (place, cob) in cycle.iter().enumerate() {
                let Cob::Heartbeat(node) = *cob else { continue };
                beats += 1;
                let is_of_node = |later: &Cob| match later {
                    Cob::Rpdo1(_) => node.get() == masseter_scenario::MASTER_NODE.get(),
                    later => *later == Cob::Tpdo1(node),
                };
                assert!(!cycle[place..].iter().any(is_of_node), "{cycle:?}");
            }
        }
        assert!(beats >= 4 * 3, "{beats}");
    }
}

#[test]
fn process_data_of_the_sync_before_are_no_answer_to_this_one() {
    let mut bench = Bench::new(&Scenario::default());
    bench.enable();
    // A cycle without a wait for process data, which lie in the queue at the beginning of the next cycle.
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
