//! What the paper claims of the number of solutions.

use super::super::Study;
use super::super::multiplicity::{READINGS, Reading};
use super::super::share::Share;
use super::{Claim, RARELY, Verdict};

pub(super) fn two_positions(study: &Study) -> Claim {
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

pub(super) fn several_solutions(study: &Study) -> Claim {
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

pub(super) fn conditions_leave_one(study: &Study) -> Claim {
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

#[cfg(test)]
mod tests {
    use super::*;

    fn share(hits: usize) -> Share {
        Share { hits, of: 1000 }
    }

    #[test]
    fn one_exception_refutes_uniqueness_and_an_empty_sample_shows_nothing() {
        assert_eq!(unique(share(0)), Verdict::Holds);
        assert_eq!(unique(share(1)), Verdict::HoldsPartly);
        assert_eq!(unique(share(10)), Verdict::DoesNotHold);
        assert_eq!(unique(Share::default()), Verdict::DoesNotHold);
    }
}
