//! Basins of convergence: which solution of the neutral input each guess of a grid leads to.
//!
//! Guesses vary in θ₁ and θ₂ over all directions above the base; θ₃ is the true solution's.

use std::f64::consts::PI;

use masseter_model::geometry::{LEGS, Mechanism};
use rayon::prelude::*;

use super::solution_set::SolutionSet;
use super::solver::{COMPARED, Start};
use super::table::{csv, degrees};

/// A guess with its result for each solver of [`COMPARED`].
#[derive(Debug, Clone, Copy)]
pub(super) struct Cell {
    pub guess_rad: [f64; LEGS],
    /// Places in [`Basins::names`].
    pub basins: [usize; COMPARED.len()],
    pub iterations: [u32; COMPARED.len()],
}

/// A square grid of guesses.
#[derive(Debug, Clone)]
pub(super) struct Basins {
    /// Cells along a side.
    pub side: usize,
    /// Row by row: θ₁ varies fastest.
    pub cells: Vec<Cell>,
    /// Of the basins: a class of solutions above the base each, the true one's first; then guesses that lead to a
    /// solution with a leg below the base, and those that lead nowhere.
    pub names: Vec<String>,
}

impl Basins {
    pub(super) fn map(mechanism: &Mechanism, set: &SolutionSet, side: usize) -> Self {
        let mut names = set.class_names();
        let [below_base, nowhere] = [names.len(), names.len() + 1];
        names.extend(["a leg below the base", "no solution reached"].map(str::to_owned));
        let middle = |index: usize| (index as f64 + 0.5) / side as f64 * PI;
        let cell = |index: usize| {
            let guess_rad = [middle(index % side), middle(index / side), set.true_one.theta_rad[2]];
            let start = Start { actuators: set.actuators, guess_rad };
            let found = COMPARED.map(|solver| solver.attempt(mechanism, &start));
            let basins = found.map(|found| match found {
                Ok(found) => set.class_of(&found.theta_rad).unwrap_or(below_base),
                Err(_) => nowhere,
            });
            Cell { guess_rad, basins, iterations: found.map(|found| found.map_or(0, |one| one.iterations)) }
        };
        Self { side, cells: (0..side * side).into_par_iter().map(cell).collect(), names }
    }

    pub(super) fn table(&self) -> String {
        let row = |cell: &Cell| {
            let results = [0, 1, 2].map(|solver| (&self.names[cell.basins[solver]], cell.iterations[solver]));
            (cell.guess_rad.map(degrees), results)
        };
        csv(
            "guess1_deg,guess2_deg,guess3_deg,published_reaches,published_iterations,newton_reaches,\
             newton_iterations,controller_reaches,controller_iterations",
            self.cells.iter().map(row),
        )
    }
}
