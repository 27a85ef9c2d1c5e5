//! States and truths made by hand.

use masseter_runtime::messages::{State, Truth};

use super::*;
use crate::poses::desired_pose;
use crate::signals::CycleMessages;

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

/// A cycle whose desired pose is the state's.
#[expect(clippy::large_types_passed_by_value, reason = "a sample holds its truth")]
fn sample(state: &State, truth: Option<Truth>) -> Sample {
    let messages = CycleMessages {
        cycle: state.cycle,
        truth,
        solution: Some(*state),
        controller_state: Some(state.controller_state),
        desired: desired_pose(state),
        ..CycleMessages::default()
    };
    let time_ns = truth.map_or(0, |truth| truth.sampled_ns);
    Sample { time_ns, messages, events: Vec::new(), is_closing: false }
}

#[test]
fn without_truth_the_estimate_takes_its_place() {
    let mut tracking = Tracking::new(PoseSource::Estimate, [0.0; 3]);
    tracking.add_sample(&sample(&State { estimated_position_m: [0.001, 0.0, 0.0], ..state(1, 0.003) }, None));
    let (figures, track) = tracking.into_figures();
    assert_eq!((figures.samples, figures.estimate_rms_mm), (1, None));
    assert!((figures.actual.rms_mm.unwrap() - 2.0).abs() < 1e-9);
    assert!((track[0].actual.translation.x - 0.001).abs() < 1e-12);
}

#[test]
fn a_platform_that_never_ran_has_no_tracking_error() {
    let mut tracking = Tracking::new(PoseSource::Truth, [0.0; 3]);
    let easing = State { controller_state: ControllerState::Easing.code(), ..state(1, 0.0) };
    tracking.add_sample(&sample(&easing, Some(truth(1, 0.0))));
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
        let truth = Truth { sampled_ns: cycle * PERIOD_NS, ..truth(cycle, x) };
        tracking.add_sample(&sample(&state(cycle, x), Some(truth)));
    }
    let (_, track) = tracking.into_figures();
    let longest_ns = 4 * (SAMPLE_NS + PERIOD_NS);
    assert!(track.windows(2).all(|pair| pair[1].sampled_ns - pair[0].sampled_ns <= longest_ns));
    assert_eq!(track[0].sampled_ns, 0);
    assert!(99_999 * PERIOD_NS - track[track.len() - 1].sampled_ns <= longest_ns);
    assert!((MOST_SAMPLES / 2..=MOST_SAMPLES).contains(&track.len()), "{}", track.len());
}

/// The controller does not use sample 2, and the motion ends with sample 3.
#[test]
#[expect(clippy::large_stack_arrays, reason = "five samples of a test")]
fn every_cycle_of_the_motion_has_a_deviation_also_one_without_a_reading_and_the_last_one() {
    let mut tracking = Tracking::new(PoseSource::Truth, [0.0; 3]);
    let stopped = |cycle| State { controller_state: ControllerState::SafeStop.code(), ..state(cycle, 0.0) };
    let mut unused = sample(&state(2, 0.0), Some(truth(2, 0.003)));
    unused.messages.solution = None;
    let samples = Vec::from_iter([
        sample(&state(1, 0.0), Some(truth(1, 0.001))),
        unused,
        sample(&stopped(3), Some(truth(3, 0.004))),
        sample(&stopped(4), Some(truth(4, 0.005))),
        // No truth: nothing is compared.
        sample(&stopped(5), None),
    ]);
    let found: Vec<_> = samples.iter().filter_map(|sample| tracking.add_sample(sample)).collect();
    let deviations: Vec<_> = found.iter().map(|sample| sample.deviation.origin_m).collect();
    assert_eq!(deviations, [0.001, 0.003, 0.004]);
    let (figures, _) = tracking.into_figures();
    assert_eq!((figures.samples, figures.actual.max_mm), (2, Some(4.0)));
    assert!((figures.actual.rms_mm.unwrap() - 5.0_f64.sqrt()).abs() < 1e-12);
    assert_eq!(figures.estimated.max_mm, Some(0.0), "of the one sample that was used");
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
                    deviations.extend(tracking.add_sample(&sample(&state, Some(truth))));
                }
                let (figures, _) = tracking.into_figures();
                let TrackingFigures { samples, actual, estimated, estimate_rms_mm, .. } = figures;
                let place = format!("{index} {number} {figures:?}");
                assert_eq!(samples, 100, "{place}");
                for (errors, is_bad) in [(actual, is_actual), (estimated, is_estimated)] {
                    let expected = Some(if is_bad { f64::INFINITY } else { 0.0 });
                    let PoseErrors {
                        rms_mm,
                        max_mm,
                        incisal_rms_mm,
                        incisal_max_mm,
                        rms_deg,
                        max_deg,
                        samples,
                    } = errors;
                    assert_eq!(samples, 100, "{place}");
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
        let truth = Truth { sampled_ns: cycle * SAMPLE_NS, ..truth(cycle, x) };
        // From the stop on, the desired pose stays.
        let desired = sample(&self::state(cycle, cycle.min(20) as f64 * 1e-3), None).messages.desired;
        let mut sample = sample(&state, Some(truth));
        sample.messages.desired = desired;
        tracking.add_sample(&sample);
    }
    let (figures, track) = tracking.into_figures();
    assert_eq!(figures.samples, 19);
    let last = track.last().unwrap();
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
        // The jaw stands from then on.
        let truth = truth(cycle, cycle.min(20) as f64 * 1e-3);
        tracking.add_sample(&sample(&state(cycle, cycle as f64 * 1e-3), Some(truth)));
    }
    let (figures, _) = tracking.into_figures();
    assert_eq!((figures.samples, figures.actual.max_mm), (19, Some(0.0)));
}
