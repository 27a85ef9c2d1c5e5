//! Maps of the workspace: where the platform can go and how it can turn within the strokes, how well
//! conditioned it is there, how far from a singularity and from the next other solution.
//!
//! Every map is a slice: two coordinates vary, the others are those of the neutral pose. A jaw motion
//! drawn into it is a projection: it leaves the slice in the other coordinates.

use masseter_controller::kinematics::{Assembly, Solutions};
use masseter_shared::geometry::{LEGS, Mechanism, Pose, Vec3};
use nalgebra::{Translation3, UnitQuaternion};
use rayon::prelude::*;

use super::sample::distance_rad;
use super::table::{Table, number};

/// A coordinate that varies in a map.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Coordinate {
    X,
    Y,
    Z,
    Roll,
    Pitch,
    Yaw,
}

/// A slice.
#[derive(Debug, Clone, Copy)]
pub(super) struct Slice {
    pub across: Coordinate,
    pub up: Coordinate,
}

/// The slices that are drawn.
pub(super) const SLICES: [Slice; 4] = [
    Slice { across: Coordinate::X, up: Coordinate::Z },
    Slice { across: Coordinate::Y, up: Coordinate::Z },
    Slice { across: Coordinate::Roll, up: Coordinate::Pitch },
    Slice { across: Coordinate::Yaw, up: Coordinate::Pitch },
];

/// What is known of a pose within the strokes in which the mechanism stands.
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
    /// Row by row, [`Slice::across`] varies fastest; none where the mechanism cannot be.
    pub poses: Vec<Option<PoseQuality>>,
}

impl Coordinate {
    /// Lowest and highest, mm or degrees.
    pub(super) fn range(self) -> [f64; 2] {
        match self {
            Self::X | Self::Y => [-40.0, 40.0],
            Self::Z => [230.0, 322.0],
            Self::Roll | Self::Pitch | Self::Yaw => [-80.0, 80.0],
        }
    }

    pub(super) fn label(self) -> &'static str {
        match self {
            Self::X => "x (anterior), mm",
            Self::Y => "y (left), mm",
            Self::Z => "z (up), mm",
            Self::Roll => "roll (about x), °",
            Self::Pitch => "pitch (about y), °",
            Self::Yaw => "yaw (about z), °",
        }
    }

    fn column(self) -> &'static str {
        match self {
            Self::X => "x_mm",
            Self::Y => "y_mm",
            Self::Z => "z_mm",
            Self::Roll => "roll_deg",
            Self::Pitch => "pitch_deg",
            Self::Yaw => "yaw_deg",
        }
    }

    /// Its value at a pose, mm or degrees.
    pub(super) fn at(self, pose: &Pose) -> f64 {
        let (roll, pitch, yaw) = pose.rotation.euler_angles();
        match self {
            Self::X => pose.translation.x * 1e3,
            Self::Y => pose.translation.y * 1e3,
            Self::Z => pose.translation.z * 1e3,
            Self::Roll => roll.to_degrees(),
            Self::Pitch => pitch.to_degrees(),
            Self::Yaw => yaw.to_degrees(),
        }
    }
}

impl Slice {
    fn pose(self, middle: &Vec3, across: f64, up: f64) -> Pose {
        let (mut position_m, mut euler_rad) = (*middle, [0.0; 3]);
        for (coordinate, value) in [(self.across, across), (self.up, up)] {
            match coordinate {
                Coordinate::X => position_m.x = value * 1e-3,
                Coordinate::Y => position_m.y = value * 1e-3,
                Coordinate::Z => position_m.z = value * 1e-3,
                Coordinate::Roll => euler_rad[0] = value.to_radians(),
                Coordinate::Pitch => euler_rad[1] = value.to_radians(),
                Coordinate::Yaw => euler_rad[2] = value.to_radians(),
            }
        }
        let [roll, pitch, yaw] = euler_rad;
        Pose::from_parts(Translation3::from(position_m), UnitQuaternion::from_euler_angles(roll, pitch, yaw))
    }

    fn name(self) -> &'static str {
        match (self.across, self.up) {
            (Coordinate::X, _) => "workspace_x_z",
            (Coordinate::Y, _) => "workspace_y_z",
            (Coordinate::Roll, _) => "workspace_roll_pitch",
            _ => "workspace_yaw_pitch",
        }
    }
}

impl Map {
    /// The slice through a position (metres) with no turn.
    pub(super) fn compute(mechanism: &Mechanism, slice: Slice, middle: &Vec3, side: usize) -> Self {
        let poses = (0..side * side).into_par_iter().map(|index| {
            let [across, up] = values(slice, side, index);
            quality(mechanism, &slice.pose(middle, across, up))
        });
        Self { slice, side, poses: poses.collect() }
    }

    /// Lowest and highest value of a coordinate of the slice at which the mechanism can be; none when
    /// it can be nowhere.
    pub(super) fn reach(&self, coordinate: Coordinate) -> Option<[f64; 2]> {
        let which = usize::from(coordinate == self.slice.up);
        let reached = self.poses.iter().enumerate().filter(|(_, quality)| quality.is_some());
        reached.map(|(index, _)| values(self.slice, self.side, index)[which]).fold(None, |range, value| {
            let [low, high]: [f64; 2] = range.unwrap_or([value; 2]);
            Some([low.min(value), high.max(value)])
        })
    }

    pub(super) fn table_name(&self) -> &'static str {
        self.slice.name()
    }

    pub(super) fn table(&self) -> Table {
        let header = [
            self.slice.across.column(),
            self.slice.up.column(),
            "condition",
            "determinant",
            "regular_within_deg",
            "separation_deg",
        ];
        let row = |(index, quality): (usize, &Option<PoseQuality>)| {
            let mut row: Vec<_> = values(self.slice, self.side, index).map(number).into();
            let known = quality.map(|quality| {
                [quality.condition, quality.determinant, quality.regular_within_deg, quality.separation_deg]
            });
            row.extend(known.unwrap_or([f64::NAN; 4]).map(number));
            row
        };
        Table::new(self.table_name(), &header, self.poses.iter().enumerate().map(row).collect())
    }
}

/// The middle of a cell, mm or degrees.
fn values(slice: Slice, side: usize, index: usize) -> [f64; 2] {
    let value = |coordinate: Coordinate, cell: usize| {
        let [low, high] = coordinate.range();
        low + (high - low) * (cell as f64 + 0.5) / side as f64
    };
    [value(slice.across, index % side), value(slice.up, index / side)]
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
        condition: mechanism.condition(pose, &joints),
        determinant: here.determinant,
        regular_within_deg: regular_rad.to_degrees(),
        separation_deg: solutions.separation_rad(here).unwrap_or(f64::NAN).to_degrees(),
    })
}
