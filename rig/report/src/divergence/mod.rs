//! Two streams of messages side by side: the first message in which they differ, and how each difference grows.
//!
//! `masseter diff` compares two recordings, `masseter replay` a recording with the answers of a controller. Numbers are
//! compared bit by bit. Figures of two runs are compared by [`compare`](crate::compare).

mod compared;
mod comparison;
mod differences;
mod field_growth;
mod lane;
mod measure;
mod motion_clock;
mod recordings;

pub use compared::Compared;
pub use comparison::{Comparison, Side};
pub use differences::Differences;
pub use recordings::recordings;
