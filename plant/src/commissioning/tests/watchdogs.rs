//! Drives whose master falls silent.

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
fn a_sound_drive_stops_in_time_stands_and_says_why() {
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
            "1016h:01h is 150 ms; nothing stops this drive",
        ),
        (
            "kind = 'ignores_process_data'",
            "l1: kept its power for ",
            "1400h:05h is 150 ms; nothing stops this drive",
        ),
        (
            "kind = 'late_watchdog'\nfor_s = 0.2",
            "l1: stopped 35",
            "after the last heartbeat, 1016h:01h is 150 ms",
        ),
        ("kind = 'coasts_without_master'", "l1: moved ", "after its power went"),
    ];
    for (text, begins, contains) in table {
        let error = prove(&quirk(text)).1.unwrap_err().to_string();
        assert!(error.starts_with(begins) && error.contains(contains), "{text}: {error}");
    }
}

#[test]
fn a_drive_that_stops_without_a_word_is_named() {
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
    assert!(prove(&quirk("kind = 'late_watchdog'\nfor_s = 0.03")).1.is_ok());
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
    assert!(
        error.starts_with("l1: 1600h is not as the profile has it; run 'masseter robot configure'"),
        "{error}"
    );
}

#[test]
fn a_wish_to_stop_ends_the_proof_before_the_silence() {
    let mut bench = Bench::new("");
    let stopped = prove_watchdogs(&mut bench.line, &bench.scenario, L1, &mut |_| Wish::Stop).unwrap_err();
    let MotionError::OfAxis { reason: AxisError::Stopped(StopCause::Requested), .. } = stopped else {
        panic!("{stopped}")
    };
    bench.assert_off();
}
