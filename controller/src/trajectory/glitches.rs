//! Glitches of a tracker: rows that leave the path of their neighbours.
//!
//! A glitch is a row that lies off the straight way between its neighbours, and is reached or left faster than usual. The
//! deviation is above 1 mm and above four times the usual one of the rows around. A jaw that stops at the teeth stops hard,
//! and is no faster before. Jumps of the orientation alone are not looked for.

use masseter_model::geometry::Vec3;
use serde::Serialize;

use super::recorded_rows::Rows;

/// The least deviation of a row, m.
const LEAST_M: f64 = 1e-3;
/// By how much a glitch exceeds what is usual: deviation, and speed.
const DEVIATION: f64 = 4.0;
const SPEED: f64 = 1.5;
/// Rows on each side that show what is usual.
const AROUND: usize = 4;
/// Rows of one glitch are no further apart.
const ONE: usize = 3;

/// A row that leaves the path of its neighbours.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Glitch {
    /// Line of the file.
    pub line: u64,
    /// Time of the row since the first, s.
    pub time_s: f64,
    /// How far the incisal point jumps, m.
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

/// How the rows follow each other.
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
            speed_m_s[row] =
                (places[row] - places[row - 1]).norm() / (rows.time_s[row] - rows.time_s[row - 1]);
            if row + 1 < places.len() {
                let share =
                    (rows.time_s[row] - rows.time_s[row - 1]) / (rows.time_s[row + 1] - rows.time_s[row - 1]);
                deviation_m[row] = (places[row] - places[row - 1].lerp(&places[row + 1], share)).norm();
            }
        }
        Self { deviation_m, speed_m_s }
    }

    /// Whether a row between others is one.
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
    median(&values[end.saturating_sub(AROUND).max(1).min(end)..end])
}

/// Median of the values from an index on.
fn after(values: &[f64], from: usize) -> f64 {
    let from = from.min(values.len());
    median(&values[from..(from + AROUND).min(values.len())])
}

/// The upper median; 0 without a value.
fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector6;

    use super::*;

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
