//! The targets of the drives, and the readings of the controller. Drives get the targets of the command only while they
//! are enabled and are to be enabled.

use super::peer::POSITION;
use super::*;

/// The targets' distance from the drives, less than a following error; and in increments.
const OFFSET_M: f64 = 5e-5;
const OFFSET: i32 = 50;

impl Bench {
    /// Enables drives that stand still, with targets beyond their positions.
    fn enabled_with_an_offset() -> Self {
        let mut bench = Self::new();
        bench.offset_m = OFFSET_M;
        (0..AXES).for_each(|axis| bench.drive(axis).may_move = true);
        bench.cycles(400, DriveRequest::Enable);
        assert!(bench.all_are(DriveState::OperationEnabled), "{:?}", bench.events);
        bench
    }
}

#[test]
fn until_a_drive_is_enabled_its_target_is_its_position() {
    let mut bench = Bench::enabled_with_an_offset();
    for axis in 0..AXES {
        let targets = &bench.drive(axis).targets;
        assert!(targets.iter().any(|(state, _)| *state == DriveState::SwitchedOn));
        for &(state, target) in targets {
            let follows = state == DriveState::OperationEnabled;
            assert_eq!(target, POSITION + if follows { OFFSET } else { 0 }, "axis {axis}, {state}");
        }
    }
}

/// The commands cease before the drives follow, so that nobody has judged their targets.
#[test]
fn a_target_from_before_a_drive_follows_is_never_sent() {
    let mut bench = Bench::new();
    (0..AXES).for_each(|axis| bench.drive(axis).may_move = true);
    bench.offset_m = 9.0;
    while !bench.all_are(DriveState::SwitchedOn) {
        bench.cycle(Some(DriveRequest::Enable));
    }
    (0..20).for_each(|_| bench.cycle(None));
    assert!(bench.all_are(DriveState::OperationEnabled));
    for axis in 0..AXES {
        assert!(bench.drive(axis).targets.iter().all(|(_, target)| *target == POSITION), "axis {axis}");
    }
    assert_eq!(bench.causes(EventKind::Fault), []);
}

/// The drive of `l1` takes a torque offset, counts backwards, and may have 60 % of its force.
#[test]
fn a_force_offset_is_sent_where_it_is_mapped_and_within_the_force_limit() {
    let text = "[[drive_profile]]\naxes = ['l1']\nreversed = ['l1']\npdos.rpdo1 = ['6040h', '607Ah', '60B2h']\n\
            [drives.leg]\nrated_force_n = 100.0\nmax_force_n = 60.0";
    let scenario = Scenario::parse(std::path::Path::new("robot.toml"), text).unwrap();
    let mut bench = Bench::of(scenario.clone());
    let drive = bench.drive(3);
    drive.rpdo1 = scenario.profile(3).pdos.rpdo1();
    drive.objects.insert((0x1600, 0), vec![3]);
    drive.objects.insert((0x1600, 3), 0x60B2_0010_u32.to_le_bytes().to_vec());
    bench.cycles(400, DriveRequest::Enable);
    assert!(bench.all_are(DriveState::OperationEnabled), "{:?}", bench.events);
    for (force_offset_n, permille) in [(25.0, -250), (-7.0, 70), (1e6, -600), (-1e6, 600), (0.0, 0)] {
        bench.cycle_with(|command| {
            let request = DriveRequest::Enable.code();
            Some(Command { request, force_offset_n: [force_offset_n; AXES], ..command })
        });
        assert_eq!(bench.drive(3).torque_offset_permille, permille, "{force_offset_n} N");
    }
    bench.cycle_with(|command| {
        Some(Command { request: DriveRequest::QuickStop.code(), force_offset_n: [9.0; AXES], ..command })
    });
    assert_eq!(bench.drive(3).torque_offset_permille, 0, "a drive that follows nothing gets no force");
    bench.cycle_with(|command| Some(Command { force_offset_n: [f64::INFINITY; AXES], ..command }));
    assert_eq!(bench.causes(EventKind::Fault), [Cause::BadMessage]);
}

#[test]
fn a_refused_command_counts_as_none() {
    let mut bench = Bench::enabled();
    bench.cycles(1, DriveRequest::Off);
    bench.cycle_with(|command| Some(Command { request: 77, ..command }));
    assert_eq!(bench.master.silent_cycles(), 1);
}

/// The same holds for every stop of drives that have moved meanwhile.
#[test]
fn from_the_first_cycle_of_a_stop_the_target_is_the_position() {
    type Stop = fn(&mut Bench);
    let stops: [Stop; 4] = [
        |bench| bench.cycle(Some(DriveRequest::Off)),
        |bench| bench.cycle(Some(DriveRequest::QuickStop)),
        |bench| bench.cycle_with(|command| Some(Command { request: 99, ..command })),
        |bench| {
            bench.master.stop();
            bench.cycle(Some(DriveRequest::Enable));
        },
    ];
    for (case, stop) in stops.into_iter().enumerate() {
        let mut bench = Bench::enabled_with_an_offset();
        for axis in 0..AXES {
            let drive = bench.drive(axis);
            drive.position += 20 + axis as i32;
            drive.targets.clear();
        }
        stop(&mut bench);
        bench.cycles(30, DriveRequest::Off);
        for axis in 0..AXES {
            let targets = &bench.drive(axis).targets;
            assert_eq!(targets[0].0, DriveState::OperationEnabled, "case {case}");
            let position = POSITION + 20 + axis as i32;
            assert!(targets.iter().all(|&(_, target)| target == position), "case {case}: {targets:?}");
        }
    }
}

#[test]
fn a_reading_carries_position_force_and_state_of_every_drive() {
    let mut bench = Bench::new();
    for axis in 0..AXES {
        bench.drive(axis).position = 1000 * (axis as i32 + 1);
        bench.drive(axis).torque_permille = -100 * (axis as i16 + 1);
    }
    bench.cycles(400, DriveRequest::Enable);
    let drives = Scenario::default().drives;
    for axis in 0..AXES {
        let share = (axis + 1) as f64;
        assert!((bench.reading.position_m[axis] - share * 1e-3).abs() < 1e-12);
        let rated_n = drives.of_axis(axis).rated_force_n;
        assert!((bench.reading.force_n[axis] + 0.1 * share * rated_n).abs() < 1e-9);
        assert_eq!(bench.reading.drive_state[axis], DriveState::OperationEnabled.code());
    }
}

/// Of frames that answer an earlier SYNC of that bus, which was sent late.
#[test]
fn process_data_before_this_cycles_sync_on_the_wire_are_none_of_this_cycle() {
    let mut bench = Bench::enabled();
    bench.cycle += 1;
    let sync_ns = bench.now_ns();
    bench.wires.begin(sync_ns);
    bench.master.begin_cycle(Wake::on_time(bench.cycle, sync_ns), &mut bench.wires);
    bench.master.note_sync(1, sync_ns + 2000);
    assert!(!bench.master.collect(sync_ns + 500_000, &mut bench.wires));
    bench.master.fill_reading(&mut bench.reading);
    assert_eq!(bench.reading.fresh_axes, 0b00_0111);
}

#[test]
fn each_change_of_a_drives_state_is_reported_once() {
    let mut bench = Bench::enabled();
    bench.cycles(50, DriveRequest::Enable);
    for axis in 0..AXES {
        let changes = bench.events_of(EventKind::Transition);
        let changes =
            changes.filter(|event| event.source == Source::Drive.code() && event.axis == axis as u32);
        let states: Vec<_> = changes.map(|event| [event.from, event.to]).collect();
        assert!(states.windows(2).all(|pair| pair[0][1] == pair[1][0]), "{states:?}");
        assert!(states.iter().all(|[from, to]| from != to), "{states:?}");
        assert_eq!(
            (states[0][0], states[states.len() - 1][1]),
            (NO_DRIVE_STATE, DriveState::OperationEnabled.code())
        );
    }
}

#[test]
fn a_reading_names_the_command_that_it_answers() {
    let mut bench = Bench::new();
    bench.cycle(None);
    assert_eq!((bench.reading.answers_cycle, bench.reading.command_received_ns), (0, 0));
    bench.cycle(Some(DriveRequest::Off));
    let received_ns = bench.now_ns() + 550_000;
    for _ in 0..3 {
        bench.cycle(None);
        assert_eq!((bench.reading.answers_cycle, bench.reading.command_received_ns), (2, received_ns));
    }
}

#[test]
fn an_event_has_the_cycle_in_which_it_happened() {
    let mut bench = Bench::enabled();
    bench.drive(2).power = DriveState::Fault;
    bench.cycle(Some(DriveRequest::Enable));
    let fault = *bench.events_of(EventKind::Fault).next().unwrap();
    assert_eq!((fault.cycle, fault.axis, fault.node, fault.bus), (bench.cycle, 2, 3, 0));
}
