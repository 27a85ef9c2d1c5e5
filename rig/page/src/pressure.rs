//! The force on each lower tooth.

use serde::Serialize;

use crate::points::Points;

/// The lower teeth, with the greatest force of all.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Pressure {
    /// In any order.
    pub teeth: Vec<Tooth>,
    /// The greatest force on a tooth, N.
    pub most_n: f64,
    /// When all teeth together bear most, s since the first SYNC. The page shows this moment first.
    pub at_s: f64,
}

/// A tooth.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Tooth {
    /// FDI number.
    pub number: u32,
    /// Where its force acts, seen from above: to the right of the picture, which is the jaw's right side, mm.
    pub across_mm: f64,
    /// The same forward, mm.
    pub forward_mm: f64,
    /// The force by time, N.
    pub points: Points,
}
