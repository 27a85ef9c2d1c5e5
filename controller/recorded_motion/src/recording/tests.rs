//! Recordings as a whole, the spline through them, and the low-pass.

use nalgebra::Vector1;

use super::*;

fn recorded(poses: impl Fn(f64) -> Pose, lowpass_hz: f64) -> Result<Recording, Located> {
    recorded_at(50.0, poses, lowpass_hz)
}

/// Two seconds.
fn recorded_at(rate_hz: f64, poses: impl Fn(f64) -> Pose, lowpass_hz: f64) -> Result<Recording, Located> {
    let sample = |k: u32| {
        let t_s = f64::from(k) / rate_hz;
        Sample { line: u64::from(k) + 3, time_s: 5.0 + t_s, displacement: poses(t_s) }
    };
    let samples: Vec<Sample> = (0..=(2.0 * rate_hz) as u32).map(sample).collect();
    Recording::new("a.csv".into(), &samples, false, lowpass_hz)
}

fn swaying(t_s: f64) -> Pose {
    let sway = (2.0 * t_s).sin();
    let rotation = UnitQuaternion::from_scaled_axis(Vec3::new(0.02, 0.3 * sway, 0.1));
    Pose::from_parts(Vec3::new(0.001, -0.002 * sway, -0.02 * sway).into(), rotation)
}

#[test]
fn a_smooth_motion_is_kept_with_and_without_the_filter() {
    for lowpass_hz in [0.0, 12.0] {
        let recording = recorded(swaying, lowpass_hz).ok().unwrap();
        assert!((recording.length_s() - 2.0).abs() < 1e-12);
        for k in 0..=200 {
            let t_s = f64::from(k) / 100.0;
            let (got, desired) = (recording.displacement(t_s), swaying(t_s));
            assert!((got.translation.vector - desired.translation.vector).norm() < 5e-5, "{t_s}");
            assert!(got.rotation.angle_to(&desired.rotation) < 5e-4, "{t_s}");
        }
    }
}

/// 195 Hz sampled at 200 Hz looks like 5 Hz.
#[test]
fn fast_noise_of_a_fast_recording_does_not_become_slow_motion() {
    let trembling =
        |t_s: f64| Pose::translation(0.0, 0.0, 0.001 * (std::f64::consts::TAU * 195.0 * t_s).sin());
    let recording = recorded_at(1000.0, trembling, 12.0).ok().unwrap();
    for k in 20..=180 {
        let height_m = recording.displacement(f64::from(k) / 100.0).translation.z;
        assert!(height_m.abs() < 2e-5, "{height_m}");
    }
}

#[test]
fn the_nearest_line_is_named() {
    let recording = recorded(swaying, 12.0).ok().unwrap();
    for (t_s, line) in [(0.0, 3), (0.009, 3), (0.011, 4), (2.0, 103), (9.0, 103)] {
        assert_eq!(recording.source_line(t_s), format!("a.csv:{line}"));
    }
}

#[test]
fn a_turn_beyond_what_a_jaw_does_is_refused() {
    let spinning = |t_s: f64| Pose::rotation(Vec3::y() * t_s);
    let error = recorded(spinning, 12.0).err().unwrap();
    assert!(error.problem.starts_with("turned by") && error.line.is_some());
}

fn sine_through(knots: u32) -> Spline<1> {
    // Unevenly spaced, over one full period, at whose ends the sine has no curvature.
    let time_s: Vec<f64> = (0..=knots)
        .map(|k| {
            let x = f64::from(k) / f64::from(knots);
            std::f64::consts::TAU * (x + 0.05 * (std::f64::consts::TAU * x).sin())
        })
        .collect();
    let values = time_s.iter().map(|t| Vector1::new(t.sin())).collect();
    Spline::through(time_s, values)
}

#[test]
fn a_sine_is_followed_with_fourth_order() {
    let worst = |knots| {
        let spline = sine_through(knots);
        let error = |k: u32| {
            let t = f64::from(k) / 1000.0 * std::f64::consts::TAU;
            (spline.at(t)[0] - t.sin()).abs()
        };
        (0..=1000).map(error).fold(0.0, f64::max)
    };
    assert!(worst(20) < 5e-4);
    assert!(worst(40) < worst(20) / 12.0);
}

#[test]
fn values_at_the_knots_are_kept_and_held_beyond_the_ends() {
    let spline = Spline::through(vec![0.0, 1.0, 3.0], [1.0, -2.0, 5.0].map(Vector1::new).to_vec());
    for (t, value) in [(-1.0, 1.0), (0.0, 1.0), (1.0, -2.0), (3.0, 5.0), (4.0, 5.0)] {
        assert!((spline.at(t)[0] - value).abs() < 1e-12);
    }
}

const RATE_HZ: f64 = 200.0;

fn sine(frequency_hz: f64) -> Vec<Vector1<f64>> {
    (0..800)
        .map(|k| Vector1::new((std::f64::consts::TAU * frequency_hz * f64::from(k) / RATE_HZ).sin()))
        .collect()
}

fn largest(values: &[Vector1<f64>]) -> f64 {
    values[200..600].iter().map(|value| value[0].abs()).fold(0.0, f64::max)
}

#[test]
fn the_corner_lies_at_minus_three_decibels_and_nothing_is_delayed() {
    for (frequency_hz, gain, tolerance) in [(1.0, 1.0, 1e-3), (12.0, 0.5f64.sqrt(), 5e-3), (60.0, 0.0, 5e-3)]
    {
        let filtered = lowpass(&sine(frequency_hz), RATE_HZ, 12.0);
        assert!((largest(&filtered) - gain).abs() < tolerance, "{frequency_hz} Hz");
    }
    let slow = sine(1.0);
    for (before, after) in slow.iter().zip(lowpass(&slow, RATE_HZ, 12.0)) {
        assert!((before[0] - after[0]).abs() < 1e-3);
    }
}

#[test]
fn ends_stay_where_they_are() {
    let ramp: Vec<_> = (0..100).map(|k| Vector1::new(0.3 * f64::from(k) + 2.0)).collect();
    let filtered = lowpass(&ramp, RATE_HZ, 12.0);
    assert_eq!(filtered.len(), ramp.len());
    for (before, after) in ramp.iter().zip(&filtered) {
        assert!((before[0] - after[0]).abs() < 0.02);
    }
    assert!((filtered[0][0] - 2.0).abs() < 1e-3 && (filtered[99][0] - ramp[99][0]).abs() < 1e-3);
}

#[test]
fn short_recordings_are_filtered_too() {
    let few = [1.0, 2.0, 3.0, 4.0].map(Vector1::new);
    assert_eq!(lowpass(&few, RATE_HZ, 12.0).len(), 4);
    assert!(lowpass::<1>(&[], RATE_HZ, 12.0).is_empty());
}
