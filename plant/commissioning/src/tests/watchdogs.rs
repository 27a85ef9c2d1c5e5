//! Drives whose master stops sending.

use super::*;

fn prove(text: &str) -> (Bench, Result<WatchdogReport, MotionError>) {
    let mut bench = Bench::new(text);
    let before = bench.objects();
    let report = prove_watchdogs(&mut bench.line, &bench.scenario, L1, &mut |_| Wish::Move);
    assert_eq!(bench.objects(), before, "every borrowed object has its old value");
    bench.assert_off();
    (bench, report)
}

fn quirk(text: &str) -> String {
    format!("[[drives.quirk]]\naxes = ['l1']\n{text}")
}

#[test]
fn a_sound_drive_stops_in_time_and_reports_the_lost_master() {
    for more in ["", "kind = 'pdos_locked_in_operation'", "kind = 'two_boot_ups'"] {
        let text = if more.is_empty() { String::new() } else { quirk(more) };
        let (bench, report) = prove(&text);
        let report = report.unwrap();
        let process_data = report.process_data.unwrap();
        for (reaction, timeout_ms, emergency) in
            [(report.heartbeat, 150, 0x8130), (process_data, 150, 0x8250)]
        {
            assert_eq!((reaction.timeout_ms, reaction.emergency), (timeout_ms, emergency), "{more}");
            let late_ms = reaction.stopped_after_ms - f64::from(timeout_ms);
            assert!((0.0..10.0).contains(&late_ms) && reaction.moved_m.abs() < 1e-4, "{more}: {reaction:?}");
        }
        let l1 = bench.scenario.can.node_ids[L1];
        assert!(
            bench.log.controlwords().iter().all(|&(node, _)| node == l1),
            "another axis got a controlword"
        );
    }
}

#[test]
fn a_drive_that_does_not_stop_is_switched_off_and_named() {
    let table = [
        (
            "kind = 'ignores_heartbeat'",
            "l1: kept its power for ",
            "1016h:01h is 150 ms; nothing stops this drive without ",
        ),
        (
            "kind = 'ignores_process_data'",
            "l1: kept its power for ",
            "1400h:05h is 150 ms; nothing stops this drive without ",
        ),
        (
            "kind = 'late_watchdog'\nfor_s = 0.2",
            "l1: was seen without power only 35",
            "after the last heartbeat, while 1016h:01h is 150 ms",
        ),
        ("kind = 'coasts_without_master'", "l1: moved ", "after its power went"),
    ];
    for (text, begins, contains) in table {
        let error = prove(&quirk(text)).1.unwrap_err().to_string();
        assert!(error.starts_with(begins) && error.contains(contains), "{text}: {error}");
    }
}

#[test]
fn a_drive_that_stops_without_an_emergency_message_is_named() {
    let mut bench = Bench::new("");
    let emergencies_off = 0x8000_0080 | u32::from(bench.scenario.can.node_ids[L1]);
    bench.line.write(L1, ObjectAddress::new(0x1014, 0), emergencies_off, 4).unwrap();
    let error = prove_watchdogs(&mut bench.line, &bench.scenario, L1, &mut |_| Wish::Move).unwrap_err();
    assert_eq!(
        error.to_string(),
        "l1: stopped without heartbeat, and sent no emergency message; check 1014h"
    );
    bench.assert_off();
}

#[test]
fn a_little_late_is_in_time() {
    let report = prove(&quirk("kind = 'late_watchdog'\nfor_s = 0.03")).1.unwrap();
    assert!((180.0..195.0).contains(&report.heartbeat.stopped_after_ms), "{report:?}");
}

#[test]
fn a_drive_without_an_event_timer_has_one_watchdog() {
    for text in [quirk("kind = 'lacks'\nobjects = ['1400h:05']"), "[can]\nrpdo_timeout_ms = 0".to_owned()] {
        assert_eq!(prove(&text).1.unwrap().process_data, None, "{text}");
    }
}

#[test]
fn process_data_that_the_drive_does_not_take_prove_nothing() {
    let error = prove(&quirk("kind = 'factory_pdos'")).1.unwrap_err().to_string();
    let wanted = "l1: 1600h is not as the rig needs it; run 'masseter robot configure' again";
    assert_eq!(error, wanted);
}

/// Instants within both silences of a sound drive, s: the heartbeat ends 50 ms after the start of the node, and the process data 200 ms
/// after that of the second proof.
fn silences_s() -> [f64; 2] {
    let (bench, report) = prove("");
    report.unwrap();
    let log = bench.log.text();
    let starts = log.lines().filter(|line| line.contains(" 000#0104"));
    let at_s = |line: &str| line[1..].split(')').next().unwrap().parse::<f64>().unwrap();
    let starts: Vec<f64> = starts.map(at_s).collect();
    [starts[0] + 0.05 + 0.06, starts[1] + 0.2 + 0.06]
}

#[test]
fn a_fault_within_the_silence_is_no_proof_of_a_watchdog() {
    for (at_s, silence) in silences_s().into_iter().zip(["heartbeat", "process data"]) {
        let mut bench = Bench::with_fault("drive_fault", L1, at_s);
        let error = prove_watchdogs(&mut bench.line, &bench.scenario, L1, &mut |_| Wish::Move).unwrap_err();
        let text = error.to_string();
        assert!(
            text.starts_with("l1: stopped ") && text.contains("find what else stopped the drive"),
            "{text}"
        );
        assert!(text.contains(&format!("after the last {silence}")), "{text}");
        bench.assert_off();
    }
}

#[test]
fn a_wish_to_stop_ends_the_proof_at_any_time_and_gives_no_power_after_it() {
    let [first_s, second_s] = silences_s();
    for (at_s, powered) in [(0.0, 0), (1.0, 1), (first_s, 1), (first_s + 1.0, 1), (second_s, 2)] {
        let mut bench = Bench::new("");
        let at_ns = (at_s * SECOND_NS as f64) as u64;
        let wish = &mut |now_ns| if now_ns >= at_ns { Wish::Stop } else { Wish::Move };
        let stopped = prove_watchdogs(&mut bench.line, &bench.scenario, L1, wish).unwrap_err();
        let MotionError::OfAxis { reason: AxisError::Stopped(StopCause::Requested), .. } = stopped else {
            panic!("{at_s}: {stopped}")
        };
        bench.assert_off();
        let enabled = bench.log.controlwords().iter().filter(|(_, word)| word.0 & 0xF == 0xF).count();
        assert_eq!(enabled, powered, "{at_s}");
    }
}

/// A drive without power goes into fault, too, where the profile makes a lost connection a fault.
#[test]
fn faults_of_other_drives_by_the_silence_end_with_it() {
    let mut bench = Bench::new("[[drive_profile]]\nobjects.6007h = { value = 1 }");
    for axis in 0..AXES {
        bench.line.write(axis, ObjectAddress::new(0x6007, 0), 1, 2).unwrap();
        bench.line.write(axis, ObjectAddress::new(0x1400, 5), 0, 2).unwrap();
    }
    let before = bench.objects();
    for axis in [L1, 0] {
        prove_watchdogs(&mut bench.line, &bench.scenario, axis, &mut |_| Wish::Move).unwrap();
        let states = stand(&mut bench.line, &bench.scenario, 0).unwrap().states;
        assert!(states.iter().all(|state| *state == DriveState::SwitchOnDisabled), "{states:?}");
    }
    assert_eq!(bench.objects(), before, "every borrowed object has its old value");
}

/// The time of the last frame is its end on the bus. At 50 kbit/s that is no whole millisecond, while frames are queued and statuswords
/// are seen at whole ones.
#[test]
fn a_silence_begins_when_the_last_frame_has_left() {
    let (bench, report) = prove("rate_hz = 100\n[can]\nbitrate_bps = 50000");
    let report = report.unwrap();
    let log = bench.log.text();
    let at_ms = |line: &str| line[1..].split(')').next().unwrap().parse::<f64>().unwrap() * 1e3;
    let ends = |frame: &str| log.lines().filter(|line| line.contains(frame)).map(at_ms).collect::<Vec<_>>();
    let from_whole_ms = |time_ms: f64| (time_ms - time_ms.round()).abs();
    for (reaction, frame, emergency) in [
        (report.heartbeat, "can1 77F#05", "can1 084#3081"),
        (report.process_data.unwrap(), "can1 204#0F00", "can1 084#5082"),
    ] {
        assert_eq!(reaction.last_frame, LastFrame::Left);
        let stopped_ms = ends(emergency)[0];
        let last_ms = ends(frame).into_iter().rfind(|&end_ms| end_ms < stopped_ms).unwrap();
        let seen_ms = last_ms + reaction.stopped_after_ms;
        assert!(from_whole_ms(last_ms) > 0.05 && from_whole_ms(seen_ms) < 0.01, "{reaction:?} {last_ms}");
        assert!((stopped_ms - 5.0..stopped_ms + 50.0).contains(&seen_ms), "{reaction:?} {stopped_ms}");
    }
}

/// 605Ah = 6 stays in the quick stop for ever. The other drives make a fault of the lost heartbeat.
#[test]
fn a_drive_that_keeps_its_power_is_switched_off_and_no_drive_stays_in_fault() {
    let (mut bench, error) = prove_among_faults("");
    let error = error.unwrap_err();
    let MotionError::OfAxis { axis: L1, reason: AxisError::KeepsPower { .. } } = error else {
        panic!("{error}")
    };
    let says = "l1: stays in quick_stop_active without heartbeat; check 605Ah and 605Eh: the drive must take the power away";
    assert_eq!(error.to_string(), says);
    let states = stand(&mut bench.line, &bench.scenario, 0).unwrap().states;
    assert!(states.iter().all(|state| *state == DriveState::SwitchOnDisabled), "{states:?}");
    let words = bench.log.controlwords();
    let l1 = bench.scenario.can.node_ids[L1];
    let reset = words.iter().position(|&(_, word)| word == Controlword::FAULT_RESET).unwrap();
    let of_l1 = words[..reset].iter().filter(|(node, _)| *node == l1).map(|(_, word)| *word);
    let last: Vec<_> = of_l1.skip_while(|word| *word != Controlword::QUICK_STOP).collect();
    assert!(
        last.contains(&Controlword::DISABLE_VOLTAGE),
        "the power goes before a fault is reset: {words:?}"
    );
}

#[test]
fn an_ignored_heartbeat_leaves_no_fault_in_another_drive_either() {
    let (mut bench, error) = prove_among_faults(&quirk("kind = 'ignores_heartbeat'"));
    let error = error.unwrap_err();
    assert!(matches!(error, MotionError::OfAxis { reason: AxisError::Unwatched { .. }, .. }), "{error}");
    let states = stand(&mut bench.line, &bench.scenario, 0).unwrap().states;
    assert!(states.iter().all(|state| *state == DriveState::SwitchOnDisabled), "{states:?}");
}

/// The proof of l1, which stays in its quick stop, beside drives that make a fault of a lost heartbeat.
fn prove_among_faults(text: &str) -> (Bench, Result<WatchdogReport, MotionError>) {
    let profile = "[[drive_profile]]\naxes = ['l1']\nobjects.605Ah = { value = 6 }\n";
    let mut bench = Bench::new(&format!("{profile}{text}"));
    for axis in (0..AXES).filter(|&axis| axis != L1) {
        bench.line.write(axis, ObjectAddress::new(0x6007, 0), 1, 2).unwrap();
    }
    let report = prove_watchdogs(&mut bench.line, &bench.scenario, L1, &mut |_| Wish::Move);
    bench.assert_off();
    (bench, report)
}
