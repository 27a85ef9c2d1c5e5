//! Import of a recorded motion of the lower jaw: from a tracker's file to a [`Recording`] in the jaw frame.
//!
//! The import takes a whole file, or refuses the file with line, reason and remedy. What is not in the file is asked
//! for by a key of `[motion]`, and what was read is listed in a protocol. Whether the motion is a jaw's is not judged
//! here.

use std::fmt::Display;

use masseter_model::geometry::{Pose, Vec3};
use masseter_scenario::input::{foreign_text, read_bytes};
use masseter_scenario::{FileConfig, JawConfig};
use nalgebra::{Matrix3, Quaternion, Rotation3, UnitQuaternion};

use super::recording::Recording;
use super::row::{Located, Row, Sample};
use super::table::{Format, LARGEST_MM, Table};
use super::{TrajectoryError, c3d, jaw::condylar_middle, markers::Body, ranges_of, require};

/// The names of a file's axes, each with its direction.
pub(super) const SIGNED_AXES: [&str; 6] = ["+x", "-x", "+y", "-y", "+z", "-z"];
/// Largest difference of a quaternion's length from 1 by rounding; beyond it the quaternion is wrong.
const NORM_TOLERANCE: f64 = 1e-3;

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
        config.check_ranges(ranges_of("motion"))?;
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
        let displacement = match &self.table.format {
            Format::Poses => displacement_of_pose(&row.values, axes, &self.reference),
            Format::Markers(body) => displacement_of_markers(body, &row.values, axes, self.origin),
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
        let are_of_centroid = !self.shows_condyles();
        let recording = Recording::new(path.clone(), samples, are_of_centroid, self.config.lowpass_hz);
        let mut recording = recording.map_err(|problem| problem.in_file(path))?;
        recording.doubts.extend(self.table.doubts.iter().cloned());
        Ok(recording)
    }

    /// Whether the file shows where the condyles are: the point that it follows is known.
    pub(super) fn shows_condyles(&self) -> bool {
        self.table.format == Format::Poses || self.origin.is_some()
    }

    /// The longest distance between two markers, mm; none of poses.
    pub(super) fn longest_side_mm(&self) -> Option<f64> {
        if let Format::Markers(body) = &self.table.format { Some(body.longest_side_m() * 1e3) } else { None }
    }
}

fn axes_and_table(config: &FileConfig) -> Result<(Axes, Table), Located> {
    let axes = Axes::parse(&config.axes).map_err(Located::whole)?;
    let unreadable = |error: &dyn Display| {
        Located::whole(format!("cannot be read ({error}); check the path and that it is text or C3D"))
    };
    let bytes = read_bytes(&config.path, FileConfig::MOST_BYTES).map_err(|error| unreadable(&error))?;
    if c3d::is_c3d(&bytes) {
        return Ok((axes, of_c3d(&bytes, config)?));
    }
    let text = foreign_text(&bytes).map_err(|error| unreadable(&error))?;
    Ok((axes, Table::parse(&text, config)?))
}

fn of_c3d(bytes: &[u8], config: &FileConfig) -> Result<Table, Located> {
    let c3d::Markers { text, first_frame, protocol } =
        c3d::markers(bytes).map_err(|error| Located::whole(error.to_string()))?;
    let in_frame = |Located { line, problem }| {
        let frame = line.and_then(|line| line.checked_sub(2)).map(|row| first_frame + row);
        Located::whole(frame.map_or(problem.clone(), |frame| format!("frame {frame}: {problem}")))
    };
    let mut table = Table::parse(&text, config).map_err(in_frame)?;
    // The file has no separators.
    table.protocol.splice(..1, protocol);
    Ok(table)
}

/// The plain form of a file, under comments with what was read and converted.
///
/// # Errors
/// For an unusable file: the line, the reason and a remedy.
pub fn plain_form(config: &FileConfig, jaw: &JawConfig) -> Result<String, TrajectoryError> {
    Source::read(config, jaw).map(|source| source.table.plain(&config.path))
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

/// Displacement of the jaw since the closed jaw by its markers. `origin` is the incisal point at the closed pose in file
/// coordinates, metres; by default the markers' centroid.
fn displacement_of_markers(
    body: &Body,
    values: &[f64],
    axes: &Axes,
    origin: Option<Vec3>,
) -> Result<Pose, String> {
    let origin = origin.unwrap_or_else(|| body.centroid());
    let (motion, _) = body.motion(values)?;
    let moved = motion.rotation * origin + motion.translation.vector - origin;
    Ok(Pose::from_parts(axes.vector(&moved).into(), axes.rotation(&motion.rotation)))
}

#[cfg(test)]
mod messy_tests;
#[cfg(test)]
mod tests;
