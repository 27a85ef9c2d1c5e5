//! One step of the proof: the verdict on one box of inputs.
//!
//! Halving and pruning enclose the reaches h of all its solutions:
//! - A part of h-space is removed when a side cannot close in it, or a condition cannot hold.
//! - Krawczyk's operator −Y E(m) + (1 − Y S)(h − m) shrinks a part. It contains every solution, because the
//!   slopes S contain every difference.

use masseter_model::geometry::{LEGS, Mechanism};
use nalgebra::Matrix3;

use super::platforms::{Platforms, Slopes};
use super::{Enclosure, InputBox};
use crate::kinematics::legs::next;

/// Most parts of h-space examined for one box of inputs; the limit bounds the time only.
const MOST_PARTS: usize = 20_000;
/// Parts narrower than this share of the inputs' own width are not halved again.
const FINE_ENOUGH: f64 = 0.5;
/// Nor are parts narrower than this, metres: the slopes decide on the remaining parts.
const FINEST_M: f64 = 5e-4;
/// A shrinking step that leaves more than this share of the width is not repeated.
const WORTH_REPEATING: f64 = 0.8;

/// The kind of solution that must be unique. All solutions are above the base.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum SolutionKind {
    /// Solutions that meet the paper's two conditions, with the platform's plane oriented.
    PaperConditions,
    /// Of these, those whose [determinant](crate::kinematics::Solution::determinant) is at least this.
    DeterminantAtLeast(f64),
}

/// Reaches hᵢ = lᵢ cos θᵢ, metres.
pub type Reaches = [Enclosure; LEGS];

/// The verdict on a box of inputs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Finding {
    /// No input in the box has a solution of this kind.
    NoSolution,
    /// No input in the box has more than one solution of this kind.
    AtMostOne,
    /// Neither is proven. The reaches of all solutions of this kind lie in this box.
    Undecided(Reaches),
}

/// A mechanism and the kind of solution that must be unique.
#[derive(Debug, Clone)]
pub struct Proof {
    mechanism: Mechanism,
    kind: SolutionKind,
}

impl Proof {
    /// The proof for one mechanism and one kind of solution.
    pub fn new(mechanism: &Mechanism, kind: SolutionKind) -> Self {
        Self { mechanism: mechanism.clone(), kind }
    }

    /// All reaches of legs of these lengths: the start of the search.
    pub fn any_reaches(inputs: &InputBox) -> Reaches {
        inputs.leg_m.map(|leg_m| Enclosure::around_zero(leg_m.high()))
    }

    /// Examines a box of inputs; `within` must contain the reaches of all its solutions.
    pub fn examine(&self, inputs: &InputBox, within: &Reaches) -> Finding {
        let Some(parts) = self.parts(inputs, within) else { return Finding::Undecided(*within) };
        let hull = |a: Reaches, b: &Reaches| std::array::from_fn(|leg| a[leg].hull(b[leg]));
        match parts.split_first() {
            None => Finding::NoSolution,
            Some((first, others)) => {
                let all = others.iter().fold(*first, hull);
                if self.is_regular(inputs, &all) { Finding::AtMostOne } else { Finding::Undecided(all) }
            }
        }
    }

    /// Parts of h-space that together contain all solutions; none when there are too many parts.
    fn parts(&self, inputs: &InputBox, within: &Reaches) -> Option<Vec<Reaches>> {
        let widest_m = inputs.axes().iter().fold(0.0, |widest, axis| f64::max(widest, axis.width()));
        let finest_m = FINEST_M.max(FINE_ENOUGH * widest_m);
        let (mut open, mut kept) = (vec![*within], Vec::new());
        let mut looked_at = 0;
        while let Some(part) = open.pop() {
            looked_at += 1;
            if looked_at > MOST_PARTS {
                return None;
            }
            let Some(part) = self.shrunk(inputs, part) else { continue };
            let widest = (0..LEGS).fold(0, |a, b| if part[b].width() > part[a].width() { b } else { a });
            if part[widest].width() <= finest_m {
                kept.push(part);
                continue;
            }
            for half in part[widest].halves() {
                let mut one = part;
                one[widest] = half;
                open.push(one);
            }
        }
        Some(kept)
    }

    /// The portion of a part that may contain solutions; none when no portion does.
    fn shrunk(&self, inputs: &InputBox, part: Reaches) -> Option<Reaches> {
        let mut part = part;
        loop {
            let platforms = Platforms::new(&self.mechanism, inputs, &part)?;
            if !self.may_count(&platforms) {
                return None;
            }
            let smaller = self.contracted(inputs, &platforms, &part)?;
            // Also false for a leg without width, which no step makes narrower.
            let shrinks = |leg: usize| smaller[leg].width() < WORTH_REPEATING * part[leg].width();
            let repeats = (0..LEGS).all(shrinks);
            part = smaller;
            if !repeats {
                return Some(part);
            }
        }
    }

    /// Whether a platform in this enclosure may be a solution of this kind.
    fn may_count(&self, platforms: &Platforms) -> bool {
        let closes = platforms.excess_m2(&self.mechanism).iter().all(|excess| excess.contains(0.0));
        closes && platforms.may_stand_as_assembled(&self.mechanism) && self.may_be_conditioned(platforms)
    }

    fn may_be_conditioned(&self, platforms: &Platforms) -> bool {
        let SolutionKind::DeterminantAtLeast(margin) = self.kind else { return true };
        let slopes = platforms.slopes(&self.mechanism);
        let determinant = slopes.and_then(|slopes| platforms.determinant(&self.mechanism, &slopes));
        determinant.is_none_or(|determinant| determinant.high() >= margin)
    }

    /// Krawczyk's operator: the unchanged part when the operator does not apply, none when no solution is left.
    fn contracted(&self, inputs: &InputBox, platforms: &Platforms, part: &Reaches) -> Option<Reaches> {
        let middle = part.map(|reach_m| Enclosure::point(reach_m.middle()));
        let at_middle = Platforms::new(&self.mechanism, inputs, &middle);
        let preconditioned =
            platforms.slopes(&self.mechanism).and_then(|slopes| Preconditioned::new(&slopes));
        let (Some(at_middle), Some(preconditioned)) = (at_middle, preconditioned) else { return Some(*part) };
        let excess_m2 = at_middle.excess_m2(&self.mechanism);
        let mut smaller = *part;
        for leg in 0..LEGS {
            let mut reach_m = middle[leg];
            for column in 0..LEGS {
                reach_m = reach_m - excess_m2[column] * preconditioned.inverse[(leg, column)];
                reach_m = reach_m + preconditioned.defect[leg][column] * (part[column] - middle[column]);
            }
            smaller[leg] = reach_m.intersection(part[leg])?;
        }
        Some(smaller)
    }

    /// Whether all matrices within the slopes are regular.
    fn is_regular(&self, inputs: &InputBox, all: &Reaches) -> bool {
        let platforms = Platforms::new(&self.mechanism, inputs, all);
        let slopes = platforms.and_then(|platforms| platforms.slopes(&self.mechanism));
        slopes.and_then(|slopes| Preconditioned::new(&slopes)).is_some_and(|matrix| matrix.is_regular())
    }
}

/// The slopes' matrix S, multiplied by an approximate inverse Y of its middle.
struct Preconditioned {
    inverse: Matrix3<f64>,
    /// 1 − Y S.
    defect: [[Enclosure; LEGS]; LEGS],
}

impl Preconditioned {
    fn new(slopes: &Slopes) -> Option<Self> {
        let mut middle = Matrix3::zeros();
        for side in 0..LEGS {
            middle[(side, side)] = slopes.near_m[side].middle();
            middle[(side, next(side))] = slopes.far_m[side].middle();
        }
        let inverse = middle.try_inverse().filter(|inverse| inverse.iter().all(|x| x.is_finite()))?;
        // Column i of S has the near slope of side i and the far slope of the side before.
        let defect = std::array::from_fn(|row| {
            std::array::from_fn(|leg| {
                let before = (leg + LEGS - 1) % LEGS;
                let entry =
                    slopes.near_m[leg] * inverse[(row, leg)] + slopes.far_m[before] * inverse[(row, before)];
                Enclosure::point(f64::from(u8::from(row == leg))) - entry
            })
        });
        Some(Self { inverse, defect })
    }

    /// ‖1 − Y S‖ < 1 for every S leaves none of them singular.
    fn is_regular(&self) -> bool {
        self.defect.iter().all(|row| {
            let sum = row.iter().map(|entry| Enclosure::point(entry.magnitude()));
            sum.reduce(|a, b| a + b).is_some_and(|sum| sum.high() < 1.0)
        })
    }
}

#[cfg(test)]
mod tests {
    use masseter_model::geometry::Actuators;

    use super::*;
    use crate::kinematics::Solutions;
    use crate::kinematics::tests::{AMBIGUOUS, published_mechanism};

    fn around(actuators: &Actuators, radius_m: f64) -> InputBox {
        let around = |value_m: f64| Enclosure::new(value_m - radius_m, value_m + radius_m);
        InputBox { slide_m: actuators.slide_m.map(around), leg_m: actuators.leg_m.map(around) }
    }

    fn examine(kind: SolutionKind, actuators: &Actuators, radius_m: f64) -> Finding {
        let inputs = around(actuators, radius_m);
        Proof::new(&published_mechanism(), kind).examine(&inputs, &Proof::any_reaches(&inputs))
    }

    #[test]
    fn inputs_near_the_neutral_one_have_at_most_one() {
        let neutral = Actuators { slide_m: [0.0; LEGS], leg_m: [0.27; LEGS] };
        assert_eq!(examine(SolutionKind::PaperConditions, &neutral, 1e-3), Finding::AtMostOne);
        let tilted = Actuators { slide_m: [0.005, -0.004, 0.003], leg_m: [0.26, 0.27, 0.275] };
        assert_eq!(examine(SolutionKind::PaperConditions, &tilted, 1e-3), Finding::AtMostOne);
    }

    #[test]
    fn nothing_is_proven_where_two_true_solutions_are_known() {
        let known = Solutions::new(&published_mechanism(), &AMBIGUOUS).unwrap();
        assert_eq!(known.true_ones().count(), 2);
        for kind in [
            SolutionKind::PaperConditions,
            SolutionKind::DeterminantAtLeast(0.0),
            SolutionKind::DeterminantAtLeast(0.04),
        ] {
            for radius_m in [1e-9, 1e-6, 1e-4] {
                let Finding::Undecided(within) = examine(kind, &AMBIGUOUS, radius_m) else {
                    panic!("{kind:?} within {radius_m} m")
                };
                assert!(within[0].width() < 0.1, "the search gave up: {kind:?}, {radius_m} m");
                for one in known.true_ones() {
                    for (leg, reach_m) in within.iter().enumerate() {
                        assert!(reach_m.contains(AMBIGUOUS.leg_m[leg] * one.theta_rad[leg].cos()));
                    }
                }
            }
        }
    }

    /// The search of a single point, and of a segment, ends.
    #[test]
    fn reaches_without_width_are_examined_as_any_other() {
        let known = Solutions::new(&published_mechanism(), &AMBIGUOUS).unwrap();
        let one = known.true_ones().next().unwrap();
        let reach_m: [f64; LEGS] = std::array::from_fn(|leg| AMBIGUOUS.leg_m[leg] * one.theta_rad[leg].cos());
        let inputs = around(&AMBIGUOUS, 1e-6);
        let proof = Proof::new(&published_mechanism(), SolutionKind::PaperConditions);
        let point = reach_m.map(Enclosure::point);
        assert_eq!(proof.examine(&inputs, &point), Finding::AtMostOne);
        let segment = [Enclosure::new(reach_m[0] - 1e-3, reach_m[0] + 1e-3), point[1], point[2]];
        assert_eq!(proof.examine(&inputs, &segment), Finding::AtMostOne);
    }

    #[test]
    fn a_determinant_between_the_two_settles_the_same_input() {
        let known = Solutions::new(&published_mechanism(), &AMBIGUOUS).unwrap();
        let between = known.true_ones().map(|one| one.determinant).sum::<f64>() / 2.0;
        let kind = SolutionKind::DeterminantAtLeast(between);
        assert_eq!(examine(kind, &AMBIGUOUS, 1e-7), Finding::AtMostOne);
    }

    #[test]
    fn what_cannot_be_assembled_has_no_solution() {
        let apart = Actuators { slide_m: [0.0; LEGS], leg_m: [0.30, 0.30, 0.20] };
        assert_eq!(examine(SolutionKind::PaperConditions, &apart, 1e-3), Finding::NoSolution);
    }
}
