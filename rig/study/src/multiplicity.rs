//! How many solutions random inputs have, and how many of them the paper's two conditions leave.

use masseter_controller::kinematics::{MOST_SOLUTIONS, Solution, Solutions};
use masseter_shared::geometry::{LEGS, Mechanism};
use rayon::prelude::*;

use super::sample::{self, Stream};
use super::share::Share;
use super::table::Table;

/// The readings of the paper's conditions.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Conditions {
    /// All hinges on one side of the platform's plane, whichever, and A₂ beyond A₃; legs above the base.
    Unsigned,
    /// All hinges below the oriented plane.
    Oriented,
    /// That, and a positive determinant of the Jacobian.
    Determinant,
}

pub(super) const CONDITIONS: [Conditions; 3] =
    [Conditions::Unsigned, Conditions::Oriented, Conditions::Determinant];

/// What one input has.
#[derive(Debug, Clone, Copy)]
struct Counts {
    solutions: usize,
    /// In the order of [`CONDITIONS`].
    left: [usize; CONDITIONS.len()],
}

/// Counts over random inputs anywhere in the strokes.
#[derive(Debug, Clone)]
pub(super) struct Multiplicity {
    inputs: Vec<Counts>,
}

impl Conditions {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Unsigned => "conditions 1 and 2, either side of the plane",
            Self::Oriented => "conditions 1 and 2, plane oriented",
            Self::Determinant => "these and a positive determinant",
        }
    }

    fn admits(self, solution: &Solution) -> bool {
        let assembly = &solution.assembly;
        let below = assembly.hinges_below_platform;
        let stands = assembly.legs_above_base == [true; LEGS] && assembly.corners_in_order;
        stands
            && match self {
                Self::Unsigned => below == [true; LEGS] || below == [false; LEGS],
                Self::Oriented => below == [true; LEGS],
                Self::Determinant => below == [true; LEGS] && assembly.positive_determinant,
            }
    }
}

impl Multiplicity {
    /// Inputs whose solutions form a continuum but for rounding are left out; random ones do not.
    pub(super) fn count(mechanism: &Mechanism, inputs: usize, seed: u64) -> Self {
        let counts = |case| {
            let actuators = sample::input(mechanism, &mut sample::generator(seed, Stream::Inputs, case));
            let solutions = Solutions::new(mechanism, &actuators).ok()?;
            let left =
                CONDITIONS.map(|conditions| solutions.iter().filter(|one| conditions.admits(one)).count());
            Some(Counts { solutions: solutions.count(), left })
        };
        Self { inputs: (0..inputs).into_par_iter().filter_map(counts).collect() }
    }

    /// How many inputs have so many solutions.
    pub(super) fn with_solutions(&self, solutions: usize) -> Share {
        Share::count(self.inputs.iter().map(|input| input.solutions == solutions))
    }

    /// Of the inputs that can be assembled: how many have more than one mirrored pair.
    pub(super) fn multiple(&self) -> Share {
        let assemblable = self.inputs.iter().filter(|input| input.solutions > 0);
        Share::count(assemblable.map(|input| input.solutions > 2))
    }

    /// Of the inputs to which a conditions leaves any solution: to how many it leaves several.
    pub(super) fn several_left(&self, conditions: Conditions) -> Share {
        let left = self.inputs.iter().map(|input| input.left[conditions as usize]);
        Share::count(left.filter(|&left| left > 0).map(|left| left > 1))
    }

    /// `left` is `all` for the number of solutions itself.
    pub(super) fn table(&self) -> Table {
        let mut rows = Vec::new();
        let mut add = |name: &str, of: &dyn Fn(&Counts) -> usize| {
            for number in 0..=MOST_SOLUTIONS {
                let inputs = self.inputs.iter().filter(|input| of(input) == number).count();
                rows.push(vec![name.to_owned(), number.to_string(), inputs.to_string()]);
            }
        };
        add("all", &|input| input.solutions);
        for conditions in CONDITIONS {
            add(conditions.name(), &|input| input.left[conditions as usize]);
        }
        Table::new("multiplicity", &["counted", "solutions", "inputs"], rows)
    }
}
