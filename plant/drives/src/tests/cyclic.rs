//! Modes, their targets and SYNC: no earlier target moves an axis.

use super::*;

const TORQUE: (u16, u8) = (0x6071, 0);
const TORQUE_ACTUAL: (u16, u8) = (0x6077, 0);
const POSITION_DEMAND: (u16, u8) = (0x6062, 0);

/// The motor carries 5 N of 500 N, or the brake does.
#[test]
fn an_enabled_axis_holds_its_position_or_waits_behind_its_brake_for_a_cyclic_target() {
    let holding = [PROFILE_POSITION, HOMING, PROFILE_VELOCITY].map(|mode| (mode, 10));
    let waiting = [CYCLIC_POSITION, CYCLIC_VELOCITY, CYCLIC_TORQUE].map(|mode| (mode, 0));
    for (mode, permille) in holding.into_iter().chain(waiting) {
        let mut bench = Bench::enabled(mode);
        bench.run_ms(200);
        assert_eq!(bench.read(TORQUE_ACTUAL), Ok(permille), "mode {mode}");
        assert!((bench.position() - START).abs() < 100, "mode {mode}");
    }
}

#[test]
fn a_torque_written_before_the_drive_is_enabled_is_none_of_the_enabled_one() {
    let mut bench = Bench::new();
    bench.write(MODE, &[CYCLIC_TORQUE as u8]).unwrap();
    bench.write(TORQUE, &100_i16.to_le_bytes()).unwrap();
    bench.sync();
    bench.enable();
    for _ in 0..20 {
        bench.sync();
        bench.run_ms(1);
    }
    assert_eq!(bench.read(TORQUE_ACTUAL), Ok(0));
    assert!((bench.position() - START).abs() < 100);
}

#[test]
fn a_stop_forgets_the_set_points() {
    let mut bench = Bench::enabled(PROFILE_POSITION);
    bench.set_point(START + 20_000, 0);
    bench.set_point(START + 30_000, 0);
    bench.run_ms(100);
    bench.control(0x02);
    bench.run_ms(100);
    assert_eq!(bench.drive.state(), DriveState::SwitchOnDisabled);
    let stopped_at = bench.position();
    assert!((START + 1000..START + 19_000).contains(&stopped_at));
    bench.enable();
    bench.run_ms(500);
    assert!(bench.is_near(stopped_at), "{}", bench.position() - stopped_at);
    assert!(!bench.has(StatusBit::SETPOINT_ACKNOWLEDGED));
}

#[test]
fn a_sync_within_the_period_does_not_hurry_the_demand() {
    let mut bench = Bench::operational();
    bench.write((0x60C2, 1), &[4]).unwrap();
    for word in [0x06, 0x07, 0x0F] {
        bench.cycle(word, START);
    }
    bench.run_ms(10);
    bench.cycle(0x0F, START + 400);
    for quarters in [1, 2, 3] {
        bench.sync();
        let demand = bench.read(POSITION_DEMAND).unwrap() as i32;
        assert!((demand - START - 100 * quarters).abs() <= 1, "{quarters}: {}", demand - START);
        bench.run_ms(1);
    }
}

#[test]
fn sync_samples_the_position_at_its_own_time() {
    let mut bench = Bench::operational();
    bench.run_ms(1);
    bench.position_m += 40e-6;
    let expected = (bench.position_m * 1e6).round() as i32;
    let answer = bench.sync()[0];
    let sampled = i32::from_le_bytes(answer.data()[2..6].try_into().unwrap());
    assert_eq!(sampled, expected);
}

/// Object 6007 and the state at once, before any ramp has ended.
#[test]
fn an_aborted_connection_switches_off_or_begins_its_ramp_at_once() {
    let table = [
        (0_u16, DriveState::OperationEnabled),
        (1, DriveState::FaultReactionActive),
        (2, DriveState::SwitchOnDisabled),
        (3, DriveState::QuickStopActive),
    ];
    for (option, state) in table {
        let (mut bench, _) = Bench::cycling();
        bench.write((0x605E, 0), &2_u16.to_le_bytes()).unwrap();
        bench.write((0x6007, 0), &option.to_le_bytes()).unwrap();
        bench.nmt(NmtCommand::EnterPreOperational);
        assert_eq!(bench.drive.state(), state, "6007 = {option}");
    }
}

#[test]
fn a_controlword_during_a_fault_reaction_clears_nothing() {
    let (mut bench, _) = Bench::cycling();
    bench.write((0x605E, 0), &2_u16.to_le_bytes()).unwrap();
    bench.write((0x6007, 0), &1_u16.to_le_bytes()).unwrap();
    bench.nmt(NmtCommand::EnterPreOperational);
    for word in [0x0F, 0x80, 0x00] {
        bench.control(word);
        assert_eq!(bench.drive.state(), DriveState::FaultReactionActive);
        assert_eq!(bench.errors(), (0x11, 0x8100));
    }
    assert_eq!(bench.emergencies(), [EmergencyCode::COMMUNICATION]);
}

/// An axis makes 50 µm in a step at its highest velocity.
#[test]
fn an_encoder_that_jumps_gets_the_brake_instead_of_a_loop() {
    for (jump_m, is_fault) in [(0.4e-3, false), (0.6e-3, true), (-5e-3, true)] {
        let (mut bench, target) = Bench::cycling();
        bench.offset_m = jump_m;
        bench.cycle(0x0F, target);
        let (state, told) = if is_fault {
            (DriveState::Fault, vec![EmergencyCode::POSITION_SENSOR])
        } else {
            (DriveState::OperationEnabled, Vec::new())
        };
        assert_eq!((bench.drive.state(), bench.emergencies()), (state, told), "{jump_m} m");
    }
}

/// From 0.1 m/s the ramp takes 10 ms and 0.5 mm. A loop of the wrong sign would push with the whole force in that time.
#[test]
fn a_stop_that_leaves_its_ramp_ends_in_the_brake() {
    for is_turned in [false, true] {
        let (mut bench, target) = Bench::cycling();
        let from_m = bench.position_m;
        bench.turned_at_m = is_turned.then_some(from_m);
        bench.cycle(0x02, target);
        bench.run_ms(50);
        let stopped_m = bench.position_m;
        bench.run_ms(50);
        assert!((bench.position_m - stopped_m).abs() < 1e-6, "it stands");
        assert!((stopped_m - from_m).abs() < 1e-3, "{} m", stopped_m - from_m);
        let (state, told) = if is_turned {
            (DriveState::Fault, vec![EmergencyCode::VELOCITY])
        } else {
            (DriveState::SwitchOnDisabled, Vec::new())
        };
        assert_eq!((bench.drive.state(), bench.emergencies()), (state, told));
    }
}

#[test]
fn an_axis_that_runs_ahead_of_its_demand_in_operation_gets_the_brake() {
    let (mut bench, mut target) = Bench::cycling();
    bench.turned_at_m = Some(bench.position_m);
    for _ in 0..5 {
        target += 100;
        bench.cycle(0x0F, target);
    }
    assert_eq!(
        (bench.drive.state(), bench.emergencies()),
        (DriveState::Fault, vec![EmergencyCode::VELOCITY])
    );
}
