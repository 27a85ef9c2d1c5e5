use masseter_can::Bitrate;
use masseter_shared::geometry::AXES;
use masseter_shared::messages::{CanData, FrameTap, Reading, State};

use masseter_can::cia402::DriveState;

use super::*;

fn view() -> View {
    let mut view = View::new(Mode::Picture, Rates::classical(Bitrate::MAX), Some(4.0), 0);
    for cycle in 1..=10 {
        view.take(&Recorded::State(State {
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
    view.take(&Recorded::Reading(Reading {
        seq: 4,
        drive_state: [DriveState::OperationEnabled.code(); AXES],
        ..Default::default()
    }));
    view.take(&Recorded::Frame(FrameTap {
        seq: 1,
        bus: 1,
        data: CanData::padded([0; 64], 8),
        ..Default::default()
    }));
    view
}

fn assert_says(text: &str, words: &[&str]) {
    for words in words {
        assert!(text.contains(words), "{words}: {text}");
    }
}

#[test]
fn the_line_says_state_error_and_losses() {
    let line = view().line(Losses { lost: 2, live: Some(Watched { clients: 1, dropped: 7 }) });
    let expected = [
        "running",
        "motion    1.00 of 4.00 s",
        "off by  2.000 mm, at most 4.000",
        "late at most 50 µs",
        "missed 0",
        "dropped 5",
        "live 1 watching, 7 dropped",
    ];
    assert_says(&line, &expected);
}

#[test]
fn the_picture_shows_progress_error_lateness_buses_and_drives() {
    let view = view();
    let picture = view.picture(Losses::default(), view.seen.busy_ns[1] * 4).unwrap();
    let expected = [
        "25 %",
        "cycle       10",
        "rms 2.280, at most 4.000",
        "controller        0.1",
        "within   1 µs      10",
        "within 100 µs       1",
        "can0   0 %  can1  25 %",
        "all operation_enabled",
    ];
    assert_says(&picture, &expected);
    assert!(!picture.contains("live"), "{picture}");
}

#[test]
fn drives_that_differ_are_told_apart() {
    let mut view = view();
    view.seen.reading.drive_state[5] = DriveState::Fault.code();
    let picture = view.picture(Losses::default(), 1).unwrap();
    assert_says(&picture, &["l2 operation_enabled", "l3 fault"]);
}

#[test]
fn a_picture_is_drawn_over_the_one_before_unless_words_stand_below_it() {
    let mut view = view();
    let mut next = || view.next(PICTURE_NS, Losses::default(), None);
    let first = next();
    let lines = first.lines().count() - 1;
    assert!(first.starts_with(ERASE_BELOW));
    assert!(next().starts_with(&format!("\x1b[{lines}A{ERASE_BELOW}")));
    view.leave_picture();
    assert!(view.next(PICTURE_NS, Losses::default(), None).starts_with(ERASE_BELOW));
}

#[test]
fn a_picture_leaves_out_what_the_terminal_has_no_rows_for() {
    let mut view = view();
    let whole = view.next(PICTURE_NS, Losses::default(), Some(100)).matches('\n').count();
    assert!(whole > 10);
    for (rows, lines) in [(whole + 1, whole), (whole, whole - 1), (5, 4), (1, 0)] {
        let picture = view.next(PICTURE_NS, Losses::default(), Some(rows));
        assert_eq!(picture.matches('\n').count(), lines, "{rows} rows");
    }
}

#[test]
fn it_is_time_for_a_line_every_second_for_a_picture_five_times_and_never_when_quiet() {
    let is_due = |mode, now_ns| View::new(mode, Rates::classical(Bitrate::MAX), None, 0).is_due(now_ns);
    assert!(is_due(Mode::Lines, SECOND_NS) && !is_due(Mode::Lines, SECOND_NS - 1));
    assert!(is_due(Mode::Picture, SECOND_NS / 5) && !is_due(Mode::Picture, SECOND_NS / 5 - 1));
    assert!(!is_due(Mode::Quiet, 9 * SECOND_NS));
}
