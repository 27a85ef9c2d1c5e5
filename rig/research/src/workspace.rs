//! Maps of the workspace: where the platform can go and how it can turn within the strokes, how well
//! conditioned it is there, how far from a singularity and from the next other solution.
//!
//! Every map is a slice: two coordinates vary, the others are those of the neutral pose. A jaw motion
//! drawn into it is a projection: it leaves the slice in the other coordinates.

use masseter_controller::kinematics::{Assembly, Solutions};
use masseter_model::geometry::{Conditioning, Jacobian, LEGS, Mechanism, Pose, Vec3};
use nalgebra::{Translation3, UnitQuaternion};
use rayon::prelude::*;

use super::sample::distance_rad;
use super::table::{csv, number};

const MM: f64 = 1e-3;
const DEGREE: f64 = std::f64::consts::PI / 180.0;

/// A coordinate that varies in a map.
#[derive(Debug, Clone, Copy)]
pub(super) struct Coordinate {
    pub label: &'static str,
    column: &'static str,
    /// Lowest and highest, in its unit.
    pub range: [f64; 2],
    /// Metres or radians.
    unit: f64,
    /// Its place among x, y, z, roll, pitch, yaw.
    place: usize,
}

const X: Coordinate =
    Coordinate { label: "x (anterior), mm", column: "x_mm", range: [-40.0, 40.0], unit: MM, place: 0 };
const Y: Coordinate =
    Coordinate { label: "y (left), mm", column: "y_mm", range: [-40.0, 40.0], unit: MM, place: 1 };
const Z: Coordinate =
    Coordinate { label: "z (up), mm", column: "z_mm", range: [230.0, 322.0], unit: MM, place: 2 };
const ROLL: Coordinate = turn("roll (about x), °", "roll_deg", 3);
const PITCH: Coordinate = turn("pitch (about y), °", "pitch_deg", 4);
const YAW: Coordinate = turn("yaw (about z), °", "yaw_deg", 5);

const fn turn(label: &'static str, column: &'static str, place: usize) -> Coordinate {
    Coordinate { label, column, range: [-80.0, 80.0], unit: DEGREE, place }
}

/// A slice.
#[derive(Debug, Clone, Copy)]
pub(super) struct Slice {
    /// Of its table.
    pub name: &'static str,
    /// The coordinate across and the one upwards.
    pub axes: [Coordinate; 2],
}

/// The slices that are drawn.
pub(super) const SLICES: [Slice; 4] = [
    Slice { name: "workspace_x_z", axes: [X, Z] },
    Slice { name: "workspace_y_z", axes: [Y, Z] },
    Slice { name: "workspace_roll_pitch", axes: [ROLL, PITCH] },
    Slice { name: "workspace_yaw_pitch", axes: [YAW, PITCH] },
];

/// Quality of a pose that the mechanism can take within the strokes.
#[derive(Debug, Clone, Copy)]
pub(super) struct PoseQuality {
    /// Condition number of the 6×6 Jacobian, turns taken at the platform's side.
    pub condition: f64,
    /// Determinant of the forward kinematics' Jacobian, legs taken as 1.
    pub determinant: f64,
    /// How far the leg angles may change, at least, before the Jacobian becomes singular.
    pub regular_within_deg: f64,
    /// How far the next other solution of the same input is.
    pub separation_deg: f64,
}

/// One map.
#[derive(Debug, Clone)]
pub(super) struct Map {
    pub slice: Slice,
    /// Cells along a side.
    pub side: usize,
    /// Row by row, the first axis varies fastest; none where the mechanism cannot be.
    pub poses: Vec<Option<PoseQuality>>,
}

impl Coordinate {
    /// Its value at a pose, in its unit.
    pub(super) fn at(&self, pose: &Pose) -> f64 {
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
    pub(super) fn compute(mechanism: &Mechanism, slice: Slice, middle: &Vec3, side: usize) -> Self {
        let poses = (0..side * side)
            .into_par_iter()
            .map(|index| quality(mechanism, &slice.pose(middle, slice.values(side, index))));
        Self { slice, side, poses: poses.collect() }
    }

    /// Lowest and highest value of each axis at which the mechanism can be; none when it can be nowhere.
    pub(super) fn reach(&self) -> [Option<(f64, f64)>; 2] {
        [0, 1].map(|axis| {
            let cells = self.poses.iter().enumerate().filter(|(_, quality)| quality.is_some());
            let reached = cells.map(|(index, _)| self.slice.values(self.side, index)[axis]);
            reached.clone().min_by(f64::total_cmp).zip(reached.max_by(f64::total_cmp))
        })
    }

    pub(super) fn table(&self) -> String {
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
