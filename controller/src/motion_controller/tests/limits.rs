//! Commands keep every axis within its velocity limit, and a requested stop only slows down.

use super::*;

#[test]
fn a_jaw_too_far_from_the_first_pose_is_not_moved_and_no_drive_is_enabled() {
    let mut scenario = short();
    scenario.controller.start_tolerance_mm = Some(5.0);
    // The first pose has legs of 0.2974 m.
    for (leg_m, is_near) in [(0.29, false), (0.297, true)] {
        let mut bench = Bench::of(&scenario, [leg_m; LEGS]);
        for _ in 0..50 {
            bench.cycle(Some);
            let is_off = bench.commands[1].request != DriveRequest::Enable.code();
            assert!(is_near || is_off, "no drive is enabled");
        }
        assert_eq!(bench.controller.state() == ControllerState::SafeStop, !is_near);
        let fault = bench.events.iter().find(|event| event.cause == Cause::StartTooFar.code());
        assert_eq!(fault.map(|fault| (fault.limit, fault.value > 5e-3)), (!is_near).then_some((5e-3, true)));
    }
}

/// The highest speed of each axis' targets in an undisturbed run, m/s.
fn highest_speed_m_s() -> [f64; AXES] {
    let mut bench = Bench::new();
    let mut highest_m_s = [0.0_f64; AXES];
    bench.run_until(ControllerState::Easing);
    for _ in 0..5000 {
        let before_m = bench.commands[1].target_m;
        bench.cycle(Some);
        for (axis, highest_m_s) in highest_m_s.iter_mut().enumerate() {
            let step_m = bench.commands[1].target_m[axis] - before_m[axis];
            *highest_m_s = highest_m_s.max(step_m.abs() / bench.controller.sequencer.period_s);
        }
    }
    assert_eq!(bench.controller.state(), ControllerState::Finished);
    highest_m_s
}

#[test]
fn an_axis_that_would_pass_its_velocity_limit_stops_the_controller() {
    for (axis, highest_m_s) in highest_speed_m_s().into_iter().enumerate() {
        let run_with = |limit_m_s: f64| {
            let mut bench = Bench::new();
            bench.controller.targets.velocity_limit_m_s[axis] = limit_m_s;
            (0..5000).for_each(|_| bench.cycle(Some));
            bench
        };
        assert_eq!(run_with(1.01 * highest_m_s).controller.state(), ControllerState::Finished);
        let limit_m_s = 0.99 * highest_m_s;
        let bench = run_with(limit_m_s);
        assert_eq!(bench.controller.state(), ControllerState::SafeStop, "axis {axis}, {highest_m_s} m/s");
        assert_eq!(bench.last_cause(), Cause::VelocityLimit);
        let told = bench.events.last().unwrap();
        assert_eq!((told.axis, told.limit), (axis as u32, limit_m_s));
        assert!(told.value > limit_m_s);
    }
}

#[test]
fn the_clock_of_a_motion_that_is_asked_to_stop_only_slows_down() {
    let mut bench = Bench::of(&Scenario { duration_s: Some(4.0), ..Scenario::default() }, [0.29; LEGS]);
    bench.run_until(ControllerState::Running);
    (0..1000).for_each(|_| bench.cycle(Some));
    bench.controller.request_stop();
    let ControllerConfig { stop_ramp_s, .. } = ControllerConfig::default();
    let ramp_cycles = (stop_ramp_s / bench.controller.sequencer.period_s).round() as usize;
    let mut state = State::default();
    let mut times_s = Vec::new();
    for _ in 0..ramp_cycles + 100 {
        bench.controller.fill_state(&mut state);
        times_s.push(state.motion_time_s);
        bench.cycle(Some);
    }
    assert_eq!(bench.controller.state(), ControllerState::Holding);
    let steps_s: Vec<_> = times_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
    assert!((steps_s[0] - bench.controller.sequencer.period_s).abs() < 1e-9, "{}", steps_s[0]);
    for (cycle, pair) in steps_s.windows(2).enumerate() {
        assert!((0.0..=pair[0] + 1e-12).contains(&pair[1]), "cycle {cycle}: {pair:?}");
    }
    let (slowing, resting) = steps_s.split_at(ramp_cycles + 1);
    assert!(resting.iter().all(|step_s| step_s.abs() < 1e-9), "{resting:?}");
    let way_s: f64 = slowing.iter().sum();
    assert!((way_s - stop_ramp_s / 2.0).abs() < 3.0 * bench.controller.sequencer.period_s, "{way_s}");
}
