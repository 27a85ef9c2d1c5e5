//! The rows of a recording as coordinates, as they were recorded.

use masseter_model::geometry::Vec3;
use nalgebra::Vector6;

/// The rows of a recording: translation of the incisal point (m) from the closed pose, and rotation vector (rad) from the
/// first row's orientation.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rows<'a> {
    pub time_s: &'a [f64],
    pub lines: &'a [u64],
    pub coordinates: &'a [Vector6<f64>],
    /// The first row's turn from the closed pose, rad.
    pub first_turn_rad: f64,
}

impl Rows<'_> {
    /// Where the incisal point is in a row, m.
    pub(super) fn place_m(&self, row: usize) -> Vec3 {
        self.coordinates[row].fixed_rows::<3>(0).into_owned()
    }

    /// Its turn from the first row, rad.
    pub(super) fn turn_rad(&self, row: usize) -> f64 {
        self.coordinates[row].fixed_rows::<3>(3).norm()
    }

    /// Its way from the first row, m.
    pub(super) fn way_m(&self, row: usize) -> f64 {
        (self.place_m(row) - self.place_m(0)).norm()
    }

    /// The row furthest from the first.
    pub(super) fn farthest(&self) -> usize {
        (0..self.lines.len()).max_by(|&a, &b| self.way_m(a).total_cmp(&self.way_m(b))).unwrap_or_default()
    }
}
