use masseter_can::Bitrate;
use masseter_can::cia402::DriveState;
use masseter_shared::geometry::AXES;
use masseter_shared::messages::{CanData, FrameTap, Reading, State};

use super::*;

fn progress(is_panel: bool) -> Progress {
    Progress::with_form(is_panel, Bitrate::MAX, 4.0, 0)
}

fn after_ten_cycles() -> Progress {
    let mut progress = progress(true);
    for cycle in 1..=10 {
        progress.add(&Recorded::State(State {
            seq: cycle,
            cycle,
            reading_cycle: cycle,
            due_ns: 1000,
            woke_ns: if cycle == 3 { 51_000 } else { 1100 },
            motion_time_s: 1.0,
            controller_state: ControllerState::Running.code(),
            estimated_position_m: [if cycle == 3 { 0.004 } else { 0.002 }, 0.0, 0.0],
            ..Default::default()
        }));
    }
    progress.add(&Recorded::Reading(Reading {
        seq: 4,
        drive_state: [DriveState::OperationEnabled.code(); AXES],
        ..Default::default()
    }));
    progress.add(&Recorded::Frame(FrameTap {
        seq: 1,
        bus: 1,
        data: CanData::new(&[0; 8]),
        ..Default::default()
    }));
    progress
}

fn assert_contains(text: &str, expected: &[&str]) {
    for expected in expected {
        assert!(text.contains(expected), "{expected}: {text}");
    }
}

#[test]
fn the_line_shows_state_error_latency_and_losses() {
    let clients = Some(ClientCounts { connected: 1, dropped: 7 });
    let line = after_ten_cycles().line(Losses { unrecorded: 2, clients });
    let expected = [
        "running",
        "motion    1.00 of 4.00 s",
        "tracking error 2.000 mm, max 4.000",
        "wake-up latency max 50 µs",
        "missed 0",
        "dropped 5",
        "live 1 watching, 7 dropped",
    ];
    assert_contains(&line, &expected);
}

#[test]
fn the_panel_shows_progress_error_latency_bus_load_and_drives() {
    let progress = after_ten_cycles();
    let panel = progress.panel(Losses::default(), progress.figures.busy_ns[1] * 4).unwrap();
    let expected = [
        "25 %",
        "cycle       10",
        "rms 2.280, max 4.000",
        "controller         0.1      50.2      50.2",
        "can0   0 %  can1  25 %",
        "all operation_enabled",
    ];
    assert_contains(&panel, &expected);
    assert!(!panel.contains("live"), "{panel}");
}

#[test]
fn drives_in_different_states_are_listed_one_by_one() {
    let mut progress = after_ten_cycles();
    progress.figures.reading.drive_state[5] = DriveState::Fault.code();
    let panel = progress.panel(Losses::default(), 1).unwrap();
    assert_contains(&panel, &["l2 operation_enabled", "l3 fault"]);
}

#[test]
fn a_panel_is_drawn_over_the_one_before_unless_other_text_follows_that() {
    let mut progress = after_ten_cycles();
    let mut next = || progress.next(PANEL_INTERVAL_NS, Losses::default(), None);
    let first = next();
    let lines = first.lines().count() - 1;
    assert!(first.starts_with(ERASE_BELOW));
    assert!(next().starts_with(&format!("\x1b[{lines}A{ERASE_BELOW}")));
    progress.start_new_panel();
    assert!(progress.next(PANEL_INTERVAL_NS, Losses::default(), None).starts_with(ERASE_BELOW));
}

#[test]
fn a_panel_leaves_out_the_lines_that_the_terminal_has_no_rows_for() {
    let mut progress = after_ten_cycles();
    let whole = progress.next(PANEL_INTERVAL_NS, Losses::default(), Some(100)).matches('\n').count();
    assert_eq!(whole, 8);
    for (rows, lines) in [(whole + 1, whole), (whole, whole - 1), (5, 4), (1, 0)] {
        let panel = progress.next(PANEL_INTERVAL_NS, Losses::default(), Some(rows));
        assert_eq!(panel.matches('\n').count(), lines, "{rows} rows");
    }
}

#[test]
fn a_line_is_due_every_second_and_a_panel_five_times_a_second() {
    for (is_panel, interval_ns) in [(false, SECOND_NS), (true, SECOND_NS / 5)] {
        let progress = progress(is_panel);
        assert!(progress.is_due(interval_ns) && !progress.is_due(interval_ns - 1));
    }
}
