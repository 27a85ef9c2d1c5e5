//! Figs. 6 and 8 of the paper: all ways to assemble the neutral input.

use anyhow::Context;
use masseter_controller::kinematics::{Solution, Solutions};
use masseter_model::geometry::{Actuators, LEGS, Mechanism};

use super::sample::distance_rad;
use super::table::{csv, degrees, number};

/// Angles closer than this are one, radians: two legs' as much as two solutions'.
const SAME_RAD: f64 = 1e-6;

/// Slides in the middle, legs half out.
#[derive(Debug, Clone)]
pub(super) struct SolutionSet {
    pub actuators: Actuators,
    pub solutions: Solutions,
    pub true_one: Solution,
}

impl SolutionSet {
    /// Of the neutral input.
    pub(super) fn neutral(mechanism: &Mechanism) -> anyhow::Result<Self> {
        let middle_m = |[low_m, high_m]: [f64; 2]| f64::midpoint(low_m, high_m);
        let strokes = mechanism.strokes();
        let actuators =
            Actuators { slide_m: [middle_m(strokes.slide_m); LEGS], leg_m: [middle_m(strokes.leg_m); LEGS] };
        let solutions = Solutions::new(mechanism, &actuators)?;
        let true_one = *solutions.true_ones().next().context("the neutral input has no true solution")?;
        Ok(Self { actuators, solutions, true_one })
    }

    /// Those above the base: the true one first, then by their angles.
    pub(super) fn above_base(&self) -> Vec<&Solution> {
        let above = |solution: &&Solution| solution.assembly.legs_above_base == [true; LEGS];
        let mut solutions: Vec<_> = self.solutions.iter().filter(above).collect();
        solutions.sort_by_key(|one| (!one.assembly.is_true(), sorted_microdegrees(&one.theta_rad)));
        solutions
    }

    /// Fig. 6: the solution that differs from the true one in corner A₁ alone.
    pub(super) fn corner_folded(&self) -> Option<&Solution> {
        let truth = self.true_one.theta_rad;
        let others_stand = |one: &&Solution| {
            let same = |leg: usize| (one.theta_rad[leg] - truth[leg]).abs() < SAME_RAD;
            same(1) && same(2) && !same(0)
        };
        self.solutions.iter().find(others_stand)
    }

    /// The class of leg angles found by a solver: equal but for the order of the legs. 0 is the true
    /// one's, none where no solution above the base has these angles.
    pub(super) fn class_of(&self, theta_rad: &[f64; LEGS]) -> Option<usize> {
        let near = |one: &&&Solution| distance_rad(&one.theta_rad, theta_rad) < SAME_RAD;
        let above = self.above_base();
        let found = above.iter().find(near)?;
        self.classes().iter().position(|class| *class == sorted_microdegrees(&found.theta_rad))
    }

    /// Each class's leg angles in order of size, µ°; the true one's first.
    fn classes(&self) -> Vec<[i64; LEGS]> {
        let mut classes: Vec<_> =
            self.above_base().iter().map(|one| sorted_microdegrees(&one.theta_rad)).collect();
        classes.dedup();
        classes
    }

    /// The names of the classes in a legend.
    pub(super) fn class_names(&self) -> Vec<String> {
        let name = |(index, class): (usize, &[i64; LEGS])| {
            let angles = class.map(|angle| format!("{:.1}°", angle as f64 / 1e6)).join(", ");
            if index == 0 { format!("true solution ({angles})") } else { format!("({angles})") }
        };
        self.classes().iter().enumerate().map(name).collect()
    }

    pub(super) fn table(&self) -> String {
        let row = |one: &Solution| {
            let assembly = &one.assembly;
            let conditions = [
                assembly.legs_above_base == [true; LEGS],
                assembly.hinges_below_platform == [true; LEGS],
                assembly.corners_in_order,
                assembly.positive_determinant,
                assembly.is_true(),
            ];
            let separation = self.solutions.separation_rad(one).map(degrees);
            let measures = [one.determinant, one.residual_m].map(number);
            (one.theta_rad.map(degrees), conditions.map(u8::from), measures, separation)
        };
        csv(
            "theta1_deg,theta2_deg,theta3_deg,above_base,hinges_below_platform,corners_in_order,positive_determinant,\
             true,determinant,residual_m,separation_deg",
            self.solutions.iter().map(row),
        )
    }
}

fn sorted_microdegrees(theta_rad: &[f64; LEGS]) -> [i64; LEGS] {
    let mut angles = theta_rad.map(|angle| (angle.to_degrees() * 1e6).round() as i64);
    angles.sort_unstable();
    angles
}

#[cfg(test)]
mod tests {
    use masseter_model::geometry::MechanismConfig;

    use super::*;

    fn set() -> SolutionSet {
        SolutionSet::neutral(&Mechanism::new(&MechanismConfig::default()).unwrap()).unwrap()
    }

    #[test]
    fn the_neutral_input_has_eight_solutions_above_the_base_in_four_classes() {
        let set = set();
        assert_eq!((set.solutions.count(), set.above_base().len()), (16, 8));
        assert_eq!(set.classes().len(), 4);
        assert_eq!(set.class_of(&set.true_one.theta_rad), Some(0));
        assert_eq!(set.class_of(&[-1.0; LEGS]), None);
    }

    #[test]
    fn the_folded_corner_is_the_one_of_the_paper() {
        let set = set();
        let folded = set.corner_folded().unwrap();
        assert!((folded.theta_rad[0].to_degrees() - 66.04).abs() < 0.01);
        assert!(folded.assembly.legs_above_base == [true; LEGS] && !folded.assembly.is_true());
    }
}
