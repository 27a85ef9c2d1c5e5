//! The paper's claims about the number of solutions.

use super::claim::{Judgement, PaperClaim, RARELY};
use crate::multiplicity::{CONDITIONS, Conditions};
use crate::share::Share;
use crate::study::Study;

pub(super) fn two_positions(study: &Study) -> PaperClaim {
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
    PaperClaim {
        statement: "With the slides in the middle, A₁ has two positions for the same A₂ and A₃.",
        section: "Results, on multiplicity; Fig. 6",
        measured,
        criterion: "holds if both are among all solutions of the neutral input",
        judgement: Judgement::new(folded.is_some(), false),
        figure: Some("fig6_assemblies"),
    }
}

pub(super) fn several_solutions(study: &Study) -> PaperClaim {
    let multiple = study.multiplicity.multiple();
    PaperClaim {
        statement: "One input has several sets of leg angles.",
        section: "Results, on multiplicity; Fig. 8",
        measured: format!(
            "the neutral input has {}; of random inputs {} have none, and of the others {} have more than one \
             mirrored pair",
            study.set.solutions.count(),
            study.multiplicity.with_solutions(0).percent(),
            multiple.percent()
        ),
        criterion: "holds if the neutral input has more than one mirrored pair",
        judgement: Judgement::new(study.set.solutions.count() > 2, false),
        figure: Some("fig8_solutions"),
    }
}

pub(super) fn conditions_leave_one(study: &Study) -> PaperClaim {
    let several = CONDITIONS.map(|conditions| study.multiplicity.several_left(conditions));
    let texts = CONDITIONS.iter().zip(several).map(|(conditions, share)| {
        format!("{}: {} ({} of {})", conditions.name(), share.percent(), share.hits, share.of)
    });
    PaperClaim {
        statement: "Two conditions leave exactly one solution, if any.",
        section: "Abstract and Results, on multiplicity",
        measured: format!("several are left — {}", texts.collect::<Vec<_>>().join("; ")),
        criterion: "holds if no random input keeps several with the plane oriented; partly if fewer than 1 % do. \
                    A sample cannot prove it: see masseter uniqueness",
        judgement: unique(several[Conditions::Oriented as usize]),
        figure: None,
    }
}

fn unique(several: Share) -> Judgement {
    Judgement::new(several.of > 0 && several.hits == 0, several.value() < RARELY)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn share(hits: usize) -> Share {
        Share { hits, of: 1000 }
    }

    #[test]
    fn one_exception_refutes_uniqueness_and_an_empty_sample_shows_nothing() {
        assert_eq!(unique(share(0)), Judgement::Holds);
        assert_eq!(unique(share(1)), Judgement::HoldsPartly);
        assert_eq!(unique(share(10)), Judgement::DoesNotHold);
        assert_eq!(unique(Share::default()), Judgement::DoesNotHold);
    }
}
