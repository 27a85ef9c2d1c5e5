//! Maps: the basins of convergence of the solvers, and the workspace.

use std::f64::consts::PI;

use masseter_controller::kinematics::{Assembly, Solutions};
use masseter_model::geometry::{Conditioning, Jacobian, LEGS, Mechanism, Pose, Vec3};
use nalgebra::{Translation3, UnitQuaternion};
use rayon::prelude::*;

use crate::evidence::{csv, degrees, number};
use crate::solutions::SolutionSet;
use crate::solver::{COMPARED, Start, distance_rad};

/// A guess with its result for each solver of [`COMPARED`].
#[derive(Debug, Clone, Copy)]
pub(crate) struct Cell {
    pub guess_rad: [f64; LEGS],
    /// Places in [`Basins::names`].
    pub basins: [usize; COMPARED.len()],
    pub iterations: [u32; COMPARED.len()],
}

/// Basins of convergence: which solution of the neutral input each guess of a square grid leads to.
///
/// Guesses vary in θ₁ and θ₂ over all directions above the base; θ₃ is the true solution's.
#[derive(Debug, Clone)]
pub(crate) struct Basins {
    /// Cells along a side.
    pub side: usize,
    /// Row by row: θ₁ varies fastest.
    pub cells: Vec<Cell>,
    /// Of the basins: a class of solutions above the base each, the true one's first; then guesses that lead to a
    /// solution with a leg below the base, and those that lead nowhere.
    pub names: Vec<String>,
}

impl Basins {
    pub(crate) fn map(mechanism: &Mechanism, set: &SolutionSet, side: usize) -> Self {
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

    pub(crate) fn table(&self) -> String {
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

const MM: f64 = 1e-3;
const DEGREE: f64 = PI / 180.0;

/// A coordinate that varies in a map.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Coordinate {
    pub label: &'static str,
    column: &'static str,
    /// Lowest and highest, in its unit.
    pub range: [f64; 2],
    /// Metres or radians.
    unit: f64,
    /// Its place among x, y, z, roll, pitch, yaw.
    place: usize,
}

const X: Coordinate = coordinate("x (anterior), mm", "x_mm", [-40.0, 40.0], MM, 0);
const Y: Coordinate = coordinate("y (left), mm", "y_mm", [-40.0, 40.0], MM, 1);
const Z: Coordinate = coordinate("z (up), mm", "z_mm", [230.0, 322.0], MM, 2);
const ROLL: Coordinate = coordinate("roll (about x), °", "roll_deg", [-80.0, 80.0], DEGREE, 3);
const PITCH: Coordinate = coordinate("pitch (about y), °", "pitch_deg", [-80.0, 80.0], DEGREE, 4);
const YAW: Coordinate = coordinate("yaw (about z), °", "yaw_deg", [-80.0, 80.0], DEGREE, 5);

const fn coordinate(
    label: &'static str,
    column: &'static str,
    range: [f64; 2],
    unit: f64,
    place: usize,
) -> Coordinate {
    Coordinate { label, column, range, unit, place }
}

/// A slice.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Slice {
    /// Of its table.
    pub name: &'static str,
    /// The coordinate across and the one upwards.
    pub axes: [Coordinate; 2],
}

/// The slices that are drawn.
pub(crate) const SLICES: [Slice; 4] = [
    Slice { name: "workspace_x_z", axes: [X, Z] },
    Slice { name: "workspace_y_z", axes: [Y, Z] },
    Slice { name: "workspace_roll_pitch", axes: [ROLL, PITCH] },
    Slice { name: "workspace_yaw_pitch", axes: [YAW, PITCH] },
];

/// Quality of a pose that the mechanism can take within the strokes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PoseQuality {
    /// Condition number of the 6×6 Jacobian, turns taken at the platform's side.
    pub condition: f64,
    /// Determinant of the forward kinematics' Jacobian, legs taken as 1.
    pub determinant: f64,
    /// How far the leg angles may change, at least, before the Jacobian becomes singular.
    pub regular_within_deg: f64,
    /// How far the next other solution of the same input is.
    pub separation_deg: f64,
}

/// One map of the workspace: where the platform can go and how it can turn within the strokes, how well conditioned it
/// is there, how far from a singularity and from the next other solution.
///
/// Every map is a slice: two coordinates vary, the others are those of the neutral pose. A jaw motion drawn into it is
/// a projection: it leaves the slice in the other coordinates.
#[derive(Debug, Clone)]
pub(crate) struct Map {
    pub slice: Slice,
    /// Cells along a side.
    pub side: usize,
    /// Row by row, the first axis varies fastest; none where the mechanism cannot be.
    pub poses: Vec<Option<PoseQuality>>,
}

impl Coordinate {
    /// Its value at a pose, in its unit.
    pub(crate) fn at(&self, pose: &Pose) -> f64 {
        let position_m = pose.translation.vector;
        let (roll, pitch, yaw) = pose.rotation.euler_angles();
        [position_m.x, position_m.y, position_m.z, roll, pitch, yaw][self.place] / self.unit
    }
}

impl Slice {
    /// The values of the axes in the middle of a cell.
    fn values(&self, side: usize, index: usize) -> [f64; 2] {
        [(0, index % side), (1, index / side)].map(|(axis, cell)| {
            let [low, high] = self.axes[axis].range;
            low + (high - low) * (cell as f64 + 0.5) / side as f64
        })
    }

    fn pose(&self, middle: &Vec3, values: [f64; 2]) -> Pose {
        let mut coordinates = [middle.x, middle.y, middle.z, 0.0, 0.0, 0.0];
        for (axis, value) in self.axes.iter().zip(values) {
            coordinates[axis.place] = value * axis.unit;
        }
        let [x, y, z, roll, pitch, yaw] = coordinates;
        Pose::from_parts(Translation3::new(x, y, z), UnitQuaternion::from_euler_angles(roll, pitch, yaw))
    }
}

impl Map {
    /// The slice through a position (metres) with no turn.
    pub(crate) fn compute(mechanism: &Mechanism, slice: Slice, middle: &Vec3, side: usize) -> Self {
        let pose = |index| quality(mechanism, &slice.pose(middle, slice.values(side, index)));
        Self { slice, side, poses: (0..side * side).into_par_iter().map(pose).collect() }
    }

    /// Lowest and highest value of each axis at which the mechanism can be; none when it can be nowhere.
    pub(crate) fn reach(&self) -> [Option<(f64, f64)>; 2] {
        [0, 1].map(|axis| {
            let cells = self.poses.iter().enumerate().filter(|(_, quality)| quality.is_some());
            let reached = cells.map(|(index, _)| self.slice.values(self.side, index)[axis]);
            reached.clone().min_by(f64::total_cmp).zip(reached.max_by(f64::total_cmp))
        })
    }

    pub(crate) fn table(&self) -> String {
        let row = |(index, quality): (usize, &Option<PoseQuality>)| {
            let known = quality.map_or([f64::NAN; 4], |quality| {
                [quality.condition, quality.determinant, quality.regular_within_deg, quality.separation_deg]
            });
            (self.slice.values(self.side, index).map(number), known.map(number))
        };
        let [across, up] = self.slice.axes.map(|axis| axis.column);
        let header = format!("{across},{up},condition,determinant,regular_within_deg,separation_deg");
        csv(&header, self.poses.iter().enumerate().map(row))
    }
}

fn quality(mechanism: &Mechanism, pose: &Pose) -> Option<PoseQuality> {
    let joints = mechanism.inverse(pose).ok()?;
    mechanism.strokes().check(&joints.actuators).ok()?;
    if !Assembly::new(mechanism, &joints.actuators, &joints.theta_rad).is_true() {
        return None;
    }
    let solutions = Solutions::new(mechanism, &joints.actuators).ok()?;
    let distance = |theta_rad: &[f64; LEGS]| distance_rad(theta_rad, &joints.theta_rad);
    let here = solutions.iter().min_by(|a, b| distance(&a.theta_rad).total_cmp(&distance(&b.theta_rad)))?;
    let regular_rad = here.certificate.map_or(0.0, |proof| proof.regular_within_rad);
    Some(PoseQuality {
        condition: Conditioning::new(&Jacobian::new(mechanism, pose, &joints)).number(),
        determinant: here.determinant,
        regular_within_deg: regular_rad.to_degrees(),
        separation_deg: solutions.separation_rad(here).unwrap_or(f64::NAN).to_degrees(),
    })
}
