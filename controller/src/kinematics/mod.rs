//! Forward kinematics: the platform's pose from slide displacements and leg lengths.
//!
//! The loop and the command line use [`ForwardTracker`]: Newton's iteration from the last solution, a [`Certificate`]
//! for its result, and otherwise [`solve_completely`]. The latter finds every solution ([`Solutions`]) and picks the
//! one with the mechanism's assembly ([`Assembly`]). If there is none, or more than one, the result is an error. The
//! paper's own algorithm and plain Newton–Raphson ([`solve`], on the paper's form of the [`Equations`]) are for
//! comparison.
//!
//! Everything is pure, allocates nothing and ends after a fixed number of iterations. The module checks neither strokes
//! nor speeds nor the dimensions of the mechanism.

mod bernstein;
mod certificate;
mod elimination;
mod equations;
mod legs;
mod loop_equations;
mod solution;
mod solutions;
mod solver;
mod tracker;

pub use certificate::Certificate;
pub use equations::{Equations, Evaluation};
pub use solution::{Assembly, Condition, ForwardError, Solution};
pub use solutions::{MOST_SOLUTIONS, Solutions};
pub use solver::{
    Iteration, MAX_HALVINGS, MAX_ITERATIONS, Method, Options, Residual, StepRule, solve, solve_traced,
};
pub use tracker::{ForwardTracker, solve_completely};

#[cfg(test)]
mod tests;
