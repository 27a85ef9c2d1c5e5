//! Teeth and food of a scenario, in the form of the mechanism.

use masseter_model::geometry::Pose;
use masseter_scenario::{self as scenario, FoodConfig, Scenario, TeethConfig, ToothConfig};

use crate::simulator::mechanism::contact::Occlusion;
use crate::simulator::mechanism::contact::food::{Food, Foodstuff, Material};
use crate::simulator::mechanism::contact::teeth::{Enamel, Friction, Grip, MOST_PAIRS, Tooth};

/// Every tooth of a scenario has a pair.
const _: () = assert!(MOST_PAIRS == scenario::MOST_PAIRS);

/// Teeth and food of a scenario, for a mouth that is closed in that pose of the platform.
pub(crate) fn occlusion(scenario: &Scenario, closed: &Pose) -> Occlusion {
    let teeth = arch(scenario).into_iter().map(|tooth| {
        let on_tooth = scenario.foods().filter(|food| food.teeth.contains(&tooth.number));
        let shares = on_tooth.map(|food| food.stiffest_n_per_m() / food.teeth.len() as f64);
        let of_teeth = scenario.teeth.iter().map(|teeth| teeth.stiff_n_per_m.max(teeth.soft_n_per_m));
        let stiffest_n_per_m = shares.chain(of_teeth).fold(0.0, f64::max);
        (Tooth { number: tooth.number, point_m: tooth.point_m, normal: tooth.normal }, stiffest_n_per_m)
    });
    let enamel = scenario.teeth.as_ref().map(Enamel::from);
    let mut occlusion = Occlusion::new(&teeth.collect::<Vec<_>>(), enamel.as_ref(), closed);
    occlusion.set_food(scenario.food.as_ref().map(|config| food(config, scenario)));
    occlusion
}

/// A fresh piece of a food on the scenario's teeth.
pub(super) fn food(config: &FoodConfig, scenario: &Scenario) -> Food {
    let numbers: Vec<_> = arch(scenario).iter().map(|tooth| tooth.number).collect();
    Food::new(config.into(), &numbers)
}

/// The teeth that can touch something.
fn arch(scenario: &Scenario) -> Vec<ToothConfig> {
    if scenario.has_contact() { scenario.arch() } else { Vec::new() }
}

impl From<&TeethConfig> for Enamel {
    fn from(teeth: &TeethConfig) -> Self {
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
}

impl From<&FoodConfig> for Foodstuff {
    fn from(food: &FoodConfig) -> Self {
        Self {
            teeth: food.teeth.clone(),
            material: match food.material {
                scenario::Material::Yielding => Material::Yielding,
                scenario::Material::Brittle => Material::Brittle,
                scenario::Material::Viscoelastic => Material::Viscoelastic,
            },
            thickness_m: food.thickness_m,
            swallowed_m: food.swallowed_m,
            left_by_chew: food.left_by_chew,
            stiffness_n_per_m: food.stiffness_n_per_m,
            exponent: food.exponent,
            damping_s_per_m: food.damping_s_per_m,
            strength_n: food.strength_n,
            residual: food.residual,
            relaxing_n_per_m: food.relaxing_n_per_m,
            relaxation_s: food.relaxation_s,
            friction: food.friction,
        }
    }
}
