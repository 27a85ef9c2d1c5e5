//! Proof, by interval arithmetic, that inputs have at most one true solution.
//!
//! [`Proof::examine`] takes a box of inputs and encloses every solution in it that meets the
//! conditions ([`Claim`]). If the slopes of the three equations over that enclosure form a regular
//! matrix, then no input in the box has two: with solutions h ≠ h′, the slopes S between them would
//! give S (h − h′) = 0. Otherwise the box stays undecided, and [`InputBox::halves`] is the way on.
//!
//! Offline work: nothing here is used by the control loop, and nothing here shows that a solution
//! exists. The mechanism is taken as its numbers stand in memory.

mod enclosure;
mod input_box;
mod platforms;
mod proof;

pub use enclosure::Enclosure;
pub use input_box::InputBox;
pub use proof::{Claim, Finding, Proof, Reaches};
