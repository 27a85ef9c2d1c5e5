use masseter_runtime::messages::codes::DriveState;
use masseter_runtime::messages::{Reading, Truth};

use super::*;

const PERIOD_NS: u64 = 1_000_000;
const L1: usize = 3;

fn codes(state: DriveState) -> [u32; AXES] {
    [state.code(); AXES]
}

/// A run of a second: the drives are enabled for 0.1 s, stop, and are off from 0.12 s on. `l1_mm` is where l1 is by the ms.
fn stopped(scenario: &Scenario, l1_mm: impl Fn(u64) -> f64) -> StandstillFigures {
    let mut watch = StandstillWatch::new(scenario);
    for ms in 0..700 {
        let drive_state = match ms {
            0..100 => codes(DriveState::OperationEnabled),
            100..120 => codes(DriveState::QuickStopActive),
            _ => codes(DriveState::SwitchOnDisabled),
        };
        watch.add_sample(&sample(ms, drive_state, ControllerState::Running, l1_mm(ms)));
    }
    watch.into_figures()
}

fn sample(ms: u64, drive_state: [u32; AXES], state: ControllerState, l1_mm: f64) -> Sample {
    let mut joint_m = [0.0; AXES];
    joint_m[L1] = l1_mm * 1e-3;
    let position_m = [0.0, 0.0, l1_mm * 1e-3];
    let reading =
        Reading { drive_state, fresh_axes: (1 << AXES) - 1, position_m: joint_m, ..Reading::default() };
    let truth = Truth { joint_m, position_m, quaternion_wxyz: [1.0, 0.0, 0.0, 0.0], ..Truth::default() };
    let messages = CycleMessages {
        reading: Some(reading),
        truth: Some(truth),
        controller_state: Some(state.code()),
        ..CycleMessages::default()
    };
    Sample { time_ns: (ms + 1) * PERIOD_NS, messages, events: Vec::new(), is_closing: false }
}

fn mark(found: &StandstillFigures) -> &'static str {
    let check = standstill(found, &Ending::SafeStop, false, &ChecksConfig::default());
    check.map_or("none", |check| check.result.mark())
}

#[test]
fn what_moves_before_the_loss_of_power_is_no_fall() {
    let found = stopped(&Scenario::default(), |ms| ms.min(120) as f64);
    assert_eq!((mark(&found), found.axes_mm, found.jaw_mm), ("ok", [0.0; AXES], Some(0.0)));
    assert!(found.recorded_s.is_some_and(|recorded_s| (recorded_s - 0.599).abs() < 1e-9), "{found:?}");
}

#[test]
fn a_fall_a_drift_and_a_jaw_that_comes_back_fail() {
    let default = Scenario::default();
    let fall = stopped(&default, |ms| -(ms.clamp(120, 250) as f64 - 120.0));
    assert!((fall.axes_mm[L1] - 130.0).abs() < 1e-9 && mark(&fall) == "FAIL", "{fall:?}");
    let drift = stopped(&default, |ms| ms.max(120) as f64 * 1e-3);
    assert!((drift.axes_mm[L1] - 0.579).abs() < 1e-9 && mark(&drift) == "FAIL", "{drift:?}");
    let back = stopped(&default, |ms| if ms == 300 { 2.0 } else { 0.0 });
    assert_eq!(mark(&back), "FAIL", "{back:?}");
    let nowhere = stopped(&default, |ms| if ms == 300 { f64::NAN } else { 0.0 });
    assert_eq!(mark(&nowhere), "FAIL", "{nowhere:?}");
    let sag = stopped(&default, |ms| if ms < 130 { 0.0 } else { 0.15 });
    assert_eq!(mark(&sag), "ok", "brakes give way a little: {sag:?}");
}

#[test]
fn a_jaw_that_runs_into_its_brakes_settles_and_one_that_falls_does_not() {
    let scenario = Scenario::default();
    let braked = stopped(&scenario, |ms| ms.clamp(120, 160) as f64);
    assert_eq!((mark(&braked), braked.settled), ("FAIL", [0.0; 2]));
    let fallen = stopped(&scenario, |ms| ms.max(120) as f64);
    assert!(mark(&fallen) == "FAIL" && fallen.settled[0] > 400.0, "{fallen:?}");
}

#[test]
fn axes_may_coast_for_the_time_that_the_scenario_declares() {
    let coasting = |ms: u64| ms.min(150) as f64;
    let mut scenario = Scenario::default();
    assert_eq!(mark(&stopped(&scenario, coasting)), "FAIL");
    scenario.checks.standstill_after_ms = 30.0;
    assert_eq!(mark(&stopped(&scenario, coasting)), "ok");
    scenario.checks.standstill_after_ms = 28.0;
    assert_eq!(mark(&stopped(&scenario, coasting)), "FAIL");
}

#[test]
fn a_drive_that_says_nothing_of_its_power_has_a_tenth_of_a_second() {
    for (from_ms, expected) in [(150, "ok"), (250, "FAIL")] {
        let mut watch = StandstillWatch::new(&Scenario::default());
        for ms in 0..700 {
            let mut drive_state = codes(DriveState::OperationEnabled);
            if ms >= 100 {
                drive_state = codes(DriveState::SwitchOnDisabled);
                drive_state[L1] = masseter_runtime::messages::codes::NO_DRIVE_STATE;
            }
            let l1_mm = if ms < from_ms { 0.0 } else { 5.0 };
            watch.add_sample(&sample(ms, drive_state, ControllerState::Running, l1_mm));
        }
        let found = watch.into_figures();
        assert_eq!(mark(&found), expected, "{found:?}");
    }
}

#[test]
fn drives_that_stay_enabled_after_the_controllers_end_must_stand_too() {
    for (speed, expected) in [(0.0, "ok"), (0.65, "FAIL")] {
        let mut watch = StandstillWatch::new(&Scenario::default());
        for ms in 0..700 {
            let state = if ms < 100 { ControllerState::Running } else { ControllerState::SafeStop };
            let enabled = codes(DriveState::OperationEnabled);
            watch.add_sample(&sample(ms, enabled, state, speed * ms.max(100) as f64));
        }
        assert_eq!(mark(&watch.into_figures()), expected);
    }
}

#[test]
fn a_motion_that_goes_on_ends_the_stop_and_is_no_fall() {
    let mut watch = StandstillWatch::new(&Scenario::default());
    for ms in 0..400 {
        let is_off = (100..300).contains(&ms);
        let state = if is_off { DriveState::SwitchOnDisabled } else { DriveState::OperationEnabled };
        let l1_mm = if is_off { 0.2 } else { ms as f64 };
        watch.add_sample(&sample(ms, codes(state), ControllerState::Running, l1_mm));
    }
    assert!(watch.figures.axes_mm[L1] < 1e-9 && watch.stop.is_none(), "{watch:?}");
}

#[test]
fn a_recording_that_ends_soon_is_untested_unless_something_else_ended_it() {
    let short = StandstillFigures { recorded_s: Some(0.006), ..StandstillFigures::default() };
    let judged = |ending: &Ending, is_partial| {
        standstill(&short, ending, is_partial, &ChecksConfig::default()).unwrap().result.mark()
    };
    assert_eq!(judged(&Ending::Completed, false), "UNTESTED");
    assert_eq!(judged(&Ending::Completed, true), "skip");
    assert_eq!(judged(&Ending::Interrupted, false), "skip");
    assert_eq!(mark(&StandstillFigures::default()), "none", "no stop");
    let moved = StandstillFigures { axes_mm: [9.0; AXES], ..short };
    assert_eq!(mark(&moved), "FAIL");
}

#[test]
fn an_axis_that_nobody_sees_after_the_stop_has_not_stood() {
    let mut watch = StandstillWatch::new(&Scenario::default());
    for ms in 0..700 {
        let state = if ms < 100 { DriveState::OperationEnabled } else { DriveState::SwitchOnDisabled };
        let mut sample = sample(ms, codes(state), ControllerState::Running, 0.0);
        sample.messages.truth = sample.messages.truth.filter(|_| ms < 200);
        watch.add_sample(&sample);
    }
    assert_eq!(mark(&watch.into_figures()), "UNTESTED");
}
