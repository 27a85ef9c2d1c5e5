//! The seed's claims, judged by what this run measured. The criteria stand here and nowhere else;
//! each is a function of figures, so that other figures give another verdict.

use super::Study;
use super::contender::{CONTENDERS, Contender, NEWTON, SEED, SHOWN};
use super::motions::Motion;
use super::multiplicity::{READINGS, Reading};
use super::sample::Guesses;
use super::share::{Share, median};
use super::speed::Situation;

/// The time the seed states for one computation, ns.
const STATED_NS: f64 = 0.1;
/// What a real-time cycle of 1 ms can spare for one solution, ns: a tenth.
const REAL_TIME_NS: f64 = 1e5;
/// How many times more iterations are "much more".
const MUCH_MORE: f64 = 2.0;
/// Guesses "close to the solution".
const CLOSE: Guesses = Guesses::Within(5.0);
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
    /// What the seed says, in other words.
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
        criterion: "holds if every motion stays within strokes, speeds and conditioning; partly if any does",
        verdict: Verdict::of(covered.is_all(), covered.hits > 0),
        figure: Some("workspace_translation"),
    }
}

fn any_guess_converges(study: &Study) -> Claim {
    let solved = study.trials.solved(SEED, ANY);
    let best = best_variant(|contender| study.trials.solved(contender, ANY));
    let close = study.trials.solved(SEED, CLOSE);
    Claim {
        says: "The algorithm converges whatever the initial guess.",
        place: "Korean summary, first advantage (the results section says otherwise)",
        measured: format!(
            "from guesses above the base the seed's solver reached a solution in {}; its best variant ({}) in {}",
            solved.percent(),
            best.0.name(),
            best.1.percent()
        ),
        criterion: "holds if all guesses above the base converge; partly if at least all within ±5° do",
        verdict: Verdict::of(solved.is_all(), close.is_all()),
        figure: Some("success"),
    }
}

fn wider_range(study: &Study) -> Claim {
    let solved = |contender| study.trials.solved(contender, ANY);
    let (seed, newton) = (solved(SEED), solved(NEWTON));
    let best = best_variant(solved);
    let true_ones = [SEED, NEWTON].map(|contender| study.trials.true_ones(contender, ANY).percent());
    let [alone, newton_alone] = study.trials.alone();
    Claim {
        says: "It converges for a wider range of guesses than Newton–Raphson.",
        place: "Abstract and Results, first advantage",
        measured: format!(
            "any solution: seed {}, Newton–Raphson {}; the true one: {} and {}; seed alone {}, Newton–Raphson \
             alone {}; best variant of the seed ({}) {}",
            seed.percent(),
            newton.percent(),
            true_ones[0],
            true_ones[1],
            alone.percent(),
            newton_alone.percent(),
            best.0.name(),
            best.1.percent()
        ),
        criterion: "holds if the seed's solver as printed arrives more often from above the base, by 3 standard \
                    errors; partly if only a variant of it does",
        verdict: wider(seed, newton, best.1),
        figure: Some("success"),
    }
}

fn wider(seed: Share, newton: Share, best_variant: Share) -> Verdict {
    Verdict::of(seed.clearly_exceeds(newton), best_variant.clearly_exceeds(newton))
}

fn newton_diverges(study: &Study) -> Claim {
    let share = study.pairs.diverging_share;
    Claim {
        says: "Typically both seem to converge at first, then Newton–Raphson diverges and the algorithm does not.",
        place: "Results, first advantage; Fig. 3",
        measured: format!(
            "{} of guesses above the base show this; the opposite, Newton–Raphson arriving where the seed's \
             solver stalls, {}",
            share.percent(),
            study.pairs.stalling_share.percent()
        ),
        criterion: "holds if at least half of the guesses show it; partly if any does",
        verdict: Verdict::of(share.value() >= 0.5, share.hits > 0),
        figure: Some("fig3_diverging"),
    }
}

fn newton_oscillates(study: &Study) -> Claim {
    let share = study.pairs.oscillating_share;
    Claim {
        says: "There are guesses from which the algorithm converges while Newton–Raphson oscillates for ever.",
        place: "Results, first advantage; Fig. 4",
        measured: format!("{} of guesses above the base ({} of {})", share.percent(), share.hits, share.of),
        criterion: "holds if any guess shows it: the last 40 errors repeat with a period of 2 to 8 iterations",
        verdict: Verdict::of(share.hits > 0, false),
        figure: Some("fig4_oscillating"),
    }
}

fn close_guess_converges(study: &Study) -> Claim {
    let solved = study.trials.solved(SEED, CLOSE);
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
            true_ones(SEED, CLOSE),
            true_ones(NEWTON, CLOSE),
            true_ones(SEED, Guesses::Within(2.0))
        ),
        criterion: "holds if all guesses within ±5° converge; partly if 99 % do",
        verdict: Verdict::of(solved.is_all(), solved.value() >= 1.0 - RARELY),
        figure: Some("success"),
    }
}

fn fewer_iterations(study: &Study) -> Claim {
    let both = study.trials.against_newton(SEED, ANY);
    let of = |side: usize, what: fn(&super::contender::Attempt) -> u32| {
        median(both.iter().map(|pair| f64::from(what(&pair[side]))).collect())
    };
    let iterations = [0, 1].map(|side| of(side, |attempt| attempt.iterations));
    let evaluations = [0, 1].map(|side| of(side, |attempt| attempt.evaluations));
    let time = study.speed.of(Situation::Random, SEED).to_newton;
    Claim {
        says: "It converges much faster: Newton–Raphson needs many more iterations.",
        place: "Results, second advantage; Fig. 5",
        measured: format!(
            "where both arrive from above the base, medians of seed and Newton–Raphson: {} and {} iterations, {} \
             and {} evaluations of the residuals; time of the seed's solver {time:.2} of Newton–Raphson's",
            iterations[0], iterations[1], evaluations[0], evaluations[1]
        ),
        criterion: "holds if Newton–Raphson's median is at least twice the seed's; partly if it is greater",
        verdict: faster(iterations),
        figure: Some("fig5_speed"),
    }
}

fn faster([seed, newton]: [f64; 2]) -> Verdict {
    Verdict::of(newton >= MUCH_MORE * seed, newton > seed)
}

fn stated_time(study: &Study) -> Claim {
    let [seed_ns, newton_ns] =
        [SEED, NEWTON].map(|contender| study.speed.of(Situation::Random, contender).median_ns);
    Claim {
        says: "The computation takes not more than 10⁻¹⁰ s on a Pentium.",
        place: "Results, second advantage",
        measured: format!(
            "median from a random guess: seed {seed_ns:.0} ns, Newton–Raphson {newton_ns:.0} ns on this machine; \
             10⁻¹⁰ s is less than one cycle of any Pentium's clock"
        ),
        criterion: "holds if the median here is not above 10⁻¹⁰ s",
        verdict: Verdict::of(seed_ns <= STATED_NS, false),
        figure: Some("fig5_speed"),
    }
}

fn real_time(study: &Study) -> Claim {
    let [warm, random] = [Situation::Warm, Situation::Random].map(|start| study.speed.of(start, SEED));
    Claim {
        says: "It is fast enough for real-time control.",
        place: "Abstract and Results, second advantage",
        measured: format!(
            "median (99th percentile, which includes what else the machine does): from the solution 1 ms before \
             {:.0} ns ({:.0} ns), from a random guess {:.0} ns ({:.0} ns)",
            warm.median_ns, warm.p99_ns, random.median_ns, random.p99_ns
        ),
        criterion: "holds if both medians are below a tenth of a 1 ms cycle; partly if the warm one is",
        verdict: Verdict::of(
            warm.median_ns.max(random.median_ns) <= REAL_TIME_NS,
            warm.median_ns <= REAL_TIME_NS,
        ),
        figure: Some("fig5_speed"),
    }
}

fn closest_solution(study: &Study) -> Claim {
    let closest = |contender| study.trials.closest(contender, ANY);
    let (seed, newton) = (closest(SEED), closest(NEWTON));
    Claim {
        says: "It reaches the solution closest to the guess.",
        place: "Abstract and Results, third advantage",
        measured: format!(
            "of the solutions reached from above the base, the closest in {} (Newton–Raphson {}); from within \
             ±20° of the true one {}",
            seed.percent(),
            newton.percent(),
            study.trials.closest(SEED, Guesses::Within(20.0)).percent()
        ),
        criterion: "holds if 99 % of the solutions reached are the closest (largest difference of any leg's angle); \
                    partly if clearly more than Newton–Raphson's",
        verdict: Verdict::of(seed.value() >= 1.0 - RARELY, seed.clearly_exceeds(newton)),
        figure: Some("basins"),
    }
}

fn unpredictable_newton(study: &Study) -> Claim {
    let newton = study.trials.closest(NEWTON, ANY);
    let near = study.trials.closest(NEWTON, CLOSE);
    Claim {
        says: "Which solution Newton–Raphson reaches cannot be predicted.",
        place: "Abstract and Results, third advantage",
        measured: format!(
            "it reached the closest in {} from above the base, in {} from within ±5° of the true one",
            newton.percent(),
            near.percent()
        ),
        criterion: "holds if it misses the closest even within ±5°; partly if only from further away",
        verdict: Verdict::of(near.value() < 1.0 - RARELY, newton.value() < 1.0 - RARELY),
        figure: Some("basins"),
    }
}

fn two_positions(study: &Study) -> Claim {
    let folded = study.set.corner_folded();
    let measured = match (study.set.true_one(), folded) {
        (Some(truth), Some(folded)) => format!(
            "θ₁ = {:.2}° and {:.2}° with θ₂ = θ₃ = {:.2}° in both",
            truth.theta_rad[0].to_degrees(),
            folded.theta_rad[0].to_degrees(),
            truth.theta_rad[1].to_degrees()
        ),
        _ => "no second solution with the same θ₂ and θ₃".to_owned(),
    };
    Claim {
        says: "With the slides in the middle, A₁ has two positions for the same A₂ and A₃.",
        place: "Results, on multiplicity; Fig. 6",
        measured,
        criterion: "holds if both are among all solutions of the neutral input",
        verdict: Verdict::of(folded.is_some(), false),
        figure: Some("fig6_assemblies"),
    }
}

fn several_solutions(study: &Study) -> Claim {
    let multiple = study.multiplicity.multiple();
    Claim {
        says: "One input has several sets of leg angles.",
        place: "Results, on multiplicity; Fig. 8",
        measured: format!(
            "the neutral input has {}; of random inputs {} have none, and of the others {} have more than one \
             mirrored pair",
            study.set.solutions.count(),
            study.multiplicity.with_solutions(0).percent(),
            multiple.percent()
        ),
        criterion: "holds if the neutral input has more than one mirrored pair",
        verdict: Verdict::of(study.set.solutions.count() > 2, false),
        figure: Some("fig8_solutions"),
    }
}

fn conditions_leave_one(study: &Study) -> Claim {
    let several = READINGS.map(|reading| study.multiplicity.several_left(reading));
    let told = READINGS.iter().zip(several).map(|(reading, share)| {
        format!("{}: {} ({} of {})", reading.name(), share.percent(), share.hits, share.of)
    });
    Claim {
        says: "Two conditions leave exactly one solution, if any.",
        place: "Abstract and Results, on multiplicity",
        measured: format!("several are left — {}", told.collect::<Vec<_>>().join("; ")),
        criterion: "holds if no random input keeps several under the oriented reading; partly if fewer than 1 % do. \
                    No sample can prove it: see masseter uniqueness",
        verdict: unique(several[Reading::Oriented as usize]),
        figure: None,
    }
}

fn unique(several: Share) -> Verdict {
    Verdict::of(several.of > 0 && several.hits == 0, several.value() < RARELY)
}

fn always_the_true_one(study: &Study) -> Claim {
    let [anywhere, close] = [ANY, CLOSE].map(|guesses| study.trials.true_ones(SEED, guesses));
    let controller = study.trials.true_ones(Contender::Controller, ANY);
    Claim {
        says: "In simulation the algorithm always reached the true solution, without exception.",
        place: "Results, on multiplicity; Korean summary",
        measured: format!(
            "the seed's solver {} from above the base, {} from within ±5°; the controller's solver {} and {}",
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

fn successive_poses(study: &Study) -> Claim {
    let seed = SHOWN.iter().position(|&contender| contender == SEED).unwrap_or_default();
    let lost: usize = study.motions.iter().map(|motion| motion.followed[seed].lost).sum();
    let steps: usize = study.motions.iter().map(|motion| motion.followed[seed].steps).sum();
    let chewing = study.motions.first().map_or(f64::NAN, |motion| motion.followed[seed].iterations_mean);
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

/// The seed's variant with the greatest share.
fn best_variant(share: impl Fn(Contender) -> Share) -> (Contender, Share) {
    let variants = CONTENDERS.into_iter().filter(|one| matches!(one, Contender::Seed(..)));
    let shares = variants.map(|contender| (contender, share(contender)));
    shares.max_by(|a, b| a.1.value().total_cmp(&b.1.value())).unwrap_or((SEED, Share::default()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn share(hits: usize) -> Share {
        Share { hits, of: 1000 }
    }

    #[test]
    fn a_wider_range_is_one_that_another_sample_would_show_as_well() {
        assert_eq!(wider(share(900), share(600), share(900)), Verdict::Holds);
        assert_eq!(wider(share(605), share(600), share(900)), Verdict::HoldsPartly);
        assert_eq!(wider(share(500), share(600), share(605)), Verdict::DoesNotHold);
    }

    #[test]
    fn many_more_iterations_are_twice_as_many() {
        assert_eq!(faster([7.0, 14.0]), Verdict::Holds);
        assert_eq!(faster([7.0, 13.0]), Verdict::HoldsPartly);
        assert_eq!(faster([7.0, 7.0]), Verdict::DoesNotHold);
        assert_eq!(faster([f64::NAN, f64::NAN]), Verdict::DoesNotHold);
    }

    #[test]
    fn one_exception_refutes_uniqueness_and_an_empty_sample_shows_nothing() {
        assert_eq!(unique(share(0)), Verdict::Holds);
        assert_eq!(unique(share(1)), Verdict::HoldsPartly);
        assert_eq!(unique(share(10)), Verdict::DoesNotHold);
        assert_eq!(unique(Share::default()), Verdict::DoesNotHold);
    }
}
