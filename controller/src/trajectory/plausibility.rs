//! Warnings about a recording that may not be the motion of a jaw. The user decides.

use super::glitches::Glitch;
use super::recorded_rows::Rows;

/// Below this everywhere, a file may hold metres where it should hold millimetres, m and rad.
const STILL_M: f64 = 1e-4;
const STILL_RAD: f64 = 2e-3;
/// No jaw opens further, m.
const WIDEST_M: f64 = 0.1;
/// A jaw glides so far without a turn, m. One that opens turns by 0.6 to 0.7° a millimetre; a sixth of that is doubtful.
const GLIDE_M: f64 = 0.012;
const TURN_DEG_PER_M: f64 = 100.0;
/// The first row of a recording of poses is near the closed jaw, m and rad.
const CLOSED_M: f64 = 0.01;
const CLOSED_RAD: f64 = 0.1;

/// What is doubtful in the rows, each with a line. Glitches are not part of it.
pub(super) fn doubts(rows: &Rows) -> Vec<String> {
    not_closed(rows).into_iter().chain(units(rows)).collect()
}

fn not_closed(rows: &Rows) -> Option<String> {
    let (away_m, line) = (rows.place_m(0).norm(), rows.lines[0]);
    (away_m > CLOSED_M || rows.first_turn_rad > CLOSED_RAD).then(|| {
        format!(
            "line {line}: the first row is {:.1} mm and {:.1}° from the closed jaw; are the poses relative to the closed \
             jaw, and the quaternions in the order qw,qx,qy,qz?",
            away_m * 1e3,
            rows.first_turn_rad.to_degrees()
        )
    })
}

fn units(rows: &Rows) -> Option<String> {
    let farthest = rows.farthest();
    let (way_m, line) = (rows.way_m(farthest), rows.lines[farthest]);
    let way_mm = way_m * 1e3;
    let turn_rad = (0..rows.lines.len()).map(|row| rows.turn_rad(row)).fold(0.0, f64::max);
    let turn_deg = turn_rad.to_degrees();
    if way_m < STILL_M && turn_rad <= STILL_RAD {
        Some(format!(
            "line {line}: the farthest row is {way_mm:.4} mm from the first; is the unit millimetres?"
        ))
    } else if way_m > WIDEST_M {
        Some(format!(
            "line {line}: the incisal point is {way_mm:.0} mm from the first row; is the unit millimetres?"
        ))
    } else if way_m > GLIDE_M && turn_deg < TURN_DEG_PER_M * way_m {
        Some(format!(
            "line {line}: the incisal point is {way_mm:.1} mm from the first row, yet the jaw turns by {turn_deg:.2}° at \
             most; are angles in the right unit, and all markers on the lower jaw?"
        ))
    } else {
        None
    }
}

/// One warning for all glitches.
pub(super) fn jumps(glitches: &[Glitch]) -> Option<String> {
    let first = glitches.first()?;
    let others = match glitches.len() - 1 {
        0 => String::new(),
        others => format!(" (and {others} more)"),
    };
    Some(format!(
        "line {}: the incisal point jumps by {:.1} mm within {:.0} ms{others}; is it a glitch of the tracker?",
        first.line,
        first.jump_m * 1e3,
        first.within_s * 1e3
    ))
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector6;

    use super::super::glitches::glitches;
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

    #[test]
    fn units_that_make_no_jaw_are_named() {
        let radians_as_degrees = doubts_of(200.0, |_, pose| pose[4] /= 57.3);
        assert!(radians_as_degrees[0].contains("turns by 0.18°"), "{radians_as_degrees:?}");
        let micrometres = doubts_of(200.0, |_, pose| pose[2] *= 1000.0);
        assert!(micrometres[0].contains("18000 mm") && micrometres.len() == 1, "{micrometres:?}");
        let open = doubts_of(200.0, |_, pose| pose[2] -= 0.02);
        assert!(open[0].starts_with("line 2: the first row is 20.0 mm"), "{open:?}");
    }
}
