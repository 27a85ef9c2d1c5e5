//! How many solutions an input has: all ways to assemble the neutral one (Figs. 6 and 8 of the paper), and those of
//! random inputs with how many of them meet the paper's two conditions.

use anyhow::Context;
use masseter_controller::kinematics::{Assembly, MOST_SOLUTIONS, Solution, Solutions};
use masseter_model::geometry::{AXES, Actuators, LEGS, Mechanism};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;

use crate::tables::{csv, degrees, number};

/// Angles closer than this are one, radians: two legs' as much as two solutions'.
const SAME_RAD: f64 = 1e-6;

/// The experiments that draw; each has streams of its own.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Stream {
    Trials = 1,
    Inputs = 2,
}

/// The generator of one case of an experiment.
pub(crate) fn generator(seed: u64, stream: Stream, case: usize) -> Pcg64Mcg {
    let stream = (stream as u64) << 56;
    Pcg64Mcg::seed_from_u64(seed.rotate_left(32) ^ stream ^ case as u64)
}

/// An input anywhere in the strokes.
pub(crate) fn random_input(mechanism: &Mechanism, random: &mut Pcg64Mcg) -> Actuators {
    let axes: [f64; AXES] = std::array::from_fn(|axis| {
        let [low_m, high_m] = mechanism.strokes().of_axis(axis);
        random.random_range(low_m..=high_m)
    });
    Actuators::from_axes(axes)
}

/// An input with a true solution.
#[derive(Debug, Clone)]
pub(crate) struct SolutionSet {
    pub actuators: Actuators,
    pub solutions: Solutions,
    pub true_one: Solution,
}

impl SolutionSet {
    /// Of the neutral input: slides in the middle, legs half out.
    pub(crate) fn neutral(mechanism: &Mechanism) -> anyhow::Result<Self> {
        let middle_m = |[low_m, high_m]: [f64; 2]| f64::midpoint(low_m, high_m);
        let strokes = mechanism.strokes();
        let actuators =
            Actuators { slide_m: [middle_m(strokes.slide_m); LEGS], leg_m: [middle_m(strokes.leg_m); LEGS] };
        let solutions = Solutions::new(mechanism, &actuators)?;
        let true_one = *solutions.true_ones().next().context("the neutral input has no true solution")?;
        Ok(Self { actuators, solutions, true_one })
    }

    /// Of random inputs, drawn anew until one has exactly one true solution: about every other input in the strokes has.
    pub(crate) fn feasible(mechanism: &Mechanism, mut draw: impl FnMut() -> Actuators) -> Self {
        loop {
            let actuators = draw();
            let Ok(solutions) = Solutions::new(mechanism, &actuators) else { continue };
            let mut true_ones = solutions.true_ones().copied();
            if let (Some(true_one), None) = (true_ones.next(), true_ones.next()) {
                return Self { actuators, solutions, true_one };
            }
        }
    }

    /// Those above the base: the true one first, then by their angles.
    fn above_base(&self) -> Vec<&Solution> {
        let above = |solution: &&Solution| solution.assembly.legs_above_base == [true; LEGS];
        let mut solutions: Vec<_> = self.solutions.iter().filter(above).collect();
        solutions.sort_by_key(|one| (!one.assembly.is_true(), sorted_microdegrees(&one.theta_rad)));
        solutions
    }

    /// The class of leg angles found by a solver: equal but for the order of the legs. 0 is the true
    /// one's, `None` if no solution above the base has these angles.
    pub(crate) fn class_of(&self, theta_rad: &[f64; LEGS]) -> Option<usize> {
        let near = |one: &&&Solution| crate::solver::distance_rad(&one.theta_rad, theta_rad) < SAME_RAD;
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
    pub(crate) fn class_names(&self) -> Vec<String> {
        let name = |(index, class): (usize, &[i64; LEGS])| {
            let angles = class.map(|angle| format!("{:.1}°", angle as f64 / 1e6)).join(", ");
            if index == 0 { format!("true solution ({angles})") } else { format!("({angles})") }
        };
        self.classes().iter().enumerate().map(name).collect()
    }

    pub(crate) fn table(&self, mechanism: &Mechanism) -> String {
        let row = |one: &Solution| {
            let corners = mechanism.corners_from_angles(&self.actuators, &one.theta_rad);
            let corners_m = corners.map(|corner| [corner.x, corner.y, corner.z].map(number));
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
            (one.theta_rad.map(degrees), conditions.map(u8::from), measures, separation, corners_m)
        };
        csv(
            "theta1_deg,theta2_deg,theta3_deg,above_base,hinges_below_platform,corners_in_order,positive_determinant,\
             true,determinant,residual_m,separation_deg,a1_x_m,a1_y_m,a1_z_m,a2_x_m,a2_y_m,a2_z_m,a3_x_m,a3_y_m,a3_z_m",
            self.solutions.iter().map(row),
        )
    }
}

fn sorted_microdegrees(theta_rad: &[f64; LEGS]) -> [i64; LEGS] {
    let mut angles = theta_rad.map(|angle| (angle.to_degrees() * 1e6).round() as i64);
    angles.sort_unstable();
    angles
}

/// Which solutions count.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Conditions {
    pub name: &'static str,
    pub admit: fn(&Assembly) -> bool,
}

/// Every solution, then interpretations of the paper's conditions.
pub(crate) const CONDITIONS: [Conditions; 4] = [
    Conditions { name: "all", admit: |_| true },
    Conditions {
        name: "conditions 1 and 2, either side of the plane",
        admit: |one| {
            let [first, others @ ..] = one.hinges_below_platform;
            stands(*one) && others == [first; LEGS - 1]
        },
    },
    Conditions {
        name: "conditions 1 and 2, plane oriented",
        admit: |one| stands(*one) && one.hinges_below_platform == [true; LEGS],
    },
    Conditions { name: "these and a positive determinant", admit: Assembly::is_true },
];
/// The place of conditions 1 and 2 with the plane oriented.
pub(crate) const ORIENTED: usize = 2;

/// Legs above the base, and A₂ beyond A₃.
fn stands(assembly: Assembly) -> bool {
    assembly.legs_above_base == [true; LEGS] && assembly.corners_in_order
}

/// How many random inputs anywhere in the strokes have how many solutions, by [`CONDITIONS`]. Inputs whose solutions form a
/// continuum but for rounding are left out; random ones do not.
pub(crate) fn multiplicity_table(mechanism: &Mechanism, inputs: usize, seed: u64) -> String {
    let solutions = |case| {
        let actuators = random_input(mechanism, &mut generator(seed, Stream::Inputs, case));
        let all = Solutions::new(mechanism, &actuators).ok()?;
        let count = |admit: fn(&Assembly) -> bool| all.iter().filter(|one| admit(&one.assembly)).count();
        Some(CONDITIONS.map(|conditions| count(conditions.admit)))
    };
    let counts: Vec<_> = (0..inputs).into_par_iter().filter_map(solutions).collect();
    let rows = CONDITIONS.iter().enumerate().flat_map(|(place, conditions)| {
        let counts = counts.iter().map(move |counts| counts[place]);
        (0..=MOST_SOLUTIONS).map(move |solutions| {
            (conditions.name, solutions, counts.clone().filter(|one| *one == solutions).count())
        })
    });
    csv("counted,solutions,inputs", rows)
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
    fn a_case_depends_only_on_its_number() {
        let mechanism = Mechanism::new(&MechanismConfig::default()).unwrap();
        let draw = |case| random_input(&mechanism, &mut generator(7, Stream::Inputs, case));
        assert_eq!(draw(3), draw(3));
        assert_ne!(draw(3), draw(4));
    }
}
