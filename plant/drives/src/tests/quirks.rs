//! Each quirk for a client. The other files cover a drive without quirks.

use super::*;
use crate::dictionary::ENTRIES;

fn with(quirk: Quirk) -> DriveSettings {
    DriveSettings { quirks: vec![quirk], ..settings() }
}

/// A drive that has booted with a quirk.
fn bench(quirk: Quirk) -> Bench {
    Bench::with(&with(quirk))
}

#[test]
fn factory_pdos_carry_controlword_and_statusword_alone_and_can_be_mapped() {
    let mut bench = bench(Quirk::FactoryPdos);
    let mut read = |index, subindex| bench.read((index, subindex)).unwrap();
    assert_eq!([read(0x1600, 0), read(0x1600, 1), read(0x1600, 2)], [1, 0x6040_0010, 0]);
    assert_eq!([read(0x1A00, 0), read(0x1A00, 1), read(0x1A00, 2)], [1, 0x6041_0010, 0]);
    for number in 0..4 {
        assert_eq!((read(0x1400 + number, 2), read(0x1800 + number, 2)), (255, 255));
        assert_eq!(read(0x1800 + number, 3), 10);
        let exists = [0x1400, 0x1800].map(|index| read(index + number, 1) >> 31 == 0);
        assert_eq!(exists, [number < 3, number == 0], "PDO {}", number + 1);
    }
    remap(&mut bench, 0x1400, 0x204, &[0x6040_0010, 0x607A_0020]);
    bench.write((0x1400, 2), &[1]).unwrap();
    bench.nmt(NmtCommand::Start);
    bench.receive(command(0x06, START));
    bench.sync();
    assert_eq!(bench.drive.state(), DriveState::ReadyToSwitchOn);
}

#[test]
fn narrow_limits_refuse_a_time_out_and_a_long_period() {
    let mut bench = bench(Quirk::NarrowLimits);
    assert_eq!(bench.write((0x6066, 0), &[20, 0]), Err(AbortCode::TOO_HIGH));
    assert_eq!(bench.write((0x6066, 0), &[0, 0]), Ok(()));
    assert_eq!(bench.write((0x60C2, 1), &[101]), Err(AbortCode::TOO_HIGH));
    assert_eq!(bench.write((0x60C2, 1), &[100]), Ok(()));
}

/// 10 m/s² are 10⁷ increments/s², of which 1 rpm/s is 4096/60.
#[test]
fn accelerations_in_rpm_s_mean_what_they_say() {
    let mut bench = bench(Quirk::AccelerationInRpmS { increments_per_turn: 4096 });
    assert_eq!(bench.read((0x60AA, 0)), Ok(0x00C0_0300));
    assert_eq!((bench.read((0x608F, 1)), bench.read((0x6092, 1))), (Ok(4096), Ok(4096)));
    assert_eq!(bench.write((0x60AA, 0), &0x00B5_5700_u32.to_le_bytes()), Err(AbortCode::TOO_LOW));
    assert_eq!(bench.read((0x6085, 0)), Ok(146_484));
    bench.write(MODE, &[PROFILE_POSITION as u8]).unwrap();
    for ramp in [0x6083, 0x6084] {
        bench.write((ramp, 0), &14_648_u32.to_le_bytes()).unwrap();
    }
    bench.enable();
    bench.set_point(START + 40_000, 0);
    bench.run_ms(50);
    assert!((bench.velocity_m_s - 0.05).abs() < 5e-3, "1 m/s² for 50 ms: {} m/s", bench.velocity_m_s);
}

#[test]
fn the_interpolation_time_counts_in_milliseconds() {
    let mut bench = bench(Quirk::InterpolationInMs);
    assert_eq!(bench.read((0x60C2, 2)), Ok(0xFD));
    assert_eq!(bench.write((0x60C2, 2), &[0xFD]), Err(AbortCode::READ_ONLY));
    assert_eq!(bench.write((0x60C2, 1), &[10]), Ok(()));
}

#[test]
fn missing_objects_do_not_exist_and_the_mode_is_not_supported() {
    let mut bench = bench(Quirk::MissingObjects);
    for index in [0x6007, 0x6066, 0x6085] {
        assert_eq!(bench.read((index, 0)), Err(AbortCode::NO_OBJECT));
        assert_eq!(bench.write((index, 0), &[0, 0]), Err(AbortCode::NO_OBJECT));
    }
    assert_eq!(bench.read((0x6502, 0)).unwrap() >> 7 & 1, 0);
    assert_eq!(bench.write(MODE, &[CYCLIC_POSITION as u8]), Err(AbortCode::INVALID_VALUE));
    assert_eq!(bench.read((0x6061, 0)), Ok(PROFILE_POSITION as u32));
}

#[test]
fn pdos_are_locked_in_operation_alone() {
    let mut bench = bench(Quirk::PdosLockedInOperation);
    assert_eq!(bench.write((0x1400, 5), &[50, 0]), Ok(()));
    bench.nmt(NmtCommand::Start);
    assert_eq!(bench.write((0x1400, 5), &[50, 0]), Err(AbortCode::DEVICE_STATE));
    bench.nmt(NmtCommand::EnterPreOperational);
    assert_eq!(bench.write((0x1400, 5), &[50, 0]), Ok(()));
}

#[test]
fn two_boot_ups_come_before_the_drive_serves() {
    let mut bench = Bench::switched_on(&with(Quirk::TwoBootUps));
    bench.run_ms(25);
    assert_eq!(bench.heartbeats(), [NmtState::BootUp]);
    let upload = SdoRequest::InitiateUpload { object: ObjectAddress::new(0x1000, 0) };
    assert_eq!(bench.ask(upload), None, "the boot loader serves nothing");
    bench.run_ms(20);
    assert_eq!(bench.heartbeats()[..2], [NmtState::BootUp, NmtState::BootUp]);
    assert!(bench.read((0x1000, 0)).is_ok());
}

#[test]
fn a_slow_save_is_lost_by_a_reset_before_its_end() {
    let (window, save) = ((0x6065, 0), (0x1010, 1));
    for (wait_ms, is_kept) in [(2900, false), (3100, true)] {
        let mut bench = bench(Quirk::SlowSave { for_ns: 3 * SECOND_NS });
        let delivered = bench.read(window).unwrap();
        bench.write(window, &777_u32.to_le_bytes()).unwrap();
        bench.write(save, b"save").unwrap();
        let beats = bench.heartbeats().len();
        bench.run_ms(wait_ms);
        assert!(bench.heartbeats().len() > beats + 50, "the heartbeat goes on");
        assert_eq!(bench.read(save), Ok(u32::from(is_kept)));
        assert_eq!(bench.write(save, b"save").is_ok(), is_kept);
        bench.nmt(NmtCommand::ResetNode);
        bench.run_ms(25);
        assert_eq!(bench.read(window), Ok(if is_kept { 777 } else { delivered }));
        assert_eq!(bench.read(save), Ok(1));
    }
}

#[test]
fn targets_count_once_a_slow_brake_is_open_and_the_axis_falls_until_it_is_closed() {
    let mut bench = bench(Quirk::SlowBrake { open_ns: SECOND_NS / 5, close_ns: 3 * SECOND_NS / 10 });
    bench.nmt(NmtCommand::Start);
    for word in [0x06, 0x07, 0x0F] {
        bench.cycle(word, START);
    }
    (0..190).for_each(|_| bench.cycle(0x0F, START + 500));
    assert!((bench.position() - START).abs() <= 30 && !bench.has(StatusBit::TargetFollowed));
    (0..150).for_each(|_| bench.cycle(0x0F, START + 500));
    assert!(bench.is_near(START + 500) && bench.has(StatusBit::TargetFollowed));
    let before_m = bench.position_m;
    bench.control(0x00);
    bench.run_ms(290);
    // Half of 5 N / 0.6 kg times the square of 0.29 s.
    assert!((before_m - bench.position_m - 0.35).abs() < 0.01, "{} m", before_m - bench.position_m);
    bench.run_ms(100);
    assert!(bench.velocity_m_s.abs() < 0.01, "{} m/s", bench.velocity_m_s);
}

#[test]
fn an_axis_without_a_brake_coasts_and_falls() {
    let mut bench = bench(Quirk::NoBrake);
    bench.run_ms(75);
    assert!((START - 41_666 - bench.position()).abs() < 2500, "{}", START - bench.position());
}

#[test]
fn the_home_offset_can_have_the_other_sign_and_the_limits_another_zero() {
    let table = [(Quirk::HomeOffsetSign, 1234, 7234), (Quirk::LimitsFromZero, -1234, 6000)];
    for (quirk, home, end) in table {
        let mut bench = bench(quirk);
        bench.write(MODE, &[HOMING as u8]).unwrap();
        bench.write((0x607C, 0), &1234_i32.to_le_bytes()).unwrap();
        bench.write((0x607D, 1), &(-6000_i32).to_le_bytes()).unwrap();
        bench.write((0x607D, 2), &6000_i32.to_le_bytes()).unwrap();
        bench.enable();
        bench.control(0x1F);
        assert!(bench.is_near(home), "{quirk:?}: {}", bench.position());
        bench.control(0x00);
        bench.write(MODE, &[PROFILE_POSITION as u8]).unwrap();
        bench.enable();
        bench.set_point(100_000, 0);
        bench.run_ms(1000);
        assert!(bench.is_near(end), "{quirk:?}: {}", bench.position());
    }
}

#[test]
fn safe_torque_off_at_power_on_lasts_for_its_time_without_an_abort() {
    for (for_ns, is_over) in [(Some(SECOND_NS / 2), true), (None, false)] {
        let mut bench = bench(Quirk::StoAtPowerOn { for_ns });
        bench.control(0x06);
        bench.run_ms(1);
        assert_eq!(bench.drive.state(), DriveState::SwitchOnDisabled);
        assert_eq!((bench.errors(), bench.emergencies()), ((0, 0), vec![]));
        bench.run_ms(500);
        bench.control(0x06);
        let expected = if is_over { DriveState::ReadyToSwitchOn } else { DriveState::SwitchOnDisabled };
        assert_eq!(bench.drive.state(), expected);
    }
}

#[test]
fn an_incremental_encoder_is_at_0_after_every_start_and_moves_without_limits_until_it_is_homed() {
    let mut bench = bench(Quirk::IncrementalEncoder);
    // The load stretches the brake by 25 µm.
    assert!(bench.position().abs() <= 30 && bench.read((0x6063, 0)) == Ok(bench.position() as u32));
    bench.write(MODE, &[PROFILE_POSITION as u8]).unwrap();
    bench.enable();
    bench.set_point(-3000, 0);
    bench.run_ms(300);
    assert!(bench.is_near(-3000), "{}", bench.position());
    bench.nmt(NmtCommand::ResetNode);
    bench.run_ms(25);
    assert!(bench.position().abs() <= 30, "{}", bench.position());
}

#[test]
fn a_fault_at_power_on_is_shown_and_can_be_reset() {
    let mut bench = bench(Quirk::FaultAtPowerOn { code: 0x7305 });
    assert_eq!(bench.drive.state(), DriveState::Fault);
    assert_eq!((bench.errors().1, bench.emergencies()), (0x7305, vec![EmergencyCode(0x7305)]));
    bench.control(0x80);
    assert_eq!((bench.drive.state(), bench.errors()), (DriveState::SwitchOnDisabled, (0, 0)));
    bench.nmt(NmtCommand::ResetNode);
    bench.run_ms(25);
    assert_eq!(bench.drive.state(), DriveState::Fault, "it is there at every start");
}

#[test]
fn a_drive_that_restarts_does_so_once() {
    let mut bench = bench(Quirk::Restarts { after_ns: SECOND_NS / 2 });
    bench.run_ms(2000);
    let boot_ups = bench.heartbeats().iter().filter(|state| **state == NmtState::BootUp).count();
    assert_eq!(boot_ups, 2);
}

#[test]
fn an_object_that_shows_its_value_acknowledges_every_other_one() {
    let objects = [(0x6065, 0), (0x60FD, 0), (0x60C2, 1)];
    let object = |(index, subindex)| ObjectAddress::new(index, subindex);
    let quirks = objects.map(|at| Quirk::Shows { object: object(at), value: 0x182 });
    let mut bench = Bench::with(&DriveSettings { quirks: quirks.into(), ..settings() });
    assert_eq!(bench.write((0x6065, 0), &777_u32.to_le_bytes()), Ok(()));
    let shown = objects.map(|object| bench.read(object));
    assert_eq!(shown, [Ok(0x182), Ok(0x182), Ok(0x82)], "as many bytes as the object has");
    assert_eq!(bench.write((0x60FD, 0), &[0; 4]), Err(AbortCode::READ_ONLY), "what it refuses, it refuses");
}

#[test]
fn an_object_that_a_drive_lacks_leaves_the_others_of_its_index() {
    let objects = [ObjectAddress::new(0x1018, 4), ObjectAddress::new(0x6007, 0)];
    let quirks = objects.map(|object| Quirk::Lacks { object });
    let mut bench = Bench::with(&DriveSettings { quirks: quirks.into(), ..settings() });
    assert_eq!(bench.read((0x1018, 4)), Err(AbortCode::NO_SUBINDEX));
    assert_eq!(bench.read((0x6007, 0)), Err(AbortCode::NO_OBJECT));
    assert!(bench.read((0x1018, 3)).is_ok());
}

#[test]
fn a_quirk_about_an_object_that_no_drive_has_is_refused_with_the_object() {
    let object = ObjectAddress::new(0x9999, 0);
    for quirk in [Quirk::Lacks { object }, Quirk::Shows { object, value: 1 }] {
        let refusal = DriveNode::new(&with(quirk), 0, 0.27).unwrap_err();
        assert_eq!(refusal, SettingsError::Quirk { object, code: AbortCode::NO_OBJECT });
        assert!(refusal.to_string().starts_with("9999h:00h: "), "{refusal}");
    }
}

#[test]
fn every_quirk_leaves_the_drive_readable() {
    let object = ObjectAddress::new(0x6065, 0);
    let half = SECOND_NS / 2;
    for (quirk, missing) in [
        (Quirk::FactoryPdos, 0),
        (Quirk::NarrowLimits, 0),
        (Quirk::AccelerationInRpmS { increments_per_turn: 4096 }, 0),
        (Quirk::InterpolationInMs, 0),
        (Quirk::MissingObjects, 3),
        (Quirk::PdosLockedInOperation, 0),
        (Quirk::TwoBootUps, 0),
        (Quirk::SlowSave { for_ns: half }, 0),
        (Quirk::SlowBrake { open_ns: half, close_ns: half }, 0),
        (Quirk::NoBrake, 0),
        (Quirk::HomeOffsetSign, 0),
        (Quirk::LimitsFromZero, 0),
        (Quirk::StoAtPowerOn { for_ns: None }, 0),
        (Quirk::IncrementalEncoder, 0),
        (Quirk::SecondEncoder { limit_m: 0.001 }, 0),
        (Quirk::FaultAtPowerOn { code: 0x7305 }, 0),
        (Quirk::Restarts { after_ns: half }, 0),
        (Quirk::IgnoresHeartbeat, 0),
        (Quirk::IgnoresProcessData, 0),
        (Quirk::LateWatchdog { for_ns: half }, 0),
        (Quirk::CoastsWithoutMaster, 0),
        (Quirk::Creeps { speed_m_s: 5e-5 }, 0),
        (Quirk::Shows { object, value: 7 }, 0),
        (Quirk::Lacks { object }, 1),
    ] {
        let mut bench = bench(quirk);
        bench.run_ms(100);
        let readable = ENTRIES.iter().filter(|entry| {
            let object = entry.address;
            !matches!(
                bench.ask(SdoRequest::InitiateUpload { object }),
                None | Some(SdoResponse::Abort { code: AbortCode::NO_OBJECT, .. })
            )
        });
        assert_eq!(readable.count(), ENTRIES.len() - missing, "{quirk:?}");
    }
}
