//! Network management, heartbeats, emergencies.

use super::*;

/// 6007h, and the state in which it leaves an enabled drive that nobody controls any more.
const LINK_REACTIONS: [(u16, DriveState); 4] = [
    (0, DriveState::OperationEnabled),
    (1, DriveState::Fault),
    (2, DriveState::SwitchOnDisabled),
    (3, DriveState::SwitchOnDisabled),
];

#[test]
fn a_node_boots_up_once_and_then_reports_its_state() {
    let mut bench = Bench::new();
    assert_eq!(bench.heartbeats(), [NmtState::BootUp]);
    bench.run_ms(100);
    bench.nmt(NmtCommand::Start);
    bench.run_ms(50);
    bench.nmt(NmtCommand::Stop);
    bench.run_ms(50);
    let beats = bench.heartbeats();
    assert_eq!(
        beats[1..],
        [NmtState::PreOperational, NmtState::PreOperational, NmtState::Operational, NmtState::Stopped]
    );
}

#[test]
fn the_heartbeat_is_produced_as_object_1017_says() {
    let mut bench = Bench::new();
    bench.write((0x1017, 0), &10_u16.to_le_bytes()).unwrap();
    bench.sent.clear();
    bench.run_ms(100);
    assert_eq!(bench.heartbeats().len(), 10);
    bench.write((0x1017, 0), &[0, 0]).unwrap();
    bench.sent.clear();
    bench.run_ms(100);
    assert_eq!(bench.heartbeats(), []);
}

/// As on real wires, when the machine held the drives up.
#[test]
fn heartbeats_missed_while_the_drive_was_stalled_are_skipped() {
    let mut bench = Bench::operational();
    bench.run_ms(100);
    bench.sent.clear();
    bench.now_ns += 470_000_000;
    bench.run_ms(1);
    assert_eq!(bench.heartbeats().len(), 1, "no burst");
    // Each waits a while for a SYNC.
    bench.run_ms(100);
    assert_eq!(bench.heartbeats().len(), 3, "and then as ever");
}

/// The beat is due at various times of the cycle.
#[test]
fn a_heartbeat_follows_the_process_data_of_its_cycle() {
    let beat = Cob::Heartbeat(id(4)).into();
    for early_steps in 0..STEPS_PER_MS {
        let mut bench = Bench::operational();
        bench.write((0x1800, 2), &[1]).unwrap();
        bench.run_steps(early_steps);
        let mut beats = 0;
        for _ in 0..100 {
            let answers = bench.sync();
            if let Some(place) = answers.iter().position(|frame| frame.id() == beat) {
                assert!(place > 0 && place + 1 == answers.len(), "the process data come first");
                beats += 1;
            }
            bench.sent.clear();
            bench.run_ms(1);
            assert_eq!(bench.heartbeats(), [], "no heartbeat comes between two SYNCs");
        }
        assert_eq!(beats, 2);
    }
    let mut silent = Bench::operational();
    silent.run_ms(100);
    assert_eq!(silent.heartbeats().len(), 3, "without SYNC it comes a little late, after the boot-up");
}

#[test]
fn a_stopped_node_obeys_network_management_alone() {
    let mut bench = Bench::operational();
    bench.nmt(NmtCommand::Stop);
    assert_eq!(bench.ask(SdoRequest::InitiateUpload { object: ObjectAddress::new(0x1000, 0) }), None);
    assert_eq!(bench.sync(), []);
    bench.nmt(NmtCommand::EnterPreOperational);
    assert!(bench.read((0x1000, 0)).is_ok());
    assert_eq!(bench.sync(), [], "process data in operational only");
    bench.nmt(NmtCommand::Start);
    assert_eq!(bench.sync().len(), 1);
}

#[test]
fn a_reset_of_the_communication_leaves_the_profile_alone() {
    let mut bench = Bench::new();
    bench.write((0x1017, 0), &10_u16.to_le_bytes()).unwrap();
    bench.write((0x6065, 0), &777_u32.to_le_bytes()).unwrap();
    bench.sent.clear();
    bench.nmt(NmtCommand::ResetCommunication);
    bench.run_ms(25);
    assert_eq!(bench.heartbeats()[0], NmtState::BootUp);
    assert_eq!((bench.read((0x1017, 0)), bench.read((0x6065, 0))), (Ok(50), Ok(777)));
}

/// Controlled over SDO, as by a tool; supervision of the heartbeat begins again with the master's next heartbeat.
#[test]
fn a_reset_of_the_communication_stops_the_axis_in_pre_operational_too() {
    let mut bench = Bench::enabled(1);
    bench.write((0x607A, 0), &(START + 50_000).to_le_bytes()).unwrap();
    bench.control(0x1F);
    bench.run_ms(100);
    assert!(bench.velocity_m_s > 0.05);
    bench.nmt(NmtCommand::ResetCommunication);
    bench.run_ms(100);
    assert_eq!(bench.drive.state(), DriveState::SwitchOnDisabled);
    assert!(bench.velocity_m_s.abs() < 1e-3);
}

#[test]
fn a_reset_closes_the_brake_and_boots_anew() {
    let mut bench = Bench::enabled(1);
    bench.sent.clear();
    bench.nmt(NmtCommand::ResetNode);
    bench.run_ms(25);
    assert_eq!(bench.heartbeats(), [NmtState::BootUp]);
    assert_eq!(bench.drive.state(), DriveState::SwitchOnDisabled);
    assert_eq!(bench.read((0x6061, 0)), Ok(8));
}

/// 6007h and the reaction of an enabled drive whose master falls silent.
#[test]
fn a_lost_heartbeat_is_answered_as_object_6007_says() {
    for (option, state) in LINK_REACTIONS {
        let mut bench = Bench::enabled(1);
        bench.write((0x6007, 0), &option.to_le_bytes()).unwrap();
        bench.master_beats();
        bench.run_ms(140);
        assert_eq!(bench.drive.state(), DriveState::OperationEnabled);
        assert_eq!(bench.emergencies(), []);
        bench.run_ms(60);
        assert_eq!(bench.drive.state(), state, "6007 = {option}");
        assert_eq!(bench.emergencies()[0], EmergencyCode::HEARTBEAT);
        bench.master_beats();
        assert_eq!(bench.emergencies().last(), Some(&EmergencyCode::RESET));
        let fault = if state == DriveState::Fault { (0x11, 0x8100) } else { (0, 0) };
        assert_eq!(bench.errors(), fault, "6007 = {option}");
    }
}

#[test]
fn an_aborted_connection_that_is_a_fault_is_reported_and_lasts_until_reset() {
    for command in [NmtCommand::Stop, NmtCommand::EnterPreOperational, NmtCommand::ResetCommunication] {
        let mut bench = Bench::enabled(1);
        bench.write((0x6007, 0), &1_u16.to_le_bytes()).unwrap();
        bench.nmt(NmtCommand::Start);
        bench.nmt(command);
        bench.run_ms(100);
        assert_eq!(bench.drive.state(), DriveState::Fault);
        assert_eq!(bench.emergencies(), [EmergencyCode::COMMUNICATION], "{command:?}");
        bench.nmt(NmtCommand::EnterPreOperational);
        assert_eq!(bench.errors(), (0x11, 0x8100));
        bench.control(0x80);
        assert_eq!(bench.drive.state(), DriveState::SwitchOnDisabled);
        assert_eq!(bench.emergencies(), [EmergencyCode::COMMUNICATION, EmergencyCode::RESET]);
        assert_eq!(bench.errors(), (0, 0));
    }
}

/// 6007h and the reaction to missing process data of a force while the master's heartbeat continues.
#[test]
fn process_data_that_stay_away_are_answered_as_object_6007_says() {
    for (option, state) in LINK_REACTIONS {
        let mut bench = Bench::enabled(10);
        bench.write((0x6007, 0), &option.to_le_bytes()).unwrap();
        remap(&mut bench, 0x1400, 0x204, &[0x6040_0010, 0x6071_0010]);
        bench.write((0x1400, 5), &10_u16.to_le_bytes()).unwrap();
        bench.nmt(NmtCommand::Start);
        for _ in 0..20 {
            bench.receive(pdo(0x204, &[0x0F, 0, 20, 0]));
            bench.sync();
            bench.run_ms(1);
        }
        assert_eq!(bench.drive.state(), DriveState::OperationEnabled);
        for _ in 0..100 {
            bench.master_beats();
            bench.run_ms(1);
        }
        assert_eq!(bench.drive.state(), state, "6007 = {option}");
        assert_eq!(bench.emergencies()[0], EmergencyCode::RPDO_TIMEOUT);
    }
}

/// 1029h:1 and the state of a node after the loss of a heartbeat.
#[test]
fn a_lost_heartbeat_changes_the_state_as_object_1029_says() {
    let table = [(0, NmtState::PreOperational), (1, NmtState::Operational), (2, NmtState::Stopped)];
    for (behaviour, state) in table {
        let mut bench = Bench::operational();
        bench.write((0x1029, 1), &[behaviour]).unwrap();
        bench.master_beats();
        bench.run_ms(250);
        assert_eq!(bench.heartbeats().pop(), Some(state), "1029:1 = {behaviour}");
    }
}

#[test]
fn a_lost_heartbeat_that_is_consumed_no_longer_is_no_error_any_more() {
    let mut bench = Bench::operational();
    bench.master_beats();
    bench.run_ms(250);
    assert_eq!(bench.errors(), (0x11, 0x8130));
    bench.write((0x1016, 1), &[0; 4]).unwrap();
    assert_eq!(bench.errors(), (0, 0));
    assert_eq!(bench.emergencies(), [EmergencyCode::HEARTBEAT, EmergencyCode::RESET]);
}

/// CiA 301: without a time, or with a number that no node has, an entry is not used; its highest byte is reserved.
#[test]
fn an_entry_for_consumed_heartbeats_needs_a_valid_node_and_a_time() {
    for (word, is_used) in [(0x7F_0064, true), (0x017F_0064, true), (0x80_0064, false), (0x7F_0000, false)] {
        let mut bench = Bench::operational();
        bench.write((0x1016, 1), &u32::to_le_bytes(word)).unwrap();
        bench.master_beats();
        bench.run_ms(150);
        assert_eq!(bench.emergencies().contains(&EmergencyCode::HEARTBEAT), is_used, "{word:X}");
    }
}

/// 6007h and 1029h:1, long before the master's heartbeat is overdue.
#[test]
fn a_drive_in_bus_off_stops_by_itself_and_reports_it_once_back() {
    for (option, state) in LINK_REACTIONS {
        let (mut bench, _) = Bench::cycling();
        bench.write((0x6007, 0), &option.to_le_bytes()).unwrap();
        bench.drive.set_error_state(bench.now_ns, ErrorState::BusOff);
        bench.run_ms(100);
        assert_eq!(bench.drive.state(), state, "6007 = {option}");
        assert_eq!(bench.heartbeats().pop(), Some(NmtState::PreOperational));
        bench.sent.clear();
        bench.drive.set_error_state(bench.now_ns, ErrorState::Active);
        bench.run_ms(1);
        assert_eq!(bench.emergencies(), [EmergencyCode::WAS_BUS_OFF, EmergencyCode::RESET]);
    }
}

#[test]
fn an_error_passive_drive_reports_it_once_and_continues() {
    let mut bench = Bench::enabled(1);
    for state in [ErrorState::Active, ErrorState::Passive, ErrorState::Passive] {
        bench.drive.set_error_state(bench.now_ns, state);
        bench.run_ms(1);
    }
    assert_eq!(bench.errors(), (0x11, 0x8120));
    bench.drive.set_error_state(bench.now_ns, ErrorState::Active);
    bench.run_ms(1);
    assert_eq!(bench.emergencies(), [EmergencyCode::ERROR_PASSIVE, EmergencyCode::RESET]);
    assert_eq!(bench.errors(), (0, 0));
    assert_eq!(bench.drive.state(), DriveState::OperationEnabled);
}

#[test]
fn a_boot_up_message_does_not_begin_the_supervision() {
    let mut bench = Bench::new();
    bench.receive(Heartbeat { state: NmtState::BootUp }.frame(id(127)));
    bench.run_ms(500);
    assert_eq!(bench.emergencies(), []);
}

#[test]
fn errors_are_kept_in_the_history_until_it_is_cleared() {
    let mut bench = Bench::operational();
    bench.receive(pdo(0x204, &[0x0F]));
    assert_eq!(bench.emergencies(), [EmergencyCode::PDO_LENGTH]);
    assert_eq!((bench.read((0x1003, 0)), bench.read((0x1003, 1))), (Ok(1), Ok(0x8210)));
    assert_eq!(bench.read((0x1003, 2)), Err(AbortCode::NO_DATA));
    assert_eq!((bench.read((0x1001, 0)), bench.read((0x603F, 0))), (Ok(0x11), Ok(0x8210)));
    bench.receive(pdo(0x204, &[0; 6]));
    assert_eq!(bench.emergencies(), [EmergencyCode::PDO_LENGTH, EmergencyCode::RESET]);
    assert_eq!((bench.read((0x1001, 0)), bench.read((0x603F, 0))), (Ok(0), Ok(0)));
    bench.nmt(NmtCommand::ResetCommunication);
    bench.run_ms(25);
    assert_eq!((bench.read((0x1003, 0)), bench.read((0x1003, 1))), (Ok(1), Ok(0x8210)));
    bench.write((0x1003, 0), &[0]).unwrap();
    assert_eq!((bench.read((0x1003, 0)), bench.read((0x1003, 1))), (Ok(0), Err(AbortCode::NO_DATA)));
}

#[test]
fn an_emergency_goes_out_under_its_cob_id_or_not_at_all() {
    let mut bench = Bench::operational();
    bench.write((0x1014, 0), &0x8000_0084_u32.to_le_bytes()).unwrap();
    bench.receive(pdo(0x204, &[0x0F]));
    assert_eq!(bench.emergencies(), []);
    bench.write((0x1014, 0), &0x0000_0091_u32.to_le_bytes()).unwrap();
    bench.receive(pdo(0x204, &[0; 6]));
    let last = bench.sent.iter().rfind(|frame| frame.id().number() == 0x91).copied();
    assert_eq!(last.map(|frame| frame.to_string()), Some("091#0000000000000000".to_owned()));
}

#[test]
fn an_unfinished_transfer_is_aborted_after_a_second() {
    let mut bench = Bench::new();
    let object = ObjectAddress::new(0x1008, 0);
    bench.ask(SdoRequest::InitiateUpload { object });
    bench.sent.clear();
    bench.run_ms(1001);
    let aborts = bench.sent.iter().filter(|frame| frame.id() == Cob::SdoResponse(id(4)).into());
    let aborts: Vec<_> = aborts.map(|frame| SdoResponse::decode(frame.data()).unwrap()).collect();
    assert_eq!(aborts, [SdoResponse::Abort { object, code: AbortCode::TIMED_OUT }]);
}
