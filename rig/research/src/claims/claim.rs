//! A claim of the paper and its judgement.

use crate::sample::Guesses;

/// Guesses anywhere above the base.
pub(super) const ANY: Guesses = Guesses::AboveBase;
/// A rule that fails in a smaller share of cases nearly holds.
pub(super) const RARELY: f64 = 0.01;

/// Whether a claim holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ClaimJudgement {
    /// By its criterion.
    Holds,
    /// By the weaker criterion.
    HoldsPartly,
    /// By neither.
    DoesNotHold,
}

/// A claim of the paper with its judgement.
#[derive(Debug, Clone)]
pub struct PaperClaim {
    /// The claim, paraphrased.
    pub statement: &'static str,
    /// Where the paper makes it.
    pub section: &'static str,
    /// The measurements that decide.
    pub measured: String,
    /// When it holds, and when it holds partly.
    pub criterion: &'static str,
    /// Whether it holds.
    pub judgement: ClaimJudgement,
    /// The figure that shows it.
    pub figure: Option<&'static str>,
}

impl ClaimJudgement {
    /// As the page and the terminal show it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Holds => "holds",
            Self::HoldsPartly => "holds partly",
            Self::DoesNotHold => "does not hold",
        }
    }

    /// Holds by its criterion, or partly by the weaker one.
    #[must_use]
    pub fn new(holds: bool, partly: bool) -> Self {
        match (holds, partly) {
            (true, _) => Self::Holds,
            (false, true) => Self::HoldsPartly,
            (false, false) => Self::DoesNotHold,
        }
    }
}
