//! Warnings about a recording that may not be the motion of a jaw. The user decides.

use masseter_model::geometry::Vec3;

use super::row::Sample;

/// Longest glide of markers without a turn, m, and the least turn to a longer one, °/m: a sixth of an opening's.
pub(super) const GLIDE_M: f64 = 0.012;
pub(super) const TURN_DEG_PER_M: f64 = 100.0;
/// A shorter way is none, m.
pub(super) const NOTHING_M: f64 = 1e-7;
/// The first row of a recording of poses is near the closed jaw, m and rad.
const CLOSED_M: f64 = 0.01;
const CLOSED_RAD: f64 = 0.1;
/// The least deviation of a row, m.
const LEAST_M: f64 = 1e-3;
/// Factors by which a glitch exceeds the usual deviation and speed.
const DEVIATION: f64 = 4.0;
const SPEED: f64 = 1.5;
/// Rows on each side for the usual values.
const AROUND: usize = 4;
/// Largest distance of the rows of one glitch.
const ONE: usize = 3;

/// The largest value but for a hundredth of the rows and two, with its row: a glitch is no unit.
pub(super) fn largest(values: &[f64]) -> (usize, f64) {
    quantile(values, 2 + values.len() / 100)
}

/// The value with so many values above, and its row.
pub(super) fn quantile(values: &[f64], above: usize) -> (usize, f64) {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|&a, &b| values[b].total_cmp(&values[a]));
    order.get(above.min(values.len().saturating_sub(1))).map_or((0, 0.0), |&row| (row, values[row]))
}

/// The doubts about the rows, each with a line, without glitches.
pub(super) fn doubts(samples: &[Sample]) -> Vec<String> {
    not_closed(&samples[0]).into_iter().chain(ways(samples)).collect()
}

fn not_closed(first: &Sample) -> Option<String> {
    let (away_m, turn_rad) = (place_m(first).norm(), first.displacement.rotation.angle());
    let (line, away_mm, turn_deg) = (first.line, away_m * 1e3, turn_rad.to_degrees());
    (away_m > CLOSED_M || turn_rad > CLOSED_RAD).then(|| {
        format!(
            "line {line}: the first row is {away_mm:.1} mm and {turn_deg:.1}° from the closed jaw; are the poses relative \
             to the closed jaw, and the quaternions in the order qw,qx,qy,qz?"
        )
    })
}

fn ways(samples: &[Sample]) -> Option<String> {
    let first = &samples[0];
    let way = |sample: &Sample| ((place_m(sample) - place_m(first)).norm(), sample.line);
    let (way_m, line) = samples.iter().map(way).max_by(|a, b| a.0.total_cmp(&b.0))?;
    let turn = |sample: &Sample| first.displacement.rotation.angle_to(&sample.displacement.rotation);
    let turn_rad = samples.iter().map(turn).fold(0.0, f64::max);
    let (way_mm, turn_deg) = (way_m * 1e3, turn_rad.to_degrees());
    if way_m > GLIDE_M && turn_deg < TURN_DEG_PER_M * way_m {
        return Some(format!(
            "line {line}: the incisal point is {way_mm:.1} mm from the first row, yet the jaw turns by {turn_deg:.2}° at \
             most; are angles in the right unit, and all markers on the lower jaw?"
        ));
    }
    (way_m < NOTHING_M && turn_rad < NOTHING_M).then(|| format!("line {line}: the jaw does not move"))
}

/// Place of the incisal point, m.
fn place_m(sample: &Sample) -> Vec3 {
    sample.displacement.translation.vector
}

/// One warning for all glitches.
pub(super) fn jumps(glitches: &[Glitch]) -> Option<String> {
    let first = glitches.first()?;
    let others = match glitches.len() - 1 {
        0 => String::new(),
        others => format!(" (and {others} more)"),
    };
    let (line, jump_mm, within_ms) = (first.line, first.jump_m * 1e3, first.within_s * 1e3);
    Some(format!(
        "line {line}: the incisal point jumps by {jump_mm:.1} mm within {within_ms:.0} ms{others}; is it a glitch of the \
         tracker?"
    ))
}

/// A row that leaves the path of its neighbours: a glitch of the tracker.
///
/// A glitch is a row off the straight way between its neighbours, with a faster step than usual before or after the
/// row. The deviation is above 1 mm and above four times the usual deviation of the rows around. A jaw that stops at
/// the teeth stops hard, but is no faster before. The search ignores jumps of the orientation alone.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Glitch {
    /// Line of the file.
    pub line: u64,
    /// Time of the row since the first, s.
    pub time_s: f64,
    /// Length of the incisal point's jump, m.
    pub jump_m: f64,
    /// Time between the two rows of the jump, s.
    pub within_s: f64,
}

/// All glitches, in the order of their rows.
pub(super) fn glitches(samples: &[Sample]) -> Vec<Glitch> {
    let steps = Steps::new(samples);
    let mut found: Vec<usize> = Vec::new();
    for row in (1..samples.len().saturating_sub(1)).filter(|&row| steps.is_glitch(row)) {
        match found.last_mut() {
            Some(last) if row - *last <= ONE => {
                if steps.deviation_m[row] > steps.deviation_m[*last] {
                    *last = row;
                }
            }
            _ => found.push(row),
        }
    }
    found.into_iter().map(|row| glitch(samples, row)).collect()
}

fn glitch(samples: &[Sample], row: usize) -> Glitch {
    let jump_m = |to: usize| (place_m(&samples[to]) - place_m(&samples[to - 1])).norm();
    let to = if jump_m(row) >= jump_m(row + 1) { row } else { row + 1 };
    Glitch {
        line: samples[row].line,
        time_s: samples[row].time_s - samples[0].time_s,
        jump_m: jump_m(to),
        within_s: samples[to].time_s - samples[to - 1].time_s,
    }
}

/// Deviations and steps of the rows.
struct Steps {
    /// Of each row from the straight way between its neighbours; 0 at the ends.
    deviation_m: Vec<f64>,
    /// From the row before; 0 for the first.
    speed_m_s: Vec<f64>,
}

impl Steps {
    fn new(samples: &[Sample]) -> Self {
        let (mut deviation_m, mut speed_m_s) = (vec![0.0; samples.len()], vec![0.0; samples.len()]);
        for (at, pair) in samples.windows(2).enumerate() {
            let way_m = (place_m(&pair[1]) - place_m(&pair[0])).norm();
            speed_m_s[at + 1] = way_m / (pair[1].time_s - pair[0].time_s);
        }
        for (at, three) in samples.windows(3).enumerate() {
            let share = (three[1].time_s - three[0].time_s) / (three[2].time_s - three[0].time_s);
            let between_m = place_m(&three[0]).lerp(&place_m(&three[2]), share);
            deviation_m[at + 1] = (place_m(&three[1]) - between_m).norm();
        }
        Self { deviation_m, speed_m_s }
    }

    /// Whether a row between others is a glitch.
    fn is_glitch(&self, row: usize) -> bool {
        let deviation_m = self.deviation_m[row];
        let usual = |values: &[f64]| before(values, row - 1).max(after(values, row + 2));
        let speed_m_s = self.speed_m_s[row].max(self.speed_m_s[row + 1]);
        deviation_m > LEAST_M
            && deviation_m > DEVIATION * usual(&self.deviation_m)
            && speed_m_s > SPEED * usual(&self.speed_m_s)
    }
}

/// Median of the values before an index.
fn before(values: &[f64], end: usize) -> f64 {
    upper_median(&values[end.saturating_sub(AROUND).max(1).min(end)..end])
}

/// Median of the values from an index on.
fn after(values: &[f64], from: usize) -> f64 {
    let from = from.min(values.len());
    upper_median(&values[from..(from + AROUND).min(values.len())])
}

/// The upper median; 0 without a value.
pub(super) fn upper_median(values: &[f64]) -> f64 {
    quantile(values, values.len().saturating_sub(1) / 2).1
}

#[cfg(test)]
mod tests {
    use masseter_model::geometry::Pose;
    use nalgebra::{UnitQuaternion, Vector6};

    use super::*;

    /// Rows of translations (m) and rotation vectors (rad) at this rate, from line 2 on.
    fn samples(rate_hz: f64, rows: impl Iterator<Item = Vector6<f64>>) -> Vec<Sample> {
        let sample = |(row, at): (u32, Vector6<f64>)| {
            let (place_m, turn_rad) = (Vec3::new(at[0], at[1], at[2]), Vec3::new(at[3], at[4], at[5]));
            let displacement = Pose::from_parts(place_m.into(), UnitQuaternion::from_scaled_axis(turn_rad));
            Sample { line: u64::from(row) + 2, time_s: f64::from(row) / rate_hz, displacement }
        };
        (0..).zip(rows).map(sample).collect()
    }

    /// Chewing at 2 Hz by 18 mm, sampled at this rate.
    fn doubts_of(rate_hz: f64, change: impl Fn(usize, &mut Vector6<f64>)) -> Vec<String> {
        let pose = |row: usize| {
            let mut pose = Vector6::zeros();
            pose[2] = -0.009 * (1.0 - (4.0 * std::f64::consts::PI * row as f64 / rate_hz).cos());
            pose[4] = -10.0 * pose[2];
            change(row, &mut pose);
            pose
        };
        let rows = samples(rate_hz, (0..200).map(pose));
        doubts(&rows).into_iter().chain(jumps(&glitches(&rows))).collect()
    }

    #[test]
    fn a_jaw_at_rest_and_a_single_jump_are_named_with_their_lines() {
        let at_rest = doubts_of(200.0, |_, pose| *pose *= 0.0);
        assert!(at_rest[0].contains("does not move") && at_rest.len() == 1, "{at_rest:?}");
        let jump = doubts_of(200.0, |row, pose| pose[0] += if row == 100 { 0.005 } else { 0.0 });
        assert!(jump[0].contains("line 102") && jump.len() == 1, "{jump:?}");
    }

    #[test]
    fn a_jaws_motion_raises_no_doubt_at_any_rate() {
        for rate_hz in [10.0, 13.0, 25.0, 50.0, 60.0, 200.0, 1000.0] {
            assert_eq!(doubts_of(rate_hz, |_, _| ()), [""; 0], "{rate_hz} Hz");
        }
        let turning =
            doubts_of(200.0, |_, pose| *pose = Vector6::new(0.0, 0.0, 0.0, pose[2] * 10.0, 0.0, 0.0));
        assert_eq!(turning, [""; 0]);
    }

    #[test]
    fn units_that_make_no_jaw_are_named() {
        let radians_as_degrees = doubts_of(200.0, |_, pose| pose[4] /= 57.3);
        assert!(radians_as_degrees[0].contains("turns by 0.18°"), "{radians_as_degrees:?}");
        let open = doubts_of(200.0, |_, pose| pose[2] -= 0.02);
        assert!(open[0].starts_with("line 2: the first row is 20.0 mm"), "{open:?}");
    }

    const RATE_HZ: f64 = 50.0;

    /// Two seconds of a motion of the incisal point, mm, from line 2 on.
    fn found(motion_mm: impl Fn(f64) -> [f64; 3]) -> Vec<Glitch> {
        let place = |row: u32| {
            let [x, y, z] = motion_mm(f64::from(row) / RATE_HZ).map(|mm| mm / 1e3);
            Vector6::new(x, y, z, 0.0, 0.0, 0.0)
        };
        glitches(&samples(RATE_HZ, (0..100).map(place)))
    }

    fn is_at(t_s: f64, at_s: f64) -> bool {
        (t_s - at_s).abs() < 1e-9
    }

    #[test]
    fn a_row_that_leaves_a_jaw_at_rest_is_found_however_slowly_the_jaw_returns() {
        let back_mm = |t_s: f64| match ((t_s - 1.0) * RATE_HZ).round() as i32 {
            0 => 2.7,
            1 => 2.1,
            2 => 0.8,
            _ => 0.0,
        };
        let found = found(|t_s| [-back_mm(t_s), 0.0, 0.0]);
        assert_eq!(found.len(), 1, "{found:?}");
        assert_eq!(found[0].line, 52);
        assert!((found[0].jump_m - 2.7e-3).abs() < 1e-9 && (found[0].within_s - 0.02).abs() < 1e-9);
    }

    #[test]
    fn each_row_that_leaves_a_fast_path_is_found() {
        let chewing_mm = |t_s: f64| -9.0 * (1.0 - (4.0 * std::f64::consts::PI * t_s).cos());
        let off_mm = |t_s: f64| if is_at(t_s, 0.6) || is_at(t_s, 1.36) { 4.0 } else { 0.0 };
        let lines: Vec<_> =
            found(|t_s| [0.0, off_mm(t_s), chewing_mm(t_s)]).iter().map(|glitch| glitch.line).collect();
        assert_eq!(lines, [32, 70]);
    }

    #[test]
    fn teeth_that_meet_and_a_start_from_rest_are_none() {
        assert_eq!(found(|t_s| [0.0, 0.0, (90.0 * t_s - 100.0).min(0.0)]), []);
        assert_eq!(found(|t_s| [0.0, 0.0, -60.0 * (t_s - 0.3).max(0.0)]), []);
    }
}
