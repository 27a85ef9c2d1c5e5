//! Pressure between the jaws: over which area the force on a tooth acts, and how hard.
//!
//! Two enamel faces meet in one elastic contact of a cusp on a flat face (Hertz 1882). Food presses with its cross-section,
//! evenly. Yield, several cusps of a tooth and the depth of a face are left out, and the radius of a cusp is an assumption.

use std::f64::consts::PI;

use masseter_model::geometry::{Pose, Vec3};
use masseter_runtime::messages::ToothContact;
use masseter_scenario::{FoodConfig, Scenario};

use crate::poses::{closed_platform, place};

/// Elastic modulus of enamel, Pa (83.4 ± 7.1 GPa: He et al. 2006, Biomaterials 27:4388), and Poisson's ratio (assumption).
const ENAMEL_PA: f64 = 83.4e9;
const POISSON: f64 = 0.3;
/// Modulus of two enamel faces against each other, Pa.
const CONTACT_PA: f64 = ENAMEL_PA / (2.0 * (1.0 - POISSON * POISSON));

/// What presses on a tooth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Bearing {
    /// A cusp of enamel of this radius, m.
    Cusp(f64),
    /// A column of food of this cross-section, m².
    Food(f64),
}

/// How a force lies on a tooth.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Pressure {
    /// The area, m².
    pub area_m2: f64,
    /// The mean over the area, Pa.
    pub mean_pa: f64,
    /// The highest on the area, Pa.
    pub peak_pa: f64,
}

impl Bearing {
    /// The pressure under a force normal to the face, N.
    pub fn under(self, normal_n: f64) -> Pressure {
        if normal_n <= 0.0 {
            return Pressure::default();
        }
        match self {
            Self::Cusp(radius_m) => {
                let contact_m = (0.75 * normal_n * radius_m / CONTACT_PA).cbrt();
                let area_m2 = PI * contact_m * contact_m;
                Pressure { area_m2, mean_pa: normal_n / area_m2, peak_pa: 1.5 * normal_n / area_m2 }
            }
            Self::Food(area_m2) => {
                let mean_pa = normal_n / area_m2;
                Pressure { area_m2, mean_pa, peak_pa: mean_pa }
            }
        }
    }
}

/// A lower tooth, and what may press on it.
#[derive(Debug, Clone, Copy)]
pub struct PressedTooth {
    /// FDI number.
    pub number: u32,
    /// Its antagonist, if teeth meet.
    pub cusp: Option<Bearing>,
    /// The food on it: the first of the run that lies on the tooth. Without another measure a piece is as wide as it is thick.
    pub food: Option<Bearing>,
    /// The tooth in the platform frame, m.
    point_m: Vec3,
    /// The antagonist in the base frame, m, and the normal towards it.
    antagonist_m: Vec3,
    normal: Vec3,
    /// Their distance in the closed mouth, m.
    clearance_m: f64,
}

impl PressedTooth {
    /// The lower teeth of a scenario; none where the jaws cannot touch.
    pub fn all(scenario: &Scenario) -> Vec<Self> {
        let Some(closed) = closed_platform(scenario).filter(|_| scenario.has_contact()) else {
            return Vec::new();
        };
        let section =
            |food: &FoodConfig| Bearing::Food(food.thickness_m * food.thickness_m / food.teeth.len() as f64);
        let tooth = |tooth: masseter_scenario::ToothConfig| {
            let point_m = Vec3::from(tooth.point_m);
            Self {
                number: tooth.number.into(),
                cusp: scenario.teeth.as_ref().map(|teeth| Bearing::Cusp(teeth.cusp_radius_m)),
                food: scenario.foods().find(|food| food.teeth.contains(&tooth.number)).map(section),
                point_m,
                antagonist_m: place(&closed, &point_m),
                normal: closed.rotation * Vec3::from(tooth.normal).normalize(),
                clearance_m: scenario.teeth.as_ref().map_or(0.0, |teeth| teeth.clearance_m),
            }
        };
        scenario.arch().into_iter().map(tooth).collect()
    }

    /// The pressure under the force of a message in a pose of the platform. Where the teeth meet, they bear all of it.
    pub fn pressure(&self, contact: &ToothContact, platform: &Pose) -> Pressure {
        let gap_m = (self.antagonist_m - place(platform, &self.point_m)).dot(&self.normal);
        let cusp = self.cusp.filter(|_| self.food.is_none() || gap_m + self.clearance_m <= 0.0);
        let normal_n = -Vec3::from(contact.force_n).dot(&self.normal);
        cusp.or(self.food).map_or(Pressure::default(), |bearing| bearing.under(normal_n))
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    /// A relative difference.
    fn off(found: f64, expected: f64) -> f64 {
        (found / expected - 1.0).abs()
    }

    /// A sphere on a plane: the pressure p₀ √(1 − r²/a²) must add up to the force, and Boussinesq's law of an elastic
    /// half-space must give it the shape of the sphere: (1/πE*) ∫ p dA / r in the middle is a²/R.
    #[test]
    fn a_cusp_presses_as_a_sphere_on_a_plane() {
        let (radius_m, normal_n) = (2e-3, 15.0);
        let Pressure { area_m2, mean_pa, peak_pa } = Bearing::Cusp(radius_m).under(normal_n);
        let contact_m = (area_m2 / PI).sqrt();
        let rings = 100_000;
        let (mut force_n, mut depth_m) = (0.0, 0.0);
        for ring in 0..rings {
            let share = (f64::from(ring) + 0.5) / f64::from(rings);
            let pressure_pa = peak_pa * (1.0 - share * share).sqrt();
            let width_m = contact_m / f64::from(rings);
            force_n += pressure_pa * 2.0 * PI * share * contact_m * width_m;
            depth_m += pressure_pa * 2.0 * width_m / CONTACT_PA;
        }
        assert!(off(force_n, normal_n) < 1e-6, "{force_n} N");
        assert!(off(depth_m, contact_m * contact_m / radius_m) < 1e-6, "{depth_m} m");
        assert!(off(peak_pa, 1.5 * mean_pa) < 1e-12);
        // Eight times the force: twice the radius of the contact and twice the pressure.
        let harder = Bearing::Cusp(radius_m).under(8.0 * normal_n);
        assert!(off(harder.area_m2, 4.0 * area_m2) < 1e-12 && off(harder.peak_pa, 2.0 * peak_pa) < 1e-12);
    }

    /// The area of a flat punch does not depend on the force, and its mean pressure is in proportion.
    #[test]
    fn food_presses_as_a_flat_punch() {
        let punch = Bearing::Food(1e-4);
        assert_eq!(punch.under(35.0), Pressure { area_m2: 1e-4, mean_pa: 3.5e5, peak_pa: 3.5e5 });
        assert!(off(punch.under(70.0).mean_pa, 7e5) < 1e-12);
        assert!([punch, Bearing::Cusp(2e-3)].iter().all(|one| one.under(0.0) == Pressure::default()));
    }

    #[test]
    fn food_bears_until_the_teeth_meet_and_friction_does_not_press() {
        let scenario = "[teeth]\nclearance_m = 1e-4\n[food]\nkind = 'soft'\nteeth = [36, 46]\n";
        let scenario = Scenario::parse(Path::new("scenario.toml"), scenario).unwrap();
        let teeth = PressedTooth::all(&scenario);
        let tooth = teeth.iter().find(|tooth| tooth.number == 36).unwrap();
        let contact = ToothContact { number: 36, force_n: [6.0, 0.0, -20.0], place_m: tooth.point_m.into() };
        let closed = closed_platform(&scenario).unwrap();
        let raised = |up_m: f64| Pose::translation(0.0, 0.0, up_m) * closed;
        assert_eq!(tooth.pressure(&contact, &raised(-5e-3)), Bearing::Food(5e-5).under(20.0));
        assert_eq!(tooth.pressure(&contact, &raised(0.9e-4)), Bearing::Food(5e-5).under(20.0));
        assert_eq!(tooth.pressure(&contact, &raised(1.1e-4)), Bearing::Cusp(2e-3).under(20.0));
        assert!(PressedTooth::all(&Scenario::default()).is_empty());
    }
}
