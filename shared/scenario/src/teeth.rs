//! The lower teeth and their contact with the upper ones: `[teeth]`.
//!
//! The default arch is a parabola through the incisal point and both first molars. Teeth stand along it by their
//! mesiodistal widths.

use serde::{Deserialize, Serialize};

use super::error::ScenarioError;
use super::jaw::JawConfig;
use super::need::{keyed, require_within};

/// The default first molar on the left, platform frame, m: ArtiSynth's jaw, scaled to the paper's platform.
const FIRST_MOLAR_M: [f64; 3] = [0.0024, 0.0248, 0.0];
/// Teeth of a side from the middle on, by the last digit of their FDI numbers, without third molars.
const BY_SIDE: usize = 7;
/// Places of their centres along the arch, as shares of the way from the incisal point to the first molar: by the mean
/// mesiodistal widths of lower teeth, 5, 5.5, 7, 7, 7, 11, 10.5 mm (dental anatomy, recalled).
const ALONG_ARCH: [f64; BY_SIDE] =
    [2.5 / 37.0, 7.75 / 37.0, 14.0 / 37.0, 21.0 / 37.0, 28.0 / 37.0, 1.0, 47.75 / 37.0];
/// The tens of the FDI numbers of the lower teeth, left then right.
const QUADRANTS: [u8; 2] = [30, 40];
/// Steps in which the length of the arch is summed.
const STEPS: usize = 1000;

/// Room for the contact of this many pairs of teeth: all lower ones.
pub const MOST_PAIRS: usize = 16;

/// A lower tooth and its antagonist.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ToothConfig {
    /// FDI number: 31 to 38 on the left, 41 to 48 on the right.
    pub number: u8,
    /// Where the lower tooth meets its antagonist in the closed mouth, platform frame, m.
    pub point_m: [f64; 3],
    /// Normal of the face on which they meet, from the lower tooth to its antagonist, platform frame of the closed mouth. That
    /// of the occlusal plane when absent; a cusp leans it.
    #[serde(default = "occlusal")]
    pub normal: [f64; 3],
}

const fn occlusal() -> [f64; 3] {
    [0.0, 0.0, 1.0]
}

section! {
    /// The lower arch, and the contact of its teeth with their antagonists.
    pub struct TeethConfig {
        /// FDI numbers of the lower teeth that the jaw lacks.
        pub missing: Vec<u8> = Vec::new(),
        /// Distance of the teeth from their antagonists in the closed mouth, m; below 0 they are pressed together there.
        pub clearance_m: f64 = 1e-4,
        /// Stiffness of a tooth in its ligament under small forces, N/m.
        pub soft_n_per_m: f64 = 2e5,
        /// Force up to which that holds, N.
        pub soft_up_to_n: f64 = 4.0,
        /// Stiffness under larger forces, N/m.
        pub stiff_n_per_m: f64 = 2e6,
        /// Damping of Hunt and Crossley: growth of the force by the speed of compression, s/m.
        pub damping_s_per_m: f64 = 2.5,
        /// Friction of enamel on enamel.
        pub friction: f64 = 0.23,
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

    pub(super) fn validate(&self) -> Result<(), ScenarioError> {
        let numbers = self.tooth.iter().map(|tooth| ("teeth.tooth.number", tooth.number));
        let missing = self.missing.iter().map(|number| ("teeth.missing", *number));
        let is_lower = |number: u8| (31..=38).contains(&number) || (41..=48).contains(&number);
        if let Some((key, number)) = numbers.chain(missing).find(|(_, number)| !is_lower(*number)) {
            return Err(ScenarioError::bad(
                key,
                &number,
                "use an FDI number of a lower tooth: 31 to 38, 41 to 48",
            ));
        }
        for (place, tooth) in self.tooth.iter().enumerate() {
            let check = || {
                if self.tooth[..place].iter().any(|other| other.number == tooth.number) {
                    let need = "give each tooth one place";
                    return Err(ScenarioError::bad("teeth.tooth.number", &tooth.number, need));
                }
                require_within(&tooth.point_m.map(|m| ("teeth.tooth.point_m", m, -0.5, 0.5)))?;
                // A steeper face would catch the tooth on its way up.
                require_within(&[("teeth.tooth.normal", tooth.rise(), 0.5, 1.0)])
            };
            check().map_err(|error| error.of_entry(place))?;
        }
        let bounds = [(-5e-4, 0.02), (1e3, 1e7), (0.0, 100.0), (1e3, 1e7), (0.0, 20.0), (0.0, 2.0)];
        let values = keyed!(
            "teeth", self, clearance_m soft_n_per_m soft_up_to_n stiff_n_per_m damping_s_per_m friction
        );
        let within =
            values.into_iter().zip(bounds).map(|((key, value), (least, most))| (key, value, least, most));
        require_within(&within.collect::<Vec<_>>())
    }
}

impl ToothConfig {
    /// The vertical part of its normal, of a length of 1.
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
    // By the distance from the middle as a share of the first molar's.
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
        for (digit, aside) in (1..).zip(distances) {
            arch.push(ToothConfig {
                number: quadrant + digit,
                point_m: point(aside, side),
                normal: occlusal(),
            });
        }
    }
    arch
}

/// How far aside each tooth stands, as a share of the first molar's distance from the middle: where the arch has the tooth's
/// length.
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
        // Neighbours are about as far apart as their widths together, halved.
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
}
