//! Faults of the mechanism.

use super::*;

#[test]
fn a_jam_stops_the_axis_at_once_and_holds_it() {
    let mut bench = bench_with(FaultConfig { for_s: Some(0.2), ..on_l2(AxisFault::Jam, None) });
    play_until(&mut bench, 0.505);
    let stuck_m = bench.truth.joint_m[L2];
    assert!(bench.truth.joint_m_s[L2].abs() < 1e-3, "{}", bench.truth.joint_m_s[L2]);
    for _ in 0..100 {
        bench.cycle(Some(&|_| ([0.0; AXES], DriveRequest::Off)));
        assert!((bench.truth.joint_m[L2] - stuck_m).abs() < 2e-4);
    }
}

#[test]
fn dry_guides_take_more_force_for_the_same_motion() {
    let force_n = |factor: &str| {
        let mut bench = bench_with(fault(AxisFault::Friction, Some(factor), 0));
        // About where the slide moves fastest.
        play_until(&mut bench, 0.69);
        assert_eq!(first_failure(&bench), None);
        bench.truth.force_n[0].abs()
    };
    let (usual_n, more_n) = (force_n("1"), force_n("3"));
    // Twice 5 N more, the screw, and some viscous friction.
    assert!((12.0..25.0).contains(&(more_n - usual_n)), "{usual_n} N became {more_n} N");
}

#[test]
fn with_play_the_platform_drops_by_half_of_it_and_the_encoder_does_not_see_that() {
    let mut bench = bench_with(on_l2(AxisFault::Play, Some("0.4 mm")));
    hold_until(&mut bench, 0.49);
    let (seen_m, is_m) = (bench.reading.position_m[L2], bench.truth.joint_m[L2]);
    hold_until(&mut bench, 0.8);
    assert_eq!(first_failure(&bench), None);
    assert!((bench.reading.position_m[L2] - seen_m).abs() < 2e-5);
    assert!((is_m - bench.truth.joint_m[L2] - 2e-4).abs() < 2e-5, "{}", is_m - bench.truth.joint_m[L2]);
}

#[test]
fn a_broken_rod_drops_the_leg_while_its_drive_stands() {
    let mut bench = bench_with(on_l2(AxisFault::BrokenRod, None));
    hold_until(&mut bench, 0.49);
    let (seen_m, is_m) = (bench.reading.position_m[L2], bench.truth.joint_m[L2]);
    hold_until(&mut bench, 1.0);
    assert!((bench.reading.position_m[L2] - seen_m).abs() < 1e-4);
    assert!(is_m - bench.truth.joint_m[L2] > 0.005, "{}", is_m - bench.truth.joint_m[L2]);
}

#[test]
fn an_axis_that_falls_on_its_end_stop_is_an_event() {
    let mut scenario = Scenario { faults: vec![on_l2(AxisFault::BrokenRod, None)], ..Scenario::default() };
    scenario.mechanism.strokes.leg_m = [0.288, 0.3];
    scenario.dynamics.axes.stop_beyond_m = 0.0;
    let mut bench = Bench::new(&scenario);
    bench.enable();
    bench.controller_state = ControllerState::Running;
    hold_until(&mut bench, 1.5);
    let hits = bench.events.iter().filter(|event| event.cause == Cause::EndStopHit.code());
    let hit = hits.clone().next().expect("the leg falls on its stop");
    assert_eq!((hit.axis, hit.source), (L2 as u32, Source::Scenario.code()));
    let speeds: Vec<_> = hits.map(|hit| hit.value).collect();
    assert!(hit.value < 0.0 && speeds.len() <= 3, "the leg rests after a bounce: {speeds:?}");
    assert!((bench.truth.joint_m[L2] - 0.288).abs() < 1e-4, "{}", bench.truth.joint_m[L2]);
}

#[test]
fn a_hard_stop_ends_the_axis_way() {
    let mut sound = Bench::new(&Scenario::default());
    play_until(&mut sound, 0.501);
    let from_m = sound.truth.joint_m[L2];
    let mut bench = bench_with(on_l2(AxisFault::EndStop, Some("0.5 mm")));
    play_until(&mut bench, 0.8);
    assert_eq!(first_failure(&bench), Some((Cause::FollowingError, 4)));
    let way_m = (bench.truth.joint_m[L2] - from_m).abs();
    assert!((0.3e-3..0.75e-3).contains(&way_m), "{way_m}");
}
