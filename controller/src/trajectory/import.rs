//! Import of a recorded motion of the lower jaw: from a CSV file to a [`Recording`] in the jaw frame.
//!
//! Comments start with `#`; the header decides between poses and markers. The import takes a whole file, or refuses the
//! file with line, reason and remedy. The import guesses, skips and repairs nothing. Whether the motion is a jaw's is not
//! judged here.

use masseter_model::geometry::{Pose, Vec3};
use masseter_scenario::input::read_foreign_text;
use masseter_scenario::{FileConfig, JawConfig};
use nalgebra::{Matrix3, Quaternion, Rotation3, Translation3, UnitQuaternion};

use super::mandible::condylar_middle;
use super::recording::{Recording, Sample};
use super::table::{Format, LARGEST_MM, Located, Row, Table};
use super::{TrajectoryError, require};

/// The names of a file's axes, each with its direction.
pub(super) const SIGNED_AXES: [&str; 6] = ["+x", "-x", "+y", "-y", "+z", "-z"];
/// Largest difference of a quaternion's length from 1 by rounding; beyond it the quaternion is wrong.
const NORM_TOLERANCE: f64 = 1e-3;
/// A triangle lower than this share of its longest side fixes no orientation.
const FLATTEST: f64 = 0.05;
/// Largest change of the markers' distances. On one rigid carrier only noise changes them; a jaw tracker's noise is
/// 0.03 mm.
const LARGEST_CHANGE_M: f64 = 0.002;
const SIDES: [(usize, usize); 3] = [(0, 1), (1, 2), (2, 0)];

/// A file's content, with the meaning of its numbers.
pub(super) struct Source<'a> {
    config: &'a FileConfig,
    axes: Axes,
    /// The point that poses follow, jaw frame, m.
    pub reference: Vec3,
    /// The incisal point at the closed jaw in the markers' coordinates, m.
    origin: Option<Vec3>,
    pub table: Table,
}

impl<'a> Source<'a> {
    /// Reads the file and checks the keys of its section.
    pub(super) fn read(config: &'a FileConfig, jaw: &JawConfig) -> Result<Self, TrajectoryError> {
        let lowpass_hz = config.lowpass_hz;
        let holds = lowpass_hz == 0.0 || (0.5..=50.0).contains(&lowpass_hz);
        require("motion.lowpass_hz", lowpass_hz, holds, "0 (none) or 0.5 to 50 Hz")?;
        for &coordinate in config.reference_point_mm.iter().chain(&config.marker_origin_mm).flatten() {
            let is_near = coordinate.abs() <= LARGEST_MM;
            let name = "motion.reference_point_mm or motion.marker_origin_mm";
            require(name, coordinate, is_near, "within ±100000 mm")?;
        }
        let reference = match config.reference_point_mm {
            Some(point_mm) => Vec3::from(point_mm) / 1000.0,
            None => condylar_middle(jaw)?,
        };
        let origin = config.marker_origin_mm.map(|mm| Vec3::from(mm) / 1000.0);
        let read = axes_and_table(config).map_err(|problem| problem.in_file(&config.path));
        read.map(|(axes, table)| Self { config, axes, reference, origin, table })
    }

    /// A row's displacement of incisal point and jaw, jaw frame, if the file has these axes.
    pub(super) fn displacement(&self, row: &Row, axes: &Axes) -> Result<Pose, Located> {
        let displacement = match self.table.format {
            Format::Poses => displacement_of_pose(&row.values, axes, &self.reference),
            Format::Markers => {
                displacement_of_markers(&self.table.rows[0].values, &row.values, axes, self.origin)
            }
        };
        displacement.map_err(|problem| Located::at(row.line, problem))
    }

    /// The rows in the jaw frame.
    pub(super) fn samples(&self) -> Result<Vec<Sample>, TrajectoryError> {
        let sample = |row: &Row| {
            let displacement = self.displacement(row, &self.axes)?;
            Ok(Sample { line: row.line, time_s: row.time_s, displacement })
        };
        let samples = self.table.rows.iter().map(sample).collect::<Result<Vec<_>, _>>();
        samples.map_err(|problem: Located| problem.in_file(&self.config.path))
    }

    /// The smooth motion through the rows.
    pub(super) fn recording(&self, samples: &[Sample]) -> Result<Recording, TrajectoryError> {
        let path = &self.config.path;
        // Without an incisal point, the markers' centroid stands for it.
        let are_of_centroid = self.table.format == Format::Markers && self.origin.is_none();
        let recording = Recording::new(path.clone(), samples, are_of_centroid, self.config.lowpass_hz);
        recording.map_err(|problem| problem.in_file(path))
    }

    /// Whether the file shows where the condyles are: the point that it follows is known.
    pub(super) fn shows_condyles(&self) -> bool {
        self.table.format == Format::Poses || self.origin.is_some()
    }

    /// The longest side of the markers' triangle, mm; none of poses.
    pub(super) fn longest_side_mm(&self) -> Option<f64> {
        let values = &self.table.rows[0].values;
        (self.table.format == Format::Markers).then(|| longest_side_m(&markers_m(values)) * 1e3)
    }
}

fn axes_and_table(config: &FileConfig) -> Result<(Axes, Table), Located> {
    let axes = Axes::parse(&config.axes).map_err(Located::whole)?;
    let text = read_foreign_text(&config.path, FileConfig::MOST_BYTES).map_err(|error| {
        Located::whole(format!("cannot be read ({error}); check the path and that it is text"))
    })?;
    let mut table = Table::parse(&text, config.time_unit)?;
    let lengths = if table.format == Format::Poses { 3 } else { 9 };
    for length in table.rows.iter_mut().flat_map(|row| &mut row.values[..lengths]) {
        *length *= config.length_unit.mm();
    }
    check_points(config, table.format).map_err(Located::whole)?;
    Ok((axes, table))
}

/// Refuses a key without a use in the file's format, because an ignored key hides a mistake.
fn check_points(config: &FileConfig, format: Format) -> Result<(), String> {
    let (key, of, holds) = match format {
        Format::Poses if config.marker_origin_mm.is_some() => ("marker_origin_mm", "markers", "poses"),
        Format::Markers if config.reference_point_mm.is_some() => ("reference_point_mm", "poses", "markers"),
        _ => return Ok(()),
    };
    Err(format!("motion.{key} is for files of {of}, and this one holds {holds}; leave it away"))
}

/// The map from a file's axes to the jaw frame's (anterior, left, up): a signed permutation that keeps the hand.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Axes(UnitQuaternion<f64>);

impl Axes {
    /// The map by the names of the file's axes that point anterior, left and up, such as "+y".
    pub(super) fn parse(names: &[String; 3]) -> Result<Self, String> {
        let refuse = |reason: &str| {
            format!(
                "axes {names:?}: {reason}; name the file's axes that point anterior, left and up, \
                 such as [\"+x\", \"+y\", \"+z\"]"
            )
        };
        let mut rows = Matrix3::zeros();
        for (row, name) in names.iter().enumerate() {
            let axis = direction(name).ok_or_else(|| refuse("an axis is one of +x -x +y -y +z -z"))?;
            rows.set_row(row, &axis.transpose());
        }
        let determinant = rows.determinant();
        if determinant == 0.0 {
            return Err(refuse("an axis is named twice"));
        }
        if determinant < 0.0 {
            return Err(refuse(&mirrored(names)));
        }
        Ok(Self(UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rows))))
    }

    /// The jaw frame's own axes.
    pub(super) fn of_jaw() -> Self {
        Self(UnitQuaternion::identity())
    }

    /// A vector of the file in the jaw frame.
    pub(super) fn vector(&self, in_file: &Vec3) -> Vec3 {
        self.0 * in_file
    }

    /// The map as a matrix.
    pub(super) fn matrix(&self) -> Matrix3<f64> {
        *self.0.to_rotation_matrix().matrix()
    }

    /// A rotation of the file in the jaw frame.
    fn rotation(&self, in_file: &UnitQuaternion<f64>) -> UnitQuaternion<f64> {
        self.0 * in_file * self.0.inverse()
    }
}

/// What a left-handed frame means. The motion shows what is anterior and up, so the axis of left is the mirrored one.
fn mirrored([anterior, left, up]: &[String; 3]) -> String {
    let axis = left.trim_start_matches(['+', '-']);
    let right_handed = if left.starts_with('+') { format!("-{axis}") } else { format!("+{axis}") };
    let others: Vec<_> = ["x", "y", "z"].into_iter().filter(|name| *name != axis).collect();
    format!(
        "the frame is left-handed: where {anterior} is anterior and {up} is up, left is {right_handed}. A file whose left \
         is {left} mirrors the jaw along {axis}: negate its {axis}_mm and its q{} and q{}, then left is {right_handed}",
        others[0], others[1]
    )
}

fn direction(name: &str) -> Option<Vec3> {
    let index = SIGNED_AXES.iter().position(|known| *known == name)?;
    Some(Vec3::ith(index / 2, if index % 2 == 0 { 1.0 } else { -1.0 }))
}

/// Displacement of the incisal point and the jaw from that of a reference point on the jaw. The reference point is in
/// the jaw frame at the closed pose, metres.
fn displacement_of_pose(values: &[f64], axes: &Axes, reference: &Vec3) -> Result<Pose, String> {
    let moved = axes.vector(&(Vec3::from_column_slice(&values[..3]) / 1000.0));
    let quaternion = Quaternion::new(values[3], values[4], values[5], values[6]);
    let norm = quaternion.norm();
    if (norm - 1.0).abs() > NORM_TOLERANCE {
        return Err(format!(
            "the quaternion's norm is {norm:.6}, not 1; write unit quaternions in the order qw,qx,qy,qz"
        ));
    }
    let rotation = axes.rotation(&UnitQuaternion::from_quaternion(quaternion));
    let incisal = reference + moved - rotation * reference;
    Ok(Pose::from_parts(incisal.into(), rotation))
}

/// Places of the three markers, m.
type Markers = [Vec3; 3];

/// Displacement of the jaw since the first row by the rigid motion of three markers (Kabsch 1976). `origin` is the
/// incisal point at the closed pose in file coordinates, metres; by default the markers' centroid.
fn displacement_of_markers(
    first: &[f64],
    values: &[f64],
    axes: &Axes,
    origin: Option<Vec3>,
) -> Result<Pose, String> {
    let (closed, now) = (markers_m(first), markers_m(values));
    check_spread(&closed)?;
    check_rigid(&closed, &now)?;
    let origin = origin.unwrap_or_else(|| centroid(&closed));
    let motion = rigid_motion(&closed, &now);
    let moved = motion.rotation * origin + motion.translation.vector - origin;
    Ok(Pose::from_parts(axes.vector(&moved).into(), axes.rotation(&motion.rotation)))
}

/// The rigid motion that carries one set of points to the other with the least squared error, by
/// singular value decomposition of their covariance.
fn rigid_motion(from: &Markers, to: &Markers) -> Pose {
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

fn markers_m(values_mm: &[f64]) -> Markers {
    std::array::from_fn(|marker| Vec3::from_column_slice(&values_mm[3 * marker..][..3]) / 1000.0)
}

fn centroid(markers: &Markers) -> Vec3 {
    markers.iter().sum::<Vec3>() / 3.0
}

fn longest_side_m(markers: &Markers) -> f64 {
    SIDES.map(|(i, j)| (markers[i] - markers[j]).norm()).into_iter().fold(0.0, f64::max)
}

fn check_spread(markers: &Markers) -> Result<(), String> {
    let [a, b, c] = markers;
    let longest_m = longest_side_m(markers);
    let height_m = (b - a).cross(&(c - a)).norm() / longest_m.max(f64::MIN_POSITIVE);
    if height_m <= FLATTEST * longest_m {
        let (height_mm, longest_mm) = (1000.0 * height_m, 1000.0 * longest_m);
        return Err(format!(
            "the markers lie on a line (triangle of height {height_mm:.3} mm over {longest_mm:.3} mm); \
             three points off one line are needed"
        ));
    }
    Ok(())
}

fn check_rigid(closed: &Markers, now: &Markers) -> Result<(), String> {
    for (i, j) in SIDES {
        let change_m = (now[i] - now[j]).norm() - (closed[i] - closed[j]).norm();
        if change_m.abs() > LARGEST_CHANGE_M {
            let (i, j, change_mm, limit_mm) = (i + 1, j + 1, 1000.0 * change_m, 1000.0 * LARGEST_CHANGE_M);
            return Err(format!(
                "markers {i} and {j} are {change_mm:+.2} mm farther apart than in the first row, limit {limit_mm} mm: \
                 one is loose or swapped; cut or correct the recording"
            ));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests;
