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
        let slowed = before.into_iter().zip(bench.truth.joint_m_s).map(|(was, is)| (was - is).abs() / 1e-3);
        hardest_m_s2 = slowed.fold(hardest_m_s2, f64::max);
        cycles += 1;
        assert!(cycles < 30, "still moving");
    }
    println!("off after {cycles} ms, at most {hardest_m_s2:.1} m/s²");
    assert!(hardest_m_s2 < 1.5 * ramp_m_s2, "{hardest_m_s2} m/s²");
}

/// The drive obeys a foreign quick stop: nobody may switch the drive on again.
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

/// Excessive demands of a command, with the master's cause.
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
            if let Some(Ok(Cob::Rpdo1(node))) = tapped.frame().map(|frame| Cob::try_from(frame.frame.id())) {
                let rpdo = Rpdo1::decode(tapped.frame().unwrap().frame.data(), &PdoMapping::RPDO1).unwrap();
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
