//! Why a recorded motion cannot be used: file, line, problem and remedy.

use std::fmt;
use std::path::PathBuf;

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
    /// A key that this format does not use.
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
        /// The value in the file.
        text: String,
    },
    /// A coordinate beyond what a tracker can see.
    #[error("{value_mm:e} in column `{column}` lies beyond ±{largest_mm} mm; is the unit millimetres?")]
    TooFar {
        /// The column.
        column: &'static str,
        /// The value in the file.
        value_mm: f64,
        /// The limit.
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
    /// A quaternion that is not of unit length.
    #[error("the quaternion's norm is {norm:.6}, not 1; write unit quaternions in the order qw,qx,qy,qz")]
    NotUnitQuaternion {
        /// Its norm.
        norm: f64,
    },
    /// Markers that fix no orientation.
    #[error(
        "the markers lie on a line (triangle of height {height_mm:.3} mm over {longest_mm:.3} mm); \
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
