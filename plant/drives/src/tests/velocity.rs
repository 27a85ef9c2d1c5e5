//! Profile velocity, profile torque and cyclic synchronous velocity.

use super::*;

const TARGET_VELOCITY: (u16, u8) = (0x60FF, 0);
const TARGET_TORQUE: (u16, u8) = (0x6071, 0);
const VELOCITY_DEMAND: (u16, u8) = (0x606B, 0);

impl Bench {
    /// Asks for a velocity, increments/s of a micrometre.
    fn ask_speed(&mut self, increments_s: i32) {
        self.write(TARGET_VELOCITY, &increments_s.to_le_bytes()).unwrap();
    }

    fn moves_at(&self, velocity_m_s: f64) -> bool {
        (self.velocity_m_s - velocity_m_s).abs() < 2e-3
    }
}

/// At 2.5 m/s² (6083h, 6084h): 0.1 m/s take 40 ms, and 0.1 m/s the other way 80 ms.
#[test]
fn a_profile_velocity_is_reached_on_its_ramp_and_kept() {
    let mut bench = Bench::enabled(PROFILE_VELOCITY);
    assert!(bench.has(StatusBit::SPEED_ZERO) && bench.has(StatusBit::TargetReached), "0 is the target");
    bench.ask_speed(100_000);
    bench.run_ms(20);
    assert!((bench.velocity_m_s - 0.05).abs() < 5e-3, "{}", bench.velocity_m_s);
    assert!(!bench.has(StatusBit::TargetReached) && !bench.has(StatusBit::SPEED_ZERO));
    assert!((bench.read(VELOCITY_DEMAND).unwrap() as i32 - 50_000).abs() < 500);
    bench.run_ms(60);
    assert!(bench.moves_at(0.1) && bench.has(StatusBit::TargetReached));
    bench.ask_speed(-100_000);
    bench.run_ms(40);
    assert!(bench.velocity_m_s.abs() < 0.01, "{}", bench.velocity_m_s);
    bench.run_ms(80);
    assert!(bench.moves_at(-0.1) && bench.has(StatusBit::TargetReached));
    assert!(!bench.has(StatusBit::InternalLimit));
}

#[test]
fn a_controlword_on_the_way_changes_no_ramp() {
    let mut bench = Bench::enabled(PROFILE_VELOCITY);
    bench.ask_speed(100_000);
    for _ in 0..20 {
        bench.control(0x0F);
        bench.run_ms(1);
    }
    assert!((bench.velocity_m_s - 0.05).abs() < 5e-3, "{}", bench.velocity_m_s);
}

#[test]
fn a_target_velocity_waits_for_the_drive_to_be_enabled() {
    let mut bench = Bench::new();
    bench.write(MODE, &[PROFILE_VELOCITY as u8]).unwrap();
    bench.ask_speed(50_000);
    bench.run_ms(50);
    assert!((bench.position() - START).abs() < 100);
    bench.enable();
    bench.run_ms(80);
    assert!(bench.moves_at(0.05));
}

/// 605Dh chooses the ramp: 0.1 m/s at 2.5 m/s² take 2 mm, at 10 m/s² (6085h) 0.5 mm.
#[test]
fn a_halt_takes_the_ramp_of_its_option_and_its_end_resumes_the_velocity() {
    for (option, way_m) in [(1, 2e-3), (2, 0.5e-3)] {
        let mut bench = Bench::enabled(PROFILE_VELOCITY);
        bench.write((0x605D, 0), &[option, 0]).unwrap();
        bench.ask_speed(100_000);
        bench.run_ms(100);
        let before_m = bench.position_m;
        bench.control(0x10F);
        bench.ask_speed(90_000);
        bench.run_ms(100);
        assert!((bench.position_m - before_m - way_m).abs() < 2e-4, "{} m", bench.position_m - before_m);
        assert!(bench.has(StatusBit::TargetReached) && bench.has(StatusBit::SPEED_ZERO));
        bench.control(0x0F);
        bench.run_ms(100);
        assert!(bench.moves_at(0.09), "the newest target counts");
    }
}

#[test]
fn a_velocity_keeps_to_its_limit_and_ends_at_the_software_limit() {
    let mut bench = Bench::enabled(PROFILE_VELOCITY);
    bench.write((0x607F, 0), &80_000_u32.to_le_bytes()).unwrap();
    bench.ask_speed(500_000);
    bench.run_ms(100);
    assert!(bench.moves_at(0.08) && bench.has(StatusBit::InternalLimit));
    bench.run_ms(2000);
    assert!((bench.position() - LIMITS[1]).abs() < 2000, "{}", bench.position() - LIMITS[1]);
    assert!(bench.moves_at(0.0) && bench.has(StatusBit::InternalLimit));
}

#[test]
fn a_quick_stop_and_another_mode_bring_a_velocity_to_rest() {
    for (option, state) in [
        (0, DriveState::SwitchOnDisabled),
        (2, DriveState::SwitchOnDisabled),
        (6, DriveState::QuickStopActive),
    ] {
        let mut bench = Bench::enabled(PROFILE_VELOCITY);
        bench.write((0x605A, 0), &[option, 0]).unwrap();
        bench.ask_speed(100_000);
        bench.run_ms(100);
        bench.control(0x02);
        bench.run_ms(100);
        assert!(bench.moves_at(0.0), "605A = {option}");
        assert_eq!((bench.drive.state(), bench.emergencies()), (state, Vec::new()), "605A = {option}");
    }
    let mut bench = Bench::enabled(PROFILE_VELOCITY);
    bench.ask_speed(100_000);
    bench.run_ms(100);
    bench.write(MODE, &[PROFILE_POSITION as u8]).unwrap();
    bench.run_ms(100);
    assert!(bench.moves_at(0.0) && bench.drive.state() == DriveState::OperationEnabled);
}

#[test]
fn a_stop_from_a_velocity_that_leaves_its_ramp_ends_in_the_brake() {
    let mut bench = Bench::enabled(PROFILE_VELOCITY);
    bench.ask_speed(100_000);
    bench.run_ms(100);
    let from_m = bench.position_m;
    bench.turned_at_m = Some(from_m);
    bench.control(0x02);
    bench.run_ms(50);
    assert!((bench.position_m - from_m).abs() < 2e-3, "{} m", bench.position_m - from_m);
    assert_eq!(
        (bench.drive.state(), bench.emergencies()),
        (DriveState::Fault, vec![EmergencyCode::VELOCITY])
    );
}

/// 605Eh: the brake at once, or a ramp to rest before the drive is in fault.
#[test]
fn a_fault_brings_a_velocity_to_rest_as_object_605e_says() {
    for (option, state) in [(0, DriveState::Fault), (1, DriveState::FaultReactionActive)] {
        let mut bench = Bench::enabled(PROFILE_VELOCITY);
        bench.nmt(NmtCommand::Start);
        bench.write((0x605E, 0), &[option, 0]).unwrap();
        bench.write((0x6007, 0), &[1, 0]).unwrap();
        bench.ask_speed(100_000);
        bench.run_ms(100);
        bench.nmt(NmtCommand::EnterPreOperational);
        bench.run_ms(1);
        assert_eq!(bench.drive.state(), state, "605E = {option}");
        bench.run_ms(100);
        assert!(bench.moves_at(0.0) && bench.drive.state() == DriveState::Fault);
    }
}

/// 10 ‰ of 500 N are 5 N. At 200 ‰/s (6087h) they take 50 ms, and the mass of 0.6 kg stands again then.
#[test]
fn a_profile_torque_is_reached_on_its_slope() {
    let mut bench = Bench::enabled(PROFILE_TORQUE);
    bench.load_n = 2.5;
    bench.write((0x6087, 0), &200_u32.to_le_bytes()).unwrap();
    bench.write(TARGET_TORQUE, &10_i16.to_le_bytes()).unwrap();
    bench.run_ms(25);
    assert!((bench.force_n - 2.5).abs() < 0.05, "{} N", bench.force_n);
    assert!(!bench.has(StatusBit::TargetReached));
    bench.run_ms(30);
    assert!((bench.force_n - 5.0).abs() < 1e-9 && bench.has(StatusBit::TargetReached));
    bench.control(0x10F);
    bench.run_ms(200);
    assert!(bench.moves_at(0.0) && bench.has(StatusBit::TargetReached), "halted");
    bench.write((0x6072, 0), &[5, 0]).unwrap();
    bench.control(0x0F);
    bench.run_ms(100);
    assert!((bench.force_n - 2.5).abs() < 1e-9 && bench.has(StatusBit::InternalLimit));
}

#[test]
fn cyclic_velocities_are_followed_from_sync_to_sync_with_their_offset() {
    let mut bench = Bench::enabled(CYCLIC_VELOCITY);
    for step in 1..=100 {
        bench.ask_speed(step * 1000);
        bench.sync();
        bench.run_ms(1);
    }
    assert!((bench.velocity_m_s - 0.1).abs() < 5e-3, "{}", bench.velocity_m_s);
    assert!(bench.has(StatusBit::TargetFollowed) && !bench.has(StatusBit::InternalLimit));
    bench.ask_speed(0);
    bench.run_ms(20);
    assert!(bench.moves_at(0.1), "a target waits for SYNC");
    bench.write((0x60B1, 0), &20_000_i32.to_le_bytes()).unwrap();
    bench.sync();
    bench.run_ms(20);
    assert!(bench.moves_at(0.02));
}
