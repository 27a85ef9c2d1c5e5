//! Each quirk for a client. The other files cover a drive without quirks.

use masseter_can::canopen::{
    AbortCode, EmergencyCode, NmtCommand, NmtState, ObjectAddress, SdoRequest, SdoResponse,
};
use masseter_can::cia402::{DriveState, StatusBit};

use super::*;
use crate::simulator::drive::dictionary::ENTRIES;
use crate::simulator::drive::tests::{
    Bench, CYCLIC_POSITION, HOMING, LIMITS, MODE, PROFILE_POSITION, START, STEP_NS, command, remap,
};

/// The drive of l1, with limits that leave it more room than the default, and with the scenario's quirks.
fn settings(quirks: &str) -> DriveSettings {
    let mut scenario = Scenario::parse(Path::new("quirks.toml"), quirks).unwrap();
    scenario.validate().unwrap();
    scenario.dynamics.step_ns = STEP_NS;
    scenario.mechanism.strokes.leg_m = LIMITS.map(|end| f64::from(end) * 1e-6);
    let [_, _, _, leg, ..] = drive_settings(&scenario).unwrap();
    leg
}

/// The drive of l1 equals the drive of the drive's own tests.
#[test]
fn the_settings_without_quirks_are_those_of_the_drives_own_tests() {
    use crate::simulator::drive::tests;
    let (of_scenario, plain) = (settings(""), tests::settings());
    assert_eq!(
        (of_scenario.node, of_scenario.step_s, of_scenario.stroke_m),
        (plain.node, plain.step_s, plain.stroke_m)
    );
    assert_eq!(of_scenario.quirks.axis, plain.quirks.axis);
    assert_eq!(format!("{:?}", of_scenario.drive), format!("{:?}", plain.drive));
    let differing = ENTRIES.iter().zip(of_scenario.objects.words).zip(plain.objects.words);
    let differing = differing.filter(|((_, a), b)| a != b).map(|((entry, _), _)| entry.address.index);
    assert!(differing.clone().all(|index| index == 0x1018), "{:?}", differing.collect::<Vec<_>>());
}

/// A drive that has booted with a quirk.
fn bench(quirk: &str) -> Bench {
    Bench::with(&settings(&format!("[[drives.quirk]]\n{quirk}")))
}

#[test]
fn factory_pdos_carry_controlword_and_statusword_alone_and_can_be_mapped() {
    let mut bench = bench("kind = 'factory_pdos'");
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
    assert_eq!(bench.drive.axis.power.state, DriveState::ReadyToSwitchOn);
}

#[test]
fn narrow_limits_refuse_a_time_out_and_a_long_period() {
    let mut bench = bench("kind = 'narrow_limits'");
    assert_eq!(bench.write((0x6066, 0), &[20, 0]), Err(AbortCode::TOO_HIGH));
    assert_eq!(bench.write((0x6066, 0), &[0, 0]), Ok(()));
    assert_eq!(bench.write((0x60C2, 1), &[101]), Err(AbortCode::TOO_HIGH));
    assert_eq!(bench.write((0x60C2, 1), &[100]), Ok(()));
}

/// 10 m/s² are 10⁷ increments/s², of which 1 rpm/s is 4096/60.
#[test]
fn accelerations_in_rpm_s_mean_what_they_say() {
    let mut bench = bench("kind = 'acceleration_in_rpm_s'\nincrements_per_turn = 4096");
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
    let mut bench = bench("kind = 'interpolation_in_ms'");
    assert_eq!(bench.read((0x60C2, 2)), Ok(0xFD));
    assert_eq!(bench.write((0x60C2, 2), &[0xFD]), Err(AbortCode::READ_ONLY));
    assert_eq!(bench.write((0x60C2, 1), &[10]), Ok(()));
}

#[test]
fn missing_objects_do_not_exist_and_the_mode_is_not_supported() {
    let mut bench = bench("kind = 'missing_objects'");
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
    let mut bench = bench("kind = 'pdos_locked_in_operation'");
    assert_eq!(bench.write((0x1400, 5), &[50, 0]), Ok(()));
    bench.nmt(NmtCommand::Start);
    assert_eq!(bench.write((0x1400, 5), &[50, 0]), Err(AbortCode::DEVICE_STATE));
    bench.nmt(NmtCommand::EnterPreOperational);
    assert_eq!(bench.write((0x1400, 5), &[50, 0]), Ok(()));
}

#[test]
fn two_boot_ups_come_before_the_drive_serves() {
    let mut bench = Bench::switched_on(&settings("[[drives.quirk]]\nkind = 'two_boot_ups'"));
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
        let mut bench = bench("kind = 'slow_save'\nfor_s = 3.0");
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
    let quirk = "[[drives.quirk]]\nkind = 'slow_brake'\nopen_s = 0.2\nclose_s = 0.3";
    let mut bench = Bench::with(&settings(quirk));
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
    let mut bench = bench("kind = 'no_brake'");
    bench.run_ms(75);
    assert!((START - 41_666 - bench.position()).abs() < 2500, "{}", START - bench.position());
}

#[test]
fn the_home_offset_can_have_the_other_sign_and_the_limits_another_zero() {
    let table = [("home_offset_sign", 1234, 7234), ("limits_from_zero", -1234, 6000)];
    for (kind, home, end) in table {
        let mut bench = bench(&format!("kind = '{kind}'"));
        bench.write(MODE, &[HOMING as u8]).unwrap();
        bench.write((0x607C, 0), &1234_i32.to_le_bytes()).unwrap();
        bench.write((0x607D, 1), &(-6000_i32).to_le_bytes()).unwrap();
        bench.write((0x607D, 2), &6000_i32.to_le_bytes()).unwrap();
        bench.enable();
        bench.control(0x1F);
        assert!(bench.is_near(home), "{kind}: {}", bench.position());
        bench.control(0x00);
        bench.write(MODE, &[PROFILE_POSITION as u8]).unwrap();
        bench.enable();
        bench.set_point(100_000, 0);
        bench.run_ms(1000);
        assert!(bench.is_near(end), "{kind}: {}", bench.position());
    }
}

#[test]
fn safe_torque_off_at_power_on_lasts_for_its_time_without_an_abort() {
    for (keys, is_over) in [("for_s = 0.5", true), ("", false)] {
        let mut bench = bench(&format!("kind = 'sto_at_power_on'\n{keys}"));
        bench.control(0x06);
        bench.run_ms(1);
        assert_eq!(bench.drive.axis.power.state, DriveState::SwitchOnDisabled);
        assert_eq!((bench.errors(), bench.emergencies()), ((0, 0), vec![]));
        bench.run_ms(500);
        bench.control(0x06);
        let expected = if is_over { DriveState::ReadyToSwitchOn } else { DriveState::SwitchOnDisabled };
        assert_eq!(bench.drive.axis.power.state, expected);
    }
}

#[test]
fn an_incremental_encoder_is_at_0_after_every_start_and_moves_without_limits_until_it_is_homed() {
    let mut bench = bench("kind = 'incremental_encoder'");
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
    let mut bench = bench("kind = 'fault_at_power_on'\ncode = 0x7305");
    assert_eq!(bench.drive.axis.power.state, DriveState::Fault);
    assert_eq!((bench.errors().1, bench.emergencies()), (0x7305, vec![EmergencyCode(0x7305)]));
    bench.control(0x80);
    assert_eq!((bench.drive.axis.power.state, bench.errors()), (DriveState::SwitchOnDisabled, (0, 0)));
    bench.nmt(NmtCommand::ResetNode);
    bench.run_ms(25);
    assert_eq!(bench.drive.axis.power.state, DriveState::Fault, "it is there at every start");
}

#[test]
fn a_drive_that_restarts_does_so_once() {
    let mut bench = bench("kind = 'restarts'\nafter_s = 0.5");
    bench.run_ms(2000);
    let boot_ups = bench.heartbeats().iter().filter(|state| **state == NmtState::BootUp).count();
    assert_eq!(boot_ups, 2);
}

#[test]
fn an_object_that_shows_its_value_acknowledges_every_other_one() {
    let mut bench = bench("kind = 'shows'\nobjects = ['6065h', '60FDh', '60C2h:01']\nvalue = 0x182");
    assert_eq!(bench.write((0x6065, 0), &777_u32.to_le_bytes()), Ok(()));
    let shown = [(0x6065, 0), (0x60FD, 0), (0x60C2, 1)].map(|object| bench.read(object));
    assert_eq!(shown, [Ok(0x182), Ok(0x182), Ok(0x82)], "as many bytes as the object has");
    assert_eq!(bench.write((0x60FD, 0), &[0; 4]), Err(AbortCode::READ_ONLY), "what it refuses, it refuses");
}

#[test]
fn an_object_that_a_drive_lacks_leaves_the_others_of_its_index() {
    let mut bench = bench("kind = 'lacks'\nobjects = ['1018h:04', '6007h']");
    assert_eq!(bench.read((0x1018, 4)), Err(AbortCode::NO_SUBINDEX));
    assert_eq!(bench.read((0x6007, 0)), Err(AbortCode::NO_OBJECT));
    assert!(bench.read((0x1018, 3)).is_ok());
}

#[test]
fn an_object_that_no_emulated_drive_has_is_refused_with_the_key() {
    let text = "[[drives.quirk]]\nkind = 'lacks'\nobjects = ['9999h']";
    let scenario = Scenario::parse(Path::new("s.toml"), text).unwrap();
    let refusal = drive_settings(&scenario).unwrap_err().to_string();
    assert!(refusal.starts_with("drives.quirk.objects: 9999h:00h: "), "{refusal}");
}

#[test]
fn a_quirk_is_on_its_axes_alone() {
    let mut bench = bench("kind = 'missing_objects'\naxes = ['l2', 'd1']");
    assert!(bench.read((0x6066, 0)).is_ok(), "this is l1");
}

#[test]
fn every_kind_leaves_the_drive_readable() {
    use masseter_scenario::QuirkKindConfig;
    for kind in QuirkKindConfig::ALL {
        let value = |key: &&str| match *key {
            "increments_per_turn" => "increments_per_turn = 4096\n".to_owned(),
            "code" => "code = 0x7305\n".to_owned(),
            "objects" => "objects = ['6065h']\n".to_owned(),
            "value" => "value = 7\n".to_owned(),
            "limit_m" => "limit_m = 0.001\n".to_owned(),
            "speed_m_s" => "speed_m_s = 5e-5\n".to_owned(),
            time => format!("{time} = 0.5\n"),
        };
        let axes = if *kind == QuirkKindConfig::SwappedIds { "axes = ['d1', 'd2']\n" } else { "" };
        let mut bench = bench(&format!(
            "kind = '{kind}'\n{axes}{}",
            kind.keys().concat().iter().map(value).collect::<String>()
        ));
        bench.run_ms(100);
        let readable = ENTRIES.iter().filter(|entry| {
            let object = entry.address;
            !matches!(
                bench.ask(SdoRequest::InitiateUpload { object }),
                None | Some(SdoResponse::Abort { code: AbortCode::NO_OBJECT, .. })
            )
        });
        let missing = match kind {
            QuirkKindConfig::MissingObjects => 3,
            QuirkKindConfig::Lacks => 1,
            _ => 0,
        };
        assert_eq!(readable.count(), ENTRIES.len() - missing, "{kind}");
    }
}
