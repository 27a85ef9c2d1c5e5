use std::path::Path;

use masseter_can::canopen::ObjectAddress;
use masseter_scenario::ObjectRule;

use super::{OFFSETS, *};

fn wanted(text: &str, axis: usize) -> Result<WantedDrive, PlantError> {
    let scenario = Scenario::parse(Path::new("robot.toml"), text).unwrap();
    scenario.validate().unwrap();
    WantedDrive::of_axis(&scenario, axis, NodeId::new(1).unwrap())
}

fn find(wanted: &WantedDrive, index: u16, subindex: u8) -> Option<Setting> {
    let object = ObjectKey(ObjectAddress::new(index, subindex));
    wanted.objects.iter().find(|wanted| wanted.object == object).cloned()
}

/// The drive that takes 10⁷ as rpm/s gets 10 m/s² in rpm/s: with 3 mm a turn 200 000.
#[test]
fn a_profile_decides_units_limits_and_objects() {
    let epos4 = "[[drive_profile]]\nkind = 'epos4'\nunits = { lead_m = 0.003 }";
    let wanted = wanted(epos4, 3).unwrap();
    let value = |index, subindex| find(&wanted, index, subindex).map(|wanted| wanted.value);
    assert_eq!(value(0x6085, 0), Some(200_000));
    assert_eq!(
        (value(0x6066, 0), value(0x60C2, 1), value(0x60C2, 2)),
        (Some(0), Some(1), Some(-3i32 as u32))
    );
    assert_eq!(find(&wanted, 0x60AA, 0).unwrap().rule, ObjectRule::Expect);
    assert_eq!(wanted.identity[3].mask, 0xFFFF_0000);
    assert_eq!((wanted.home.object.0, wanted.home.value), (ObjectAddress::new(0x30B0, 0), 0));
}

#[test]
fn what_a_drive_cannot_take_is_refused_with_the_key_that_decides_it() {
    for (text, refusal) in [
        (
            "objects.6066h = { highest = 0 }",
            "drives.leg.following_error_timeout_ms: object 6066h:00h would be 20",
        ),
        ("objects.6085h = { lowest = 20_000_000 }", "drives.leg.quick_stop_deceleration_m_s2: object 6085h"),
        ("objects.3000h = { value = 1 }", "drive_profile.objects.3000h: enter bytes"),
        (
            "objects.1014h = { value = 128, plus_node_id = true, highest = 132, bytes = 4 }",
            "drive_profile.objects: object 1014h:00h would be 133; the drive takes any to 132",
        ),
        ("objects.'60C2h:02' = { value = -2 }", "rate_hz = 1000: the drive counts its cycle in 10^-2 s"),
    ] {
        let error = wanted(&format!("[[drive_profile]]\n{text}"), 4).unwrap_err().to_string();
        assert!(error.starts_with(refusal), "{error}");
    }
}

#[test]
fn a_value_may_follow_from_the_node_id_or_have_three_bytes() {
    let text = "[[drive_profile]]\nobjects.1014h = { value = 128, plus_node_id = true, bytes = 4 }\n\
                objects.2000h = { value = -5, bytes = 3 }";
    for (axis, cob_id) in [(0, 0x81), (4, 0x85)] {
        assert_eq!(find(&wanted(text, axis).unwrap(), 0x1014, 0).unwrap().value, cob_id);
    }
    let small = find(&wanted(text, 0).unwrap(), 0x2000, 0).unwrap();
    assert!(small.is_shown_by(0xFF_FFFB) && !small.is_shown_by(0xFF_FFFC));
}

#[test]
fn an_absent_object_is_left_and_an_optional_one_may_be_refused() {
    let text =
        "[[drive_profile]]\nobjects.6007h = { rule = 'absent' }\nobjects.6065h = { rule = 'optional' }";
    let wanted = wanted(text, 0).unwrap();
    assert_eq!(find(&wanted, 0x6007, 0), None);
    assert_eq!(find(&wanted, 0x6065, 0).unwrap().rule, ObjectRule::Optional);
    assert_eq!(find(&wanted, 0x1400, 5).unwrap().rule, ObjectRule::Optional);
}

/// A drive keeps the last force of process data that no longer carry the force.
#[test]
fn offsets_are_0_unless_they_are_process_data() {
    let offset = |text: &str, index| {
        let wanted = wanted(&format!("[[drive_profile]]\n{text}"), 3).unwrap();
        find(&wanted, index, 0).map(|wanted| (wanted.value, wanted.bytes, wanted.rule))
    };
    assert_eq!(offset("", 0x60B2), Some((0, 2, ObjectRule::Optional)));
    assert_eq!(offset("", 0x60B1), None, "no process data of the rig carry it");
    assert_eq!(offset("objects.60B2h = { rule = 'absent' }", 0x60B2), None);
    for kind in ["kind = 'epos4'\nunits = { lead_m = 0.003 }", "kind = 'n5'"] {
        for (index, bytes) in OFFSETS {
            assert_eq!(offset(kind, index), Some((0, bytes, ObjectRule::Optional)), "{kind}");
        }
    }
    let mapped = "kind = 'n5'\npdos.rpdo1 = ['6040h', '607Ah', '60B2h']";
    assert_eq!(offset(mapped, 0x60B2), None);
    assert!(offset(mapped, 0x60B1).is_some());
    assert_eq!(offset("objects.60B2h = { value = 5 }", 0x60B2), Some((5, 2, ObjectRule::Write)));
}

/// A leg of 0.2 m at home whose limits count from there, and the same on a drive that counts the other way.
#[test]
fn software_limits_count_from_home_and_ascend_on_a_reversed_axis() {
    let limits = |text: &str| {
        let wanted = wanted(&format!("[[drive_profile]]\n{text}"), 3).unwrap();
        let limit = |subindex| find(&wanted, 0x607D, subindex).unwrap().value as i32;
        ([limit(1), limit(2)], wanted.home.value as i32)
    };
    let ([low, high], _) = limits("");
    let moved = [low - 200_000, high - 200_000];
    assert_eq!(limits("homing.home_position_m = 0.2"), (moved, -200_000));
    assert_eq!(
        limits("homing = { home_position_m = 0.2, limits_from_home = false, home_sign = 1 }"),
        ([low, high], 200_000)
    );
    let back = moved.map(|end: i32| -end);
    assert_eq!(limits("homing.home_position_m = 0.2\nreversed = ['l1']"), ([back[1], back[0]], 200_000));
}

#[test]
fn process_data_may_be_silent_as_long_as_commands_or_the_heartbeat() {
    let timeout_ms = |rate_hz, configured| {
        let mut scenario = Scenario { rate_hz, ..Scenario::default() };
        scenario.can.rpdo_timeout_ms = configured;
        rpdo_timeout_ms(&scenario)
    };
    assert_eq!(timeout_ms(100, None), 200, "20 cycles");
    assert_eq!(timeout_ms(1000, None), Scenario::default().can.heartbeat_consumer_ms);
    assert_eq!(timeout_ms(1000, Some(0)), 0);
}
