//! Proof, by interval arithmetic, that inputs have at most one true solution.
//!
//! [`Proof::examine`] takes a box of inputs and encloses every solution in it that meets the
//! conditions ([`SolutionKind`]). If the slopes of the three equations over that enclosure form a regular
//! matrix, then no input in the box has two: with solutions h ≠ h′, the slopes S between them would
//! give S (h − h′) = 0. Otherwise the box stays undecided, and the caller examines its
//! [halves](InputBox::halves).
//!
//! The control loop does not use this module, and the proof does not show that a solution exists. The dimensions of the
//! mechanism count as exact numbers.

mod enclosure;
mod input_box;
mod platforms;
mod proof;

pub use enclosure::Enclosure;
pub use input_box::InputBox;
pub use proof::{Finding, Proof, Reaches, SolutionKind};
