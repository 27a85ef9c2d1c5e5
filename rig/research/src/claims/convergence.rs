//! The paper's claims about convergence.

use super::claim::{ANY, ClaimJudgement, PaperClaim, RARELY};
use crate::sample::Guesses;
use crate::share::Share;
use crate::solver::{CONTROLLER, NEWTON, PUBLISHED, SOLVERS, Solver};
use crate::study::Study;

/// Guesses "close to the solution".
const CLOSE: Guesses = Guesses::Within(5.0);

pub(super) fn any_guess_converges(study: &Study) -> PaperClaim {
    let solved = study.trials.solved(PUBLISHED, ANY);
    let (variant, best) = best_variant(study);
    PaperClaim {
        statement: "The algorithm converges whatever the initial guess.",
        section: "Korean summary, first advantage (the results section says otherwise)",
        measured: format!(
            "from guesses above the base the paper's solver reached a solution in {solved}; its best variant \
             ({variant}) in {best}"
        ),
        criterion: "holds if all guesses above the base converge; partly if at least all within ±5° do",
        judgement: ClaimJudgement::new(solved.is_all(), study.trials.solved(PUBLISHED, CLOSE).is_all()),
        figure: Some("success"),
    }
}

pub(super) fn wider_range(study: &Study) -> PaperClaim {
    let [published, newton] = [PUBLISHED, NEWTON].map(|solver| study.trials.solved(solver, ANY));
    let [published_true, newton_true] = [PUBLISHED, NEWTON].map(|solver| study.trials.true_ones(solver, ANY));
    let [published_alone, newton_alone] = study.trials.alone();
    let (variant, best) = best_variant(study);
    PaperClaim {
        statement: "It converges for a wider range of guesses than Newton–Raphson.",
        section: "Abstract and Results, first advantage",
        measured: format!(
            "any solution: published {published}, Newton–Raphson {newton}; the true one: {published_true} and \
             {newton_true}; published alone {published_alone}, Newton–Raphson alone {newton_alone}; best variant of \
             the paper ({variant}) {best}"
        ),
        criterion: "holds if the paper's solver as printed reaches a solution more often from above the base, by 3 standard \
                    errors; partly if only a variant of it does",
        judgement: wider(published, newton, best),
        figure: Some("success"),
    }
}

pub(super) fn newton_diverges(study: &Study) -> PaperClaim {
    let [diverging, _, stalling] = study.pairs.each_ref().map(|disagreement| disagreement.share);
    PaperClaim {
        statement: "Typically both seem to converge at first, then Newton–Raphson diverges and the algorithm does not.",
        section: "Results, first advantage; Fig. 3",
        measured: format!(
            "{diverging} of guesses above the base show this; the opposite, Newton–Raphson reaching a solution where \
             the paper's solver stalls, {stalling}"
        ),
        criterion: "holds if at least half of the guesses show it; partly if any does",
        judgement: ClaimJudgement::new(diverging.value() >= 0.5, diverging.hits > 0),
        figure: Some("fig3_diverging"),
    }
}

pub(super) fn newton_oscillates(study: &Study) -> PaperClaim {
    let share = study.pairs[1].share;
    PaperClaim {
        statement: "There are guesses from which the algorithm converges while Newton–Raphson oscillates for ever.",
        section: "Results, first advantage; Fig. 4",
        measured: format!("{share} of guesses above the base ({} of {})", share.hits, share.of),
        criterion: "holds if any guess shows it: the last 40 errors repeat with a period of 2 to 8 iterations",
        judgement: ClaimJudgement::new(share.hits > 0, false),
        figure: Some("fig4_oscillating"),
    }
}

pub(super) fn close_guess_converges(study: &Study) -> PaperClaim {
    let solved = study.trials.solved(PUBLISHED, CLOSE);
    let [true_ones, newton] = [PUBLISHED, NEWTON].map(|solver| study.trials.true_ones(solver, CLOSE));
    let closer = study.trials.true_ones(PUBLISHED, Guesses::Within(2.0));
    PaperClaim {
        statement: "A guess close to the solution always makes it converge.",
        section: "Results, first advantage",
        measured: format!(
            "within ±5° of the true angles it reached a solution in {solved} ({} of {}), the true one in {true_ones} \
             (Newton–Raphson {newton}); within ±2° the true one in {closer}",
            solved.hits, solved.of
        ),
        criterion: "holds if all guesses within ±5° converge; partly if 99 % do",
        judgement: ClaimJudgement::new(solved.is_all(), solved.value() >= 1.0 - RARELY),
        figure: Some("success"),
    }
}

/// How often the solution reached is the closest: from guesses above the base, and within ±5°.
fn closest(study: &Study, solver: Solver) -> [Share; 2] {
    [ANY, CLOSE].map(|guesses| study.trials.closest(solver, guesses))
}

fn closest_measured(study: &Study) -> String {
    let [[published, published_close], [newton, newton_close]] =
        [PUBLISHED, NEWTON].map(|solver| closest(study, solver));
    format!(
        "of the solutions reached from above the base, the closest: the paper's solver {published}, Newton–Raphson \
         {newton}; from within ±5° of the true one: {published_close} and {newton_close}"
    )
}

/// One criterion for the two claims that follow: 99 % of the solutions reached are the closest ones.
fn is_predictable(closest: Share) -> bool {
    closest.of > 0 && closest.value() >= 1.0 - RARELY
}

fn reaches_the_closest([anywhere, close]: [Share; 2]) -> ClaimJudgement {
    ClaimJudgement::new(is_predictable(anywhere), is_predictable(close))
}

fn cannot_be_predicted([anywhere, close]: [Share; 2]) -> ClaimJudgement {
    ClaimJudgement::new(!is_predictable(close), !is_predictable(anywhere))
}

pub(super) fn closest_solution(study: &Study) -> PaperClaim {
    PaperClaim {
        statement: "It reaches the solution closest to the guess.",
        section: "Abstract and Results, third advantage",
        measured: closest_measured(study),
        criterion: "holds if at least 99 % of the solutions that the paper's solver reaches from above the base are the \
                    closest (largest difference of any leg's angle); partly if at least from within ±5°",
        judgement: reaches_the_closest(closest(study, PUBLISHED)),
        figure: Some("basins"),
    }
}

pub(super) fn unpredictable_newton(study: &Study) -> PaperClaim {
    PaperClaim {
        statement: "Which solution Newton–Raphson reaches cannot be predicted.",
        section: "Abstract and Results, third advantage",
        measured: closest_measured(study),
        criterion: "the criterion of the claim before, turned round: holds if fewer than 99 % of the solutions that \
                    Newton–Raphson reaches from within ±5° are the closest; partly if only from above the base",
        judgement: cannot_be_predicted(closest(study, NEWTON)),
        figure: Some("basins"),
    }
}

pub(super) fn always_the_true_one(study: &Study) -> PaperClaim {
    let [[anywhere, close], [controller, controller_close]] = [PUBLISHED, CONTROLLER]
        .map(|solver| [ANY, CLOSE].map(|guesses| study.trials.true_ones(solver, guesses)));
    PaperClaim {
        statement: "In simulation the algorithm always reached the true solution, without exception.",
        section: "Results, on multiplicity; Korean summary",
        measured: format!(
            "the paper's solver {anywhere} from above the base, {close} from within ±5°; the controller's solver \
             {controller} and {controller_close}"
        ),
        criterion: "holds if every guess above the base leads to the true solution; partly if every one within ±5° does",
        judgement: ClaimJudgement::new(anywhere.is_all(), close.is_all()),
        figure: Some("success"),
    }
}

pub(super) fn successive_poses(study: &Study) -> PaperClaim {
    let followed: Vec<_> = study.motions.iter().map(|motion| motion.followed[0]).collect();
    let lost: usize = followed.iter().map(|followed| followed.lost).sum();
    let steps: usize = followed.iter().map(|followed| followed.steps).sum();
    PaperClaim {
        statement: "Starting each step from the pose before, the true pose is found all along a movement.",
        section: "Results, last paragraph",
        measured: format!(
            "{lost} of {steps} steps of 1 ms lost over {} motions; {:.1} iterations a step while chewing",
            followed.len(),
            followed[0].iterations_mean
        ),
        criterion: "holds if no step is lost; partly if fewer than 1 % are",
        judgement: ClaimJudgement::new(steps > 0 && lost == 0, (lost as f64) < RARELY * steps as f64),
        figure: None,
    }
}

fn wider(published: Share, newton: Share, best_variant: Share) -> ClaimJudgement {
    ClaimJudgement::new(published.clearly_exceeds(newton), best_variant.clearly_exceeds(newton))
}

/// The paper's variant that most often reaches a solution from above the base, and how often it does.
fn best_variant(study: &Study) -> (&'static str, Share) {
    let variants = SOLVERS.into_iter().filter(|solver| solver.is_published());
    let shares = variants.map(|solver| (solver.name, study.trials.solved(solver, ANY)));
    shares.max_by(|a, b| a.1.value().total_cmp(&b.1.value())).expect("the paper has variants")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_same_figures_never_fulfil_both_claims_of_one_solver() {
        for (anywhere, close, reaches, unpredictable) in [
            (995, 999, ClaimJudgement::Holds, ClaimJudgement::DoesNotHold),
            (300, 999, ClaimJudgement::HoldsPartly, ClaimJudgement::HoldsPartly),
            (300, 980, ClaimJudgement::DoesNotHold, ClaimJudgement::Holds),
        ] {
            let closest = [anywhere, close].map(share);
            assert_eq!(reaches_the_closest(closest), reaches);
            assert_eq!(cannot_be_predicted(closest), unpredictable);
        }
    }

    fn share(hits: usize) -> Share {
        Share { hits, of: 1000 }
    }

    #[test]
    fn a_wider_range_is_one_that_another_sample_would_show_as_well() {
        assert_eq!(wider(share(900), share(600), share(900)), ClaimJudgement::Holds);
        assert_eq!(wider(share(605), share(600), share(900)), ClaimJudgement::HoldsPartly);
        assert_eq!(wider(share(500), share(600), share(605)), ClaimJudgement::DoesNotHold);
    }
}
