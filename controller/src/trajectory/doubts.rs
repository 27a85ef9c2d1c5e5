//! Warnings about a recording that may not be the motion of a jaw. The user decides.

use masseter_model::geometry::Vec3;
use nalgebra::Vector6;
use serde::Serialize;

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

/// The original rows of a recording: translation of the incisal point (m) from the closed pose, and rotation vector
/// (rad) from the first row's orientation.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rows<'a> {
    pub time_s: &'a [f64],
    pub lines: &'a [u64],
    pub coordinates: &'a [Vector6<f64>],
    /// The first row's turn from the closed pose, rad.
    pub first_turn_rad: f64,
}

impl Rows<'_> {
    /// Place of the incisal point in a row, m.
    fn place_m(&self, row: usize) -> Vec3 {
        self.coordinates[row].fixed_rows::<3>(0).into_owned()
    }

    /// Its turn from the first row, rad.
    fn turn_rad(&self, row: usize) -> f64 {
        self.coordinates[row].fixed_rows::<3>(3).norm()
    }

    /// Its way from the first row, m.
    fn way_m(&self, row: usize) -> f64 {
        (self.place_m(row) - self.place_m(0)).norm()
    }

    /// The row furthest from the first.
    fn farthest(&self) -> usize {
        (0..self.lines.len()).max_by(|&a, &b| self.way_m(a).total_cmp(&self.way_m(b))).unwrap_or_default()
    }
}

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
pub(super) fn doubts(rows: &Rows) -> Vec<String> {
    not_closed(rows).into_iter().chain(ways(rows)).collect()
}

fn not_closed(rows: &Rows) -> Option<String> {
    let (away_m, line) = (rows.place_m(0).norm(), rows.lines[0]);
    let (away_mm, turn_deg) = (away_m * 1e3, rows.first_turn_rad.to_degrees());
    (away_m > CLOSED_M || rows.first_turn_rad > CLOSED_RAD).then(|| {
        format!(
            "line {line}: the first row is {away_mm:.1} mm and {turn_deg:.1}° from the closed jaw; are the poses relative \
             to the closed jaw, and the quaternions in the order qw,qx,qy,qz?"
        )
    })
}

fn ways(rows: &Rows) -> Option<String> {
    let farthest = rows.farthest();
    let (way_m, line) = (rows.way_m(farthest), rows.lines[farthest]);
    let turn_rad = (0..rows.lines.len()).map(|row| rows.turn_rad(row)).fold(0.0, f64::max);
    let (way_mm, turn_deg) = (way_m * 1e3, turn_rad.to_degrees());
    if way_m > GLIDE_M && turn_deg < TURN_DEG_PER_M * way_m {
        return Some(format!(
            "line {line}: the incisal point is {way_mm:.1} mm from the first row, yet the jaw turns by {turn_deg:.2}° at \
             most; are angles in the right unit, and all markers on the lower jaw?"
        ));
    }
    (way_m < NOTHING_M && turn_rad < NOTHING_M).then(|| format!("line {line}: the jaw does not move"))
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
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
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
pub(super) fn glitches(rows: &Rows) -> Vec<Glitch> {
    let steps = Steps::new(rows);
    let mut found: Vec<usize> = Vec::new();
    for row in (1..rows.lines.len().saturating_sub(1)).filter(|&row| steps.is_glitch(row)) {
        match found.last_mut() {
            Some(last) if row - *last <= ONE => {
                if steps.deviation_m[row] > steps.deviation_m[*last] {
                    *last = row;
                }
            }
            _ => found.push(row),
        }
    }
    found.into_iter().map(|row| glitch(rows, row)).collect()
}

fn glitch(rows: &Rows, row: usize) -> Glitch {
    let jump_m = |to: usize| (rows.place_m(to) - rows.place_m(to - 1)).norm();
    let to = if jump_m(row) >= jump_m(row + 1) { row } else { row + 1 };
    Glitch {
        line: rows.lines[row],
        time_s: rows.time_s[row],
        jump_m: jump_m(to),
        within_s: rows.time_s[to] - rows.time_s[to - 1],
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
    fn new(rows: &Rows) -> Self {
        let places: Vec<Vec3> = (0..rows.lines.len()).map(|row| rows.place_m(row)).collect();
        let (mut deviation_m, mut speed_m_s) = (vec![0.0; places.len()], vec![0.0; places.len()]);
        for row in 1..places.len() {
            let step_s = rows.time_s[row] - rows.time_s[row - 1];
            speed_m_s[row] = (places[row] - places[row - 1]).norm() / step_s;
            if row + 1 < places.len() {
                let share = step_s / (rows.time_s[row + 1] - rows.time_s[row - 1]);
                deviation_m[row] = (places[row] - places[row - 1].lerp(&places[row + 1], share)).norm();
            }
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
    use super::*;

    /// Chewing at 2 Hz by 18 mm, sampled at this rate.
    fn doubts_of(rate_hz: f64, change: impl Fn(usize, &mut Vector6<f64>)) -> Vec<String> {
        let time_s: Vec<f64> = (0..200).map(|k| f64::from(k) / rate_hz).collect();
        let pose = |(row, t_s): (usize, &f64)| {
            let mut pose = Vector6::zeros();
            pose[2] = -0.009 * (1.0 - (4.0 * std::f64::consts::PI * t_s).cos());
            pose[4] = -10.0 * pose[2];
            change(row, &mut pose);
            pose
        };
        let rows: Vec<_> = time_s.iter().enumerate().map(pose).collect();
        let lines: Vec<_> = (2..202).collect();
        let rows = Rows { time_s: &time_s, lines: &lines, coordinates: &rows, first_turn_rad: 0.0 };
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
        let time_s: Vec<f64> = (0..100).map(|k| f64::from(k) / RATE_HZ).collect();
        let place = |&t_s: &f64| {
            let [x, y, z] = motion_mm(t_s).map(|mm| mm / 1e3);
            Vector6::new(x, y, z, 0.0, 0.0, 0.0)
        };
        let coordinates: Vec<_> = time_s.iter().map(place).collect();
        let lines: Vec<_> = (2..102).collect();
        glitches(&Rows { time_s: &time_s, lines: &lines, coordinates: &coordinates, first_turn_rad: 0.0 })
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
