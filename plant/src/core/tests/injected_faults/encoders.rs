//! Faults of encoders.

use super::*;

#[test]
fn an_encoder_with_an_offset_leads_the_axis_away_and_back() {
    let mut bench =
        bench_with(FaultConfig { for_s: Some(0.1), ..on_l2(EncoderFault::Offset, Some("50 um")) });
    hold_until(&mut bench, 0.49);
    let (seen_m, is_m) = (bench.reading.position_m[L2], bench.truth.joint_m[L2]);
    let held_m = bench.reading.position_m;
    hold_at(&mut bench, held_m, 0.59);
    assert!((bench.reading.position_m[L2] - seen_m).abs() < 1e-5, "the drive corrects what it sees");
    assert!((bench.truth.joint_m[L2] - is_m + 5e-5).abs() < 1e-5, "{}", bench.truth.joint_m[L2] - is_m);
    hold_at(&mut bench, held_m, 0.75);
    assert!((bench.truth.joint_m[L2] - is_m).abs() < 1e-5);
}

#[test]
fn the_brake_holds_the_axis_though_its_encoder_drifts() {
    let mut bench = bench_with(on_l2(EncoderFault::Drift, Some("50 mm/s")));
    hold_until(&mut bench, 0.55);
    let mut switch_off = || {
        (0..100).for_each(|_| bench.cycle(Some(&|reading| (reading.position_m, DriveRequest::Off))));
        bench.truth.joint_m[L2]
    };
    let stopped_m = switch_off();
    switch_off();
    assert!(bench.plant.master.drives_are_off());
    assert!((bench.truth.joint_m[L2] - stopped_m).abs() < 1e-5);
    assert!((bench.reading.position_m[L2] - stopped_m).abs() > 0.01, "the encoder drifts on");
}

#[test]
fn offsets_that_overlap_add_up_and_each_is_counted_by_itself() {
    let offset = |size: &str, [from_s, for_s]: [f64; 2]| FaultConfig {
        from_s: Some(from_s),
        for_s: Some(for_s),
        ..on_l2(EncoderFault::Offset, Some(size))
    };
    let faults = vec![offset("20 um", [0.5, 0.4]), offset("30 um", [0.6, 0.1]), offset("0 um", [0.55, 0.3])];
    let mut bench = Bench::new(&Scenario { faults, ..Scenario::default() });
    hold_until(&mut bench, 0.49);
    let (held_m, is_m) = (bench.reading.position_m, bench.truth.joint_m[L2]);
    for (until_s, led_m) in [(0.59, 2e-5), (0.69, 5e-5), (0.89, 2e-5), (1.1, 0.0)] {
        hold_at(&mut bench, held_m, until_s);
        let away_m = is_m - bench.truth.joint_m[L2];
        assert!((away_m - led_m).abs() < 8e-6, "{until_s} s: {away_m}");
    }
    let numbers = |cause| told(&bench, cause).iter().map(|event| event.value).collect::<Vec<_>>();
    assert_eq!([numbers(Cause::FaultInjected), numbers(Cause::FaultEnded)], [[1.0, 2.0], [2.0, 1.0]]);
}

#[test]
fn a_stuck_encoder_shows_one_number_though_another_one_sticks_and_lets_go() {
    let stuck = |[from_s, for_s]: [f64; 2]| FaultConfig {
        from_s: Some(from_s),
        for_s: Some(for_s),
        ..on_l2(EncoderFault::Stuck, None)
    };
    let faults = vec![stuck([0.5, 0.2]), stuck([0.55, 0.05])];
    let mut bench = Bench::new(&Scenario { faults, ..Scenario::default() });
    hold_until(&mut bench, 0.502);
    let shown_m = bench.reading.position_m[L2];
    let held_m = bench.reading.position_m;
    while bench.cycle < 699 {
        bench.cycle(Some(&|_| (held_m, DriveRequest::Enable)));
        assert_eq!(bench.reading.position_m[L2].to_bits(), shown_m.to_bits(), "{}", bench.cycle);
    }
}
