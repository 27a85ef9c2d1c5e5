//! The paper's claims, judged by the measurements of a study. The criteria are defined here alone; each is a function
//! of measured values, so that other values give another judgement.

use crate::evidence::{ClaimJudgement, PaperClaim, Share, quantile};
use crate::motions::Motion;
use crate::solutions::{CONDITIONS, ORIENTED};
use crate::solver::{CONTROLLER, Found, NEWTON, PUBLISHED, SOLVERS, Solver};
use crate::study::Study;
use crate::trials::Guesses;

/// Guesses anywhere above the base.
const ANY: Guesses = Guesses::AboveBase;
/// Guesses "close to the solution".
const CLOSE: Guesses = Guesses::Within(5.0);
/// A rule that fails in a smaller share of cases nearly holds.
const RARELY: f64 = 0.01;
/// The time the paper states for one computation, ns.
const STATED_NS: f64 = 0.1;
/// Share of a real-time cycle of 1 ms for one solution, ns: a tenth.
const REAL_TIME_NS: f64 = 1e5;
/// How many times more iterations are "much more".
const MUCH_MORE: f64 = 2.0;

/// All claims that can be measured, in the paper's order.
pub(crate) fn judged_claims(study: &Study) -> Vec<PaperClaim> {
    vec![
        movement_is_covered(study),
        any_guess_converges(study),
        wider_range(study),
        newton_diverges(study),
        newton_oscillates(study),
        close_guess_converges(study),
        fewer_iterations(study),
        stated_time(study),
        real_time(study),
        closest_solution(study),
        unpredictable_newton(study),
        two_positions(study),
        several_solutions(study),
        conditions_leave_one(study),
        always_the_true_one(study),
        successive_poses(study),
    ]
}

fn movement_is_covered(study: &Study) -> PaperClaim {
    let covered = Share::count(study.motions.iter().map(|motion| motion.demands.is_ok()));
    let texts = |motion: &Motion| match &motion.demands {
        Ok(demands) => {
            let margin_m = demands.margin_m(study.mechanism.strokes());
            let least_mm = margin_m.iter().copied().fold(f64::INFINITY, f64::min) * 1e3;
            let Motion { name, condition, .. } = motion;
            format!("{name}: {least_mm:.1} mm of stroke left, condition at most {condition:.1}")
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

fn any_guess_converges(study: &Study) -> PaperClaim {
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

fn wider_range(study: &Study) -> PaperClaim {
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

fn newton_diverges(study: &Study) -> PaperClaim {
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

fn newton_oscillates(study: &Study) -> PaperClaim {
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

fn close_guess_converges(study: &Study) -> PaperClaim {
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

fn closest_solution(study: &Study) -> PaperClaim {
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

fn unpredictable_newton(study: &Study) -> PaperClaim {
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

fn always_the_true_one(study: &Study) -> PaperClaim {
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

fn successive_poses(study: &Study) -> PaperClaim {
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

fn two_positions(study: &Study) -> PaperClaim {
    let folded = study.set.corner_folded();
    let [theta1, theta2, _] = study.set.true_one.theta_rad.map(f64::to_degrees);
    let measured = folded.map_or("no second solution with the same θ₂ and θ₃".to_owned(), |folded| {
        let folded1 = folded.theta_rad[0].to_degrees();
        format!("θ₁ = {theta1:.2}° and {folded1:.2}° with θ₂ = θ₃ = {theta2:.2}° in both")
    });
    PaperClaim {
        statement: "With the slides in the middle, A₁ has two positions for the same A₂ and A₃.",
        section: "Results, on multiplicity; Fig. 6",
        measured,
        criterion: "holds if both are among all solutions of the neutral input",
        judgement: ClaimJudgement::new(folded.is_some(), false),
        figure: Some("fig6_assemblies"),
    }
}

fn several_solutions(study: &Study) -> PaperClaim {
    let solutions = study.set.solutions.count();
    let [none, multiple] = [study.multiplicity.with_solutions(0), study.multiplicity.with_more_than(2, 0)];
    PaperClaim {
        statement: "One input has several sets of leg angles.",
        section: "Results, on multiplicity; Fig. 8",
        measured: format!(
            "the neutral input has {solutions}; of random inputs {none} have none, and of the others {multiple} have \
             more than one mirrored pair"
        ),
        criterion: "holds if the neutral input has more than one mirrored pair",
        judgement: ClaimJudgement::new(solutions > 2, false),
        figure: Some("fig8_solutions"),
    }
}

fn conditions_leave_one(study: &Study) -> PaperClaim {
    let several = |conditions| study.multiplicity.with_more_than(1, conditions);
    let texts = (1..CONDITIONS.len()).map(|conditions| {
        let share = several(conditions);
        format!("{}: {share} ({} of {})", CONDITIONS[conditions].name, share.hits, share.of)
    });
    PaperClaim {
        statement: "Two conditions leave exactly one solution, if any.",
        section: "Abstract and Results, on multiplicity",
        measured: format!("several are left — {}", texts.collect::<Vec<_>>().join("; ")),
        criterion: "holds if no random input keeps several with the plane oriented; partly if fewer than 1 % do. \
                    A sample cannot prove it: see masseter-research uniqueness",
        judgement: unique(several(ORIENTED)),
        figure: None,
    }
}

fn unique(several: Share) -> ClaimJudgement {
    ClaimJudgement::new(several.of > 0 && several.hits == 0, several.value() < RARELY)
}

fn fewer_iterations(study: &Study) -> PaperClaim {
    let both = study.trials.against_newton(PUBLISHED, ANY);
    let medians = |what: fn(&Found) -> u32| {
        [0, 1].map(|side| quantile(both.iter().map(|pair| f64::from(what(&pair[side]))), 0.5))
    };
    let iterations = medians(|found| found.iterations);
    let evaluations = medians(|found| found.evaluations);
    let [published, ..] = study.speed[0].timings;
    PaperClaim {
        statement: "It converges much faster: Newton–Raphson needs many more iterations.",
        section: "Results, second advantage; Fig. 5",
        measured: format!(
            "where both reach a solution from above the base, medians of the paper's solver and Newton–Raphson: {} and {} iterations, {} \
             and {} evaluations of the residuals; time of the paper's solver {:.2} of Newton–Raphson's",
            iterations[0], iterations[1], evaluations[0], evaluations[1], published.to_newton
        ),
        criterion: "holds if Newton–Raphson's median is at least twice the paper's; partly if it is greater",
        judgement: faster(iterations),
        figure: Some("fig5_speed"),
    }
}

fn stated_time(study: &Study) -> PaperClaim {
    let [published_ns, newton_ns, _] = study.speed[0].timings.map(|timing| timing.median_ns);
    PaperClaim {
        statement: "The computation takes not more than 10⁻¹⁰ s on a Pentium.",
        section: "Results, second advantage",
        measured: format!(
            "median from a random guess: the paper's solver {published_ns:.0} ns, Newton–Raphson {newton_ns:.0} ns on this machine; \
             10⁻¹⁰ s is less than one cycle of any Pentium's clock"
        ),
        criterion: "holds if the median here is not above 10⁻¹⁰ s",
        judgement: ClaimJudgement::new(published_ns <= STATED_NS, false),
        figure: Some("fig5_speed"),
    }
}

fn real_time(study: &Study) -> PaperClaim {
    let [random, warm] = study.speed.each_ref().map(|situation| situation.timings[0]);
    PaperClaim {
        statement: "It is fast enough for real-time control.",
        section: "Abstract and Results, second advantage",
        measured: format!(
            "median (99th percentile, which includes what else the machine does): from the solution 1 ms before \
             {:.0} ns ({:.0} ns), from a random guess {:.0} ns ({:.0} ns)",
            warm.median_ns, warm.p99_ns, random.median_ns, random.p99_ns
        ),
        criterion: "holds if both medians are below a tenth of a 1 ms cycle; partly if the warm one is",
        judgement: ClaimJudgement::new(
            warm.median_ns.max(random.median_ns) <= REAL_TIME_NS,
            warm.median_ns <= REAL_TIME_NS,
        ),
        figure: Some("fig5_speed"),
    }
}

fn faster([published, newton]: [f64; 2]) -> ClaimJudgement {
    ClaimJudgement::new(newton >= MUCH_MORE * published, newton > published)
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

    #[test]
    fn one_exception_refutes_uniqueness_and_an_empty_sample_shows_nothing() {
        assert_eq!(unique(share(0)), ClaimJudgement::Holds);
        assert_eq!(unique(share(1)), ClaimJudgement::HoldsPartly);
        assert_eq!(unique(share(10)), ClaimJudgement::DoesNotHold);
        assert_eq!(unique(Share::default()), ClaimJudgement::DoesNotHold);
    }

    #[test]
    fn many_more_iterations_are_twice_as_many() {
        assert_eq!(faster([7.0, 14.0]), ClaimJudgement::Holds);
        assert_eq!(faster([7.0, 13.0]), ClaimJudgement::HoldsPartly);
        assert_eq!(faster([7.0, 7.0]), ClaimJudgement::DoesNotHold);
        assert_eq!(faster([f64::NAN, f64::NAN]), ClaimJudgement::DoesNotHold);
    }
}
