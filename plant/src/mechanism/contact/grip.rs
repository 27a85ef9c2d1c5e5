//! Dry friction of a contact along its face.
//!
//! Coulomb's law, regularised by elasticity: the faces hold to each other by a spring, and slide where the spring would pull
//! more than friction allows (Cundall and Strack, Géotechnique 29, 1979). A contact at rest stays at rest.

use masseter_model::geometry::Vec3;

use super::pair::Touch;

/// The friction of a contact.
#[derive(Debug, Clone, Copy)]
pub(super) struct Friction {
    /// Largest lateral force as a share of the normal one.
    pub(super) coefficient: f64,
    /// Stiffness of the faces along each other, N/m.
    pub(super) stiffness_n_per_m: f64,
}

/// Where a lower tooth holds to the other face.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Grip {
    /// Where the spring would be slack, base frame, m; none without contact.
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
