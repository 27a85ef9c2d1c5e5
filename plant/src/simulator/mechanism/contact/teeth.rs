//! A lower tooth and its antagonist: their places, their motion, and the forces of their contact.
//!
//! A tooth gives way in its ligament, at first easily, then less. Its stiffness is an assumption, because no
//! measurement is known. Friction is Coulomb's law, regularised by elasticity (Cundall and Strack, Géotechnique 29,
//! 1979). A spring holds the faces to each other, and the faces slide at a pull beyond the friction. A contact at rest
//! stays at rest.
//!
//! The law of every contact is that of Hunt and Crossley, "Coefficient of restitution interpreted as damping in
//! vibroimpact", 1975. The damping grows with the elastic force. So the force begins at 0 with the contact, at any
//! speed.

use masseter_model::geometry::{Pose, Twist, Vec3};
use masseter_scenario::{TeethConfig, ToothConfig};
use nalgebra::{Matrix3x6, Point3};

/// The pair.
#[derive(Debug, Clone, Copy, serde::Serialize, serde::Deserialize)]
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

/// The motion of a pair over a step. Forces are constant over the step, so they are those of its end at this speed.
#[derive(Debug, Clone, Copy)]
pub(super) struct Touch {
    /// From the platform's origin to the lower tooth, base axes, m.
    pub(super) arm: Vec3,
    /// The lower tooth in the base frame now, m.
    pub(super) place_m: Vec3,
    /// From the lower tooth to its antagonist.
    pub(super) normal: Vec3,
    /// Distance along the normal at the step's end, m; negative for overlapping teeth.
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

    /// The motion of the pair at a pose and twist of the platform.
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

/// The contact of a pair of teeth.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub(super) struct Enamel {
    /// Distance of the teeth in the closed mouth, m.
    clearance_m: f64,
    /// Stiffness of a tooth in its ligament under forces up to `soft_up_to_n` (N), and under larger ones, N/m.
    soft_n_per_m: f64,
    soft_up_to_n: f64,
    stiff_n_per_m: f64,
    /// Damping of Hunt and Crossley, s/m.
    damping_s_per_m: f64,
    friction: Friction,
    grip: Grip,
}

impl Enamel {
    /// A contact that nothing touches yet.
    pub(super) fn new(teeth: &TeethConfig) -> Self {
        let stiff_n_per_m = teeth.stiff_n_per_m;
        Self {
            clearance_m: teeth.clearance_m,
            soft_n_per_m: teeth.soft_n_per_m,
            soft_up_to_n: teeth.soft_up_to_n,
            stiff_n_per_m,
            damping_s_per_m: teeth.damping_s_per_m,
            friction: Friction { coefficient: teeth.friction, stiffness_n_per_m: stiff_n_per_m },
            grip: Grip::default(),
        }
    }

    /// The force on the lower tooth, base axes, N.
    pub(super) fn force_n(&mut self, touch: &Touch) -> Vec3 {
        let elastic_n = self.elastic_n(-touch.gap_m - self.clearance_m);
        let normal_n = contact_force_n(elastic_n, self.damping_s_per_m, touch.closing_m_s);
        touch.normal * -normal_n + self.grip.force_n(touch, normal_n, self.friction)
    }

    /// The force of a compression, N.
    fn elastic_n(&self, compression_m: f64) -> f64 {
        let soft_n = self.soft_n_per_m * compression_m;
        if soft_n <= self.soft_up_to_n {
            return soft_n.max(0.0);
        }
        self.soft_up_to_n + self.stiff_n_per_m * (compression_m - self.soft_up_to_n / self.soft_n_per_m)
    }
}

/// The friction of a contact.
#[derive(Debug, Clone, Copy, serde::Serialize, serde::Deserialize)]
pub(super) struct Friction {
    /// Largest lateral force as a share of the normal one.
    pub(super) coefficient: f64,
    /// Stiffness of the faces along each other, N/m.
    pub(super) stiffness_n_per_m: f64,
}

/// The hold of a lower tooth on the other face.
#[derive(Debug, Clone, Copy, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct Grip {
    /// Place of the slack spring, base frame, m; none without contact.
    anchor_m: Option<Vec3>,
}

impl Grip {
    /// The lateral force on the lower tooth under a normal force, N.
    pub(super) fn force_n(&mut self, touch: &Touch, normal_n: f64, friction: Friction) -> Vec3 {
        let Friction { coefficient, stiffness_n_per_m } = friction;
        if normal_n <= 0.0 {
            self.anchor_m = None;
            return Vec3::zeros();
        }
        let most_n = coefficient * normal_n;
        let from_anchor = touch.place_m - *self.anchor_m.get_or_insert(touch.place_m);
        let along = from_anchor - touch.normal * from_anchor.dot(&touch.normal);
        let stretch = along.cap_magnitude(most_n / stiffness_n_per_m);
        self.anchor_m = Some(touch.place_m - stretch);
        ((stretch + touch.slide_m) * -stiffness_n_per_m).cap_magnitude(most_n)
    }
}

/// The force of a contact, N, from its elastic force (N), its damping (s/m) and the speed of its compression (m/s). A contact
/// pushes and never pulls.
pub(super) fn contact_force_n(elastic_n: f64, damping_s_per_m: f64, closing_m_s: f64) -> f64 {
    elastic_n * (1.0 + damping_s_per_m * closing_m_s).max(0.0)
}

#[cfg(test)]
mod enamel_tests {
    use masseter_scenario::TeethConfig;

    use super::*;

    #[test]
    fn a_tooth_is_soft_up_to_4_n_and_then_ten_times_stiffer() {
        let enamel = Enamel::new(&TeethConfig::default());
        for (compression_um, expected_n) in [(-5.0, 0.0), (10.0, 2.0), (20.0, 4.0), (30.0, 24.0)] {
            let found_n = enamel.elastic_n(compression_um * 1e-6);
            assert!((found_n - expected_n).abs() < 1e-9, "{found_n} N at {compression_um} µm");
        }
    }
}

#[cfg(test)]
mod law_tests {
    use super::*;

    #[test]
    fn a_contact_at_any_speed_begins_without_a_jump_and_never_pulls() {
        assert!([0.06, 5.0].iter().all(|closing_m_s| contact_force_n(0.0, 2.5, *closing_m_s).abs() < 1e-12));
        assert!(contact_force_n(100.0, 2.5, -10.0).abs() < 1e-12);
        assert!(contact_force_n(100.0, 2.5, 0.06) > 100.0 && contact_force_n(100.0, 2.5, -0.06) < 100.0);
    }
}
