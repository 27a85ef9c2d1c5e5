//! The paper's claims, judged by what this run measured. The criteria stand here and nowhere else;
//! each is a function of figures, so that other figures give another verdict.

mod convergence;
mod multiplicity;
mod speed;

use super::Study;
use super::motions::Motion;
use super::sample::Guesses;
use super::share::Share;

/// Any guess at all, as far as a leg can stand.
const ANY: Guesses = Guesses::AboveBase;
/// A rule that fails so rarely nearly holds.
const RARELY: f64 = 0.01;

/// What became of a claim.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Verdict {
    Holds,
    HoldsPartly,
    DoesNotHold,
}

/// A claim with its judgement.
#[derive(Debug, Clone)]
pub(super) struct Claim {
    /// What the paper says, in other words.
    pub says: &'static str,
    /// Where it says so.
    pub place: &'static str,
    pub measured: String,
    /// When it holds, and when partly.
    pub criterion: &'static str,
    pub verdict: Verdict,
    /// The figure to look at.
    pub figure: Option<&'static str>,
}

impl Verdict {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Holds => "holds",
            Self::HoldsPartly => "holds partly",
            Self::DoesNotHold => "does not hold",
        }
    }

    fn of(holds: bool, partly: bool) -> Self {
        match (holds, partly) {
            (true, _) => Self::Holds,
            (false, true) => Self::HoldsPartly,
            (false, false) => Self::DoesNotHold,
        }
    }
}

/// All claims that can be measured, in the paper's order.
pub(super) fn judge(study: &Study) -> Vec<Claim> {
    vec![
        movement_is_covered(study),
        convergence::any_guess_converges(study),
        convergence::wider_range(study),
        convergence::newton_diverges(study),
        convergence::newton_oscillates(study),
        convergence::close_guess_converges(study),
        speed::fewer_iterations(study),
        speed::stated_time(study),
        speed::real_time(study),
        convergence::closest_solution(study),
        convergence::unpredictable_newton(study),
        multiplicity::two_positions(study),
        multiplicity::several_solutions(study),
        multiplicity::conditions_leave_one(study),
        convergence::always_the_true_one(study),
        convergence::successive_poses(study),
    ]
}

fn movement_is_covered(study: &Study) -> Claim {
    let covered = Share::of(study.motions.iter().map(|motion| motion.demands.is_ok()));
    let told = |motion: &Motion| match &motion.demands {
        Ok(demands) => {
            let margin_m = demands.margin_m(study.mechanism.strokes());
            let least_mm = margin_m.iter().copied().fold(f64::INFINITY, f64::min) * 1e3;
            format!(
                "{}: {least_mm:.1} mm of stroke left, condition at most {:.1}",
                motion.name, demands.condition
            )
        }
        Err(reason) => format!("{}: {reason}", motion.name),
    };
    Claim {
        says: "The dimensions given cover the range of the human jaw's movement.",
        place: "Method 1",
        measured: study.motions.iter().map(told).collect::<Vec<_>>().join("; "),
        criterion: "holds if every motion stays within strokes, speeds and conditioning, with openings of 44 and 56 mm (mean \
                    and 95th percentile of adults); partly if any does",
        verdict: Verdict::of(covered.is_all(), covered.hits > 0),
        figure: Some("workspace_translation"),
    }
}
