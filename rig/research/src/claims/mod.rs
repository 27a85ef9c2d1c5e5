//! The paper's claims, judged by the measurements of a study. The criteria are defined here alone; each is a function of
//! measured values, so that other values give another judgement.

mod claim;
mod convergence;
mod multiplicity;
mod speed;

use super::motions::Motion;
use super::share::Share;
use crate::study::Study;

pub use claim::{ClaimJudgement, PaperClaim};

/// All claims that can be measured, in the paper's order.
pub(super) fn judge(study: &Study) -> Vec<PaperClaim> {
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

fn movement_is_covered(study: &Study) -> PaperClaim {
    let covered = Share::count(study.motions.iter().map(|motion| motion.demands.is_ok()));
    let texts = |motion: &Motion| match &motion.demands {
        Ok(demands) => {
            let margin_m = demands.margin_m(study.mechanism.strokes());
            let least_mm = margin_m.iter().copied().fold(f64::INFINITY, f64::min) * 1e3;
            format!(
                "{}: {least_mm:.1} mm of stroke left, condition at most {:.1}",
                motion.name, motion.condition
            )
        }
        Err(reason) => format!("{}: {reason}", motion.name),
    };
    PaperClaim {
        statement: "The dimensions given cover the range of the human jaw's movement.",
        section: "Method 1",
        measured: study.motions.iter().map(texts).collect::<Vec<_>>().join("; "),
        criterion: "holds if every motion stays within strokes, speeds and conditioning, with openings of 44 and 56 mm (mean \
                    and 95th percentile of adults); partly if any does",
        judgement: ClaimJudgement::new(covered.is_all(), covered.hits > 0),
        figure: Some("workspace_translation"),
    }
}
