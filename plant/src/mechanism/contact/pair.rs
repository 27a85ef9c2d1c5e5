//! A lower tooth and its antagonist: where they are, and how they move towards and along each other.

use masseter_model::geometry::{Pose, Twist, Vec3};
use masseter_scenario::ToothConfig;
use nalgebra::{Matrix3x6, Point3};

/// The pair.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pair {
    /// FDI number of the lower tooth.
    pub(super) number: u8,
    /// The lower tooth in the platform frame, m.
    pub(super) lower_m: Vec3,
    /// Its antagonist in the base frame, m: where the lower tooth is in the closed mouth.
    upper_m: Vec3,
    /// From the lower tooth to its antagonist, base frame; of length 1.
    normal: Vec3,
}

/// The motion of a pair over a step. Forces are held over the step, so that they are those of its end: where the speed leads.
#[derive(Debug, Clone, Copy)]
pub(super) struct Touch {
    /// From the platform's origin to the lower tooth, base axes, m.
    pub(super) arm: Vec3,
    /// The lower tooth in the base frame now, m.
    pub(super) place_m: Vec3,
    /// From the lower tooth to its antagonist.
    pub(super) normal: Vec3,
    /// Distance along the normal at the step's end, m; negative where the teeth would overlap.
    pub(super) gap_m: f64,
    /// Speed at which the distance shrinks, m/s.
    pub(super) closing_m_s: f64,
    /// Way along the face in the step, m.
    pub(super) slide_m: Vec3,
    /// Duration of the step, s.
    pub(super) step_s: f64,
}

impl Pair {
    /// A tooth and its antagonist in a mouth that is closed in that pose of the platform.
    pub(super) fn new(tooth: &ToothConfig, closed: &Pose) -> Self {
        Self {
            number: tooth.number,
            lower_m: Vec3::from(tooth.point_m),
            upper_m: (closed * Point3::from(tooth.point_m)).coords,
            normal: closed.rotation * Vec3::from(tooth.normal).normalize(),
        }
    }

    /// How the pair moves at a pose and twist of the platform.
    pub(super) fn touch(&self, pose: &Pose, twist: &Twist, step_s: f64) -> Touch {
        let (linear, angular): (Vec3, Vec3) =
            (twist.fixed_rows::<3>(0).into(), twist.fixed_rows::<3>(3).into());
        let arm = pose.rotation * self.lower_m;
        let (place_m, speed) = (pose.translation.vector + arm, linear + angular.cross(&arm));
        let closing_m_s = speed.dot(&self.normal);
        let gap_m = (self.upper_m - place_m).dot(&self.normal) - closing_m_s * step_s;
        let slide_m = (speed - self.normal * closing_m_s) * step_s;
        Touch { arm, place_m, normal: self.normal, gap_m, closing_m_s, slide_m, step_s }
    }

    /// From the twist to the velocity of the lower tooth, at that pose of the platform.
    pub(super) fn jacobian(&self, pose: &Pose) -> Matrix3x6<f64> {
        let mut jacobian = Matrix3x6::identity();
        jacobian.fixed_view_mut::<3, 3>(0, 3).copy_from(&-(pose.rotation * self.lower_m).cross_matrix());
        jacobian
    }
}
