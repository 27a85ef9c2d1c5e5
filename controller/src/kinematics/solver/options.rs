//! What the paper's text leaves open, as options.

/// No options allow more iterations than this.
pub const MAX_ITERATIONS: u32 = 100;
/// No options allow more reductions of one increment than this.
pub const MAX_HALVINGS: u32 = 40;

/// How to iterate, and when to end.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// ε: solved when the error (eq. 2) is not above it, cm². The error in this test is always that of
    /// the distances, whatever [`residual`](Self::residual) the iteration goes by.
    pub epsilon_cm2: f64,
    /// What the iteration drives to zero.
    pub residual: Residual,
    /// How the paper's algorithm reduces an increment; Newton–Raphson reduces none.
    pub step: StepRule,
    /// Iterations allowed; at most [`MAX_ITERATIONS`].
    pub max_iterations: u32,
    /// Reductions of one increment allowed; at most [`MAX_HALVINGS`].
    pub max_halvings: u32,
}

impl Default for Options {
    /// The tolerance, 10⁻¹⁴ m for each side, lies a few hundred roundings above what double precision
    /// reaches at these sizes.
    fn default() -> Self {
        Self {
            epsilon_cm2: 1e-24,
            residual: Residual::default(),
            step: StepRule::default(),
            max_iterations: 20,
            max_halvings: 12,
        }
    }
}

/// Which iteration.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Method {
    /// The paper's algorithm: Newton's direction, the increment reduced until the error decreases.
    #[default]
    Published,
    /// Newton–Raphson with the full increment.
    Newton,
}

/// Which form of the equations gives the increment and must decrease.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Residual {
    /// |AᵢAⱼ| − Lᵢⱼ, metres: eq. 1 as printed.
    #[default]
    Distance,
    /// |AᵢAⱼ|² − Lᵢⱼ², m²: the same zeros, smooth where two corners meet.
    SquaredDistance,
}

/// What "the increment is reduced" (Fig. 2) means.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum StepRule {
    /// Halved until the error is smaller than before; every iteration begins with the full increment.
    #[default]
    Halving,
    /// The same, but the next iteration begins with twice the accepted share of its increment.
    CautiousHalving,
    /// The line search of Numerical Recipes: a sufficient decrease, found through the parabola of
    /// value, slope and last attempt, cut to between a tenth and a half.
    QuadraticBacktracking,
}
