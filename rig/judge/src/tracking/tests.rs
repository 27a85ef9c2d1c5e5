//! States and truths made by hand.

use super::*;

const PERIOD_NS: u64 = 1_000_000;

fn state(cycle: u64, x: f64) -> State {
    State {
        cycle,
        reading_cycle: cycle,
        desired_position_m: [x, 0.0, 0.0],
        desired_quaternion_wxyz: [1.0, 0.0, 0.0, 0.0],
        estimated_quaternion_wxyz: [1.0, 0.0, 0.0, 0.0],
        controller_state: ControllerState::Running.code(),
        ..Default::default()
    }
}

fn truth(cycle: u64, x: f64) -> Truth {
    Truth { cycle, position_m: [x, 0.0, 0.0], quaternion_wxyz: [1.0, 0.0, 0.0, 0.0], ..Default::default() }
}

#[test]
fn without_truth_the_estimate_takes_its_place() {
    let mut tracking = Tracking::new(PoseSource::Estimate, [0.0; 3]);
    tracking.apply_state(&State { estimated_position_m: [0.001, 0.0, 0.0], ..state(1, 0.003) }, true, false);
    let (figures, track) = tracking.into_figures();
    assert_eq!((figures.samples, figures.estimate_rms_mm), (1, None));
    assert!((figures.actual.rms_mm.unwrap() - 2.0).abs() < 1e-9);
    assert!((track.samples[0].actual.translation.x - 0.001).abs() < 1e-12);
}

#[test]
fn a_platform_that_never_ran_has_no_tracking_error() {
    let mut tracking = Tracking::new(PoseSource::Truth, [0.0; 3]);
    tracking.apply_state(
        &State { controller_state: ControllerState::Easing.code(), ..state(1, 0.0) },
        true,
        false,
    );
    tracking.apply_truth(&truth(1, 0.0));
    let (figures, _) = tracking.into_figures();
    let moved =
        |peak| PoseErrors { max_mm: peak, incisal_max_mm: peak, max_deg: peak, ..PoseErrors::default() };
    let peaks = (figures.actual, figures.estimated);
    assert_eq!(peaks, (moved(Some(0.0)), moved(Some(0.0))));
    assert_eq!((figures.samples, figures.rms_noise_mm, figures.estimate_rms_mm), (0, None, None));
}

#[test]
fn a_long_run_keeps_samples_from_its_beginning_to_its_end() {
    let mut tracking = Tracking::new(PoseSource::Truth, [0.0; 3]);
    for cycle in 0..100_000 {
        // To and fro in 0.7 s, as fast as chewing.
        let x = (cycle as f64 / 700.0 * std::f64::consts::TAU).sin();
        tracking.apply_state(&state(cycle, x), true, false);
        tracking.apply_truth(&Truth { sampled_ns: cycle * PERIOD_NS, ..truth(cycle, x) });
    }
    let (_, track) = tracking.into_figures();
    let longest_ns = 4 * (SAMPLE_NS + PERIOD_NS);
    assert!(track.samples.windows(2).all(|pair| pair[1].sampled_ns - pair[0].sampled_ns <= longest_ns));
    assert_eq!(track.samples[0].sampled_ns, 0);
    assert!(99_999 * PERIOD_NS - track.samples[track.samples.len() - 1].sampled_ns <= longest_ns);
    assert!((MOST_SAMPLES / 2..=MOST_SAMPLES).contains(&track.samples.len()), "{}", track.samples.len());
}

#[test]
fn poses_are_compared_by_cycle_in_whatever_order_they_come() {
    let mut tracking = Tracking::new(PoseSource::Truth, [0.0; 3]);
    tracking.apply_state(&state(1, 0.003), true, false);
    tracking.apply_state(&state(2, 0.000), true, false);
    tracking.apply_truth(&truth(2, 0.004));
    tracking.apply_truth(&truth(1, 0.000));
    tracking.apply_truth(&truth(3, 9.000));
    let (figures, _) = tracking.into_figures();
    assert_eq!(figures.samples, 2);
    assert!((figures.actual.max_mm.unwrap() - 4.0).abs() < 1e-9);
    assert!((figures.actual.rms_mm.unwrap() - (12.5f64).sqrt()).abs() < 1e-9);
}

/// Cycle 3 has no reading of sample 2, and the motion ends with cycle 4.
#[test]
fn cycles_without_a_reading_and_the_last_one_have_a_deviation_too() {
    let mut tracking = Tracking::new(PoseSource::Truth, [0.0; 3]);
    let stale = State { reading_cycle: 1, ..state(3, 0.0) };
    let stopped = |cycle| State { controller_state: ControllerState::SafeStop.code(), ..state(cycle, 0.0) };
    let mut deviations = Vec::new();
    let found = [
        tracking.apply_state(&state(1, 0.0), true, false),
        tracking.apply_state(&stale, false, false),
        tracking.apply_state(&stopped(4), true, false),
        tracking.apply_state(&stopped(5), true, false),
    ];
    assert!(found.iter().all(Option::is_none), "{found:?}");
    for (cycle, x) in [(1, 0.001), (2, 0.003), (4, 0.004), (5, 0.005)] {
        deviations.extend(tracking.apply_truth(&truth(cycle, x)).into_iter().flatten());
    }
    let deviations: Vec<_> = deviations.iter().map(|sample| sample.deviation.origin_m).collect();
    assert_eq!(deviations, [0.001, 0.003, 0.004]);
    let (figures, _) = tracking.into_figures();
    assert_eq!((figures.samples, figures.actual.max_mm), (1, Some(4.0)));
    assert!((figures.actual.rms_mm.unwrap() - 1.0).abs() < 1e-12);
}

type Numbers = for<'a> fn(&'a mut State, &'a mut Truth) -> &'a mut [f64];

/// Each number in turn that a pose consists of, in one sample of 100 or in all.
#[test]
fn a_pose_that_is_none_is_infinitely_far_from_its_path() {
    let fields: [(Numbers, [bool; 3]); 6] = [
        (|state, _| &mut state.desired_position_m, [true, true, false]),
        (|state, _| &mut state.desired_quaternion_wxyz, [true, true, false]),
        (|state, _| &mut state.estimated_position_m, [false, true, true]),
        (|state, _| &mut state.estimated_quaternion_wxyz, [false, true, true]),
        (|_, truth| &mut truth.position_m, [true, false, true]),
        (|_, truth| &mut truth.quaternion_wxyz, [true, false, true]),
    ];
    for (field, [is_actual, is_estimated, is_estimate]) in fields {
        let length = field(&mut state(0, 0.0), &mut truth(0, 0.0)).len();
        let bad =
            [f64::NAN, f64::INFINITY].into_iter().flat_map(|number| (0..length).map(move |i| (i, number)));
        // Of a quaternion: without length, and with twice its length.
        let lengths = [0.0, 2.0].map(|number| (0, number));
        for (index, number) in bad.chain(lengths.into_iter().filter(|_| length == 4)) {
            for is_spoiled in [|cycle: u64| cycle == 50, |_| true] {
                let mut tracking = Tracking::new(PoseSource::Truth, [0.03, 0.0, 0.0]);
                let mut deviations = Vec::new();
                for cycle in 1..=100 {
                    let (mut state, mut truth) = (state(cycle, 0.0), truth(cycle, 0.0));
                    if is_spoiled(cycle) {
                        field(&mut state, &mut truth)[index] = number;
                    }
                    tracking.apply_state(&state, true, false);
                    deviations.extend(tracking.apply_truth(&truth).into_iter().flatten());
                }
                let (figures, _) = tracking.into_figures();
                let TrackingFigures { samples, actual, estimated, estimate_rms_mm, .. } = figures;
                let place = format!("{index} {number} {figures:?}");
                assert_eq!(samples, 100, "{place}");
                for (errors, is_bad) in [(actual, is_actual), (estimated, is_estimated)] {
                    let expected = Some(if is_bad { f64::INFINITY } else { 0.0 });
                    let PoseErrors { rms_mm, max_mm, incisal_rms_mm, incisal_max_mm, rms_deg, max_deg } =
                        errors;
                    let found = [rms_mm, max_mm, incisal_rms_mm, incisal_max_mm, rms_deg, max_deg];
                    assert_eq!(found, [expected; 6], "{place}");
                }
                assert_eq!(estimate_rms_mm == Some(f64::INFINITY), is_estimate, "{place}");
                let bad = deviations.iter().filter(|sample| sample.deviation.angle_rad.is_infinite()).count();
                let spoiled = (1..=100).filter(|cycle| is_actual && is_spoiled(*cycle)).count();
                assert_eq!((deviations.len(), bad), (100, spoiled), "{place}");
            }
        }
    }
}

#[test]
fn after_a_safe_stop_the_track_goes_on_beside_the_last_desired_pose() {
    let mut tracking = Tracking::new(PoseSource::Truth, [0.0; 3]);
    for cycle in 1..=60 {
        let x = cycle as f64 * 1e-3;
        let name = if cycle < 20 { ControllerState::Running } else { ControllerState::SafeStop };
        let state = State { controller_state: name.code(), ..state(cycle, x) };
        tracking.apply_state(&state, true, false);
        tracking.apply_truth(&Truth { sampled_ns: cycle * SAMPLE_NS, ..truth(cycle, x) });
    }
    let (figures, track) = tracking.into_figures();
    assert_eq!(figures.samples, 19);
    let last = track.samples.last().unwrap();
    assert_eq!((last.sampled_ns, last.actual.translation.x), (60 * SAMPLE_NS, 0.06));
    assert!((last.desired.translation.x - 0.02).abs() < 1e-12, "the sample that ended the motion");
}

#[test]
fn once_the_drives_are_stopped_no_desired_pose_counts_whatever_the_controller_reports() {
    let mut tracking = Tracking::new(PoseSource::Truth, [0.0; 3]);
    for cycle in 1..=60 {
        if cycle == 20 {
            tracking.stop(cycle);
        }
        tracking.apply_state(&state(cycle, cycle as f64 * 1e-3), true, false);
        // The jaw stands from then on.
        tracking.apply_truth(&truth(cycle, cycle.min(20) as f64 * 1e-3));
    }
    let (figures, _) = tracking.into_figures();
    assert_eq!((figures.samples, figures.actual.max_mm), (19, Some(0.0)));
}
