//! Markers on one rigid body: their common motion, lost ones, and two that change places.
//!
//! A marker that is lost in a row has no coordinates there (NaN). Three markers that are seen are enough.

use masseter_model::geometry::{Pose, Vec3};
use nalgebra::{Matrix3, Rotation3, Translation3, UnitQuaternion};

use super::layout::MARKERS;
use super::row::{Located, Row, gaps};

/// Markers nearer to one line than this share of their greatest distance fix no orientation.
const FLATTEST: f64 = 0.05;
/// Largest change of the markers' distances. On one rigid carrier only noise changes them; a jaw tracker's noise is
/// 0.03 mm.
const LARGEST_CHANGE_M: f64 = 0.002;
/// Largest turn between rows: no jaw turns so far within a gap that is bridged.
const LARGEST_TURN_RAD: f64 = 0.8;

/// The markers of a file, with their places at the closed jaw.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Body {
    names: Vec<String>,
    closed: Vec<Vec3>,
}

impl Body {
    /// The body by a row with all markers, mm.
    pub(super) fn new(names: &[String], closed_mm: &[f64]) -> Result<Self, String> {
        let closed = places_m(closed_mm);
        if let Some((height_m, longest_m)) = flat(&closed) {
            let (height_mm, longest_mm) = (1000.0 * height_m, 1000.0 * longest_m);
            return Err(format!(
                "the markers lie on a line (at most {height_mm:.3} mm off it, over {longest_mm:.3} mm); three points off one \
                 line are needed"
            ));
        }
        Ok(Self { names: names.to_vec(), closed })
    }

    /// The longest distance between two markers, m.
    pub(super) fn longest_side_m(&self) -> f64 {
        let sides = self.closed.iter().flat_map(|a| self.closed.iter().map(move |b| (a - b).norm()));
        sides.fold(0.0, f64::max)
    }

    /// The centroid at the closed jaw, m.
    pub(super) fn centroid(&self) -> Vec3 {
        centroid(&self.closed)
    }

    /// The rigid motion since the closed jaw with the least squared error (Kabsch 1976), and that error's root mean
    /// square, m; from the places of a row, mm.
    pub(super) fn motion(&self, values_mm: &[f64]) -> Result<(Pose, f64), String> {
        let now = places_m(values_mm);
        self.check_rigid(&now)?;
        Ok(self.fit(&now))
    }

    fn fit(&self, now: &[Vec3]) -> (Pose, f64) {
        let (closed, now): (Vec<Vec3>, Vec<Vec3>) =
            self.closed.iter().zip(now).filter(|(_, now)| is_seen(now)).unzip();
        let motion = rigid_motion(&closed, &now);
        let off = |(closed, now): (&Vec3, &Vec3)| {
            (motion.rotation * closed + motion.translation.vector - now).norm_squared()
        };
        let residual_m = (closed.iter().zip(&now).map(off).sum::<f64>() / now.len() as f64).sqrt();
        (motion, residual_m)
    }

    fn check_rigid(&self, now: &[Vec3]) -> Result<(), String> {
        let (i, j, change_m) = self.largest_change(now);
        if change_m.abs() <= LARGEST_CHANGE_M {
            return Ok(());
        }
        let (names, change_mm, limit_mm) = (&self.names, 1000.0 * change_m, 1000.0 * LARGEST_CHANGE_M);
        let without = |loose: usize| {
            let mut others = now.to_vec();
            others[loose] = Vec3::repeat(f64::NAN);
            (others.iter().filter(|place| is_seen(place)).count() >= MARKERS[0])
                .then(|| (loose, self.largest_change(&others).2.abs()))
        };
        let others = (0..now.len()).filter_map(without).min_by(|a, b| a.1.total_cmp(&b.1));
        let others = others.filter(|(_, change_m)| *change_m <= LARGEST_CHANGE_M);
        let remedy = others.map_or_else(
            || "one is loose or swapped; cut or correct the recording".to_owned(),
            |(loose, _)| {
                let kept = names.iter().filter(|name| **name != names[loose]);
                format!(
                    "{} is loose, or not on the lower jaw; leave it out by motion.markers = [{}]",
                    names[loose],
                    masseter_scenario::wording::listed(kept.map(|name| format!("\"{name}\"")))
                )
            },
        );
        Err(format!(
            "markers {} and {} are {change_mm:+.2} mm farther apart than in the first row, limit {limit_mm} mm: {remedy}",
            names[i], names[j]
        ))
    }

    /// The two markers whose distance changes most, and the change, m.
    fn largest_change(&self, now: &[Vec3]) -> (usize, usize, f64) {
        let change_m = |(i, j): (usize, usize)| {
            (i, j, (now[i] - now[j]).norm() - (self.closed[i] - self.closed[j]).norm())
        };
        let changes = pairs(now.len()).map(change_m).filter(|(_, _, change_m)| change_m.is_finite());
        changes.max_by(|a, b| a.2.abs().total_cmp(&b.2.abs())).unwrap_or_default()
    }

    /// The turn of a row, if the markers are those of the body and it is near the turn before.
    fn continues(&self, now: &[Vec3], before: &UnitQuaternion<f64>) -> Option<(Pose, f64)> {
        let is_rigid = self.largest_change(now).2.abs() <= LARGEST_CHANGE_M;
        is_rigid.then(|| self.fit(now)).filter(|(pose, _)| pose.rotation.angle_to(before) < LARGEST_TURN_RAD)
    }
}

/// The body of the first row with all markers, and the rows from there in which its motion can be seen. Markers that
/// change places are put back.
pub(super) struct Settled {
    pub body: Body,
    pub rows: Vec<Row>,
    pub protocol: Vec<String>,
    /// What the user must know before a run.
    pub doubts: Vec<String>,
}

pub(super) fn settle(names: &[String], mut rows: Vec<Row>) -> Result<Settled, Located> {
    let is_whole = |row: &Row| row.values.iter().all(|value| value.is_finite());
    let whole = rows.iter().position(is_whole).ok_or_else(|| {
        let lost = |marker: &usize| rows.iter().filter(|row| row.values[3 * marker].is_nan()).count();
        let worst = (0..names.len()).max_by_key(lost).map_or("", |marker| &names[marker]);
        Located::whole(format!(
            "no row has all {} markers ({worst} is lost most often); leave some out by motion.markers = [names]",
            names.len()
        ))
    })?;
    let (mut protocol, mut doubts) = (Vec::new(), Vec::new());
    if whole > 0 {
        let line = rows[whole].line;
        doubts.push(format!(
            "line {line}: the closed jaw is this row, the first with all markers; is the jaw closed there?"
        ));
        rows.drain(..whole);
    }
    let body = Body::new(names, &rows[0].values).map_err(|problem| Located::at(rows[0].line, problem))?;
    let mut lost: Vec<u64> = Vec::new();
    rows.retain(|row| {
        let seen: Vec<Vec3> = places_m(&row.values).into_iter().filter(is_seen).collect();
        let is_enough = seen.len() >= MARKERS[0] && flat(&seen).is_none();
        lost.extend((!is_enough).then_some(row.line));
        is_enough
    });
    protocol.extend(gaps(&lost));
    let (mut last, mut square_m2, mut largest) = (UnitQuaternion::identity(), 0.0, (0.0, 0));
    let mut swaps: Vec<(usize, usize, Vec<u64>)> = Vec::new();
    for row in &mut rows {
        let now = places_m(&row.values);
        let mut found = body.continues(&now, &last);
        if found.is_none() {
            let swapped = |(i, j)| {
                let mut now = now.clone();
                now.swap(i, j);
                Some((i, j, body.continues(&now, &last)?))
            };
            let mut fits = pairs(now.len()).filter_map(swapped);
            if let (Some((i, j, fit)), None) = (fits.next(), fits.next()) {
                (0..3).for_each(|axis| row.values.swap(3 * i + axis, 3 * j + axis));
                match swaps.iter_mut().find(|(a, b, _)| (*a, *b) == (i, j)) {
                    Some((_, _, lines)) => lines.push(row.line),
                    None => swaps.push((i, j, vec![row.line])),
                }
                found = Some(fit);
            }
        }
        // A row that fits in no way is refused with its reason here, or as a turn too far.
        let (pose, residual_m) = match found {
            Some(found) => found,
            None => body.motion(&row.values).map_err(|problem| Located::at(row.line, problem))?,
        };
        last = pose.rotation;
        square_m2 += residual_m * residual_m;
        if residual_m > largest.0 {
            largest = (residual_m, row.line);
        }
    }
    let rms_mm = 1e3 * (square_m2 / rows.len() as f64).sqrt();
    let (largest_mm, line) = (1e3 * largest.0, largest.1.max(rows[0].line));
    protocol.push(format!(
        "rigid body of {} markers: residual rms {rms_mm:.3} mm, largest {largest_mm:.3} mm in line {line}",
        names.len()
    ));
    doubts.extend(swaps.iter().map(|(i, j, lines)| {
        let (first, last, count) = (lines[0], lines[lines.len() - 1], lines.len());
        format!(
            "line {first}: markers {} and {} change places in {count} rows up to line {last}; they are put back",
            names[*i], names[*j]
        )
    }));
    Ok(Settled { body, rows, protocol, doubts })
}

/// The rigid motion that carries one set of points to the other with the least squared error, by
/// singular value decomposition of their covariance.
fn rigid_motion(from: &[Vec3], to: &[Vec3]) -> Pose {
    let (from_centre, to_centre) = (centroid(from), centroid(to));
    let covariance: Matrix3<f64> =
        from.iter().zip(to).map(|(a, b)| (b - to_centre) * (a - from_centre).transpose()).sum();
    let svd = covariance.svd_unordered(true, true);
    let (Some(u), Some(v_t)) = (svd.u, svd.v_t) else { return Pose::identity() };
    // Three points lie in a plane, so their least singular value is 0, and its axis may be mirrored.
    let mut upright = Matrix3::identity();
    let least = svd.singular_values.imin();
    upright[(least, least)] = (u * v_t).determinant().signum();
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(u * upright * v_t));
    Pose::from_parts(Translation3::from(to_centre - rotation * from_centre), rotation)
}

fn places_m(values_mm: &[f64]) -> Vec<Vec3> {
    values_mm.chunks_exact(3).map(|place| Vec3::from_column_slice(place) / 1000.0).collect()
}

fn is_seen(place: &Vec3) -> bool {
    place.iter().all(|coordinate| coordinate.is_finite())
}

fn pairs(markers: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..markers).flat_map(move |i| (i + 1..markers).map(move |j| (i, j)))
}

fn centroid(places: &[Vec3]) -> Vec3 {
    places.iter().sum::<Vec3>() / places.len() as f64
}

/// The greatest distance from the line through the two farthest places, and the distance of these, if the first is too
/// small for an orientation.
fn flat(places: &[Vec3]) -> Option<(f64, f64)> {
    let apart_m = |&(i, j): &(usize, usize)| (places[i] - places[j]).norm();
    let (i, j) = pairs(places.len()).max_by(|a, b| apart_m(a).total_cmp(&apart_m(b)))?;
    let (along, longest_m) = (places[j] - places[i], apart_m(&(i, j)));
    let off_m = |place: &Vec3| along.cross(&(place - places[i])).norm() / longest_m.max(f64::MIN_POSITIVE);
    let height_m = places.iter().map(off_m).fold(0.0, f64::max);
    (height_m <= FLATTEST * longest_m).then_some((height_m, longest_m))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn coordinates() -> impl Strategy<Value = Vec3> {
        [-0.1..0.1f64, -0.1..0.1f64, -0.1..0.1f64].prop_map(Vec3::from)
    }

    proptest! {
        #[test]
        fn any_rigid_motion_is_recovered(
            from in prop::collection::vec(coordinates(), 3..12),
            by in coordinates(), turn in [-1.8..1.8f64, -1.8..1.8f64, -1.8..1.8f64],
        ) {
            prop_assume!(flat(&from).is_none());
            let rotation = UnitQuaternion::from_scaled_axis(Vec3::from(turn));
            let to: Vec<Vec3> = from.iter().map(|point| rotation * point + by).collect();
            let motion = rigid_motion(&from, &to);
            for (from, to) in from.iter().zip(&to) {
                prop_assert!((motion.rotation * from + motion.translation.vector - to).norm() < 1e-9);
            }
            prop_assert!((motion.rotation.inverse() * rotation).scaled_axis().norm() < 1e-6);
        }
    }

    const CLOSED: [f64; 12] = [1.0, 0.0, 0.0, 41.0, 0.0, 0.0, 1.0, 35.0, 0.0, 1.0, 0.0, 20.0];

    fn names(count: usize) -> Vec<String> {
        (1..=count).map(|number| format!("m{number}")).collect()
    }

    /// Six rows of a shift; `change` gets the row's index.
    fn settled(markers: usize, change: impl Fn(usize, &mut [f64])) -> Result<Settled, Located> {
        let row = |index: usize| {
            let mut values: Vec<f64> =
                CLOSED[..3 * markers].iter().map(|value| value + index as f64).collect();
            change(index, &mut values);
            Row { line: index as u64 + 2, time_s: 0.01 * index as f64, values }
        };
        settle(&names(markers), (0..6).map(row).collect())
    }

    #[test]
    fn markers_that_tell_no_pose_are_refused() {
        for flat in [[0.0, 0.0, 0.0, 40.0, 0.0, 0.0, 80.0, 1.0, 0.0], [5.0; 9]] {
            let error = Body::new(&names(3), &flat).unwrap_err();
            assert!(error.contains("lie on a line"), "{error}");
        }
        let error = settled(3, |row, values| values[3] += if row == 2 { 3.0 } else { 0.0 }).err().unwrap();
        assert_eq!(error.line, Some(4));
        assert!(
            error.problem.starts_with("markers m1 and m2 are +3.00 mm farther apart"),
            "{}",
            error.problem
        );
    }

    #[test]
    fn one_lost_marker_of_four_leaves_the_pose_and_one_of_three_a_gap() {
        let lose = |row: usize, values: &mut [f64]| {
            if row == 3 {
                values[3..6].fill(f64::NAN);
            }
        };
        let Settled { body, rows, .. } = settled(4, lose).ok().unwrap();
        let (pose, residual_m) = body.motion(&rows[3].values).unwrap();
        assert!((pose.translation.vector - Vec3::repeat(0.003)).norm() < 1e-12 && residual_m < 1e-12);
        let lines: Vec<u64> = settled(3, lose).ok().unwrap().rows.iter().map(|row| row.line).collect();
        assert_eq!(lines, [2, 3, 4, 6, 7]);
    }

    #[test]
    fn two_markers_that_change_places_are_named_and_put_back() {
        let swap = |row: usize, values: &mut [f64]| {
            if (2..4).contains(&row) {
                (0..3).for_each(|axis| values.swap(axis, 3 + axis));
            }
        };
        for markers in [3, 4] {
            let swapped = settled(markers, swap).ok().unwrap();
            assert_eq!(swapped.rows, settled(markers, |_, _| ()).ok().unwrap().rows);
            let said = "line 4: markers m1 and m2 change places in 2 rows up to line 5; they are put back";
            assert_eq!(swapped.doubts, [said]);
        }
    }

    #[test]
    fn a_marker_that_is_not_on_the_jaw_is_named_with_the_key_that_leaves_it_out() {
        let still = |_: usize, values: &mut [f64]| values[9..].copy_from_slice(&[1.0, 2.0, 30.0]);
        let error = settled(4, still).err().unwrap();
        assert!(
            error.problem.ends_with("leave it out by motion.markers = [\"m1\", \"m2\", \"m3\"]"),
            "{}",
            error.problem
        );
    }

    #[test]
    fn the_closed_jaw_is_the_first_row_with_all_markers() {
        let settled =
            settled(3, |row, values| values[0] = if row == 0 { f64::NAN } else { values[0] }).ok().unwrap();
        assert_eq!(settled.rows[0].line, 3);
        assert!(settled.doubts[0].starts_with("line 3: the closed jaw is this row"), "{:?}", settled.doubts);
    }
}
