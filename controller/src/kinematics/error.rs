//! Why the forward kinematics gives no pose.

use masseter_model::geometry::AXIS_NAMES;

use super::Condition;

/// An input without a true solution, as far as the solver could find.
#[doc(alias = "direct kinematics")]
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum ForwardError {
    /// An actuator or the guess is no finite number.
    #[error("an actuator coordinate or the guess is not a finite number; check the input")]
    NotFinite,
    /// The iteration reached its bound.
    #[error(
        "no convergence: after {iterations} iterations a side of the platform is still off by \
         {residual_m:e} m; start closer to the solution, or check that the mechanism can be assembled"
    )]
    NoConvergence {
        /// The largest |fₖ| at the end, metres.
        residual_m: f64,
        /// Iterations made.
        iterations: u32,
    },
    /// No halving of the increment decreases the error: a local minimum.
    #[error(
        "stalled in a local minimum after {iterations} iterations: a side of the platform is off by \
         {residual_m:e} m; start closer to the solution, or check that the mechanism can be assembled"
    )]
    Stalled {
        /// The largest |fₖ| at the minimum, metres.
        residual_m: f64,
        /// Iterations made.
        iterations: u32,
    },
    /// The Jacobian has no inverse at the iteration's end, or rounding does not separate the solution from another.
    #[error(
        "singular: the Jacobian's determinant is {determinant:e} with a side of the platform off by \
         {residual_m:e} m; start elsewhere or keep away from this input"
    )]
    Singular {
        /// Determinant with every leg's length taken as 1.
        determinant: f64,
        /// The largest |fₖ| there, metres.
        residual_m: f64,
    },
    /// A solution of the equations at which the mechanism cannot stand.
    #[error(
        "solved, but not as the mechanism is assembled: {violated}; check the six inputs and the scenario's [mechanism]"
    )]
    WrongAssembly {
        /// The first condition that does not hold.
        violated: Condition,
    },
    /// A leg's length is zero or negative.
    #[error("leg {} is {leg_m:e} m long, so its angle is undefined; check the input {}", leg + 1, AXIS_NAMES[3 + leg])]
    NoLength {
        /// Index of the leg, from 0.
        leg: usize,
        /// Its length.
        leg_m: f64,
    },
    /// No leg angles close the platform's triangle: there are no real solutions.
    #[error("the mechanism cannot be assembled, whatever the leg angles; check the six inputs")]
    Unassemblable,
    /// More than one solution fulfils every condition of the true one.
    #[error(
        "ambiguous: {count} solutions stand as the mechanism is assembled, {separation_rad} rad apart; \
         approach this input from a known pose"
    )]
    Ambiguous {
        /// How many.
        count: usize,
        /// The distance of the nearest two, the largest difference of any leg, radians.
        separation_rad: f64,
    },
    /// More solutions than the equations have: they form a continuum but for rounding.
    #[error("undecided: the solutions cannot be separated, only {solutions} were; keep away from this input")]
    Undecided {
        /// Solutions that were separated.
        solutions: usize,
    },
}

impl ForwardError {
    /// One word for a status column.
    pub fn reason(&self) -> &'static str {
        match self {
            Self::NotFinite => "not_finite",
            Self::NoConvergence { .. } => "no_convergence",
            Self::Stalled { .. } => "stalled",
            Self::Singular { .. } => "singular",
            Self::WrongAssembly { .. } => "wrong_assembly",
            Self::NoLength { .. } => "no_length",
            Self::Unassemblable => "unassemblable",
            Self::Ambiguous { .. } => "ambiguous",
            Self::Undecided { .. } => "undecided",
        }
    }

    /// What a side of the platform is off by where the iteration ended, metres; none where no
    /// iteration ended short of a solution.
    pub fn residual_m(&self) -> Option<f64> {
        match *self {
            Self::NoConvergence { residual_m, .. }
            | Self::Stalled { residual_m, .. }
            | Self::Singular { residual_m, .. } => Some(residual_m),
            _ => None,
        }
    }
}
