//! The paper's claims about speed.

use super::claim::{ANY, ClaimJudgement, PaperClaim};
use crate::share::median;
use crate::solver::{Found, PUBLISHED};
use crate::study::Study;

/// The time the paper states for one computation, ns.
const STATED_NS: f64 = 0.1;
/// Share of a real-time cycle of 1 ms for one solution, ns: a tenth.
const REAL_TIME_NS: f64 = 1e5;
/// How many times more iterations are "much more".
const MUCH_MORE: f64 = 2.0;

pub(super) fn fewer_iterations(study: &Study) -> PaperClaim {
    let both = study.trials.against_newton(PUBLISHED, ANY);
    let medians = |what: fn(&Found) -> u32| {
        [0, 1].map(|side| median(both.iter().map(|pair| f64::from(what(&pair[side])))))
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

pub(super) fn stated_time(study: &Study) -> PaperClaim {
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

pub(super) fn real_time(study: &Study) -> PaperClaim {
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
    fn many_more_iterations_are_twice_as_many() {
        assert_eq!(faster([7.0, 14.0]), ClaimJudgement::Holds);
        assert_eq!(faster([7.0, 13.0]), ClaimJudgement::HoldsPartly);
        assert_eq!(faster([7.0, 7.0]), ClaimJudgement::DoesNotHold);
        assert_eq!(faster([f64::NAN, f64::NAN]), ClaimJudgement::DoesNotHold);
    }
}
