//! What the paper claims of where its solver arrives.

use super::super::Study;
use super::super::contender::{CONTENDERS, Contender, NEWTON, PUBLISHED, SHOWN};
use super::super::sample::Guesses;
use super::super::share::Share;
use super::{ANY, Claim, RARELY, Verdict};

/// Guesses "close to the solution".
const CLOSE: Guesses = Guesses::Within(5.0);

pub(super) fn any_guess_converges(study: &Study) -> Claim {
    let solved = study.trials.solved(PUBLISHED, ANY);
    let best = best_variant(|contender| study.trials.solved(contender, ANY));
    let close = study.trials.solved(PUBLISHED, CLOSE);
    Claim {
        says: "The algorithm converges whatever the initial guess.",
        place: "Korean summary, first advantage (the results section says otherwise)",
        measured: format!(
            "from guesses above the base the paper's solver reached a solution in {}; its best variant ({}) in {}",
            solved.percent(),
            best.0.name(),
            best.1.percent()
        ),
        criterion: "holds if all guesses above the base converge; partly if at least all within ±5° do",
        verdict: Verdict::of(solved.is_all(), close.is_all()),
        figure: Some("success"),
    }
}

pub(super) fn wider_range(study: &Study) -> Claim {
    let solved = |contender| study.trials.solved(contender, ANY);
    let (published, newton) = (solved(PUBLISHED), solved(NEWTON));
    let best = best_variant(solved);
    let true_ones = [PUBLISHED, NEWTON].map(|contender| study.trials.true_ones(contender, ANY).percent());
    let [alone, newton_alone] = study.trials.alone();
    Claim {
        says: "It converges for a wider range of guesses than Newton–Raphson.",
        place: "Abstract and Results, first advantage",
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
        criterion: "holds if the paper's solver as printed arrives more often from above the base, by 3 standard \
                    errors; partly if only a variant of it does",
        verdict: wider(published, newton, best.1),
        figure: Some("success"),
    }
}

pub(super) fn newton_diverges(study: &Study) -> Claim {
    let share = study.pairs.diverging.share;
    Claim {
        says: "Typically both seem to converge at first, then Newton–Raphson diverges and the algorithm does not.",
        place: "Results, first advantage; Fig. 3",
        measured: format!(
            "{} of guesses above the base show this; the opposite, Newton–Raphson arriving where the paper's \
             solver stalls, {}",
            share.percent(),
            study.pairs.stalling.share.percent()
        ),
        criterion: "holds if at least half of the guesses show it; partly if any does",
        verdict: Verdict::of(share.value() >= 0.5, share.hits > 0),
        figure: Some("fig3_diverging"),
    }
}

pub(super) fn newton_oscillates(study: &Study) -> Claim {
    let share = study.pairs.oscillating.share;
    Claim {
        says: "There are guesses from which the algorithm converges while Newton–Raphson oscillates for ever.",
        place: "Results, first advantage; Fig. 4",
        measured: format!("{} of guesses above the base ({} of {})", share.percent(), share.hits, share.of),
        criterion: "holds if any guess shows it: the last 40 errors repeat with a period of 2 to 8 iterations",
        verdict: Verdict::of(share.hits > 0, false),
        figure: Some("fig4_oscillating"),
    }
}

pub(super) fn close_guess_converges(study: &Study) -> Claim {
    let solved = study.trials.solved(PUBLISHED, CLOSE);
    let true_ones = |contender, guesses| study.trials.true_ones(contender, guesses).percent();
    Claim {
        says: "A guess close to the solution always makes it converge.",
        place: "Results, first advantage",
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
        verdict: Verdict::of(solved.is_all(), solved.value() >= 1.0 - RARELY),
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

    /// Claim 10, of the paper's solver.
    fn reaches_the_closest(self) -> Verdict {
        Verdict::of(self.anywhere, self.close)
    }

    /// Claim 11, of Newton–Raphson: the opposite.
    fn cannot_be_predicted(self) -> Verdict {
        Verdict::of(!self.close, !self.anywhere)
    }
}

/// How often the solution reached is the closest: from guesses above the base, and within ±5°.
fn closest(study: &Study, contender: Contender) -> [Share; 2] {
    [ANY, CLOSE].map(|guesses| study.trials.closest(contender, guesses))
}

fn closest_measured(study: &Study) -> String {
    let [[published, published_close], [newton, newton_close]] =
        [PUBLISHED, NEWTON].map(|contender| closest(study, contender).map(Share::percent));
    format!(
        "of the solutions reached from above the base, the closest: the paper's solver {published}, Newton–Raphson \
         {newton}; from within ±5° of the true one: {published_close} and {newton_close}"
    )
}

pub(super) fn closest_solution(study: &Study) -> Claim {
    Claim {
        says: "It reaches the solution closest to the guess.",
        place: "Abstract and Results, third advantage",
        measured: closest_measured(study),
        criterion: "holds if at least 99 % of the solutions that the paper's solver reaches from above the base are the \
                    closest (largest difference of any leg's angle); partly if at least from within ±5°",
        verdict: Predictable::from_shares(closest(study, PUBLISHED)).reaches_the_closest(),
        figure: Some("basins"),
    }
}

pub(super) fn unpredictable_newton(study: &Study) -> Claim {
    Claim {
        says: "Which solution Newton–Raphson reaches cannot be predicted.",
        place: "Abstract and Results, third advantage",
        measured: closest_measured(study),
        criterion: "the criterion of the claim before, turned round: holds if fewer than 99 % of the solutions that \
                    Newton–Raphson reaches from within ±5° are the closest; partly if only from above the base",
        verdict: Predictable::from_shares(closest(study, NEWTON)).cannot_be_predicted(),
        figure: Some("basins"),
    }
}

pub(super) fn always_the_true_one(study: &Study) -> Claim {
    let [anywhere, close] = [ANY, CLOSE].map(|guesses| study.trials.true_ones(PUBLISHED, guesses));
    let controller = study.trials.true_ones(Contender::Controller, ANY);
    Claim {
        says: "In simulation the algorithm always reached the true solution, without exception.",
        place: "Results, on multiplicity; Korean summary",
        measured: format!(
            "the paper's solver {} from above the base, {} from within ±5°; the controller's solver {} and {}",
            anywhere.percent(),
            close.percent(),
            controller.percent(),
            study.trials.true_ones(Contender::Controller, CLOSE).percent()
        ),
        criterion: "holds if every guess above the base leads to the true solution; partly if every one within ±5° does",
        verdict: Verdict::of(anywhere.is_all(), close.is_all()),
        figure: Some("success"),
    }
}

pub(super) fn successive_poses(study: &Study) -> Claim {
    let published =
        SHOWN.iter().position(|&contender| contender == PUBLISHED).expect("the paper's solver is shown");
    let lost: usize = study.motions.iter().map(|motion| motion.followed[published].lost).sum();
    let steps: usize = study.motions.iter().map(|motion| motion.followed[published].steps).sum();
    let chewing = study.motions.first().map_or(f64::NAN, |motion| motion.followed[published].iterations_mean);
    Claim {
        says: "Starting each step from the pose before, the true pose is found all along a movement.",
        place: "Results, last paragraph",
        measured: format!(
            "{lost} of {steps} steps of 1 ms lost over {} motions; {chewing:.1} iterations a step while chewing",
            study.motions.len()
        ),
        criterion: "holds if no step is lost; partly if fewer than 1 % are",
        verdict: Verdict::of(steps > 0 && lost == 0, (lost as f64) < RARELY * steps as f64),
        figure: None,
    }
}

fn wider(published: Share, newton: Share, best_variant: Share) -> Verdict {
    Verdict::of(published.clearly_exceeds(newton), best_variant.clearly_exceeds(newton))
}

/// The paper's variant with the greatest share.
fn best_variant(share: impl Fn(Contender) -> Share) -> (Contender, Share) {
    let variants = CONTENDERS.into_iter().filter(|one| matches!(one, Contender::Published(..)));
    let shares = variants.map(|contender| (contender, share(contender)));
    shares.max_by(|a, b| a.1.value().total_cmp(&b.1.value())).unwrap_or((PUBLISHED, Share::default()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_same_figures_never_fulfil_both_claims_of_one_solver() {
        let share = |hits| Share { hits, of: 1000 };
        for (anywhere, close, reaches, unpredictable) in [
            (995, 999, Verdict::Holds, Verdict::DoesNotHold),
            (300, 999, Verdict::HoldsPartly, Verdict::HoldsPartly),
            (300, 980, Verdict::DoesNotHold, Verdict::Holds),
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
        assert_eq!(wider(share(900), share(600), share(900)), Verdict::Holds);
        assert_eq!(wider(share(605), share(600), share(900)), Verdict::HoldsPartly);
        assert_eq!(wider(share(500), share(600), share(605)), Verdict::DoesNotHold);
    }
}
