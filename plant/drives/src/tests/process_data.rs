//! PDOs: mapping, transmission types, SYNC.

use super::*;

#[test]
fn the_mapping_after_power_on_is_the_masters() {
    let mut bench = Bench::operational();
    let [frame] = bench.sync()[..] else { panic!("one TPDO") };
    let position = bench.position().to_le_bytes();
    assert_eq!(frame.id().number(), 0x184);
    assert_eq!(frame.data()[..6], [0x50, 0x02, position[0], position[1], position[2], position[3]]);
    assert_eq!(frame.data().len(), 8, "statusword, position and torque");
}

#[test]
fn a_remapped_pdo_carries_its_new_objects_at_the_next_sync() {
    let mut bench = Bench::operational();
    remap(&mut bench, 0x1800, 0x4000_0184, &[0x6061_0008, 0x603F_0010]);
    let [frame] = bench.sync()[..] else { panic!("one TPDO") };
    assert_eq!(frame.to_string(), "184#080000");
    remap(&mut bench, 0x1400, 0x0000_0310, &[0x6060_0008]);
    bench.receive(pdo(0x310, &[10]));
    let [frame] = bench.sync()[..] else { panic!("one TPDO") };
    assert_eq!(frame.to_string(), "184#0A0000", "the mode was received under its new identifier");
}

#[test]
fn a_reset_brings_the_first_mapping_back() {
    let mut bench = Bench::operational();
    remap(&mut bench, 0x1800, 0x4000_0184, &[0x6061_0008]);
    bench.nmt(NmtCommand::ResetNode);
    bench.run_ms(25);
    bench.nmt(NmtCommand::Start);
    assert_eq!(bench.sync()[0].data().len(), 8);
}

#[test]
fn a_synchronous_pdo_takes_effect_at_sync_and_the_newest_counts() {
    let mut bench = Bench::operational();
    bench.receive(pdo(0x204, &[0x07, 0, 0, 0, 0, 0]));
    bench.receive(pdo(0x204, &[0x06, 0, 0, 0, 0, 0]));
    bench.run_ms(1);
    assert_eq!(bench.drive.state(), DriveState::SwitchOnDisabled);
    bench.sync();
    assert_eq!(bench.drive.state(), DriveState::ReadyToSwitchOn);
}

#[test]
fn an_event_driven_pdo_takes_effect_at_once() {
    let mut bench = Bench::operational();
    bench.write((0x1400, 2), &[255]).unwrap();
    bench.receive(pdo(0x204, &[0x06, 0, 0, 0, 0, 0]));
    assert_eq!(bench.drive.state(), DriveState::ReadyToSwitchOn);
}

#[test]
fn transmission_types_say_at_which_sync() {
    let sends = |kind: u8| {
        let mut bench = Bench::operational();
        bench.write((0x1800, 2), &[kind]).unwrap();
        [(); 7].map(|()| bench.sync().len())
    };
    assert_eq!(sends(1), [1; 7]);
    assert_eq!(sends(3), [1, 0, 0, 1, 0, 0, 1]);
    assert_eq!(sends(0), [1, 0, 0, 0, 0, 0, 0], "nothing changes at standstill");
    assert_eq!(sends(255), [0; 7]);
}

#[test]
fn a_sync_counter_chooses_the_first_sync() {
    let mut bench = Bench::new();
    bench.write((0x1019, 0), &[4]).unwrap();
    bench.write((0x1800, 1), &0xC000_0184_u32.to_le_bytes()).unwrap();
    bench.write((0x1800, 2), &[4]).unwrap();
    bench.write((0x1800, 6), &[3]).unwrap();
    bench.write((0x1800, 1), &0x4000_0184_u32.to_le_bytes()).unwrap();
    bench.nmt(NmtCommand::Start);
    let answers = [1, 2, 3, 4, 1, 2, 3, 4].map(|counter| {
        let before = bench.sent.len();
        bench.receive(pdo(0x080, &[counter]));
        bench.sent.len() - before
    });
    assert_eq!(answers, [0, 0, 1, 0, 0, 0, 1, 0]);
    bench.sync();
    assert_eq!(bench.emergencies(), [EmergencyCode::SYNC_LENGTH], "the counter is missing");
}

#[test]
fn an_event_driven_tpdo_is_sent_at_a_change_no_more_often_than_allowed() {
    let mut bench = Bench::inhibited_for_5_ms(20);
    assert_eq!(bench.tpdos_within(61), 4, "at first, and every 20 ms");
    bench.write(MODE, &[10]).unwrap();
    assert_eq!(bench.tpdos_within(3), 0, "inhibited for 5 ms");
    assert_eq!(bench.tpdos_within(3), 1);
}

#[test]
fn an_event_timer_waits_for_the_end_of_the_inhibit_time() {
    let mut bench = Bench::inhibited_for_5_ms(2);
    assert_eq!(bench.tpdos_within(51), 11, "at first, and every 5 ms");
}

impl Bench {
    /// Operational, with an event-driven TPDO of that event timer.
    fn inhibited_for_5_ms(timer_ms: u16) -> Self {
        let mut bench = Self::operational();
        remap(&mut bench, 0x1800, 0xC000_0184, &[]);
        bench.write((0x1A00, 1), &0x6061_0008_u32.to_le_bytes()).unwrap();
        bench.write((0x1A00, 0), &[1]).unwrap();
        bench.write((0x1800, 2), &[255]).unwrap();
        bench.write((0x1800, 3), &50_u16.to_le_bytes()).unwrap();
        bench.write((0x1800, 5), &timer_ms.to_le_bytes()).unwrap();
        bench.write((0x1800, 1), &0x4000_0184_u32.to_le_bytes()).unwrap();
        bench
    }

    /// How often the first TPDO is sent in the milliseconds that follow.
    fn tpdos_within(&mut self, ms: u64) -> usize {
        self.sent.clear();
        self.run_ms(ms);
        self.sent.iter().filter(|frame| frame.id().number() == 0x184).count()
    }
}

#[test]
fn a_measured_value_is_sent_by_the_event_timer_and_not_at_every_change() {
    let mut bench = Bench::enabled(10);
    bench.write((0x1800, 1), &0xC000_0184_u32.to_le_bytes()).unwrap();
    bench.write((0x1800, 2), &[255]).unwrap();
    bench.write((0x1800, 5), &20_u16.to_le_bytes()).unwrap();
    bench.write((0x1800, 1), &0x4000_0184_u32.to_le_bytes()).unwrap();
    bench.nmt(NmtCommand::Start);
    bench.write((0x6071, 0), &50_u16.to_le_bytes()).unwrap();
    bench.sync();
    bench.run_ms(20);
    assert!(bench.velocity_m_s > 0.05);
    bench.sent.clear();
    bench.run_ms(100);
    let sent: Vec<_> = bench.sent.iter().filter(|frame| frame.id().number() == 0x184).copied().collect();
    assert_eq!(sent.len(), 5);
    let positions = sent.windows(2).map(|two| [two[0].data()[2..6].to_vec(), two[1].data()[2..6].to_vec()]);
    assert!(positions.into_iter().all(|[before, after]| before != after), "each carries the newest value");
    bench.sent.clear();
    bench.control(0x02);
    bench.run_ms(1);
    assert!(bench.sent.iter().any(|frame| frame.id().number() == 0x184), "a new state is an event");
}

#[test]
fn process_data_of_a_wrong_length_are_reported_and_short_ones_not_used() {
    let mut bench = Bench::operational();
    bench.receive(pdo(0x204, &[0x06, 0]));
    bench.sync();
    assert_eq!(bench.drive.state(), DriveState::SwitchOnDisabled);
    bench.receive(pdo(0x204, &[0x06, 0, 0, 0, 0, 0, 0]));
    bench.sync();
    assert_eq!(bench.drive.state(), DriveState::ReadyToSwitchOn);
    assert_eq!(bench.emergencies(), [EmergencyCode::PDO_LENGTH, EmergencyCode::PDO_LENGTH_EXCEEDED]);
}

#[test]
fn process_data_that_stay_away_are_reported_once() {
    let mut bench = Bench::operational();
    bench.write((0x1400, 5), &10_u16.to_le_bytes()).unwrap();
    bench.run_ms(50);
    assert_eq!(bench.emergencies(), [], "the timer begins with the first frame");
    bench.receive(pdo(0x204, &[0; 6]));
    bench.run_ms(50);
    assert_eq!(bench.emergencies(), [EmergencyCode::RPDO_TIMEOUT]);
    bench.receive(pdo(0x204, &[0; 6]));
    assert_eq!(bench.emergencies(), [EmergencyCode::RPDO_TIMEOUT, EmergencyCode::RESET]);
}

/// An operational drive with a second RPDO, 304h with the mode of operation.
fn with_two_rpdos() -> Bench {
    let mut bench = Bench::operational();
    remap(&mut bench, 0x1401, 0x304, &[0x6060_0008]);
    bench
}

#[test]
fn an_error_of_process_data_lasts_until_no_pdo_has_it() {
    let mut bench = with_two_rpdos();
    for _ in 0..10 {
        bench.receive(pdo(0x204, &[0; 2]));
        bench.receive(pdo(0x304, &[8]));
    }
    assert_eq!(bench.emergencies(), [EmergencyCode::PDO_LENGTH]);
    bench.receive(pdo(0x304, &[]));
    bench.receive(pdo(0x204, &[0; 6]));
    assert_eq!(bench.emergencies(), [EmergencyCode::PDO_LENGTH], "the other one is too short now");
    bench.receive(pdo(0x304, &[8]));
    assert_eq!(bench.emergencies(), [EmergencyCode::PDO_LENGTH, EmergencyCode::RESET]);
}

#[test]
fn a_pdo_that_stays_away_is_missed_while_another_comes() {
    let mut bench = with_two_rpdos();
    bench.write((0x1400, 5), &10_u16.to_le_bytes()).unwrap();
    bench.receive(pdo(0x204, &[0; 6]));
    for _ in 0..30 {
        bench.receive(pdo(0x304, &[8]));
        bench.run_ms(1);
    }
    assert_eq!(bench.emergencies(), [EmergencyCode::RPDO_TIMEOUT]);
    assert_eq!(bench.errors(), (0x11, 0x8250));
    bench.receive(pdo(0x204, &[0; 7]));
    assert_eq!(bench.errors(), (0x11, 0x8220), "too long, but it is there again");
}

#[test]
fn the_error_of_a_pdo_goes_with_the_pdo() {
    let mut bench = with_two_rpdos();
    bench.receive(pdo(0x304, &[]));
    bench.write((0x1401, 1), &0x8000_0304_u32.to_le_bytes()).unwrap();
    assert_eq!(bench.emergencies(), [EmergencyCode::PDO_LENGTH, EmergencyCode::RESET]);
}

#[test]
fn a_value_beyond_its_limits_in_process_data_leaves_its_object_alone() {
    let mut bench = Bench::operational();
    remap(&mut bench, 0x1401, 0x304, &[0x6081_0020]);
    let before = bench.read((0x6081, 0));
    bench.receive(pdo(0x304, &[0; 4]));
    bench.sync();
    assert_eq!(bench.read((0x6081, 0)), before);
}
