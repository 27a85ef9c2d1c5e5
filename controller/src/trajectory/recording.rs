//! A recording as a smooth curve of jaw displacements.
//!
//! Samples become translation and rotation vector (from the first sample's orientation), are spread
//! to an even grid, low-passed and joined by a spline, twice continuously differentiable.

use std::path::PathBuf;

use masseter_model::geometry::{Pose, Vec3};
use nalgebra::{UnitQuaternion, Vector6};

use super::error::Located;
use super::glitches::{Glitch, glitches};
use super::lowpass::lowpass;
use super::plausibility::doubts;
use super::recorded_rows::Rows;
use super::spline::Spline;

/// Least rate of the even grid, Hz: well above what a jaw does. What is sampled faster keeps its rate, because what a
/// slower grid cannot hold would return on it as slow motion, which the filter passes.
const LEAST_GRID_HZ: f64 = 200.0;
/// A turn by more than this moves the incisal point otherwise than the markers' centroid by what matters: 1.4 mm where
/// they are 40 mm apart.
const CENTROID_TURN_DEG: f64 = 2.0;
/// Beyond this, rotation vectors are no longer a good measure of the way between two poses.
const LARGEST_TURN_DEG: f64 = 90.0;

/// A row of the file: jaw displacement in the jaw frame, metres.
#[derive(Debug)]
pub(super) struct Sample {
    pub line: u64,
    pub time_s: f64,
    pub displacement: Pose,
}

/// Jaw displacements over the recording's own time, from 0.
#[derive(Debug, Clone)]
pub(super) struct Recording {
    path: PathBuf,
    time_s: Vec<f64>,
    lines: Vec<u64>,
    first_rotation: UnitQuaternion<f64>,
    curve: Spline<6>,
    /// The largest turn, degrees, if it makes the markers' centroid a bad substitute for the incisal point.
    pub centroid_turn_deg: Option<f64>,
    /// What is doubtful beside the glitches, with the line.
    pub doubts: Vec<String>,
    /// Rows that leave the path of their neighbours.
    pub glitches: Vec<Glitch>,
}

impl Recording {
    /// From samples at strictly increasing times; a corner of 0 leaves them unfiltered. `are_of_centroid`: whether the samples
    /// are displacements of the markers' centroid, because the incisal point is not given.
    pub(super) fn new(
        path: PathBuf,
        samples: &[Sample],
        are_of_centroid: bool,
        lowpass_hz: f64,
    ) -> Result<Self, Located> {
        let first = &samples[0];
        let first_rotation = first.displacement.rotation;
        let coordinates = samples.iter().map(|sample| coordinates(sample, &first_rotation));
        let coordinates = coordinates.collect::<Result<Vec<_>, _>>()?;
        let turns_deg = coordinates.iter().map(|at| at.fixed_rows::<3>(3).norm().to_degrees());
        let largest_turn_deg = turns_deg.fold(0.0, f64::max);
        let is_bad = are_of_centroid && largest_turn_deg > CENTROID_TURN_DEG;
        let time_s: Vec<f64> = samples.iter().map(|sample| sample.time_s - first.time_s).collect();
        let lines: Vec<_> = samples.iter().map(|sample| sample.line).collect();
        let first_turn_rad = first_rotation.angle();
        let rows = Rows { time_s: &time_s, lines: &lines, coordinates: &coordinates, first_turn_rad };
        let (doubts, glitches) = (doubts(&rows), glitches(&rows));
        let raw = Spline::through(time_s.clone(), coordinates);
        Ok(Self {
            path,
            lines,
            doubts,
            glitches,
            first_rotation,
            curve: if lowpass_hz == 0.0 { raw } else { smoothed(&raw, &time_s, lowpass_hz) },
            centroid_turn_deg: is_bad.then_some(largest_turn_deg),
            time_s,
        })
    }

    pub(super) fn length_s(&self) -> f64 {
        self.time_s[self.time_s.len() - 1]
    }

    /// Displacement of the jaw from the closed pose, jaw frame.
    pub(super) fn displacement(&self, motion_s: f64) -> Pose {
        let at = self.curve.at(motion_s);
        let turn = UnitQuaternion::from_scaled_axis(Vec3::new(at[3], at[4], at[5]));
        Pose::from_parts(Vec3::new(at[0], at[1], at[2]).into(), self.first_rotation * turn)
    }

    /// File and line whose time is nearest.
    pub(super) fn source_line(&self, motion_s: f64) -> String {
        let right = self.time_s.partition_point(|&t_s| t_s < motion_s).min(self.time_s.len() - 1);
        let left = right.saturating_sub(1);
        let nearest = if motion_s - self.time_s[left] < self.time_s[right] - motion_s { left } else { right };
        format!("{}:{}", self.path.display(), self.lines[nearest])
    }
}

/// Translation (m) and rotation vector from the first orientation (rad).
fn coordinates(sample: &Sample, first: &UnitQuaternion<f64>) -> Result<Vector6<f64>, Located> {
    let turn = (first.inverse() * sample.displacement.rotation).scaled_axis();
    let angle_deg = turn.norm().to_degrees();
    if angle_deg > LARGEST_TURN_DEG {
        let limit = format!("limit {LARGEST_TURN_DEG}°; is the orientation right?");
        let problem = format!("turned by {angle_deg:.1}° from the first row, {limit}");
        return Err(Located::at(sample.line, problem));
    }
    let at = sample.displacement.translation.vector;
    Ok(Vector6::new(at.x, at.y, at.z, turn.x, turn.y, turn.z))
}

fn smoothed(raw: &Spline<6>, time_s: &[f64], lowpass_hz: f64) -> Spline<6> {
    let last = time_s.len() - 1;
    let length_s = time_s[last];
    let steps = (length_s * LEAST_GRID_HZ).ceil().max(last as f64) as u32;
    let grid_s: Vec<f64> = (0..=steps).map(|k| length_s * f64::from(k) / f64::from(steps)).collect();
    let even: Vec<_> = grid_s.iter().map(|&t_s| raw.at(t_s)).collect();
    let filtered = lowpass(&even, f64::from(steps) / length_s, lowpass_hz);
    Spline::through(grid_s, filtered)
}

#[cfg(test)]
mod tests {
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

    /// 195 Hz sampled at 200 Hz would be 5 Hz.
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
}
