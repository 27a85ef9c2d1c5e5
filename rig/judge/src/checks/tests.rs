use super::*;
use crate::breach::earliest;

#[test]
fn no_gap_in_a_part_of_a_recording_says_nothing_of_the_rest() {
    let cases = [
        (Ending::Completed, false, false, 0, "ok"),
        (Ending::Completed, false, false, 1, "FAIL"),
        (Ending::Completed, true, false, 0, "skip"),
        (Ending::Completed, false, true, 0, "skip"),
        (Ending::RecordingFailed, false, false, 0, "skip"),
        (Ending::RecordingFailed, true, true, 1, "FAIL"),
    ];
    for (ending, is_cut_short, is_damaged, missing, mark) in cases {
        let check = dropped_messages(missing, &ending, is_cut_short, is_damaged);
        assert_eq!(check.result.mark(), mark, "{ending:?} {check:?}");
    }
}

fn response(max_ns: u64, unbounded: Option<&str>) -> BusResponse {
    let sync = ResponseFigures {
        bus: 1,
        message: "SYNC".to_owned(),
        frames: 1,
        max_ns: Some(max_ns),
        bound_ns: unbounded.is_none().then_some(190_000),
    };
    BusResponse { messages: vec![sync], off_time_frames: 0, unbounded: unbounded.map(str::to_owned) }
}

#[test]
fn a_message_beyond_its_bound_fails_unless_the_bound_does_not_hold() {
    let cases =
        [(190_000, None, "ok"), (191_000, None, "FAIL"), (191_000, Some("bus 0 had 1 errors"), "skip")];
    for (max_ns, unbounded, mark) in cases {
        let check = bus_response(&response(max_ns, unbounded), &SkipFigures::default());
        assert_eq!(check.result.mark(), mark, "{check:?}");
    }
    let failed = bus_response(&response(191_000, None), &SkipFigures::default());
    assert_eq!(failed.finding, "SYNC on bus 1 took 191 µs, bound 190 µs");
    let off_time = BusResponse { off_time_frames: 7, ..response(150_000, None) };
    let check = bus_response(&off_time, &SkipFigures::default());
    assert_eq!(check.result.mark(), "ok");
    assert!(check.finding.ends_with("; 7 frames beside a stall not judged"), "{check:?}");
}

#[test]
fn a_message_beyond_its_bound_by_no_more_than_the_plant_stalled_is_not_judged() {
    for (stalled_ns, overlong_ns, mark) in [(999, 0, "FAIL"), (1000, 0, "skip"), (500, 500, "skip")] {
        let plant = SkipFigures { stalled_ns, overlong_ns, ..SkipFigures::default() };
        let check = bus_response(&response(191_000, None), &plant);
        assert_eq!(check.result.mark(), mark, "{check:?}");
    }
}

#[test]
fn a_late_motion_and_missed_commands_have_limits() {
    let played = MotionFigures { way_mm: Some(900.0), ..MotionFigures::default() };
    let motion = |lag_ms| MotionFigures { lag_ms, ..played };
    let found = [Some(11.0), Some(20.0), Some(20.1), Some(f64::NAN), None]
        .map(|lag_ms| motion_lag(&motion(lag_ms), 20.0).map(|check| check.result.mark()));
    assert_eq!(found, [Some("ok"), Some("ok"), Some("FAIL"), Some("FAIL"), None]);
    assert_eq!(
        motion_lag(&MotionFigures { lag_ms: Some(0.0), ..MotionFigures::default() }, 20.0),
        None,
        "an own motion"
    );
    for (change, finding) in [
        ((Some(31.0), 0.0, [0.0; 2]), "0.0 ms, limit 20 ms; the true jaw was 31.0 ms ahead of the motion"),
        (
            (None, 30.0, [25.0, 0.0]),
            "30.0 ms, limit 20 ms; the controller began the motion 25.0 ms after its lead-in",
        ),
        (
            (None, 30.0, [15.0, 28.0]),
            "30.0 ms, limit 20 ms; the controller's motion time ran back by 28.0 ms",
        ),
        ((None, 30.0, [15.0, 15.0]), "30.0 ms, limit 20 ms"),
    ] {
        let (ahead_ms, lag_ms, lag_causes_ms) = change;
        let motion = MotionFigures { ahead_ms, lag_causes_ms, ..motion(Some(lag_ms)) };
        let check = motion_lag(&motion, 20.0).unwrap();
        assert_eq!((check.result.mark(), check.finding.as_str()), ("FAIL", finding));
    }
}

#[test]
fn a_desired_pose_that_is_none_has_a_time() {
    let found =
        TrackingFigures { without_pose: 2, without_pose_ns: Some(4_000_000_000), ..Default::default() };
    let stated = stated_pose(&found).unwrap().breach;
    let stated = earliest(stated.into_iter(), Some(2_000_000_000)).unwrap().to_string();
    assert_eq!(stated, "stated pose: without a finite pose 2 samples, limit 0, at 2.000 s of the motion");
}
