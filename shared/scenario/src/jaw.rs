//! The lower jaw, its teeth, and food between them: `[jaw]`, `[teeth]` and `[food]`.
//!
//! The default arch is a parabola through the incisal point and both first molars. The teeth follow each other by their
//! mesiodistal widths. The trajectory checks the ranges of `[jaw]`.

use std::collections::BTreeSet;

use masseter_model::section::Range;
use serde::{Deserialize, Deserializer, Serialize, de::Error};

use super::error::{Checked, ScenarioError, ranges_of, require, require_each, require_range};
use super::merge::{Given, over_kind};
use crate::wording::listed;

/// Farthest offset on a robot that fits on a table, m.
const FARTHEST_M: f64 = 1.0;
/// The default first molar on the left, platform frame, m: ArtiSynth's jaw, scaled to the paper's platform.
const FIRST_MOLAR_M: [f64; 3] = [0.0024, 0.0248, 0.0];
/// Teeth of a side from the middle on, by the last digit of their FDI numbers, without third molars.
const BY_SIDE: usize = 7;
/// Places of their centres along the arch, as shares of the way from the incisal point to the first molar. The mean
/// mesiodistal widths of lower teeth are 5, 5.5, 7, 7, 7, 11, 10.5 mm (dental anatomy, recalled).
const ALONG_ARCH: [f64; BY_SIDE] =
    [2.5 / 37.0, 7.75 / 37.0, 14.0 / 37.0, 21.0 / 37.0, 28.0 / 37.0, 1.0, 47.75 / 37.0];
/// The tens of the FDI numbers of the lower teeth, left then right.
const QUADRANTS: [u8; 2] = [30, 40];
/// Steps of the sum for the length of the arch.
const STEPS: usize = 1000;

/// Most pairs of teeth in contact: all lower teeth.
pub const MOST_PAIRS: usize = 16;

/// The kinds of food with their values. The values are data in `food/kinds/`, each with its source.
const FOODS: [(&str, &str); 5] = [
    ("soft", include_str!("food/kinds/soft.toml")),
    ("peanut", include_str!("food/kinds/peanut.toml")),
    ("hazelnut", include_str!("food/kinds/hazelnut.toml")),
    ("almond", include_str!("food/kinds/almond.toml")),
    ("gum", include_str!("food/kinds/gum.toml")),
];

section! {
    /// The place of the lower jaw on the platform, and the dimensions of the mandible.
    #[derive(Copy)]
    pub struct JawConfig {
        /// Length of all three legs at the closed pose, slides in the middle.
        pub closed_leg_m: f64 = 0.2974 => Positive,
        /// Offset of the closed pose, base frame: a jaw that opens far back gains stroke if its closed pose is further
        /// forward.
        pub closed_offset_m: [f64; 3] = [0.0; 3] => Within(-FARTHEST_M, FARTHEST_M),
        /// The incisal point in the platform frame; by default corner A₁.
        pub reference_point_m: [f64; 3] = [0.05 / 3f64.sqrt(), 0.0, 0.0] => Within(-FARTHEST_M, FARTHEST_M),
        /// Side of Bonwill's triangle; its corners are both condyles and the incisal point.
        pub bonwill_side_m: f64 = 0.100 => Within(0.01, 1.0),
        /// Balkwill angle between Bonwill's triangle and the occlusal plane.
        pub balkwill_angle_deg: f64 = 22.5 => "0 to below 90",
    }
}

keys! {
    /// A lower tooth and its antagonist.
    #[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields)]
    pub struct ToothConfig {
        /// FDI number: 31 to 38 on the left, 41 to 48 on the right.
        pub number: u8 => "31 to 38, 41 to 48, none twice",
        /// Where the tooth meets its antagonist in the closed mouth, platform frame.
        pub point_m: [f64; 3] => Within(-0.5, 0.5),
        /// Normal of the face on which they meet, from the lower tooth to its antagonist, platform frame of the closed
        /// mouth. That of the occlusal plane when absent; a cusp leans it.
        #[serde(default = "occlusal")]
        pub normal: [f64; 3] => "within 60° of the platform's normal",
    }
}

const fn occlusal() -> [f64; 3] {
    [0.0, 0.0, 1.0]
}

section! {
    /// The lower arch, and the contact of its teeth with their antagonists.
    pub struct TeethConfig {
        /// Lower teeth that the jaw lacks.
        pub missing: Vec<u8> = Vec::new() => "31 to 38, 41 to 48",
        /// Distance of the teeth from their antagonists in the closed mouth; below 0 they are pressed together there.
        pub clearance_m: f64 = 1e-4 => Within(-0.0005, 0.02),
        /// Stiffness of a tooth under small forces (assumption).
        pub soft_n_per_m: f64 = 2e5 => Within(1000.0, 10_000_000.0),
        /// Force up to which that holds.
        pub soft_up_to_n: f64 = 4.0 => Within(0.0, 100.0),
        /// Stiffness under larger forces (assumption).
        pub stiff_n_per_m: f64 = 2e6 => Within(1000.0, 10_000_000.0) "as `dynamics.step_ns` allows",
        /// Damping of Hunt and Crossley: growth of the force by the speed of compression (assumption).
        pub damping_s_per_m: f64 = 2.5 => Within(0.0, 20.0),
        /// Friction of enamel on enamel.
        pub friction: f64 = 0.23 => Within(0.0, 2.0),
        /// Radius of the cusp in which a pair of teeth meets, for the pressure alone (assumption).
        pub cusp_radius_m: f64 = 2e-3 => Within(0.0001, 0.1),
        /// Teeth at other places than those of the default arch.
        #[serde(skip_serializing_if = "Vec::is_empty")]
        pub tooth: Vec<ToothConfig> = Vec::new(),
    }
}

impl TeethConfig {
    /// The teeth that the jaw has, by their numbers.
    pub fn arch(&self, jaw: &JawConfig) -> Vec<ToothConfig> {
        let mut arch = default_arch(jaw);
        for tooth in &self.tooth {
            arch.retain(|other| other.number != tooth.number);
            arch.push(*tooth);
        }
        arch.retain(|tooth| !self.missing.contains(&tooth.number));
        arch.sort_by_key(|tooth| tooth.number);
        arch
    }

    pub(super) fn validate(&self) -> Checked {
        let numbers = self.tooth.iter().map(|tooth| ("teeth.tooth.number", tooth.number));
        let missing = self.missing.iter().map(|number| ("teeth.missing", *number));
        numbers.chain(missing).try_for_each(|(key, number)| {
            let is_lower = (31..=38).contains(&number) || (41..=48).contains(&number);
            require(is_lower, key, &number, "use an FDI number of a lower tooth: 31 to 38, 41 to 48")
        })?;
        let mut placed = BTreeSet::new();
        require_each(&self.tooth, |tooth| {
            let is_new = placed.insert(tooth.number);
            require(is_new, "teeth.tooth.number", &tooth.number, "give each tooth one place")?;
            tooth.check_ranges(ranges_of("teeth.tooth"))?;
            // A steeper face catches the tooth on its way up.
            require_range("teeth.tooth.normal", Range::Within(0.5, 1.0), tooth.rise())
        })?;
        self.check_ranges(ranges_of("teeth"))
    }
}

impl ToothConfig {
    /// The vertical part of its unit normal.
    fn rise(&self) -> f64 {
        let [x, y, z] = self.normal;
        z / (x * x + y * y + z * z).sqrt()
    }
}

/// Seven teeth a side on the parabola.
fn default_arch(jaw: &JawConfig) -> Vec<ToothConfig> {
    const { assert!(2 * (BY_SIDE + 1) <= MOST_PAIRS) };
    let [molar_x, molar_y, molar_z] = FIRST_MOLAR_M;
    let [incisal_x, incisal_y, incisal_z] = jaw.reference_point_m;
    // By the distance from the middle as a share of the first molar's distance.
    let point = |aside: f64, side: f64| {
        let (back, front) = (aside * aside, 1.0 - aside * aside);
        [
            front * incisal_x + back * molar_x,
            front * incisal_y + side * aside * molar_y,
            front * incisal_z + back * molar_z,
        ]
    };
    let distances = distances_aside(|aside| point(aside, 1.0));
    let mut arch = Vec::with_capacity(2 * BY_SIDE);
    for (quadrant, side) in QUADRANTS.into_iter().zip([1.0, -1.0]) {
        let tooth = |(number, aside)| ToothConfig { number, point_m: point(aside, side), normal: occlusal() };
        arch.extend((quadrant + 1..).zip(distances).map(tooth));
    }
    arch
}

/// Distance of each tooth from the middle, as a share of the first molar's: the point at the tooth's length along the
/// arch.
fn distances_aside(point: impl Fn(f64) -> [f64; 3]) -> [f64; BY_SIDE] {
    let step = 1.0 / STEPS as f64;
    let mut lengths_m = vec![0.0];
    for place in 0..2 * STEPS {
        let [from, to] = [place, place + 1].map(|place| point(place as f64 * step));
        let squares = from.into_iter().zip(to).map(|(from, to)| (to - from) * (to - from));
        lengths_m.push(lengths_m[place] + squares.sum::<f64>().sqrt());
    }
    ALONG_ARCH.map(|share| {
        let length_m = share * lengths_m[STEPS];
        lengths_m.partition_point(|shorter_m| *shorter_m < length_m - 1e-12) as f64 * step
    })
}

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

keys! {
    /// A piece of food that resists the bite.
    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields)]
    pub struct FoodConfig {
        /// The food whose values the other keys replace. The defaults here are those of `soft`;
        /// `shared/scenario/src/food/kinds` has all, with their sources.
        pub kind: String,
        /// Where the values come from.
        pub source: String,
        /// The teeth that it lies on; they carry equal shares of it.
        pub teeth: Vec<u8> => "lower teeth that the jaw has, none twice",
        /// How it gives way: it flows at its strength; breaks at its strength, whereupon its fragments flow at a share of
        /// it; or is a standard linear solid.
        pub material: Material,
        /// Thickness of a fresh piece.
        pub thickness_m: f64 => Within(0.001, 0.05),
        /// Elastic force by compression, at full compression where `exponent` is not 1.
        pub stiffness_n_per_m: f64 => Within(1.0, 1_000_000.0) "as `dynamics.step_ns` allows",
        /// Exponent of the compression in the elastic force.
        pub exponent: f64 => Within(1.0, 1.5),
        /// Damping of Hunt and Crossley: growth of the force by the speed of compression.
        pub damping_s_per_m: f64 => Within(0.0, 10.0),
        /// Elastic force at which it flows or breaks; the most that a viscoelastic one bears.
        pub strength_n: f64 => Within(0.1, 1500.0),
        /// Share of stiffness and strength that fragments keep.
        pub residual: f64 => Within(0.01, 1.0),
        /// Spring of a viscoelastic food that relaxes.
        pub relaxing_n_per_m: f64 => Within(0.0, 1_000_000.0),
        /// In which time it relaxes.
        pub relaxation_s: f64 => Within(0.001, 100.0),
        /// Largest lateral force as a share of the normal one.
        pub friction: f64 => Within(0.0, 2.0),
        /// Share of its thickness that it keeps from one chew to the next.
        pub left_by_chew: f64 => Within(0.1, 1.0),
        /// Thickness below which it is swallowed; a fresh piece follows.
        pub swallowed_m: f64 => Within(0.0002, 0.05) "at most `thickness_m`",
    }
}

impl Default for FoodConfig {
    /// The first kind: soft food.
    fn default() -> Self {
        Self::of_kind(FOODS[0].0).expect("the rig's foods have every key")
    }
}

impl FoodConfig {
    /// The food of that kind.
    ///
    /// # Errors
    /// For a name that no kind has.
    pub fn of_kind(kind: &str) -> Result<Self, toml::de::Error> {
        over_kind(&FOODS, toml::Table::from_iter([("kind".to_owned(), kind.into())]))
    }

    /// The steepest rise of its force with compression, N/m.
    pub fn stiffest_n_per_m(&self) -> f64 {
        self.exponent * self.stiffness_n_per_m + self.relaxing_n_per_m
    }

    /// Checks the values; the food must lie on teeth of this arch.
    pub(super) fn validate(&self, arch: &[ToothConfig]) -> Checked {
        let missing = |number: &&u8| !arch.iter().any(|tooth| tooth.number == **number);
        if let Some(number) = self.teeth.iter().find(missing) {
            let there = listed(arch.iter().map(|tooth| tooth.number));
            let need = format!("name lower teeth that the jaw has: {there}");
            return Err(ScenarioError::bad("food.teeth", number, need));
        }
        let distinct = self.teeth.iter().collect::<BTreeSet<_>>().len();
        let is_once = (1..=distinct).contains(&self.teeth.len());
        let teeth = format!("{:?}", self.teeth);
        require(is_once, "food.teeth", &teeth, "name at least one tooth, none twice")?;
        self.check_ranges(ranges_of("food"))?;
        require_range("food.swallowed_m", Range::Within(0.0, self.thickness_m), self.swallowed_m)
    }
}

/// Reads a food. The values of the table replace the values of its kind.
pub(super) fn over_food<'de, D: Deserializer<'de>>(table: D) -> Result<Option<FoodConfig>, D::Error> {
    let given = Option::<Given>::deserialize(table)?;
    given.map(|given| given.over(&FOODS)).transpose().map_err(D::Error::custom)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn arch(teeth: &TeethConfig) -> Vec<ToothConfig> {
        teeth.arch(&JawConfig::default())
    }

    #[test]
    fn the_default_arch_goes_through_the_incisal_point_and_both_first_molars() {
        let arch = arch(&TeethConfig::default());
        let numbers: Vec<_> = arch.iter().map(|tooth| tooth.number).collect();
        assert_eq!(numbers, [31, 32, 33, 34, 35, 36, 37, 41, 42, 43, 44, 45, 46, 47]);
        let of = |number: u8| arch.iter().find(|tooth| tooth.number == number).unwrap().point_m;
        assert_eq!(
            [of(36), of(46)].map(|place_m| format!("{place_m:?}")),
            ["[0.0024, 0.0248, 0.0]", "[0.0024, -0.0248, 0.0]"]
        );
        let incisal = JawConfig::default().reference_point_m;
        assert!((of(31)[0] - incisal[0]).abs() < 5e-4 && of(31)[1] < 4e-3, "{:?}", of(31));
        // The distance of neighbours is about the mean of their widths.
        let distance_m = |a: u8, b: u8| {
            let squares = of(a).into_iter().zip(of(b)).map(|(a, b)| (a - b) * (a - b));
            squares.sum::<f64>().sqrt()
        };
        assert!((distance_m(36, 37) - 10.75e-3).abs() < 1e-3, "{}", distance_m(36, 37));
        assert!((distance_m(33, 34) - 7e-3).abs() < 0.7e-3, "{}", distance_m(33, 34));
    }

    #[test]
    fn a_tooth_is_missing_moved_or_added() {
        let moved = ToothConfig { number: 33, point_m: [0.02, 0.015, 0.001], normal: [0.3, 0.0, 1.0] };
        let wisdom = ToothConfig { number: 38, point_m: [-0.018, 0.03, 0.0], ..moved };
        let teeth = TeethConfig { missing: vec![46], tooth: vec![moved, wisdom], ..TeethConfig::default() };
        teeth.validate().unwrap();
        let arch = arch(&teeth);
        assert_eq!(arch.len(), 14);
        assert!(arch.contains(&moved) && arch.contains(&wisdom));
        assert!(!arch.iter().any(|tooth| tooth.number == 46));
    }

    #[test]
    fn every_kind_has_its_name_a_source_and_valid_values() {
        let arch = TeethConfig::default().arch(&JawConfig::default());
        for (name, text) in FOODS {
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
