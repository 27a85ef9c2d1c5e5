//! Basins of convergence: which solution of the neutral input each guess of a grid leads to.
//!
//! Guesses vary in θ₁ and θ₂ over all directions above the base; θ₃ is the true solution's.

use std::f64::consts::PI;

use masseter_shared::geometry::{LEGS, Mechanism};
use rayon::prelude::*;

use super::solution_set::SolutionSet;
use super::solver::COMPARED;
use super::table::{Table, number};

/// Where a guess leads.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Basin {
    /// To a class of solutions above the base; 0 is the true one.
    Class(usize),
    /// To a solution with a leg below the base.
    BelowBase,
    /// Nowhere.
    Nothing,
}

/// Where a guess leads, by solver in the order of [`COMPARED`].
#[derive(Debug, Clone, Copy)]
pub(super) struct Cell {
    pub guess_rad: [f64; LEGS],
    pub basins: [Basin; COMPARED.len()],
    pub iterations: [u32; COMPARED.len()],
}

/// A square grid of guesses.
#[derive(Debug, Clone)]
pub(super) struct Basins {
    /// Cells along a side.
    pub side: usize,
    /// Row by row: θ₁ varies fastest.
    pub cells: Vec<Cell>,
    pub class_names: Vec<String>,
}

impl Basins {
    pub(super) fn map(mechanism: &Mechanism, set: &SolutionSet, side: usize) -> Self {
        let third_rad = set.true_one().map_or(PI / 2.0, |truth| truth.theta_rad[2]);
        let middle = |index: usize| (index as f64 + 0.5) / side as f64 * PI;
        let cell = |index: usize| {
            let guess_rad = [middle(index % side), middle(index / side), third_rad];
            let attempts = COMPARED.map(|solver| solver.attempt(mechanism, &set.actuators, &guess_rad));
            let basins = attempts.map(|attempt| match attempt.found_rad {
                Ok(found_rad) => set.class_of(&found_rad).map_or(Basin::BelowBase, Basin::Class),
                Err(_) => Basin::Nothing,
            });
            Cell { guess_rad, basins, iterations: attempts.map(|attempt| attempt.iterations) }
        };
        let cells = (0..side * side).into_par_iter().map(cell).collect();
        Self { side, cells, class_names: set.class_names() }
    }

    pub(super) fn table(&self) -> Table {
        let header = [
            "guess1_deg",
            "guess2_deg",
            "guess3_deg",
            "published_reaches",
            "published_iterations",
            "newton_reaches",
            "newton_iterations",
            "controller_reaches",
            "controller_iterations",
        ];
        let row = |cell: &Cell| {
            let mut row: Vec<_> = cell.guess_rad.iter().map(|angle| number(angle.to_degrees())).collect();
            for (basin, iterations) in cell.basins.iter().zip(cell.iterations) {
                row.extend([self.name(*basin), iterations.to_string()]);
            }
            row
        };
        Table::new("basins", &header, self.cells.iter().map(row).collect())
    }

    /// What a legend and the table call a basin.
    pub(super) fn name(&self, basin: Basin) -> String {
        match basin {
            Basin::Class(class) => self.class_names[class].clone(),
            Basin::BelowBase => "a leg below the base".to_owned(),
            Basin::Nothing => "no solution reached".to_owned(),
        }
    }
}
