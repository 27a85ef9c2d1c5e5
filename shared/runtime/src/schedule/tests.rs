use super::*;

fn scenario(can: CanConfig, rate_hz: u32) -> Scenario {
    Scenario { rate_hz, can, ..Scenario::default() }
}

/// RPDO1 of eight bytes: three frames of 20 µs more on each bus.
#[test]
fn a_torque_offset_lengthens_the_frames_and_the_command_is_due_earlier() {
    let with_offset = |axes: &str, rate_hz| {
        let pdos = "pdos.rpdo1 = ['6040h', '607Ah', '60B2h']";
        let text = format!("rate_hz = {rate_hz}\n[[drive_profile]]\naxes = [{axes}]\n{pdos}");
        Scenario::parse(std::path::Path::new("robot.toml"), &text).unwrap()
    };
    let command_by_ns = |axes| CycleSchedule::new(&with_offset(axes, 500)).unwrap().command_by_ns;
    let [none, one, all] = ["", "'l1'", "'d1', 'd2', 'd3', 'l1', 'l2', 'l3'"].map(command_by_ns);
    assert_eq!([none - one, none - all], [20_000, 60_000], "the busiest bus counts");
    let cycle_ns = |axes| plans(&with_offset(axes, 500)).unwrap().last().unwrap().cycle_time_ns();
    assert_eq!(cycle_ns("'l1'") - cycle_ns(""), 20_000);
    let refusal = CycleSchedule::new(&with_offset("'l1', 'l2', 'l3'", 1000)).unwrap_err().to_string();
    assert!(refusal.ends_with("the highest rate_hz that fits is 970"), "{refusal}");
}

#[test]
fn two_buses_hold_a_kilohertz_and_the_offsets_follow_the_frames() {
    let schedule = CycleSchedule::new(&Scenario::default()).unwrap();
    assert_eq!(schedule.reading_from_ns, (47 + 3 * 111 - 3) * 1000);
    assert_eq!(schedule.reading_by_ns, (65 + 55 + 3 * 135) * 1000);
    assert_eq!(schedule.controller_at_ns, schedule.reading_by_ns + PUBLISH_NS);
    assert_eq!(schedule.command_by_ns, 1_000_000 - (65 + 3 * 115) * 1000);
}

#[test]
fn drives_that_take_time_to_answer_delay_the_reading() {
    let slow = CanConfig { answer_us: 300, ..Default::default() };
    let [at_once, late] = [CanConfig::default(), slow]
        .map(|can| CycleSchedule::new(&scenario(can, 500)).unwrap().reading_by_ns);
    assert_eq!(late, at_once + 300_000 + 65_000, "meanwhile another heartbeat may begin");
}

#[test]
fn a_drive_booted_beside_running_ones_keeps_to_the_offsets() {
    let bits = |length| worst_case_bits(length, false);
    for axes in 1..=6 {
        let [sdo, heartbeat] = [SDO_LENGTH, HEARTBEAT_LENGTH].map(bits);
        let [tpdo, rpdo] = [PdoMapping::TPDO1, PdoMapping::RPDO1].map(|mapping| bits(pdo_bytes(&mapping)));
        assert!(sdo + (axes - 1) * tpdo <= heartbeat + axes * tpdo);
        assert!(sdo + (axes - 1) * rpdo <= heartbeat + axes * rpdo);
    }
    for plan in plans_of(&Scenario::default(), 1_000_000, Drives::OneBoots).unwrap() {
        assert_eq!(plan.check(), Ok(()));
    }
}

/// The booting drive sends no process data: in the worst case the longer frames stay.
#[test]
fn the_drive_with_the_shortest_process_data_boots() {
    let text = "rate_hz = 500\n[[drive_profile]]\naxes = ['l1']\npdos.rpdo1 = ['6040h', '607Ah', '60B2h']";
    let scenario = Scenario::parse(std::path::Path::new("robot.toml"), text).unwrap();
    let plan = plans_of(&scenario, 2_000_000, Drives::OneBoots).unwrap().pop().unwrap();
    let has = |name: &str| plan.messages.iter().any(|planned| planned.message.name == name);
    assert_eq!(["RPDO1 4", "RPDO1 5", "SDO request 5"].map(has), [true, false, true]);
}

#[test]
fn one_bus_at_a_kilohertz_is_refused_with_the_arithmetic() {
    let one = CanConfig { buses: vec![vec![0, 1, 2, 3, 4, 5]], ..Default::default() };
    let error = CycleSchedule::new(&scenario(one.clone(), 1000)).unwrap_err().to_string();
    assert!(error.contains("takes 1555.0 µs at worst;") && error.contains("too late"), "{error}");
    assert!(CycleSchedule::new(&scenario(one, 250)).is_ok());
}

#[test]
fn an_ideal_bus_holds_twenty_kilohertz() {
    let ideal = CanConfig { ideal: true, ..Default::default() };
    let schedule = CycleSchedule::new(&scenario(ideal, 20_000)).unwrap();
    assert!(schedule.reading_by_ns < 1000 && schedule.command_by_ns > 49_000, "{schedule:?}");
}

#[test]
fn the_last_process_data_of_a_cycle_wait_for_all_others_and_a_heartbeat() {
    let plans = plans(&Scenario::default()).unwrap();
    let last = Cob::Rpdo1(NodeId::new(3).unwrap()).into();
    let last = plans[0].messages.iter().find(|planned| planned.message.id == last).unwrap();
    assert_eq!(last.response_ns, Some((65 + 55 + 3 * 135 + 3 * 115) * 1000));
}

#[test]
fn a_cycle_without_time_for_the_controller_is_refused() {
    let error = CycleSchedule::new(&scenario(CanConfig::default(), 1041)).unwrap_err();
    assert!(matches!(error, ScheduleError::Misfit { misfit: Misfit::NoTime { .. }, .. }), "{error}");
}

#[test]
fn the_highest_rate_is_one_that_fits_and_the_next_does_not() {
    let one_bus = vec![vec![0, 1, 2, 3, 4, 5]];
    for can in [
        CanConfig::default(),
        CanConfig { answer_us: 10, ..Default::default() },
        CanConfig { buses: one_bus, ..Default::default() },
    ] {
        let highest_hz = Room::for_link(&scenario(can.clone(), 1000)).unwrap().max_rate_hz.unwrap();
        let fits = |rate_hz: u32| CycleSchedule::new(&scenario(can.clone(), rate_hz)).is_ok();
        assert!(fits(highest_hz) && !fits(highest_hz + 1), "{highest_hz} Hz: {can:?}");
    }
    let ideal = CanConfig { ideal: true, ..Default::default() };
    assert_eq!(Room::for_link(&scenario(ideal, 1000)).unwrap().max_rate_hz, Some(*RATES_HZ.end()));
}

#[test]
fn a_refusal_names_the_highest_rate_and_the_answer_time_of_slow_drives() {
    let slow = CanConfig { answer_us: 10, ..Default::default() };
    let refusal = |can, rate_hz| CycleSchedule::new(&scenario(can, rate_hz)).unwrap_err().to_string();
    let said = refusal(slow, 1000);
    assert!(
        said.ends_with(
            "the highest rate_hz that fits is 956, since can.answer_us takes 75 µs of every cycle"
        ),
        "{said}"
    );
    let said = refusal(CanConfig::default(), 1250);
    assert!(said.ends_with("the highest rate_hz that fits is 1030"), "{said}");
}
