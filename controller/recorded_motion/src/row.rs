//! A row of a recording, and what is wrong or absent in one, with its line.
//!
//! The readings of rows are not part of this module.

use masseter_model::geometry::{Pose, Vec3};

use super::TrajectoryError;

/// What trackers write for a lost sample, besides an empty cell.
const LOST: [&str; 12] =
    ["", "-", "--", "nan", "-nan", "na", "n/a", "#n/a", "null", "none", "missing", "-3.697314e28"];

/// A row: time, and the other columns of the plain form. A marker that is lost has NaN.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Row {
    pub line: u64,
    pub time_s: f64,
    pub values: Vec<f64>,
}

/// A row in the jaw frame: displacement of the jaw, m.
#[derive(Debug)]
pub(super) struct Sample {
    pub line: u64,
    pub time_s: f64,
    pub displacement: Pose,
}

impl Sample {
    /// How far a point of the jaw has moved from its place in the closed jaw, m.
    pub(super) fn way(&self, point: &Vec3) -> Vec3 {
        moved(&self.displacement, point)
    }
}

/// How far a displacement moves a point, m.
pub(super) fn moved(displacement: &Pose, point: &Vec3) -> Vec3 {
    displacement.rotation * point + displacement.translation.vector - point
}

/// A problem of a recording, before its path is known.
#[derive(Debug)]
pub(super) struct Located {
    /// The line, from 1; none where the file as a whole is at fault.
    pub line: Option<u64>,
    /// The error and its remedy, for the author of the file.
    pub problem: String,
}

impl Located {
    pub(super) fn at(line: u64, problem: String) -> Self {
        Self { line: Some(line), problem }
    }

    pub(super) fn whole(problem: String) -> Self {
        Self { line: None, problem }
    }

    pub(super) fn in_file(self, path: &std::path::Path) -> TrajectoryError {
        let line = self.line.map_or_else(String::new, |line| format!(":{line}"));
        TrajectoryError(format!("{}{line}: {}", path.display(), self.problem))
    }
}

/// A line of the protocol for rows without a pose.
pub(super) fn gaps(lines: &[u64]) -> Option<String> {
    let (first, last) = (lines.first()?, lines.last()?);
    let rows = masseter_scenario::wording::counted(lines.len() as u64, "row");
    Some(format!("gaps for lost samples: {rows}, lines {first} to {last}"))
}

pub(super) fn is_lost(cell: &str) -> bool {
    LOST.contains(&cell.to_lowercase().replace("e+", "e").as_str())
}
