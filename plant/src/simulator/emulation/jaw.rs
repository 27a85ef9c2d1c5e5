//! The mouth of a scenario: its teeth with the stiffest contact of each, and food on them.

use masseter_model::geometry::Pose;
use masseter_scenario::{FoodConfig, Scenario, ToothConfig};

use crate::simulator::mechanism::contact::{Occlusion, food::Food};

/// Teeth and food of a scenario, for a mouth that is closed in that pose of the platform.
pub(crate) fn occlusion(scenario: &Scenario, closed: &Pose) -> Occlusion {
    let teeth = arch(scenario).into_iter().map(|tooth| {
        let on_tooth = scenario.foods().filter(|food| food.teeth.contains(&tooth.number));
        let shares = on_tooth.map(|food| food.stiffest_n_per_m() / food.teeth.len() as f64);
        let of_teeth = scenario.teeth.iter().map(|teeth| teeth.stiff_n_per_m.max(teeth.soft_n_per_m));
        let stiffest_n_per_m = shares.chain(of_teeth).fold(0.0, f64::max);
        (tooth, stiffest_n_per_m)
    });
    let mut occlusion = Occlusion::new(&teeth.collect::<Vec<_>>(), scenario.teeth.as_ref(), closed);
    occlusion.set_food(scenario.food.as_ref().map(|config| food(config, scenario)));
    occlusion
}

/// A fresh piece of a food on the scenario's teeth.
pub(super) fn food(config: &FoodConfig, scenario: &Scenario) -> Food {
    let numbers: Vec<_> = arch(scenario).iter().map(|tooth| tooth.number).collect();
    Food::new(config, &numbers)
}

/// The teeth that can touch something.
fn arch(scenario: &Scenario) -> Vec<ToothConfig> {
    if scenario.has_contact() { scenario.arch() } else { Vec::new() }
}
