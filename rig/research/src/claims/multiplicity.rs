//! The paper's claims about the number of solutions.

use super::claim::{ClaimJudgement, PaperClaim, RARELY};
use crate::multiplicity::{CONDITIONS, ORIENTED};
use crate::share::Share;
use crate::study::Study;

pub(super) fn two_positions(study: &Study) -> PaperClaim {
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

pub(super) fn several_solutions(study: &Study) -> PaperClaim {
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

pub(super) fn conditions_leave_one(study: &Study) -> PaperClaim {
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

#[cfg(test)]
mod tests {
    use super::*;

    fn share(hits: usize) -> Share {
        Share { hits, of: 1000 }
    }

    #[test]
    fn one_exception_refutes_uniqueness_and_an_empty_sample_shows_nothing() {
        assert_eq!(unique(share(0)), ClaimJudgement::Holds);
        assert_eq!(unique(share(1)), ClaimJudgement::HoldsPartly);
        assert_eq!(unique(share(10)), ClaimJudgement::DoesNotHold);
        assert_eq!(unique(Share::default()), ClaimJudgement::DoesNotHold);
    }
}
