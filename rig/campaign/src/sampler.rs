//! Samplers: points of the unit cube, one coordinate a factor.

use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use serde::{Deserialize, Serialize};

/// How the points of a campaign are chosen.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Sampler {
    /// Every combination of the levels.
    #[default]
    Grid,
    /// Independent points.
    Random,
    /// Random points of which every slice of a factor has one.
    LatinHypercube,
    /// The Sobol sequence, scrambled by the seed: even in all factors together.
    Sobol,
}

impl Sampler {
    /// The most points of a Sobol sequence.
    pub const MOST_SOBOL: usize = 1 << 16;
    /// The most factors of a Sobol sequence.
    pub const MOST_SOBOL_FACTORS: usize = 256;
}

/// The points of a sampler, each in \[0, 1)ⁿ. `levels` has the number of levels of every factor, for the grid alone; `runs` is
/// the number of points of the others.
pub fn points(sampler: Sampler, levels: &[usize], runs: usize, seed: u64) -> Vec<Vec<f64>> {
    let mut random = Pcg64::seed_from_u64(seed);
    match sampler {
        Sampler::Grid => grid(levels),
        Sampler::Random => (0..runs).map(|_| levels.iter().map(|_| random.random()).collect()).collect(),
        Sampler::LatinHypercube => latin_hypercube(levels.len(), runs, &mut random),
        Sampler::Sobol => (0..runs)
            .map(|number| {
                let coordinate =
                    |at: usize| f64::from(sobol_burley::sample(number as u32, at as u32, seed as u32));
                (0..levels.len()).map(coordinate).collect()
            })
            .collect(),
    }
}

/// The middle of every level, in the order of an odometer: the last factor changes first.
fn grid(levels: &[usize]) -> Vec<Vec<f64>> {
    levels.iter().fold(vec![Vec::new()], |begun, &count| {
        let extended = begun.iter().flat_map(|point| {
            (0..count).map(move |level| {
                let middle = (level as f64 + 0.5) / count as f64;
                point.iter().copied().chain([middle]).collect()
            })
        });
        extended.collect()
    })
}

fn latin_hypercube(factors: usize, runs: usize, random: &mut Pcg64) -> Vec<Vec<f64>> {
    let columns: Vec<Vec<f64>> = (0..factors)
        .map(|_| {
            let mut slices: Vec<usize> = (0..runs).collect();
            slices.shuffle(random);
            slices.into_iter().map(|slice| (slice as f64 + random.random::<f64>()) / runs as f64).collect()
        })
        .collect();
    (0..runs).map(|run| columns.iter().map(|column| column[run]).collect()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const THREE: [usize; 3] = [2, 3, 1];

    #[test]
    fn a_grid_has_every_combination_once() {
        let all = points(Sampler::Grid, &THREE, 0, 1);
        assert_eq!(all.len(), 6);
        assert_eq!(all[0], [0.25, 0.5 / 3.0, 0.5]);
        assert_eq!(all[5], [0.75, 2.5 / 3.0, 0.5]);
        assert_eq!(points(Sampler::Grid, &[], 0, 1), [Vec::<f64>::new()]);
    }

    #[test]
    fn every_slice_of_a_latin_hypercube_has_one_point() {
        let all = points(Sampler::LatinHypercube, &THREE, 20, 7);
        for factor in 0..3 {
            let mut slices: Vec<_> = all.iter().map(|point| (point[factor] * 20.0) as usize).collect();
            slices.sort_unstable();
            assert_eq!(slices, (0..20).collect::<Vec<_>>());
        }
    }

    #[test]
    fn a_sobol_sequence_has_one_point_in_every_square_of_a_power_of_two() {
        let all = points(Sampler::Sobol, &[1, 1], 16, 3);
        let mut squares: Vec<_> =
            all.iter().map(|point| (point[0] * 4.0) as usize * 4 + (point[1] * 4.0) as usize).collect();
        squares.sort_unstable();
        assert_eq!(squares, (0..16).collect::<Vec<_>>());
    }

    #[test]
    fn a_seed_gives_the_same_points_and_another_seed_others() {
        for sampler in [Sampler::Random, Sampler::LatinHypercube, Sampler::Sobol] {
            let of_seed = |seed| points(sampler, &THREE, 10, seed);
            assert_eq!(of_seed(1), of_seed(1));
            assert_ne!(of_seed(1), of_seed(2));
            assert!(of_seed(1).iter().flatten().all(|u| (0.0..1.0).contains(u)));
        }
    }
}
