//! Whether a recording looks like the motion of a jaw: doubts for its author, who alone can decide.

use nalgebra::Vector6;

/// Below this everywhere, a file may hold metres where it should hold millimetres, m and rad.
const STILL_M: f64 = 1e-4;
const STILL_RAD: f64 = 2e-3;
/// The least deviation of one row that counts as a glitch, m.
const GLITCH_M: f64 = 1e-3;
/// In a glitch of one row, its neighbours deviate half as much, and the rows beside those hardly.
const NEIGHBOURS: std::ops::Range<f64> = 0.3..0.7;
const BEYOND: f64 = 0.1;

/// What is doubtful in rows of translation (m) and rotation vector (rad) from the first row, with the line of a row.
pub(super) fn doubts(time_s: &[f64], rows: &[Vector6<f64>], lines: &[u64]) -> Vec<String> {
    still(rows, lines).into_iter().chain(glitch(time_s, rows, lines)).collect()
}

fn still(rows: &[Vector6<f64>], lines: &[u64]) -> Option<String> {
    let first = rows[0].fixed_rows::<3>(0);
    let way_m = |row: &Vector6<f64>| (row.fixed_rows::<3>(0) - first).norm();
    let (farthest, way_m) = rows.iter().map(way_m).enumerate().max_by(|(_, a), (_, b)| a.total_cmp(b))?;
    let turns = rows.iter().any(|row| row.fixed_rows::<3>(3).norm() > STILL_RAD);
    (way_m < STILL_M && !turns).then(|| {
        let (line, way_mm) = (lines[farthest], way_m * 1e3);
        format!("line {line}: the farthest row is {way_mm:.4} mm from the first; is the unit millimetres?")
    })
}

fn glitch(time_s: &[f64], rows: &[Vector6<f64>], lines: &[u64]) -> Option<String> {
    let at = |row: usize| rows[row].fixed_rows::<3>(0).into_owned();
    // From the straight way between the rows beside it.
    let deviation_m = |row: usize| {
        let [before_s, at_s, after_s] = [row - 1, row, row + 1].map(|row| time_s[row]);
        let share = (at_s - before_s) / (after_s - before_s);
        (at(row) - at(row - 1).lerp(&at(row + 1), share)).norm()
    };
    (3..rows.len().saturating_sub(3)).find_map(|row| {
        let peak_m = deviation_m(row);
        let is_alone = peak_m > GLITCH_M
            && [row - 1, row + 1].iter().all(|&row| NEIGHBOURS.contains(&(deviation_m(row) / peak_m)))
            && [row - 2, row + 2].iter().all(|&row| deviation_m(row) < BEYOND * peak_m);
        is_alone.then(|| {
            let (line, jump_mm) = (lines[row], peak_m * 1e3);
            format!("line {line}: one row jumps by {jump_mm:.1} mm and back; is it a glitch of the tracker?")
        })
    })
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
            change(row, &mut pose);
            pose
        };
        let rows: Vec<_> = time_s.iter().enumerate().map(pose).collect();
        doubts(&time_s, &rows, &(2..202).collect::<Vec<_>>())
    }

    #[test]
    fn a_motion_in_metres_and_a_single_jump_are_named_with_their_lines() {
        let in_metres = doubts_of(200.0, |_, pose| *pose /= 1000.0);
        assert!(in_metres[0].contains("0.0180 mm") && in_metres.len() == 1, "{in_metres:?}");
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
}
