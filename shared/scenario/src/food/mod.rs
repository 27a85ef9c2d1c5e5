//! Food between the teeth of the emulated jaw: `[food]`.
//!
//! A food is data: the values of its kind, each with its source, stand in `kinds/`.

use serde::{Deserialize, Deserializer, Serialize};

use super::error::ScenarioError;
use super::kinds::{over_kind, over_kind_if_given};
use super::need::{keyed, require_within};
use super::teeth::ToothConfig;

/// The kinds with their values.
const KINDS: [(&str, &str); 5] = [
    ("soft", include_str!("kinds/soft.toml")),
    ("peanut", include_str!("kinds/peanut.toml")),
    ("hazelnut", include_str!("kinds/hazelnut.toml")),
    ("almond", include_str!("kinds/almond.toml")),
    ("gum", include_str!("kinds/gum.toml")),
];

/// How a food gives way.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Material {
    /// It flows at its strength, and stays flat until it is collected again.
    Yielding,
    /// It breaks at its strength. Its fragments flow at a share of the strength.
    Brittle,
    /// A standard linear solid: a spring beside a spring with a damper. It regains its shape.
    Viscoelastic,
}

/// A piece of food that resists the bite.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FoodConfig {
    /// The kind whose values the other keys replace.
    pub kind: String,
    /// Where the values come from.
    pub source: String,
    /// The lower teeth that it lies on, by their FDI numbers. They carry it in equal shares.
    pub teeth: Vec<u8>,
    /// How it gives way.
    pub material: Material,
    /// Thickness of a fresh piece, m.
    pub thickness_m: f64,
    /// Elastic force by compression of a fresh piece, N/m: at full compression, where the exponent is not 1.
    pub stiffness_n_per_m: f64,
    /// Exponent of the compression in the elastic force.
    pub exponent: f64,
    /// Damping of Hunt and Crossley: growth of the force by the speed of compression, s/m.
    pub damping_s_per_m: f64,
    /// Elastic force at which it flows or breaks, N.
    pub strength_n: f64,
    /// Share of stiffness and strength that its fragments keep.
    pub residual: f64,
    /// The spring that relaxes, N/m.
    pub relaxing_n_per_m: f64,
    /// In which time it relaxes, s.
    pub relaxation_s: f64,
    /// Largest lateral force on a tooth, as a share of the normal one.
    pub friction: f64,
    /// Share of its thickness that the food keeps from one chew to the next.
    pub left_by_chew: f64,
    /// Thickness below which it is swallowed, m. A fresh piece follows.
    pub swallowed_m: f64,
}

impl Default for FoodConfig {
    /// The first kind: soft food.
    fn default() -> Self {
        Self::of_kind(KINDS[0].0).expect("the rig's foods have every key")
    }
}

impl FoodConfig {
    /// The food of that kind.
    ///
    /// # Errors
    /// For a name that no kind has.
    pub fn of_kind(kind: &str) -> Result<Self, toml::de::Error> {
        over_kind(&KINDS, toml::Table::from_iter([("kind".to_owned(), kind.into())]))
    }

    /// The steepest rise of its force with compression, N/m.
    pub fn stiffest_n_per_m(&self) -> f64 {
        self.exponent * self.stiffness_n_per_m + self.relaxing_n_per_m
    }

    /// Checks the values; the food must lie on teeth of this arch.
    pub(super) fn validate(&self, arch: &[ToothConfig]) -> Result<(), ScenarioError> {
        let missing = |number: &&u8| !arch.iter().any(|tooth| tooth.number == **number);
        if let Some(number) = self.teeth.iter().find(missing) {
            let there: Vec<_> = arch.iter().map(|tooth| tooth.number.to_string()).collect();
            let need = format!("name lower teeth that the jaw has: {}", there.join(", "));
            return Err(ScenarioError::bad("food.teeth", number, need));
        }
        let is_twice = |(place, number): (usize, &u8)| self.teeth[..place].contains(number);
        if self.teeth.is_empty() || self.teeth.iter().enumerate().any(is_twice) {
            let need = "name at least one tooth, none twice";
            return Err(ScenarioError::bad("food.teeth", &format!("{:?}", self.teeth), need));
        }
        let bounds = [
            (1e-3, 0.05),
            (1.0, 1e6),
            (1.0, 1.5),
            (0.0, 10.0),
            (0.1, 1500.0),
            (0.01, 1.0),
            (0.0, 1e6),
            (1e-3, 100.0),
            (0.0, 2.0),
            (0.1, 1.0),
            (2e-4, 0.05),
        ];
        let values = keyed!(
            "food", self, thickness_m stiffness_n_per_m exponent damping_s_per_m strength_n residual
            relaxing_n_per_m relaxation_s friction left_by_chew swallowed_m
        );
        let within: Vec<_> = values
            .into_iter()
            .zip(bounds)
            .map(|((key, value), (least, most))| (key, value, least, most))
            .collect();
        require_within(&within)?;
        let fresh = self.thickness_m;
        require_within(&[("food.swallowed_m", self.swallowed_m, 0.0, fresh)])
    }
}

/// Reads a food: what the table has replaces the values of its kind.
pub(super) fn over_food<'de, D: Deserializer<'de>>(table: D) -> Result<Option<FoodConfig>, D::Error> {
    over_kind_if_given(&KINDS, table)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{JawConfig, TeethConfig};

    #[test]
    fn every_kind_has_its_name_a_source_and_valid_values() {
        let arch = TeethConfig::default().arch(&JawConfig::default());
        for (name, text) in KINDS {
            let food = FoodConfig::of_kind(name).unwrap();
            assert_eq!(food.kind, name);
            assert!(food.source.len() > 10, "{name}");
            food.validate(&arch).unwrap();
            let keys = text.lines().filter(|line| line.contains(" = "));
            let without_source = keys.filter(|line| !line.contains('#') && !line.starts_with(['k', 's']));
            assert_eq!(without_source.collect::<Vec<_>>(), Vec::<&str>::new(), "{name}");
        }
        assert!(FoodConfig::of_kind("toffee").unwrap_err().to_string().contains("there is no kind 'toffee'"));
    }

    #[test]
    fn nuts_break_at_the_forces_that_were_measured() {
        let strength_n = |kind| FoodConfig::of_kind(kind).unwrap().strength_n.to_string();
        assert_eq!(["peanut", "hazelnut", "almond"].map(strength_n), ["76", "431", "895"]);
    }
}
