//! The paper's claims about convergence.

use super::claim::{ANY, Judgement, PaperClaim, RARELY};
use crate::sample::Guesses;
use crate::share::Share;
use crate::solver::{COMPARED, NEWTON, PUBLISHED, SOLVERS, Solver};
use crate::study::Study;

/// Guesses "close to the solution".
const CLOSE: Guesses = Guesses::Within(5.0);

pub(super) fn any_guess_converges(study: &Study) -> PaperClaim {
    let solved = study.trials.solved(PUBLISHED, ANY);
    let best = best_variant(|solver| study.trials.solved(solver, ANY));
    let close = study.trials.solved(PUBLISHED, CLOSE);
    PaperClaim {
        statement: "The algorithm converges whatever the initial guess.",
        section: "Korean summary, first advantage (the results section says otherwise)",
        measured: format!(
            "from guesses above the base the paper's solver reached a solution in {}; its best variant ({}) in {}",
            solved.percent(),
            best.0.name(),
            best.1.percent()
        ),
        criterion: "holds if all guesses above the base converge; partly if at least all within ±5° do",
        judgement: Judgement::new(solved.is_all(), close.is_all()),
        figure: Some("success"),
    }
}

pub(super) fn wider_range(study: &Study) -> PaperClaim {
    let solved = |solver| study.trials.solved(solver, ANY);
    let (published, newton) = (solved(PUBLISHED), solved(NEWTON));
    let best = best_variant(solved);
    let true_ones = [PUBLISHED, NEWTON].map(|solver| study.trials.true_ones(solver, ANY).percent());
    let [alone, newton_alone] = study.trials.alone();
    PaperClaim {
        statement: "It converges for a wider range of guesses than Newton–Raphson.",
        section: "Abstract and Results, first advantage",
        measured: format!(
            "any solution: published {}, Newton–Raphson {}; the true one: {} and {}; published alone {}, Newton–Raphson \
             alone {}; best variant of the paper ({}) {}",
            published.percent(),
            newton.percent(),
            true_ones[0],
            true_ones[1],
            alone.percent(),
            newton_alone.percent(),
            best.0.name(),
            best.1.percent()
        ),
        criterion: "holds if the paper's solver as printed reaches a solution more often from above the base, by 3 standard \
                    errors; partly if only a variant of it does",
        judgement: wider(published, newton, best.1),
        figure: Some("success"),
    }
}

pub(super) fn newton_diverges(study: &Study) -> PaperClaim {
    let share = study.pairs.diverging.share;
    PaperClaim {
        statement: "Typically both seem to converge at first, then Newton–Raphson diverges and the algorithm does not.",
        section: "Results, first advantage; Fig. 3",
        measured: format!(
            "{} of guesses above the base show this; the opposite, Newton–Raphson reaching a solution where the \
             paper's solver stalls, {}",
            share.percent(),
            study.pairs.stalling.share.percent()
        ),
        criterion: "holds if at least half of the guesses show it; partly if any does",
        judgement: Judgement::new(share.value() >= 0.5, share.hits > 0),
        figure: Some("fig3_diverging"),
    }
}

pub(super) fn newton_oscillates(study: &Study) -> PaperClaim {
    let share = study.pairs.oscillating.share;
    PaperClaim {
        statement: "There are guesses from which the algorithm converges while Newton–Raphson oscillates for ever.",
        section: "Results, first advantage; Fig. 4",
        measured: format!("{} of guesses above the base ({} of {})", share.percent(), share.hits, share.of),
        criterion: "holds if any guess shows it: the last 40 errors repeat with a period of 2 to 8 iterations",
        judgement: Judgement::new(share.hits > 0, false),
        figure: Some("fig4_oscillating"),
    }
}

pub(super) fn close_guess_converges(study: &Study) -> PaperClaim {
    let solved = study.trials.solved(PUBLISHED, CLOSE);
    let true_ones = |solver, guesses| study.trials.true_ones(solver, guesses).percent();
    PaperClaim {
        statement: "A guess close to the solution always makes it converge.",
        section: "Results, first advantage",
        measured: format!(
            "within ±5° of the true angles it reached a solution in {} ({} of {}), the true one in {} \
             (Newton–Raphson {}); within ±2° the true one in {}",
            solved.percent(),
            solved.hits,
            solved.of,
            true_ones(PUBLISHED, CLOSE),
            true_ones(NEWTON, CLOSE),
            true_ones(PUBLISHED, Guesses::Within(2.0))
        ),
        criterion: "holds if all guesses within ±5° converge; partly if 99 % do",
        judgement: Judgement::new(solved.is_all(), solved.value() >= 1.0 - RARELY),
        figure: Some("success"),
    }
}

/// One criterion for claims 10 and 11: the solution is predictable from guesses if 99 % of the solutions reached are the
/// closest ones.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Predictable {
    /// From guesses above the base.
    anywhere: bool,
    /// From guesses within ±5°.
    close: bool,
}

impl Predictable {
    fn from_shares([anywhere, close]: [Share; 2]) -> Self {
        let is_predictable = |closest: Share| closest.of > 0 && closest.value() >= 1.0 - RARELY;
        Self { anywhere: is_predictable(anywhere), close: is_predictable(close) }
    }

    /// PaperClaim 10, of the paper's solver.
    fn reaches_the_closest(self) -> Judgement {
        Judgement::new(self.anywhere, self.close)
    }

    /// PaperClaim 11, of Newton–Raphson: the opposite.
    fn cannot_be_predicted(self) -> Judgement {
        Judgement::new(!self.close, !self.anywhere)
    }
}

/// How often the solution reached is the closest: from guesses above the base, and within ±5°.
fn closest(study: &Study, solver: Solver) -> [Share; 2] {
    [ANY, CLOSE].map(|guesses| study.trials.closest(solver, guesses))
}

fn closest_measured(study: &Study) -> String {
    let [[published, published_close], [newton, newton_close]] =
        [PUBLISHED, NEWTON].map(|solver| closest(study, solver).map(Share::percent));
    format!(
        "of the solutions reached from above the base, the closest: the paper's solver {published}, Newton–Raphson \
         {newton}; from within ±5° of the true one: {published_close} and {newton_close}"
    )
}

pub(super) fn closest_solution(study: &Study) -> PaperClaim {
    PaperClaim {
        statement: "It reaches the solution closest to the guess.",
        section: "Abstract and Results, third advantage",
        measured: closest_measured(study),
        criterion: "holds if at least 99 % of the solutions that the paper's solver reaches from above the base are the \
                    closest (largest difference of any leg's angle); partly if at least from within ±5°",
        judgement: Predictable::from_shares(closest(study, PUBLISHED)).reaches_the_closest(),
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
        judgement: Predictable::from_shares(closest(study, NEWTON)).cannot_be_predicted(),
        figure: Some("basins"),
    }
}

pub(super) fn always_the_true_one(study: &Study) -> PaperClaim {
    let [anywhere, close] = [ANY, CLOSE].map(|guesses| study.trials.true_ones(PUBLISHED, guesses));
    let controller = study.trials.true_ones(Solver::Controller, ANY);
    PaperClaim {
        statement: "In simulation the algorithm always reached the true solution, without exception.",
        section: "Results, on multiplicity; Korean summary",
        measured: format!(
            "the paper's solver {} from above the base, {} from within ±5°; the controller's solver {} and {}",
            anywhere.percent(),
            close.percent(),
            controller.percent(),
            study.trials.true_ones(Solver::Controller, CLOSE).percent()
        ),
        criterion: "holds if every guess above the base leads to the true solution; partly if every one within ±5° does",
        judgement: Judgement::new(anywhere.is_all(), close.is_all()),
        figure: Some("success"),
    }
}

pub(super) fn successive_poses(study: &Study) -> PaperClaim {
    let published =
        COMPARED.iter().position(|&solver| solver == PUBLISHED).expect("the paper's solver is shown");
    let lost: usize = study.motions.iter().map(|motion| motion.followed[published].lost).sum();
    let steps: usize = study.motions.iter().map(|motion| motion.followed[published].steps).sum();
    let chewing = study.motions.first().map_or(f64::NAN, |motion| motion.followed[published].iterations_mean);
    PaperClaim {
        statement: "Starting each step from the pose before, the true pose is found all along a movement.",
        section: "Results, last paragraph",
        measured: format!(
            "{lost} of {steps} steps of 1 ms lost over {} motions; {chewing:.1} iterations a step while chewing",
            study.motions.len()
        ),
        criterion: "holds if no step is lost; partly if fewer than 1 % are",
        judgement: Judgement::new(steps > 0 && lost == 0, (lost as f64) < RARELY * steps as f64),
        figure: None,
    }
}

fn wider(published: Share, newton: Share, best_variant: Share) -> Judgement {
    Judgement::new(published.clearly_exceeds(newton), best_variant.clearly_exceeds(newton))
}

/// The paper's variant with the greatest share.
fn best_variant(share: impl Fn(Solver) -> Share) -> (Solver, Share) {
    let variants = SOLVERS.into_iter().filter(|one| matches!(one, Solver::Published(..)));
    let shares = variants.map(|solver| (solver, share(solver)));
    shares.max_by(|a, b| a.1.value().total_cmp(&b.1.value())).unwrap_or((PUBLISHED, Share::default()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_same_figures_never_fulfil_both_claims_of_one_solver() {
        let share = |hits| Share { hits, of: 1000 };
        for (anywhere, close, reaches, unpredictable) in [
            (995, 999, Judgement::Holds, Judgement::DoesNotHold),
            (300, 999, Judgement::HoldsPartly, Judgement::HoldsPartly),
            (300, 980, Judgement::DoesNotHold, Judgement::Holds),
        ] {
            let predictable = Predictable::from_shares([share(anywhere), share(close)]);
            assert_eq!(predictable.reaches_the_closest(), reaches);
            assert_eq!(predictable.cannot_be_predicted(), unpredictable);
        }
    }

    fn share(hits: usize) -> Share {
        Share { hits, of: 1000 }
    }

    #[test]
    fn a_wider_range_is_one_that_another_sample_would_show_as_well() {
        assert_eq!(wider(share(900), share(600), share(900)), Judgement::Holds);
        assert_eq!(wider(share(605), share(600), share(900)), Judgement::HoldsPartly);
        assert_eq!(wider(share(500), share(600), share(605)), Judgement::DoesNotHold);
    }
}
