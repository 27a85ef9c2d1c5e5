//! A recording as a smooth curve of jaw displacements.
//!
//! Samples become translation and rotation vector (from the first sample's orientation) on an even grid. A low-pass and
//! a spline make the curve twice continuously differentiable.

use std::f64::consts::{PI, SQRT_2};
use std::path::PathBuf;

use masseter_model::geometry::{Pose, Vec3};
use nalgebra::{SVector, UnitQuaternion, Vector6};

use super::doubts::{Glitch, doubts, glitches, jumps};
use super::row::{Located, Sample};

/// Least rate of the even grid, Hz, well above the frequencies of a jaw. Faster samples keep their rate, because a
/// slower grid turns their high frequencies into slow motion, which the filter passes.
const LEAST_GRID_HZ: f64 = 200.0;
/// Largest turn for which the markers' centroid can stand for the incisal point: 1.4 mm of difference at a distance of
/// 40 mm.
const CENTROID_TURN_DEG: f64 = 2.0;
/// Largest turn for which rotation vectors are a good measure of the way between two poses.
const LARGEST_TURN_DEG: f64 = 90.0;
/// Length of the reflected ends, in periods of the corner frequency.
const MARGIN_PERIODS: f64 = 3.0;

/// Jaw displacements over the recording's own time, from 0.
#[derive(Debug, Clone)]
pub struct Recording {
    path: PathBuf,
    time_s: Vec<f64>,
    lines: Vec<u64>,
    first_rotation: UnitQuaternion<f64>,
    /// Through the rows as they are.
    raw: Spline<6>,
    curve: Spline<6>,
    /// The largest turn, degrees, if it makes the markers' centroid a bad substitute for the incisal point.
    pub centroid_turn_deg: Option<f64>,
    /// Other doubts than the glitches, with the line.
    pub(super) doubts: Vec<String>,
    /// Rows that leave the path of their neighbours.
    pub(super) glitches: Vec<Glitch>,
}

impl Recording {
    /// A recording from samples at strictly increasing times; a corner of 0 leaves them unfiltered. `are_of_centroid`:
    /// whether the samples are displacements of the markers' centroid, for lack of the incisal point.
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
        let raw = Spline::through(time_s.clone(), coordinates);
        Ok(Self {
            path,
            lines: samples.iter().map(|sample| sample.line).collect(),
            doubts: doubts(samples),
            glitches: glitches(samples),
            first_rotation,
            curve: if lowpass_hz == 0.0 { raw.clone() } else { smoothed(&raw, &time_s, lowpass_hz) },
            raw,
            centroid_turn_deg: is_bad.then_some(largest_turn_deg),
            time_s,
        })
    }

    /// From the first to the last row, s.
    pub fn length_s(&self) -> f64 {
        self.time_s[self.time_s.len() - 1]
    }

    /// Displacement of the jaw from the closed pose, jaw frame.
    #[inline]
    pub fn displacement(&self, motion_s: f64) -> Pose {
        self.pose(&self.curve.at(motion_s))
    }

    /// The same without the low-pass, as the rows have it.
    #[inline]
    pub fn recorded(&self, motion_s: f64) -> Pose {
        self.pose(&self.raw.at(motion_s))
    }

    /// The times of the rows after one time and up to another.
    #[inline]
    pub fn rows_between(&self, after_s: f64, to_s: f64) -> &[f64] {
        let end = self.time_s.partition_point(|&t_s| t_s <= to_s);
        let begin = self.time_s.partition_point(|&t_s| t_s <= after_s).min(end);
        &self.time_s[begin..end]
    }

    /// The doubts, each with its line, and those about glitches.
    pub fn all_doubts(&self) -> Vec<String> {
        self.doubts.iter().cloned().chain(jumps(&self.glitches)).collect()
    }

    #[inline]
    fn pose(&self, at: &Vector6<f64>) -> Pose {
        let turn = UnitQuaternion::from_scaled_axis(Vec3::new(at[3], at[4], at[5]));
        Pose::from_parts(Vec3::new(at[0], at[1], at[2]).into(), self.first_rotation * turn)
    }

    /// File and line with the nearest time.
    pub fn source_line(&self, motion_s: f64) -> String {
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
        let problem = format!(
            "turned by {angle_deg:.1}° from the first row, limit {LARGEST_TURN_DEG}°; is the orientation right?"
        );
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

/// A natural cubic spline through vectors over time: twice continuously differentiable, curvature 0 at the ends.
#[derive(Debug, Clone)]
struct Spline<const N: usize> {
    time_s: Vec<f64>,
    values: Vec<SVector<f64, N>>,
    /// Second derivatives at the knots.
    curvatures: Vec<SVector<f64, N>>,
}

impl<const N: usize> Spline<N> {
    /// The spline through at least two values at strictly increasing times.
    fn through(time_s: Vec<f64>, values: Vec<SVector<f64, N>>) -> Self {
        assert!(time_s.len() >= 2 && time_s.len() == values.len(), "a curve needs two knots");
        let curvatures = curvatures(&time_s, &values);
        Self { time_s, values, curvatures }
    }

    /// The value at a time; held beyond the ends. Finds its span in O(log n), allocates nothing.
    #[inline]
    fn at(&self, t_s: f64) -> SVector<f64, N> {
        let last = self.time_s.len() - 1;
        let t_s = t_s.clamp(self.time_s[0], self.time_s[last]);
        let right = self.time_s.partition_point(|&knot| knot <= t_s).clamp(1, last);
        let left = right - 1;
        let span = self.time_s[right] - self.time_s[left];
        let b = (t_s - self.time_s[left]) / span;
        let a = 1.0 - b;
        let bend = |x: f64| (x * x * x - x) * span * span / 6.0;
        self.values[left] * a
            + self.values[right] * b
            + self.curvatures[left] * bend(a)
            + self.curvatures[right] * bend(b)
    }
}

/// Elimination in the tridiagonal system for equal slopes on both sides of each knot.
fn curvatures<const N: usize>(time_s: &[f64], values: &[SVector<f64, N>]) -> Vec<SVector<f64, N>> {
    let knots = time_s.len();
    let span = |left: usize| time_s[left + 1] - time_s[left];
    let slope = |left: usize| (values[left + 1] - values[left]) / span(left);
    let mut upper = vec![0.0; knots];
    let mut solution = vec![SVector::zeros(); knots];
    for knot in 1..knots - 1 {
        let (before, after) = (span(knot - 1), span(knot));
        let pivot = 2.0 * (before + after) - before * upper[knot - 1];
        upper[knot] = after / pivot;
        solution[knot] = ((slope(knot) - slope(knot - 1)) * 6.0 - solution[knot - 1] * before) / pivot;
    }
    for knot in (1..knots - 1).rev() {
        let next = solution[knot + 1];
        solution[knot] -= next * upper[knot];
    }
    solution
}

/// A low-pass without delay: a second-order Butterworth filter forwards, then backwards. Both passes together reach −3
/// dB at the corner, which must lie below half the rate of the evenly spaced values.
///
/// A point reflection extends both ends, and the filter starts settled, so that the first and the last value stay
/// unchanged.
fn lowpass<const N: usize>(values: &[SVector<f64, N>], rate_hz: f64, corner_hz: f64) -> Vec<SVector<f64, N>> {
    let margin = ((MARGIN_PERIODS * rate_hz / corner_hz).ceil() as usize).min(values.len().saturating_sub(1));
    let filter = Butterworth::new(rate_hz, corner_hz);
    let mut extended = with_reflected_ends(values, margin);
    filter.run(&mut extended);
    extended.reverse();
    filter.run(&mut extended);
    extended.reverse();
    extended[margin..margin + values.len()].to_vec()
}

fn with_reflected_ends<const N: usize>(values: &[SVector<f64, N>], margin: usize) -> Vec<SVector<f64, N>> {
    let (Some(first), Some(last)) = (values.first(), values.last()) else { return Vec::new() };
    let before = values[1..=margin].iter().rev().map(|value| first * 2.0 - value);
    let after =
        values[values.len() - 1 - margin..values.len() - 1].iter().rev().map(|value| last * 2.0 - value);
    before.chain(values.iter().copied()).chain(after).collect()
}

/// y = b (x + 2x' + x'') − a₁y' − a₂y'', by the bilinear transform.
struct Butterworth {
    b: f64,
    a1: f64,
    a2: f64,
}

impl Butterworth {
    fn new(rate_hz: f64, corner_hz: f64) -> Self {
        // Two passes of a second-order filter multiply its attenuation; this factor moves −3 dB back.
        let two_passes = (SQRT_2 - 1.0).powf(0.25);
        let k = (PI * corner_hz / rate_hz).tan() / two_passes;
        let scale = 1.0 / (1.0 + SQRT_2 * k + k * k);
        Self { b: k * k * scale, a1: 2.0 * (k * k - 1.0) * scale, a2: (1.0 - SQRT_2 * k + k * k) * scale }
    }

    fn run<const N: usize>(&self, values: &mut [SVector<f64, N>]) {
        let Some(&settled) = values.first() else { return };
        let (mut x1, mut x2, mut y1, mut y2) = (settled, settled, settled, settled);
        for value in values {
            let x = *value;
            *value = (x + x1 * 2.0 + x2) * self.b - y1 * self.a1 - y2 * self.a2;
            (x2, x1, y2, y1) = (x1, x, y1, *value);
        }
    }
}

#[cfg(test)]
mod tests;
