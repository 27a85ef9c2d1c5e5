//! Reading a recorded motion of the lower jaw: from a CSV file to a [`Recording`] in the jaw frame.
//!
//! Comments start with `#`; the header decides between poses and markers. A file is used whole or
//! refused with line, reason and remedy: nothing is guessed, skipped or repaired.

use masseter_shared::config::{FileConfig, JawConfig};
use masseter_shared::geometry::Vec3;
use masseter_shared::input::read_text;

use super::TrajectoryError;
use super::axes::Axes;
use super::error::{Located, require};
use super::mandible::condylar_middle;
use super::recording::{Recording, Sample};
use super::table::{Format, LARGEST_MM, Row, Table};
use super::{markers, pose_csv};

/// Reads, converts to the jaw frame and smooths.
pub(super) fn import(config: &FileConfig, jaw: &JawConfig) -> Result<Recording, TrajectoryError> {
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
    recording(config, &reference).map_err(|problem| problem.in_file(&config.path))
}

fn recording(config: &FileConfig, reference: &Vec3) -> Result<Recording, Located> {
    let axes = Axes::parse(&config.axes).map_err(Located::whole)?;
    let unreadable = |error| format!("cannot be read ({error}); check the path and that it is UTF-8 text");
    let text =
        read_text(&config.path, FileConfig::MOST_BYTES).map_err(|error| Located::whole(unreadable(error)))?;
    let table = Table::parse(&text)?;
    check_points(config, table.format).map_err(Located::whole)?;
    let origin = config.marker_origin_mm.map(|mm| Vec3::from(mm) / 1000.0);
    let displacement = |values: &[f64]| match table.format {
        Format::Poses => pose_csv::displacement(values, &axes, reference),
        Format::Markers => markers::displacement(&table.rows[0].values, values, &axes, origin),
    };
    let sample = |row: &Row| match displacement(&row.values) {
        Ok(displacement) => Ok(Sample { line: row.line, time_s: row.time_s, displacement }),
        Err(problem) => Err(Located::at(row.line, problem)),
    };
    let samples = table.rows.iter().map(sample).collect::<Result<Vec<_>, _>>()?;
    let is_of_centroid = table.format == Format::Markers && origin.is_none();
    Recording::new(config.path.clone(), &samples, is_of_centroid, config.lowpass_hz)
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
