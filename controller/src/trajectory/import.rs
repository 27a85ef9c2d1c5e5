//! Reading a recorded motion of the lower jaw: from a CSV file to a [`Recording`] in the jaw frame.
//!
//! Comments start with `#`; the header decides between poses and markers. A file is used whole or
//! refused with line, reason and remedy: nothing is guessed, skipped or repaired.

use std::fmt;
use std::path::PathBuf;

use masseter_shared::config::{FileConfig, JawConfig};
use masseter_shared::geometry::{Pose, Vec3};

use super::TrajectoryError;
use super::axes::Axes;
use super::error::require;
use super::mandible::condylar_middle;
use super::markers;
use super::pose_csv;
use super::recording::Recording;
use super::table::{Format, LARGEST_MM, Table};

/// A place in a recording.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SourceLine {
    /// The file.
    pub path: PathBuf,
    /// The line, from 1.
    pub line: u64,
}

impl fmt::Display for SourceLine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}", self.path.display(), self.line)
    }
}

/// A recording that cannot be used: where, and why.
#[derive(Debug, thiserror::Error)]
#[error("{}{}: {problem}", path.display(), line.map_or_else(String::new, |line| format!(":{line}")))]
pub struct ImportError {
    /// The file.
    pub path: PathBuf,
    /// The line, from 1; none where the file as a whole is at fault.
    pub line: Option<u64>,
    /// What is wrong.
    #[source]
    pub problem: ImportProblem,
}

/// What makes a recording unusable.
#[derive(Debug, thiserror::Error)]
pub enum ImportProblem {
    /// The file is absent, forbidden or no text.
    #[error("cannot be read ({0}); check the path and that it is UTF-8 text")]
    NotReadable(#[from] std::io::Error),
    /// The axes are no right-handed frame.
    #[error(
        "axes {axes:?}: {reason}; name the file's axes that point anterior, left and up, \
         such as [\"+x\", \"+y\", \"+z\"]"
    )]
    Axes {
        /// As configured.
        axes: [String; 3],
        /// What is wrong with them.
        reason: &'static str,
    },
    /// Neither of the headers.
    #[error("column {position} is `{found}`, expected `{expected}`; the header must be `{header}`")]
    Column {
        /// The first column that differs, from 1.
        position: usize,
        /// Its name; empty if missing.
        found: String,
        /// The name it should have; empty if there should be none.
        expected: &'static str,
        /// The whole header of the nearest format.
        header: String,
    },
    /// A point that this format has no use for.
    #[error("motion.{key} is for files of {of}, and this one holds {holds}; leave it away")]
    Superfluous {
        /// The key.
        key: &'static str,
        /// What it is for.
        of: &'static str,
        /// What the file holds.
        holds: &'static str,
    },
    /// A row with more or fewer fields than the header.
    #[error("{found} fields, but the header names {expected}; complete the row or delete it")]
    Fields {
        /// Fields in the row.
        found: usize,
        /// Columns of the header.
        expected: usize,
    },
    /// A field that is no finite number.
    #[error("`{text}` in column `{column}` is not a finite number; write it with a decimal point")]
    NotANumber {
        /// The column.
        column: &'static str,
        /// What stands there.
        text: String,
    },
    /// A coordinate beyond what a tracker can see.
    #[error("{value_mm:e} in column `{column}` lies beyond ±{largest_mm} mm; is the unit millimetres?")]
    TooFar {
        /// The column.
        column: &'static str,
        /// What stands there.
        value_mm: f64,
        /// What is believed.
        largest_mm: f64,
    },
    /// Time that does not increase, or by less than a microsecond.
    #[error(
        "time {time_s} s does not come after {previous_s} s of the row before by 1 µs or more; sort the rows, \
         drop repeats"
    )]
    TimeOrder {
        /// Time of the row.
        time_s: f64,
        /// Time of the row before.
        previous_s: f64,
    },
    /// Rows missing.
    #[error("{gap_s:.3} s without a sample, at most {largest_s} s can be bridged; cut the recording here")]
    Gap {
        /// Time since the row before.
        gap_s: f64,
        /// What is bridged.
        largest_s: f64,
    },
    /// Too short to be a motion.
    #[error("{rows} rows of data, at least {needed} are needed")]
    TooFewRows {
        /// Rows found.
        rows: usize,
        /// Rows needed.
        needed: usize,
    },
    /// A quaternion that is none.
    #[error("the quaternion's norm is {norm:.6}, not 1; write unit quaternions in the order qw,qx,qy,qz")]
    NotUnitQuaternion {
        /// Its norm.
        norm: f64,
    },
    /// Markers that fix no orientation.
    #[error(
        "the markers stand on a line (triangle of height {height_mm:.3} mm over {longest_mm:.3} mm); \
         three points off one line are needed"
    )]
    Collinear {
        /// Height of their triangle over its longest side, mm.
        height_mm: f64,
        /// The longest side, mm.
        longest_mm: f64,
    },
    /// Markers that moved against each other.
    #[error(
        "markers {first} and {second} are {change_mm:+.2} mm farther apart than in the first row, limit \
         {limit_mm} mm: one is loose or swapped; cut or correct the recording"
    )]
    NotRigid {
        /// A marker, from 1.
        first: usize,
        /// Another.
        second: usize,
        /// Change of their distance, mm.
        change_mm: f64,
        /// What is allowed.
        limit_mm: f64,
    },
    /// More rotation than the interpolation is made for.
    #[error("turned by {angle_deg:.1}° from the first row, limit {limit_deg}°; is the orientation right?")]
    Turned {
        /// Angle from the first row's orientation.
        angle_deg: f64,
        /// What is allowed.
        limit_deg: f64,
    },
}

/// A problem with its line, before the path is known to it.
pub(super) struct Located {
    pub line: Option<u64>,
    pub problem: ImportProblem,
}

impl Located {
    pub(super) fn at(line: u64, problem: ImportProblem) -> Self {
        Self { line: Some(line), problem }
    }

    pub(super) fn whole(problem: impl Into<ImportProblem>) -> Self {
        Self { line: None, problem: problem.into() }
    }
}

/// Jaw displacements as recorded; jaw frame, metres.
#[derive(Debug, Default)]
pub(super) struct Samples {
    pub time_s: Vec<f64>,
    pub lines: Vec<u64>,
    pub displacements: Vec<Pose>,
    /// Whether they are those of the markers' centroid, because nobody said where the incisal point is.
    pub are_of_centroid: bool,
}

/// Reads, converts to the jaw frame and smooths.
pub(super) fn import(config: &FileConfig, jaw: &JawConfig) -> Result<Recording, TrajectoryError> {
    let lowpass_hz = config.lowpass_hz;
    let holds = lowpass_hz == 0.0 || (0.5..=50.0).contains(&lowpass_hz);
    require("lowpass_hz", lowpass_hz, holds, "0 (none) or 0.5 to 50 Hz")?;
    for &coordinate in config.reference_point_mm.iter().chain(&config.marker_origin_mm).flatten() {
        let is_near = coordinate.abs() <= LARGEST_MM;
        require("reference_point_mm or marker_origin_mm", coordinate, is_near, "within ±100000 mm")?;
    }
    let reference = match config.reference_point_mm {
        Some(point_mm) => Vec3::from(point_mm) / 1000.0,
        None => condylar_middle(jaw)?,
    };
    let recording = samples(config, &reference)
        .and_then(|samples| Recording::new(config.path.clone(), samples, lowpass_hz))
        .map_err(|Located { line, problem }| ImportError { path: config.path.clone(), line, problem })?;
    Ok(recording)
}

fn samples(config: &FileConfig, reference: &Vec3) -> Result<Samples, Located> {
    let axes = Axes::parse(&config.axes).map_err(Located::whole)?;
    let text = std::fs::read_to_string(&config.path).map_err(Located::whole)?;
    let table = Table::parse(&text)?;
    check_points(config, table.format).map_err(Located::whole)?;
    match table.format {
        Format::Poses => pose_csv::samples(&table, &axes, reference),
        Format::Markers => {
            markers::samples(&table, &axes, config.marker_origin_mm.map(|mm| Vec3::from(mm) / 1000.0))
        }
    }
}

/// What nobody would look at is refused: it was meant for something.
fn check_points(config: &FileConfig, format: Format) -> Result<(), ImportProblem> {
    let (poses, markers) = ("poses", "markers");
    match format {
        Format::Poses if config.marker_origin_mm.is_some() => {
            Err(ImportProblem::Superfluous { key: "marker_origin_mm", of: markers, holds: poses })
        }
        Format::Markers if config.reference_point_mm.is_some() => {
            Err(ImportProblem::Superfluous { key: "reference_point_mm", of: poses, holds: markers })
        }
        _ => Ok(()),
    }
}
