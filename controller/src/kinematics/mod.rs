//! Forward kinematics: the platform's pose from slide displacements and leg lengths.
//!
//! The seed's three equations in the leg angles ([`Equations`]), two iterations that solve them
//! from a guess ([`solve`]), the conditions that tell the true solution from the mirrored and folded
//! ones ([`Assembly`]), and what the loop and the command line use: a warm-started
//! [`ForwardTracker`] and [`solve_cold`] for single inputs.
//!
//! Everything is pure, allocates nothing and ends after a fixed number of iterations. It does not
//! judge strokes, and a failure proves nothing: an input may have a solution that no start reached.

mod assembly;
mod cold;
mod equations;
mod error;
mod solver;
mod tracker;

pub use assembly::{Assembly, Condition};
pub use cold::solve_cold;
pub use equations::{Equations, Evaluation};
pub use error::ForwardError;
pub use solver::{MAX_HALVINGS, MAX_ITERATIONS, Method, Options, Solution, solve, solve_newton, solve_seed};
pub use tracker::ForwardTracker;

#[cfg(test)]
mod samples;
