//! Reading a recorded motion of the lower jaw: from a CSV file to a [`Recording`] in the jaw frame.
//!
//! Comments start with `#`; the header decides between poses and markers. A file is used whole or
//! refused with line, reason and remedy: nothing is guessed, skipped or repaired.

use masseter_model::geometry::{Pose, Vec3};
use masseter_scenario::input::read_text;
use masseter_scenario::{FileConfig, JawConfig};

use super::TrajectoryError;
use super::axes::Axes;
use super::error::{Located, require};
use super::mandible::condylar_middle;
use super::recording::{Recording, Sample};
use super::table::{Format, LARGEST_MM, Row, Table};
use super::{markers, pose_csv};

/// Reads, converts to the jaw frame and smooths.
pub(super) fn import(config: &FileConfig, jaw: &JawConfig) -> Result<Recording, TrajectoryError> {
    let source = Source::read(config, jaw)?;
    source.recording().map(|(_, recording)| recording)
}

/// A file that was read, with what its numbers mean.
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
            require(
                "motion.reference_point_mm or motion.marker_origin_mm",
                coordinate,
                is_near,
                "within ±100000 mm",
            )?;
        }
        let reference = match config.reference_point_mm {
            Some(point_mm) => Vec3::from(point_mm) / 1000.0,
            None => condylar_middle(jaw)?,
        };
        let origin = config.marker_origin_mm.map(|mm| Vec3::from(mm) / 1000.0);
        let read = axes_and_table(config).map_err(|problem| problem.in_file(&config.path));
        read.map(|(axes, table)| Self { config, axes, reference, origin, table })
    }

    /// Whether the markers' centroid stands for the incisal point, because that is not given.
    pub(super) fn is_of_centroid(&self) -> bool {
        self.table.format == Format::Markers && self.origin.is_none()
    }

    /// A row's displacement of incisal point and jaw, jaw frame, if the file has these axes.
    pub(super) fn displacement(&self, row: &Row, axes: &Axes) -> Result<Pose, Located> {
        let displacement = match self.table.format {
            Format::Poses => pose_csv::displacement(&row.values, axes, &self.reference),
            Format::Markers => {
                markers::displacement(&self.table.rows[0].values, &row.values, axes, self.origin)
            }
        };
        displacement.map_err(|problem| Located::at(row.line, problem))
    }

    /// The rows in the jaw frame, and the smooth motion.
    pub(super) fn recording(&self) -> Result<(Vec<Sample>, Recording), TrajectoryError> {
        let sample = |row: &Row| {
            let displacement = self.displacement(row, &self.axes)?;
            Ok(Sample { line: row.line, time_s: row.time_s, displacement })
        };
        let made = self.table.rows.iter().map(sample).collect::<Result<Vec<_>, _>>().and_then(|samples| {
            let path = self.config.path.clone();
            let recording = Recording::new(path, &samples, self.is_of_centroid(), self.config.lowpass_hz)?;
            Ok((samples, recording))
        });
        made.map_err(|problem: Located| problem.in_file(&self.config.path))
    }
}

fn axes_and_table(config: &FileConfig) -> Result<(Axes, Table), Located> {
    let axes = Axes::parse(&config.axes).map_err(Located::whole)?;
    let unreadable = |error| format!("cannot be read ({error}); check the path and that it is UTF-8 text");
    let text =
        read_text(&config.path, FileConfig::MOST_BYTES).map_err(|error| Located::whole(unreadable(error)))?;
    let table = Table::parse(&text)?;
    check_points(config, table.format).map_err(Located::whole)?;
    Ok((axes, table))
}

/// Refuses a key that the file's format does not use: ignoring it would hide a mistake.
fn check_points(config: &FileConfig, format: Format) -> Result<(), String> {
    let (key, of, holds) = match format {
        Format::Poses if config.marker_origin_mm.is_some() => ("marker_origin_mm", "markers", "poses"),
        Format::Markers if config.reference_point_mm.is_some() => ("reference_point_mm", "poses", "markers"),
        _ => return Ok(()),
    };
    Err(format!("motion.{key} is for files of {of}, and this one holds {holds}; leave it away"))
}
