//! Late readings, and processes that stop for a while.

use super::*;

#[test]
fn a_late_reading_is_compared_with_the_desired_pose_at_its_own_sample() {
    let mut bench = Bench::new();
    bench.run_until(ControllerState::Running);
    let mut delayed = bench.reading();
    for _ in 0..600 {
        bench.cycle(|reading| Some(std::mem::replace(&mut delayed, reading)));
    }
    assert_eq!(bench.controller.state(), ControllerState::Running);
    let mut state = State::default();
    bench.controller.fill_state(&mut state);
    assert_eq!(state.reading_cycle + 1, state.cycle);
    let desired = nalgebra::Vector3::from(state.desired_position_m);
    assert!((desired - nalgebra::Vector3::from(state.estimated_position_m)).norm() < 5e-5);
    let at_its_time = trajectory(&short()).pose_in_motion(state.motion_time_s).translation.vector;
    assert!((desired - at_its_time).norm() < 1e-12);
}

/// Each for 15 cycles, with the extra length of the run.
#[test]
fn after_a_stall_the_motion_continues_from_the_position_of_the_drives_without_a_burst() {
    type Stall = fn(&mut Bench);
    let undisturbed = Bench::played(|_| ());
    let stalls: [(&str, Stall); 3] = [
        ("controller", |bench| bench.controller_stalls(15)),
        ("plant", |bench| bench.plant_stalls(15)),
        ("both", |bench| bench.cycle += 15),
    ];
    for (who, stall) in stalls {
        let stalled = Bench::played(stall);
        let (step_m, usual_m) = (stalled.largest_step_m, undisturbed.largest_step_m);
        assert!(step_m < 1.01 * usual_m, "{who}: {step_m} m in one cycle, otherwise {usual_m} m");
        let longer = stalled.cycle - undisturbed.cycle;
        assert!((14..=16).contains(&longer), "{who}: {longer} cycles longer");
    }
}

/// The desired pose waits with the drives: its steps stay as small as those of the undisturbed motion.
#[test]
fn a_stall_is_not_taken_for_lost_tracking() {
    let usual_m = Bench::played(|_| ()).largest_step_m;
    for stall in [Bench::controller_stalls, Bench::plant_stalls] {
        let bench = Bench::played(|bench| {
            stall(bench, 15);
            for _ in 0..5 {
                bench.cycle(Some);
                let mut state = State::default();
                bench.controller.fill_state(&mut state);
                let desired = nalgebra::Vector3::from(state.desired_position_m);
                let error_m = (desired - nalgebra::Vector3::from(state.estimated_position_m)).norm();
                assert!(error_m < 1.5 * usual_m, "{error_m}");
            }
        });
        assert!(bench.events.iter().all(|event| event.kind == EventKind::Transition.code()));
    }
}

/// Of fourteen readings four are incomplete, for which the motion waits three cycles.
#[test]
fn a_motion_that_waited_too_long_in_all_for_the_bus_is_late() {
    let mut bench = Bench::new();
    bench.run_until(ControllerState::Running);
    (0..150).for_each(|_| bench.cycle(Some));
    for round in 1..=7 {
        assert_eq!(bench.controller.state(), ControllerState::Running, "round {round}");
        (0..10).for_each(|_| bench.cycle(Some));
        (0..4).for_each(|_| bench.cycle(|reading| Some(Reading { fresh_axes: 0, ..reading })));
    }
    assert_eq!(
        (bench.controller.state(), bench.last_cause()),
        (ControllerState::SafeStop, Cause::MotionLate)
    );
    let told = bench.events.last().unwrap();
    assert!((told.value - 0.021).abs() < 1e-9 && (told.limit - 0.02).abs() < 1e-9, "{told:?}");
}

#[test]
fn waits_for_a_loop_that_stands_still_do_not_make_the_motion_late() {
    for stall in [Bench::controller_stalls, Bench::plant_stalls] {
        let mut bench = Bench::new();
        bench.run_until(ControllerState::Running);
        for _ in 0..6 {
            (0..40).for_each(|_| bench.cycle(Some));
            stall(&mut bench, 15);
        }
        assert_eq!(bench.controller.state(), ControllerState::Running);
    }
}
