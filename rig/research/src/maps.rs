//! Maps: the basins of convergence of the solvers, and the workspace.

use std::f64::consts::PI;

use masseter_controller::kinematics::{Assembly, Solutions};
use masseter_model::geometry::{Conditioning, Jacobian, LEGS, Mechanism, Pose, Vec3};
use nalgebra::{Translation3, UnitQuaternion};
use rayon::prelude::*;

use crate::solutions::SolutionSet;
use crate::solver::{Found, SOLVERS, Start, distance_rad};
use crate::tables::{csv, degrees, number};

/// Basins of convergence: which solution of the neutral input each guess of a square grid leads to, row by row.
///
/// Guesses vary in θ₁, fastest, and θ₂ over all directions above the base; θ₃ is the true solution's. A basin is a class of
/// solutions above the base; or guesses lead to a solution with a leg below the base, or nowhere.
pub(crate) fn basins_table(mechanism: &Mechanism, set: &SolutionSet, side: usize) -> String {
    let names = set.class_names();
    let middle = |index: usize| (index as f64 + 0.5) / side as f64 * PI;
    let cell = |index: usize| {
        let guess_rad = [middle(index % side), middle(index / side), set.true_one.theta_rad[2]];
        let start = Start { actuators: set.actuators, guess_rad };
        SOLVERS.map(|solver| {
            let (reaches, iterations) = match solver.attempt(mechanism, &start) {
                Ok(Found { theta_rad, iterations, .. }) => {
                    let class = set.class_of(&theta_rad);
                    (class.map_or("a leg below the base", |class| names[class].as_str()), iterations)
                }
                Err(_) => ("no solution reached", 0),
            };
            (guess_rad.map(degrees), solver.name, reaches, iterations)
        })
    };
    let cells: Vec<_> = (0..side * side).into_par_iter().map(cell).collect();
    csv("guess1_deg,guess2_deg,guess3_deg,solver,reaches,iterations", cells.into_iter().flatten())
}

const MM: f64 = 1e-3;
const DEGREE: f64 = PI / 180.0;

/// A coordinate that varies in a map.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Coordinate {
    column: &'static str,
    /// Lowest and highest, in its unit.
    range: [f64; 2],
    /// Metres or radians.
    unit: f64,
    /// Its place among x, y, z, roll, pitch, yaw.
    place: usize,
}

const X: Coordinate = coordinate("x_mm", [-40.0, 40.0], MM, 0);
const Y: Coordinate = coordinate("y_mm", [-40.0, 40.0], MM, 1);
const Z: Coordinate = coordinate("z_mm", [230.0, 322.0], MM, 2);
const ROLL: Coordinate = coordinate("roll_deg", [-80.0, 80.0], DEGREE, 3);
const PITCH: Coordinate = coordinate("pitch_deg", [-80.0, 80.0], DEGREE, 4);
const YAW: Coordinate = coordinate("yaw_deg", [-80.0, 80.0], DEGREE, 5);
/// In the order of a pose.
pub(crate) const COORDINATES: [Coordinate; 6] = [X, Y, Z, ROLL, PITCH, YAW];

const fn coordinate(column: &'static str, range: [f64; 2], unit: f64, place: usize) -> Coordinate {
    Coordinate { column, range, unit, place }
}

/// A slice.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Slice {
    /// Of its table.
    pub name: &'static str,
    /// The coordinate across and the one upwards.
    axes: [Coordinate; 2],
}

/// The slices that are drawn.
pub(crate) const SLICES: [Slice; 4] = [
    Slice { name: "workspace_x_z", axes: [X, Z] },
    Slice { name: "workspace_y_z", axes: [Y, Z] },
    Slice { name: "workspace_roll_pitch", axes: [ROLL, PITCH] },
    Slice { name: "workspace_yaw_pitch", axes: [YAW, PITCH] },
];

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

/// One map of the workspace, the slice through a position (metres) with no turn: where the platform can go or how it can turn
/// within the strokes, how well conditioned it is there, how far from a singularity and from the next other solution. Two
/// coordinates vary, the first fastest; the others are those of the neutral pose.
pub(crate) fn workspace_table(mechanism: &Mechanism, slice: Slice, middle: &Vec3, side: usize) -> String {
    let row = |index: usize| {
        let values = slice.values(side, index);
        let quality = quality(mechanism, &slice.pose(middle, values)).unwrap_or([f64::NAN; 4]);
        (values.map(number), quality.map(number))
    };
    let rows: Vec<_> = (0..side * side).into_par_iter().map(row).collect();
    let [across, up] = slice.axes.map(|axis| axis.column);
    csv(&format!("{across},{up},condition,determinant,regular_within_deg,separation_deg"), rows)
}

/// Of a pose that the mechanism can take within the strokes: condition number of the 6×6 Jacobian, turns taken at the
/// platform's side; determinant of the forward kinematics' Jacobian, legs taken as 1; how far the leg angles may change, at
/// least, before it becomes singular, and how far the next other solution of the same input is, degrees.
fn quality(mechanism: &Mechanism, pose: &Pose) -> Option<[f64; 4]> {
    let joints = mechanism.inverse(pose).ok()?;
    mechanism.strokes().check(&joints.actuators).ok()?;
    if !Assembly::new(mechanism, &joints.actuators, &joints.theta_rad).is_true() {
        return None;
    }
    let solutions = Solutions::new(mechanism, &joints.actuators).ok()?;
    let distance = |theta_rad: &[f64; LEGS]| distance_rad(theta_rad, &joints.theta_rad);
    let here = solutions.iter().min_by(|a, b| distance(&a.theta_rad).total_cmp(&distance(&b.theta_rad)))?;
    let regular_rad = here.certificate.map_or(0.0, |proof| proof.regular_within_rad);
    Some([
        Conditioning::new(&Jacobian::new(mechanism, pose, &joints)).number(),
        here.determinant,
        regular_rad.to_degrees(),
        solutions.separation_rad(here).unwrap_or(f64::NAN).to_degrees(),
    ])
}
