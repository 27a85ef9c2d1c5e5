//! Motions beside which controllers play: in time, late, or not at all. And whole analyses of their messages.

use masseter_recording::Recorded;
use masseter_runtime::messages::codes::{ControllerState, DriveState, EventKind, Source};
use masseter_runtime::messages::{Command, Event, Reading, Truth};
use masseter_runtime::named::Parameter;
use masseter_scenario::{ForceControlConfig, LateralForceConfig};

use super::*;
use crate::{Analysis, Figures};

const PERIOD_S: f64 = 1e-3;

fn scenario() -> Scenario {
    Scenario { duration_s: Some(2.0), ..Scenario::default() }
}

fn motion() -> Trajectory {
    let scenario = scenario();
    let mechanism = Mechanism::new(&scenario.mechanism).unwrap();
    Trajectory::new(&scenario.motion, &scenario.jaw, &mechanism, scenario.duration_s).unwrap()
}

/// What a controller states of a sample at this time of the trajectory.
fn state(motion: &Trajectory, at_s: f64) -> State {
    let (desired_position_m, desired_quaternion_wxyz) = pose_fields(&motion.pose(at_s));
    let motion_time_s = motion.motion_time_s(at_s);
    State { motion_time_s, desired_position_m, desired_quaternion_wxyz, ..State::default() }
}

/// Cycles of a motion: what the controller states of each, or `None` if it used no reading.
fn desired(reference: &mut Reference, states: &[Option<State>]) -> Vec<Desired> {
    let cycle = |(place, used): (usize, &Option<State>)| {
        reference.advance(&Progress {
            cycle: place as u64 + 1,
            has_sync: true,
            has_run: true,
            reading: None,
            is_disturbed: false,
            state: Some(ControllerState::Running.code()),
            next_use: states[place..].iter().flatten().next(),
            is_used: used.is_some(),
            is_open: false,
            parameters: None,
        })
    };
    states.iter().enumerate().map(cycle).collect()
}

fn apart_m(desired: &Desired, motion: &Trajectory, at_s: f64) -> f64 {
    (desired.pose.unwrap().translation.vector - motion.pose(at_s).translation.vector).norm()
}

#[test]
fn the_pose_is_the_scenarios_whatever_the_controller_states_as_desired() {
    let motion = motion();
    let honest: Vec<_> = (0..2000).map(|cycle| Some(state(&motion, f64::from(cycle) * PERIOD_S))).collect();
    let liar: Vec<_> = honest
        .iter()
        .map(|state| state.map(|state| State { desired_position_m: [0.0; 3], ..state }))
        .collect();
    for states in [honest, liar] {
        let found = desired(&mut Reference::new(&scenario(), &Declared::default()), &states);
        for (cycle, desired) in found.iter().enumerate() {
            assert!(apart_m(desired, &motion, cycle as f64 * PERIOD_S) < 1e-9, "{cycle}");
            assert_eq!(desired.lag_s, Some(0.0), "{cycle}");
        }
    }
}

/// Ten readings are lost at 0.7 s: the controller waits for nine cycles.
#[test]
fn a_motion_that_waits_is_late_and_its_pose_waits_too() {
    let motion = motion();
    let at_s =
        |cycle: usize| if cycle < 710 { cycle as f64 * PERIOD_S } else { (cycle - 9) as f64 * PERIOD_S };
    let states: Vec<_> =
        (0..1500).map(|cycle| (!(700..710).contains(&cycle)).then(|| state(&motion, at_s(cycle)))).collect();
    let found = desired(&mut Reference::new(&scenario(), &Declared::default()), &states);
    for (cycle, desired) in found.iter().enumerate() {
        let waits_s = if (700..710).contains(&cycle) { at_s(cycle).min(at_s(710)) } else { at_s(cycle) };
        assert!(apart_m(desired, &motion, waits_s) < 1e-8, "{cycle}");
    }
    let lag_s = found.last().unwrap().lag_s.unwrap();
    assert!((lag_s - 0.009).abs() < 1e-6, "{lag_s}");
}

#[test]
fn a_controller_that_states_no_progress_is_late_and_waits_for_no_longer_than_the_limit() {
    let motion = motion();
    let still: Vec<_> =
        (0..1000).map(|_| Some(State { motion_time_s: 0.0, ..state(&motion, 0.0) })).collect();
    let found = desired(&mut Reference::new(&scenario(), &Declared::default()), &still);
    let last = found.last().unwrap();
    assert!(last.lag_s.unwrap() > 0.9 && apart_m(last, &motion, 0.999 - 0.020) < 1e-8, "{last:?}");
    // Without a time, or ahead, nothing is late.
    for motion_time_s in [f64::NAN, -1.0, 9.0] {
        let states: Vec<_> =
            still.iter().map(|of| of.map(|state| State { motion_time_s, ..state })).collect();
        let found = desired(&mut Reference::new(&scenario(), &Declared::default()), &states);
        assert!(
            found.last().is_some_and(|last| last.lag_s == Some(0.0) && apart_m(last, &motion, 0.999) < 1e-8)
        );
    }
}

#[test]
fn what_was_late_stays_late() {
    let motion = motion();
    let catches_up =
        |cycle: u32| f64::from(if (500..600).contains(&cycle) { cycle - 10 } else { cycle }) * PERIOD_S;
    let states: Vec<_> = (0..700).map(|cycle| Some(state(&motion, catches_up(cycle)))).collect();
    let found = desired(&mut Reference::new(&scenario(), &Declared::default()), &states);
    assert!((found.last().unwrap().lag_s.unwrap() - 0.010).abs() < 1e-6);
}

#[test]
fn a_stop_by_request_and_a_slower_rate_are_taken_over() {
    let motion = motion();
    let states: Vec<_> = (0..1900).map(|cycle| Some(state(&motion, f64::from(cycle) * PERIOD_S))).collect();
    let mut reference = Reference::new(&scenario(), &Declared::default());
    let stop =
        Event { cycle: 800, ..Event::new(Source::Controller, EventKind::Transition, Cause::StopRequested) };
    reference.apply_event(&EventRecord::from(&stop));
    let found = desired(&mut reference, &states);
    let [near_end, end] = [1700, 1899].map(|place: usize| found[place].pose.unwrap());
    assert!((near_end.translation.vector - end.translation.vector).norm() < 1e-12, "it has come to rest");
    assert_eq!(reference.rest(|_, _| 1.0), Some(0.0));

    let rate = Parameter::new("motion_rate", 1.0);
    let declared = Declared { parameters: vec![rate], ..Declared::default() };
    let mut slow = Reference::new(&scenario(), &declared);
    let mut parameters = Parameters::default();
    parameters.parameters.length = 1;
    let mut last = Desired::default();
    for cycle in 1..=1000 {
        let state = Some(ControllerState::Running.code());
        let progress = Progress {
            cycle,
            has_sync: true,
            has_run: true,
            reading: None,
            is_disturbed: false,
            state,
            next_use: None,
            is_used: false,
            is_open: false,
            parameters: Some(&parameters),
        };
        last = slow.advance(&progress);
    }
    assert!(apart_m(&last, &motion, 0.0) < 1e-8, "at rate 0 the motion stays where it is");
}

#[test]
fn before_the_motion_and_in_an_own_one_the_controllers_pose_counts_and_after_it_the_last_one() {
    let motion = motion();
    let own = Declared { motion: PlayedMotion::Own, ..Declared::default() };
    let beside = State { desired_position_m: [0.1, 0.0, 0.3], ..state(&motion, 0.0) };
    let advance = |reference: &mut Reference, state: ControllerState, used: &State| {
        let (next_use, state) = (Some(used), Some(state.code()));
        reference.advance(&Progress {
            cycle: 1,
            has_sync: true,
            has_run: true,
            reading: None,
            is_disturbed: false,
            state,
            next_use,
            is_used: true,
            is_open: false,
            parameters: None,
        })
    };
    let mut of_scenario = Reference::new(&scenario(), &Declared::default());
    let eased = advance(&mut of_scenario, ControllerState::Easing, &beside);
    assert!((eased.pose.unwrap().translation.x - 0.1).abs() < 1e-9 && eased.lag_s.is_none());
    let running = advance(&mut of_scenario, ControllerState::Running, &beside);
    assert!(apart_m(&running, &motion, 0.0) < 1e-9, "the scenario's first pose");
    let ends = advance(&mut of_scenario, ControllerState::Disabling, &beside);
    let after = advance(&mut of_scenario, ControllerState::Finished, &beside);
    assert_eq!(ends.pose, after.pose);
    let mut of_controller = Reference::new(&scenario(), &own);
    let running = advance(&mut of_controller, ControllerState::Running, &beside);
    assert!((running.pose.unwrap().translation.x - 0.1).abs() < 1e-9 && running.lag_s.is_none());
    assert_eq!(of_controller.rest(|_, _| 1.0), None);
}

/// Messages of a controller that plays for so many cycles and says that it has finished; the jaw is where `place` says, and the
/// desired pose is what it states.
fn figures(
    cycles: u64,
    place: impl Fn(&Trajectory, f64) -> Pose,
    has_reading: impl Fn(u64) -> bool,
) -> Figures {
    let motion = motion();
    let mut analysis = Analysis::new(&scenario(), &Declared::default());
    let mut take = |message: Recorded| analysis.take(&message).unwrap();
    for cycle in 1..=cycles + 10 {
        let (at_s, sampled_ns) = ((cycle - 1) as f64 * PERIOD_S, cycle * 1_000_000);
        let actual = place(&motion, at_s);
        let (position_m, quaternion_wxyz) = pose_fields(&actual);
        let drive_state = [DriveState::OperationEnabled.code(); 6];
        let answers_cycle = cycle;
        take(
            Reading {
                seq: cycle,
                cycle,
                sampled_ns,
                drive_state,
                answers_cycle,
                fresh_axes: 63,
                ..Reading::default()
            }
            .into(),
        );
        take(Truth { seq: cycle, cycle, sampled_ns, position_m, quaternion_wxyz, ..Truth::default() }.into());
        take(Command { seq: cycle, cycle, ..Command::default() }.into());
        let is_over = cycle > cycles;
        let name = if is_over { ControllerState::Finished } else { ControllerState::Running };
        let reading_cycle = if has_reading(cycle) { cycle } else { 0 };
        let stated = state(&motion, at_s);
        take(
            State {
                seq: cycle,
                cycle,
                reading_cycle,
                sampled_ns,
                controller_state: name.code(),
                // The controller says that the jaw is where it should be.
                desired_position_m: position_m,
                desired_quaternion_wxyz: quaternion_wxyz,
                estimated_position_m: position_m,
                estimated_quaternion_wxyz: quaternion_wxyz,
                ..stated
            }
            .into(),
        );
    }
    analysis.finish(false, &[])
}

/// V1 and V2: whoever says that the jaw is where it should be is judged by the scenario's motion.
#[test]
fn a_jaw_that_never_moves_has_played_nothing_and_one_that_moves_has_played_all() {
    let still = figures(200, |motion, _| motion.pose(0.0), |_| true);
    assert!(still.motion.played.unwrap().abs() < 0.005, "{:?}", still.motion);
    let as_long = figures(2000, |motion, _| motion.pose(0.0), |_| true);
    assert!(as_long.motion.played.unwrap().abs() < 0.005, "{:?}", as_long.motion);
    assert!(as_long.tracking.actual.incisal_max_mm.unwrap() > 5.0, "{:?}", as_long.tracking.actual);
    let moves = figures(2001, Trajectory::pose, |_| true);
    assert!((moves.motion.played.unwrap() - 1.0).abs() < 0.01, "{:?}", moves.motion);
    assert!(moves.tracking.actual.incisal_max_mm.unwrap() < 1e-6, "{:?}", moves.tracking.actual);
    assert_eq!(moves.motion.missed_commands, 0);
    let half = figures(1000, Trajectory::pose, |_| true);
    assert!((0.2..0.8).contains(&half.motion.played.unwrap()), "{:?}", half.motion);
}

/// States of cycles whose readings show drives that are enabled from the third cycle on.
fn in_order(states: &[ControllerState], motion: PlayedMotion) -> Option<Disorder> {
    let mut order = StateOrder::new(&scenario(), &Declared { motion, ..Declared::default() });
    for (cycle, state) in (1..).zip(states) {
        order.advance(Some(state.code()), Some(&reading(cycle, cycle >= 3)), true);
    }
    order.disorder().map(|(disorder, _)| disorder)
}

fn reading(cycle: u64, are_enabled: bool) -> Reading {
    let state = if are_enabled { DriveState::OperationEnabled } else { DriveState::SwitchedOn };
    Reading { cycle, drive_state: [state.code(); 6], fresh_axes: 63, ..Reading::default() }
}

#[test]
fn states_have_an_order_and_a_motion_its_enabled_drives() {
    use ControllerState::{Disabling, Easing, Enabling, Finished, Holding, Running, SafeStop, WaitReadings};
    let back = |from, to| Some(Disorder::Back { from, to });
    let cases = [
        (&[WaitReadings, Enabling, Easing, Running, Holding, Disabling, Finished][..], None),
        (&[Enabling, WaitReadings, Enabling, Running, SafeStop], None),
        (&[Enabling, Enabling, Easing, Easing, Finished], Some(Disorder::NeverBegan)),
        (&[Enabling, Running, Running], Some(Disorder::BeforeDrives)),
        (&[Enabling, Enabling, Running, Enabling, Running], back(Running, Enabling)),
        (&[Enabling, Enabling, Running, Easing, Running], back(Running, Easing)),
        (&[Enabling, Enabling, Running, Finished, Running], back(Finished, Running)),
    ];
    for (states, expected) in cases {
        assert_eq!(in_order(states, PlayedMotion::Scenario), expected, "{states:?}");
    }
    let pause = [Enabling, Enabling, Easing, Running, Holding, Running];
    assert_eq!(in_order(&pause, PlayedMotion::Scenario), back(Holding, Running));
    assert_eq!(in_order(&pause, PlayedMotion::Own), None, "an own motion may hold and go on");
    let left = [Enabling, Enabling, Running, Enabling, Running];
    assert_eq!(in_order(&left, PlayedMotion::Own), back(Running, Enabling));
}

/// The drives are enabled in the first cycle: with a lead-in of 1.003 s the motion begins in cycle 1004, whatever the controller says.
#[test]
fn a_motion_begins_at_the_end_of_the_lead_in_at_the_latest() {
    let motion = motion();
    let waits = State { motion_time_s: -1.0, ..state(&motion, 0.0) };
    for stated in [ControllerState::WaitReadings, ControllerState::Enabling, ControllerState::Easing] {
        let mut reference = Reference::new(&scenario(), &Declared::default());
        let mut advance = |cycle: u64, state: ControllerState, used: &State| {
            reference.advance(&Progress {
                cycle,
                has_sync: true,
                has_run: true,
                reading: Some(&reading(cycle, true)),
                is_disturbed: false,
                state: Some(state.code()),
                next_use: Some(used),
                is_used: true,
                is_open: false,
                parameters: None,
            })
        };
        let before = (1..=1003).map(|cycle| advance(cycle, stated, &waits)).last().unwrap();
        assert_eq!((before.lag_s, before.is_awaited), (None, false));
        assert_eq!(advance(1004, stated, &waits).lag_s, Some(0.0));
        let late = (1005..=1034).map(|cycle| advance(cycle, stated, &waits)).last().unwrap();
        assert!(late.is_awaited && (late.lag_s.unwrap() - 0.030).abs() < 1e-9, "{late:?}");
        let begun = advance(1035, ControllerState::Running, &state(&motion, 0.0));
        assert!(!begun.is_awaited && begun.lag_s.unwrap() >= 0.030, "what is late stays late: {begun:?}");
        assert!((reference.lag_causes_ms()[0] - 30.0).abs() < 1e-6);
    }
}

/// A parameter of the motion is the operator's: a value that the controller declares for itself changes nothing.
#[test]
fn a_controller_scales_its_motion_only_by_order() {
    let motion = motion();
    let amplitude = |of_scenario: Option<f64>| {
        let mut scenario = scenario();
        scenario.parameters.extend(of_scenario.map(|value| ("motion_amplitude".to_owned(), value)));
        let parameters = vec![Parameter::new("motion_amplitude", of_scenario.unwrap_or(0.0))];
        let mut reference = Reference::new(&scenario, &Declared { parameters, ..Declared::default() });
        let mut values = Parameters::default();
        (values.parameters.length, values.parameters.values[0]) = (1, of_scenario.unwrap_or(0.0));
        let advance = |cycle| {
            reference.advance(&Progress {
                cycle,
                has_sync: true,
                has_run: true,
                reading: None,
                is_disturbed: false,
                state: Some(ControllerState::Running.code()),
                next_use: None,
                is_used: false,
                is_open: false,
                parameters: Some(&values),
            })
        };
        (1..=700).map(advance).last().unwrap()
    };
    assert!(apart_m(&amplitude(None), &motion, 0.699) < 1e-8, "the controller's own zero");
    assert!(apart_m(&amplitude(Some(0.0)), &motion, 0.0) < 1e-8, "the scenario's zero");
}

/// The motion of 2 s is slow enough that no other check sees a jaw that is 30 ms ahead.
#[test]
fn a_jaw_that_is_ahead_of_its_motion_is_told_and_one_that_is_late_or_beside_it_is_not() {
    let ahead = |place: fn(&Trajectory, f64) -> Pose| figures(2001, place, |_| true).motion.ahead_ms;
    let found = ahead(|motion, at_s| motion.pose(at_s + 0.030)).unwrap();
    assert!((found - 30.0).abs() < 3.0, "{found}");
    assert!(
        ahead(|motion, at_s| motion.pose(at_s + 0.030 * ((at_s - 0.8) / 0.2).clamp(0.0, 1.0)))
            .is_some_and(|found| found > 20.0)
    );
    for place in [
        Trajectory::pose as fn(&Trajectory, f64) -> Pose,
        |motion, at_s| motion.pose(at_s + 0.010),
        |motion, at_s| motion.pose(at_s - 0.030),
        |motion, at_s| Pose::translation(0.0, 0.0, 1e-3) * motion.pose(at_s),
        |motion, at_s| motion.pose(0.0).lerp_slerp(&motion.pose(at_s), 0.95),
    ] {
        assert_eq!(ahead(place), None);
    }
}

/// V5: the jaw strays in the cycles of which the controller has no reading.
#[test]
fn a_jaw_that_strays_while_readings_are_lost_is_seen() {
    let strays = |motion: &Trajectory, at_s: f64| {
        let mut pose = motion.pose(at_s);
        if (0.7005..0.7055).contains(&at_s) {
            pose.translation.x += 1e-3;
        }
        pose
    };
    let found = figures(2001, strays, |cycle| !(701..=707).contains(&cycle));
    assert!((found.tracking.actual.max_mm.unwrap() - 1.0).abs() < 0.01, "{:?}", found.tracking.actual);
    assert_eq!(found.tracking.samples, 2001);
}

/// The plant loses ten cycles: the controller takes one step, and waits. Later the controller loses ten, and the machine makes it wait
/// for fifty.
#[test]
fn cycles_that_a_loop_lost_are_no_lag() {
    let motion = motion();
    let mut reference = Reference::new(&scenario(), &Declared::default());
    let mut at_s = -PERIOD_S;
    let mut last = Desired::default();
    for cycle in 1..=1000 {
        let (has_sync, has_run) = (!(501..=510).contains(&cycle), !(701..=710).contains(&cycle));
        let waits = (!has_sync && cycle != 501) || (851..=900).contains(&cycle);
        at_s += if has_run && !waits { PERIOD_S } else { 0.0 };
        let used = state(&motion, at_s);
        let (is_used, next_use) = (has_sync && has_run, (has_sync && has_run).then_some(&used));
        let state = Some(ControllerState::Running.code());
        last = reference.advance(&Progress {
            cycle,
            has_sync,
            has_run,
            reading: None,
            is_disturbed: (850..=900).contains(&cycle),
            state,
            next_use,
            is_used,
            is_open: false,
            parameters: None,
        });
        if is_used {
            assert!(apart_m(&last, &motion, at_s) < 1e-8, "{cycle}");
        }
    }
    assert!(last.lag_s.unwrap() < 1e-6, "{last:?}");
}

/// A controller that leads the jaw aside in a bite, and one that does so with an open mouth and states the place as desired.
#[test]
fn a_lateral_detour_counts_only_while_something_is_between_the_teeth() {
    let motion = motion();
    let force_control = ForceControlConfig {
        lateral: Some(LateralForceConfig { reach_m: 0.005, ..LateralForceConfig::default() }),
        ..ForceControlConfig::default()
    };
    let scenario = Scenario { force_control: Some(force_control), ..scenario() };
    for (is_open, expected_m) in [(false, 0.003), (true, 0.0)] {
        let mut reference = Reference::new(&scenario, &Declared::default());
        let mut last = Desired::default();
        for cycle in 1..=100_u32 {
            let mut aside = state(&motion, f64::from(cycle - 1) * PERIOD_S);
            aside.desired_position_m[1] += 0.003;
            last = reference.advance(&Progress {
                cycle: cycle.into(),
                has_sync: true,
                has_run: true,
                reading: None,
                is_disturbed: false,
                state: Some(ControllerState::Running.code()),
                next_use: Some(&aside),
                is_used: true,
                is_open,
                parameters: None,
            });
        }
        let moved_m = apart_m(&last, &motion, 99.0 * PERIOD_S);
        assert!((moved_m - expected_m).abs() < 1e-6, "{is_open}: {moved_m}");
    }
}
